"""Draws results/figures/janssen.png from a sweep of this case over grains.count: python3 cases/silo/draw.py [SWEEP]"""
from pathlib import Path
import sys

import h5py
import numpy as np

here = Path(__file__).parent
sys.path.insert(0, str(here.parents[1] / "python"))
from moraine import style  # noqa: E402
from moraine.style import plt  # noqa: E402

width, mu, gravity, density, water = 0.1, 0.2, 9.80665, 2600, 1000  # of case.toml


def measure(run):
    """The end of a run: floor stress and submerged weight over the section (Pa), bulk density (kg/m3) in water, K, friction mobilised."""
    with h5py.File(run / "output/series.h5") as f:
        floor = f["normal_stress"][-1]
    with h5py.File(sorted((run / "output/snapshots").glob("*.h5"))[-1]) as f:
        x, r, force = f["grains/position"][:], f["grains/radius"][:], f["grains/force"][:]
        i, j, between = f["contacts/i"][:], f["contacts/j"][:], f["contacts/force"][:]
    by_walls = force.copy()  # what is no neighbour's push is a wall's
    np.subtract.at(by_walls, i, between)
    np.add.at(by_walls, j, between)
    touching = np.minimum(x, width - x)[:, :2] < r[:, None]
    normal = np.abs(by_walls[:, :2])[touching].sum()
    friction = by_walls[:, 2].sum() - floor * width**2
    mass = density * 4 / 3 * np.pi * r**3
    weight = (mass * (1 - water / density)).sum() * gravity
    top = x[:, 2].max()
    within = (x[:, 2] > 0.1 * top) & (x[:, 2] <= 0.9 * top)
    bulk = mass[within].sum() * (1 - water / density) / (width**2 * 0.8 * top)
    # Vertical force that contacts carry, in slices of a fifth of a diameter; nothing here knows the force on the floor.
    slices = np.arange(0.002, top, 0.004)
    upper, lower = np.maximum(x[i, 2], x[j, 2]), np.minimum(x[i, 2], x[j, 2])
    up = np.where(x[i, 2] > x[j, 2], between[:, 2], -between[:, 2])
    carried = np.array([up[(upper > z) & (lower <= z)].sum() for z in slices])
    vertical = carried.sum() * 0.004 / width**2
    return {"floor": floor, "weight": weight / width**2, "bulk": bulk, "K": normal / (4 * width) / vertical,
            "mobilised": friction / (mu * normal)}


def janssen(weight, bulk, K, mobilised=1):
    limit = bulk * gravity * width / (4 * mu * mobilised * K)
    return limit * (1 - np.exp(-weight / limit))


def main(sweep):
    runs = sorted((p for p in sweep.iterdir() if (p / "output/series.h5").exists()), key=lambda p: int(p.name.split("-")[1].split("+")[0]))
    ends = [measure(run) for run in runs]
    print("| grains | height of fill, widths | weight/section (Pa) | floor (Pa) | Janssen (Pa) | with the friction mobilised (Pa) | K | friction mobilised |\n|---|---|---|---|---|---|---|---|")
    for run, e in zip(runs, ends):
        print(f"| {run.name.replace('count-', '')} | {e['weight'] / (e['bulk'] * gravity * width):.2f} | {e['weight']:.0f} | {e['floor']:.0f} | "
              f"{janssen(e['weight'], e['bulk'], e['K']):.0f} | {janssen(e['weight'], e['bulk'], e['K'], e['mobilised']):.0f} | {e['K']:.2f} | {e['mobilised']:.2f} |")
    bulk, K, mobilised = (ends[-1][name] for name in ("bulk", "K", "mobilised"))

    figure, (left, right) = plt.subplots(1, 2, figsize=(style.page, 2.6), layout="constrained")
    high = np.array([e["weight"] / (e["bulk"] * gravity * width) for e in ends])
    z = np.linspace(0, 1.05 * high.max(), 200)
    left.plot(z, bulk * gravity * width * z / 1e3, color="0.6", linestyle="--", label="weight in water")
    left.plot(z, janssen(bulk * gravity * width * z, bulk, K) / 1e3, color=style.ink, label=f"Janssen, K = {K:.2f} as measured")
    left.plot(z, janssen(bulk * gravity * width * z, bulk, K, mobilised) / 1e3, color=style.ink, linestyle=":",
              label=f"with {100 * mobilised:.0f} % of the friction, as mobilised")
    left.plot(high, [e["floor"] / 1e3 for e in ends], "o", color="C0", clip_on=False, label="floor")
    left.set(xlabel="height of fill (widths)", ylabel="stress (kPa)", xlim=(0, None), ylim=(0, None))
    left.legend()
    style.panel(left, "a")
    for run, line in zip(runs, style.lines(len(runs))):
        with h5py.File(run / "output/series.h5") as f:
            t, stress = f["time"][:], f["normal_stress"][:]
        later = t > 0.7
        right.plot(t[later], stress[later] / 1e3, color=line["color"], linestyle=line["linestyle"], label=run.name.replace("count-", "") + " grains")
    right.axvline(1.1, color="0.8", linewidth=0.6, zorder=0)  # the flow begins to fall
    right.set(xlabel="time (s)", ylabel="stress on the floor (kPa)", ylim=(0, 2.5))
    right.legend()
    style.panel(right, "b")
    print(*style.save(figure, here / "results/figures/janssen", ("png",), dpi=200))


main(Path(sys.argv[1]) if len(sys.argv) > 1 else here / "sweep")
