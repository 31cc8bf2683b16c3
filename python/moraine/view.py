"""One page with the bed in 3D, from the snapshots of a case: ./moraine view CASE.

The page holds all it needs: three.js from where it is installed, and of each snapshot the grains, contacts and water, as whole
numbers of 16 bits over the range of each quantity, packed with gzip and base64. view_page/view.js unpacks and draws them.
"""
import argparse
import base64
import gzip
import importlib.util
import json
import os
from pathlib import Path
import re

import numpy as np

from . import frames, results
from .movie import counted
from .results import MissingData, Snapshot
from .style import plt, sequential

page = Path(__file__).parent / "view_page"
weakest = 0.2  # contacts below this share of the mean normal force are left out

fields = {  # of a grain: label, unit shown, how many of it make one of SI, whether it has a sign, and its values in SI
    "pressure": ("pressure", "kPa", 1e-3, False, lambda s: s.grains["pressure"]),
    "speed": ("speed", "mm/s", 1e3, False, lambda s: np.linalg.norm(s.grains["velocity"], axis=1)),
    "displacement": ("displacement along x", "mm", 1e3, True, lambda s: s.grains["displacement"][:, 0]),
    "rise": ("displacement along z", "mm", 1e3, True, lambda s: s.grains["displacement"][:, 2]),
    "spin": ("spin about y", "rad/s", 1, True, lambda s: s.grains["spin"][:, 1]),
    "rotation": ("rotation about y", "rad", 1, True, lambda s: s.grains["rotation"][:, 1]),
    "coordination": ("contacts of the grain", "", 1, False, lambda s: np.bincount(
        np.concatenate([s.contacts["i"], s.contacts["j"]]), minlength=len(s.grains))),
    "radius": ("radius", "mm", 1e3, False, lambda s: s.grains["radius"]),
    "role": ("0 free, 1 lower layer, 2 driven layer", "", 1, False, lambda s: s.grains["role"]),
}

curves = {  # columns of the series: label
    "shear_friction": "shear friction", "total_friction": "shear friction, with water", "dilation_diameters": "dilation (diameters)",
    "water_pressure_mean": "mean water pressure (kPa)", "porosity": "porosity", "coordination": "contacts per grain",
    "unbalanced_force": "unbalanced force", "kinetic": "kinetic energy (J)", "shear_strain": "shear strain",
}
most_rows = 2000  # of a curve


def library():
    """Text of three.js with its OrbitControls, from Debian's libjs-three or from the PyPI package jupyter-threejs-sage."""
    debian = Path("/usr/share/javascript/three")
    sets = [[debian / "three.min.js", debian / "examples/js/controls/OrbitControls.js"]]
    found = importlib.util.find_spec("jupyter_threejs_sage")
    if found and found.origin:
        sets.insert(0, sorted((Path(found.origin).parent / "static").glob("r*/three.min.js"))[-1:])
    for files in sets:
        if files and all(f.is_file() for f in files):
            return "\n".join(f.read_text(encoding="utf-8") for f in files)
    raise MissingData("there is no three.js, which the page is drawn with; install it (Debian: apt-get install libjs-three; "
                      "with pip: pip install jupyter-threejs-sage)")


class Packed:
    """Columns as whole numbers: `columns` says of each its name, length, bytes of a number, least value, and step."""

    def __init__(self):
        self.columns, self.parts = [], []

    def add(self, name, values, step=None):
        """step: of values that are whole multiples of it; else 16 bits over their range. Values that are not finite are refused."""
        values = np.asarray(values, float).ravel()
        if not np.isfinite(values).all():
            raise MissingData(f"{name}: has values that are not finite")
        low = float(values.min()) if len(values) and step is None else 0.0
        width = 2
        if step is None:
            step = float(values.max() - low) / 65535 if len(values) else 0.0
        elif len(values) and values.max() / step > 65535:
            width = 4
        whole = np.round((values - low) / (step or 1)).astype(f"<u{width}")
        self.columns.append([name, len(values), width, low, step])
        self.parts.append(whole.view(np.uint8).reshape(-1, width).T.tobytes())  # all low bytes first: gzip finds more in them

    def text(self):
        return base64.b64encode(gzip.compress(b"".join(self.parts), 6, mtime=0)).decode()


def unpacked(columns, text):
    """{name: values} of what Packed has made; view.js does the same."""
    data, at, found = gzip.decompress(base64.b64decode(text)), 0, {}
    for name, length, width, low, step in columns:
        part = np.frombuffer(data, np.uint8, length * width, at).reshape(width, length)
        found[name] = low + step * sum(plane * 256.0**k for k, plane in enumerate(part))
        at += length * width
    return found


def pack(snapshot):
    """What the page shows of a snapshot: Packed, and a dictionary of what else is said of it."""
    packed, g, c = Packed(), snapshot.grains, snapshot.contacts
    top = float((g["position"][:, 2] + g["radius"]).max())
    about = {"top": snapshot.top_wall if top < snapshot.top_wall < 1.5 * top else top}  # of the box that is drawn
    for axis in range(3):
        packed.add("xyz"[axis], g["position"][:, axis])
    for name, (*_, values) in fields.items():
        packed.add(name, values(snapshot), 1 if name in ("coordination", "role") else None)
    force = snapshot.normal_forces()
    kept = np.flatnonzero(force >= weakest * force.mean()) if len(force) else np.zeros(0, int)
    packed.add("i", c["i"][kept], 1)
    packed.add("j", c["j"][kept], 1)
    packed.add("force", force[kept])
    about["mean_force"], about["contacts"] = float(force.mean()) if len(force) else 0.0, len(force)
    try:
        cells, size = snapshot.water_grid
        packed.add("water", snapshot.water["pressure"])
        about["cells"], about["size"] = cells, [float(s) for s in size]
    except MissingData:
        pass
    return packed, about | {"columns": packed.columns}


class Range:
    """Of the colours of a field, round, from what all snapshots have."""

    def __init__(self, factor, signed):
        self.factor, self.signed, self.parts = factor, signed, []

    def add(self, values):
        self.parts.append(np.percentile(np.abs(values) if self.signed else values, [0, 97]) if len(values) else (0, 0))

    def ends(self):
        low, high = min(p[0] for p in self.parts) * self.factor, max(p[1] for p in self.parts) * self.factor
        high = frames.round_up(high)
        return (-high, high) if self.signed else (0.0, high)


def drawn_curves(stage):
    """Time, strain and columns of the stage's series, every so many rows."""
    rows = stage.series
    every = -(-len(rows) // most_rows)
    which = sorted({*range(0, len(rows), every), len(rows) - 1})
    def numbers(name, factor=1):
        return [float(f"{v:.7g}") if np.isfinite(v) else None for v in factor * rows[name][which]]
    x = {"time (s)": numbers("stage_time")} | ({"shear strain": numbers("shear_strain")} if stage.sheared else {})
    shown = {label: numbers(name, 1e-3 if "kPa" in label else 1) for name, label in curves.items()
             if name in rows and np.ptp(np.nan_to_num(rows[name])) > 0 and not (name == "total_friction" and not stage.wet)}
    return {"x": x, "curves": shown, "every": every}


def collect(case, stage_name=None, every=None, most=50.0):
    """Of a case (moraine.open): what the page says of it, and the text of each snapshot. most: MB of the snapshots together."""
    stage, files = frames.snapshots(case, stage_name)
    first = Snapshot(files[0])
    if every is None:
        size = len(pack(Snapshot(files[-1]))[0].text()) / 1e6
        every = max(1, int(np.ceil(len(files) * size / most)))
    number = len(files)
    chosen = sorted({*range(0, number, every), number - 1})
    files = [files[k] for k in chosen]
    time, strain = frames.times(stage, files)
    texts, about = [], []
    ranges = {name: Range(factor, signed) for name, (_, _, factor, signed, _) in fields.items()}
    water = Range(1e-3, True)
    for k, snapshot in counted(enumerate(map(Snapshot, files)), len(files), "view"):
        if len(snapshot.grains) != len(first.grains):
            raise MissingData(f"{snapshot.file}: has {len(snapshot.grains)} grains where {first.file} has {len(first.grains)}")
        packed, said = pack(snapshot)
        free = snapshot.grains["role"] == 0
        for name, (*_, values) in fields.items():
            ranges[name].add(values(snapshot)[free])
        if "cells" in said:
            water.add(snapshot.water["pressure"])
        texts.append(packed.text())
        about.append(said | {"time": float(time[k]), "strain": None if strain is None else float(strain[k])})
    ranges = {name: r.ends() for name, r in ranges.items()} | {"role": (0, 2)}
    radius = first.grains["radius"]
    ranges["radius"] = [1e3 * float(radius.min()), 1e3 * float(radius.max() if np.ptp(radius) else 1.01 * radius.max())]
    wet = any("cells" in s for s in about)
    left_out = [f"{number - len(files)} of {number} snapshots"] if len(files) < number else []
    left_out += [f"contacts below {weakest:g} of the mean normal force"]
    head = {
        "title": frames.title(case), "stage": stage.name, "box": [float(b) for b in first.box[:2]], "count": len(first.grains),
        "fields": {name: {"label": label, "unit": unit, "factor": factor, "signed": signed, "range": ranges[name]}
                   for name, (label, unit, factor, signed, _) in fields.items()},
        "water": {"label": "water pressure over hydrostatic", "unit": "kPa", "factor": 1e-3, "signed": True, "range": water.ends()} if wet else None,
        "colours": {name: [[round(255 * v) for v in colour[:3]] for colour in colour_map(np.linspace(0, 1, 64))]
                    for name, colour_map in (("plain", sequential), ("signed", plt.get_cmap("RdBu_r")))},
        "series": drawn_curves(stage), "snapshots": about, "left_out": "; ".join(left_out),
    }
    return head, texts


def script(text):
    """Fit to stand between <script> and </script>."""
    return text.replace("</", "<\\/")


def html(head, texts):
    parts = {
        "title": head["title"].replace("&", "&amp;").replace("<", "&lt;"), "style": (page / "view.css").read_text(),
        "library": library(), "data": script(json.dumps(head, separators=(",", ":"), allow_nan=False)),
        "snapshots": "\n".join(f'<script type="text/plain" class="snapshot">{t}</script>' for t in texts),
        "program": (page / "view.js").read_text(),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda name: parts[name[1]], (page / "view.html").read_text())


def make(case, path, stage=None, every=None, most=50.0):
    """Writes the page to path, aside and then renamed. Returns what the page says of the case."""
    frames.free_for(path, b'content="moraine view"', "page that moraine view has written")
    library()  # before the work
    head, texts = collect(case, stage, every, most)
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        aside.write_text(html(head, texts), encoding="utf-8")
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
    return head


def arguments(parser):
    def number(text):
        if int(text) < 1:
            raise argparse.ArgumentTypeError(f"{text}: expected 1 or more")
        return int(text)

    def megabytes(text):
        if not 0.01 <= float(text) <= 2000:
            raise argparse.ArgumentTypeError(f"{text}: expected 0.01 to 2000 MB")
        return float(text)

    parser.add_argument("case", metavar="CASE", help="directory of the case")
    parser.add_argument("--stage", metavar="NAME", help="the stage to show (default: the last that shears)")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--every", type=number, metavar="N", help="show every Nth snapshot only, and the last")
    size.add_argument("--most", type=megabytes, default=50, metavar="MB", help="leave out snapshots so that they are about this at most (default: %(default)s)")
    parser.add_argument("--output", metavar="FILE", help="the page (default: CASE/figures/view.html)")


def run(args):
    case = results.open(args.case)
    path = Path(args.output or case.directory / "figures/view.html")
    path.parent.mkdir(parents=True, exist_ok=True)
    head = make(case, path, args.stage, args.every, args.most)
    number = len(head["snapshots"])
    print(f"{path}: {number} snapshot{'s' * (number != 1)} of {head['count']} grains, {path.stat().st_size / 1e6:.2g} MB; "
          f"left out: {head['left_out']}")
