"""The figures of the paper that show whole beds: strength, dilation, profiles, rotation, and the laboratory. Each function takes
cases or snapshots and gives a Matplotlib figure. Cases of the same normal stress, such as several seeds, are shown as their mean and
the range between the least and the largest."""
from itertools import groupby

import numpy as np

from . import compaction, measure, paper, profile, rotation, shearing, strength
from .results import MissingData
from .style import column, ink, lines, page, panel, plt

kPa = 1e3


def by_stress(cases):
    """[(sigma_0, [cases])] in order."""
    cases = sorted(cases, key=lambda c: c.normal_stress)
    return [(s, list(own)) for s, own in groupby(cases, key=lambda c: c.normal_stress)]


def is_loop(cases):
    return any(shearing.is_loop(shearing.of(c)) for c in cases)


def on_common_strain(cases, name, step=0.0025):
    """Strains every `step` that all cases have reached, and a row of `name`, smoothed over a strain of 0.01, for each case. Of stages
    of shear that follow each other one after the other, with their signs."""
    drawn = [shearing.drawn(shearing.of(c)) for c in cases]
    if len({tuple(shearing.direction(rows["shear_strain"]) for rows in stages) for stages in drawn}) > 1:
        raise MissingData(f"{cases[0].directory} and others at {cases[0].normal_stress / kPa:g} kPa differ in number or direction of "
                          "their stages of shear, so there is no mean over them")
    strains, values = [], []
    for stages in zip(*drawn):
        d, begin = shearing.direction(stages[0]["shear_strain"]), np.mean([rows["shear_strain"][0] for rows in stages])
        stages = [shearing.turned(rows) for rows in stages]
        strain = np.arange(0, min(rows["shear_strain"][-1] for rows in stages) + 1e-9, step)
        means = []
        for rows in stages:
            mean = strength.smoothed(rows["shear_strain"], rows[name], 0.01)
            known = np.isfinite(mean)
            at, what = np.r_[0, rows["shear_strain"][known]], np.r_[rows[name][0], mean[known]]
            order = np.argsort(at, kind="stable")  # a layer that a stress drives may spring back
            means.append(np.interp(strain, at[order], what[order]))
        strains.append(begin + d * strain)
        values.append((d if name in shearing.signed else 1) * np.array(means))
    return np.concatenate(strains), np.concatenate(values, axis=1)


def from_zero(axes, loop, x=True, y=True):
    """Limits of curves that begin at zero and stay above it; of a loop, its axes."""
    if loop:
        axes.axhline(0, color="0.6", lw=0.5, zorder=0), axes.axvline(0, color="0.6", lw=0.5, zorder=0)
        return
    if x:
        axes.set_xlim(0)
    if y:
        axes.set_ylim(0)


def friction_dilation(cases):
    """Fig. 4: shear friction and dilation against shear strain at each normal stress."""
    figure, (over, under) = plt.subplots(2, 1, figsize=(column, 4.4), sharex=True, gridspec_kw={"hspace": 0.12})
    groups = by_stress(cases)
    for (sigma_0, own), look in zip(groups, lines(len(groups))):
        look = {k: look[k] for k in ("color", "linestyle")}
        for axes, name in ((over, "shear_friction"), (under, "dilation_diameters")):
            strain, values = on_common_strain(own, name)
            axes.plot(strain, values.mean(axis=0), label=f"{sigma_0 / kPa:g} kPa", **look)
            if len(own) > 1:
                axes.fill_between(strain, values.min(axis=0), values.max(axis=0), color=look["color"], alpha=0.18, lw=0)
    over.set_ylabel("shear friction $\\tau/\\sigma'$")
    from_zero(over, is_loop(cases), x=False)
    over.legend(title="$\\sigma_0$", ncol=2, loc="lower right")
    under.set_ylabel("dilation (mean grain diameters)")
    under.set_xlabel("shear strain $\\gamma$")
    from_zero(under, is_loop(cases), y=False)
    figure.align_ylabels()
    panel(over, "a"), panel(under, "b")
    return figure


def taylor(cases, step=0.005):
    """Taylor's relation (strength.py) at the lowest, a middle and the highest normal stress, and what it leaves in all cases."""
    figure, (over, under) = plt.subplots(2, 1, figsize=(column, 4.4), sharex=True, gridspec_kw={"hspace": 0.12, "height_ratios": (2, 1)})
    groups, left, end = [], [], np.inf
    for sigma_0, own in by_stress(cases):
        curves = [strength.taylor(shearing.of(c)) for c in own]
        groups.append((sigma_0, curves))
        end = min(end, *(c.strain[-1] for c in curves))
    if not end > strength.window + step:
        raise MissingData(f"{cases[0].directory} and others: sheared too little for windows of {strength.window:g} of strain")
    strain = np.arange(strength.window / 2, end - strength.window / 2 + 1e-9, step)
    def mean(curves, values):
        return np.mean([np.interp(strain, c.strain[np.isfinite(v)], v[np.isfinite(v)]) for c in curves for v in [values(c)]], axis=0)
    chosen = [groups[k] for k in sorted({0, len(groups) // 2, len(groups) - 1})]
    for (sigma_0, curves), look in zip(chosen, lines(len(chosen))):
        over.plot(strain, mean(curves, lambda c: c.friction), color=look["color"], label=f"{sigma_0 / kPa:g} kPa")
        over.plot(strain, mean(curves, lambda c: c.mu_cs + c.rate), color=look["color"], linestyle=(0, (4, 1.5)), lw=0.8)
    left = np.array([mean([c], lambda c: c.residual) for _, curves in groups for c in curves])
    under.axhline(0, color="0.6", lw=0.5, zorder=0)
    under.plot(strain, left.mean(axis=0), color=ink)
    under.fill_between(strain, left.min(axis=0), left.max(axis=0), color=ink, alpha=0.15, lw=0)
    over.set_ylabel("$\\tau/\\sigma'$;  $\\mu_{cs} + d\\epsilon_v/d\\gamma$")
    over.legend(title="$\\sigma_0$", loc="upper right")
    under.set_ylabel("left over")
    under.set_xlabel("shear strain $\\gamma$")
    under.set_xlim(0)
    figure.align_ylabels()
    panel(over, "a"), panel(under, "b")
    return figure


def mohr_coulomb(rows):
    """Fig. 14, Table 2: peak and ultimate strength of measured runs (see measure.py), their lines, and the other materials'."""
    figure, both = plt.subplots(2, 1, figsize=(column, 5.2), sharex=True, gridspec_kw={"hspace": 0.14})
    sigma_0 = np.array([r["sigma_0_kPa"] for r in rows])
    fits = measure.mohr_coulomb(rows)
    end = sigma_0.max() * 1.05
    for axes, key, what, letter, index in ((both[0], "friction_peak", "peak", "a", 0), (both[1], "friction_ultimate", "ultimate", "b", 2)):
        for (name, values), dashes in zip(paper.materials.items(), ((0, (1, 1)), (0, (4, 1.5)), (0, (7, 1.5)), (0, (4, 1, 1, 1)))):
            phi, C = values[index:index + 2]
            grey = "0.35" if "DEM" in name else "0.6"
            line = C + np.tan(np.radians(phi)) * np.array([0, end])
            axes.plot([0, end], line, color=grey, linestyle=dashes, lw=0.9, label=f"{name}: {phi:g}°, {C:g} kPa")
        fit = fits[what]
        tau = sigma_0 * [r[key] for r in rows]
        axes.plot([0, end], fit.tau(np.array([0, end]) * kPa) / kPa, color="C0", lw=1.3,
                  label=f"Moraine: {fit.phi:.1f}°, {fit.C / kPa:.2f} kPa")
        if what == "peak":
            raw = sigma_0 * [r["friction_peak_raw"] for r in rows]
            axes.plot(sigma_0, raw, "+", color="C0", ms=4, mew=0.7, label="raw peaks (0.05 s)")
        axes.plot(sigma_0, tau, "o", mfc="white", mec="C0", ms=3.4, mew=0.8)
        axes.set_ylabel(f"{what} shear strength $\\tau_{what[0]}$ (kPa)")
        axes.set_xlim(0, end)
        axes.set_ylim(0)
        axes.legend(loc="upper left", handlelength=2.6, frameon=True, facecolor="white", edgecolor="none", framealpha=0.9, borderpad=0.2)
        panel(axes, letter)
    both[1].set_xlabel("normal stress $\\sigma_0$ (kPa)")
    figure.align_ylabels()
    return figure


def against_height(axes, groups, curve, label, markevery):
    """curve(snapshots) of the sheared beds of each normal stress, as values and heights (m); `label` names the values."""
    for (sigma_0, own), look in zip(groups, lines(len(groups))):
        values, height = curve([shearing.of(c).snapshots[-1] for c in own])
        axes.plot(values, height, label=f"{sigma_0 / kPa:g} kPa", markevery=markevery, ms=2.6, mew=0.6, mfc="white", **look)
    axes.set_xlabel(label)
    axes.set_ylabel("height above the floor (m)")
    axes.set_ylim(0)


def mean_displacement(snapshots):
    """Displacement along the shear (m) and heights (m), means over several beds."""
    profiles = [profile.displacement(s) for s in snapshots]
    height = np.linspace(max(z[0] for z, _ in profiles), min(z[-1] for z, _ in profiles), 60)
    return np.mean([np.interp(height, z, u) for z, u in profiles], axis=0), height


def displacement(cases):
    """Fig. 8: mean displacement along the shear against height at each normal stress, over the grains of the lowest stress."""
    figure, axes = plt.subplots(figsize=(column, 3.2))
    groups = by_stress(cases)
    sigma_0, own = groups[0]
    grains = shearing.of(own[0]).snapshots[-1].grains
    axes.plot(grains["displacement"][:, 0], grains["position"][:, 2], ".", color="0.72", ms=1.4, mew=0, rasterized=True,
              label=f"grains, {sigma_0 / kPa:g} kPa")
    against_height(axes, groups, mean_displacement, "displacement along the shear direction (m)", 6)
    axes.legend(title="$\\sigma_0$", loc="lower right")
    return figure


def mean_porosity(snapshots):
    """Porosity and middle heights (m) of slabs, means over several beds; without the slabs at floor and wall."""
    edges, phi = (np.mean(values, axis=0) for values in zip(*profile.alike(snapshots)))
    return phi[1:-1], ((edges[1:] + edges[:-1]) / 2)[1:-1]


def porosity(cases):
    """Fig. 9: porosity of horizontal slabs, one mean grain diameter thick, at the end of shear."""
    figure, axes = plt.subplots(figsize=(column, 3.2))
    groups = by_stress(cases)
    against_height(axes, groups, mean_porosity, "porosity of a slab one mean grain diameter thick", 2)
    sigma_0, own = groups[0]
    axes.plot(*mean_porosity([c.stage("consolidate").snapshots[-1] for c in own]), color="0.7", lw=1, label=f"before, {sigma_0 / kPa:g} kPa")
    axes.legend(title="$\\sigma_0$", loc="lower right")
    return figure


def rotations(snapshot):
    """Fig. 11: rotation gathered by each grain, one axis against another."""
    omega = rotation.rotations(snapshot)
    found = rotation.statistics(snapshot)
    figure, all_axes = plt.subplots(1, 3, figsize=(page, 2.5), gridspec_kw={"wspace": 0.34})
    reach = np.percentile(np.abs(omega), 99.8) or 1.0  # nothing has turned yet
    for axes, (a, b), letter in zip(all_axes, ((0, 1), (0, 2), (1, 2)), "abc"):
        axes.plot(omega[:, a], omega[:, b], ".", color=ink, alpha=0.25, ms=2, mew=0, rasterized=True)
        axes.axhline(0, color="0.6", lw=0.5), axes.axvline(0, color="0.6", lw=0.5)
        axes.plot(found.mean[a], found.mean[b], "+", color="C3", ms=9, mew=1.5)
        axes.set_xlabel(f"rotation about ${'xyz'[a]}$, $\\Omega_{a + 1}$ (rad)")
        axes.set_ylabel(f"rotation about ${'xyz'[b]}$, $\\Omega_{b + 1}$ (rad)")
        axes.set_aspect("equal")
        axes.set_xlim(-reach, reach), axes.set_ylim(-reach, reach)
        panel(axes, letter)
    return figure


def laboratory(cases):
    """Fig. 13: shear stress and dilation at one normal stress, beside what the paper's text and Table 2 state of other materials.

    Their curves are not printed as numbers: marks on the right stand for peak (filled) and ultimate (open) strength after
    Table 2 at this normal stress, and for total dilation after par. 52.
    """
    sigma_0 = cases[0].normal_stress
    figure, (over, under) = plt.subplots(2, 1, figsize=(column, 4.4), sharex=True, gridspec_kw={"hspace": 0.12})
    for axes, name, scale in ((over, "shear_friction", sigma_0 / kPa), (under, "dilation_diameters", 1)):
        strain, values = on_common_strain(cases, name)
        axes.plot(strain, scale * values.mean(axis=0), color="C0", label="Moraine")
        if len(cases) > 1:
            axes.fill_between(strain, scale * values.min(axis=0), scale * values.max(axis=0), color="C0", alpha=0.2, lw=0)
    end = strain.max()
    for k, ((name, (phi_p, C_p, phi_u, C_u)), mark) in enumerate(zip(paper.materials.items(), "s^oD")):
        at = end * (1.05 + 0.05 * k)
        for phi, C, face in ((phi_p, C_p, "0.35"), (phi_u, C_u, "white")):
            over.plot(at, C + sigma_0 / kPa * np.tan(np.radians(phi)), mark, mfc=face, mec="0.35", ms=4, mew=0.8,
                      label=name if face != "white" else None)
        if name in paper.dilation:
            under.plot(at, paper.dilation[name], mark, mfc="0.35", mec="0.35", ms=4, label=name)
    over.set_ylabel(f"shear stress at $\\sigma_0$ = {sigma_0 / kPa:g} kPa (kPa)")
    from_zero(over, is_loop(cases), x=False)
    over.set_title("filled: peak, open: ultimate (Table 2)", loc="right", fontsize=7, color="0.35")
    under.axhline(0, color="0.6", lw=0.5)
    under.set_ylabel("dilation (mean grain diameters)")
    under.set_xlabel("shear strain $\\gamma$")
    under.set_xlim(min(0, 1.05 * strain.min()), end * 1.25)
    under.set_title("total at 80 kPa (par. 52); the till contracts", loc="right", fontsize=7, color="0.35")
    handles, labels = over.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, -0.09), ncol=3)
    figure.align_ylabels()
    panel(over, "a"), panel(under, "b")
    return figure


def consolidation(cases):
    """Par. 29: volumetric strain under the top wall, what is still to come of it on a log scale, and the exponential fit."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(page, 2.6), gridspec_kw={"wspace": 0.3})
    groups = by_stress(cases)
    for (sigma_0, own), look in zip(groups, lines(len(groups))):
        look = {k: look[k] for k in ("color", "linestyle")}
        time, strain = compaction.volumetric_strain(own[0].stage("consolidate"))
        left.plot(time, 100 * strain, label=f"{sigma_0 / kPa:g} kPa", **look)
        ahead = strain[-1] - strain
        right.semilogy(time[ahead > 0], 100 * ahead[ahead > 0], **look)
        try:
            for fit, length in zip(compaction.phases(time, strain), (5, 2)):
                span = np.linspace(fit.begin, fit.begin + length * fit.time, 50)
                left_over = fit.amplitude * np.exp(-(span - fit.begin) / fit.time) + strain[-1] - fit.final
                right.semilogy(span[left_over > 0], 100 * left_over[left_over > 0], color="0.55", lw=2.5, alpha=0.45, zorder=0)
        except (RuntimeError, ValueError):
            continue
    left.set_xlabel("time (s)"), left.set_ylabel("volumetric strain (%)")
    left.set_xlim(0), left.legend(title="$\\sigma_0$", loc="lower right", ncol=2)
    right.set_xlabel("time (s)"), right.set_ylabel("volumetric strain still to come (%)")
    right.set_xlim(0)
    right.text(0.98, 0.95, "grey: exponential fits", transform=right.transAxes, ha="right", va="top", fontsize=7, color="0.35")
    panel(left, "a"), panel(right, "b")
    return figure
