"""Figures of forces and of moving grains: Figs. 5, 6, 7 and 10 of the paper, force distributions, and a sheared bed.

Each function returns a matplotlib Figure. Snapshots are those of moraine.results; stresses in Pa.
"""
import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from . import forces, shearing, spheres
from . import section as sections
from .results import MissingData
from .style import column, ink, lines, page, panel, plt, sequential

fixed_grey = (0.72, 0.72, 0.72, 1)
strong_is_dark = sequential.reversed()  # on white paper
warm = plt.matplotlib.colors.ListedColormap(plt.get_cmap("YlOrBr")(np.linspace(0.03, 0.72, 256)))  # black, white, green stand out
white, green = ("1", 0.014), ("#2fd14f", 0.013)  # colour, width in inches
straight = {"angles": "xy", "scale_units": "xy", "units": "inches", "headwidth": 4, "headlength": 4.5, "headaxislength": 4,
            "minshaft": 1.8}


def rounded(value):
    """To the nearest of 1, 2 or 5 times a power of ten."""
    choices = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(value))
    return float(choices[np.abs(np.log(choices / value)).argmin()])


def outlined(width=1.6, colour="0"):
    return [withStroke(linewidth=width, foreground=colour)]


def box_edges(snapshot, x, r):
    """Ends of the twelve edges of the box up to the highest grain, m."""
    size = np.array([*snapshot.box[:2], (x[:, 2] + r).max()])
    corners = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])
    return [(p * size, q * size) for p in corners for q in corners if (q - p).min() >= 0 and (q - p).sum() == 1]


def pressure_3d(snapshot, sigma_0, strong=3, upper=5):
    """Grain pressure over sigma_0 in the bed, and the free grains above `strong` alone (Fig. 5). Fixed grains are grey."""
    g = snapshot.grains
    x, r, free = g["position"], g["radius"], g["role"] == 0
    share = g["pressure"] / sigma_0
    colour = np.where(free[:, None], spheres.colours(share / upper), fixed_grey)
    chosen = free & (share > strong)

    figure, axes = plt.subplots(1, 2, figsize=(page, 3.25))
    figure.subplots_adjust(left=0.0, right=0.86, top=0.9, bottom=0.02, wspace=0.03)
    corners = np.array(box_edges(snapshot, x, r)).reshape(-1, 3)
    frame = np.concatenate([x, corners]), np.concatenate([r, np.zeros(len(corners))])
    titles = ("free grains by pressure" + ", fixed ones grey" * bool((~free).any()),
              f"above {strong:g} $\\sigma_0$ only: {100 * chosen.sum() / free.sum():.0f} % of the free grains")
    for axes_, which, letter, title in zip(axes, (np.ones(len(x), bool), chosen), "ab", titles):
        image, place = spheres.render(x[which], r[which], colour[which], pixels=1500, frame=frame)
        axes_.imshow(image, interpolation="antialiased", zorder=2)
        axes_.set(xlim=(0, image.shape[1]), ylim=(image.shape[0], 0))
        axes_.set_axis_off()
        panel(axes_, letter)
        axes_.set_title(title, pad=4)
    hidden = snapshot.box * (1, 1, 0)  # the corner behind everything
    for p, q in box_edges(snapshot, x, r):
        seen = not (np.allclose(p, hidden) or np.allclose(q, hidden))
        axes[1].plot(*np.transpose([place(p), place(q)]), color="0.45", lw=0.6, ls="-" if seen else ":",
                     zorder=3 if seen else 1, clip_on=False)
    lx, ly, top = corners.max(axis=0)
    for at, length, offset in (((lx / 2, 0, 0), lx, (3, -4)), ((0, ly / 2, 0), ly, (-3, -4)), ((lx, 0, top / 2), top, (3, 0))):
        axes[1].annotate(f"{length:.2f} m", place(np.array(at)), offset, textcoords="offset points", fontsize=7,
                         ha="left" if offset[0] > 0 else "right", va="top" if offset[1] else "center", annotation_clip=False)
    bar = figure.colorbar(plt.cm.ScalarMappable(Normalize(0, upper), spheres.colour_map()), extend="max", ax=axes,
                          cax=figure.add_axes([0.93, 0.2, 0.014, 0.55]))
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
    axes[1].annotate("$u$", (1.0, 1.05), (0.7, 1.05), xycoords="axes fraction", ha="right", va="center",
                     arrowprops={"arrowstyle": "-|>", "color": ink, "lw": 1.2})
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

    figure, axes = plt.subplots(1, 2, figsize=(page * 0.8, 2.95))
    figure.subplots_adjust(left=0.03, right=0.84, top=0.88, bottom=0.1, wspace=0.16)
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
        a.set_title(title, pad=10)
    axes[1].annotate("$u$", (1.05, -0.98), (0.7, -0.98), ha="right", va="center", annotation_clip=False,
                     arrowprops={"arrowstyle": "-|>", "color": ink, "lw": 1.2})
    bar = figure.colorbar(drawn, cax=figure.add_axes([0.87, 0.22, 0.018, 0.58]))
    bar.set_label("density of axes\n(multiples of uniform)")
    keys = [Line2D([], [], ls="", marker="P", ms=7, mfc="1", mec="0", mew=0.8, label="applied: $\\sigma'$ down + $\\tau$ along x"),
            Line2D([], [], ls="", marker="o", ms=6, mfc="none", mec="0", mew=1.2, label="major principal stress of the contacts")]
    figure.legend(handles=keys, loc="lower center", bbox_to_anchor=(0.43, 0.0), ncols=2, handletextpad=0.2)
    return figure


def force_distribution(snapshots, labels, sigma_0, factor=4):
    """Distributions of normal forces, with an exponential tail, and of grain pressures, with the share above factor sigma_0.

    One curve for each snapshot, named by its label. Bins with fewer than three values are left out; the dashed tail is that of the
    last snapshot. Par. 31."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(page, 2.7))
    figure.subplots_adjust(left=0.08, right=0.98, top=0.9, bottom=0.16, wspace=0.28)
    for s, label, look in zip(snapshots, labels, lines(len(snapshots))):
        d = forces.distribution(s, sigma_0)
        beta, error = forces.exponential_tail(d.force)
        share = 100 * forces.share_above(s, sigma_0, factor)
        names = f"{label}: $\\beta$ = {beta:.2f} $\\pm$ {error:.2f}", f"{label}: {share:.1f} %"
        for a, values, name in zip((left, right), (d.force, d.pressure), names):
            bins = int(np.ceil(values.max() / 0.25))
            centres, density = d.density(values, bins, bins * 0.25)
            shown = density * len(values) * 0.25 > 2.5  # at least three values in a bin
            a.plot(centres[shown], density[shown], **look | {"markersize": 2.5, "linewidth": 0.9}, label=name)
    for a in (left, right):
        a.set(yscale="log", xlim=0, ylabel="probability density")
        low, high = a.get_ylim()
        a.set_ylim(low, high * (high / low)**0.45)  # room for the legend
    tail = np.array([1.5, left.get_xlim()[1]])
    left.plot(tail, np.exp(-beta * (tail - 1.5)) * np.mean(d.force > 1.5) * beta, color="0.4", lw=0.7, ls="--", zorder=0)
    right.axvline(factor, ymax=0.66, color="0.4", lw=0.7, ls="--", zorder=0)
    left.set_xlabel("normal force over its mean, $f/\\langle f \\rangle$")
    right.set_xlabel("grain pressure over $\\sigma_0$")
    left.legend(title="tail $\\propto \\exp(-\\beta f/\\langle f \\rangle)$ above 1.5", title_fontsize=7, loc="upper right")
    right.legend(title=f"share above {factor:g} $\\sigma_0$", title_fontsize=7, loc="upper right")
    panel(left, "a")
    panel(right, "b")
    return figure


def section_scales(cuts, diameter):
    """What the arrows of these sections are drawn to, one for all of them."""
    def typical(values, percent):
        values = np.concatenate(values)
        return rounded(max(np.percentile(values, percent), 1e-9)) if len(values) else 1.0

    return {"speed": typical([np.linalg.norm(c.velocity, axis=1) for c in cuts], 95),  # m/s
            "slip": typical([np.linalg.norm(c.slip, axis=1) for c in cuts], 95),       # m/s
            "turn": rounded(2.5 / typical([np.abs(c.spin) for c in cuts], 85)),        # s
            "length": 1.2 * diameter}                                                  # m, of an arrow of the key


def section(snapshots, sigma_0, y=None, z_range=None, labels=None, upper=4):
    """Grains in a vertical plane at several times (Fig. 10): pressure, velocity, spin about y, and slip at contacts.

    z_range: m; by default the upper eight mean diameters. A curved arrow shows how far a disc turns in the time stated. Arrows
    much longer than those of the key are cut, as a rattler's slip would hide the others."""
    diameter = 2 * snapshots[0].grains["radius"].mean()
    if z_range is None:
        top = max(s.grains["position"][:, 2].max() for s in snapshots)
        z_range = max(top - 7 * diameter, 0), top
    cuts = [sections.section(s, y, z_range) for s in snapshots]
    labels = labels or [f"t = {s.stage_time:.2f} s" for s in snapshots]

    scales = section_scales(cuts, diameter)
    width, low, high = cuts[0].width, z_range[0] - 0.6 * diameter, z_range[1] + 0.6 * diameter
    rows, columns = (len(cuts), 1) if width > 1.5 * (high - low) else (1, len(cuts))
    left, right, gap = 0.5, 0.65, 0.3  # inches
    wide = (page - left - right - gap * (columns - 1)) / columns
    tall = wide * (high - low) / width
    height = rows * (tall + gap) + 0.85
    figure = plt.figure(figsize=(page, height))
    for k, (cut, label) in enumerate(zip(cuts, labels)):
        row, place = k // columns, k % columns
        a = figure.add_axes([(left + place * (wide + gap)) / page, (0.4 + (rows - 1 - row) * (tall + gap)) / height, wide / page,
                             tall / height])
        discs = draw_section(a, cut, sigma_0, upper, diameter, **scales)
        a.set(xlim=(0, width), ylim=(low, high))
        a.tick_params(labelbottom=row == rows - 1, labelleft=place == 0)
        a.set_xlabel("x (m)" if row == rows - 1 else "")
        a.set_ylabel("z (m)" if place == 0 else "")
        panel(a, "abcdefgh"[k])
        a.set_title(label, pad=4)
    middle = (0.4 + (rows * (tall + gap) - gap) / 2) / height
    place = [1 - 0.5 / page, middle - 0.7 / height, 0.1 / page, 1.4 / height]
    bar = figure.colorbar(discs, extend="max", cax=figure.add_axes(place))
    bar.set_label("grain pressure over $\\sigma_0$")
    section_key(figure.add_axes([left / page, 1 - 0.4 / height, 1 - (left + right) / page, 0.36 / height]), width / wide, diameter,
                **scales)
    return figure


def arrows(axes, places, vectors, key, length, colour, thick):
    """Straight arrows, `length` (m) for a vector of size `key`; none where they would be mere heads, cut at 1.5 lengths."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    seen = size[:, 0] > 0.2 * key
    v = (vectors * np.minimum(1, 1.5 * key / np.maximum(size, 1e-30)))[seen]
    drawn = axes.quiver(*places[seen].T, *v.T, color=colour, scale=key / length, width=thick, zorder=4, **straight)
    drawn.set_path_effects(outlined(0.9, "0"))


def turning(centre, radius, angle):
    """An arrow along a circle, half of it to each side of the top: clockwise, as seen from -y, for a positive angle (rad)."""
    t = np.pi / 2 + angle / 2 - np.linspace(0, angle, 24)
    path = Path(centre + radius * np.column_stack([np.cos(t), np.sin(t)]))
    return FancyArrowPatch(path=path, arrowstyle="-|>", mutation_scale=4.5, lw=0.8, color="0", shrinkA=0, shrinkB=0, zorder=3)


def draw_section(axes, cut, sigma_0, upper, diameter, speed, slip, turn, length):
    positive = cut.spin > 0
    discs = PatchCollection([Circle(c, r) for c, r in zip(cut.centre, cut.radius)], cmap=warm, norm=Normalize(0, upper),
                            array=cut.pressure / sigma_0, linewidths=np.where(positive, 1.2, 0.3),
                            edgecolors=np.where(positive[:, None], (0, 0, 0, 1), (0.6, 0.6, 0.6, 1)))
    axes.add_collection(discs)
    for c, r, w in zip(cut.centre, cut.radius, cut.spin):
        angle = np.clip(w * turn, -5, 5)
        if abs(angle) > 0.7 and r > 0.25 * diameter:
            axes.add_patch(turning(c, 0.65 * r, angle))
    arrows(axes, cut.centre, cut.velocity, speed, length, *white)
    arrows(axes, cut.point, cut.slip, slip, length, *green)
    return discs


def section_key(axes, metre_per_inch, diameter, speed, slip, turn, length):
    """What the marks of a section mean, to the scale of its panels."""
    wide, tall = np.array([axes.get_position().width * axes.figure.get_figwidth(), 0.36]) * metre_per_inch
    axes.set(xlim=(0, wide), ylim=(-tall / 2, tall / 2))
    axes.set_axis_off()
    r, gap = min(diameter / 2, 0.45 * tall), 0.08 * metre_per_inch
    middle = np.array([length / 2, 0])
    marks = ((f"velocity {1e3 * speed:g} mm/s", lambda at: arrows(axes, at[None], np.array([[speed, 0]]), speed, length, *white)),
             (f"slip {1e3 * slip:g} mm/s", lambda at: arrows(axes, at[None], np.array([[slip, 0]]), slip, length, *green)),
             ("spin > 0 about y", lambda at: axes.add_patch(Circle(at + middle, r, fc=warm(0), ec="0", lw=1.2))),
             (f"turn in {turn:g} s", lambda at: axes.add_patch(turning(at + middle - (0, 0.3 * r), 0.9 * r, 2.5))))
    for k, (text, draw) in enumerate(marks):
        at = np.array([k * wide / 4, 0])
        draw(at)
        axes.text(at[0] + length + gap, 0, text, fontsize=7, va="center")


def sheared_bed(case):
    """The bed at the end of the last shear stage by displacement, displacement over height, friction and dilation over strain.

    Displacement is that of the stage, along its direction. Strain and friction: see shearing.drawn."""
    sheared = [s for s in case.stages if s.sheared]
    if not sheared:
        raise MissingData(f"{case.output}/case.toml: there is no stage that shears")
    stage = shearing.along(sheared[-1])
    series, grains, loop = shearing.joined(shearing.drawn(stage)), stage.snapshots[-1].grains, shearing.is_loop(stage)
    x, r, moved = grains["position"], grains["radius"], grains["displacement"][:, 0]
    colour = spheres.colours(moved / (moved.max() or 1.0))

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
    profile.set(xlabel="displacement\nalong shear (cm)", ylabel="height (cm)", ylim=0)

    over = figure.add_subplot(grid[0, 2])
    over.plot(series["shear_strain"], series["shear_friction"], color=ink, lw=0.7)
    over.set(ylabel="shear friction\n$\\tau/\\sigma'$")
    over.tick_params(labelbottom=False)
    under = figure.add_subplot(grid[1, 2], sharex=over)
    under.plot(series["shear_strain"], series["dilation_diameters"], color=ink, lw=0.7)
    under.set(ylabel="dilation\n(diameters)", xlabel="shear strain")
    if loop:
        over.axhline(0, color="0.6", lw=0.5, zorder=0)
    else:
        over.set_ylim(0), under.set_xlim(0, series["shear_strain"].max() or None)
    figure.align_ylabels([over, under])
    return figure
