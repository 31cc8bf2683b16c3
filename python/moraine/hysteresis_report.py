"""The report of the study hysteresis: a shear stress that is held while the water's pressure rises until the bed slips, and falls again until it stops.

A cycle goes from one smallest pressure at the top to the next. Effective stress is the normal stress asked for less the pressure at the top."""
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from . import dilatancy, measure, shearing, study_runs
from .results import MissingData
from .intervals import mean_interval, show
from .page import LeftOut, Page, machine, version
from .style import lines, page as page_width, panel, plt

slipping = 0.05     # bed heights a second: a bed that shears faster slips, else it creeps or rests
over = 0.1          # s, over which velocities are means
onset = 0.25        # of strain: of the first slip, over which Taylor's relation is looked at


@dataclass
class Slip:
    """One slip of a cycle: that with the largest velocity."""
    cycle: int
    start: float            # s
    stop: float
    pressure_start: float   # Pa, at the top
    pressure_stop: float
    friction_start: float   # shear stress over effective stress, both as asked for
    friction_stop: float
    slip: float             # bed heights
    fastest: float          # bed heights a second


class Run(study_runs.Run):
    def __init__(self, case):
        super().__init__(case)
        self.t = self.rows["stage_time"]
        if "wall_water_pressure" not in self.rows:
            raise MissingData(f"{case.directory}: there is no pore water")
        self.pressure = self.rows["wall_water_pressure"]  # of a drained top: the one asked for
        tau = self.settings["shear_stress"]
        self.tau = tau["ramp"][1] if isinstance(tau, dict) else tau  # held after a ramp

    @cached_property
    def velocity(self):
        """Bed heights a second, means over `over`."""
        x = self.rows["shear_strain"]
        low, high = np.maximum(self.t - over / 2, self.t[0]), np.minimum(self.t + over / 2, self.t[-1])
        return (np.interp(high, self.t, x) - np.interp(low, self.t, x)) / (high - low)

    @property
    def friction_asked(self):
        return self.tau / (self.sigma_0 - self.pressure)

    @cached_property
    def cycles(self):
        """(first, last row) of each, between one smallest pressure and the next."""
        turn = np.flatnonzero(np.diff(np.sign(np.diff(self.pressure))) > 0) + 1
        return list(zip([0, *turn], [*turn, len(self.t) - 1]))

    @property
    def rise(self):
        """Of the pressure at the top in the first half of the first cycle, Pa/s."""
        first, last = self.cycles[0]
        top = first + int(np.argmax(self.pressure[first:last + 1]))
        return (self.pressure[top] - self.pressure[first]) / (self.t[top] - self.t[first])

    def slips(self):
        """The largest slip of each cycle; none where the bed does not come to `slipping`."""
        found = []
        for k, (first, last) in enumerate(self.cycles):
            own = slice(first, last + 1)
            t, v, p = self.t[own], self.velocity[own], self.pressure[own]
            best = int(np.argmax(v))
            if v[best] < slipping:
                continue
            slow = np.flatnonzero(v < slipping)
            before, after = slow[slow < best], slow[slow > best]
            start, stop = (before[-1] + 1 if len(before) else 0), (after[0] if len(after) else len(t) - 1)
            x, friction = self.rows["shear_strain"][own], self.friction_asked[own]
            found.append(Slip(k + 1, t[start], t[stop], p[start], p[stop], friction[start], friction[stop], x[stop] - x[start], v[best]))
        return found

    def until_first_slip(self):
        """As far as `onset` of strain, for Taylor's relation: later the bed flows, and inertia counts."""
        return SimpleNamespace(series=first_rows(self.rows))

    def measured(self):
        rows = []
        for s in self.slips():
            rows.append({"case": self.name, "seed": self.seed, "rise_kPa_s": self.rise / 1e3, "cycle": s.cycle, "pressure_start_kPa": s.pressure_start / 1e3,
                         "pressure_stop_kPa": s.pressure_stop / 1e3, "difference_kPa": (s.pressure_start - s.pressure_stop) / 1e3, "friction_start": s.friction_start,
                         "friction_stop": s.friction_stop, "slip_H": s.slip, "fastest_H_s": s.fastest, "time_start_s": s.start, "time_stop_s": s.stop,
                         "porosity_0": shearing.porosity_0(self.rows), "height_0_m": self.height_0, "hours": measure.hours(self.case) if s.cycle == 1 else 0.0})
        return rows


def first_rows(rows):
    """Up to the first that has come to a strain of `onset`."""
    far = np.flatnonzero(rows["shear_strain"] > onset)
    return rows.rows(slice(far[0] if len(far) else len(rows)))


def load(study, note):
    runs = study_runs.load(study, Run, note)
    return sorted(runs, key=lambda r: (-r.rise, r.name, r.seed))


def values(rows, key):
    return np.array([r[key] for r in rows], float)


def shown(rows, key, digits):
    return show(*mean_interval(values(rows, key)), digits) if rows else "-"


def label(rise):
    return f"{rise / 1e3:.2g} kPa/s"


def slip_table(runs, rows):
    """A line for each rise and cycle: where it starts and stops."""
    keys = {"pressure_start_kPa": ("starts at (kPa)", 2), "pressure_stop_kPa": ("stops at (kPa)", 2), "difference_kPa": ("later by (kPa)", 2),
            "friction_start": ("friction asked for at the start", 3), "friction_stop": ("at the stop", 3), "slip_H": ("slip (bed heights)", 2), "fastest_H_s": ("fastest (1/s)", 2)}
    table = []
    for name, own in study_runs.grouped(runs, lambda r: r.name).items():
        for cycle in range(1, max(len(r.cycles) for r in own) + 1):
            mine = [r for r in rows if r["case"] == name and r["cycle"] == cycle]
            table.append([label(np.mean([r.rise for r in own])), cycle, f"{len(mine)} of {len(own)}", *(shown(mine, k, digits) for k, (_, digits) in keys.items())])
    return ["pressure rises by", "cycle", "beds that slip", *(name for name, _ in keys.values())], table


def looks(runs):
    names = list(dict.fromkeys(r.name for r in runs))
    return dict(zip(names, [x["color"] for x in lines(len(names))]))


def time_figure(runs):
    """Pressure, velocity, slip and height against time: a column for each case, a line for each packing."""
    names = list(dict.fromkeys(r.name for r in runs))
    figure, axes = plt.subplots(4, len(names), figsize=(page_width, 5.6), sharex="col", sharey="row", squeeze=False, gridspec_kw={"hspace": 0.24, "wspace": 0.08})
    for column, name in zip(axes.T, names):
        own = [r for r in runs if r.name == name]
        for r, look in zip(own, lines(len(own))):
            pressure, speed, slip, height = column
            if r is own[0]:
                pressure.plot(r.t, r.pressure / 1e3, color="0.3", lw=0.9)
            speed.semilogy(r.t, np.maximum(r.velocity, 1e-5), color=look["color"], lw=0.6)
            slip.semilogy(r.t, np.maximum(r.rows["shear_strain"], 1e-4), color=look["color"], lw=0.8)
            height.plot(r.t, r.rows["dilation_diameters"], color=look["color"], lw=0.6)
            for s in r.slips():
                pressure.plot(s.start, s.pressure_start / 1e3, "^", ms=3.5, color="tab:red", mew=0)
                pressure.plot(s.stop, s.pressure_stop / 1e3, "v", ms=3.5, color="tab:blue", mew=0)
        speed.axhline(slipping, color="0.6", lw=0.5, zorder=0)
        pressure.set_title(label(np.mean([r.rise for r in own])), fontsize=8)
        height.set_xlabel("time (s)")
        height.set_xlim(0, own[0].t[-1])
    for ax, text in zip(axes[:, 0], ("pressure at\nthe top (kPa)", "shear rate (1/s)", "strain", "dilation\n(diameters)")):
        ax.set_ylabel(text)
    figure.align_ylabels()
    for ax, letter in zip(axes.flat, "abcdefgh"):
        panel(ax, letter)
    return figure


def loop_figure(runs):
    """Shear rate against the friction that is asked for: up and down."""
    names = list(dict.fromkeys(r.name for r in runs))
    figure, axes = plt.subplots(1, len(names), figsize=(page_width, 3.0), sharey=True, squeeze=False, gridspec_kw={"wspace": 0.08})
    for ax, name in zip(axes[0], names):
        own = [r for r in runs if r.name == name]
        for r in own:
            for first, last in r.cycles:
                top = first + int(np.argmax(r.pressure[first:last + 1]))
                for part, colour in ((slice(first, top + 1), "tab:red"), (slice(top, last + 1), "tab:blue")):
                    ax.semilogy(r.friction_asked[part], np.maximum(r.velocity[part], 1e-5), color=colour, lw=0.5, alpha=0.8)
        ax.axhline(slipping, color="0.6", lw=0.5, zorder=0)
        ax.set(xlabel="shear stress over effective stress", title=label(np.mean([r.rise for r in own])))
    axes[0, 0].set_ylabel("shear rate (1/s)")
    handles = [plt.Line2D([], [], color=c, label=n) for c, n in (("tab:red", "pressure rises"), ("tab:blue", "pressure falls"))]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=2)
    for ax, letter in zip(axes[0], "ab"):
        panel(ax, letter)
    return figure


captions = {
    "time": "Pressure at the top, shear rate, strain and dilation against time; a line for each packing. Triangles: where the largest slip of a cycle starts (red) and stops (blue). "
            f"Thin line: the rate of {slipping:g} 1/s above which a bed is said to slip.",
    "loop": "Shear rate against shear stress over effective stress, all packings and cycles: the bed slips later than it stops. Rates below 1e-5 1/s are drawn there.",
    "taylor": dilatancy.caption,
}


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, figures/, report.html, report.md to `output`."""
    output, note = Path(output), LeftOut(say)
    made_by = version()
    runs = load(study, note)
    output.mkdir(parents=True, exist_ok=True)
    rows = [row for r in runs for row in r.measured()]
    measure.table(rows, output / "measurements.csv")
    settings, first = runs[0].case.settings, runs[0]
    groups = {label(np.mean([r.rise for r in own])): [r.until_first_slip() for r in own] for own in study_runs.grouped(runs, lambda r: r.name).values()}
    page = Page()
    page.heading("A shear stress held, a water pressure that rises and falls: where slip starts and stops", 1)
    page.paragraph(f"{len(runs)} runs of {settings['grains']['count']:,} grains: seeds {', '.join(map(str, sorted({r.seed for r in runs})))}, preset {settings['model'].get('preset')}. Total normal stress "
                   f"{first.sigma_0 / 1e3:g} kPa, shear stress {first.tau / 1e3:g} kPa; pressure at the top {first.pressure.min() / 1e3:.3g} to {first.pressure.max() / 1e3:.3g} kPa, in straight ramps up and down. "
                   f"{sum(measure.hours(r.case) for r in runs):.2f} hours of runs. This report: version {made_by}, on {machine()}, {date.today()}.")
    page.paragraph(f"A bed slips while it shears faster than {slipping:g} bed heights a second, mean over {over:g} s; of each cycle its fastest slip counts. Friction asked for is shear stress over normal stress less "
                   "pressure at the top. ± is half of a 95 % interval over the packings.")
    page.heading("Where slip starts and stops")
    page.table(*slip_table(runs, rows))
    if rows:
        later = values(rows, "difference_kPa")
        page.paragraph(f"Slip starts at a higher pressure than it stops in {int((later > 0).sum())} of {len(later)} slips.")
    dilatancy.add(page, groups)
    page.paragraph(f"Of the first slip, up to a strain of {onset:g}: later the bed flows so fast that inertia counts.")
    for why in note:
        page.paragraph(why)
    if notes:
        page.notes(Path(notes).read_text())
    page.figures({"time": lambda: time_figure(runs), "loop": lambda: loop_figure(runs), "taylor": lambda: dilatancy.figure(groups)}, captions, output / "figures")
    page.write(output, "Hysteresis of slip, with Moraine")
    say(str(output / "report.html"))
    for line in slip_table(runs, rows)[1]:
        say("  " + "  ".join(map(str, line)))
