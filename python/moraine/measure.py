"""One line of numbers for each run: everything that the report compares with the paper."""
from pathlib import Path
import csv
import io

import numpy as np

from . import compaction, forces, profile, rotation, section, shearing, strength
from .results import Results, MissingData
from .progress import duration


def runs(directory, say=print):
    """The cases of a study that have been begun, in order of seed and normal stress."""
    found = []
    for file in sorted(Path(directory).glob("seed-*/shear/sweep/*/output/case.toml")):
        try:
            case = Results(file.parents[1])
            case.seed, case.normal_stress  # what they are sorted by
            found.append(case)
        except MissingData as why:
            say(f"left out: {why}")
    if not found:
        raise MissingData(f"{directory}: there is no run; expected seed-*/shear/sweep/*/output")
    return sorted(found, key=lambda c: (c.seed, c.normal_stress))


def hours(case):
    """Of wall clock that the run took, several at once: from the times of its snapshots; where it was interrupted, without
    the break."""
    times = np.sort([f.stat().st_mtime for f in (case.output / "snapshots").glob("*.h5")])
    steps = np.diff(times)
    return float(steps[steps <= 20 * np.median(steps)].sum()) / 3600 if len(steps) else np.nan


def strengths(case, until=None):
    """Of the shear stage, up to a strain of `until`: a flat dictionary in the units of its names."""
    shear = shearing.of(case)
    s, rows = strength.strength(shear, until=until), shear.series
    begin = shearing.course(shear)[0].series
    if until is not None:
        rows = rows.rows(rows["shear_strain"] <= until)
    late = rows["shear_strain"] >= strength.late * s.strain
    return {
        "seed": case.seed, "sigma_0_kPa": shear.settings["normal_stress"] / 1e3, "strain": s.strain,
        "friction_peak_raw": s.peak_raw, "strain_peak_raw": s.peak_raw_strain, "tau_peak_raw_kPa": s.tau_peak_raw / 1e3,
        "friction_peak": s.peak, "strain_peak": s.peak_strain,
        "friction_ultimate": s.ultimate, "friction_ultimate_std": s.ultimate_std,
        "dilation_d": s.dilation, "strain_dilated": s.dilation_end, "contraction_d": s.contraction,
        "height_0_m": shearing.height_0(rows), "porosity_0": shearing.porosity_0(rows), "coordination_0": begin["coordination"][0],
        "coordination": rows["coordination"][late].mean(),
    }


def taylor(case, shear, consolidate):
    """Taylor's relation (strength.py): at the smoothed peak, and over all the strain that windows reach."""
    t = strength.taylor(shear)
    known = t.residual[np.isfinite(t.residual)]
    return {"friction_critical": t.mu_cs, "dilation_rate_peak": t.rate[t.at_peak], "dilation_rate_max": np.nanmax(t.rate),
            "taylor_residual_peak": t.residual[t.at_peak], "taylor_residual_rms": np.sqrt(np.mean(known**2)),
            "taylor_dilation_d": t.area * shearing.height_0(shear.series) / case.diameter}


def tilt(tensor):
    """Angle from the vertical of the axis of its largest principal value, degrees; positive where it dips towards +x: of a stage seen along
    its shear (shearing.py), towards the shear."""
    trend, plunge = forces.maximum_compressive_direction(tensor)
    return np.copysign(90 - plunge, np.cos(np.radians(trend)))


def strong_tilt(snapshot):
    """Of the mean direction of the strongest half of the contacts (Fig. 7): largest principal axis of their mean n n^T."""
    n = forces.vector(*forces.trend_plunge(snapshot))
    return tilt(n.T @ n / len(n))


def about(case, shear, consolidate):
    rate = abs(shear.settings["strain_rate"] or shear.settings["velocity"] / shearing.height_0(shear.series))
    return {"preset": case.settings["model"]["preset"], "f": shear.settings["f"],
            "k_n": case.settings["contact"]["k_n"] / case.settings["model"]["softening"],
            "grains": len(shear.snapshots[-1].grains), "hours": hours(case), "program": case.text.partition("\n")[0].lstrip("# "),
            "inertia_number": compaction.inertia_number(rate, case.diameter / 2,
                                                        case.settings["grains"]["density"], shear.settings["normal_stress"])}


def consolidation(case, shear, consolidate):
    time, strain = compaction.volumetric_strain(consolidate)
    out = {"consolidation_strain": strain[-1]}
    try:
        collapse, creep = compaction.phases(time, strain)
        out |= {"collapse_time_s": collapse.time, "collapse_r2": collapse.r_squared, "creep_time_s": creep.time,
                "creep_r2": creep.r_squared}
    except (RuntimeError, ValueError):  # no such curve fits
        pass
    return out


def profiles(case, shear, consolidate):
    last = shear.snapshots[-1]
    depth, block = profile.shear_zone(last)
    _, phi = profile.porosity(last)
    return {"shear_zone_d": depth, "shear_zone_integral_d": block, "porosity_max": phi[1:-1].max(),  # the outermost lie at flat walls
            "loosened_depth_d": profile.loosened_depth(consolidate.snapshots[-1], last)}


def rotations(case, shear, consolidate):
    """Of all grains, as the paper's seem to be, and of the free ones: those of the two layers do not turn."""
    last = shear.snapshots[-1]
    late = shear.snapshots[len(shear.snapshots) * 2 // 3:]
    out = {"opposite_spins": np.mean([section.opposite_spins(x) for x in late])}
    for name, found in (("rotation", rotation.statistics(last, all_grains=True)), ("free_rotation", rotation.statistics(last))):
        for axis, mean, variance in zip("xyz", found.mean, found.variance):
            out |= {f"{name}_mean_{axis}": mean, f"{name}_variance_{axis}": variance}
    return out


def force_chains(case, shear, consolidate):
    """Means over the snapshots of the last third of the shear, since chains come and go."""
    sigma_0, before = shear.settings["normal_stress"], shearing.mirrored(consolidate.snapshots[-1], shear.direction)
    late = shear.snapshots[len(shear.snapshots) * 2 // 3:]
    rows = shear.series
    friction = rows["shear_friction"][rows["shear_strain"] >= strength.late * rows["shear_strain"][-1]].mean()
    return {"above_4_consolidated": forces.share_above(before, sigma_0),
            "above_4_sheared": np.mean([forces.share_above(x, sigma_0) for x in late]),
            "strong_tilt_consolidated": abs(strong_tilt(before)), "strong_tilt_sheared": np.mean([strong_tilt(x) for x in late]),
            "stress_tilt": np.mean([tilt(forces.stress_tensor(x)) for x in late]),
            "applied_tilt": np.degrees(np.arctan(friction))}


def require_end(case):
    """Raises MissingData where the shear has not come to its end: its ultimate state would be that of the strain it has."""
    shear = shearing.of(case)
    rows = shear.series
    share = rows["stage_time"][-1] / duration(shear, shearing.height_0(rows))
    if share < 0.999:
        raise MissingData(f"{case.directory}: the shear has come to {100 * share:.0f} % of its time; it is still running, or was cut off")


def measure(case, say=print):
    """The strengths, and all that can be had from consolidation and snapshots; what lacks data is left out, and said."""
    require_end(case)
    out = strengths(case)
    for part in (about, taylor, consolidation, profiles, rotations, force_chains):
        try:
            out |= part(case, shearing.of(case), case.stage("consolidate"))
        except MissingData as why:
            say(f"{part.__name__.replace('_', ' ')}: not measured: {why}")
    return out


def table(rows, file=None):
    """The same as CSV text; written to `file` where one is given."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    out = io.StringIO()
    lines = csv.writer(out, lineterminator="\n")  # which puts into quotes what has a comma in it
    lines.writerow(names)
    for row in rows:
        lines.writerow([f"{row[n]:.6g}" if isinstance(row.get(n), float) else row.get(n, "") for n in names])
    text = out.getvalue()
    if file:
        Path(file).write_text(text)
    return text


def read_table(file):
    def value(text):
        try:
            return float(text)
        except ValueError:
            return text
    with Path(file).open() as lines:
        return [{k: value(v) for k, v in row.items()} for row in csv.DictReader(lines)]


def mohr_coulomb(rows):
    """Peak (smoothed and raw) and ultimate strength lines of measured runs."""
    sigma_0 = np.array([r["sigma_0_kPa"] for r in rows]) * 1e3
    return {what: strength.mohr_coulomb(sigma_0, sigma_0 * [r[key] for r in rows]) for what, key in
            (("peak", "friction_peak"), ("peak_raw", "friction_peak_raw"), ("ultimate", "friction_ultimate"))}


def mohr_coulomb_by_seed(rows):
    """The same for the runs of each seed alone: a list of such dictionaries, of the seeds that have enough normal stresses."""
    fits = []
    for seed in sorted({r["seed"] for r in rows}):
        try:
            fits.append(mohr_coulomb([r for r in rows if r["seed"] == seed]))
        except ValueError:
            continue
    return fits
