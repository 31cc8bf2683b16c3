"""The report of the study grading: what the width of the grain sizes does to a bed that shears, at equal D50 (par. 56 of the paper).

A run is one of a grading, a packing (seed) and a normal stress. Lengths are in D50, the diameter of which half of the mass is finer.
"""
from datetime import date
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from scipy import stats

from . import compaction, dilatancy, forces, measure, profile, shearing, strength
from .results import Results, MissingData
from .intervals import mean_interval, show
from .page import LeftOut, Page, machine, version
from .progress import duration
from .style import lines, page as page_width, panel, plt

gradings = {"1": "1:1", "5": "1:5", "20": "1:20", "fractal": "fractal"}  # names of the cases, shear-NAME, in the order of the report
thirds = 3          # of the mass, by size: the finest, the middle and the coarsest
late = strength.late
bounded = 0.8        # of the free depth: a shear zone that takes more is bounded by it


def by_mass(radius):
    """Order of the grains by size, and for each in that order the share of the mass that is finer or as fine."""
    order = np.argsort(radius, kind="stable")
    mass = np.cumsum(radius[order] ** 3)
    return order, mass / mass[-1]


def size_at(radius, share):
    """Diameter of which this share of the mass is finer."""
    order, finer = by_mass(radius)
    return float(2 * radius[order][np.searchsorted(finer, share)])


def third_of_mass(radius):
    """0 for the grains that make up the finest third of the mass, 1, 2 for the coarsest."""
    order, finer = by_mass(radius)
    which = np.empty(len(radius), int)
    which[order] = np.minimum((finer * thirds * (1 - 1e-12)).astype(int), thirds - 1)
    return which


def load_bearing(snapshot, least=2):
    """Mask of the grains left when those with fewer than `least` contacts with others left are taken away, again and again; wall
    contacts are not in a snapshot, so grains that touch a wall count as left. And the contacts between grains left, each once."""
    g, c = snapshot.grains, snapshot.contacts
    n = len(g["radius"])
    i, j = c["i"], c["j"]
    z, r = g["position"][:, 2], g["radius"]
    held = (z - r <= 0) | (z + r >= snapshot.top_wall)
    left = np.ones(n, bool)
    while True:
        both = left[i] & left[j]
        count = np.bincount(i[both], minlength=n) + np.bincount(j[both], minlength=n)
        fewer = left & (count < least) & ~held
        if not fewer.any():
            return left, int(both.sum())
        left &= ~fewer


class Run:
    """A case that has been sheared, and what is read off it."""

    def __init__(self, case):
        self.case, self.seed = case, case.seed
        self.stage = shearing.along(case.stage("shear"))
        self.rows = self.stage.series
        self.sigma_0 = self.stage.settings["normal_stress"]
        self.grading = next((p.removeprefix("shear-") for p in case.directory.parts[::-1] if p.startswith("shear-")), "")
        if self.grading not in gradings:
            raise MissingData(f"{case.directory}: expected to lie in one of {', '.join('shear-' + g for g in gradings)}")

    @property
    def done(self):
        return min(1.0, self.rows["stage_time"][-1] / duration(self.stage, shearing.height_0(self.rows)))

    @cached_property
    def radius(self):
        return self.stage.snapshots[0].grains["radius"]

    @cached_property
    def d50(self):
        return size_at(self.radius, 0.5)

    @cached_property
    def friction(self):
        return strength.smoothed(self.rows["shear_strain"], self.rows["shear_friction"])

    @cached_property
    def dilation(self):
        """In D50, for each row."""
        return self.rows["dilation"] / self.d50

    @cached_property
    def late_snapshots(self):
        return self.stage.snapshots[len(self.stage.snapshots) * 2 // 3:]

    @property
    def inertia_number(self):
        """With the mass that answers to forces, which density scaling makes larger."""
        settings = self.case.settings
        scaled = np.maximum(self.radius, settings["model"].get("density_scaling", 0.0))
        density = settings["grains"]["density"] * (scaled**3).sum() / (self.radius**3).sum()
        return compaction.inertia_number(abs(self.stage.settings["strain_rate"]), self.d50 / 2, density, self.sigma_0)

    def segregation(self):
        """How far the finest third of the mass has risen over the coarsest during the shear, among free grains, in D50."""
        first, last = self.stage.snapshots[0].grains, self.stage.snapshots[-1].grains
        third, free = third_of_mass(self.radius), last["role"] == 0
        rise = last["position"][:, 2] - first["position"][:, 2]

        def mean(which):
            chosen = free & (third == which)
            if not chosen.any():
                raise MissingData(f"{self.case.directory}: no free grain in a third of the mass")
            return np.average(rise[chosen], weights=self.radius[chosen] ** 3)
        return float(mean(0) - mean(thirds - 1)) / self.d50

    def bearing(self):
        """Means over the last third of the shear: share of grains that bear load, contacts of each of them, and the pressure of the
        finest third of the mass over that of all, free grains."""
        third = third_of_mass(self.radius)
        share, contacts, fines = [], [], []
        for s in self.late_snapshots:
            left, count = load_bearing(s)
            share.append(left.mean()), contacts.append(2 * count / max(1, left.sum()))
            free = s.grains["role"] == 0
            volume, pressure = self.radius**3, s.grains["pressure"]
            fine = free & (third == 0)
            fines.append(np.average(pressure[fine], weights=volume[fine]) / np.average(pressure[free], weights=volume[free]))
        return np.mean(share), np.mean(contacts), np.mean(fines)

    def strong_contacts(self):
        """Share of the contacts between free grains whose normal force is more than four times the mean of them, and the share of all
        normal force that these carry: means over the last third of the shear."""
        number, force = [], []
        for s in self.late_snapshots:
            f = s.normal_forces()[forces.free_contacts(s)]
            strong = f > 4 * f.mean()
            number.append(strong.mean()), force.append(f[strong].sum() / f.sum())
        return np.mean(number), np.mean(force)

    def reach(self, depth):
        """Of the depth from the middle of the driven layer down to the layer that stands still, the share that the shear zone takes."""
        g = self.stage.snapshots[-1].grains
        z, role = g["position"][:, 2], g["role"]
        return depth * self.d50 / (z[role == 2].mean() - z[role == 1].max())

    def measured(self):
        s = strength.strength(self.stage)
        depth, block = profile.shear_zone(self.stage.snapshots[-1], diameter=self.d50)
        half, _ = profile.shear_zone(self.stage.snapshots[-1], share=0.5, diameter=self.d50)
        share, contacts, fines = self.bearing()
        strong, carried = self.strong_contacts()
        tail = self.rows["shear_strain"] >= 0.9 * self.rows["shear_strain"][-1]
        return {
            "grading": self.grading, "seed": self.seed, "sigma_0_kPa": self.sigma_0 / 1e3, "grains": len(self.radius),
            "d50_m": self.d50, "widest": float(self.radius.max() / self.radius.min()), "strain": s.strain,
            "friction_peak": s.peak, "strain_peak": s.peak_strain, "friction_ultimate": s.ultimate, "friction_ultimate_std": s.ultimate_std,
            "dilation_d50": self.dilation[tail].mean(), "height_0_m": shearing.height_0(self.rows), "porosity_0": shearing.porosity_0(self.rows),
            "shear_zone_d50": depth, "shear_zone_reach": self.reach(depth), "shear_zone_half_d50": half, "shear_zone_integral_d50": block, "segregation_d50": self.segregation(),
            "load_bearing_share": share, "contacts_of_load_bearing": contacts, "pressure_of_finest_third": fines,
            "strong_contacts": strong, "force_of_strong_contacts": carried, "inertia_number": self.inertia_number,
            "hours": measure.hours(self.case),
        }


def load(study, note):
    """Finished runs, in order of grading, normal stress and seed; the others are named."""
    runs = []
    for file in sorted(Path(study).glob("seed-*/shear-*/sweep/*/output/case.toml")):
        try:
            run = Run(Results(file.parents[1]))
            if run.done < 0.999:
                raise MissingData(f"has come to {100 * run.done:.0f} % of its shear")
            runs.append(run)
        except MissingData as why:
            note(f"left out: {file.parents[1]}: {why}")
    order = list(gradings)
    return sorted(runs, key=lambda r: (order.index(r.grading), r.sigma_0, r.seed))


quantities = {  # column: name, digits
    "friction_peak": ("peak friction", 3), "friction_ultimate": ("ultimate friction", 3), "dilation_d50": ("dilation (D50)", 2),
    "shear_zone_d50": ("shear zone, to 5 % (D50)", 1), "shear_zone_reach": ("its share of the depth that is free", 2),
    "shear_zone_half_d50": ("depth of half the displacement (D50)", 1), "shear_zone_integral_d50": ("as a block (D50)", 1),
    "porosity_0": ("porosity before shear", 3), "segregation_d50": ("finest third over coarsest (D50)", 2),
    "load_bearing_share": ("grains that bear load", 2), "contacts_of_load_bearing": ("contacts of each of these", 2),
    "pressure_of_finest_third": ("pressure of the finest third", 2), "strong_contacts": ("contacts above 4 times the mean", 3),
    "force_of_strong_contacts": ("their share of the force", 2),
}


def values(rows, key):
    return np.array([r[key] for r in rows], float)


def select(rows, grading, sigma_0):
    return [r for r in rows if r["grading"] == grading and r["sigma_0_kPa"] == sigma_0]


def stresses(rows):
    return sorted({r["sigma_0_kPa"] for r in rows})


def present(rows):
    return [g for g in gradings if any(r["grading"] == g for r in rows)]


def tables(rows):
    """{normal stress, kPa: lines of a table, a quantity each, a column for each grading}."""
    return {sigma: [[name, *(show(*mean_interval(values(own, key)), digits) if (own := select(rows, g, sigma)) else "-" for g in present(rows))]
                    for key, (name, digits) in quantities.items()] for sigma in stresses(rows)}


def difference(rows, key, grading, reference="1"):
    """Of the means of two gradings, with the half width of its 95 % interval, by Welch's t, averaged over the normal stresses; nan for less than two runs of either."""
    means, variances, freedoms = [], [], []
    for sigma in stresses(rows):
        a, b = values(select(rows, grading, sigma), key), values(select(rows, reference, sigma), key)
        if len(a) < 2 or len(b) < 2:
            return np.nan, np.nan
        va, vb = a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)
        means.append(a.mean() - b.mean()), variances.append(va + vb)
        freedoms.append(len(a) + len(b) - 2 if va + vb == 0 else (va + vb) ** 2 / (va**2 / (len(a) - 1) + vb**2 / (len(b) - 1)))
    return float(np.mean(means)), float(stats.t.ppf(0.975, sum(freedoms)) * np.sqrt(sum(variances)) / len(means))


def verdict(mean, half, digits, less, more):
    if not np.isfinite(half):
        return "too few runs to tell"
    return show(mean, half, digits) + ": " + ("no difference seen" if abs(mean) <= half else less if mean < 0 else more)


def findings(rows):
    """What the paper tells of others, and what is found here: rows of (what, who, here)."""
    found = []
    for g in present(rows):
        if g == "1":
            continue
        zone, friction = difference(rows, "shear_zone_half_d50", g), difference(rows, "friction_ultimate", g)
        peak = difference(rows, "friction_peak", g)
        found.append([f"depth of half the displacement of {gradings[g]} less that of 1:1, D50", "fines localise strain (Morgan & Boettcher 1999, two dimensions)",
                      verdict(*zone, 1, "shallower", "deeper")])
        found.append([f"ultimate friction of {gradings[g]} less that of 1:1",
                      "no difference (Mair et al. 2002, glass beads); slightly lower with more fines (Morgan 1999, two dimensions)",
                      verdict(*friction, 3, "lower", "higher")])
        found.append([f"peak friction of {gradings[g]} less that of 1:1", "not told there", verdict(*peak, 3, "lower", "higher")])
    return found


def look_of(runs):
    names = [g for g in gradings if any(r.grading == g for r in runs)]
    return dict(zip(names, lines(len(names))))


def curves_figure(runs):
    """Friction and dilation against strain, a column for each normal stress; a line for each packing."""
    sigmas, look = sorted({r.sigma_0 for r in runs}), look_of(runs)
    figure, axes = plt.subplots(2, len(sigmas), figsize=(page_width, 4.2), sharex=True, sharey="row", squeeze=False,
                                gridspec_kw={"hspace": 0.12, "wspace": 0.08})
    for column, sigma in zip(axes.T, sigmas):
        for r in runs:
            if r.sigma_0 != sigma:
                continue
            style_of = {k: look[r.grading][k] for k in ("color", "linestyle")}
            column[0].plot(r.rows["shear_strain"], r.friction, lw=0.8, **style_of)
            column[1].plot(r.rows["shear_strain"], r.dilation, lw=0.8, **style_of)
        column[0].set_title(f"$\\sigma_0$ = {sigma / 1e3:g} kPa", fontsize=8)
        column[1].set_xlabel("shear strain $\\gamma$")
    axes[0, 0].set_ylabel("friction $\\tau/\\sigma'$"), axes[1, 0].set_ylabel("dilation ($D_{50}$)")
    axes[0, 0].set_xlim(0), axes[0, 0].set_ylim(0)
    legend(figure, look)
    for ax, letter in zip(axes.flat, "abcdef"):
        panel(ax, letter)
    return figure


def legend(figure, look, y=0.03):
    handles = [plt.Line2D([], [], label=gradings[g], **{k: s[k] for k in ("color", "linestyle")}) for g, s in look.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, y), ncol=len(handles))


def profiles_figure(runs):
    """Grading curves, and at the end of the shear the displacement with depth, a panel for each normal stress."""
    sigmas, look = sorted({r.sigma_0 for r in runs}), look_of(runs)
    figure, axes = plt.subplots(1, 1 + len(sigmas), figsize=(page_width, 2.8), gridspec_kw={"wspace": 0.32})
    for g, s in look.items():
        radius = next(r for r in runs if r.grading == g).radius
        order, finer = by_mass(radius)
        axes[0].plot(2e3 * radius[order], 100 * finer, **{k: s[k] for k in ("color", "linestyle")})
    axes[0].set(xscale="log", xlabel="diameter (mm)", ylabel="finer by mass (%)", ylim=(0, 100))
    for ax, sigma in zip(axes[1:], sigmas):
        for r in runs:
            if r.sigma_0 == sigma:
                snapshot = r.stage.snapshots[-1]
                z, u = profile.displacement(snapshot, r.d50)
                ax.plot(u / profile.layer_displacement(snapshot), (snapshot.top_wall - z) / r.d50, lw=0.8,
                        **{k: look[r.grading][k] for k in ("color", "linestyle")})
        ax.axvline(0.05, color="0.6", lw=0.5, zorder=0)
        ax.set(xlabel="displacement over the layer's", xlim=(0, 1.02), title=f"$\\sigma_0$ = {sigma / 1e3:g} kPa")
        ax.invert_yaxis()
    axes[1].set_ylabel("depth below the wall ($D_{50}$)")
    legend(figure, look, -0.08)
    for ax, letter in zip(axes, "abcd"):
        panel(ax, letter)
    return figure


def chains_figure(runs):
    """Forces between free grains in a slice two D50 thick, the last snapshot of the first packing of each grading, at the highest stress."""
    top = max(r.sigma_0 for r in runs)
    chosen = list({r.grading: r for r in reversed(runs) if r.sigma_0 == top}.values())[::-1]
    figure, axes = plt.subplots(1, len(chosen), figsize=(page_width, 2.9), sharey=True, squeeze=False, gridspec_kw={"wspace": 0.08})
    for ax, r, letter in zip(axes[0], chosen, "abcd"):
        s = r.stage.snapshots[-1]
        slice_ = 2 * r.d50
        x, radius = s.grains["position"], r.radius
        cut = np.abs(x[:, 1] - s.box[1] / 2) < np.minimum(radius, slice_ / 2)
        for (px, _, pz), q in zip(x[cut], radius[cut]):
            ax.add_patch(plt.Circle((px, pz), q, fc="0.93", ec="0.75", lw=0.25, zorder=1))
        net = forces.network(s, thickness=slice_)
        unit = top * r.d50**2  # N
        ax.add_collection(LineCollection(net.segments, linewidths=np.clip(net.force / unit, 0.05, 4), colors=look_of(runs)[r.grading]["color"], zorder=2))
        ax.set(aspect="equal", xlim=(0, s.box[0]), ylim=(0, s.top_wall), title=gradings[r.grading], xlabel="x (m)")
        panel(ax, letter)
    axes[0, 0].set_ylabel("z (m)")
    return figure


captions = {
    "curves": "Friction (means over a strain of 0.02) and dilation against shear strain, each packing a line.",
    "profiles": "Grading curves of the grains as drawn, and the displacement with depth at the end of the shear, slabs one D50 thick, each packing a line. "
                "Thin line: 5 % of the layer's, where the shear zone is taken to end.",
    "chains": "Normal forces between free grains at the end of the shear, in a slice two D50 thick across the middle, as wide as the force over σ_0 D50², at the highest "
              "normal stress. Grey: grains that the middle plane cuts.",
    "taylor": f"At the highest normal stress. {dilatancy.caption}",
}


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
    settings = runs[0].case.settings
    page = Page()
    page.heading("What the width of the grain sizes does to a bed that shears", 1)
    page.paragraph(f"{len(runs)} runs: gradings {', '.join(gradings[g] for g in present(rows))}, seeds {', '.join(map(str, sorted({r.seed for r in runs})))}, "
                   f"normal stress {', '.join(f'{s:g}' for s in stresses(rows))} kPa, preset {settings['model'].get('preset')}, sheared at {runs[0].stage.settings['strain_rate']:g} 1/s to a strain of "
                   f"{max(r['strain'] for r in rows):.2f}. {np.nansum(values(rows, 'hours')):.1f} hours of runs, packing apart, several at once. "
                   f"This report: version {made_by}, on {machine()}, {date.today()}.")
    scaling = settings["model"].get("density_scaling", 0.0)
    page.paragraph("± is half of a 95 % interval over the packings. Lengths are in D50, the diameter of which half of the mass is finer. "
                   + (f"Density scaling: radii below {1e3 * scaling:g} mm have the inertia of that radius. " if scaling else "")
                   + f"Inertia numbers, with the mass that answers to forces: {min(values(rows, 'inertia_number')):.1e} to {max(values(rows, 'inertia_number')):.1e}.")
    page.table(["grading", "grains", "sizes", "D50 (mm)", "bed before shear (D50)"],
               [[gradings[g], own[0]["grains"], f"1:{own[0]['widest']:.3g}", f"{1e3 * own[0]['d50_m']:.1f}",
                 f"{np.mean(values(own, 'height_0_m') / values(own, 'd50_m')):.1f}"] for g in present(rows) if (own := [r for r in rows if r["grading"] == g])])
    if found := findings(rows):
        page.heading("Beside what the paper tells of others (par. 56)")
        page.paragraph("Differences of means over packings, averaged over the normal stresses, with their 95 % interval.")
        page.table(["quantity", "others", "here"], found)
    reach = values(rows, "shear_zone_reach")
    if reach.max() > bounded:
        page.paragraph(f"The shear zone, down to 5 % of the displacement, takes {100 * reach.min():.0f} to {100 * reach.max():.0f} % of the depth down to the layer that stands still: "
                       "these beds are too low for it to end by itself, and its thickness follows their height. So the depth of half the displacement is compared.")
    for sigma, table in tables(rows).items():
        page.heading(f"At {sigma:g} kPa")
        page.table(["quantity", *(gradings[g] for g in present(rows))], table)
    groups = {f"{gradings[g]}, {sigma:g} kPa": [r.stage for r in runs if r.grading == g and r.sigma_0 == sigma * 1e3] for sigma in stresses(rows) for g in present(rows)}
    dilatancy.add(page, groups)
    for why in note:
        page.paragraph(why)
    if notes:
        page.notes(Path(notes).read_text())
    page.figures({"curves": lambda: curves_figure(runs), "profiles": lambda: profiles_figure(runs), "chains": lambda: chains_figure(runs), "taylor": lambda: dilatancy.figure({k: v for k, v in groups.items() if k.endswith(f"{max(stresses(rows)):g} kPa")})},
                 captions, output / "figures")
    page.write(output, "Sizes of grains, with Moraine")
    say(str(output / "report.html"))
    for quantity, _, here in found:
        say(f"  {quantity}: {here}")
