"""Taylor's relation (strength.py) on the curves of a study, for any report: a table and a figure.

`groups` is {name: [stages]} throughout: of runs that differ in their packing alone."""
import numpy as np

from . import strength, style
from .results import MissingData
from .intervals import mean_interval, show
from .style import ink, lines, panel, plt

step = 0.005    # of strain, between the points of mean curves
head = ["runs", "number", "peak friction", "dilation rate at the peak", "critical friction", "left over at the peak", "left over, r.m.s."]
told = ("Taylor's relation is friction = μ_cs + dε_v/dγ: the work of shear that friction at the critical state does not take lifts the bed. Friction and dilation rate are of "
        f"windows of {strength.window:g} of strain, dilation is over the height of the bed; μ_cs is the mean of friction less dilation rate over the last third of the strain. ± as above.")
caption = ("Taylor's relation: (a) friction less dilation rate, means over the packings, which would stay at the critical friction (thin lines) where the relation holds; "
           "(b) friction above the critical at the peak against the dilation rate there, each run a point; on the line the relation holds.")


def curves(stages):
    """Taylor's relation of each of these; those too short for it are left out."""
    found = []
    for stage in stages:
        try:
            found.append(strength.taylor(stage))
        except MissingData:
            continue
    return found


def table(groups):
    """Lines for `head`."""
    rows = []
    for name, stages in groups.items():
        if not (own := curves(stages)):
            continue
        peak = [t.at_peak for t in own]
        rms = [np.sqrt(np.nanmean(t.residual**2)) for t in own]
        rows.append([name, len(own), *(show(*mean_interval([x[k] for x, k in zip(column, peak)]), 3) for column in ([t.friction for t in own], [t.rate for t in own])),
                     show(*mean_interval([t.mu_cs for t in own]), 3), show(*mean_interval([t.residual[k] for t, k in zip(own, peak)]), 3), f"{np.mean(rms):.3f}"])
    return rows


def add(page, groups):
    """Heading, what the relation is, and the table of a report."""
    page.heading("Stress and dilation: Taylor's relation")
    page.paragraph(told)
    page.table(head, table(groups))


def mean_curve(own, values):
    """Strain, and the mean over these curves of what `values` takes from each, as far as all reach."""
    known = [np.isfinite(values(t)) for t in own]
    low, high = max(t.strain[k][0] for t, k in zip(own, known)), min(t.strain[k][-1] for t, k in zip(own, known))
    if high - low < step:
        raise MissingData(f"sheared too little for windows of {strength.window:g} of strain")
    strain = np.arange(low, high, step)
    return strain, np.mean([np.interp(strain, t.strain[k], values(t)[k]) for t, k in zip(own, known)], axis=0)


def figure(groups):
    groups = {name: own for name, stages in groups.items() if (own := curves(stages))}
    if not groups:
        raise MissingData(f"no run is sheared by {strength.window:g} of strain")
    drawn, (left, right) = plt.subplots(1, 2, figsize=(style.page, 2.9), gridspec_kw={"wspace": 0.28, "width_ratios": (1.5, 1)})
    most, handles = 0.0, []
    for (name, own), look in zip(groups.items(), lines(len(groups))):
        strain, values = mean_curve(own, lambda t: t.friction - t.rate)
        left.plot(strain, values, color=look["color"], linestyle=look["linestyle"])
        left.axhline(np.mean([t.mu_cs for t in own]), color=look["color"], lw=0.4, zorder=0)
        handles.append(plt.Line2D([], [], label=name, ms=3.5, **look))
        rate, over = (np.array([x(t)[t.at_peak] for t in own]) for x in (lambda t: t.rate, lambda t: t.friction - t.mu_cs))
        right.plot(rate, over, ls="", color=look["color"], marker=look["marker"], ms=3.5)
        most = max(most, rate.max(), over.max())
    right.plot([0, 1.1 * most], [0, 1.1 * most], color=ink, lw=0.6, zorder=0)
    left.set(xlabel="shear strain $\\gamma$", ylabel="$\\tau/\\sigma' - d\\epsilon_v/d\\gamma$", xlim=(0, None))
    right.set(xlabel="$d\\epsilon_v/d\\gamma$ at the peak", ylabel="$\\tau/\\sigma' - \\mu_{cs}$ at the peak")
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.02), ncol=min(5, len(groups)))
    panel(left, "a"), panel(right, "b")
    return drawn
