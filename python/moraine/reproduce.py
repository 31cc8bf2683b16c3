"""./moraine reproduce NAME: runs the study of cases/NAME/study.toml, what is missing of it, and ends with figures and a report."""
from pathlib import Path
import fcntl
import os
import re
import shutil
import signal
import subprocess

from . import cluster, places
from .places import root
from .results import MissingData
from .study import Study, read


def studies():
    return sorted(p.parent.name for p in (root / "cases").glob("*/study.toml"))


def arguments(parser):
    parser.add_argument("NAME", help=f"a directory in cases/ with a study.toml: {', '.join(studies())}")
    parser.add_argument("--preset", default="fast", choices=("paper", "standard", "fast"),
                        help="accuracy against time (default: %(default)s)")
    parser.add_argument("--seeds", help="how many random packings, or which: 4,5,6 (default: as study.toml has it)")
    parser.add_argument("--quick", action="store_true", help="a small version, as study.toml describes it: minutes instead of hours")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="sets",
                        help="override a key of case.toml, by its full name: --set wall.mass=64kg; makes a study beside the one without. "
                             "A list of study.toml, such as --set normal_stress=30,100kPa: these values instead; the report has all there are")
    parser.add_argument("--settled", default="", metavar="STUDY",
                        help="shear the beds that this study has settled (such as fast) instead of settling them again")
    parser.add_argument("--output", metavar="DIR", help="of the report (default: runs/STUDY/results beside the Snakefile)")
    parser.add_argument("--cores", type=int, help=f"CPU cores to use (default: all, {os.cpu_count()}; on a cluster as many as it has)")
    parser.add_argument("--gpu", action="store_true", help="on one GPU, all runs of a case and seed at once")
    parser.add_argument("--cluster", metavar="PROFILE",
                        help="run each case as a job of a cluster: slurm, which takes cases/cluster/slurm/config.yaml, or a directory with such a file")
    parser.add_argument("--cluster-options", default="", metavar="OPTIONS",
                        help="more options for sbatch, in one word with =: --cluster-options='--partition=long --account=me'")
    parser.add_argument("--dry-run", action="store_true", help="say what would run")


def seeds(text):
    if not re.fullmatch(r"\d+(,\d+)*", text) or text == "0":
        raise MissingData(f"--seeds {text}: expected a number of seeds, or seeds with commas between them")
    return [int(s) for s in text.split(",")] if "," in text else list(range(1, int(text) + 1))


def study_of(args, home):
    lists_there = {k for case in read(home)["case"] for k in case.get("lists", {})}
    settings, lists = {}, {}
    for text in args.sets:
        key, equals, value = text.partition("=")
        like = next((k for k in lists_there if "." not in k and key.endswith("." + k)), "")
        if not equals or not value:
            raise MissingData(f"--set {text}: expected KEY=VALUE")
        if key in lists_there:
            lists[key] = value if "," in value else value + ","
        elif key in ("seed", "grains.seed", "preset", "model.preset"):
            raise MissingData(f"--set {text}: give --{key.rpartition('.')[2].replace('seed', 'seeds')} instead")
        elif like:
            raise MissingData(f"--set {text}: give --set {like}={value}, which holds for all stages")
        elif "." not in key:
            raise MissingData(f"--set {text}: expected the full name of the key, such as wall.mass; ./moraine keys lists them")
        else:
            settings[key] = value
    moraine, step = os.environ.get("MORAINE_LAUNCHER", str(places.program() or root / "moraine")), ""
    if args.cluster:
        step = cluster.step(cluster.profile(args.cluster))
        if moraine == str(root / "moraine") and (root / "build/moraine").exists():
            moraine = str(root / "build/moraine")  # nodes need nothing to build with
    return Study(home, args.preset, seeds(args.seeds) if args.seeds else [], args.quick, settings, lists, args.settled,
                 str(Path(args.output).resolve()) if args.output else "", gpu=args.gpu, moraine=moraine, step=step)


def hold(study):
    """Open files that keep other commands off this study and the beds it uses; the system lets go of them however this one ends.
    Variants may share beds that are finished."""
    held = []
    for name in sorted({study.name, study.bed}):
        directory = study.home / "runs" / name
        directory.mkdir(parents=True, exist_ok=True)
        held.append((directory / ".lock").open("w"))
        only_read = name != study.name and all((study.home / study.done(bed, seed)).exists() for bed in study.beds for seed in study.seeds)
        try:
            fcntl.flock(held[-1], (fcntl.LOCK_SH if only_read else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            raise MissingData(f"{directory} is in use by another reproduce; wait for its end") from None
    return held


def check(study):
    """Keys and values, before hours are spent: each case of the first seed, as if it began with loose grains."""
    seed = study.seeds[0]
    for name in study.wanted(seed):
        sets = ["--set", 'start=""']
        for key, values in study.parts[name].lists.items():
            sets += ["--set", f"{key}={last_value(values)}"]
        done = subprocess.run([study.moraine, "check", str(study.directory(name, seed)), *sets], cwd=study.home, capture_output=True, text=True)
        if done.returncode:
            raise MissingData(done.stderr.strip().removeprefix("moraine: "))


def last_value(values):
    """"10,20 kPa" -> "20 kPa"."""
    return values.rstrip(", ").split(",")[-1].strip()


def run(args):
    home = root / "cases" / args.NAME
    if not (root / "cases/Snakefile").exists():
        raise MissingData(f"there is no {root}/cases/Snakefile; `moraine cases` copies the cases with their workflow to here")
    if not (home / "study.toml").exists():
        raise MissingData(f"there is no {home}/study.toml; studies: {', '.join(studies()) or 'none (they are in the repository)'}")
    if args.cluster_options and not args.cluster:
        raise MissingData("--cluster-options: they go with --cluster")
    study = study_of(args, home)  # first, so that what is wrong with it is said before anything is to be installed
    snakemake = shutil.which("snakemake")
    if not snakemake:
        raise MissingData("snakemake is not installed (Debian: apt-get install snakemake; in a virtual environment: pip install 'moraine[workflow]')")
    held = [] if args.dry_run else hold(study)
    if not args.dry_run:
        study.write_cases()
        check(study)
    command = [snakemake, "--snakefile", "../Snakefile", "--configfile", str(study.write_config()),
               # What has been computed stays valid when only words of the workflow change.
               "--rerun-triggers", "mtime", "--keep-going", "--rerun-incomplete",
               "--nolock"]  # Snakemake's own lock outlives a power cut, and then wants to be removed by hand
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(places.on_path), os.environ.get("PYTHONPATH")]))}
    if args.cluster:
        profile = cluster.profile(args.cluster)
        command += cluster.words(profile, args.cores)
        environment |= cluster.environment(profile, args.cluster_options)
    else:
        command += ["--cores", str(args.cores or os.cpu_count())]
    if args.dry_run:
        command.append("--dry-run")
    kept = [f.fileno() for f in held]
    if args.cluster:
        with subprocess.Popen(command, cwd=home, env=environment, pass_fds=kept) as process:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for Snakemake, which cancels its jobs and then ends
            status = process.wait()
    else:
        status = subprocess.run(command, cwd=home, env=environment, pass_fds=kept).returncode
    if status == 0 and not args.dry_run:
        print(f"report: {home / 'runs' / study.name / 'results' if not args.output else Path(args.output)}/report.html")
    if status and args.cluster and not args.dry_run:
        raise MissingData("\nmoraine: ".join([*cluster.unfinished(study), "the same command goes on with what is missing"]))
    return status
