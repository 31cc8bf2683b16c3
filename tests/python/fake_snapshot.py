"""Snapshots with known grains and contacts, in the layout of src/output/snapshot.cpp."""
from pathlib import Path

import h5py
import numpy as np

from moraine import Snapshot

units = {
    "grains": {"id": "1", "role": "1", "radius": "m", "position": "m", "displacement": "m", "velocity": "m/s", "spin": "rad/s",
               "rotation": "rad", "force": "N", "pressure": "Pa"},
    "contacts": {"id": "1", "i": "1", "j": "1", "point": "m", "force_normal": "N", "force_tangential": "N", "force": "N",
                 "overlap": "m"},
}


def write(directory, position, radius=0.5, pairs=(), normal=1.0, tangential=0.0, box=(10, 10, 0), top_wall=np.inf, leave_out=(),
          stem="01-shear-000000", time=0.0, **grains):
    """A snapshot of grains at `position`, of which `pairs` (i, j) touch: |f_n| = normal along the branch, f_t = tangential, on i.

    grains: role, velocity, spin, pressure, ...; zero where not given. leave_out: names such as "grains/spin"."""
    x = np.array(position, float)
    n, box = len(x), np.array(box, float)
    r = np.broadcast_to(np.asarray(radius, float), n)
    columns = {name: np.zeros((n, 3)) for name in ("displacement", "velocity", "spin", "rotation", "force")}
    columns |= {"pressure": np.zeros(n), "role": np.zeros(n, np.uint8)}
    for name, value in grains.items():
        columns[name] = np.broadcast_to(np.asarray(value, columns[name].dtype), columns[name].shape)
    columns |= {"id": np.arange(n, dtype=np.int32), "radius": r}
    columns["position"] = np.column_stack([x[:, :2] % box[:2], x[:, 2]])

    i, j = np.array(pairs, np.int32).reshape(-1, 2).T
    branch = x[i] - x[j]
    branch[:, :2] -= box[:2] * np.round(branch[:, :2] / box[:2])
    distance = np.linalg.norm(branch, axis=1, keepdims=True)
    direction = branch / distance
    overlap = r[i] + r[j] - distance[:, 0]
    point = x[i] - (r[i] - overlap / 2)[:, None] * direction
    f_n = np.broadcast_to(np.asarray(normal, float), len(i))[:, None] * direction
    f_t = np.broadcast_to(np.asarray(tangential, float), (len(i), 3))
    contacts = {"id": np.arange(len(i), dtype=np.int32), "i": i, "j": j,
                "point": np.column_stack([point[:, :2] % box[:2], point[:, 2]]), "force_normal": f_n,
                "force_tangential": f_t, "force": f_n + f_t, "overlap": overlap}

    file = Path(directory) / f"{stem}.h5"
    with h5py.File(file, "w") as h5:
        h5.attrs.update({"program": "moraine", "name": file.stem, "time": time, "step": 0, "stage_time": time, "box": box,
                         "top_wall": float(top_wall)})
        for group, data in (("grains", columns), ("contacts", contacts)):
            for name in units[group]:
                if f"{group}/{name}" not in leave_out:
                    h5[f"{group}/{name}"] = data[name]
                    h5[f"{group}/{name}"].attrs["units"] = units[group][name]
    return Snapshot(file)
