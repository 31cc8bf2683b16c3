"""./moraine report STUDY: measures the runs of a study and holds them against what was published; report.html, report.md, tables and figures."""
from pathlib import Path
import importlib

from .results import MissingData
from .study import read

reports = ("paper", "hardening", "creep", "grading", "angular", "lateral", "hysteresis")   # NAME: build(study, output, notes) of NAME_report.py


def arguments(parser):
    parser.add_argument("STUDY", help="directory of runs, such as cases/paper-2013/runs/fast")
    parser.add_argument("--output", metavar="DIR", help="where the report goes (default: STUDY/results)")
    parser.add_argument("--notes", metavar="FILE", help="Markdown to include: findings, causes")


def kind(study):
    """Which report, by the study.toml that the runs belong to; that of the paper for runs that lie elsewhere."""
    home = Path(study).resolve().parents[1]
    if not (home / "study.toml").exists():
        return "paper"
    name = read(home).get("report", "paper")
    if name not in reports:
        raise MissingData(f"{home / 'study.toml'}: report = {name}: expected one of {', '.join(reports)}")
    return name


def run(args):
    if args.notes and not Path(args.notes).is_file():
        raise MissingData(f"there is no file {args.notes}")
    report = importlib.import_module(f".{kind(args.STUDY)}_report", __package__)
    report.build(args.STUDY, args.output or Path(args.STUDY) / "results", args.notes)
