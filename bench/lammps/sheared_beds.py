"""Both programs on the beds of bench/sheared.py, in rounds whose order is drawn anew: rows of times, and what they must be."""
import datetime
import json
import os
import random
import shutil
import statistics
import subprocess
import sys

from machine import busy_cores, machine, root, version
from packing import pack, warm_up
from sheared import Beds, copies_for, gamma_n, grains_of_bed, last_snapshot, normal_stress

lammps_sheared_bed = root.parent / "shared/peers/lammps-sheared-bed"
parts = ("undamped", "damped", "packing", "size")
# How many times faster than gran/hooke/history of `lmp` with 10,000 grains: the least, and the goal. (part, cores)
wanted = {("undamped", 1): (6, 8), ("undamped", 2): (5.5, 7), ("damped", 1): (5, 7), ("packing", 1): (4, 6)}
most_searching = 0.08  # of the time in the packing bed
most_by_size = 1.2     # time a grain with 640,000 over that with 10,000
largest = 640_000
skins = (0.1e-3, 0.2e-3, 0.5e-3, 1e-3, 2e-3)  # m, LAMMPS gets the best of them


def middle(values):
    return dict(median=statistics.median(values), least=min(values), most=max(values))


def lammps_name(program):
    lines = said([program, "-h"]).split("\n")
    return next((line.split(" - ", 1)[1].strip() for line in lines if " - " in line), "unknown")


class Contest:
    """One scene with so many grains on so many cores; each contestant is called by name and says what it measured."""

    def __init__(self, beds, scene, grains, cores, steps, programs):
        self.beds, self.scene, self.grains, self.cores, self.steps = beds, scene, grains, cores, steps
        self.case = beds.case(scene, grains)
        self.contestants = {"Moraine": self.moraine}
        for which, program in programs.items():
            for style in ("gran/hooke/history", "granular") if which == "newer" else ("gran/hooke/history",):
                if which == "installed" or cores == 1:  # the newer one may have another MPI than mpirun
                    self.contestants["LAMMPS" if which == "installed" else f"newer LAMMPS {style}"] = (program, style)

    def moraine(self):
        out = said([self.beds.program, "bench", self.case, "--steps", self.steps, "--threads", self.cores, "--backend", "cpu"])
        return json.loads(out)

    def lammps(self, program, style, skin):
        copies, dt = copies_for(self.grains), self.beds.dt()
        settings = self.beds.settings(copies)
        if self.scene == "packing":
            wall = self.beds.wall_path(self.steps + warm_up)
            return pack(self.beds.resting(copies) / "start.h5", settings, gamma_n[self.scene], dt, wall, self.steps, self.cores, skin,
                        style, program)
        box, contact = settings["box"], settings["contact"]
        return json.loads(said(
            [sys.executable, lammps_sheared_bed, last_snapshot(self.beds.sheared(copies)), "--box", f"{box['x']!r},{box['y']!r}", "--k",
             repr(contact["k_n"]), "--mu", contact["mu_d"], "--dt", repr(dt), "--gamma", gamma_n[self.scene], "--stress", normal_stress,
             "--steps", self.steps, "--ranks", self.cores, "--style", style, "--skin", skin, "--density",
             settings["grains"]["density"], "--lmp", program]))

    def best_skins(self, tries):
        """By contestant: the skin that was fastest, and the least ms of each skin."""
        names = [name for name in self.contestants if name != "Moraine"]
        tried = {name: {skin: [] for skin in tries} for name in names}
        for _ in range(2 if len(tries) > 1 else 0):
            for name, skin in random.sample([(n, s) for n in names for s in tries], len(names) * len(tries)):
                tried[name][skin].append(self.lammps(*self.contestants[name], skin)["ms_per_step"])
        if len(tries) == 1:
            return dict.fromkeys(names, tries[0]), {}
        least = {name: {skin: min(ms) for skin, ms in of.items()} for name, of in tried.items()}
        return {name: min(of, key=of.get) for name, of in least.items()}, least

    def rounds(self, number, best):
        runs = {name: [] for name in self.contestants}
        for _ in range(number):
            for name in random.sample(list(runs), len(runs)):
                runs[name].append(self.moraine() if name == "Moraine" else self.lammps(*self.contestants[name], best[name]))
        return runs


def said(words):
    run = subprocess.run([str(w) for w in words], capture_output=True, text=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    if run.returncode:
        sys.exit(f"{' '.join(map(str, words))}\nfailed:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
    return run.stdout


def against_lammps(beds, scene, grains, cores, programs, a, found):
    """A row. `found` keeps the skins found for the scene with the fewest grains."""
    few = grains == grains_of_bed or scene == "packing"  # the first steps of packing are these, however many grains
    steps = a.steps if few else max(100, a.steps // 4)
    contest = Contest(beds, scene, grains, cores, steps, programs)
    if scene not in found:
        found[scene] = Contest(beds, scene, grains_of_bed, 1, a.steps, programs).best_skins([a.skin] if a.skin else skins)
    best, tried = found[scene]
    runs = contest.rounds(a.rounds, best)
    ms = {name: [run["ms_per_step"] for run in of] for name, of in runs.items()}
    ratios = {name: middle([b / m for b, m in zip(ms[name], ms["Moraine"])]) for name in ms if name != "Moraine"}
    last = {name: of[-1] for name, of in runs.items()}
    searching = [run["search_share"] for run in runs["Moraine"] if "search_share" in run]
    row = dict(part=scene, grains=grains, cores=cores, steps=steps, ms_per_step=ms,
               median_ms_per_step={n: middle(v) for n, v in ms.items()}, ratio=ratios, skin_m={name: best[name] for name in ratios}, skins_tried_least_ms=tried,
               lammps_list_builds={name: last[name]["list_builds"] for name in ratios},
               contacts=last["Moraine"]["contacts"], pairs=last["Moraine"]["pairs"], near_pairs=last["Moraine"]["near_pairs"],
               search_share=statistics.median(searching) if searching else None, checks=[])
    if grains == grains_of_bed and (scene, cores) in wanted:
        least, goal = wanted[scene, cores]
        row["checks"].append(dict(what=f"at least {least} times as fast as LAMMPS (goal {goal})", found=ratios["LAMMPS"]["median"],
                                  passed=ratios["LAMMPS"]["median"] >= least))
    if grains == grains_of_bed and scene == "packing" and cores == 1 and searching:
        row["checks"].append(dict(what=f"searching at most {most_searching:.0%} of the time", found=row["search_share"],
                                  passed=row["search_share"] <= most_searching))
    return row


def by_size(beds, cores, a):
    """A row: the time a grain and step takes in the largest bed and in the smallest, Moraine alone."""
    small = Contest(beds, "undamped", grains_of_bed, cores, a.steps, {})
    large = Contest(beds, "undamped", largest, cores, max(50, a.steps // 15), {})
    ns = {small.grains: [], large.grains: []}
    for _ in range(a.rounds):
        for contest in random.sample([small, large], 2):
            ns[contest.grains].append(1e6 * contest.moraine()["ms_per_step"] / contest.grains)
    ratio = middle([b / s for b, s in zip(ns[large.grains], ns[small.grains])])
    row = dict(part="size", grains=largest, cores=cores, steps=large.steps, ns_per_grain_and_step=ns,
               median_ns={n: middle(v) for n, v in ns.items()}, ratio={"10,000 grains": ratio}, checks=[])
    if cores == 1:
        row["checks"].append(dict(what=f"at most {most_by_size} times the time a grain of 10,000", found=ratio["median"],
                                  passed=ratio["median"] <= most_by_size))
    return row


def spread(m, digits):
    return f"{m['median']:.{digits}f} ({m['least']:.{digits}f} - {m['most']:.{digits}f})"


def line(row):
    if row["part"] == "size":
        of = {int(n): m for n, m in row["median_ns"].items()}
        return (f"size, {row['cores']} core(s): {spread(of[largest], 1)} ns a grain and step with {largest} grains, "
                f"{spread(of[grains_of_bed], 1)} with {grains_of_bed}; ratio {spread(row['ratio']['10,000 grains'], 2)}")
    ms = row["median_ms_per_step"]
    text = f"{row['part']}, {row['grains']} grains, {row['cores']} core(s): Moraine {spread(ms['Moraine'], 3)} ms"
    for name, ratio in row["ratio"].items():
        text += f"; {name} {spread(ms[name], 3)}, ratio {spread(ratio, 2)}, skin {1e3 * row['skin_m'][name]:g} mm"
    return text + (f"; searching {row['search_share']:.1%}" if row["search_share"] is not None else "")


def markdown(result):
    rows = result["rows"]
    out = ["# Moraine against LAMMPS on beds that shear and pack", "", f"Written by `bench/compare-lammps sheared`; {result['what']}",
           "", "Medians (least - most); the ratio is the median of those within a round. LAMMPS has `gran/hooke/history` and the best of "
           "the skins tried.", "",
           "| scene | grains | cores | Moraine, ms | LAMMPS, ms | ratio | searching | skin, mm | wanted |", "|---|---|---|---|---|---|---|---|---|"]
    newer, size = [], []
    for r in rows:
        checks = "; ".join(f"{c['what']}: {'passed' if c['passed'] else 'FAILED'}" for c in r["checks"]) or "-"
        if r["part"] == "size":
            of = {int(n): m for n, m in r["median_ns"].items()}
            size.append(f"| {r['cores']} | {spread(of[grains_of_bed], 1)} | {spread(of[largest], 1)} | "
                        f"{spread(r['ratio']['10,000 grains'], 2)} | {checks} |")
            continue
        ms, share = r["median_ms_per_step"], r["search_share"]
        out.append(f"| {r['part']} | {r['grains']} | {r['cores']} | {spread(ms['Moraine'], 3)} | {spread(ms['LAMMPS'], 3)} | "
                   f"{spread(r['ratio']['LAMMPS'], 2)} | {'-' if share is None else f'{share:.1%}'} | "
                   f"{1e3 * r['skin_m']['LAMMPS']:g} | {checks} |")
        newer += [f"| {r['part']} | {r['grains']} | {name.removeprefix('newer LAMMPS ')} | {spread(ms[name], 3)} | {spread(ratio, 2)} | "
                  f"{1e3 * r['skin_m'][name]:g} |" for name, ratio in r["ratio"].items() if name != "LAMMPS"]
    if newer:
        out += ["", "A newer LAMMPS, on one core:", "", "| scene | grains | style | ms | ratio | skin, mm |", "|---|---|---|---|---|---|", *newer]
    if size:
        out += ["", f"ns a grain and step, undamped, {grains_of_bed} grains and {largest}:", "",
                f"| cores | {grains_of_bed} | {largest} | ratio | wanted |", "|---|---|---|---|---|", *size]
    out += ["", "Taken:", ""]
    out += sorted({f"- {r['date']}, {', '.join(f'{k} {v}' for k, v in r['machine'].items())}; version {r['version']}; LAMMPS "
                   f"{', '.join(r['lammps'].values())}; `{r['command']}`; others kept {r['cores_busy_before']:g} cores busy before and "
                   f"{r['cores_busy_after']:g} after ({', '.join(sorted({q['part'] for q in rows if q['command'] == r['command']}))})"
                   for r in rows})
    return "\n".join([*out, ""])


def sheared(a, out):
    """Measure what a.only, a.grains, a.cores name; True where no check fails. Rows of earlier calls are kept beside the new ones."""
    beds = Beds(a.program)
    programs = {"installed": "lmp", **({"newer": a.lmp} if a.lmp else {})}
    versions = {which: lammps_name(program) for which, program in programs.items()}
    chosen, sizes = a.only or parts, a.grains or [10_000, 90_000]
    print("beds:", os.path.relpath(beds.folder, root), flush=True)
    for scene in [s for s in chosen if s != "size"]:
        for grains in {grains_of_bed, *sizes}:
            beds.case(scene, grains)
    if "packing" in chosen:
        beds.wall_path(a.steps + warm_up)
    if "size" in chosen:
        beds.case("undamped", largest)
    if a.prepare:
        return True
    path, new, found = out / "lammps-sheared.json", [], {}
    about = dict(date=datetime.date.today().isoformat(), machine=machine(), version=version(), lammps=versions, rounds=a.rounds,
                 command=a.command, cores_busy_before=busy_cores())
    for cores in a.cores or (1, 2):
        if cores > 1 and (not shutil.which("mpirun") or os.cpu_count() < cores):
            print(f"{cores} cores: skipped: no mpirun (package openmpi-bin), or fewer cores")
            continue
        for part in chosen:
            for grains in sizes if part != "size" else [largest]:
                row = by_size(beds, cores, a) if part == "size" else against_lammps(beds, part, grains, cores, programs, a, found)
                new.append({**about, **row})
                print(line(row), flush=True)
                for check in row["checks"]:
                    print(f"  {check['what']}: {check['found']:.3g}, {'passed' if check['passed'] else 'FAILED'}", flush=True)
                if part == "packing" and row["search_share"] is None:
                    print("  this version does not say what share of the time goes into searching: not checked")
    busy = busy_cores()
    rows = {(r["part"], r["grains"], r["cores"]): r for r in (json.loads(path.read_text())["rows"] if path.exists() else [])}
    rows.update({(r["part"], r["grains"], r["cores"]): {**r, "cores_busy_after": busy} for r in new})
    order = sorted(rows, key=lambda key: (parts.index(key[0]), key[1], key[2]))
    what = "a bed of sphere-init-1e4.bin in the middle of a shear at 10 kPa and while it packs down, tiled for more grains."
    result = dict(what=what, rows=[rows[key] for key in order])
    path.write_text(json.dumps(result, indent=1) + "\n")
    (out / "lammps-sheared.md").write_text(markdown(result))
    if max(about["cores_busy_before"], busy) > 0.1:
        print(f"others were at work here ({about['cores_busy_before']:.1f} cores busy before, {busy:.1f} after): these times are too long")
    return all(check["passed"] for row in new for check in row["checks"])
