"""The bed that feature-cost and compare-versions measure: 10,000 grains, settled by the program sphere."""
import json
import subprocess
import sys

from machine import root

bed_file = root.parent / "shared/data/sphere-init-1e4.bin"
dt = 2e-6  # s

# The bed between its floor and a wall that presses on it, held below and driven above, with friction and without damping.
# "stage." keys belong to the one stage. With "run", a time step, it is computed by `moraine run`, else by `moraine bench`.
base = {
    "start": "../bed", "box.periodic": "xy", "contact.gamma_n": 0, "contact.gamma_t": 0, "contact.mu_s": 0.6, "contact.mu_d": 0.6,
    "model.dt": dt, "model.ledger": False, "guards.interval": 10**9,
    "output.series_interval": 1e3, "output.snapshot_interval": 1e3, "output.checkpoint_interval": 1e9,
    "stage.kind": "shear", "stage.velocity": 0.01, "stage.normal_stress": 1e4, "stage.zero_kinematics": False,
    "stage.wall_mu": 0, "stage.wall_gamma_n": 0, "stage.wall_gamma_t": 0,
    "stage.duration": 1,
}
no_layers = {"stage.kind": "consolidate", "stage.velocity": None}
let_go = {**no_layers, "run": dt, "start": None, "contact.gamma_n": 300, "stage.kind": "settle", "stage.normal_stress": None,
          "stage.zero_kinematics": True}


def skip(why):
    print("skipped:", why)
    sys.exit(77)


def call(*words, **how):
    words = [str(w) for w in words]
    done = subprocess.run(words, capture_output=True, text=True, **how)
    if done.returncode:
        sys.exit(f"{' '.join(words)}\nfailed: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout, done.stderr


def toml(keys):
    tables = {"": []}
    for name, value in keys.items():
        table, _, key = name.rpartition(".")
        if value is not None:
            tables.setdefault(table, []).append(f"{key} = {json.dumps(value)}\n")
    stage, head = tables.pop("stage"), tables.pop("")
    text = "".join(f"[{table}]\n{''.join(lines)}" for table, lines in tables.items())
    return 'extends = "../imported"\nstages = ["s"]\n' + "".join(head) + text + '[[stage]]\nname = "s"\n' + "".join(stage)
