"""What bench/slurm checks and measures."""
import datetime
import os
import shutil
import statistics
import subprocess
import time
from pathlib import Path

import h5py

from machine import busy_cores, machine, root, version

hello = """#include <mpi.h>
#include <stdio.h>
int main(int n, char** words) {
  int rank, ranks, sum;
  MPI_Init(&n, &words);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Allreduce(&rank, &sum, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  printf("%d ranks, sum %d\\n", ranks, sum);
  return MPI_Finalize();
}
"""


class Checks:
    def __init__(self):
        self.lines = []  # (passed, words); passed None: skipped

    def __call__(self, passed, words):
        self.lines.append((passed if passed is None else bool(passed), words.strip()))
        print("skipped:" if passed is None else "passed:" if passed else "FAILED:", words, flush=True)

    @property
    def passed(self):
        return all(passed is not False for passed, _ in self.lines)


def files_outside():
    """Where programs like these leave something: settings, spools, logs and sockets of the system, the user's own, and this checkout."""
    found = set()
    for top in "/etc", "/var/spool", "/var/log", "/var/lib/slurm", "/var/lib/munge", "/run", "/dev/shm", "/var/tmp", root / "cases", root / "python":
        for directory, folders, files in os.walk(top):
            found.update(Path(directory, name) for name in (*folders, *files))
    found = {p for p in found if not p.name.startswith("vader_segment")}  # of other programs' MPI; ours lie in the scratch directory
    home = Path.home()  # others of this user's programs may be at work there, and in /tmp
    words = ("slurm", "munge", "snake", "ompi", "openmpi", "pmi", "hwloc", "moraine", "matplotlib")
    for top in home, home / ".config", home / ".cache", home / ".local/share", Path("/tmp"):
        if top.is_dir():
            found.update(p for p in top.iterdir() if any(w in p.name.lower() for w in words))
    return found


def processes_of(path, first=False):
    """Numbers of processes that have this path in their command or environment, but for this one; or as the first word of their command."""
    found, wanted = [], str(path).encode()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            command = (entry / "cmdline").read_bytes()
            there = command.startswith(wanted + b"\0") if first else wanted in command or wanted in (entry / "environ").read_bytes()
        except OSError:
            continue  # it has ended, or is another user's
        if there and int(entry.name) != os.getpid():
            found.append(int(entry.name))
    return found


def different(a, b):
    """Names of data sets that differ between two output directories: of the series, and of the last snapshot."""
    differs = []
    for file in ["series.h5", *(f"snapshots/{f.name}" for f in sorted((a / "snapshots").glob("*.h5"))[-1:])]:
        if not (b / file).exists():
            differs.append(file)
            continue
        with h5py.File(a / file, swmr=file == "series.h5") as x, h5py.File(b / file, swmr=file == "series.h5") as y:
            names = [set(), set()]
            for f, found in zip((x, y), names):
                f.visititems(lambda name, what: found.add(name) if isinstance(what, h5py.Dataset) else None)
            differs += sorted(names[0] ^ names[1])
            differs += [n for n in sorted(names[0] & names[1]) if x[n][()].tobytes() != y[n][()].tobytes() or x[n].shape != y[n].shape]
    return differs


def overhead(tree, slurm):
    """s from sbatch to the end of what a job does, where that is nothing, and where it is a step of ours; medians of 5."""
    def median(*words):
        times, end = [], slurm.directory / "end"
        for _ in range(5):
            began = time.time()
            subprocess.run(["sbatch", "--quiet", "--wait", "--output=/dev/null", "--wrap", f"{' '.join(map(str, words))}; date +%s.%N >{end}"],
                           env=slurm.environment, check=True, cwd=tree.directory)
            times.append(float(end.read_text()) - began)
        return statistics.median(times)
    return {"empty": median("true"), "step": median(tree.directory / "cases/cluster/slurm/step", tree.program, "--version")}


def mpi(tree, slurm, scratch, check):
    """mpirun in a job of two tasks: a program that adds the ranks, and Moraine, if it was built with MPI."""
    def job(*words):
        log = scratch / "mpi.log"
        done = subprocess.run(["sbatch", "--quiet", "--wait", "--ntasks=2", "--open-mode=truncate", f"--output={log}", "--wrap", " ".join(map(str, words))],
                              env=slurm.environment, cwd=scratch)
        return done.returncode, log.read_text()

    if not shutil.which("mpicc"):
        check(None, "MPI: there is no mpicc (libopenmpi-dev)")
        return
    (scratch / "hello.c").write_text(hello)
    subprocess.run(["mpicc", "hello.c", "-o", "hello"], cwd=scratch, check=True)
    for start in "mpirun", "srun --mpi=pmix":
        status, said = job(start, "./hello")
        check(status == 0 and said.count("2 ranks, sum 1") == 2, f"{start} in a job of two tasks starts two ranks that know each other")
    if not (tree.program.parent / "moraine_mpi.so").exists():
        check(None, "Moraine on two ranks: this build has no MPI (moraine_mpi.so beside the program)")
        return
    cases = [scratch / name for name in ("one-rank", "two-ranks")]
    for case in cases:
        shutil.copytree(tree.directory / "cases/quick-shear", case, ignore=shutil.ignore_patterns("output"))
    short = ["--threads", 1, "--set", "stage.shear.strain=0.05"]
    subprocess.run(list(map(str, [tree.program, "run", cases[0], *short])), check=True, capture_output=True)
    # As at a time limit with --signal=B:USR1@SECONDS: Slurm tells the batch script, which mpirun has become.
    words = ["exec mpirun", tree.program, "run", cases[1], *short]
    number = subprocess.run(["sbatch", "--parsable", "--ntasks=2", f"--output={scratch / 'mpi.log'}", "--wrap", " ".join(map(str, words))],
                            env=slurm.environment, cwd=scratch, check=True, capture_output=True, text=True).stdout.strip()
    while not (cases[1] / "output/checkpoint.h5").exists():
        time.sleep(0.1)
    time.sleep(3)
    subprocess.run(["scancel", "--batch", "--signal=USR1", number], env=slurm.environment, check=True)
    while subprocess.run(["squeue", "--noheader", "--jobs", number], env=slurm.environment, capture_output=True, text=True).stdout.strip():
        time.sleep(0.2)
    stopped = "--resume goes on from here" in (scratch / "mpi.log").read_text()
    check(stopped, "two ranks of a job: SIGUSR1 to its batch script, as before a time limit, leaves a checkpoint")
    status, said = job("mpirun", tree.program, "run", cases[1], "--resume", *short)
    differs = different(cases[0] / "output", cases[1] / "output") if status == 0 else [" ".join(said.split())[-300:]]
    check(not differs, f"Moraine on two ranks of a job, resumed: same bits as on one{': not ' * bool(differs) + ', '.join(differs)}")


def report(file, check, facts):
    about = ", ".join(f"{key} {value}" for key, value in machine().items())
    release = subprocess.run(["slurmctld", "-V"], capture_output=True, text=True).stdout.strip()
    snakemake = subprocess.run(["snakemake", "--version"], capture_output=True, text=True).stdout.strip()
    lines = ["# A study on Slurm, from nothing to figures", "",
             f"`bench/slurm`, version {version()}, {datetime.date.today()}, {about}; others kept {busy_cores():g} cores busy after. {release}, Snakemake "
             f"{snakemake}; one node of two cores, the quick study of the paper (1,000 grains, three normal stresses), {facts['all']:.0f} s in all.", "",
             "| | s |", "|---|---|",
             f"| the study without Slurm | {facts['alone']:.0f} |",
             f"| the study as jobs, one of them killed and one stopped at its time limit | {facts['cluster']:.0f} |",
             f"| from sbatch to the end of a job that does nothing | {facts['empty']:.1f} |",
             f"| from sbatch to the end of a job that runs `moraine --version` as a step | {facts['step']:.1f} |", "",
             "| checked | |", "|---|---|"]
    lines += [f"| {words} | {'skipped' if passed is None else 'passed' if passed else 'FAILED'} |" for passed, words in check.lines]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([*lines, ""]))
