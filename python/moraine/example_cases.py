"""moraine cases [DIR]: copies the cases that come with the package to where they can be run and changed."""
from pathlib import Path
import shutil

from . import places
from .sealed import MissingData


def arguments(parser):
    parser.add_argument("DIR", nargs="?", default="cases", help="directory to make (default: %(default)s)")


def run(args):
    target = Path(args.DIR)
    origin = places.sources / "cases" if places.sources else places.carried
    if target.exists():
        raise MissingData(f"{target} is there already; name another directory: moraine cases DIR")
    if not origin.is_dir():
        raise MissingData(f"there is no {origin}: this package was installed without its cases")
    results = shutil.ignore_patterns("output", "sweep", "runs", ".snakemake")
    shutil.copytree(origin, target, ignore=results)
    print(f"{target}: {len(list(target.rglob('case.toml')))} cases; to begin with: moraine run {target}/quick-shear")
