"""The report of creep-2016: a bed under a constant shear stress while the water's pressure swings, beside what the original program
recorded (../shared/data/sphere-2016-cyclic-contacts.txt, where that is there: it is data of another project and not kept here).

Phase is time since a period began, s. The grains bear the total stress less the pressure at the top: most at a quarter of the period, least
at three quarters."""
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path

import numpy as np

from . import measure, style
from .results import Results, MissingData
from .page import LeftOut, Page, beside, machine, version
from .progress import duration
from .style import panel, plt

root = Path(__file__).resolve().parents[2]
original_file = root.parent / "shared/data/sphere-2016-cyclic-contacts.txt"
original_interval = 0.01                # s, between its records
phases = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 3.75, 4.0, 4.25, 4.5, 4.75)   # s, as levels are compared; a period is 5 s
tolerance = {True: 0.15, False: 0.3}    # of the coordination: where the grains bear more than the mean stress, and where less
loose = 1.0                             # a bed with fewer contacts per grain has burst loose


@dataclass
class Record:
    """Coordination against time; of a run of ours with the rest that is drawn."""
    name: str
    t: np.ndarray               # s
    coordination: np.ndarray    # contacts per grain
    period: float               # s

    @property
    def periods(self):
        return int(self.t[-1] / self.period + 0.01)

    def at(self, phase):
        """Coordination around this phase of each period after the first: median over 0.1 s."""
        times = self.period * np.arange(1, self.periods + 1) + phase
        own = [np.abs(self.t - time) < 0.05 for time in times]
        return np.array([np.median(self.coordination[o]) for o in own if o.any()])

    def level(self, phase):
        values = self.at(phase)
        return np.median(values) if len(values) else np.nan

    def bursts(self):
        """For each period, counted from its middle to that of the next, where a bed bursts loose: (period, from, to, lowest), phases in s of the
        period in which it began; from and to are those of the first and last record with less than `loose` contacts per grain, nan without any."""
        found = []
        for k in range(self.periods):
            own = (self.t >= (k + 0.5) * self.period) & (self.t < (k + 1.5) * self.period)
            t, z = self.t[own] - k * self.period, self.coordination[own]
            if not len(z) or t[-1] - t[0] < 0.6 * self.period:
                continue
            below = t[z < loose]
            found.append((k + 1, below[0] if len(below) else np.nan, below[-1] if len(below) else np.nan, z.min(), len(below) * np.median(np.diff(t))))
        return found


class Run:
    def __init__(self, case):
        self.case, self.seed = case, case.seed
        self.stage = next((s for s in case.stages if s.kind == "shear_stress"), None)
        if self.stage is None:
            raise MissingData(f"{case.output}/case.toml: no stage is driven by a shear stress")
        self.rows, self.settings = self.stage.series, self.stage.settings
        if not self.settings.get("top_pressure_frequency"):
            raise MissingData(f"{case.output}/case.toml: the pressure of stage {self.stage.name} does not swing")
        self.period = 1 / self.settings["top_pressure_frequency"]
        self.height = float(self.rows["height"][0])

    @property
    def done(self):
        return min(1.0, self.rows["stage_time"][-1] / duration(self.stage, self.height))

    @property
    def record(self):
        return Record(f"Moraine, seed {self.seed}", self.rows["stage_time"], self.rows["coordination"], self.period)

    @cached_property
    def velocity(self):
        """Of the driven layer, m/s: between one row and the next."""
        return np.gradient(self.rows["shear_strain"] * self.height, self.rows["stage_time"])

    def effective(self, phase):
        """Stress that the grains bear, Pa, at this phase, where the pressure in the bed is that of its top."""
        s = self.settings
        return s["normal_stress"] - s["top_pressure"] - s["top_pressure_amplitude"] * np.sin(2 * np.pi * phase / self.period + s["top_pressure_phase"])

    def by_period(self):
        """[(period, slip in bed heights, fastest m/s, height at its end over that at the start, porosity at its end)]"""
        t, lines = self.rows["stage_time"], []
        for k in range(self.record.periods):
            own = (t >= k * self.period) & (t <= (k + 1) * self.period + 1e-9)
            r = self.rows.rows(own)
            lines.append((k + 1, r["shear_strain"][-1] - r["shear_strain"][0], np.abs(self.velocity[own]).max(), r["height"].max() / self.height,
                          r["height"][-1] / self.height, r["porosity"][-1]))
        return lines


def original(period):
    """What the original program recorded, or None where its file is not there."""
    if not original_file.exists():
        return None
    table = np.loadtxt(original_file)
    return Record("original", original_interval * np.arange(1, table.shape[1] + 1), table[2], period)


def load(study, note):
    runs = []
    for file in sorted(Path(study).glob("seed-*/**/output/case.toml")):
        try:
            case = Results(file.parents[1])
            if not any(s.kind == "shear_stress" for s in case.stages):
                continue  # a bed
            run = Run(case)
            if run.record.periods < 1:
                raise MissingData("has not come to the end of its first period")
            if run.done < 0.999:
                note(f"{file.parents[1]}: has come to {100 * run.done:.0f} % of its time; what there is is shown")
            runs.append(run)
        except MissingData as why:
            note(f"left out: {file.parents[1]}: {why}")
    return runs


def level_rows(run, theirs):
    """[phase, effective stress (kPa), ours, theirs, difference, verdict] for the table of levels."""
    table = []
    for phase in phases:
        phase_here = phase * run.period / 5
        stress = run.effective(phase_here)
        ours, other = run.record.level(phase_here), theirs.level(phase_here) if theirs else np.nan
        allowed = tolerance[stress > run.settings["normal_stress"]]
        verdict = "" if not np.isfinite(ours - other) else "within" if abs(ours - other) <= allowed else "outside"
        table.append([f"{phase_here:g}", f"{stress / 1e3:.0f}", number(ours), number(other), number(ours - other, "+.2f"), f"{verdict} {allowed:g}" if verdict else "-"])
    return table


def number(value, form=".2f"):
    return f"{value:{form}}" if np.isfinite(value) else "-"


def burst_rows(records):
    """A line for each period: for each record from, to, time below, lowest."""
    bursts = [{b[0]: b[1:] for b in r.bursts()} for r in records]
    return [[k, *(text for b in bursts for text in (
        [f"{b[k][0]:.2f} to {b[k][1]:.2f} s" if np.isfinite(b[k][0]) else "none", f"{b[k][3]:.2f} s", f"{b[k][2]:.2f}"] if k in b else ["-"] * 3))]
            for k in sorted(set().union(*bursts))]


def overlay_figure(run, theirs):
    """Stress and pressure, velocity, coordination and height against time: all of it, and three periods."""
    t, rows, T = run.rows["stage_time"], run.rows, run.period
    figure, axes = plt.subplots(4, 2, figsize=(style.page, 6.4), sharex="col", sharey="row", gridspec_kw={"hspace": 0.16, "wspace": 0.06, "width_ratios": (1.5, 1)})
    first = T * max(0, min(4, run.record.periods - 3))
    for k, (stress, speed, contacts, height) in enumerate(axes.T):
        stress.plot(t, run.effective(t) / 1e3, color="0.3", lw=0.8, label="on the grains, if the pressure follows at once")
        stress.plot(t, rows["water_pressure_mean"] / 1e3, color="tab:blue", lw=0.6, label="water pressure, shear zone")
        speed.semilogy(t, np.maximum(np.abs(run.velocity), 1e-6), color="0.2", lw=0.5)
        if theirs:
            contacts.plot(theirs.t, theirs.coordination, color="tab:orange", lw=0.6, label="original")
        contacts.plot(t, rows["coordination"], color="0.15", lw=0.6, label="Moraine")
        height.plot(t, rows["height"] / run.height, color="0.2", lw=0.6)
        height.set_xlabel("time (s)")
        end = max(t[-1], theirs.t[-1] if theirs else 0)
        height.set_xlim((0, end) if k == 0 else (first, first + 3 * T))
        for ax in (stress, speed, contacts, height):
            for n in range(int(end / T) + 1):
                ax.axvline(n * T, color="0.9", lw=0.5, zorder=0)
    axes[0, 0].set_ylabel("kPa"), axes[1, 0].set_ylabel("layer (m/s)"), axes[2, 0].set_ylabel("contacts per grain")
    axes[3, 0].set_ylabel("height over $H_0$")
    axes[0, 1].legend(loc="upper right", fontsize=6), axes[2, 1].legend(loc="lower right")
    low, high = axes[0, 0].get_ylim()
    axes[0, 0].set_ylim(low, high + 0.4 * (high - low))  # room for the legend
    axes[2, 0].set_ylim(0), axes[1, 0].set_ylim(1e-6)
    figure.align_ylabels()
    for ax, letter in zip(axes.flat, "abcdefgh"):
        panel(ax, letter)
    return figure


def phase_figure(runs, theirs):
    """Coordination by phase: the median over the periods after the first, and the range of 80 % of them."""
    figure, ax = plt.subplots(figsize=(style.column * 1.5, 2.8))
    records = ([theirs] if theirs else []) + [r.record for r in runs]
    T = runs[0].period
    phase = np.linspace(0, T, 101)[:-1]
    for record, colour in zip(records, ["tab:orange", "0.15", "tab:blue", "tab:green"] if theirs else ["0.15", "tab:blue", "tab:green"]):
        values = [record.at(p) for p in phase]
        if not all(map(len, values)):
            continue
        low, middle, high = np.array([np.quantile(v, (0.1, 0.5, 0.9)) for v in values]).T
        ax.fill_between(phase, low, high, color=colour, alpha=0.2, lw=0)
        ax.plot(phase, middle, color=colour, lw=1, label=record.name)
    stress = ax.twinx()
    stress.plot(phase, runs[0].effective(phase) / 1e3, color="0.6", lw=0.7, ls="--")
    stress.set_ylabel("stress on the grains (kPa, dashed)")
    stress.spines.right.set_visible(True)
    ax.set_xlabel("time in the period (s)"), ax.set_ylabel("contacts per grain")
    ax.set_xlim(0, T), ax.set_ylim(0), ax.legend(loc="lower left")
    return figure


captions = {
    "overlay": "Stress on the grains and pressure of the water, velocity of the driven layer, contacts per grain beside those that the original program recorded, "
               "and height of the bed; left all of it, right three periods.",
    "phase": "Contacts per grain by phase: median over the periods after the first, and the range that holds 80 % of them.",
}


def variants_of(study, run):
    """{name: runs} of the studies beside this one with as many grains."""
    found = {}
    for other in beside(study):
        runs = [r for r in load(other, lambda _: None) if r.case.settings["grains"]["count"] == run.case.settings["grains"]["count"]]
        if runs:
            found[other.name] = runs
    return found


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes levels.csv, figures/, report.html, report.md to `output`."""
    output, note = Path(output), LeftOut(say)
    made_by = version()
    runs = load(study, note)
    if not runs:
        raise MissingData(f"{study}: there is no run to report" + "".join(f"; {w}" for w in note))
    output.mkdir(parents=True, exist_ok=True)
    run, settings = runs[0], runs[0].case.settings
    theirs = original(run.period)
    if theirs is None:
        note(f"the original's record is not here ({original_file.name}), so nothing is compared with it")
    page = Page()
    page.heading("Damsgaard et al. (2016), reproduced: creep and slip", 1)
    page.paragraph(f"{settings['grains']['count']} grains, preset {settings['model'].get('preset')} (stiffness divided by {settings['model'].get('softening', 1):g}), seeds "
                   f"{', '.join(str(r.seed) for r in runs)}; {run.settings['normal_stress'] / 1e3:g} kPa of total stress, driven by {run.settings['shear_stress'] / 1e3:g} kPa, pressure swinging by "
                   f"{run.settings['top_pressure_amplitude'] / 1e3:g} kPa every {run.period:g} s, {run.record.periods} periods. {sum(measure.hours(r.case) for r in runs):.1f} hours. "
                   f"This report: version {made_by}, on {machine()}, {date.today()}.")
    page.heading("Contacts per grain by phase")
    page.paragraph("Medians over the periods after the first. The grains bear the total stress less the pressure: most at 1.25 s, least at 3.75 s of 5 s. Asked for: within "
                   f"{tolerance[True]:g} where they bear more than the mean, within {tolerance[False]:g} where less.")
    levels = level_rows(run, theirs)
    page.table(["phase (s)", "stress on the grains (kPa)", "here", "original", "difference", "verdict"], levels)
    measure.table([{"phase_s": float(p), "effective_stress_kPa": float(e), "coordination": o, "original": t} for p, e, o, t, *_ in levels], output / "levels.csv")
    page.heading("Bursts")
    page.paragraph(f"A bed has burst loose where it has less than {loose:g} contact per grain; phases are counted on through the end of a period.")
    records = [run.record] + ([theirs] if theirs else [])
    page.table(["period", *(f"{name}: {what}" for name in ["here"] + (["original"] if theirs else []) for what in ("loose from, to", "for", "lowest"))], burst_rows(records))
    page.heading("What happens to the bed")
    page.table(["period", "slip (bed heights)", "fastest (m/s)", "highest (H_0)", "height at its end (H_0)", "porosity at its end"],
               [[k, f"{slip:.3g}", f"{fast:.3g}", f"{top:.3f}", f"{end:.3f}", f"{porosity:.3f}"] for k, slip, fast, top, end, porosity in run.by_period()])
    variants = variants_of(study, run)
    if variants:
        page.heading("Tests of causes")
        page.paragraph("Studies with other settings, named after them.")
        page.table(["settings", "periods", *(f"contacts at {p:g} s" for p in (1.0, 3.0, 4.0, 4.5)), "periods with a burst", "fastest (m/s)"],
                   [[name, own[0].record.periods, *(number(own[0].record.level(p * own[0].period / 5)) for p in (1.0, 3.0, 4.0, 4.5)),
                     sum(np.isfinite(b[1]) for b in own[0].record.bursts()), f"{max(x[2] for x in own[0].by_period()):.3g}"] for name, own in variants.items()])
    for why in note:
        page.paragraph(why.replace(f"{root}/", ""))
    if notes:
        page.notes(Path(notes).read_text())
    page.figures({"overlay": lambda: overlay_figure(run, theirs), "phase": lambda: phase_figure(runs, theirs)}, captions, output / "figures")
    page.write(output, "Damsgaard et al. (2016), reproduced with Moraine")
    say(str(output / "report.html"))
    for line in levels:
        say(f"  phase {line[0]} s: here {line[2]}, original {line[3]}")
