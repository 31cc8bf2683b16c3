"""The report of the study angular: what a resistance to rolling does to a bed that shears, beside the angular sand of the paper (par. 54).

A run is one of a packing (dense or loose), a coefficient of rolling resistance, a friction of the grains, a seed and a normal stress."""
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path

import numpy as np

from . import compaction, dilatancy, measure, paper, profile, rotation, section, shearing, strength, study_runs
from .intervals import mean_interval, show
from .page import LeftOut, Page, machine, version
from .style import lines, page as page_width, panel, plt

early = 0.05    # of strain: within it stage 1, where a bed may contract
tiny = 2e-3     # diameters of contraction, below which it is none


@dataclass(frozen=True, order=True)
class Kind:
    """What runs that differ in packing and normal stress alone have in common."""
    loose: bool
    mu_s: float
    mu_roll: float

    @property
    def label(self):
        return f"μ_r = {self.mu_roll:g}" + (f", μ = {self.mu_s:g}" if self.mu_s != 0.3 else "") + (", loose" if self.loose else "")


class Run(study_runs.Run):
    def __init__(self, case):
        super().__init__(case)
        contact = case.settings["contact"]
        self.kind = Kind(self.name.startswith("loose"), contact["mu_s"], contact.get("mu_roll", 0.0))

    @cached_property
    def diameter(self):
        return self.case.diameter

    @cached_property
    def friction(self):
        return strength.smoothed(self.rows["shear_strain"], self.rows["shear_friction"])

    @property
    def dilation(self):
        """In diameters, for each row."""
        return self.rows["dilation"] / self.diameter

    def contraction(self):
        """Deepest point of the bed below where it stood when shear began, diameters, and its strain; within `early`."""
        own = self.rows["shear_strain"] <= early
        deepest = int(np.argmin(self.dilation[own]))
        return max(0.0, -float(self.dilation[own][deepest])), float(self.rows["shear_strain"][own][deepest])

    def measured(self):
        s, last = strength.strength(self.stage), self.stage.snapshots[-1]
        zone, _ = profile.shear_zone(last)
        half, _ = profile.shear_zone(last, share=0.5)
        z, role = last.grains["position"][:, 2], last.grains["role"]
        free = zone * self.diameter / (z[role == 2].mean() - z[role == 1].max())
        turned = rotation.statistics(last)
        late = self.stage.snapshots[len(self.stage.snapshots) * 2 // 3:]
        contraction, at = self.contraction()
        late_rows = self.rows["shear_strain"] >= strength.late * s.strain
        settings = self.case.settings
        return {
            "packing": "loose" if self.kind.loose else "dense", "mu_roll": self.kind.mu_roll, "mu_s": self.kind.mu_s, "seed": self.seed, "sigma_0_kPa": self.sigma_0 / 1e3,
            "grains": len(z), "strain": s.strain, "friction_peak": s.peak, "friction_peak_raw": s.peak_raw, "strain_peak": s.peak_strain, "friction_ultimate": s.ultimate,
            "dilation_d": s.dilation, "contraction_d": contraction, "strain_contraction": at, "porosity_0": shearing.porosity_0(self.rows), "height_0_m": self.height_0,
            "shear_zone_d": zone, "shear_zone_reach": free, "shear_zone_half_d": half, "coordination_late": self.rows["coordination"][late_rows].mean(),
            "rotation_mean_y": turned.mean[1], "rotation_variance_x": turned.variance[0], "rotation_variance_y": turned.variance[1], "rotation_variance_z": turned.variance[2],
            "opposite_spins": float(np.mean([section.opposite_spins(x) for x in late])),
            "inertia_number": compaction.inertia_number(abs(self.settings["strain_rate"]), self.diameter / 2, settings["grains"]["density"], self.sigma_0),
            "hours": measure.hours(self.case),
        }


def load(study, note):
    return sorted(study_runs.load(study, Run, note), key=lambda r: (r.kind, r.sigma_0, r.seed))


def of_kind(rows, kind, sigma_0=None):
    return [r for r in rows if (r["packing"] == "loose", r["mu_s"], r["mu_roll"]) == (kind.loose, kind.mu_s, kind.mu_roll) and sigma_0 in (None, r["sigma_0_kPa"])]


def values(rows, key):
    return np.array([r[key] for r in rows], float)


def shown(rows, key, digits):
    return show(*mean_interval(values(rows, key)), digits) if rows else "-"


def angle(fit):
    """phi and C of a Mohr-Coulomb line with their 95 % intervals."""
    phi, C = fit.interval()
    return show(fit.phi, phi, 1, "°"), show(fit.C / 1e3, C / 1e3, 2, " kPa")


def strength_table(rows, kinds):
    """phi and C by Mohr-Coulomb lines through the runs of a kind, and friction at the highest stress; then the materials of Table 2."""
    top = max(r["sigma_0_kPa"] for r in rows)
    table = []
    for kind in kinds:
        own, high = of_kind(rows, kind), of_kind(rows, kind, top)
        if not high:
            continue
        try:
            fits = measure.mohr_coulomb(own)
            fitted = [*angle(fits["peak"]), *angle(fits["ultimate"])]
        except ValueError:
            fitted = ["-"] * 4
        table.append([kind.label, *fitted, shown(high, "friction_peak", 3), shown(high, "friction_ultimate", 3)])
    for name, (phi_p, C_p, phi_u, C_u) in paper.materials.items():
        at_top = [f"{C / top + np.tan(np.radians(phi)):.3f}" for phi, C in ((phi_p, C_p), (phi_u, C_u))]
        table.append([f"{name} (Table 2)", f"{phi_p}°", f"{C_p} kPa", f"{phi_u}°", f"{C_u} kPa", *at_top])
    return ["", "φ_p", "C_p", "φ_u", "C_u", f"peak friction at {top:g} kPa", "ultimate"], table


def bed_tables(rows, kinds):
    """{normal stress: lines}: what the bed does, a line for each kind."""
    keys = {"porosity_0": ("porosity before shear", 3), "contraction_d": ("contraction in stage 1 (diameters)", 4), "strain_contraction": ("to the strain", 4),
            "dilation_d": ("dilation at the end (diameters)", 2), "strain_peak": ("strain at the peak", 3), "shear_zone_d": ("shear zone, to 5 % (diameters)", 1),
            "shear_zone_half_d": ("depth of half the displacement", 1), "shear_zone_reach": ("share of the free depth", 2), "coordination_late": ("contacts a grain, last third", 2)}
    head = ["", *(name for name, _ in keys.values())]
    return head, {sigma: [[k.label, *(shown(own, key, digits) for key, (_, digits) in keys.items())] for k in kinds if (own := of_kind(rows, k, sigma))]
                  for sigma in sorted({r["sigma_0_kPa"] for r in rows})}


def rotation_table(rows, kinds):
    top = max(r["sigma_0_kPa"] for r in rows)
    keys = {"rotation_mean_y": 3, "rotation_variance_x": 3, "rotation_variance_y": 3, "rotation_variance_z": 3, "opposite_spins": 3}
    table = [[k.label, *(shown(own, key, digits) for key, digits in keys.items())] for k in kinds if (own := of_kind(rows, k, top))]
    return ["", "mean about y (rad)", "variance about x (rad²)", "about y", "about z", "contacts whose grains spin against each other"], table


def looks(runs):
    kinds = list(dict.fromkeys(r.kind for r in runs))
    return dict(zip(kinds, lines(len(kinds))))


def drawn_style(look):
    return {k: look[k] for k in ("color", "linestyle")}


def legend(figure, look, y=0.0, columns=4):
    handles = [plt.Line2D([], [], label=k.label, **drawn_style(s)) for k, s in look.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, y), ncol=min(columns, len(handles)))


def averaged(runs, of):
    """Strain and the mean over runs of what `of` takes from each, row by row as far as the shortest goes."""
    count = min(len(r.rows) for r in runs)
    return runs[0].rows["shear_strain"][:count], np.mean([of(r)[:count] for r in runs], axis=0)


def curves_figure(runs):
    """Friction and dilation at the highest stress, means over the packings, and the dilation of stage 1."""
    top, look = max(r.sigma_0 for r in runs), looks(runs)
    figure, (over, under, first) = plt.subplots(1, 3, figsize=(page_width, 2.7), gridspec_kw={"wspace": 0.46})
    for kind, own in study_runs.grouped([r for r in runs if r.sigma_0 == top], lambda r: r.kind).items():
        over.plot(*averaged(own, lambda r: r.friction), **drawn_style(look[kind]))
        strain, dilation = averaged(own, lambda r: r.dilation)
        under.plot(strain, dilation, **drawn_style(look[kind]))
        early_rows = strain <= early / 2
        first.plot(strain[early_rows], dilation[early_rows], **drawn_style(look[kind]))
    over.set(xlabel="shear strain $\\gamma$", ylabel="friction $\\tau/\\sigma'$", xlim=(0, None), ylim=(0, None))
    under.set(xlabel="shear strain $\\gamma$", ylabel="dilation (diameters)", xlim=(0, None))
    first.set(xlabel="shear strain $\\gamma$", xlim=(0, early / 2), ylabel="dilation (diameters)")
    low = min(line.get_ydata().min() for line in first.lines)
    first.set_ylim(1.3 * min(low, -tiny), max(0.06, -4 * low))
    first.axhline(0, color="0.6", lw=0.5, zorder=0)
    first.set_xticks([0, early / 4, early / 2])
    legend(figure, look, -0.06)
    for ax, letter in zip((over, under, first), "abc"):
        panel(ax, letter)
    return figure


def strength_figure(rows, kinds):
    """Angles by coefficient of rolling resistance, with the materials of Table 2; dilation and shear zone by the same."""
    figure, (angles, swell, zone) = plt.subplots(1, 3, figsize=(page_width, 2.7), gridspec_kw={"wspace": 0.42})
    sigmas = sorted({r["sigma_0_kPa"] for r in rows})
    for mu_s, fill in zip(sorted({k.mu_s for k in kinds if not k.loose}), ("full", "none")):
        own = sorted(k for k in kinds if not k.loose and k.mu_s == mu_s)
        x = [k.mu_roll for k in own]
        try:
            fits = [measure.mohr_coulomb(of_kind(rows, k)) for k in own]
        except ValueError:
            fits = []
        for which, colour, name in (("peak", "tab:red", "φ_p"), ("ultimate", "tab:blue", "φ_u")):
            if fits:
                angles.errorbar(x, [f[which].phi for f in fits], [f[which].interval()[0] for f in fits], color=colour, marker="o", ms=3.5, lw=0.8, fillstyle=fill,
                                ls="-" if fill == "full" else "--", label=f"{name}, μ = {mu_s:g}")
        for sigma, colour in zip(sigmas, ("tab:green", "tab:purple", "tab:brown")):
            for axes, key in ((swell, "dilation_d"), (zone, "shear_zone_half_d")):
                there = [k for k in own if of_kind(rows, k, sigma)]
                mean, half = np.array([mean_interval(values(of_kind(rows, k, sigma), key)) for k in there]).T
                axes.errorbar([k.mu_roll for k in there], mean, np.nan_to_num(half), color=colour, marker="o", ms=3.5, lw=0.8, fillstyle=fill, ls="-" if fill == "full" else "--",
                              label=f"{sigma:g} kPa, μ = {mu_s:g}")
    for name, where in (("quartz sand", {"x": 0.02, "ha": "left"}), ("glass beads", {"x": 0.98, "ha": "right"})):
        phi_p, _, phi_u, _ = paper.materials[name]
        angles.axhline(phi_p, color="tab:red", lw=0.5, ls=":", zorder=0), angles.axhline(phi_u, color="tab:blue", lw=0.5, ls=":", zorder=0)
        angles.text(y=phi_p + 0.3, s=name, fontsize=6, va="bottom", transform=angles.get_yaxis_transform(), **where)
    swell.axhline(paper.dilation["quartz sand"], color="0.5", lw=0.5, ls=":", zorder=0)
    swell.text(0.98, paper.dilation["quartz sand"], "quartz sand", fontsize=6, ha="right", va="bottom", transform=swell.get_yaxis_transform())
    for axes, label in ((angles, "angle of friction (°)"), (swell, "dilation (diameters)"), (zone, "depth of half the\ndisplacement (diameters)")):
        axes.set(xlabel="rolling resistance $\\mu_r$", ylabel=label, ylim=(0, None))
    angles.set_ylim(0, 52)
    swell.set_ylim(0, 2.4)
    angles.legend(fontsize=6, loc="lower right"), zone.legend(fontsize=6, loc="lower right")
    for ax, letter in zip((angles, swell, zone), "abc"):
        panel(ax, letter)
    return figure


def profiles_figure(runs):
    """Displacement with depth at the end, a panel for each normal stress; means over the packings."""
    sigmas, look = sorted({r.sigma_0 for r in runs}), looks(runs)
    figure, axes = plt.subplots(1, len(sigmas), figsize=(page_width, 3.0), sharey=True, squeeze=False, gridspec_kw={"wspace": 0.1})
    for ax, sigma in zip(axes[0], sigmas):
        for kind, own in study_runs.grouped([r for r in runs if r.sigma_0 == sigma], lambda r: r.kind).items():
            depth, mean = mean_profile(own)
            ax.plot(mean, depth, **drawn_style(look[kind]))
        ax.axvline(0.05, color="0.6", lw=0.5, zorder=0)
        ax.set(xlabel="displacement over the layer's", xlim=(0, 1.02), title=f"$\\sigma_0$ = {sigma / 1e3:g} kPa")
    axes[0, 0].invert_yaxis()
    axes[0, 0].set_ylabel("depth below the wall (diameters)")
    legend(figure, look, -0.03)
    for ax, letter in zip(axes[0], "abc"):
        panel(ax, letter)
    return figure


def mean_profile(runs):
    """Depth below the wall (diameters) and displacement over the layer's, mean over the runs."""
    depth = np.arange(0.5, min(r.stage.snapshots[-1].top_wall / r.diameter for r in runs), 0.5)
    found = []
    for r in runs:
        s = r.stage.snapshots[-1]
        z, u = profile.displacement(s)
        found.append(np.interp(depth, ((s.top_wall - z) / r.diameter)[::-1], (u / profile.layer_displacement(s))[::-1]))
    return depth, np.mean(found, axis=0)


def rotation_figure(runs):
    """How far free grains have turned about y at the end, at the highest stress: all packings."""
    top, look = max(r.sigma_0 for r in runs), looks(runs)
    figure, (free, with_depth) = plt.subplots(1, 2, figsize=(page_width, 2.8), gridspec_kw={"wspace": 0.28})
    for kind, own in study_runs.grouped([r for r in runs if r.sigma_0 == top], lambda r: r.kind).items():
        turned = np.concatenate([rotation.rotations(r.stage.snapshots[-1])[:, 1] for r in own])
        density, edges = np.histogram(turned, bins=np.arange(-3.125, 3.2, 0.25), density=True)
        free.step((edges[1:] + edges[:-1]) / 2, density, where="mid", lw=0.9, **drawn_style(look[kind]))
        depth = np.concatenate([(s.top_wall - s.grains["position"][:, 2])[s.grains["role"] == 0] / r.diameter for r in own for s in [r.stage.snapshots[-1]]])
        edges = np.arange(0, depth.max(), 2.0)
        which = np.digitize(depth, edges) - 1
        there = [k for k in range(len(edges)) if (which == k).sum() > 20]
        with_depth.plot([turned[which == k].mean() for k in there], edges[there] + 1.0, **drawn_style(look[kind]))
    free.axvline(0, color="0.6", lw=0.5, zorder=0), with_depth.axvline(0, color="0.6", lw=0.5, zorder=0)
    free.set(xlabel="rotation about y (rad)", ylabel="density (1/rad)", yscale="log")
    with_depth.set(xlabel="mean rotation about y (rad)", ylabel="depth below the wall (diameters)")
    with_depth.invert_yaxis()
    legend(figure, look, -0.03)
    panel(free, "a"), panel(with_depth, "b")
    return figure


captions = {
    "curves": "At the highest normal stress: (a) friction (means over a strain of 0.02), (b) dilation, (c) dilation in stage 1. Means over the packings.",
    "strength": "By coefficient of rolling resistance, dense packings, 95 % intervals: (a) angles of friction at the peak and in the ultimate state, dotted those of Table 2; "
                "(b) dilation at the end; (c) depth at which the displacement is half of the layer's.",
    "profiles": "Displacement with depth at the end of the shear, slabs one diameter thick, means over the packings. Thin line: 5 % of the layer's.",
    "rotations": "Rotation of the free grains about y at the end of the shear, highest normal stress: (a) its distribution (par. 45, Fig. 11), (b) its mean with depth. "
                 "A bed that turns as a whole with the shear would have positive rotations.",
    "taylor": dilatancy.caption,
}


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, figures/, report.html, report.md to `output`."""
    output, note = Path(output), LeftOut(say)
    made_by = version()
    runs = load(study, note)
    output.mkdir(parents=True, exist_ok=True)
    rows, kinds = [r.measured() for r in runs], list(dict.fromkeys(r.kind for r in runs))
    measure.table(rows, output / "measurements.csv")
    settings, top = runs[0].case.settings, max(r.sigma_0 for r in runs)
    groups = {k.label: [r.stage for r in own] for k, own in study_runs.grouped([r for r in runs if r.sigma_0 == top], lambda r: r.kind).items()}
    page = Page()
    page.heading("What a resistance to rolling does to a bed that shears", 1)
    page.paragraph(f"{len(runs)} runs of {rows[0]['grains']:,} grains: seeds {', '.join(map(str, sorted({r.seed for r in runs})))}, normal stress "
                   f"{', '.join(f'{s / 1e3:g}' for s in sorted({r.sigma_0 for r in runs}))} kPa, preset {settings['model'].get('preset')}, sheared at {runs[0].settings['strain_rate']:g} 1/s to a strain of "
                   f"{max(r['strain'] for r in rows):.2f}. {np.nansum(values(rows, 'hours')):.2f} hours of runs, packing apart. This report: version {made_by}, on {machine()}, {date.today()}.")
    page.paragraph("μ_r is the coefficient of rolling resistance between grains (contact.mu_roll): the couple at a contact is at most μ_r times the normal force times half a radius. μ is their friction, 0.3 as in the paper "
                   "where nothing else is said. Dense beds are pressed together without friction, loose ones with the friction and the rolling resistance that they are sheared with. "
                   "± is half of a 95 % interval: of φ and C from the fit over the runs, of all else over the packings.")
    page.heading("Strength, beside Table 2")
    page.table(*strength_table(rows, kinds))
    head, tables = bed_tables(rows, kinds)
    for sigma, table in tables.items():
        page.heading(f"The bed at {sigma:g} kPa")
        page.table(head, table)
    page.heading(f"Rotations at {top / 1e3:g} kPa (par. 44 and 45)")
    page.paragraph(f"Of free grains, at the end of the shear. The paper's mean about y, over all grains at a strain of 1: {paper.rotation_mean[1]:g} rad, with variances of "
                   f"{', '.join(f'{v:g}' for v in paper.rotation_variance)} rad² about x, y and z.")
    page.table(*rotation_table(rows, kinds))
    dilatancy.add(page, groups)
    for why in note:
        page.paragraph(why)
    if notes:
        page.notes(Path(notes).read_text())
    page.figures({"curves": lambda: curves_figure(runs), "strength": lambda: strength_figure(rows, kinds), "profiles": lambda: profiles_figure(runs),
                  "rotations": lambda: rotation_figure(runs), "taylor": lambda: dilatancy.figure(groups)}, captions, output / "figures")
    page.write(output, "Resistance to rolling, with Moraine")
    say(str(output / "report.html"))
    for line in strength_table(rows, kinds)[1]:
        say("  " + "  ".join(map(str, line)))
