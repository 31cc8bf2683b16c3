"""The report of paper-2013: what the paper states, what came out here, with intervals and verdicts; report.html and report.md.

An interval is one of 95 %: of the Mohr-Coulomb values from the fit over all seeds and normal stresses (Student's t times the
standard error), of everything else from the scatter over the runs: over the seeds where a normal stress is named, else over all.
"""
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
from scipy import special, stats

from . import figures, measure, paper, shearing
from .results import MissingData
from .intervals import compare, further_run, mean_interval, show
from .page import Page, machine, version


@dataclass(frozen=True)
class Line:
    quantity: str
    where: str
    paper: str
    ours: str
    verdict: str


def column(rows, key):
    """Of measured runs; nan where one lacks it."""
    return np.array([r.get(key, np.nan) for r in rows], float)


def known(rows, *keys):
    """Whether all these have been measured in all of the rows."""
    return bool(rows) and all(np.isfinite(column(rows, key)).all() for key in keys)


def at(rows, sigma_0):
    return [r for r in rows if np.isclose(r["sigma_0_kPa"], sigma_0)]


def trend(x, y, groups, draws=9999):
    """Spearman's rank correlation, the probability of one at least as large by chance, and the least that probability can be.

    By chance: the values of each group change places among themselves. A group is a packing, whose runs have more in common than
    their normal stress; and the usual formula gives p = 0 for three values in order, of which every third triple is."""
    x, y, groups = stats.rankdata(x), stats.rankdata(y), np.asarray(groups)
    if np.ptp(y) == 0:
        return 0.0, 1.0, 0.0
    a, b = x - x.mean(), y - y.mean()
    scale, random = np.sqrt((a**2).sum() * (b**2).sum()), np.random.default_rng(1)
    chance, orders = np.zeros(draws), 1.0
    for g in np.unique(groups):
        own = groups == g
        chance += random.permuted(np.tile(b[own], (draws, 1)), axis=1) @ a[own]
        orders *= special.factorial(own.sum())
    rank = (a * b).sum() / scale
    return rank, (1 + np.sum(np.abs(chance) / scale >= abs(rank) - 1e-9)) / (1 + draws), 2 / orders


def order(quantity, where, claim, rows, key, falling=False):
    """Whether a column grows with the normal stress over all runs (or falls)."""
    x, y = column(rows, "sigma_0_kPa"), column(rows, key)
    if len(np.unique(x)) < 3 or not np.isfinite(y).all():
        return Line(quantity, where, claim, "not measured in all runs, at three normal stresses or more", "not tested")
    rank, p, least = trend(x, y, column(rows, "seed"))
    means = ", ".join(f"{y[x == s].mean():.2f}" for s in np.unique(x))
    right = rank < 0 if falling else rank > 0
    verdict = "too few runs to tell" if least > 0.05 else "no trend to be seen" if p > 0.05 else "holds" if right else "does not hold"
    return Line(quantity, where, claim, f"{means} (rank correlation {rank:+.2f}, p = {p:.1g})", verdict)


def strength_lines(rows):
    try:
        fits = measure.mohr_coulomb(rows)
    except ValueError:
        return
    each = measure.mohr_coulomb_by_seed(rows)
    peak = paper.phi_p, paper.phi_p_se, paper.C_p, paper.C_p_se, 0.5, 0.05  # the last two: half of the last digit printed
    ultimate = paper.phi_u, paper.phi_u_se, paper.C_u, paper.C_u_se, 0.5, 0.005
    t = stats.t.ppf(0.975, len(paper.normal_stresses) - 2)  # of the paper's standard errors
    for key, how, (phi, phi_se, C, C_se, phi_digit, C_digit) in (
            ("peak", "smoothed", peak), ("peak_raw", "raw, rows of 0.05 s", peak), ("ultimate", "mean over the last third", ultimate)):
        fit, letter = fits[key], key[0]
        phi_half, C_half = fit.interval()
        for name, value, half, reference, se, digit, unit, own in (
                ("φ", fit.phi, phi_half, phi, phi_se, phi_digit, "°", [f[key].phi for f in each]),
                ("C", fit.C / 1e3, C_half / 1e3, C, C_se, C_digit, " kPa", [f[key].C / 1e3 for f in each])):
            alone = f"; each seed alone: {show(*mean_interval(own), 2, unit)}" if len(each) > 1 else ""
            verdict = compare(value, reference, np.hypot(half, t * se) + digit)
            if name == "φ" and verdict == "lower" and column(rows, "grains").min() >= paper.grains:
                verdict = "lower: not from this model (cases/paper-2013/notes-fast.md)"
            yield Line(f"{name}_{letter} ({how})", "par. 30, Table 2", f"{reference:g} ± {se:g}{unit} (s.e.)",
                       show(value, half, 2, unit) + alone, verdict)
    yield order("peak friction falls with σ_0", "par. 29, Fig. 4", "it depends on σ_0", rows, "friction_peak", falling=True)
    yield order("ultimate friction falls with σ_0", "par. 29, Fig. 4", "it depends on σ_0", rows, "friction_ultimate", falling=True)


def dilation_lines(rows):
    where = "par. 29, Fig. 4"
    yield order("strain at the smoothed peak grows with σ_0", where, "order", rows, "strain_peak")
    yield order("strain until dilation is complete (95 %) grows with σ_0", where, "order", rows, "strain_dilated")
    yield order("total dilation (diameters) grows with σ_0", where, "order", rows, "dilation_d")
    if high := at(rows, 80):
        value, half = mean_interval(column(high, "dilation_d"))
        yield Line("dilation at 80 kPa", "par. 52", "about 0.75 diameters", show(value, half, 2, " diameters"),
                   compare(value, paper.dilation["DEM (paper)"], further_run(column(high, "dilation_d")) + 0.05))


def taylor_lines(rows):
    if not known(rows, "taylor_residual_peak"):
        return
    where, peak_paper = "par. 29, 52; Taylor's relation", paper.friction_peak_80kPa
    friction, rate = column(rows, "friction_critical"), column(rows, "dilation_rate_peak")
    at_peak, half = mean_interval(column(rows, "taylor_residual_peak"))
    rms = column(rows, "taylor_residual_rms").mean()
    yield Line("friction = μ_cs + dε_v/dγ: what is left at the peak", where, "not tested there",
               f"{show(at_peak, half, 3)}, {rms:.3f} (r.m.s.) over all strains; μ_cs {friction.min():.2f} to {friction.max():.2f}, "
               f"dilation rates at the peak {rate.min():.2f} to {rate.max():.2f}",
               "holds within 0.05" if np.abs(column(rows, "taylor_residual_peak")).max() < 0.05 else f"holds within {np.abs(column(rows, 'taylor_residual_peak')).max():.2f}")
    if known(high := at(rows, 80), "taylor_dilation_d"):
        own, seen = column(high, "taylor_dilation_d").mean(), column(high, "dilation_d").mean()
        mu, left = column(high, "friction_critical").mean(), column(high, "taylor_residual_peak").mean()
        yield Line("the same at 80 kPa: the dilation that friction above μ_cs asks for", where, f"a peak of {peak_paper:g} asks for a dilation rate of "
                   f"{peak_paper - paper.friction_ultimate_80kPa:.2f} over its own ultimate friction of {paper.friction_ultimate_80kPa:g}",
                   f"{own:.2f} of {seen:.2f} diameters; the paper's peak would take a rate of {peak_paper - mu - left:.2f} here, "
                   f"where it is {column(high, 'dilation_rate_peak').mean():.2f}", "peak and dilation check each other")


def profile_lines(rows):
    if known(low := at(rows, 10), "shear_zone_d"):
        value, half = mean_interval(column(low, "shear_zone_d"))
        block = column(low, "shear_zone_integral_d").mean()
        yield Line("shear zone at 10 kPa, down to 5 % of the displacement", "par. 33, Fig. 8", "about 7 diameters, at the top",
                   f"{show(value, half, 1, ' diameters')} (as a block that moves with the layer: {block:.1f})",
                   compare(value, paper.shear_zone_10kPa, further_run(column(low, "shear_zone_d")) + 0.5))
    yield order("shear zone (5 %, diameters) deepens with σ_0", "par. 33, Fig. 8", "order", rows, "shear_zone_d")
    yield order("highest porosity of a slab falls with σ_0", "par. 33, Fig. 9", "order", rows, "porosity_max", falling=True)
    yield order("mean depth of the porosity gained (diameters) grows with σ_0", "par. 33, Fig. 9", "nearest the top at low stress", rows,
                "loosened_depth_d")


def force_lines(rows):
    if not known(rows, "above_4_sheared"):
        return
    share, before = column(rows, "above_4_sheared"), column(rows, "above_4_consolidated")
    yield Line("single grains under more than 4 σ_0", "par. 31, Fig. 5", "they exist",
               f"{100 * share.mean():.1f} % of the free grains in shear, {100 * before.mean():.1f} % consolidated",
               "holds" if share.min() > 0 else "does not hold")
    tilt, half = mean_interval(column(rows, "strong_tilt_consolidated"))
    yield Line("strongest half of the contacts, consolidated: main direction", "par. 31, Fig. 7", "vertical",
               f"{show(tilt, half, 1, '°')} from the vertical", "holds" if tilt < 15 else "does not hold")
    tilt, half = mean_interval(column(rows, "strong_tilt_sheared"))  # positive: dipping towards +x
    applied, stress = column(rows, "applied_tilt").mean(), column(rows, "stress_tilt").mean()
    yield Line("the same in shear, towards the shear direction", "par. 31, Fig. 7",
               "along the maximum compressive stress σ' + τ; subhorizontal",
               f"{show(tilt, half, 1, '°')} from the vertical; largest principal stress, from the contacts: {stress:.1f}°; σ' and τ "
               f"added as vectors, as the paper has it: {applied:.1f}°",
               "along the largest principal stress, not the paper's sum" if abs(tilt - stress) < 5 < abs(tilt - applied)
               else "holds" if abs(tilt - applied) < 5 else "does not hold")


def rotation_lines(rows):
    high = at(rows, 80)
    for what, unit, digits, references in (("mean", " rad", 3, paper.rotation_mean), ("variance", " rad²", 2, paper.rotation_variance)):
        for axis, reference in zip("xyz", references):
            if known(high, key := f"rotation_{what}_{axis}"):
                value, half = mean_interval(column(high, key))
                free = column(high, f"free_{key}").mean()
                yield Line(f"{what} of the rotation about {axis} at 80 kPa, all grains", "par. 45, Fig. 11", f"{reference:g}{unit}",
                           f"{show(value, half, digits, unit)} (free grains only: {free:.{digits}f})",
                           compare(value, reference, further_run(column(high, key))))
    if known(rows, "opposite_spins"):
        share, half = mean_interval(100 * column(rows, "opposite_spins"))
        yield Line("contacts whose grains spin against each other", "par. 44, Fig. 10", "grains prefer to roll in opposite directions",
                   f"{show(share, half, 1, ' %')} (50 % if they did not)",
                   "too few runs to tell" if np.isnan(half) else "holds" if share - half > 50 else "does not hold")


def rate_lines(rows):
    if known(rows, "collapse_r2"):
        time, creep = column(rows, "collapse_time_s").mean(), column(rows, "creep_time_s").mean()
        r2, creep_r2 = column(rows, "collapse_r2").min(), column(rows, "creep_r2").min()
        yield Line("consolidation", "par. 29", "volumetric strain rate decays exponentially",
                   f"collapse of the loose top with a time of {1e3 * time:.0f} ms (R² ≥ {r2:.3f}), then creep with {creep:.2f} s "
                   f"(R² ≥ {creep_r2:.3f})",
                   "holds, in two steps" if min(r2, creep_r2) > 0.9 else "does not hold")
    if known(rows, "inertia_number"):
        numbers = dict(zip(column(rows, "sigma_0_kPa"), column(rows, "inertia_number")))
        ends = " to ".join(f"{numbers[s]:.2g} ({s:g} kPa)" for s in sorted({min(numbers), max(numbers)}))
        yield Line("inertia number I (eq. 1)", "par. 28", "7.5e-4 (10 kPa) to 2.2e-4 (120 kPa)", ends,
                   "the paper's own Table 1 gives 5.1e-4 and 1.5e-4 by eq. 1")


def quantities(rows):
    """All lines that can be drawn up from measured runs."""
    return [line for part in (strength_lines, dilation_lines, taylor_lines, profile_lines, force_lines, rotation_lines, rate_lines)
            for line in part(rows)]


def in_short(lines):
    """Which of them agree with the paper and which do not, in three sentences."""
    kinds = {"Agrees with the paper, or holds": ("agrees", "holds"), "Does not": ("lower", "higher", "does not hold", "no trend"),
             "Cannot be told": ("too few", "not tested")}
    said = []
    for words, beginnings in kinds.items():
        found = [x.quantity for x in lines if x.verdict.startswith(beginnings)]
        if found:
            said.append(f"{words} ({len(found)}): {'; '.join(found)}.")
    return " ".join(said)


@dataclass(frozen=True)
class Variant:
    """A study with other settings, beside the main one: the same seeds and normal stresses, up to the same strain."""
    name: str
    runs: int
    strain: float
    values: dict    # name: (main, variant, half width of the 95 % interval of the mean difference or nan)
    rows: list      # strengths of both, run by run


compared = {"friction_peak_raw": "peak friction, raw", "friction_peak": "peak friction, smoothed", "friction_ultimate": "friction, last third",
            "dilation_d": "dilation, diameters", "coordination": "contacts a grain", "porosity_0": "porosity before shear"}


def variant(main_cases, name, cases):
    """Or nothing, where no seed and normal stress are common to both."""
    def key(case):
        return case.seed, case.normal_stress
    main = {key(c): c for c in main_cases}
    pairs = [(main[key(c)], c) for c in cases if key(c) in main]
    if not pairs:
        return None
    end = min(shearing.of(c).series["shear_strain"][-1] for pair in pairs for c in pair)
    both = [[measure.strengths(c, until=end * (1 + 1e-9)) for c in pair] for pair in pairs]
    values = {}
    for column in compared:
        ours, theirs = np.array([[m[column], v[column]] for m, v in both]).T
        values[column] = ours.mean(), theirs.mean(), mean_interval(theirs - ours)[1]
    rows = [{"study": who, **numbers} for pair in both for who, numbers in zip(("main", name), pair)]
    return Variant(name, len(pairs), end, values, rows)


def differs(rows):
    """What sets these runs apart from the paper's, whatever their settings; empty if nothing."""
    grains, strain = column(rows, "grains").min(), column(rows, "strain").min()
    small = f"{grains:,.0f} grains instead of {paper.grains:,}" if grains < paper.grains else ""
    short = f"a shear strain of {strain:.2f} instead of {paper.total_shear_strain:g}" if strain < 0.99 * paper.total_shear_strain else ""
    if not small + short:
        return ""
    return f"These runs have {' and '.join(filter(None, (small, short)))}, so a difference from the paper may come from that alone" + \
        (": ultimate strength, dilation, shear zone and rotation are those of this strain." if short else ".")


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, variants.csv, figures/, report.html, report.md to `output`."""
    study, output = Path(study), Path(output)
    output.mkdir(parents=True, exist_ok=True)
    made_by = version()  # before this report changes a file that the repository keeps
    left_out = []

    def note(why):
        left_out.append(why)
        say(why)

    cases = measure.runs(study, note)
    say(f"measuring {len(cases)} runs")
    rows, measured = [], []
    for case in cases:
        if any((case.seed, case.normal_stress) == (c.seed, c.normal_stress) for c in measured):
            note(f"left out: {case.directory}: has the seed and the normal stress of another run")
            continue
        try:
            rows.append(measure.measure(case, note))
            measured.append(case)
        except MissingData as why:
            note(f"left out: {why}")
    if not rows:
        raise MissingData(f"{study}: no run can be measured: " + "; ".join(left_out))
    measure.table(rows, output / "measurements.csv")

    seeds, stresses = sorted({r["seed"] for r in rows}), sorted({r["sigma_0_kPa"] for r in rows})
    text = Page()
    text.heading("Damsgaard et al. (2013), reproduced", 1)
    first = rows[0]
    text.paragraph(f"{len(rows)} runs of {first.get('grains', '?')} grains: normal stress {', '.join(f'{s:g}' for s in stresses)} kPa, "
                   f"seeds {', '.join(map(str, seeds))}, preset {first.get('preset')} (f = "
                   f"{first.get('f', np.nan):g}, k_n = {first.get('k_n', np.nan):.3g} N/m), sheared "
                   f"to a strain of {min(r['strain'] for r in rows):.2f}. {first.get('program', 'moraine').split(',')[0]}, {np.nansum(column(rows, 'hours')):.1f} hours of "
                   f"runs, settling apart, several at once. This report: version {made_by}, on {machine()}, {date.today()}.")
    if unlike := differs(rows):
        text.paragraph(unlike)
    text.paragraph("± is half of a 95 % interval: of φ and C from the Levenberg-Marquardt fit over all runs, of all else from the scatter over "
                   "the runs: those of the normal stress that is named, else all. The paper's ± is its standard error. φ and C agree where the "
                   "difference lies within the intervals of both, added in squares, and half of the paper's last digit; what the paper has of one run, where one more run here "
                   "would come out like it with a probability of 95 %. Single runs are in measurements.csv.")
    text.heading("The paper's numbers and these")
    lines = quantities(rows)
    text.paragraph(in_short(lines))
    text.table(["quantity", "paper", "here", "verdict", "where"], [[x.quantity, x.paper, x.ours, x.verdict, x.where] for x in lines])
    for why in left_out:
        text.paragraph(why)

    variants = []
    for other in sorted(p for p in study.parent.iterdir() if p.is_dir() and p != study):
        try:
            same = [c for c in measure.runs(other) if c.settings["grains"]["count"] == measured[0].settings["grains"]["count"]]
            variants.append(variant(measured, other.name, same))
        except MissingData:
            continue
    if variants := [v for v in variants if v]:
        measure.table([row for v in variants for row in v.rows], output / "variants.csv")
        text.heading("Tests of causes")
        text.paragraph("Each line is a study with other settings, named after them, against the runs above with the same seeds and normal "
                       "stresses, both read up to the same strain: what is called the last third is that of this strain. Those with settings of settle have beds of their own. Values: here, there; ± of the difference where there are several runs.")
        text.table(["settings", "runs", "up to strain", *compared.values()],
                   [[v.name, v.runs, f"{v.strain:.2f}"] + [f"{a:.3f}, {b:.3f}" + (f" (±{h:.3f})" if np.isfinite(h) else "")
                                                           for a, b, h in v.values.values()] for v in variants])
    if notes:
        text.notes(Path(notes).read_text())

    text.heading("Figures")
    selection = figures.Selection(measured)
    text.paragraph(f"Where a figure shows one run, it is that of {selection.one.normal_stress / 1e3:g} kPa and seed {selection.one.seed}.")
    missing = figures.draw(selection, output / "figures", ("svg", "png", "pdf"), say=say)
    for figure in selection.figures:
        if figure.name in missing:
            text.paragraph(f"{figure.name} is not drawn: {missing[figure.name]}")
        else:
            text.figure(figure.name, figure.caption, output / "figures")
    text.write(output, "Damsgaard et al. (2013), reproduced with Moraine")
    say(f"{output / 'report.html'}")
    for x in lines:
        say(f"  {x.quantity}: paper {x.paper}; here {x.ours}: {x.verdict}")
    return missing
