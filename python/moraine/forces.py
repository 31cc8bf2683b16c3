"""Contact forces: their network, distribution, directions, fabric and stress (pars. 31, 34, 44; Figs. 5-7).

A free contact is one between two free grains (role 0): the "nonfixed particles" of Fig. 6. Contacts with walls are not in a
snapshot's contacts; a grain's pressure has them. Directions are axes, told by their end in the lower hemisphere: the trend is
the angle of its horizontal part from +x towards +y (0 to 360 degrees), the plunge that below the horizontal (0 to 90 degrees).
"""
from dataclasses import dataclass

import numpy as np

from .results import MissingData


def free_contacts(snapshot):
    """Mask of the contacts between two free grains. Raises MissingData where there are none."""
    free = snapshot.grains["role"] == 0
    both = free[snapshot.contacts["i"]] & free[snapshot.contacts["j"]]
    if not both.any():
        raise MissingData(f"{snapshot.file}: there are no contacts between free grains")
    return both


def strongest_contacts(snapshot, share):
    """Rows of that share of the free contacts that carries the largest |f_n|, strongest first."""
    free = np.flatnonzero(free_contacts(snapshot))
    order = np.argsort(snapshot.normal_forces()[free], kind="stable")[::-1]
    return free[order[:round(share * len(free))]]


# The network (Fig. 6).

@dataclass
class Network:
    segments: np.ndarray  # m, count x 2 x 2: the ends of each, as (x, z)
    force: np.ndarray     # N, |f_n| of each segment
    contact: np.ndarray   # row of the contact; one that crosses a side in x has two segments


def network(snapshot, y=None, thickness=None):
    """Free contacts whose point lies within thickness / 2 of the plane y, as segments between the grains' centres (Fig. 6).

    Both in m; by default the middle of the box, and three mean diameters. A segment that crosses a side in x is cut there, and
    its rest begins at the other side."""
    lx, ly = snapshot.box[:2]
    y = ly / 2 if y is None else y
    thickness = 6 * snapshot.grains["radius"].mean() if thickness is None else thickness
    off = snapshot.contacts["point"][:, 1] - y
    off -= ly * np.round(off / ly)
    contact = np.flatnonzero(free_contacts(snapshot) & (np.abs(off) <= thickness / 2))
    a = snapshot.grains["position"][snapshot.contacts["i"][contact]][:, [0, 2]]
    b = a - snapshot.branches()[contact][:, [0, 2]]
    side = np.where(b[:, 0] < 0, 0, np.where(b[:, 0] > lx, lx, np.nan))  # the one crossed
    over = np.isfinite(side)
    share = (side[over] - a[over, 0]) / (b[over, 0] - a[over, 0])
    cut = a[over] + share[:, None] * (b[over] - a[over])
    shift = np.column_stack([lx - 2 * side[over], np.zeros(over.sum())])
    segments = np.stack([a, b], axis=1)
    segments[over, 1] = cut
    segments = np.concatenate([segments, np.stack([cut + shift, b[over] + shift], axis=1)])
    contact = np.concatenate([contact, contact[over]])
    return Network(segments, snapshot.normal_forces()[contact], contact)


# How pressures and forces are distributed (Fig. 5, par. 31).

@dataclass
class Distribution:
    pressure: np.ndarray  # of each free grain over sigma_0
    force: np.ndarray     # |f_n| of each free contact over their mean
    mean_force: float     # N

    def density(self, values, bins=40, upper=None):
        """Centres of bins from 0 to upper (default: the largest value), and the probability density in them."""
        density, edges = np.histogram(values, bins=bins, range=(0, values.max() if upper is None else upper))
        width = edges[1] - edges[0]
        return (edges[1:] + edges[:-1]) / 2, density / (len(values) * width)


def distribution(snapshot, sigma_0):
    """Pressures of the free grains over sigma_0 (Pa), and normal forces of the free contacts over their mean.

    The pressure of a grain is the sum of |f_n| at its contacts, walls included, over its surface 4 pi r^2."""
    force = snapshot.normal_forces()[free_contacts(snapshot)]
    pressure = snapshot.grains["pressure"][snapshot.grains["role"] == 0]
    return Distribution(pressure / sigma_0, force / force.mean(), float(force.mean()))


def exponential_tail(values, above=1.5):
    """beta and its standard error in P(v) ~ exp(-beta v) for v > above: the most likely one, 1 / (mean of v - above)."""
    excess = values[values > above] - above
    if not len(excess):
        return np.nan, np.nan
    beta = 1 / excess.mean()
    return beta, beta / np.sqrt(len(excess))


def share_above(snapshot, sigma_0, factor=4):
    """Share of the free grains whose pressure is above factor sigma_0 (par. 31: force chains are often above 4)."""
    pressure = snapshot.grains["pressure"][snapshot.grains["role"] == 0]
    return float(np.mean(pressure > factor * sigma_0)) if len(pressure) else np.nan


# Directions (Fig. 7).

def axis(vectors):
    """Trend and plunge, degrees, of the axes along these vectors (... x 3, any length)."""
    v = np.asarray(vectors, float)
    v = np.where(v[..., 2:] > 0, -v, v) + 0.0  # lower hemisphere; -0 becomes 0
    trend = np.degrees(np.arctan2(v[..., 1], v[..., 0])) % 360
    return trend, np.degrees(np.arctan2(-v[..., 2], np.hypot(v[..., 0], v[..., 1])))


def vector(trend, plunge):
    """Unit vector into the lower hemisphere, ... x 3; the inverse of axis()."""
    t, p = np.radians(trend), np.radians(plunge)
    return np.stack([np.cos(t) * np.cos(p), np.sin(t) * np.cos(p), -np.sin(p)], axis=-1)


def normals(snapshot, which):
    """Unit normals, from j to i, of these contacts (mask or rows), n x 3."""
    n = snapshot.branches()[which]
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def trend_plunge(snapshot, strongest=0.5):
    """Trend and plunge, degrees, of the normals of that share of the free contacts that carries the largest |f_n| (Fig. 7)."""
    return axis(normals(snapshot, strongest_contacts(snapshot, strongest)))


def stereographic(trend, plunge):
    """Equal-angle (Wulff) projection of the lower hemisphere onto the unit disc, seen from above: +x to the right, +y up.

    r = tan((90 - plunge) / 2): the vertical is the centre, the horizontal the rim (the equator of Fig. 7)."""
    r, t = np.tan(np.radians(90 - np.asarray(plunge)) / 2), np.radians(trend)
    return r * np.cos(t), r * np.sin(t)


def unproject(x, y):
    """Trend and plunge, degrees, of points of the unit disc; the inverse of stereographic()."""
    return np.degrees(np.arctan2(y, x)) % 360, 90 - 2 * np.degrees(np.arctan(np.hypot(x, y)))


def axial_density(trend, plunge, at, concentration=40.0):
    """Density of axes around the axes `at` = (trend, plunge), degrees, in multiples of that of axes without preference.

    Each axis spreads as exp(concentration (cos^2 - 1)), by 9 degrees with the default."""
    n, seen = vector(trend, plunge), vector(*at)
    t = (np.arange(4000) + 0.5) / 4000
    isotropic = np.exp(concentration * (t**2 - 1)).mean()  # cosines of isotropic axes are uniform
    density = [np.exp(concentration * ((n @ s)**2 - 1)).mean() for s in seen.reshape(-1, 3)]
    return np.reshape(density, seen.shape[:-1]) / isotropic


# Tensors.

def fabric_tensor(snapshot, weights=None):
    """Mean of n n^T over the free contacts, trace 1; I / 3 where normals have no preference.

    weights: one number for each contact of the snapshot, such as snapshot.normal_forces()."""
    free = free_contacts(snapshot)
    n = normals(snapshot, free)
    w = np.ones(len(n)) if weights is None else np.asarray(weights)[free]
    return np.einsum("c,ca,cb->ab", w, n, n) / w.sum()


def bulk(snapshot):
    """Heights, m, between which all stress is carried by contacts between grains.

    From the highest centre of the lower layer to the lowest of the driven one; without layers, from the floor to the top wall
    less the largest radius at each, which leaves out what contacts with the walls carry."""
    z, role, r = snapshot.grains["position"][:, 2], snapshot.grains["role"], snapshot.grains["radius"].max()
    low = z[role == 1].max() if (role == 1).any() else r
    wall = snapshot.top_wall if np.isfinite(snapshot.top_wall) and snapshot.top_wall > 0 else np.inf
    high = z[role == 2].min() if (role == 2).any() else min(wall - r, z.max())
    return low, high


def stress_tensor(snapshot, z_range=None):
    """Mean stress by Love and Weber, 1/V sum of f (x) x_ij over all contacts, 3 x 3, Pa: rows are the force, columns the branch.

    f = f_n + f_t acts on i, x_ij points from j to i: compression is positive. A top layer dragged along +x makes the xz component
    negative (the upper grain is held back by the lower), about -tau. V is the box's area times the height of z_range (m; default:
    bulk()). A contact counts with the share of its branch that lies between these heights, so zz, xz and yz are exactly the mean
    of what the horizontal planes there carry: zz is sigma' and the weight above. Where grains gain spin it is not symmetric to the
    last digit; principal() takes the symmetric part."""
    low, high = bulk(snapshot) if z_range is None else z_range
    branch, c = snapshot.branches(), snapshot.contacts
    top = snapshot.grains["position"][c["i"], 2]
    ends = np.sort(np.column_stack([top, top - branch[:, 2]]), axis=1)
    length = ends[:, 1] - ends[:, 0]
    inside = np.clip(ends[:, 1], low, high) - np.clip(ends[:, 0], low, high)
    level = (ends[:, 0] >= low) & (ends[:, 0] <= high)  # of a horizontal branch all or nothing lies inside
    share = np.where(length > 0, inside / np.where(length > 0, length, 1), level)
    force = c["force_normal"] + c["force_tangential"]
    return np.einsum("c,ca,cb->ab", share, force, branch) / (snapshot.area * (high - low))


def principal(tensor):
    """Principal values of the symmetric part, largest first, and their directions as the columns of a matrix."""
    values, directions = np.linalg.eigh((tensor + tensor.T) / 2)
    return values[::-1], directions[:, ::-1]


def maximum_compressive_direction(tensor):
    """Trend and plunge, degrees, of the axis of the largest principal value of a stress or fabric tensor."""
    trend, plunge = axis(principal(tensor)[1][:, 0])
    return float(trend), float(plunge)


def applied_compressive_direction(tau, sigma):
    """Trend and plunge, degrees, of the paper's "maximum compressive stress (sigma' + tau)": the white plus of Fig. 7.

    It is the sum of what the top does to the bed, sigma' straight down and tau along +x: vertical in consolidation, then inclined by
    atan(tau / sigma') from the vertical, dipping towards +x, where the top layer moves: grains that it pushes carry force along
    +x and down. The principal direction of the stress tensor dips the same way, but less steeply: at 45 degrees where horizontal
    and vertical stress are equal."""
    trend, plunge = axis([tau, 0.0, -sigma])
    return float(trend), float(plunge)
