"""Tables and plot of the study: work-precision-{smooth,beds}.csv, .json, .md, .png."""
import csv
import datetime
import json
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from scipy.stats import t as student

from beds import Setting, paper, statistics
from machine import machine, version

names = list(statistics)


class Sample:
    """Mean of a statistic over seeds, with its 95 % confidence interval by the t distribution."""

    def __init__(self, values):
        self.n, self.mean = len(values), float(np.mean(values))
        self.scatter = float(np.std(values, ddof=1))
        self.variance = self.scatter**2 / self.n
        self.interval = float(student.ppf(0.975, self.n - 1)) * math.sqrt(self.variance)


def compare(a, b):
    """Welch's test of b against a."""
    error = math.sqrt(a.variance + b.variance)
    freedom = error**4 / (a.variance**2 / (a.n - 1) + b.variance**2 / (b.n - 1))
    p = float(2 * student.sf(abs(b.mean - a.mean) / error, freedom))
    verdict = "inside" if p > 0.05 else "unsure" if p > 0.05 / len(names) else "OUTSIDE"
    could_see = float(student.ppf(0.975, freedom) + student.ppf(0.8, freedom)) * error
    return dict(difference=b.mean - a.mean, in_seed_scatter=(b.mean - a.mean) / a.scatter, p=p, verdict=verdict,
                could_see=could_see, could_see_in_seed_scatter=could_see / a.scatter)


def settings_of(runs):
    """One entry for each setting, in the order of the runs."""
    found = {}
    for run in runs:
        found.setdefault(Setting(run["f"], run["soft"], run["faster"]), []).append(run)
    entries = []
    for s, own in found.items():
        good = [run for run in own if "failed" not in run]
        e = dict(setting=s, name=s.name, seeds=len(good), failed=[run["failed"] for run in own if "failed" in run])
        if len(good) >= 2:
            e["cpu_s_per_strain"] = float(np.median([run["cpu_s_per_strain"] for run in good]))
            e["residue_over_work"] = float(np.median([run["residue_over_work"] for run in good]))
            e["samples"] = {name: Sample([run[name] for run in good]) for name in names}
        entries.append(e)
    reference = next((e for e in entries if e["setting"] == paper and "samples" in e), None)
    for e in entries:
        if reference is None or "samples" not in e:
            continue
        e["gain"] = reference["cpu_s_per_strain"] / e["cpu_s_per_strain"]
        if e is not reference:
            e["tests"] = {name: compare(reference["samples"][name], e["samples"][name]) for name in names}
            e["largest"] = max(abs(test["in_seed_scatter"]) for test in e["tests"].values())
    return entries


def words(e):
    if "tests" not in e:
        return "the reference" if e["setting"] == paper else "too few runs"
    counts = {v: [n for n in names if e["tests"][n]["verdict"] == v] for v in ("unsure", "OUTSIDE")}
    text = "; ".join(f"{v}: {', '.join(list_)}" for v, list_ in counts.items() if list_) or "all inside"
    return text + (f"; {len(e['failed'])} runs failed" if e["failed"] else "")


def markdown(entries, about, done, wanted):
    runs = next((e for e in entries if e["setting"] == paper), None)
    lines = [f"<!-- {about['command']}, {about['date']}, {about['version']}, {about['machine'].get('Model name', '')} -->"]
    if done < wanted:
        lines.append(f"Not complete: {done} of {wanted} runs.\n")
    lines += ["| f | k_n | k_n/(sigma_0 d) | rate, 1/s | I | seeds | CPU s a unit of strain | times faster | "
              "largest difference, seed s.d. | test |", "|---|---|---|---|---|---|---|---|---|---|"]
    for e in sorted(entries, key=lambda e: -e.get("cpu_s_per_strain", 0)):
        s = e["setting"]
        head = f"| {s.f:g} | 1/{s.soft:g} | {s.stiffness:.2g} | {0.05 * s.faster:g} | {s.inertia:.1e} | {e['seeds']} | "
        if "samples" not in e:
            lines.append(head + f"| | | {e['failed'][0] if e['failed'] else 'too few runs'} |")
            continue
        lines.append(head + f"{e['cpu_s_per_strain']:.3g} | {e.get('gain', math.nan):.3g} | "
                     + (f"{e['largest']:.2f}" if "largest" in e else "") + f" | {words(e)} |")
    if runs and "samples" in runs:
        lines += ["", "| statistic of `paper` | mean, 95 % interval | s.d. of seeds | the test could see, s.d. | meaning |",
                  "|---|---|---|---|---|"]
        tested = [e for e in entries if "tests" in e]
        for name, (unit, meaning) in statistics.items():
            sample = runs["samples"][name]
            see = [e["tests"][name]["could_see_in_seed_scatter"] for e in tested]
            lines.append(f"| {name}{'' if unit == '1' else ', ' + unit} | {sample.mean:.4g} +- {sample.interval:.2g} | "
                         f"{sample.scatter:.2g} | {f'{min(see):.1f} to {max(see):.1f}' if see else ''} | {meaning} |")
    return "\n".join(lines) + "\n"


def label(axes, marks, taken, gap=7, fontsize=7):
    """Names the marks (x, y, name), each where no other mark, name or line is, as near as can be; those farther away have a
    line to their mark. taken: artists that need their place, too."""
    figure = axes.figure
    renderer, points = figure.canvas.get_renderer(), figure.dpi / 72  # pixels to a point
    places = axes.transData.transform([mark[:2] for mark in marks]) if marks else []
    boxes = [artist.get_window_extent(renderer) for artist in taken]
    boxes += [Bbox.from_bounds(*(place - 5 * points), 10 * points, 10 * points) for place in places]
    for line in axes.lines:  # in small pieces
        corners = line.get_transform().transform(line.get_xydata())
        for a, b in zip(corners, corners[1:]):
            pieces = np.linspace(a, b, max(2, int(np.hypot(*(b - a)) / points)))
            boxes += [Bbox.from_bounds(*piece, 1, 1) for piece in pieces]
    angles = np.radians([15, -15, 165, 195, 60, 120, -60, -120, 90, -90])
    for k in sorted(range(len(marks)), key=lambda k: -places[k][0]):  # from the right, where room is least
        for distance in np.arange(gap, 100, 3):
            for angle in angles:
                shift = distance * np.array([np.cos(angle), np.sin(angle)])
                text = axes.annotate(marks[k][2], marks[k][:2], xytext=shift, textcoords="offset points", fontsize=fontsize, va="center",
                                     ha="center" if abs(shift[0]) < 3 else "left" if shift[0] > 0 else "right",
                                     arrowprops={"arrowstyle": "-", "lw": 0.5, "color": "0.5", "shrinkA": 1, "shrinkB": 4} if distance > 12 else None)
                text.update_positions(renderer)
                box = Text.get_window_extent(text, renderer).padded(1.5 * points)
                if axes.bbox.contains(box.x0, box.y0) and axes.bbox.contains(box.x1, box.y1) and not box.count_overlaps(boxes):
                    break
                text.remove()
            else:
                continue
            boxes.append(box)
            break
        else:
            raise RuntimeError(f"no room for the label {marks[k][2]}")


def plot(path, smooth, entries, about):
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained")
    styles = dict(zip(dict.fromkeys(row["scene"] for row in smooth), ("o-", "s--", "^-.", "D:")))
    for scene, style in styles.items():
        own = [r for r in smooth if r["scene"] == scene and r["softening"] == 1 and "error" in r]
        left.loglog([r["f"] for r in own], [r["error"] for r in own], style, color="0.15", mfc="white", label=scene)
    left.axvline(0.075, color="0.6", lw=0.8)
    left.set(xlabel="f = dt / sqrt(min m / k), 1   (run time goes as 1/f)", ylabel="error over what happened, 1",
             title="Smooth scenes, against f = 0.075/64")
    left.text(0.078, 0.93, "paper", color="0.4", transform=left.get_xaxis_transform())
    stopped = {r["f"] for r in smooth if "failed" in r}
    left.plot(sorted(stopped), [0.97] * len(stopped), "x", color="0.15", transform=left.get_xaxis_transform(),
              label="some scene was stopped as unstable")
    left.legend(fontsize="small")

    tested = [e for e in entries if "tests" in e]
    marks = []
    for e in tested:
        seen = any(test["verdict"] == "OUTSIDE" for test in e["tests"].values())
        x, y = e["cpu_s_per_strain"], e["largest"]
        right.plot(x, y, "x" if seen else "o", color="0.15", mfc="white", ms=7)
        s = e["setting"]
        parts = [f"f {s.f:g}"] + ([f"k/{s.soft:g}"] if s.soft != 1 else []) + ([f"rate x{s.faster:g}"] if s.faster != 1 else [])
        marks.append((x, y, ", ".join(parts)))
    front, least = [], math.inf
    for e in sorted(tested, key=lambda e: e["cpu_s_per_strain"]):
        if e["largest"] < least:
            least = e["largest"]
            front.append((e["cpu_s_per_strain"], least))
    if front:
        corners = [point for a, b in zip(front, front[1:]) for point in (a, (b[0], a[1]))] + front[-1:]
        right.plot(*zip(*corners), color="0.5", lw=1, label="Pareto front")
        see = np.median([test["could_see_in_seed_scatter"] for e in tested for test in e["tests"].values()])
        right.axhline(see, color="0.5", ls=":", label="a single statistic's difference that the test\nfinds in 80 % of cases (median)")
        reference = next(e for e in entries if e["setting"] == paper)["cpu_s_per_strain"]
        right.axvline(reference, color="0.6", lw=0.8)
        right.text(reference, 0.03, "paper ", color="0.4", ha="right", transform=right.get_xaxis_transform())
        right.plot([], [], "o", color="0.15", mfc="white", label="no statistic OUTSIDE")
        right.plot([], [], "x", color="0.15", label="some statistic OUTSIDE")
        right.set(xscale="log", yscale="log", xlabel="processor time for a unit of shear strain, s",
                  ylabel="largest difference from paper, s.d. of seeds", title="Sheared beds, statistics over seeds")
        right.set_ylim(top=8 * right.get_ylim()[1])  # room for the legend
        right.legend(fontsize="x-small", loc="upper right")
        right.set_xlim(right.get_xlim()[0], 2.5 * right.get_xlim()[1])  # and for labels on the right
    figure.suptitle(f"{about['machine'].get('Model name', '')}, {about['date']}, {about['version']}", fontsize=8, color="0.4")
    figure.set_dpi(130)
    figure.canvas.draw()  # the layout is fixed before labels look for room
    figure.set_layout_engine("none")
    label(right, marks, [right.get_legend()] + right.texts if front else [])
    figure.savefig(path, dpi=130)
    plt.close(figure)


def write_csv(path, rows):
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, columns)
        table.writeheader()
        table.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


def write(out, command, smooth, runs, wanted):
    head = dict(what="Run time against error: smooth scenes, and statistics of sheared beds.", date=datetime.date.today().isoformat(),
                machine=machine(), version=version(), command=command)
    entries = settings_of(runs)
    versions = sorted({run["program"] for run in runs})
    if len(versions) > 1:
        print(f"the runs come from {len(versions)} builds of the program ({', '.join(versions)}): times may not be comparable")
    write_csv(out / "work-precision-smooth.csv", smooth)
    write_csv(out / "work-precision-beds.csv", runs)
    text = markdown(entries, head, len(runs), wanted)
    (out / "work-precision.md").write_text(text)
    plain = [{k: {n: vars(v) if isinstance(v, Sample) else v for n, v in x.items()} if isinstance(x, dict) else x
              for k, x in e.items() if k != "setting"}
             | dict(e["setting"]._asdict(), stiffness_number=e["setting"].stiffness, inertia_number=e["setting"].inertia)
             for e in entries]
    (out / "work-precision.json").write_text(json.dumps(
        {**head, "runs": len(runs), "runs_wanted": wanted, "builds": versions, "settings": plain}, indent=1) + "\n")
    plot(out / "work-precision.png", smooth, entries, head)
    print(text)


def read_csv(path):
    def value(text):
        try:
            return float(text)
        except ValueError:
            return text
    with open(path, newline="") as file:
        return [{k: value(v) for k, v in row.items() if v != ""} for row in csv.DictReader(file)]


def redraw(out, stem):
    """The plot alone, of the numbers that lie in `out`."""
    about = json.loads((out / f"{stem}.json").read_text())
    plot(out / f"{stem}.png", read_csv(out / f"{stem}-smooth.csv"), settings_of(read_csv(out / f"{stem}-beds.csv")), about)
