"""The report of hardening-2015: peak strength by rate beside what Damsgaard et al. (2015), The Cryosphere 9, 2183-2200, found.

A run is one of a packing (seed), a permeability factor k_c and a closure (full: water drags at the grains; pressure_gradient: it does not,
as in the original), or dry. Rates are relative: mu_f rate/k_c over that of the least permeable bed of the original, for where water is as
quick as here only this product counts."""
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path

import numpy as np

from . import measure, shearing, style, water_figures
from .results import Results, MissingData
from .intervals import compare, further_run, mean_interval, show
from .page import LeftOut, Page, beside, machine, version
from .progress import duration
from .style import lines, panel, plt

published = {0.01: 0.62, 0.1: 0.65, 1.0: 0.71}  # peak friction by relative rate, at 20 kPa; friction coefficient of the grains 0.5
published_stress = 20e3                         # Pa
viscosity, rate, k_c = 1.797e-6, 0.05, 3.5e-15  # Pa s, 1/s, m2: of the relative rate 1
peak_rows, peak_record, peak_strain = 20, 0.01, 0.2  # the original's peak: of a Hann window over 20 records of 0.01 s, up to this strain
late = 0.75     # of the strain: where the mean of the end begins
closures = {"full": "with drag", "pressure_gradient": "without drag, as theirs"}


@dataclass(frozen=True)
class Kind:
    """What runs that differ in their packing alone have in common."""
    closure: str        # empty: dry
    relative_rate: float


class Run:
    """A case that has been sheared, and what is read off it."""

    def __init__(self, case):
        self.case, self.seed = case, case.seed
        self.stage = shearing.along(case.stage("shear"))
        self.rows, self.wet = self.stage.series, self.stage.wet
        self.sigma_0 = self.stage.settings["normal_stress"]
        self.rate = abs(self.stage.settings["strain_rate"])
        water = case.settings.get("fluid", {})
        self.closure = water.get("closure", "full") if self.wet else ""
        self.mu_f, self.k_c = (water["viscosity"], water["permeability_factor"]) if self.wet else (0.0, np.inf)
        self.kind = Kind(self.closure, float(f"{self.mu_f * self.rate / self.k_c / (viscosity * rate / k_c):.3g}"))

    @property
    def done(self):
        """Share of the stage that has been computed."""
        return min(1.0, self.rows["stage_time"][-1] / duration(self.stage, shearing.height_0(self.rows)))

    @cached_property
    def friction(self):
        """Shear stress over the normal stress that was asked for."""
        return self.rows["shear_stress"] / self.sigma_0

    @cached_property
    def smooth(self):
        """Strain and friction as the original smooths it: a Hann window over `peak_rows` of its records."""
        interval = self.rows["stage_time"][2] - self.rows["stage_time"][1]
        width = max(3, round(peak_rows * peak_record * rate / (interval * self.rate)))
        window = np.hanning(width)
        strain = self.rows["shear_strain"]
        if len(strain) <= width:
            raise MissingData(f"{self.case.directory}: too few rows to be smoothed over {width}")
        return strain[width // 2:][:len(strain) - width + 1], np.convolve(self.friction, window / window.sum(), "valid")

    @property
    def _peak(self):
        strain, friction = self.smooth
        within = strain <= peak_strain
        best = int(np.argmax(friction[within]))
        return friction[within][best], strain[within][best]

    def _late(self, values):
        strain = self.rows["shear_strain"]
        return values[strain >= late * strain[-1]].mean()

    @property
    def group(self):
        """mu rate H^2/(k sigma_0), with height and Kozeny-Carman permeability of the bed when shear begins: the time the pressure takes to
        even out through the bed, over that in which dilation at the rate of shear would lower it by sigma_0."""
        if not self.wet:
            return 0.0
        phi, height = shearing.porosity_0(self.rows), shearing.height_0(self.rows)
        return self.mu_f * self.rate * height**2 / (self.k_c * phi**3 / (1 - phi)**2 * self.sigma_0)

    def measured(self):
        rows, (peak, strain) = self.rows, self._peak
        pressure = rows["water_pressure_mean"] if self.wet else np.zeros(len(rows))
        return {
            "seed": self.seed, "closure": self.closure or "dry", "k_c_m2": self.k_c, "relative_rate": self.kind.relative_rate, "group": self.group,
            "sigma_0_kPa": self.sigma_0 / 1e3, "strain": rows["shear_strain"][-1], "peak": peak, "strain_at_peak": strain,
            "peak_raw": self.friction[1:].max(), "friction_late": self._late(self.friction),
            "effective_friction_late": self._late(rows["shear_stress"]) / (self.sigma_0 - self._late(pressure)),
            "lowest_pressure_kPa": pressure.min() / 1e3, "pressure_late_kPa": self._late(pressure) / 1e3,
            "dilation_d": self._late(rows["dilation_diameters"]), "porosity_0": shearing.porosity_0(rows),
            "height_0_m": shearing.height_0(rows), "hours": measure.hours(self.case),
        }


def load(study, note):
    """Finished runs of a directory of runs, in order; the others are named."""
    runs = []
    for file in sorted(Path(study).glob("seed-*/**/output/case.toml")):
        case = None
        try:
            case = Results(file.parents[1])
            if not any(s.kind == "shear" for s in case.stages):
                continue  # a bed
            run = Run(case)
            if run.done < 0.999:
                raise MissingData(f"has come to {100 * run.done:.0f} % of its shear")
            runs.append(run)
        except MissingData as why:
            note(f"left out: {file.parents[1]}: {why}")
    return sorted(runs, key=lambda r: (r.closure, r.kind.relative_rate, r.seed))


def by_kind(rows):
    """{Kind: rows of it}; rows as Run.measured() has them."""
    kinds = {}
    for r in rows:
        kinds.setdefault(Kind("" if r["closure"] == "dry" else r["closure"], r["relative_rate"]), []).append(r)
    return kinds


def values(rows, key):
    return np.array([r[key] for r in rows], float)


def shown(rows, key, digits=2):
    return show(*mean_interval(values(rows, key)), digits) if rows else "-"


def peak_table(kinds):
    """Relative rate, published peak, ours with both closures, verdict, and what each has over its slowest or dry bed."""
    dry = kinds.get(Kind("", 0.0), [])
    dry_peak = values(dry, "peak").mean() if dry else np.nan
    table = []
    for relative in sorted({k.relative_rate for k in kinds if k.closure} | set(published)):
        line = [f"{relative:g}", f"{published[relative]:.2f}" if relative in published else "-"]
        for closure in closures:
            rows = kinds.get(Kind(closure, relative), [])
            verdict = ""
            if rows and relative in published:  # by logarithms, for the scatter goes with the level
                logarithms = np.log(values(rows, "peak"))
                verdict = ": " + compare(logarithms.mean(), np.log(published[relative]), further_run(logarithms) + 0.005 / published[relative])
            line.append(shown(rows, "peak") + verdict)
        ours = values(kinds.get(Kind("full", relative), []), "peak")
        line += [f"{published[relative] / published[min(published)]:.2f}" if relative in published else "-",
                 f"{ours.mean() / dry_peak:.2f}" if len(ours) and np.isfinite(dry_peak) else "-"]
        table.append(line)
    return table


def critical_table(kinds):
    return [[closures.get(kind.closure, "dry"), f"{kind.relative_rate:g}" if kind.closure else "-", len(rows), shown(rows, "friction_late", 3),
             shown(rows, "effective_friction_late", 3), shown(rows, "pressure_late_kPa"), shown(rows, "lowest_pressure_kPa", 1),
             shown(rows, "dilation_d"), shown(rows, "strain_at_peak", 3)] for kind, rows in kinds.items() if to_the_end(rows)]


def to_the_end(rows):
    """Whether they have been sheared beyond the peak: without drag they are not."""
    return min(r["strain"] for r in rows) > peak_strain


def critical_state(kinds):
    """In words, whether friction over the stress that the grains of the shear zone bear depends on the rate at the end: dry and with drag,
    packing by packing."""
    chosen = {k: {r["seed"]: r["effective_friction_late"] for r in rows} for k, rows in kinds.items() if k.closure in ("", "full") and to_the_end(rows)}
    common = set.intersection(*(set(v) for v in chosen.values())) if chosen else set()
    if len(chosen) < 2 or len(common) < 2:
        return "Whether the critical state depends on the rate cannot be told from so few runs."
    ordered = [chosen[k] for k in sorted(chosen, key=lambda k: k.relative_rate)]
    difference = np.array([ordered[-1][s] - ordered[0][s] for s in sorted(common)])
    mean, half = mean_interval(difference)
    equal = abs(mean) <= half
    return (f"Shear stress over what the grains of the shear zone bear, σ_0 less the pressure there, over the last {100 * (1 - late):.0f} % of the strain: at the highest rate it is "
            f"{mean:+.3f} ± {half:.3f} from that of the dry bed of the same packing, so {'no dependence on the rate is seen' if equal else 'it still depends on the rate'}.")


def average(runs, pick):
    """Strain and the mean over the runs of pick(run), at the strains of the first."""
    strain = runs[0].rows["shear_strain"]
    return strain, np.mean([np.interp(strain, r.rows["shear_strain"], pick(r)) for r in runs], axis=0)


def kinds_of(runs):
    kinds = {}
    for r in runs:
        kinds.setdefault(r.kind, []).append(r)
    return kinds


def curves_figure(runs):
    """Friction, pressure and dilation against strain: a column for each closure, a colour for each rate; a line for each packing."""
    kinds = kinds_of(runs)
    present = [c for c in closures if any(k.closure == c for k in kinds)]
    if not present:
        raise MissingData("no wet run has come to its end")
    rates = sorted({k.relative_rate for k in kinds if k.closure})
    colours = dict(zip(rates, (x["color"] for x in lines(len(rates)))))
    figure, axes = plt.subplots(3, len(present), figsize=(style.page, 6), sharex=True, sharey="row", squeeze=False,
                                gridspec_kw={"hspace": 0.12, "wspace": 0.08})
    for column, closure in zip(axes.T, present):
        for kind, own in kinds.items():
            if kind.closure not in ("", closure):
                continue
            look = {"color": colours.get(kind.relative_rate, "0.4"), "linestyle": "-" if kind.closure else (0, (3, 1.5))}
            for run in own:
                column[0].plot(*run.smooth, lw=0.6, alpha=0.8, **look)
                column[2].plot(run.rows["shear_strain"], run.rows["dilation_diameters"], lw=0.6, alpha=0.8, **look)
                if run.wet:
                    column[1].plot(*water_figures.curve(run.rows, run.rows["water_pressure_mean"] / 1e3), lw=0.6, alpha=0.8, **look)
        column[0].set_title(closures[closure], fontsize=8)
        column[1].axhline(0, color="0.6", lw=0.5, zorder=0)
        column[1].set_yscale("symlog", linthresh=1.0)
        for relative, peak in published.items():
            column[0].axhline(peak, color=colours.get(relative, "0.5"), lw=0.7, ls=":", zorder=0)
        column[2].set_xlabel("shear strain $\\gamma$")
    axes[0, 0].set_yscale("log")
    axes[0, 0].set_ylim(0.1), axes[0, 0].set_xlim(0)
    axes[0, 0].set_ylabel("friction $\\tau/\\sigma_0$"), axes[1, 0].set_ylabel("water pressure, shear zone (kPa)"), axes[2, 0].set_ylabel("dilation (diameters)")
    handles = [plt.Line2D([], [], color=c, label=f"relative rate {r:g}") for r, c in colours.items()]
    handles += [plt.Line2D([], [], color="0.4", ls=(0, (3, 1.5)), label="dry"), plt.Line2D([], [], color="0.5", ls=":", lw=0.7, label="published peaks")]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.05), ncol=len(handles))
    figure.align_ylabels()
    for ax, letter in zip(axes.flat, "abcdef"):
        panel(ax, letter)
    return figure


def peaks_figure(tables):
    """Peak friction, and that over the slowest or dry bed, against relative rate. tables: {label: rows}; the first are the study's own."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(style.page, 2.9), gridspec_kw={"wspace": 0.28})
    slow = published[min(published)]
    left.plot(list(published), list(published.values()), "k*-", lw=0.6, ms=6, label="published")
    right.plot(list(published), [p / slow for p in published.values()], "k*-", lw=0.6, ms=6)
    series = [(f"{label.partition('+')[2] or label}, {text}" if label else text, by_kind(rows), closure)
              for label, rows in tables.items() for closure, text in closures.items()]
    series = [s for s in series if any(k.closure == s[2] for k in s[1])]
    dry = {r["seed"]: r["peak"] for r in next(iter(tables.values())) if r["closure"] == "dry"}
    for (label, kinds, closure), look in zip(series, lines(len(series))):
        own = sorted((k.relative_rate, rows) for k, rows in kinds.items() if k.closure == closure)
        look |= {"ms": 4, "mew": 0.8, "mfc": "white"}
        means = [mean_interval(values(rows, "peak")) for _, rows in own]
        left.errorbar([r for r, _ in own], [m for m, _ in means], yerr=[np.nan_to_num(h) for _, h in means], label=label, capsize=2, lw=0.8, **look)
        ratios = [[r["peak"] / dry[r["seed"]] for r in rows if r["seed"] in dry] for _, rows in own]
        right.plot([r for (r, _), q in zip(own, ratios) if q], [np.mean(q) for q in ratios if q], lw=0.8, **look)
    if dry:
        left.axhline(np.mean(list(dry.values())), color="0.4", ls=(0, (3, 1.5)), lw=0.8, label="dry")
    right.axhline(1, color="0.6", lw=0.5, zorder=0)
    for ax in (left, right):
        ax.set_xscale("log"), ax.set_yscale("log"), ax.set_xlabel("relative rate")
        ticks = [0.5, 1, 2, 5, 10] if ax is left else [1, 2, 5, 10]
        low, high = ax.get_ylim()
        ticks = [t for t in ticks if low <= t <= high] or [round(high, 2)]
        ax.set_yticks(ticks, [f"{t:g}" for t in ticks]), ax.minorticks_off()
    left.set_ylabel("peak friction $\\tau/\\sigma_0$")
    right.set_ylabel("over that of the dry bed\n(published: of the slowest)")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.03), ncol=3)
    panel(left, "a"), panel(right, "b")
    return figure


captions = {
    "curves": "Friction (smoothed as the original's), mean pressure of the water in the shear zone (upper half of the bed, over hydrostatic; scale linear within 1 kPa) and dilation "
              "against shear strain, each packing a line. Dashed: dry. Dotted: the published peaks.",
    "peaks": "Peak friction against relative rate, with the 95 % interval over the packings, and over that of the dry bed. Stars: published; their rise is over "
             "the slowest rate.",
    "pressure": "Pressure with depth and time in one bed of the highest rate, with drag.",
}


def variants_of(study, own, note):
    """{name: measured rows} of the studies beside this one that share its number of grains and its stress."""
    found = {}
    for other in beside(study):
        runs = [r for r in load(other, lambda _: None) if r.case.settings["grains"]["count"] == own[0].case.settings["grains"]["count"]
                and r.sigma_0 == own[0].sigma_0]
        if runs:
            found[other.name] = [r.measured() for r in runs]
    return found


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, figures/, report.html, report.md to `output`."""
    output, note = Path(output), LeftOut(say)
    made_by = version()  # before this report changes a file that the repository keeps
    runs = load(study, note)
    if not runs:
        raise MissingData(f"{study}: no run has come to its end" + "".join(f"; {w}" for w in note))
    output.mkdir(parents=True, exist_ok=True)
    rows = [r.measured() for r in runs]
    measure.table(rows, output / "measurements.csv")
    kinds, first = by_kind(rows), runs[0]
    settings = first.case.settings
    page = Page()
    page.heading("Damsgaard et al. (2015), reproduced: dilatant hardening", 1)
    page.paragraph(f"{len(runs)} runs of {settings['grains']['count']} grains, seeds {', '.join(map(str, sorted({r.seed for r in runs})))}, preset {settings['model'].get('preset')}, "
                   f"normal stress {first.sigma_0 / 1e3:g} kPa, sheared to a strain of {max(r['strain'] for r in rows):.2f}, without drag of {min(r['strain'] for r in rows):.2f}. "
                   f"{np.nansum(values(rows, 'hours')):.1f} hours of runs, settling apart, several at once. This report: version {made_by}, on {machine()}, {date.today()}.")
    page.paragraph(f"± is half of a 95 % interval over the packings. Peaks are the original's: the largest value of τ/σ_0, smoothed by a Hann window over {peak_rows} of its records of "
                   f"{peak_record:g} s (a strain of {peak_rows * peak_record * rate:g}), up to a strain of {peak_strain:g}. A relative rate of 1 is μ_f = {viscosity:g} Pa s, {rate:g} 1/s and "
                   f"k_c = {k_c:g} m²; lower ones have a higher k_c. The published values are of one packing: ours agree where one more run here would come out like "
                   "theirs with a probability of 95 %; peaks are compared by their logarithms, for the scatter goes with the level.")
    page.heading("Peak friction beside the published one")
    page.table(["relative rate", "published (20 kPa)", *(f"here, {text}" for text in closures.values()), "published, over the slowest", "here, with drag, over the dry bed"],
               peak_table(kinds))
    if first.sigma_0 != published_stress:
        page.paragraph(f"The published peaks are of {published_stress / 1e3:g} kPa, these runs of {first.sigma_0 / 1e3:g} kPa.")
    dry = kinds.get(Kind("", 0.0), [])
    if dry:
        page.paragraph(f"The dry bed's peak is {shown(dry, 'peak', 3)} here.")
    page.heading("Critical state")
    page.paragraph(critical_state(kinds))
    if table := critical_table(kinds):
        page.table(["water", "relative rate", "runs", "τ/σ_0, end", "τ/(σ_0 - p), end", "pressure, end (kPa)", "lowest pressure (kPa)", "dilation, end (d)",
                    "strain at peak"], table)
    variants = variants_of(study, runs, note)
    if variants:
        page.heading("Tests of causes")
        page.paragraph("Studies with other settings, named after them, on the same beds.")
        for name, other in variants.items():
            page.paragraph(f"{name}:")
            page.table(["water", "relative rate", "runs", "peak", "peak of the study above", "lowest pressure (kPa)"],
                       [[closures.get(k.closure, "dry"), f"{k.relative_rate:g}", len(own), shown(own, "peak"),
                         shown([r for r in kinds.get(k, []) if r["seed"] in {o["seed"] for o in own}], "peak"), shown(own, "lowest_pressure_kPa", 1)]
                        for k, own in by_kind(other).items()])
    for why in note:
        page.paragraph(why)
    if notes:
        page.notes(Path(notes).read_text())
    fastest = [r for r in runs if r.closure == "full"]
    draws = {"curves": lambda: curves_figure(runs), "peaks": lambda: peaks_figure({"": rows} | variants),
             "pressure": lambda: water_figures.pressure(max(fastest, key=lambda r: r.kind.relative_rate).stage)}
    page.figures(draws, captions, output / "figures")
    page.write(output, "Damsgaard et al. (2015), reproduced with Moraine")
    say(str(output / "report.html"))
    for line in peak_table(kinds):
        say("  relative rate " + ", ".join([line[0], f"published {line[1]}", *(f"{t} {v}" for t, v in zip(closures.values(), line[2:]))]))
