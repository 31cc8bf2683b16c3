"""`moraine bench` on ranks: the same as without them, through mpirun."""
import json
import os
import subprocess
import sys

# As root, too; more ranks than cores; no rank bound to a core, so that its threads find others.
mpirun = ["mpirun", "--allow-run-as-root", "--oversubscribe", "--bind-to", "none"]


def bench(program, case, steps, ranks=1, threads=1, preload=None):
    """What `moraine bench` prints, as a dictionary; what it says on stderr is under "stderr". One rank is without MPI.

    preload: a library that stands before MPI's.
    """
    words = [program, "bench", case, "--steps", steps, "--threads", threads, "--backend", "cpu"]
    if ranks > 1:
        words = [*mpirun, *(["-x", f"LD_PRELOAD={preload}"] if preload else []), "-n", ranks, *words]
    run = subprocess.run([str(w) for w in words], capture_output=True, text=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    if run.returncode:
        sys.exit(f"{' '.join(map(str, words))}\nfailed:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
    return {**json.loads(run.stdout), "stderr": run.stderr}
