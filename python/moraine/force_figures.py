"""Figures of forces and of moving grains: Figs. 5, 6, 7 and 10 of the paper, force distributions, and the picture of a sheared bed.

Each function returns a matplotlib Figure. Snapshots are those of moraine.case; stresses in Pa.
"""
import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from . import forces, spheres
from . import section as sections
from .case import MissingData
from .style import column, ink, lines, page, panel, plt, sequential

fixed_grey = (0.72, 0.72, 0.72, 1)
strong_is_dark = sequential.reversed()  # on white paper


def rounded(value, up=False):
    """To 1, 2 or 5 times a power of ten: the nearest, or the next one up."""
    choices = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(value))
    return float(choices[choices >= value * (1 - 1e-9)][0] if up else choices[np.abs(np.log(choices / value)).argmin()])


def outlined(width=1.6, colour="0"):
    return [withStroke(linewidth=width, foreground=colour)]


def box_edges(snapshot, x, r):
    """Ends of the twelve edges of the box up to the highest grain, m."""
    size = np.array([*snapshot.box[:2], (x[:, 2] + r).max()])
    corners = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])
    return [(p * size, q * size) for p in corners for q in corners if (q - p).min() >= 0 and (q - p).sum() == 1]


def pressure_3d(snapshot, sigma_0, strong=2, upper=4):
    """Grain pressure over sigma_0 in the bed, and the free grains above `strong` alone (Fig. 5). Fixed grains are grey."""
    g = snapshot.grains
    x, r, free = g["position"], g["radius"], g["role"] == 0
    share = g["pressure"] / sigma_0
    colour = np.where(free[:, None], spheres.colours(share / upper), fixed_grey)
    chosen = free & (share > strong)

    figure, axes = plt.subplots(1, 2, figsize=(page, 3.25))
    figure.subplots_adjust(left=0.0, right=0.9, top=0.9, bottom=0.02, wspace=0.03)
    corners = np.array(box_edges(snapshot, x, r)).reshape(-1, 3)
    frame = np.concatenate([x, corners]), np.concatenate([r, np.zeros(len(corners))])
    titles = "free grains by pressure, fixed grains grey", f"only above {strong:g} $\\sigma_0$: {100 * chosen.sum() / free.sum():.0f} % of the free grains"
    for axes_, which, letter, title in zip(axes, (np.ones(len(x), bool), chosen), "ab", titles):
        image, place = spheres.render(x[which], r[which], colour[which], pixels=1500, frame=frame)
        axes_.imshow(image, interpolation="antialiased", zorder=2)
        axes_.set_axis_off()
        panel(axes_, letter)
        axes_.set_title(title, pad=4)
    for p, q in box_edges(snapshot, x, r):
        axes[1].plot(*np.transpose([place(p), place(q)]), color="0.6", lw=0.6, zorder=1)
    bar = figure.colorbar(plt.cm.ScalarMappable(Normalize(0, upper), spheres.colour_map()), extend="max", ax=axes,
                          cax=figure.add_axes([0.915, 0.2, 0.014, 0.55]))
    bar.set_label("grain pressure over $\\sigma_0$")
    bar.set_ticks(range(upper + 1))
    return figure


def force_network(consolidated, sheared, y=None, thickness=None):
    """Normal forces in a vertical slice, in consolidation and in shear: width and colour by |f_n| (Fig. 6)."""
    nets = [forces.network(s, y, thickness) for s in (consolidated, sheared)]
    every = np.concatenate([n.force for n in nets])
    upper = rounded(np.percentile(every, 98))
    above = 100 * np.mean(every > upper)
    unit, name = (1e3, "kN") if upper >= 1e3 else (1, "N")
    tops = [(s.grains["position"][:, 2] + s.grains["radius"]).max() for s in (consolidated, sheared)]
    width, top = consolidated.box[0], max(tops)

    figure, axes = plt.subplots(2, 1, figsize=(column, 2 * 2.5 * top / width + 0.9), sharex=True)
    figure.subplots_adjust(left=0.14, right=0.8, top=0.94, bottom=0.08, hspace=0.16)
    for a, s, net, letter in zip(axes, (consolidated, sheared), nets, "ab"):
        order = np.argsort(net.force)  # the strong on top of the weak
        share = np.minimum(net.force[order] / upper, 1.5)
        a.add_collection(LineCollection(net.segments[order], linewidths=0.15 + 2.4 * share, array=net.force[order] / unit,
                                        cmap=strong_is_dark, norm=Normalize(0, upper / unit), capstyle="round"))
        a.set(xlim=(0, width), ylim=(0, 1.02 * top), aspect="equal", ylabel="z (m)")
        panel(a, letter)
    axes[0].set_title("consolidation", pad=4)
    axes[1].set_title("shear", pad=4)
    axes[1].annotate("", (0.98, 1.05), (0.7, 1.05), xycoords="axes fraction", arrowprops={"arrowstyle": "-|>", "color": ink, "lw": 1.2})
    axes[1].set_xlabel("x (m)")
    bar = figure.colorbar(axes[0].collections[0], cax=figure.add_axes([0.83, 0.25, 0.03, 0.5]), extend="max")
    bar.set_label(f"$|f_n|$ ({name}); {above:.1f} % are above {upper / unit:g} {name}")
    return figure


def stereonets(consolidated, sheared, tau, sigma, strongest=0.5):
    """Directions of the strongest half of the normal forces, in consolidation and in shear (Fig. 7).

    tau, sigma: shear and normal stress on the top while it is sheared, Pa. Density of axes, equal-angle projection of the lower
    hemisphere. White plus: the paper's maximum compressive stress (sigma' + tau); circle: the major principal stress of the
    contact forces."""
    grid = np.linspace(-1, 1, 61)
    gx, gy = np.meshgrid(grid, grid)
    reach = np.maximum(np.hypot(gx, gy), 1)  # what lies outside takes the value of the rim, and is clipped
    maps = [forces.axial_density(*forces.trend_plunge(s, strongest), forces.unproject(gx / reach, gy / reach))
            for s in (consolidated, sheared)]
    upper = np.ceil(10 * max(m.max() for m in maps)) / 10
    levels = MaxNLocator(10).tick_values(0, upper)
    levels = levels[(levels >= 0)]

    figure, axes = plt.subplots(1, 2, figsize=(page * 0.8, 3.1))
    figure.subplots_adjust(left=0.03, right=0.84, top=0.88, bottom=0.14, wspace=0.16)
    for a, s, m, letter, applied, title in zip(axes, (consolidated, sheared), maps, "ab", ((0, sigma), (tau, sigma)),
                                               ("consolidation", "shear")):
        rim = Circle((0, 0), 1, fill=False, ec=ink, lw=0.8, zorder=4)
        a.add_patch(rim)
        drawn = a.contourf(gx, gy, m, levels, cmap=sequential, zorder=1)
        for c in getattr(drawn, "collections", [drawn]):
            c.set_clip_path(rim)
            c.set_edgecolor("face")
        plus = forces.stereographic(*forces.applied_compressive_direction(*applied))
        ring = forces.stereographic(*forces.maximum_compressive_direction(forces.stress_tensor(s)))
        a.plot(*ring, "o", ms=7, mfc="none", mec="0", mew=2.6, zorder=5)
        a.plot(*ring, "o", ms=7, mfc="none", mec="1", mew=1.2, zorder=6)
        a.plot(*plus, "+", ms=10, mec="0", mew=3.4, zorder=7)
        a.plot(*plus, "+", ms=9, mec="1", mew=1.6, zorder=8)
        a.set(xlim=(-1.06, 1.06), ylim=(-1.06, 1.06), aspect="equal")
        a.set_axis_off()
        a.annotate("x", (1.03, 0), va="center", annotation_clip=False)
        a.annotate("y", (0, 1.03), ha="center", annotation_clip=False)
        panel(a, letter)
        a.set_title(title, pad=12)
    for height, way in ((0.99, 1), (-0.99, -1)):  # the top moves along +x, the bottom the other way beside it
        x = np.array([0.5, 0.95]) * way
        axes[1].annotate("", (x[1], height), (x[0], height), annotation_clip=False,
                         arrowprops={"arrowstyle": "-|>", "color": ink, "lw": 1.2})
    bar = figure.colorbar(drawn, cax=figure.add_axes([0.87, 0.22, 0.018, 0.58]))
    bar.set_label("density of axes\n(multiples of uniform)")
    keys = [Line2D([], [], ls="", marker="P", ms=7, mfc="1", mec="0", mew=0.8, label="applied: $\\sigma'$ down + $\\tau$ along x"),
            Line2D([], [], ls="", marker="o", ms=6, mfc="none", mec="0", mew=1.2, label="major principal stress of the contacts")]
    figure.legend(handles=keys, loc="lower center", bbox_to_anchor=(0.43, 0.0), ncols=2, handletextpad=0.2)
    return figure


def force_distribution(snapshots, labels, sigma_0, factor=4):
    """How normal forces and grain pressures are distributed, with the exponential tail and the share above factor sigma_0 (par. 31)."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(page, 2.7))
    figure.subplots_adjust(left=0.08, right=0.98, top=0.9, bottom=0.16, wspace=0.28)
    for s, label, look in zip(snapshots, labels, lines(len(snapshots))):
        d = forces.distribution(s, sigma_0)
        look = look | {"markersize": 2.5, "linewidth": 0.9}
        beta, error = forces.exponential_tail(d.force)
        centres, density = d.density(d.force, upper=max(8.0, d.force.max()))
        shown = density > 0
        left.plot(centres[shown], density[shown], **look, label=f"{label}: $\\beta$ = {beta:.2f} $\\pm$ {error:.2f}")
        centres, density = d.density(d.pressure, upper=max(8.0, d.pressure.max()))
        shown = density > 0
        share = 100 * forces.share_above(s, sigma_0, factor)
        right.plot(centres[shown], density[shown], **look, label=f"{label}: {share:.1f} % above {factor:g} $\\sigma_0$")
    tail = np.array([1.5, left.get_xlim()[1]])
    left.plot(tail, np.exp(-beta * (tail - 1.5)) * np.mean(d.force > 1.5) * beta, color="0.4", lw=0.7, ls="--", zorder=0)
    right.axvline(factor, color="0.4", lw=0.7, ls="--", zorder=0)
    left.set(yscale="log", xlim=0, xlabel="normal force over its mean, $f/\\langle f \\rangle$", ylabel="probability density")
    right.set(yscale="log", xlim=0, xlabel="grain pressure over $\\sigma_0$", ylabel="probability density")
    left.legend(title="tail $\\propto \\exp(-\\beta f/\\langle f \\rangle)$ above 1.5", title_fontsize=7)
    right.legend()
    panel(left, "a")
    panel(right, "b")
    return figure


def turning(centre, radius, angle):
    """An arrow along a circle, from its top: clockwise, as seen from -y, for a positive angle (rad)."""
    t = np.pi / 2 - np.linspace(0, angle, 24) + angle / 2
    path = Path(centre + radius * np.column_stack([np.cos(t), np.sin(t)]))
    return FancyArrowPatch(path=path, arrowstyle="-|>", mutation_scale=4, lw=0.7, color="0", shrinkA=0, shrinkB=0)


def section(snapshots, sigma_0, y=None, z_range=None, labels=None, upper=4):
    """Grains in a vertical plane at several times (Fig. 10): pressure, velocity, spin about y, and slip at contacts.

    z_range: m; by default the upper ten mean diameters. A curved arrow shows how far a disc turns in the time stated."""
    diameter = 2 * snapshots[0].grains["radius"].mean()
    if z_range is None:
        top = max(s.grains["position"][:, 2].max() for s in snapshots)
        z_range = max(top - 9.5 * diameter, 0), top
    cuts = [sections.section(s, y, z_range) for s in snapshots]
    labels = labels or [f"t = {s.stage_time:.2f} s" for s in snapshots]
    speed, spin, slip = (np.concatenate(q) for q in zip(*(
        (np.linalg.norm(c.velocity, axis=1), np.abs(c.spin), np.linalg.norm(c.slip, axis=1)) for c in cuts)))
    speed, slip = (rounded(max(np.percentile(q, 95), 1e-12)) if len(q) else 1.0 for q in (speed, slip))
    turn = rounded(np.radians(150) / max(np.percentile(spin, 95), 1e-12))  # s

    width, low, high = cuts[0].width, z_range[0] - diameter / 2, z_range[1] + diameter / 2
    each = 6.0 * (high - low) / width
    figure, axes = plt.subplots(len(cuts), 1, figsize=(page, len(cuts) * (each + 0.25) + 0.75), sharex=True, squeeze=False)
    tall = figure.get_figheight()
    figure.subplots_adjust(left=0.075, right=0.9, top=1 - 0.6 / tall, bottom=0.4 / tall, hspace=0.25 / each)
    length = 1.1 * diameter  # of the arrows in the key
    for a, cut, label, letter in zip(axes[:, 0], cuts, labels, "abcdefgh"):
        norm = Normalize(0, upper)
        discs = PatchCollection([Circle(c, r) for c, r in zip(cut.centre, cut.radius)], cmap=spheres.colour_map(), norm=norm,
                                array=cut.pressure / sigma_0, linewidths=np.where(cut.spin > 0, 1.1, 0.0),
                                edgecolors=np.where((cut.spin > 0)[:, None], (0, 0, 0, 1), (1, 1, 1, 0)))
        a.add_collection(discs)
        for c, r, w in zip(cut.centre, cut.radius, cut.spin):
            angle = np.clip(w * turn, -5, 5)
            if abs(angle) > 0.25 and r > 0.25 * diameter:
                a.add_patch(turning(c, 0.62 * r, angle))
        arrows = {"angles": "xy", "scale_units": "xy", "headwidth": 4, "headlength": 4, "headaxislength": 3.6}
        moving = a.quiver(*cut.centre.T, *cut.velocity.T, color="1", scale=speed / length, width=0.0022, zorder=3, **arrows)
        moving.set_path_effects(outlined(1.0, "0.1"))
        slips = a.quiver(*cut.point.T, *cut.slip.T, color="#39d353", scale=slip / length, width=0.0018, zorder=4, **arrows)
        slips.set_path_effects(outlined(0.9, "0.15"))
        a.set(xlim=(0, width), ylim=(low, high), aspect="equal", ylabel="z (m)")
        panel(a, letter)
        a.set_title(label, pad=4)
    axes[-1, 0].set_xlabel("x (m)")
    bar = figure.colorbar(discs, cax=figure.add_axes([0.925, 0.3, 0.014, 0.4]), extend="max")
    bar.set_label("grain pressure over $\\sigma_0$")
    return figure


def sheared_bed(case):
    """The bed at the end of the last shear stage by displacement, displacement over height, friction and dilation over strain."""
    sheared = [s for s in case.stages if s.sheared]
    if not sheared:
        raise MissingData(f"{case.output}/case.toml: there is no stage that shears")
    stage = sheared[-1]
    series, grains = stage.series, stage.snapshots[-1].grains
    x, r, moved = grains["position"], grains["radius"], grains["displacement"][:, 0]
    colour = spheres.colours(moved / moved.max())

    figure = plt.figure(figsize=(page, 2.9))
    figure.subplots_adjust(left=0.01, right=0.98, top=0.95, bottom=0.14)
    grid = figure.add_gridspec(2, 3, width_ratios=(2.2, 0.95, 1.5), wspace=0.36, hspace=0.16)

    bed = figure.add_subplot(grid[:, 0])
    image, place = spheres.render(x, r, colour, pixels=1500)
    bed.imshow(image, interpolation="antialiased")
    bed.set_axis_off()
    top, side = (x[:, 2] + r).max(), x.max(axis=0)
    tail, head = (place(np.array([share * side[0], side[1], top + r.mean()])) for share in (0.3, 0.75))
    bed.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "lw": 1.4, "color": ink}, annotation_clip=False)
    bed.annotate("$u$", tail, (-4, 0), textcoords="offset points", ha="right", va="center", fontsize=10, annotation_clip=False)
    bed.set_ylim(len(image), min(0, head[1] - 20))

    profile = figure.add_subplot(grid[:, 1])
    profile.scatter(100 * moved, 100 * x[:, 2], c=colour, s=min(5, 5e3 / len(x)), linewidths=0, rasterized=True)
    profile.set(xlabel="displacement\nalong x (cm)", ylabel="height (cm)", ylim=0)

    over = figure.add_subplot(grid[0, 2])
    over.plot(series["shear_strain"], series["shear_friction"], color=ink, lw=0.7)
    over.set(ylabel="shear friction\n$\\tau/\\sigma'$", ylim=0)
    over.tick_params(labelbottom=False)
    under = figure.add_subplot(grid[1, 2], sharex=over)
    under.plot(series["shear_strain"], series["dilation_diameters"], color=ink, lw=0.7)
    under.set(ylabel="dilation\n(diameters)", xlabel="shear strain", xlim=(0, series["shear_strain"].max()))
    figure.align_ylabels([over, under])
    return figure
