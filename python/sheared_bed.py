#!/usr/bin/env python3
"""Draws the sheared bed of a case: its grains coloured by how far they moved along x, the displacement by height, and
shear friction and dilation over shear strain.

usage: sheared_bed.py CASE PICTURE.png
"""
import sys
from pathlib import Path

import h5py
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt



def colours(share):
    """Viridis without its darkest tones, which hide the shape of a grain."""
    return plt.get_cmap("viridis")(0.12 + 0.83 * np.clip(share, 0, 1))


def blurred(image, width):
    """Mean over width x width pixels around each."""
    for axis in (0, 1):
        n = image.shape[axis]
        reach = [(width // 2, width // 2) if a == axis else (0, 0) for a in (0, 1)]
        first = [(1, 0) if a == axis else (0, 0) for a in (0, 1)]
        total = np.cumsum(np.pad(np.pad(image, reach, mode="edge"), first), axis=axis)
        span = 2 * (width // 2)
        image = (np.take(total, range(span, span + n), axis) - np.take(total, range(n), axis)) / span
    return image


def render(x, r, colour, azimuth, elevation, pixels):
    """Shaded spheres seen from far away. Returns an RGBA image, and a function from places to its pixels."""
    a, e = np.radians([azimuth, elevation])
    right = np.array([np.cos(a), np.sin(a), 0])
    back = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
    up = np.cross(right, back)
    light = -0.45 * right - 0.6 * back + 0.66 * up
    light /= np.linalg.norm(light)

    u, v, d = x @ right, x @ up, x @ back
    low, high = np.array([min(u - r), min(v - r)]), np.array([max(u + r), max(v + r)])
    scale = pixels / (high[0] - low[0])
    width, height = np.ceil((high - low) * scale).astype(int) + 1
    depth = np.full((height, width), np.inf)
    image = np.zeros((height, width, 4))
    for k in range(len(r)):
        c = (np.array([u[k], v[k]]) - low) * scale
        radius = r[k] * scale
        i0, j0 = np.maximum(np.floor(c - radius).astype(int), 0)
        i1, j1 = np.ceil(c + radius).astype(int) + 1
        i, j = np.meshgrid(np.arange(i0, min(i1, width)), np.arange(j0, min(j1, height)))
        nu, nv = (i - c[0]) / radius, (j - c[1]) / radius
        inside = nu**2 + nv**2 < 1
        nd = np.sqrt(np.where(inside, 1 - nu**2 - nv**2, 0))  # towards the eye
        z = d[k] - r[k] * nd
        i, j, z, nu, nv, nd = (q[inside] for q in (i, j, z, nu, nv, nd))
        nearer = z < depth[j, i]
        i, j, z, nu, nv, nd = (q[nearer] for q in (i, j, z, nu, nv, nd))
        depth[j, i] = z
        shine = nu * (light @ right) + nv * (light @ up) - nd * (light @ back)
        shade = 0.38 + 0.67 * np.clip(shine, 0, 1)
        image[j, i, :3] = colour[k, :3] * shade[:, None] + 0.25 * np.clip(shine, 0, 1)[:, None]**24
        image[j, i, 3] = 1

    # Hollows are darker than what stands out.
    seen = np.isfinite(depth)
    near = np.where(seen, depth, depth[seen].max())
    hollow = np.clip((near - blurred(near, int(2 * r.mean() * scale))) / r.mean(), 0, 1.5)
    image[..., :3] *= (1 - 0.35 * hollow)[..., None]
    image = np.clip(image[: height // 2 * 2, : width // 2 * 2], 0, 1)  # then two by two into one
    image = sum(image[a::2, b::2] for a in (0, 1) for b in (0, 1)) / 4
    image = image[::-1]

    def place(point):
        return (point @ right - low[0]) * scale / 2, len(image) - (point @ up - low[1]) * scale / 2

    return image, place


def main(case, picture):
    output = Path(case) / "output"
    with h5py.File(output / "series.h5") as series:
        strain, friction, dilation = (series[k][:] for k in ("shear_strain", "shear_friction", "dilation_diameters"))
        shear = series["stage"][:] == series["stage"][-1]
    with h5py.File(sorted((output / "snapshots").glob("*-shear-*.h5"))[-1]) as snapshot:
        grains = {k: snapshot["grains"][k][:] for k in ("position", "radius", "displacement", "role")}
    x, r = grains["position"], grains["radius"]
    moved = grains["displacement"][:, 0]
    colour = colours(moved / moved.max())

    plt.rcParams.update({"font.size": 9, "font.family": "DejaVu Sans", "axes.spines.top": False,
                         "axes.spines.right": False, "axes.linewidth": 0.7})
    figure = plt.figure(figsize=(10, 4.1), dpi=112)
    figure.subplots_adjust(left=0.015, right=0.975, top=0.93, bottom=0.13)
    grid = figure.add_gridspec(2, 3, width_ratios=(2.35, 0.95, 1.6), wspace=0.32, hspace=0.16)

    bed = figure.add_subplot(grid[:, 0])
    image, place = render(x, r, colour, azimuth=-28, elevation=22, pixels=1100)
    bed.imshow(image, interpolation="antialiased")
    bed.set_axis_off()
    top, side = (x[:, 2] + r).max(), x.max(axis=0)
    tail, head = (place(np.array([share * side[0], side[1], top + r.mean()])) for share in (0.3, 0.75))
    bed.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "lw": 1.8, "color": "0.15"}, annotation_clip=False)
    bed.annotate("$u$", tail, (-5, 0), textcoords="offset points", ha="right", va="center", fontsize=12,
                 annotation_clip=False)
    bed.set_ylim(len(image), min(0, head[1] - 20))

    profile = figure.add_subplot(grid[:, 1])
    profile.scatter(100 * moved, 100 * x[:, 2], c=colour, s=7, linewidths=0)
    profile.set_xlabel("displacement along x (cm)")
    profile.set_ylabel("height (cm)")
    profile.set_ylim(0)

    over = figure.add_subplot(grid[0, 2])
    over.plot(strain[shear], friction[shear], color="0.15", lw=0.9)
    over.set_ylabel("shear friction $\\tau/\\sigma'$")
    over.tick_params(labelbottom=False)
    over.set_ylim(0)
    under = figure.add_subplot(grid[1, 2], sharex=over)
    under.plot(strain[shear], dilation[shear], color="0.15", lw=0.9)
    under.set_ylabel("dilation (diameters)")
    under.set_xlabel("shear strain")
    under.set_xlim(0, strain.max())
    figure.align_ylabels([over, under])
    figure.savefig(picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
