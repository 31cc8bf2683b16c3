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


class View:
    """Parallel rays from azimuth and elevation (degrees), on a picture that just holds the spheres x, r (m).

    pixels: its width before two by two become one. at_most: its width and height in pixels of the final picture, instead."""

    def __init__(self, x, r, azimuth=-28, elevation=22, pixels=1100, at_most=None):
        a, e = np.radians([azimuth, elevation])
        self.right = np.array([np.cos(a), np.sin(a), 0])
        self.back = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
        self.up = np.cross(self.right, self.back)
        self.low = np.array([min(x @ self.right - r), min(x @ self.up - r)])
        high = np.array([max(x @ self.right + r), max(x @ self.up + r)])
        room = (pixels, np.inf) if at_most is None else 2 * np.array(at_most) - 2
        self.scale = min(room / (high - self.low))  # pixels per metre, before two by two become one
        self.width, self.height = (np.ceil((high - self.low) * self.scale).astype(int) + 1) // 2 * 2

    def place(self, point):
        """The pixel of the final picture where a place (m) is seen."""
        return (point @ self.right - self.low[0]) * self.scale / 2, self.height // 2 - (point @ self.up - self.low[1]) * self.scale / 2


def draw(x, r, colour, view):
    """Centres x (n x 3) and radii r, m, with colours (n x 3 or 4), as an RGBA image of half the view's width and height."""
    right, up, back = view.right, view.up, view.back
    light = -0.45 * right - 0.6 * back + 0.66 * up
    light /= np.linalg.norm(light)
    width, height, scale = view.width, view.height, view.scale
    centre = (np.column_stack([x @ right, x @ up]) - view.low) * scale
    radius, d = r * scale, x @ back
    first = np.maximum(np.floor(centre - radius[:, None]).astype(int), 0)
    end = np.minimum(np.ceil(centre + radius[:, None]).astype(int) + 1, (width, height))
    columns, rows = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
    depth, owner = np.full((height, width), np.inf, np.float32), np.full((height, width), -1, np.int32)
    for k in np.argsort(d - r):  # the nearest first: what it hides is left out
        (i0, j0), (i1, j1) = first[k], end[k]
        before = depth[j0:j1, i0:i1]
        if not (d[k] - r[k] < before).any():
            continue
        off = radius[k]**2 - (columns[i0:i1] - centre[k, 0])**2 - (rows[j0:j1] - centre[k, 1])**2
        z = d[k] - np.sqrt(np.maximum(off, 0)) / scale
        shown = (off > 0) & (z < before)
        np.copyto(before, z, where=shown)
        np.copyto(owner[j0:j1, i0:i1], k, where=shown)

    image = np.zeros((height, width, 4), np.float32)
    seen = owner >= 0
    j, i = np.nonzero(seen)
    k = owner[seen]
    nu, nv = (i - centre[k, 0]) / radius[k], (j - centre[k, 1]) / radius[k]
    nd = (d[k] - depth[seen]) / r[k]  # towards the eye
    shine = np.clip(nu * (light @ right) + nv * (light @ up) - nd * (light @ back), 0, 1)
    shade = colour[k, :3] * (0.38 + 0.67 * shine)[:, None] + 0.25 * shine[:, None]**24

    # Hollows are darker than what stands out.
    if seen.any():
        near = np.where(seen, depth, depth[seen].max())
        hollow = np.clip((near - blurred(near, int(2 * r.mean() * scale))) / r.mean(), 0, 1.5)
        shade *= (1 - 0.35 * hollow[seen])[:, None]
    image[seen, :3], image[seen, 3] = np.clip(shade, 0, 1), 1
    image = sum(image[a::2, b::2] for a in (0, 1) for b in (0, 1)) / 4  # two by two into one
    image[..., :3] /= np.maximum(image[..., 3:], 0.25)  # a rim is transparent, not dark
    return image[::-1]


def render(x, r, colour, azimuth=-28, elevation=22, pixels=1100, frame=None):
    """Spheres as draw() has them, in a view that just holds them; frame: or these centres and radii, if others than x and r.

    Returns an RGBA image, and a function from places (m) to its pixels."""
    view = View(*((x, r) if frame is None else frame), azimuth, elevation, pixels)
    return draw(x, r, colour, view), view.place
