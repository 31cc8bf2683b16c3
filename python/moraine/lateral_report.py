"""The report of the study lateral: a top layer whose velocity varies across y (Kasmalkar et al. 2021), beside one that moves as one.

Where the velocity varies it is symmetric about a slowest line. Positions across are told by the distance from that, 0 to half the side of the box,
and both sides are folded onto each other; so they are where the layer moves as one."""
from datetime import date
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from . import dilatancy, measure, profile, shearing, strength, study_runs
from .results import MissingData, Table
from .intervals import mean_interval, show
from .page import LeftOut, Page, machine, version
from .style import lines, page as page_width, panel, plt, sequential

shapes = {"uniform": "as one", "cosine": "cosine", "half": "half"}  # of the velocity, stage.profile
mean_share = {"uniform": 1.0, "cosine": 0.5, "half": 0.5}           # mean of the velocity over the largest
strips = ("slow", "between", "fast")    # thirds of the way from the slowest line to the fastest
upper = 4                               # diameters below the driven layer: the bed whose porosity is told
times = ("early", "late")               # when it is told: about a largest strain of `early`, and in the last third
early = 0.1


def name_of(kind):
    shape, wet = kind
    return f"{shapes[shape]}, {'wet' if wet else 'dry'}"


class Run(study_runs.Run):
    def __init__(self, case):
        super().__init__(case)
        self.shape = self.settings.get("profile", "uniform")
        if self.shape not in shapes:
            raise MissingData(f"{case.directory}: stage.profile = {self.shape}: expected one of {', '.join(shapes)}")
        self.kind = self.shape, self.stage.wet
        self.share = mean_share[self.shape]
        self.diameter = case.diameter
        self.side = self.stage.snapshots[0].box[1]
        self.last = self.stage.snapshots[-1]
        self.late = self.stage.snapshots[len(self.stage.snapshots) * 2 // 3:]

    @cached_property
    def sheared(self):
        """What strength.py and dilatancy.py read: mean strain and friction over the width. What resists is weighted by the velocity, and strain
        is that of the fastest; both over the mean share they are those of a bed that shears alike all over. In wet beds friction is over what the
        grains bear in the shear zone: on the wall less the pressure of the water there."""
        columns = {name: self.rows[name] for name in self.rows}
        borne = self.rows["normal_stress"] - (self.rows["water_pressure_mean"] if self.stage.wet else 0.0)
        columns |= {"shear_strain": self.share * self.rows["shear_strain"], "shear_friction": self.rows["shear_stress"] / borne / self.share}
        return SimpleNamespace(series=Table(self.rows.file, columns, self.rows.units))

    @property
    def displacement(self):
        """Of each grain along x, m."""
        return self.last.grains["displacement"][:, 0]

    @property
    def slowest(self):
        """y of the slowest line, m; `half` moves what lies below half the side."""
        return 0.75 * self.side if self.shape == "half" else 0.0

    def across(self, y):
        """Distance from the slowest line, m."""
        y = (np.asarray(y) - self.slowest) % self.side
        return np.minimum(y, self.side - y)

    def strip(self, y):
        """0 slow, 1 between, 2 fast."""
        return np.minimum((self.across(y) / (self.side / 2) * 3).astype(int), 2)

    @property
    def cells(self):
        return max(6, 2 * round(self.side / self.diameter / 2)), max(4, round(self.height_0 / self.diameter))

    def upper_porosity(self, snapshot):
        """By column across y: of the bed from `upper` diameters below the driven layer up to it, and of all columns' middles, m."""
        count, fine = self.cells[0], 8 * self.cells[1]
        found = profile.section_porosity(snapshot, count, fine)
        role, z = snapshot.grains["role"], snapshot.grains["position"][:, 2]
        driven = role == 2
        top = (z[driven].mean() if driven.any() else snapshot.top_wall - self.diameter / 2) - self.diameter / 2
        edges = np.linspace(0, snapshot.top_wall, fine + 1)
        own = (edges[:-1] >= top - upper * self.diameter) & (edges[1:] <= top)
        return (np.arange(count) + 0.5) * self.side / count, found[:, own].mean(axis=1)

    @cached_property
    def before(self):
        return self.upper_porosity(self.stage.snapshots[0])

    @cached_property
    def gains(self):
        """(largest strain, gain of porosity by column) of each snapshot."""
        end = self.rows["stage_time"][-1]
        return [(s.stage_time / end * float(self.rows["shear_strain"][-1]), self.upper_porosity(s)[1] - self.before[1]) for s in self.stage.snapshots]

    def chosen(self, when):
        """(largest strain, gain of porosity by column) of the snapshots of that time."""
        if when == "late":
            return self.gains[-len(self.late):]
        return [g for g in self.gains if abs(g[0] - early) <= early / 2 + 1e-6] or self.gains[-1:]

    def gain(self, when):
        return np.mean([gain for _, gain in self.chosen(when)], axis=0)

    def folded(self, values, y=None):
        """Values of columns (at y, m) by distance from the slowest line (m): means of the two sides."""
        y = self.before[0] if y is None else y
        away = (np.arange(self.cells[0] // 2) + 0.5) * self.side / self.cells[0]
        wrapped, again = np.concatenate([y - self.side, y, y + self.side]), np.tile(values, 3)
        return away, (np.interp((self.slowest + away) % self.side, wrapped, again) + np.interp((self.slowest - away) % self.side, wrapped, again)) / 2

    def local_strain(self, when):
        """Of the driven layer by column: its mean displacement then over the height of the bed."""
        y, L = self.before[0], self.side
        share = {"uniform": np.ones(len(y)), "cosine": (1 - np.cos(2 * np.pi * y / L)) / 2, "half": np.where(y < L / 2, 1.0, 0.0)}[self.shape]
        return share * float(np.mean([strain for strain, _ in self.chosen(when)]))

    def water_pressure(self):
        """By column across y, mean over the height and the last third of the snapshots, Pa."""
        (_, ny, _), _ = self.last.water_grid
        means = [s.water["pressure"].reshape(-1, ny, s.water_grid[0][0]).mean(axis=(0, 2)) for s in self.late]
        return (np.arange(ny) + 0.5) * self.side / ny, np.mean(means, axis=0)

    def half_depth(self, strip):
        """Below the driven layer, diameters: where the displacement in this strip is half of the layer's there."""
        g = self.last.grains
        own = self.strip(g["position"][:, 1]) == strip
        z, u, driven = g["position"][own, 2], self.displacement[own], (g["role"] == 2)[own]
        edges = profile.slabs(self.last.top_wall, self.diameter)
        which = np.clip(np.digitize(z, edges) - 1, 0, len(edges) - 2)
        mean = np.array([u[(which == k) & ~driven].mean() if ((which == k) & ~driven).any() else np.nan for k in range(len(edges) - 1)])
        layer, top = u[driven].mean(), z[driven].mean()
        if layer < 0.5 * self.diameter:  # a strip that rests
            return np.nan
        middle = (edges[1:] + edges[:-1]) / 2
        known = np.isfinite(mean) & (middle < top)
        z_known, ratio = np.append(middle[known], top), np.append(mean[known] / layer, 1.0)
        below = np.flatnonzero(ratio < 0.5)
        if not len(below):
            return top / self.diameter
        k = below[-1]
        part = (0.5 - ratio[k]) / (ratio[k + 1] - ratio[k])
        return (top - (z_known[k] + part * (z_known[k + 1] - z_known[k]))) / self.diameter

    def load(self, strip):
        """Mean pressure of the free grains in the upper bed of this strip over that of all such grains, last third of the snapshots."""
        found = []
        for s in self.late:
            g = s.grains
            z = g["position"][:, 2]
            own = (g["role"] == 0) & (z > z[g["role"] == 2].mean() - (upper + 0.5) * self.diameter)
            found.append(g["pressure"][own & (self.strip(g["position"][:, 1]) == strip)].mean() / g["pressure"][own].mean())
        return float(np.mean(found))

    def measured(self):
        s, rows = strength.strength(self.sheared), self.sheared.series
        strip = self.strip(self.before[0])
        out = {"profile": self.shape, "wet": int(self.stage.wet), "seed": self.seed, "sigma_0_kPa": self.sigma_0 / 1e3, "mean_strain": rows["shear_strain"][-1],
               "friction_peak": s.peak, "friction_late": s.ultimate, "dilation_d": s.dilation, "height_0_m": self.height_0, "porosity_0": shearing.porosity_0(self.rows),
               "hours": measure.hours(self.case)}
        for k, name in enumerate(strips):
            for when in times:
                out |= {f"strain_{when}_{name}": self.local_strain(when)[strip == k].mean(), f"gain_{when}_{name}": self.gain(when)[strip == k].mean()}
            out |= {f"load_{name}": self.load(k), f"half_depth_d_{name}": self.half_depth(k)}
        if self.stage.wet:
            y, p = self.water_pressure()
            here = np.interp(self.before[0], y, p, period=self.side)  # cells of the water are wider than columns
            out |= {f"water_kPa_{name}": here[strip == k].mean() / 1e3 for k, name in enumerate(strips)}
        return out


def load(study, note):
    order = list(shapes)
    return sorted(study_runs.load(study, Run, note), key=lambda r: (r.stage.wet, order.index(r.shape), r.seed))


def basis(runs, run):
    """The run of the same packing whose layer moves as one, wet or dry as this; dry where there is no other, [] where there is none."""
    alike = [r for r in runs if r.seed == run.seed and r.shape == "uniform"]
    return [r for r in alike if r.stage.wet == run.stage.wet] or alike


def over_alike(runs, run, when):
    """By column: porosity gained over what a bed of the same packing gains where the layer moves as one, at the strain that it has come to there."""
    return run.gain(when) - expected(basis(runs, run), run.local_strain(when))


def expected(runs, strain):
    """Gain of porosity of beds that shear alike all over, at these strains: mean over the packings and the width."""
    known = [np.array([(e, gain.mean()) for e, gain in r.gains]) for r in runs]
    return np.mean([np.interp(strain, k[:, 0], k[:, 1]) for k in known], axis=0)


def values(rows, key):
    return np.array([r[key] for r in rows], float)


def shown(rows, key, digits):
    own = [r for r in rows if np.isfinite(r.get(key, np.nan))]
    return show(*mean_interval(values(own, key)), digits) if own else "-"


def strip_table(runs, rows):
    """A line for each kind and strip."""
    table = []
    for kind, mine in study_runs.grouped(runs, lambda r: r.kind).items():
        own = [r for r in rows if (r["profile"], bool(r["wet"])) == kind]
        varied = [r for r in mine if r.shape != "uniform" and basis(runs, r)]
        for k, strip in enumerate(strips):
            line = [name_of(kind), strip]
            for when in times:
                over = "-"
                if varied:
                    over = show(*mean_interval([over_alike(runs, r, when)[r.strip(r.before[0]) == k].mean() for r in varied]), 4)
                line += [f"{values(own, f'strain_{when}_{strip}').mean():.2f}", shown(own, f"gain_{when}_{strip}", 4), over]
            table.append([*line, shown(own, f"half_depth_d_{strip}", 2), shown(own, f"load_{strip}", 2), shown(own, f"water_kPa_{strip}", 2)])
    return ["top layer", "strip", *(f"{when}: {what}" for when in times for what in ("strain of the layer", "porosity gained", "over that of as much strain alike")),
            "half of the displacement (diameters)", "load over the mean", "water pressure (kPa)"], table


def whole_table(rows):
    keys = {"mean_strain": ("mean strain", 2), "friction_peak": ("peak friction", 3), "friction_late": ("last third", 3), "dilation_d": ("dilation (diameters)", 2), "porosity_0": ("porosity before", 3)}
    table = [[name_of((shape, wet)), *(shown(own, k, d) for k, (_, d) in keys.items())] for shape, wet in dict.fromkeys((r["profile"], bool(r["wet"])) for r in rows)
             for own in [[r for r in rows if (r["profile"], bool(r["wet"])) == (shape, wet)]]]
    return ["top layer", *(n for n, _ in keys.values())], table


def looks(runs):
    own = list(dict.fromkeys(r.kind for r in runs))
    return dict(zip(own, lines(len(own))))


def drawn_style(look):
    return {k: look[k] for k in ("color", "linestyle")}


def maps_figure(runs):
    """Displacement and gain of porosity over y and depth at the end, means over the packings, a column for each case."""
    own = list(dict.fromkeys(r.kind for r in runs))
    figure, axes = plt.subplots(2, len(own), figsize=(page_width, 3.6), sharex=True, sharey=True, squeeze=False, gridspec_kw={"hspace": 0.12, "wspace": 0.08})
    for column, kind in zip(axes.T, own):
        mine = [r for r in runs if r.kind == kind]
        ny, nz = mine[0].cells
        moved, gained = [], []
        for r in mine:
            g = r.last.grains
            y, z = g["position"][:, 1] % r.side, g["position"][:, 2] / r.last.top_wall
            count, *_ = np.histogram2d(y, z, (ny // 2, nz), ((0, r.side), (0, 1)))
            total, *_ = np.histogram2d(y, z, (ny // 2, nz), ((0, r.side), (0, 1)), weights=r.displacement / r.diameter)
            with np.errstate(invalid="ignore"):
                moved.append(total / count)
            gained.append(np.mean([profile.section_porosity(s, ny // 2, nz) for s in r.late], axis=0) - profile.section_porosity(r.stage.snapshots[0], ny // 2, nz))
        side, high = mine[0].side / mine[0].diameter, mine[0].last.top_wall / mine[0].diameter
        extent = (0, side, 0, high)
        a = column[0].imshow(np.nanmean(moved, axis=0).T, origin="lower", extent=extent, aspect="auto", cmap=sequential, vmin=0)
        b = column[1].imshow(np.mean(gained, axis=0).T, origin="lower", extent=extent, aspect="auto", cmap=sequential, vmin=-0.02, vmax=0.08)
        column[0].set_title(name_of(kind), fontsize=8)
        column[1].set_xlabel("y (diameters)")
    axes[0, 0].set_ylabel("z (diameters)"), axes[1, 0].set_ylabel("z (diameters)")
    figure.colorbar(a, ax=list(axes[0]), label="displacement\n(diameters)", pad=0.01, fraction=0.05)
    figure.colorbar(b, ax=list(axes[1]), label="porosity\ngained", pad=0.01, fraction=0.05)
    return figure


def across_figure(runs):
    """Gain of porosity in the upper bed across y, early and late, and what is over that which as much strain makes where the layer moves as one."""
    look = looks(runs)
    figure, axes = plt.subplots(2, 2, figsize=(page_width, 4.8), sharex=True, sharey="row", gridspec_kw={"wspace": 0.08, "hspace": 0.18})
    for (gained, over), when in zip(axes.T, times):
        for kind, own in study_runs.grouped(runs, lambda r: r.kind).items():
            found = np.array([r.folded(r.gain(when))[1] for r in own])
            s = own[0].folded(own[0].gain(when))[0] / own[0].diameter
            gained.plot(s, found.mean(axis=0), **drawn_style(look[kind]))
            if kind[0] == "uniform" or not all(basis(runs, r) for r in own):
                continue
            left = np.array([r.folded(over_alike(runs, r, when))[1] for r in own])
            over.plot(s, left.mean(axis=0), **drawn_style(look[kind]))
            if len(own) > 1:
                error = left.std(axis=0, ddof=1) / np.sqrt(len(own))
                over.fill_between(s, left.mean(axis=0) - error, left.mean(axis=0) + error, color=look[kind]["color"], alpha=0.15, lw=0)
        over.axhline(0, color="0.6", lw=0.5, zorder=0)
        for ax in (gained, over):
            ax.axvline(runs[0].side / 4 / runs[0].diameter, color="0.6", lw=0.5, ls=":", zorder=0)
        strain = np.mean([e for r in runs for e, _ in r.chosen(when)])
        gained.set_title(f"{when}: largest strain {strain:.2f}", fontsize=8)
        over.set_xlabel("from the slowest line (diameters)")
    axes[0, 0].set_ylabel(f"porosity gained,\nupper {upper} diameters"), axes[1, 0].set_ylabel("over that of\nas much strain alike")
    figure.align_ylabels()
    legend(figure, look, 0.02)
    for ax, letter in zip(axes.flat, "abcd"):
        panel(ax, letter)
    return figure


def legend(figure, look, y):
    handles = [plt.Line2D([], [], label=name_of(k), **drawn_style(x)) for k, x in look.items()]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, y), ncol=min(6, len(handles)))


def water_figure(runs):
    """Pressure of the water across y, late: each packing a thin line, and their mean."""
    wet = [r for r in runs if r.stage.wet]
    if not wet:
        raise MissingData("no run has pore water")
    look = looks(wet)
    figure, ax = plt.subplots(figsize=(page_width * 0.55, 2.7))
    for kind, own in study_runs.grouped(wet, lambda r: r.kind).items():
        pressures = np.array([r.folded(p, y)[1] / 1e3 for r in own for y, p in [r.water_pressure()]])
        s = own[0].folded(own[0].gain("late"))[0] / own[0].diameter
        for p in pressures:
            ax.plot(s, p, lw=0.4, **drawn_style(look[kind]))
        ax.plot(s, pressures.mean(axis=0), lw=1.4, **drawn_style(look[kind]))
    ax.set(xlabel="from the slowest line (diameters)", ylabel="water pressure (kPa)")
    legend(figure, look, -0.05)
    return figure


def curves_figure(runs):
    """Friction and dilation against mean strain, means over the packings."""
    look = looks(runs)
    figure, (over, under) = plt.subplots(1, 2, figsize=(page_width, 2.7), gridspec_kw={"wspace": 0.28})
    for kind, own in study_runs.grouped(runs, lambda r: r.kind).items():
        count = min(len(r.rows) for r in own)
        strain = own[0].sheared.series["shear_strain"][:count]
        over.plot(strain, np.mean([strength.smoothed(r.sheared.series["shear_strain"], r.sheared.series["shear_friction"])[:count] for r in own], axis=0), lw=0.9, **drawn_style(look[kind]))
        under.plot(strain, np.mean([r.rows["dilation"][:count] / r.diameter for r in own], axis=0), **drawn_style(look[kind]))
    over.set(xlabel="mean shear strain", ylabel="friction $\\tau/\\sigma'$", xlim=(0, None), ylim=(0, None))
    under.set(xlabel="mean shear strain", ylabel="dilation (diameters)", xlim=(0, None))
    legend(figure, look, -0.04)
    panel(over, "a"), panel(under, "b")
    return figure


captions = {
    "maps": "Displacement along x (above) and porosity gained (below) in sections across the shear at the end, means over the length of the box and the packings.",
    "across": f"Above: porosity gained in the {upper} diameters below the driven layer, by distance from the slowest line, both sides folded onto each other; below: what is over that of a bed whose layer moves "
              "as one, at the strain that the layer has come to there. Shaded: one standard error over the packings. Dotted line: half way, where the velocity varies most and \"half\" has its margins.",
    "water": "Pressure of the water at the end, mean over the height, by distance from the slowest line: each packing (thin) and their mean.",
    "curves": "(a) Friction and (b) dilation against mean shear strain, means over the packings.",
    "taylor": dilatancy.caption,
}


def build(study, output, notes=None, say=print):
    """study: directory of runs (runs/NAME). Writes measurements.csv, figures/, report.html, report.md to `output`."""
    output, note = Path(output), LeftOut(say)
    made_by = version()
    runs = load(study, note)
    output.mkdir(parents=True, exist_ok=True)
    rows = [r.measured() for r in runs]
    measure.table(rows, output / "measurements.csv")
    settings, first = runs[0].case.settings, runs[0]
    groups = {name_of(k): [r.sheared for r in own] for k, own in study_runs.grouped(runs, lambda r: r.kind).items()}
    page = Page()
    page.heading("A top layer whose velocity varies across y", 1)
    page.paragraph(f"{len(runs)} runs of {settings['grains']['count']:,} grains: seeds {', '.join(map(str, sorted({r.seed for r in runs})))}, normal stress {first.sigma_0 / 1e3:g} kPa, preset "
                   f"{settings['model'].get('preset')}. The box is {first.side / first.diameter:.0f} diameters wide across the shear. The fastest part of the layer shears the bed at "
                   f"{first.settings['strain_rate']:g} 1/s; in \"cosine\" its velocity is u (1 - cos(2 π y/L))/2, in \"half\" that of the half at y < L/2 is u and that of the other 0. {np.nansum(values(rows, 'hours')):.2f} hours of runs. "
                   f"This report: version {made_by}, on {machine()}, {date.today()}.")
    page.paragraph("± is half of a 95 % interval over the packings. Friction and strain are means over the width; in wet beds friction is over what the grains bear in the shear zone, where dilation lowers the water's pressure. Strips are thirds of the way from the slowest line to the fastest. Half of the displacement: how far below the driven layer grains have moved "
                   "half as far as it has in that strip. Load: mean pressure of the grains of the upper bed there, over that of all of them.")
    page.heading("The bed as a whole")
    page.table(*whole_table(rows))
    page.heading("Across the shear")
    page.table(*strip_table(runs, rows))
    dilatancy.add(page, groups)
    for why in note:
        page.paragraph(why)
    if notes:
        page.notes(Path(notes).read_text())
    page.figures({"maps": lambda: maps_figure(runs), "across": lambda: across_figure(runs), **({"water": lambda: water_figure(runs)} if any(r.stage.wet for r in runs) else {}), "curves": lambda: curves_figure(runs), "taylor": lambda: dilatancy.figure(groups)},
                 captions, output / "figures")
    page.write(output, "Lateral shear, with Moraine")
    say(str(output / "report.html"))
    for line in strip_table(runs, rows)[1]:
        say("  " + "  ".join(map(str, line)))
