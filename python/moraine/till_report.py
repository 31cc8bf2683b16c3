"""What the hardening runs of cases/till came to: hardening.csv, hardening.md and figures, beside the published follow-up,
Damsgaard et al. (2015), The Cryosphere 9, 2183-2200.

Peaks are those of total friction (see water_figures): smoothed is the largest mean over a shear strain of 0.01, raw the largest row."""
from functools import cached_property
from pathlib import Path

import numpy as np

from . import measure, shearing, style, water_figures
from .case import Case, MissingData
from .progress import duration
from .strength import smoothed

# Their peak friction at sigma_0 = 20 kPa, by shear rate relative to their fastest; friction coefficient of their grains.
follow_up = {0.01: 0.62, 0.1: 0.65, 1.0: 0.71}
follow_up_mu = 0.5

root = Path(__file__).resolve().parents[2]
last = 0.9      # of the strain at the end: where the mean of the end begins


class Run:
    """A case that is sheared, and what is read off it."""

    def __init__(self, name, case):
        self.name, self.case = name, case
        self.stage = shearing.along(case.stage("shear"))
        self.rows = self.stage.series
        self.wet = self.stage.wet
        self.rate = abs(self.stage.settings["strain_rate"])
        if self.rate == 0:
            raise MissingData(f"{case.output}/case.toml: the stage {self.stage.name} has no strain_rate")
        water = case.settings.get("fluid", {})
        self.viscosity, self.k_c = (water["viscosity"], water["permeability_factor"]) if self.wet else (0.0, np.inf)
        if self.wet and self.k_c == 0:  # as the program has it where none is given
            self.k_c = case.diameter**2 / 180
        self.mu_s = self.stage.settings.get("mu_s", np.nan)

    @property
    def done(self):
        """Share of the stage that has been computed."""
        return min(1.0, self.rows["stage_time"][-1] / duration(self.stage, shearing.height_0(self.rows)))

    @property
    def finished(self):
        return self.done > 0.999

    @cached_property
    def sigma_0(self):
        return self.stage.settings["normal_stress"]

    @property
    def group(self):
        """mu rate H^2/(k sigma_0), with height and Kozeny-Carman permeability of the bed when shear begins: the time the pressure takes to
        even out through the bed, over that in which dilation at the rate of shear would lower it by sigma_0."""
        if not self.wet:
            return 0.0
        phi, height = shearing.porosity_0(self.rows), shearing.height_0(self.rows)
        return self.viscosity * self.rate * height**2 / (self.k_c * phi**3 / (1 - phi)**2 * self.sigma_0)

    @cached_property
    def friction(self):
        return water_figures.total_friction(self.rows, self.wet)

    @cached_property
    def _smooth_peak(self):
        strain, mean = self.rows["shear_strain"], smoothed(self.rows["shear_strain"], self.friction, water_figures.width)
        if not np.isfinite(mean).any():
            raise MissingData(f"{self.rows.file}: too short to be smoothed over a strain of {water_figures.width:g}")
        best = int(np.nanargmax(mean))
        return mean[best], strain[best]

    @property
    def peak(self):
        return self._smooth_peak[0]

    @property
    def strain_at_peak(self):
        return self._smooth_peak[1]

    @property
    def peak_raw(self):
        return self.friction[self.rows["shear_strain"] > 0].max()

    def _mean_of_end(self, values):
        strain = self.rows["shear_strain"]
        return values[strain >= last * strain[-1]].mean()

    @property
    def lowest_pressure(self):
        """Of the smoothed mean in the shear zone, Pa; 0 in a dry bed."""
        return np.nanmin(smoothed(self.rows["shear_strain"], self.rows["water_pressure_mean"], water_figures.width)) if self.wet else 0.0

    def measured(self):
        return {
            "run": self.name, "k_c_m2": self.k_c if self.wet else "", "rate_1_s": self.rate,
            "mu_rate_over_k_c_Pa_m2": self.viscosity * self.rate / self.k_c if self.wet else 0.0, "group": self.group,
            "strain": self.rows["shear_strain"][-1], "peak": self.peak, "strain_at_peak": self.strain_at_peak, "peak_raw": self.peak_raw,
            "friction_end": self._mean_of_end(self.friction), "grain_friction_end": self._mean_of_end(self.rows["shear_friction"]),
            "lowest_pressure_kPa": self.lowest_pressure / 1e3 if self.wet else "",
            "dilation_d": self._mean_of_end(self.rows["dilation_diameters"]), "porosity_0": shearing.porosity_0(self.rows),
            "height_0_m": shearing.height_0(self.rows),
        }


def load(directories, note):
    """Runs of {name: directory} that have rows of shear; the others are named."""
    runs = []
    for name, directory in directories.items():
        try:
            if not (Path(directory) / "output" / "case.toml").exists():
                raise MissingData("it has not been run")
            run = Run(name, Case(directory))
        except MissingData as why:
            note(f"{name}: left out: {why}")
            continue
        if not run.finished:
            note(f"{name}: has come to {100 * run.done:.0f} % of its shear: its curves are drawn, its peak is not counted")
        runs.append(run)
    return runs


def add_ratio(rows):
    """peak_over_dry, where the dry twin has been measured."""
    dry = {r["rate_1_s"]: r["peak"] for r in rows if r["k_c_m2"] == ""}
    for r in rows:
        r["peak_over_dry"] = r["peak"] / dry[r["rate_1_s"]] if r["rate_1_s"] in dry else ""
    return rows


def number(value, digits=3, form="f"):
    return f"{value:.{digits}{form}}" if isinstance(value, (float, np.floating)) and np.isfinite(value) else "-"


def markdown_table(head, rows):
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in [head, ["---"] * len(head), *rows])


def table_of(rows):
    head = ["k_c (m²)", "rate (1/s)", "μ γ̇ / k_c (kPa/m²)", "μ γ̇ H²/(k σ_0)", "peak, smoothed", "over the dry peak", "strain at peak", "peak, raw",
            "friction, last tenth", "lowest pressure (kPa)", "dilation (d)"]
    return markdown_table(head, [[
        number(r["k_c_m2"], 1, "e") if r["k_c_m2"] != "" else "dry", f"{r['rate_1_s']:g}", number(r["mu_rate_over_k_c_Pa_m2"] / 1e3, 3, "g"),
        number(r["group"], 2, "g"), number(r["peak"]), number(r["peak_over_dry"], 2), number(r["strain_at_peak"]), number(r["peak_raw"]),
        number(r["friction_end"]), number(r["lowest_pressure_kPa"], 2), number(r["dilation_d"], 2)] for r in rows])


captions = {
    "hardening": "Total friction and mean pressure of the water in the shear zone (upper half of the bed) against shear strain. Dashed: dry.",
    "peaks": "Peak strength against rate; and over the dry peak, against the ratio of shear rate to drainage rate.",
    "dilation": "Dilation against shear strain. Dashed: dry.",
}


def text_of(rows, runs, notes, drawn, pressures):
    first = rows[0]
    mu = next((r.mu_s for r in runs), np.nan)
    parts = ["# Dilatant hardening", f"Friction coefficient of the grains {mu:g}, normal stress {runs[0].sigma_0 / 1e3:g} kPa; the bed is "
             f"{first['height_0_m']:.3f} m high with a porosity of {first['porosity_0']:.3f} when shear begins. Written by `./moraine till report`; "
             "the same numbers, and a few more, are in [hardening.csv](hardening.csv).", table_of(rows),
             "Friction is shear stress over total stress (grains and water) on the top wall. Peak, smoothed: the largest mean over a shear strain of "
             f"{water_figures.width:g}; raw: the largest row. Friction and dilation (mean grain diameters) at the end: means over the last tenth of "
             "the strain. Pressure: over hydrostatic, mean of the shear zone (upper half of the bed), smoothed like the peak. k: Kozeny-Carman, with "
             "the porosity when shear begins."]
    base = follow_up[min(follow_up)]
    parts += ["## The follow-up", f"Damsgaard et al. (2015), σ_0 = 20 kPa, friction coefficient of the grains {follow_up_mu:g} there:",
              markdown_table(["relative shear rate", "peak friction", "over that of the slowest"],
                             [[f"{rate:g}", f"{peak:.2f}", f"{peak / base:.2f}"] for rate, peak in follow_up.items()]),
              "Their bed differs in grains and friction: the rise is to be compared, not the level."]
    if notes:
        parts += ["## What is missing", "\n".join(f"- {n}" for n in notes)]
    if drawn or pressures:
        parts.append("## Figures")
    parts += [f"![{name}](figures/{name}.png)\n\n*{captions[name]}*" for name in drawn]
    if pressures:
        parts.append("Pressure with depth and time: " + ", ".join(f"[{run}](figures/{file})" for run, file in pressures.items()) + ".")
    return "\n\n".join(parts) + "\n"


def pressure_figure(stage, name, directory, say):
    """figures/pressure-NAME.png; its file name."""
    stem = directory / "figures" / f"pressure-{name}"
    path, = style.save(water_figures.pressure(stage), stem, ("png",), dpi=130)
    say(str(path))
    return path.name


def build(directories, output, say=print):
    """directories: {name: case directory}. Returns what is missing, in words."""
    notes, drawn, pressures = [], [], {}
    output = Path(output)

    def note(why):
        why = why.replace(f"{root}/", "")  # what the report names is found in any copy of the tree
        notes.append(why)
        say(why)

    runs = load(directories, note)
    if not runs:
        raise MissingData("no hardening run has results; ./moraine till hardening runs them")
    finished, rows = [], []
    for run in runs:
        if not run.finished:
            continue
        try:
            rows.append(run.measured())
            finished.append(run)
        except MissingData as why:
            note(f"{run.name}: not measured: {why}")
    output.mkdir(parents=True, exist_ok=True)
    for name, draw in (("hardening", lambda: water_figures.hardening(runs)), ("peaks", lambda: water_figures.peaks(finished)),
                       ("dilation", lambda: water_figures.dilation(runs))):
        try:
            say(str(style.save(draw(), output / "figures" / name, ("png",), dpi=130)[0]))
            drawn.append(name)
        except MissingData as why:
            note(f"{name}: not drawn: {why}")
    for run in runs:
        if run.wet:
            try:
                pressures[run.name] = pressure_figure(run.stage, run.name, output, say)
            except MissingData as why:
                note(f"pressure-{run.name}: not drawn: {why}")
    if not rows:
        raise MissingData("no hardening run has come to its end: no table is written")
    add_ratio(rows)
    measure.table(rows, output / "hardening.csv")
    (output / "hardening.md").write_text(text_of(rows, finished, notes, drawn, pressures))
    say(str(output / "hardening.md"))
    return notes
