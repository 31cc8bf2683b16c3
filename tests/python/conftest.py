from pathlib import Path
import os
import sys

root = Path(__file__).resolve().parents[2]
if "MORAINE_INSTALLED" not in os.environ:  # else the package that pip has installed, as .ci/wheel does
    sys.path.insert(0, str(root / "python"))
