"""The laws that Moraine shares with LAMMPS's pair granular: forces against it, and speed in the bed that shears.

Hertz's force with Mindlin's stiffness, of the form that LAMMPS calls mindlin_rescale/force, and rolling sds. LAMMPS's floor has its
numbers given (hertz, k_t): older versions mix a wall's moduli in another way.
"""
import datetime
import json
import os
import random
import re
import resource
import statistics
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from laws import GRANULAR, MORAINE, Bed, Springs, near_pairs
from machine import busy_cores, machine, version
from sheared import Beds, grains_of_bed, last_snapshot, normal_stress

young, poisson = 7e10, 0.25  # Pa, 1: of quartz; about as stiff as the bed's own springs at 10 kPa
mu_roll = 0.1
k_roll = 1.16e7              # N/m
steps_compared = 100
near_enough = 1e-9           # of the largest force
own_law = 1e-12              # m, of a program from its own law after these steps,
own_force = 1e-8             # of the largest force: what rounding of 1e-15 m makes of these springs
wanted_over_lammps = 6
most_over_linear = {"hertz and mindlin": 1.3, "linear, rolling": 1.25}
skins = (0.1e-3, 0.2e-3, 0.5e-3)  # m, LAMMPS gets the best


class SharedLaw(NamedTuple):
    hertz: bool
    friction: bool = True
    rolling: bool = False

    def springs(self, k_n, k_t, mu):
        E_star, shear = young / 2 / (1 - poisson ** 2), young / 2 / (1 + poisson)
        normal = dict(E_star=E_star, G_star=shear / 2 / (2 - poisson)) if self.hertz else dict(k_n=k_n, k_t=k_t)
        return Springs(**normal, mu=mu if self.friction else 0.0, **(dict(k_roll=k_roll, mu_roll=mu_roll) if self.rolling else {}))

    def keys(self, friction):
        """Lines of a [contact] or [wall]; friction: of the case, to be left out."""
        lines = ['law = "hertz"', f"young = {young!r}", f"poisson = {poisson!r}"] if self.hertz else []
        lines += [f"k_roll = {k_roll!r}", f"mu_roll = {mu_roll!r}"] if self.rolling else []
        return lines + ([] if self.friction else [f"{key} = 0" for key in friction])

    def lammps(self, p, at_wall=False):
        normal = (f"hooke {p.k_n!r} 0.0" if not self.hertz else f"hertz {4 / 3 * p.E_star!r} 0.0" if at_wall
                  else f"hertz/material {young!r} 0.0 {poisson!r}")
        stiffness = f"{p.k_t!r}" if not self.hertz else f"{8 * p.G_star!r}" if at_wall else "NULL"
        tangential = ("linear_nohistory 0.0 0.0" if not self.friction
                      else f"{'mindlin_rescale/force' if self.hertz else 'linear_history'} {stiffness} 0.0 {p.mu!r}")
        rolling = f" rolling sds {p.k_roll!r} 0.0 {p.mu_roll!r}" if self.rolling else ""
        return f"{normal} tangential {tangential}{rolling} damping velocity"


laws = {"linear": SharedLaw(False), "hertz, no friction": SharedLaw(True, False), "hertz and mindlin": SharedLaw(True),
        "linear, rolling": SharedLaw(False, rolling=True), "hertz, mindlin, rolling": SharedLaw(True, rolling=True)}
differences = {
    "k_t of the step's end, of its middle, while a grows": dict(mean_stiffness=True),
    "r, r + delta_n/2 in the contact's velocity": dict(lever_in_velocity=True),
    "normal and levers of the step's end, of its middle": dict(mid_step=True),
    "springs brought into the new plane, turned with the pair": dict(turned_spring=True, kept_length=False),
}
compared = ("hertz and mindlin", "linear, rolling", "hertz, mindlin, rolling")


def lammps(grains, box, density, commands, program="lmp"):
    """What LAMMPS says. grains: arrays as in a snapshot; commands: after the bed, whose types are role + 1."""
    x, r, role = grains["position"], grains["radius"], grains["role"]
    d, top = float(2 * r.mean()), float((x[:, 2] + r).max())
    with tempfile.TemporaryDirectory() as tmp:
        with open(Path(tmp) / "bed.data", "w") as file:
            file.write(f"bed\n\n{len(r)} atoms\n3 atom types\n\n0 {float(box[0])!r} xlo xhi\n0 {float(box[1])!r} ylo yhi\n"
                       f"{-d!r} {top + 20 * d!r} zlo zhi\n\nAtoms\n\n")
            file.writelines(f"{i + 1} {k + 1} {2 * q!r} {density!r} {a % box[0]!r} {b % box[1]!r} {c!r}\n"
                            for i, ((a, b, c), q, k) in enumerate(zip(x.tolist(), r.tolist(), role.tolist())))
            file.write("\nVelocities\n\n")
            file.writelines(f"{i + 1} {' '.join(map(repr, v + w))}\n"
                            for i, (v, w) in enumerate(zip(grains["velocity"].tolist(), grains["spin"].tolist())))
        (Path(tmp) / "in.lmp").write_text(f"""\
units si
atom_style sphere
atom_modify map array
boundary p p f
newton off
comm_modify vel yes
read_data bed.data
group bottom type 2
group top type 3
group free type 1
fix weight free gravity 9.81 vector 0 0 -1
fix move free nve/sphere
fix hold bottom freeze
thermo 1000000
{commands}
""")
        run = subprocess.run([program, "-in", "in.lmp", "-log", "none"], cwd=tmp, capture_output=True, text=True,
                             env=dict(os.environ, OMP_NUM_THREADS="1"))
        if run.returncode:
            sys.exit(f"LAMMPS failed:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
        dump = Path(tmp) / "dump"
        if not dump.exists():
            return run.stdout
        table = np.loadtxt(dump, skiprows=9)
        table = table[np.argsort(table[:, 0])]
        return dict(position=table[:, 1:4], force=table[:, 4:7], spin=table[:, 7:10])


def compare(program, tmp, scene_of, gravity, speed, dt):
    """Forces at step 0; after some steps each program against its own law in numpy, and the programs against each other."""
    results, ok = {}, True
    print(f"Free grains, the bed of compare-lammps growth with the laws below; after {steps_compared} steps contacts are sheared and rolled.\n"
          f"{'':<26}{'forces at step 0':<20}{'':>4}forces at step {steps_compared}, of the largest {'':>4}positions, m\n"
          f"{'':<26}{'of the largest':<20}{'M - L':<12}{'L - its law':<14}{'M - its law':<14}{'M - L':<12}{'L - its law':<14}M - its law")
    for number, name in enumerate(compared):
        law = laws[name]
        (tmp / str(number)).mkdir()
        scene = scene_of(program, tmp / str(number), contact="\n".join(law.keys([])), wall="# as between grains" if law.hertz else "")
        p = law.springs(scene.k_n, scene.k_t, scene.mu)
        start, end = scene.moraine(steps_compared)
        free = start["role"] == 0
        weight = np.where(free, gravity * scene.density * 4 / 3 * np.pi * start["radius"] ** 3, 0.0)
        style = f"""\
neighbor 0.0005 bin
neigh_modify delay 0 every 1 check yes
pair_style granular
pair_coeff * * {law.lammps(p)}
timestep {dt!r}
fix drive top move linear {speed!r} 0 0
fix floor all wall/gran granular {law.lammps(p, True)} zplane 0.0 NULL
"""
        dump = ("dump out all custom 1 dump id x y z fx fy fz omegax omegay omegaz\n"
                "dump_modify out sort id format float %.17g first yes\nrun 0\n")
        theirs_0 = lammps(start, scene.sides, scene.density, style + dump)
        theirs = lammps(start, scene.sides, scene.density, style + f"run {steps_compared}\n" + dump.replace("run 0", "run 0 post no"))
        pairs = near_pairs(start["position"], start["radius"], scene.sides, Bed.reach)

        def own(which):
            bed = Bed(start["position"], start["radius"], start["role"], pairs, scene.sides, p, scene.density, gravity, speed, dt, which)
            bed.advance(steps_compared)
            return dict(position=bed.x, force=bed.force)
        own_lammps, own_moraine = own(GRANULAR), own(MORAINE)

        def without_weight(of):
            f = of["force"].copy()
            f[:, 2] += weight
            return f

        def of_largest(a, b):
            return float(np.linalg.norm((a - b)[free], axis=1).max() / np.linalg.norm(b[free], axis=1).max())
        row = dict(forces_at_start=of_largest(start["force"], without_weight(theirs_0)),
                   forces=of_largest(end["force"], without_weight(theirs)),
                   forces_lammps_own=of_largest(without_weight(theirs), own_lammps["force"]),
                   forces_moraine_own=of_largest(end["force"], own_moraine["force"]),
                   positions_m=scene.apart(end["position"], theirs["position"]).max(),
                   positions_lammps_own_m=scene.apart(theirs["position"], own_lammps["position"]).max(),
                   positions_moraine_own_m=scene.apart(end["position"], own_moraine["position"]).max())
        row = {key: float(value) for key, value in row.items()}
        results[name] = row
        passed = (row["forces_at_start"] <= near_enough and max(row["forces_lammps_own"], row["forces_moraine_own"]) <= own_force
                  and max(row["positions_lammps_own_m"], row["positions_moraine_own_m"]) <= own_law)
        ok = ok and passed
        values = list(row.values())
        print(f"{name:<26}{values[0]:<20.2g}{values[1]:<12.2g}{values[2]:<14.2g}{values[3]:<14.2g}{values[4]:<12.2g}{values[5]:<14.2g}"
              f"{values[6]:<12.2g}{'' if passed else 'FAILED'}", flush=True)
    results["parts"] = parts = {}
    print(f"\nWhat each difference between the laws does to those forces after {steps_compared} steps, of the largest ({name}):")
    for what, switches in differences.items():
        parts[what] = of_largest(own(replace(GRANULAR, **switches))["force"], own_lammps["force"])
        print(f"  {what:<60}{parts[what]:.2g}")
    print(f"\nAllowed: {near_enough} of the largest force at step 0; {own_force} of it and {own_law} m from the own laws.\n"
          "LAMMPS takes the first of each, Moraine the second; either program follows its own law in numpy, so the list is complete.")
    return results, ok


class Contest:
    def __init__(self, program, steps, lammps_program):
        self.beds, self.steps, self.lammps_program = Beds(program), steps, lammps_program
        self.settings = self.beds.settings()
        self.contact = self.settings["contact"]

    def bed(self, law):
        """Case of the sheared bed under Hertz's law, or with springs; it has gone on for a while with the law."""
        return self.beds.under("hertz" if law.hertz else "linear", SharedLaw(law.hertz).keys([]))

    def case(self, name):
        law = laws[name]
        return self.beds.going_on(re.sub(r"\W+", "-", name), self.bed(law), law.keys(["mu_s", "mu_d"]), ["mu_roll = 0"] if law.rolling else [])

    def processor_ms(self, name):
        """Of a step of Moraine, without its start: what the machine's other work disturbs less than the time that passes."""
        def seconds(steps):
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            subprocess.run([str(w) for w in (self.beds.program, "bench", self.case(name), "--steps", steps, "--threads", 1, "--backend", "cpu")],
                           check=True, capture_output=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
            return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        few = self.steps // 10
        return 1e3 * (seconds(self.steps + few) - seconds(few)) / self.steps

    def moraine(self, name):
        out = subprocess.run([str(w) for w in (self.beds.program, "bench", self.case(name), "--steps", self.steps, "--threads", 1, "--backend",
                                               "cpu")], capture_output=True, text=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
        if out.returncode:
            sys.exit(f"moraine bench failed:\n{out.stdout[-2000:]}{out.stderr[-2000:]}")
        return json.loads(out.stdout)

    def lammps(self, name, skin):
        law, box = laws[name], self.settings["box"]
        p = law.springs(self.contact["k_n"], self.contact["k_t"], self.contact["mu_d"])
        with h5py.File(last_snapshot(self.bed(law))) as file:
            grains = {key: file["grains/" + key][:] for key in ("position", "radius", "role", "velocity", "spin")}
        speed = float(grains["velocity"][grains["role"] == 2, 0].mean())
        out = lammps(grains, (box["x"], box["y"]), self.settings["grains"]["density"], f"""\
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes exclude group bottom bottom exclude group top top
pair_style granular
pair_coeff * * {law.lammps(p)}
timestep {self.beds.dt()!r}
variable area equal lx*ly
variable share equal -{normal_stress!r}*v_area/count(top)
fix force top setforce 0.0 0.0 NULL
fix load top aveforce NULL NULL v_share
fix lift top nve
velocity top set {speed!r} 0 0
run {self.steps}
""", self.lammps_program)
        return 1e3 * float(re.search(r"Loop time of ([\d.e+-]+)", out)[1]) / self.steps


def time_laws(a, out):
    """Moraine and LAMMPS in turns in an order drawn anew; ratios within a round."""
    contest = Contest(a.program, a.steps, a.lmp or "lmp")
    for name in laws:
        contest.case(name)
    if a.prepare:
        return True
    before, runs = busy_cores(), []
    tries = {name: {skin: contest.lammps(name, skin) for skin in ([a.skin] if a.skin else skins)} for name in laws}
    best = {name: min(of, key=of.get) for name, of in tries.items()}
    for _ in range(a.rounds):
        one = {}
        for who, name in random.sample([(w, n) for w in ("moraine", "lammps") for n in laws], 2 * len(laws)):
            one[who, name] = contest.moraine(name) if who == "moraine" else contest.lammps(name, best[name])
        for name in random.sample(list(laws), len(laws)):
            one["processor", name] = contest.processor_ms(name)
        runs.append(one)
    rows, ok = {}, True
    for name in laws:
        ms = [run["moraine", name]["ms_per_step"] for run in runs]
        theirs = [run["lammps", name] for run in runs]
        row = dict(moraine_ms=ms, lammps_ms=theirs, skin_m=best[name], contacts=runs[-1]["moraine", name]["contacts"],
                   near_pairs=runs[-1]["moraine", name]["near_pairs"], over_lammps=statistics.median(t / m for t, m in zip(theirs, ms)),
                   over_linear=statistics.median(m / run["moraine", "linear"]["ms_per_step"] for m, run in zip(ms, runs)))
        row["moraine_processor_ms"] = [run["processor", name] for run in runs]
        row["over_linear_processor"] = statistics.median(run["processor", name] / run["processor", "linear"] for run in runs)
        row["passed"] = row["over_lammps"] >= wanted_over_lammps and row["over_linear"] <= most_over_linear.get(name, np.inf)
        rows[name], ok = row, ok and row["passed"]
    about = dict(what="Moraine and LAMMPS's pair granular with the same laws, in the bed that shears", date=datetime.date.today().isoformat(),
                 machine=machine(), version=version(), lammps=subprocess.run([contest.lammps_program, "-h"], capture_output=True, text=True)
                 .stdout.split("\n")[1].strip(), command=a.command, rounds=a.rounds, steps=a.steps, grains=grains_of_bed,
                 cores_busy_before=before, cores_busy_after=busy_cores())
    (out / "lammps-laws.json").write_text(json.dumps({**about, "laws": rows, "skins_tried_ms": {n: {str(k): v for k, v in t.items()}
                                                                                               for n, t in tries.items()}}, indent=1) + "\n")
    text = markdown(about, rows)
    (out / "lammps-laws.md").write_text(text)
    print(text)
    return ok


def markdown(about, rows):
    def times(ms):
        return f"{statistics.median(ms):.3f} ({min(ms):.3f} - {max(ms):.3f})"
    lines = ["# Moraine against LAMMPS's pair granular with the same laws", "",
             f"Written by `bench/compare-lammps laws`: {about['grains']} grains in the middle of a shear at 10 kPa, one core, {about['steps']} steps, "
             f"{about['rounds']} rounds in an order drawn anew. Times in ms a step, median (least - most); ratios are medians of those within a round.",
             "", "| law | Moraine | LAMMPS granular | times as fast | over the linear spring | the same, processor time | contacts | skin, mm | wanted |", "|---|---|---|---|---|---|---|---|---|"]
    for name, r in rows.items():
        most = most_over_linear.get(name)
        wanted = f"at least {wanted_over_lammps} times as fast" + (f", at most {most} times the linear spring's time" if most else "")
        lines.append(f"| {name} | {times(r['moraine_ms'])} | {times(r['lammps_ms'])} | {r['over_lammps']:.2f} | {r['over_linear']:.2f} | "
                     f"{r['over_linear_processor']:.2f} | "
                     f"{r['contacts']} | {1e3 * r['skin_m']:g} | {wanted}: {'passed' if r['passed'] else 'FAILED'} |")
    cpu = ", ".join(f"{key} {value}" for key, value in about["machine"].items())
    lines += ["", f"Hertz: E = {young:g} Pa, nu = {poisson}. LAMMPS: `hertz/material` or `hooke`, `mindlin_rescale/force` or `linear_history`, `rolling sds`; "
              "without friction `linear_nohistory`. Both beds went on for a while with the law before they were timed; LAMMPS's springs begin unstretched.",
              "", f"Taken {about['date']}, {cpu}; version {about['version']}; {about['lammps']}; `{about['command']}`; others kept "
              f"{about['cores_busy_before']:.2f} cores busy before and {about['cores_busy_after']:.2f} after.", ""]
    return "\n".join(lines)
