"""Where the package finds what it does not contain itself: in the tree of the sources, or installed by pip."""
from pathlib import Path

package = Path(__file__).resolve().parent
sources = package.parents[1] if (package.parents[1] / "CMakeLists.txt").exists() else None   # None: installed
on_path = package.parent            # what PYTHONPATH has to name for this package to be found
carried = package / "cases"         # cases that an installed package brings along
root = sources or Path.cwd()        # where cases/ is looked for; installed: where the command is given


def program():
    """The program itself, or None in the sources, where only the launcher ./moraine can build it."""
    file = package / "bin/moraine"
    return file if file.exists() else None
