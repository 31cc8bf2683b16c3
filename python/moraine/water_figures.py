"""Figures of beds with pore water. Each function takes stages and gives a Matplotlib figure.

Pressures are those over hydrostatic. Curves are smoothed over a shear strain of 0.01. Total friction is shear stress over what grains and
water together press on the top wall; in a dry bed that is the shear friction."""
import numpy as np

from . import shearing, strength
from .results import MissingData
from .style import lines, page, panel, plt

width = 0.01    # of shear strain, over which curves are smoothed


def total_friction(rows, wet):
    """`wet`: whether the stage of these rows has water; a dry stage of a wet case has the column, but nothing in it."""
    return rows["total_friction" if wet else "shear_friction"]


def curve(rows, values):
    """Strain and smoothed values, with the first row as it is; rows too few to be smoothed stay as they are."""
    strain = rows["shear_strain"]
    mean = strength.smoothed(strain, values, width)
    known = np.isfinite(mean)
    if not known.any():
        return strain, values
    return np.r_[strain[0], strain[known]], np.r_[values[0], mean[known]]


def course_curve(stage, pick):
    """The same of a stage and those that it is drawn with (shearing.drawn); pick(rows) gives the values."""
    return (np.concatenate(parts) for parts in zip(*(curve(rows, pick(rows)) for rows in shearing.drawn(stage))))


def unit_of(pressures):
    """Name and size of the unit that suits these pressures (Pa)."""
    largest = np.max(np.abs(pressures), initial=0.0)
    return ("MPa", 1e6) if largest >= 1e6 else ("kPa", 1e3) if largest >= 1e3 else ("Pa", 1.0)


def pressure_label(unit):
    return f"pressure, shear zone ({unit})"


def shear(stages, labels):
    """Stages beside each other, such as a wet one and its dry twin: total friction, friction of the grains, pressure, dilation."""
    figure, axes = plt.subplots(2, 2, figsize=(page, 4.4), sharex=True, gridspec_kw={"hspace": 0.2, "wspace": 0.26})
    (total, grains), (pressure, dilation) = axes
    loop = any(shearing.is_loop(s) for s in stages)
    wet = [rows for s in stages if s.wet for rows in shearing.drawn(s)]
    unit, size = unit_of(np.concatenate([r["water_pressure_mean"] for r in wet]) if wet else [0.0])
    highest = 0.0
    for stage, label, colour in zip(stages, labels, plt.rcParams["axes.prop_cycle"].by_key()["color"]):
        look = {"color": colour, "linestyle": "-" if stage.wet else "--", "label": label or None}
        strain, friction = course_curve(stage, lambda rows: total_friction(rows, stage.wet))
        highest = max(highest, friction.max())
        total.plot(strain, friction, **look)
        grains.plot(*course_curve(stage, lambda rows: rows["shear_friction"]), **look)
        dilation.plot(*course_curve(stage, lambda rows: rows["dilation_diameters"]), **look)
        if stage.wet:
            pressure.plot(*course_curve(stage, lambda rows: rows["water_pressure_mean"] / size), **look)
    if loop:
        for ax in (total, grains):
            ax.axhline(0, color="0.6", lw=0.5, zorder=0)
    elif highest > 5:
        total.set_yscale("log")
        total.set_ylim(0.1)
    else:
        total.set_ylim(0)
    total.set_ylabel("total friction $\\tau/\\sigma$")
    grains.set_ylabel("friction of the grains $\\tau/\\sigma'$")
    if not loop:
        grains.set_ylim(0), total.set_xlim(0)
    pressure.set_ylabel(pressure_label(unit))
    dilation.set_ylabel("dilation (diameters)")
    for ax in (pressure, dilation):
        ax.axhline(0, color="0.6", lw=0.5, zorder=0)
        ax.set_xlabel("shear strain $\\gamma$")
    if any(labels):
        total.legend(loc="best")
    figure.align_ylabels()
    for ax, letter in zip(axes.flat, "abcd"):
        panel(ax, letter)
    return figure


def pressure_field(stage):
    """Of the snapshots with water: stage times (s), heights of the grid (m), and the mean pressure of each level of cells (Pa),
    a row for each snapshot, from the floor up."""
    times, heights, levels = [], [], []
    for snapshot in stage.snapshots:
        try:
            (_, _, count), size = snapshot.water_grid
        except MissingData:
            continue
        times.append(snapshot.stage_time)
        heights.append(size[2])
        levels.append(snapshot.water["pressure"].reshape(count, -1).mean(axis=1))
    if len(times) < 2:
        raise MissingData(f"{stage.case.output}/snapshots: fewer than two snapshots of stage {stage.name} hold water")
    if len({len(p) for p in levels}) > 1:
        raise MissingData(f"{stage.case.output}/snapshots: the water's grid changes its number of levels within stage {stage.name}")
    return np.array(times), np.array(heights), np.array(levels)


def pressure(stage):
    """Pressure with depth and time, and profiles at some of these times."""
    times, heights, levels = pressure_field(stage)
    unit, size = unit_of(levels)
    levels = levels / size
    reach = np.abs(levels).max() or 1.0
    figure, (field, profiles) = plt.subplots(1, 2, figsize=(page, 2.8), sharey=True, layout="constrained", width_ratios=(1.8, 1))

    middle = (times[1:] + times[:-1]) / 2
    edges = np.r_[times[0], middle, times[-1]]  # each snapshot stands for the time around it
    depth = np.linspace(1, 0, levels.shape[1] + 1)[:, None] * np.interp(edges, times, heights)
    mesh = field.pcolormesh(np.broadcast_to(edges, depth.shape), depth, levels.T, cmap="RdBu_r", vmin=-reach, vmax=reach, rasterized=True)
    figure.colorbar(mesh, ax=field, label=f"water pressure ({unit})", pad=0.02)
    field.set_xlabel("time since the stage began (s)")
    field.set_ylabel("depth below the top wall (m)")
    field.set_ylim(heights.max(), 0)
    rows = shearing.along(stage).series
    if stage.kind == "shear" and rows["stage_time"][-1] > 0:  # at an even rate
        rate = rows["shear_strain"][-1] / rows["stage_time"][-1]
        if rate > 0:
            field.secondary_xaxis("top", functions=(lambda t: t * rate, lambda g: g / rate)).set_xlabel("shear strain $\\gamma$")

    some = np.unique(np.linspace(0, len(times) - 1, 6).round().astype(int)[1:])
    for k, look in zip(some, lines(len(some))):
        centres = (np.arange(levels.shape[1], 0, -1) - 0.5) / levels.shape[1] * heights[k]
        profiles.plot(levels[k], centres, ms=3, mew=0.6, mfc="white", label=f"{times[k]:.3g} s", **look)
    profiles.axvline(0, color="0.6", lw=0.5, zorder=0)
    profiles.set_xlabel(f"water pressure ({unit})")
    profiles.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    field.text(-0.12, 1.02, "(a)", transform=field.transAxes, fontweight="bold", ha="right")
    panel(profiles, "b")
    return figure
