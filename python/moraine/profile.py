"""What varies with height: displacement, the shear zone, porosity (pars. 32 and 33, Figs. 8 and 9)."""
import numpy as np

from .results import MissingData


def slabs(top, thickness):
    """Edges of horizontal slabs between floor and wall, as thick as asked for or a little thicker, m."""
    return np.linspace(0, top, max(1, int(top / thickness)) + 1)


def displacement(snapshot, thickness=None):
    """Middle heights (m) and mean displacement along x (m) of the grains whose centres lie in horizontal slabs.

    thickness: of a slab, m; one mean grain diameter by default. Slabs without a grain are left out.
    """
    z, u = snapshot.grains["position"][:, 2], snapshot.grains["displacement"][:, 0]
    edges = slabs(snapshot.top_wall, thickness or 2 * snapshot.grains["radius"].mean())
    which = np.clip(np.digitize(z, edges) - 1, 0, len(edges) - 2)
    count = np.bincount(which, minlength=len(edges) - 1)
    total = np.bincount(which, weights=u, minlength=len(edges) - 1)
    there = count > 0
    return ((edges[:-1] + edges[1:]) / 2)[there], total[there] / count[there]


def layer_displacement(snapshot):
    """Of the driven layer, m."""
    driven = snapshot.grains["role"] == 2
    if not driven.any():
        raise MissingData(f"{snapshot.file}:/grains: no grain has role 2: there is no driven layer, the bed is not sheared")
    return snapshot.grains["displacement"][driven, 0].mean()


def shear_zone(snapshot, share=0.05, diameter=None):
    """Thickness of the shear zone in diameters (m; the mean of the grains by default), and read off slabs as thick, two ways:

    depth     from the middle of the driven layer down to where the slab mean of the displacement along x has fallen to `share`
              of the layer's, whichever way that went (linear between slab middles)
    integral  the integral over z of u(z)/u_layer: the thickness of a block that moves with the layer and carries as much
    """
    d, u_layer = diameter or 2 * snapshot.grains["radius"].mean(), layer_displacement(snapshot)
    if u_layer == 0:
        raise MissingData(f"{snapshot.file}: the driven layer has not moved since shear began: there is no shear zone")
    driven = snapshot.grains["role"] == 2
    top = snapshot.grains["position"][driven, 2].mean()
    z, u = displacement(snapshot, d)
    if u_layer < 0:
        u, u_layer = -u, -u_layer
    edges = slabs(snapshot.top_wall, d)
    integral = float(np.sum(u) * (edges[1] - edges[0]) / u_layer)
    depth = top
    below = np.flatnonzero(u < share * u_layer)
    below = below[z[below] < top]
    if len(below):
        k = below[-1]  # the highest slab that has stayed behind
        if k + 1 < len(z):
            part = (share * u_layer - u[k]) / (u[k + 1] - u[k])
            depth = top - (z[k] + part * (z[k + 1] - z[k]))
        else:
            depth = top - z[k]
    return depth / d, integral / d


def porosity(snapshot, thickness=None):
    """Edges (m) and porosity of horizontal slabs between floor and top wall; each sphere is cut exactly.

    thickness: of a slab, m; one mean grain diameter by default.
    """
    z, r = snapshot.grains["position"][:, 2], snapshot.grains["radius"]
    edges = slabs(snapshot.top_wall, thickness or 2 * r.mean())
    h = np.clip(edges[:, None] - (z - r), 0, 2 * r)             # of the part of each sphere below each edge
    below = (np.pi * h**2 * (3 * r - h) / 3).sum(axis=1)
    return edges, 1 - np.diff(below) / (snapshot.area * np.diff(edges))


def alike(snapshots):
    """Edges (m) and porosity of as many slabs in each of several beds, about one mean grain diameter thick; [(edges, porosity)]."""
    count = min(len(porosity(s)[1]) for s in snapshots)
    return [porosity(s, s.top_wall / (count + 0.5)) for s in snapshots]


def loosened_depth(before, after):
    """Mean depth below the top wall, in mean grain diameters, of the porosity that slabs have gained from one snapshot to the other.
    The slabs at floor and wall are left out."""
    (_, phi_before), (edges, phi) = alike([before, after])
    gain = np.clip(phi - phi_before, 0, None)[1:-1]
    middle = ((edges[1:] + edges[:-1]) / 2)[1:-1]
    if not gain.any():
        return np.nan
    return float((gain * (after.top_wall - middle)).sum() / gain.sum() / (2 * after.grains["radius"].mean()))


def inside(count):
    """Points spread evenly in a ball of radius 1, count x 3: each stands for as much of its volume."""
    k = np.arange(count) + 0.5
    # Radii by volume; directions by a spiral whose turns do not keep step with the radii.
    radius, z = np.cbrt(k / count), 1 - 2 * np.mod(k * 0.7548776662, 1)
    turn = 2 * np.pi * np.mod(k * 0.5698402910, 1)
    across = np.sqrt(1 - z**2)
    return radius[:, None] * np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def section_porosity(snapshot, cells_y, cells_z, points=300):
    """Porosity of columns along x: cells_y x cells_z between the sides in y and between floor and top wall; in y the box is periodic.
    Each sphere counts as so many points, which leaves an error of some 0.002 in a cell of one diameter."""
    x, r = snapshot.grains["position"], snapshot.grains["radius"]
    ball = inside(points)
    y = (x[:, 1, None] + r[:, None] * ball[:, 1]) % snapshot.box[1]
    z = x[:, 2, None] + r[:, None] * ball[:, 2]
    volume = np.repeat(4 / 3 * np.pi * r**3 / points, points)
    solid, *_ = np.histogram2d(y.ravel(), z.ravel(), (cells_y, cells_z), ((0, snapshot.box[1]), (0, snapshot.top_wall)), weights=volume)
    return 1 - solid / (snapshot.area * snapshot.top_wall / (cells_y * cells_z))
