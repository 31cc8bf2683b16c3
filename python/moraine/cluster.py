"""A study on a cluster: Snakemake's profile in cases/cluster, what reproduce adds to it, and what it says of jobs that failed."""
from pathlib import Path
import re
import shutil

from .places import root
from .results import MissingData

kept = root / "cases/cluster"   # profiles


def profile(name):
    """Directory of the profile of this name, or this directory."""
    for directory in (kept / name, Path(name)):
        if (directory / "config.yaml").exists():
            directory = directory.resolve()
            break
    else:
        known = ", ".join(sorted(p.parent.name for p in kept.glob("*/config.yaml")))
        raise MissingData(f"--cluster {name}: expected one of {known}, or a directory with the config.yaml of a profile for Snakemake")
    submit = re.search(r"\b(sbatch|qsub|bsub)\b", (directory / "config.yaml").read_text())
    if submit and not shutil.which(submit[0]):
        raise MissingData(f"--cluster {name}: {submit[0]} is not on the PATH; give this command on a machine from which jobs are submitted")
    return directory


def step(directory):
    """The program of a profile that runs a command as a step of a job; or "env", which just runs it."""
    return str(directory / "step") if (directory / "step").exists() else "env"


def words(directory, cores):
    """For Snakemake, beside those for one machine."""
    return ["--profile", str(directory), *(["--cores", str(cores)] if cores else [])]


def environment(directory, options):
    """What a profile may ask for: where it lies, and more options for sbatch."""
    return {"MORAINE_PROFILE": str(directory)} | ({"MORAINE_SBATCH": options} if options else {})


def unfinished(study):
    """Lines about what has not finished: each case, its log, and the last error there; or what it waits for."""
    home, lines = Path(study.home), []
    for seed in study.seeds:
        for name in study.wanted(seed):
            if (home / study.done(name, seed)).exists():
                continue
            case, log = study.directory(name, seed), study.log(name, seed)
            waits = [mark for mark in study.start(name, seed) if not (home / mark).exists()]
            if waits:
                lines.append(f"{case} has not begun: it starts from {study.directory(study.parts[name].start, seed)}")
            elif not (home / log).exists():
                lines.append(f"{case} has not begun: it was not submitted; why, stands above")
            else:
                job, error = last_words((home / log).read_text(errors="replace"))
                lines.append(f"{case} has not finished: job {job}: {error}; see {home / log}")
    if not lines:
        lines.append(f"the report was not written; see {home / study.report_log()}")
    return lines


def last_words(log):
    """(number of the last job, what it said last of errors) of a log."""
    number = (re.findall(r"^job (\d+) ", log, re.MULTILINE) or ["?"])[-1]
    _, ran, last = ("\n" + log).rpartition(f"\njob {number} on ")  # again, if it was queued again
    if not ran:
        return number, "has not run; squeue or sacct say why"
    for who in "moraine|slurmstepd", "srun":
        said = re.findall(rf"^(?:{who}): (?:error: )?(.*(?:\n  .*)*)", last, re.MULTILINE)
        if said:
            return number, "; ".join(line.strip() for line in said[-1].splitlines()).replace(":; ", ": ")
    return number, "was ended without a word of the program"
