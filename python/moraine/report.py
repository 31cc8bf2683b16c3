"""The report of a study: what the paper states, what came out here, with intervals and verdicts; report.html and report.md.

An interval is one of 95 %: of the Mohr-Coulomb values from the fit over all seeds and normal stresses (Student's t times the
standard error), of everything else from the scatter over the seeds.
"""
import base64
from dataclasses import dataclass
from datetime import date
from html import escape
from pathlib import Path
import os
import platform
import subprocess

import numpy as np
from scipy import stats

from . import figures, measure, paper
from .case import MissingData


@dataclass(frozen=True)
class Line:
    quantity: str
    where: str
    paper: str
    ours: str
    verdict: str


def mean_interval(values):
    """Mean and half width of its 95 % interval; the half width is nan for a single value."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return values.mean(), np.nan
    return values.mean(), stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))


def show(value, half, digits=2, unit=""):
    width = f" ± {half:.{digits}f}" if np.isfinite(half) else " (one run)"
    return f"{value:.{digits}f}{width}{unit}"


def compare(value, half, reference, reference_half=0.0):
    """Whether the intervals meet."""
    if not np.isfinite(half):
        return "one run, no interval"
    if abs(value - reference) <= half + reference_half:
        return "agrees"
    return "higher" if value > reference else "lower"


def grows(rows, key, falling=False):
    """Spearman's rank correlation of a column with the normal stress over all runs, in words, and the verdict on the claim that
    the column grows with it (or falls)."""
    x, y = np.array([[r["sigma_0_kPa"], r[key]] for r in rows]).T
    if len(np.unique(x)) < 3 or not np.isfinite(y).all():
        return "fewer than three normal stresses", "not tested"
    rank, p = stats.spearmanr(x, y)
    means = ", ".join(f"{y[x == s].mean():.2f}" for s in np.unique(x))
    sign = -1 if falling else 1
    verdict = "holds" if sign * rank > 0 and p < 0.05 else "does not hold" if p < 0.05 else "no trend to be seen"
    return f"{means} (rank correlation {rank:+.2f}, p = {p:.1g})", verdict


def at(rows, sigma_0):
    return [r for r in rows if np.isclose(r["sigma_0_kPa"], sigma_0)]


def quantities(rows):
    """All lines that can be drawn up from measured runs."""
    out = []
    try:
        fits = measure.mohr_coulomb(rows)
    except ValueError:
        fits = {}
    for key, what, references in (
            ("peak", "smoothed", (paper.phi_p, paper.phi_p_se, paper.C_p, paper.C_p_se)),
            ("peak_raw", "raw, rows of 0.05 s", (paper.phi_p, paper.phi_p_se, paper.C_p, paper.C_p_se)),
            ("ultimate", "mean over the last third", (paper.phi_u, paper.phi_u_se, paper.C_u, paper.C_u_se))):
        if key not in fits:
            continue
        fit, (phi, phi_se, C, C_se) = fits[key], references
        phi_half, C_half = fit.interval()
        letter = key[0]
        out.append(Line(f"φ_{letter} ({what})", "par. 30, Table 2", f"{phi:g} ± {phi_se:g}° (s.e.)",
                        show(fit.phi, phi_half, 2, "°"), compare(fit.phi, phi_half, phi, 2 * phi_se)))
        out.append(Line(f"C_{letter} ({what})", "par. 30, Table 2", f"{C:g} ± {C_se:g} kPa (s.e.)",
                        show(fit.C / 1e3, C_half / 1e3, 2, " kPa"), compare(fit.C / 1e3, C_half / 1e3, C, 2 * C_se)))
    out.append(Line("strain at the smoothed peak grows with σ_0", "par. 29, Fig. 4", "order", *grows(rows, "strain_peak")))
    out.append(Line("strain until dilation is complete (95 %) grows with σ_0", "par. 29, Fig. 4", "order", *grows(rows, "strain_dilated")))
    out.append(Line("total dilation (diameters) grows with σ_0", "par. 29, Fig. 4", "order", *grows(rows, "dilation_d")))

    if high := at(rows, 80):
        value, half = mean_interval([r["dilation_d"] for r in high])
        out.append(Line("dilation at 80 kPa", "par. 52", "about 0.75 diameters", show(value, half, 2, " diameters"),
                        compare(value, half, 0.75, 0.05)))
    if low := at(rows, 10):
        depth, half = mean_interval([r["shear_zone_d"] for r in low])
        block, _ = mean_interval([r["shear_zone_integral_d"] for r in low])
        out.append(Line("shear zone at 10 kPa, down to 5 % of the displacement", "par. 33, Fig. 8", "about 7 diameters, at the top",
                        f"{show(depth, half, 1, ' diameters')} (as a block that moves with the layer: {block:.1f})",
                        compare(depth, half, paper.shear_zone_10kPa, 0.5)))
    out.append(Line("shear zone (block, diameters) deepens with σ_0", "par. 33, Fig. 8", "order", *grows(rows, "shear_zone_integral_d")))
    out.append(Line("highest porosity of a slab falls with σ_0", "par. 33, Fig. 9", "order", *grows(rows, "porosity_max", falling=True)))
    out.append(Line("its depth below the top wall (diameters) grows with σ_0", "par. 33, Fig. 9", "nearest the top at low stress",
                    *grows(rows, "porosity_max_below_top_d")))

    share = [r["above_4_sheared"] for r in rows]
    before = [r["above_4_consolidated"] for r in rows]
    out.append(Line("single grains under more than 4 σ_0", "par. 31, Fig. 5", "they exist",
                    f"{100 * np.mean(share):.2f} % of the free grains in shear, {100 * np.mean(before):.2f} % consolidated",
                    "holds" if min(share) > 0 else "does not hold"))
    tilt_before, tilt_shear = mean_interval([r["strong_tilt_consolidated"] for r in rows]), mean_interval([r["strong_tilt_sheared"] for r in rows])
    applied = np.mean([r["applied_tilt"] for r in rows])
    out.append(Line("strongest half of the contacts, consolidated: main direction", "par. 31, Fig. 7", "vertical",
                    f"{show(*tilt_before, 1, '°')} from the vertical", "holds" if tilt_before[0] < 15 else "does not hold"))
    out.append(Line("the same in shear, towards the shear direction", "par. 31, Fig. 7", "along the maximum compressive stress σ' + τ",
                    f"{show(*tilt_shear, 1, '°')} from the vertical; σ' + τ: {applied:.1f}°; largest principal stress from the "
                    f"contacts: {np.mean([r['stress_tilt'] for r in rows]):.1f}°",
                    "holds" if abs(tilt_shear[0] - applied) < 10 else "steeper" if tilt_shear[0] < applied else "flatter"))

    if high:
        for k, axis in enumerate("xyz"):
            value, half = mean_interval([r[f"rotation_mean_{axis}"] for r in high])
            out.append(Line(f"mean rotation about {axis} at 80 kPa", "par. 45, Fig. 11", f"{paper.rotation_mean[k]:g} rad",
                            show(value, half, 3, " rad"), compare(value, half, paper.rotation_mean[k])))
        for k, axis in enumerate("xyz"):
            value, half = mean_interval([r[f"rotation_variance_{axis}"] for r in high])
            out.append(Line(f"variance of the rotation about {axis} at 80 kPa", "par. 45, Fig. 11",
                            f"{paper.rotation_variance[k]:g} rad²", show(value, half, 2, " rad²"),
                            compare(value, half, paper.rotation_variance[k])))
    known = [r for r in rows if np.isfinite(r["collapse_time_s"])]
    if known:
        out.append(Line("consolidation", "par. 29", "volumetric strain rate decays exponentially",
                        f"two exponentials: {1e3 * np.mean([r['collapse_time_s'] for r in known]):.0f} ms (R² "
                        f"{np.mean([r['collapse_r2'] for r in known]):.3f}), then {np.mean([r['creep_time_s'] for r in known]):.2f} s (R² "
                        f"{np.mean([r['creep_r2'] for r in known]):.3f})",
                        "holds" if np.mean([r["collapse_r2"] for r in known]) > 0.95 else "does not hold"))
    numbers = {r["sigma_0_kPa"]: r["inertia_number"] for r in rows}
    lowest, highest = min(numbers), max(numbers)
    out.append(Line("inertia number I (eq. 1)", "par. 28", "7.5e-4 (10 kPa) to 2.2e-4 (120 kPa)",
                    f"{numbers[lowest]:.2g} ({lowest:g} kPa) to {numbers[highest]:.2g} ({highest:g} kPa)",
                    "cannot agree: eq. 1 with the values of Table 1 gives 5.1e-4 and 1.5e-4"))
    return out


@dataclass(frozen=True)
class Variant:
    """A study with other settings, beside the main one: the same seeds and normal stresses, up to the same strain."""
    name: str
    runs: int
    strain: float
    values: dict    # name: (main, variant, half width of the 95 % interval of the mean difference or nan)


compared = {"friction_peak_raw": "peak friction, raw", "friction_peak": "peak friction, smoothed", "friction_ultimate": "friction, last third",
            "dilation_d": "dilation, diameters", "coordination": "contacts a grain", "porosity_0": "porosity before shear"}


def variant(main_cases, name, cases):
    """Or nothing, where no seed and normal stress are common to both."""
    def key(case):
        return case.settings["grains"]["seed"], case.normal_stress
    main = {key(c): c for c in main_cases}
    pairs = [(main[key(c)], c) for c in cases if key(c) in main]
    if not pairs:
        return None
    end = min(c.stage("shear").series["shear_strain"][-1] for pair in pairs for c in pair)
    both = [[measure.strengths(c, until=end * (1 + 1e-9)) for c in pair] for pair in pairs]
    values = {}
    for column in compared:
        ours, theirs = np.array([[m[column], v[column]] for m, v in both]).T
        values[column] = ours.mean(), theirs.mean(), mean_interval(theirs - ours)[1]
    return Variant(name, len(pairs), end, values)


def machine():
    cpu = platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.partition(":")[2].strip()
                break
    except OSError:
        pass
    return f"{cpu}, {os.cpu_count()} cores"


def version():
    root = Path(__file__).resolve().parents[2]
    git = subprocess.run(["git", "-C", str(root), "describe", "--always", "--dirty"], capture_output=True, text=True)
    return git.stdout.strip() if git.returncode == 0 else "unknown"


class Report:
    """Collects text once and writes it as HTML and as Markdown."""

    def __init__(self):
        self.html, self.md = [], []

    def heading(self, text, level=2):
        self.html.append(f"<h{level}>{escape(text)}</h{level}>")
        self.md.append("#" * level + f" {text}\n")

    def paragraph(self, text):
        self.html.append(f"<p>{escape(text)}</p>")
        self.md.append(f"{text}\n")

    def table(self, head, rows):
        cells = "".join(f"<th>{escape(h)}</th>" for h in head)
        body = "\n".join("<tr>" + "".join(f"<td>{escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self.html.append(f"<table><thead><tr>{cells}</tr></thead><tbody>\n{body}\n</tbody></table>")
        self.md.append("\n".join("| " + " | ".join(str(c).replace("|", "\\|") for c in row) + " |"
                                 for row in [head, ["---"] * len(head), *rows]) + "\n")

    def figure(self, name, caption, directory):
        svg = (directory / f"{name}.svg").read_bytes()
        self.html.append(f'<figure><img alt="{escape(caption)}" src="data:image/svg+xml;base64,{base64.b64encode(svg).decode()}">'
                         f"<figcaption>{escape(caption)}</figcaption></figure>")
        self.md.append(f"![{name}](figures/{name}.png)\n\n*{caption}*\n")

    def write(self, directory, title):
        page = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{escape(title)}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff; }}
h1 {{ line-height: 1.2; }} h2 {{ margin-top: 2.2em; }}
table {{ border-collapse: collapse; font-size: 13px; width: 100%; }}
th, td {{ text-align: left; vertical-align: top; padding: .35em .7em .35em 0; border-bottom: 1px solid #ddd; }}
figure {{ margin: 2em 0; }} figure img {{ max-width: 100%; }} figcaption {{ font-size: 13px; color: #444; }}
</style></head><body>
{chr(10).join(self.html)}
</body></html>
"""
        for name, text in (("report.html", page), ("report.md", "\n".join(self.md))):
            aside = directory / (name + ".tmp")
            aside.write_text(text)
            aside.rename(directory / name)


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, figures/, report.html, report.md to `output`."""
    study, output = Path(study), Path(output)
    output.mkdir(parents=True, exist_ok=True)
    cases = measure.runs(study)
    say(f"measuring {len(cases)} runs")
    rows, left_out = [], []
    for case in cases:
        try:
            rows.append(measure.measure(case))
        except MissingData as why:
            left_out.append(str(why))
            say(f"left out: {why}")
    if not rows:
        raise MissingData(f"{study}: no run has all that the report needs: " + "; ".join(left_out))
    measure.table(rows, output / "measurements.csv")

    seeds, stresses = sorted({r["seed"] for r in rows}), sorted({r["sigma_0_kPa"] for r in rows})
    text = Report()
    text.heading("Damsgaard et al. (2013), reproduced", 1)
    text.paragraph(f"{len(rows)} runs of {rows[0]['grains']} grains: normal stress {', '.join(f'{s:g}' for s in stresses)} kPa, "
                   f"seeds {', '.join(map(str, seeds))}, preset {rows[0]['preset']} (f = {rows[0]['f']:g}, k_n = {rows[0]['k_n']:.3g} N/m), sheared "
                   f"to a strain of {min(r['strain'] for r in rows):.2f}. {rows[0]['program'].split(',')[0]}, version {version()}, on {machine()}; "
                   f"{sum(r['hours'] for r in rows):.1f} hours of runs, several at once. {date.today()}.")
    text.paragraph("± is half of a 95 % interval: of φ and C from the Levenberg-Marquardt fit over all runs, of all else from the scatter "
                   "over the seeds. The paper's ± is its standard error. Single runs are in measurements.csv.")
    text.heading("The paper's numbers and these")
    lines = quantities(rows)
    text.table(["quantity", "paper", "here", "verdict", "where"], [[x.quantity, x.paper, x.ours, x.verdict, x.where] for x in lines])
    for why in left_out:
        text.paragraph(f"Left out: {why}")

    variants = []
    for other in sorted(p for p in study.parent.iterdir() if p.is_dir() and p != study):
        try:
            variants.append(variant(cases, other.name, measure.runs(other)))
        except MissingData:
            continue
    if variants := [v for v in variants if v]:
        text.heading("Tests of causes")
        text.paragraph("Each line is a study with other settings, named after them, against the runs above with the same seeds and normal "
                       "stresses, both read up to the same strain. Values: here, there; ± of the difference where there are several runs.")
        text.table(["settings", "runs", "up to strain", *compared.values()],
                   [[v.name, v.runs, f"{v.strain:.2f}"] + [f"{a:.3f}, {b:.3f}" + (f" (±{h:.3f})" if np.isfinite(h) else "")
                                                           for a, b, h in v.values.values()] for v in variants])
    if notes and Path(notes).exists():
        add_notes(text, Path(notes).read_text())

    text.heading("Figures")
    missing = figures.draw(figures.Selection(cases), output / "figures", ("svg", "png", "pdf"), say=say)
    for figure in figures.all_figures:
        if figure.name in missing:
            text.paragraph(f"{figure.name} is not drawn: {missing[figure.name]}")
        else:
            text.figure(figure.name, figure.caption, output / "figures")
    text.write(output, "Damsgaard et al. (2013), reproduced with Moraine")
    say(f"{output / 'report.html'}")
    for x in lines:
        say(f"  {x.quantity}: paper {x.paper}; here {x.ours}: {x.verdict}")
    return missing


def add_notes(report, text):
    """Markdown of the simplest kind: headings and paragraphs, set apart by empty lines."""
    for block in text.strip().split("\n\n"):
        block = " ".join(block.split("\n"))
        if block.startswith("#"):
            report.heading(block.lstrip("# "), max(2, len(block) - len(block.lstrip("#"))))
        else:
            report.paragraph(block)


def arguments(parser):
    parser.add_argument("STUDY", help="directory of runs, such as cases/paper-2013/runs/fast")
    parser.add_argument("--output", metavar="DIR", help="where the report goes (default: STUDY/results)")
    parser.add_argument("--notes", metavar="FILE", help="Markdown to include: findings, causes")


def run(args):
    missing = build(args.STUDY, args.output or Path(args.STUDY) / "results", args.notes)
    return 1 if missing else 0
