"""Grains as shaded spheres seen from far away, without a graphics card: 10,000 take some seconds."""
import numpy as np

from .style import plt


def colours(share):
    """Viridis without its darkest tones, which hide the shape of a grain."""
    return plt.get_cmap("viridis")(0.12 + 0.83 * np.clip(share, 0, 1))


def colour_map():
    """The same for colour bars."""
    return plt.matplotlib.colors.ListedColormap(colours(np.linspace(0, 1, 256)))


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


def render(x, r, colour, azimuth=-28, elevation=22, pixels=1100, frame=None):
    """Centres x (n x 3) and radii r, m, with colours (n x 3 or 4), seen from azimuth and elevation (degrees).

    pixels: width of the picture before two by two become one. frame: centres and radii that it is to hold, if others than x and r.
    Returns an RGBA image, and a function from places (m) to its pixels."""
    a, e = np.radians([azimuth, elevation])
    right = np.array([np.cos(a), np.sin(a), 0])
    back = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
    up = np.cross(right, back)
    light = -0.45 * right - 0.6 * back + 0.66 * up
    light /= np.linalg.norm(light)

    held, reach = (x, r) if frame is None else frame
    low = np.array([min(held @ right - reach), min(held @ up - reach)])
    high = np.array([max(held @ right + reach), max(held @ up + reach)])
    scale = pixels / (high[0] - low[0])
    width, height = np.ceil((high - low) * scale).astype(int) + 1
    u, v, d = x @ right, x @ up, x @ back
    depth = np.full((height, width), np.inf)
    image = np.zeros((height, width, 4))
    for k in np.argsort(d):  # the nearest first: what it hides need not be shaded
        c = (np.array([u[k], v[k]]) - low) * scale
        radius = r[k] * scale
        i0, j0 = np.maximum(np.floor(c - radius).astype(int), 0)
        i1, j1 = np.minimum(np.ceil(c + radius).astype(int) + 1, (width, height))
        if (d[k] - r[k] >= depth[j0:j1, i0:i1]).all():
            continue
        i, j = np.meshgrid(np.arange(i0, i1), np.arange(j0, j1))
        nu, nv = (i - c[0]) / radius, (j - c[1]) / radius
        inside = nu**2 + nv**2 < 1
        nd = np.sqrt(np.where(inside, 1 - nu**2 - nv**2, 0))  # towards the eye
        z = d[k] - r[k] * nd
        shown = inside & (z < depth[j, i])
        i, j, z, nu, nv, nd = (q[shown] for q in (i, j, z, nu, nv, nd))
        depth[j, i] = z
        shine = np.clip(nu * (light @ right) + nv * (light @ up) - nd * (light @ back), 0, 1)
        image[j, i, :3] = colour[k, :3] * (0.38 + 0.67 * shine)[:, None] + 0.25 * shine[:, None]**24
        image[j, i, 3] = 1

    # Hollows are darker than what stands out.
    seen = np.isfinite(depth)
    if seen.any():
        near = np.where(seen, depth, depth[seen].max())
        hollow = np.clip((near - blurred(near, int(2 * r.mean() * scale))) / r.mean(), 0, 1.5)
        image[..., :3] *= (1 - 0.35 * hollow)[..., None]
    image = np.clip(image[: height // 2 * 2, : width // 2 * 2], 0, 1)  # then two by two into one
    image = sum(image[a::2, b::2] for a in (0, 1) for b in (0, 1)) / 4
    image[..., :3] /= np.maximum(image[..., 3:], 0.25)  # a rim is transparent, not dark
    image = image[::-1]

    def place(point):
        return (point @ right - low[0]) * scale / 2, len(image) - (point @ up - low[1]) * scale / 2

    return image, place
