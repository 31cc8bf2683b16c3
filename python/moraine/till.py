"""./moraine till: the experiments of cases/till, till with pore water. README.md there says what they are.

    quick       a bed of 1,000 grains, sheared undrained and dry, and the figure that compares them
    hardening   10,000 grains at several permeabilities and rates of shear, each rate also dry
    report      table and figures of the hardening runs there are

Each run is an ordinary case directory; what has been computed stays, and what was cut off goes on.
"""
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import fcntl
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

from .case import Case, MissingData
from .progress import Progress

root = Path(__file__).resolve().parents[2]

permeability_factors = ("3.5e-8", "3.5e-9", "3.5e-10")  # k_c, m2
strain_rates = ("0.025", "0.05", "0.1")                 # 1/s
series_strain, snapshot_strain = 0.001, 0.025           # of shear, between two rows and two snapshots, at every rate

interval = 60   # s of the clock between two lines on how far the runs are


def home():
    return root / "cases" / "till"


def shown(directory):
    """As a person at the root of the tree would write it."""
    return os.path.relpath(directory, root)


def hardening_cases():
    """{name: text of case.toml}, the slowest rates first: they take longest."""
    cases = {}
    for rate in sorted(strain_rates, key=float):
        output = f'series_interval = "{series_strain / float(rate):g} s"\nsnapshot_interval = "{snapshot_strain / float(rate):g} s"\n'
        for k_c in (None, *permeability_factors):
            title, water = ("dry", "enabled = false") if k_c is None else (f"k_c = {k_c} m2", f'permeability_factor = "{k_c} m2"')
            name = f"dry+rate-{rate}" if k_c is None else f"k_c-{k_c}+rate-{rate}"
            cases[name] = (f'title = "Till, hardening: {title}, {rate} 1/s"\nextends = "../../"\n\n[fluid]\n{water}\n\n'
                           f'[[stage]]\nname = "shear"\nstrain_rate = "{rate} 1/s"\n\n[output]\n{output}')
    return cases


def hardening_directories():
    """{name: directory}, by permeability and rate, dry ones last."""
    directories = {name: home() / "hardening" / "runs" / name for name in hardening_cases()}
    wet = [n for k_c in permeability_factors for n in directories if n.startswith(f"k_c-{k_c}+")]
    return {name: directories[name] for name in wet + [n for n in directories if n.startswith("dry")]}


def write_case(directory, text):
    """One that is there stays; another one in its place is an error."""
    file = directory / "case.toml"
    if not file.exists():
        directory.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    elif file.read_text() != text:
        raise MissingData(f"{shown(file)} is not that of this study; move the folder away, or remove it, and try again")


def hold(directory):
    """An open file that keeps other commands off; the system lets go of it however this one ends."""
    directory.mkdir(parents=True, exist_ok=True)
    lock = (directory / ".lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise MissingData(f"{shown(directory)} is in use by another ./moraine till; wait for its end") from None
    return lock


def finished(directory):
    progress = Progress(directory)
    progress.look()
    return progress.state == "finished"


def how_far(directory):
    """In words, of a case that runs."""
    try:
        progress = Progress(directory)
        progress.look()
        if progress.case is None:
            return "begins"
        return f"{progress.stage.name} {100 * progress.fraction:.0f} %"
    except (MissingData, OSError):  # its files are being replaced
        return "begins"


class Runs:
    """Runs cases, some at once, each with so many threads, and says how far they are."""

    def __init__(self, directories, at_once, threads=1, say=print):
        self.directories, self.at_once, self.threads = directories, at_once, threads
        self.say = lambda text: say(f"{time.strftime('%H:%M:%S')} {text}")
        self.under_way, self.failed, self.ended, self.stop = {}, {}, 0, False
        self.lock = threading.Lock()

    def _one(self, name, directory):
        program = os.environ.get("MORAINE_PROGRAM") or str(root / "moraine")
        command = [program, "run", shown(directory), "--resume", "--quiet", "--threads", str(self.threads), "--backend", "cpu"]
        with tempfile.TemporaryFile() as errors:
            with self.lock:  # so that none begins once the others have been stopped
                if self.stop:
                    return
                process = subprocess.Popen(command, cwd=root, stdout=subprocess.DEVNULL, stderr=errors)
                self.under_way[name] = process
                self.say(f"{name}: begins")
            status = process.wait()
            errors.seek(0)
            words = errors.read().decode(errors="replace").strip().splitlines()
        with self.lock:
            del self.under_way[name]
            self.ended += 1
            if status:
                self.failed[name] = words[-1] if words else f"ended with status {status}"
                self.say(f"{name}: {self.failed[name]}")
            else:
                self.say(f"{name}: finished ({self.ended} of {len(self.directories)})")

    def _tell(self):
        with self.lock:
            names = list(self.under_way)
        if names:
            parts = ", ".join(f"{name}: {how_far(self.directories[name])}" for name in names)
            self.say(f"{self.ended} of {len(self.directories)} ended; {parts}")

    def run(self):
        """{name: why} of those that failed."""
        pool = ThreadPoolExecutor(self.at_once)
        try:
            tasks = [pool.submit(self._one, name, directory) for name, directory in self.directories.items()]
            told = time.monotonic()
            while not all(t.done() for t in tasks):
                time.sleep(0.2)
                if time.monotonic() >= told + interval:
                    self._tell()
                    told = time.monotonic()
            for task in tasks:
                task.result()
        finally:  # after Ctrl-C, too: each run writes a checkpoint and ends
            with self.lock:
                self.stop = True
                for process in self.under_way.values():
                    process.terminate()
            pool.shutdown(cancel_futures=True)
        return self.failed


def run_missing(directories, at_once, threads=1, say=print):
    """Those of {name: directory} that have not finished."""
    missing = {name: d for name, d in directories.items() if not finished(d)}
    say(f"{len(directories) - len(missing)} of {len(directories)} runs have finished" + (f"; {min(at_once, len(missing))} at once" if missing else ""))
    return Runs(missing, at_once, threads, say).run() if missing else {}


def failed(failures):
    for name, why in failures.items():
        print(f"moraine: {name}: {why}", file=sys.stderr)
    return 1 if failures else 0


def quick(args):
    from . import style, till_report, water_figures
    wet = home() / "quick-undrained"
    if status := failed(run_missing({"quick-undrained": wet, "quick-undrained/dry": wet / "dry"}, args.at_once)):
        return status
    stages = [Case(d).stage("shear") for d in (wet, wet / "dry")]
    results = home() / "results"
    for path in style.save(water_figures.shear(stages, ["undrained", "dry"]), results / "figures" / "quick-undrained", ("png",), dpi=130):
        print(path)
    till_report.pressure_figure(stages[0], "quick-undrained", results, print)
    return 0


def hardening(args):
    directories = hardening_directories()
    runs = home() / "hardening" / "runs"
    with hold(runs):
        for name, text in hardening_cases().items():
            write_case(directories[name], text)
        bed = home() / "bed"
        if not finished(bed):
            print(f"{shown(bed)} comes first")
            if status := failed(Runs({"bed": bed}, 1, args.at_once).run()):
                return status
        failures = run_missing({name: directories[name] for name in hardening_cases()}, args.at_once)
    if not failures:
        print("all have finished; ./moraine till report measures and draws them")
    return failed(failures)


def report(args):
    from . import till_report
    till_report.build(hardening_directories(), args.output or home() / "results")
    return 0


def count(text):
    if not re.fullmatch(r"[1-9]\d{0,3}", text):
        raise MissingData(f"--at-once {text}: expected a number of runs, from 1")
    return int(text)


def arguments(parser):
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    parsers = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    for name, does in (("quick", "1,000 grains, undrained and dry: runs what is missing, and draws them"),
                       ("hardening", f"10,000 grains: {len(permeability_factors)} permeabilities x {len(strain_rates)} rates and their dry twins; runs "
                                     "what is missing")):
        sub = parsers.add_parser(name, help=does, description=does + ".")
        sub.add_argument("--at-once", metavar="N", default=str(cores), help="runs at once, of one thread each (default: one for each core, %(default)s)")
    does = "measures and draws the hardening runs there are, into cases/till/results"
    sub = parsers.add_parser("report", help=does, description=does + ".")
    sub.add_argument("--output", metavar="DIR", help="where they go instead")


def run(args):
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # by way of what stops the runs
    if args.what != "report":
        args.at_once = count(args.at_once)
    return {"quick": quick, "hardening": hardening, "report": report}[args.what](args)
