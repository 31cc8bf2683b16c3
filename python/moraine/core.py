"""The compiled part of the package, moraine._core; where it is not built, one error that says how to get it."""
from contextlib import contextmanager
import re

try:
    from . import _core
except ImportError as why:
    raise ImportError("moraine.Case and moraine.Run need the compiled part of the package, moraine._core, which is not built here: "
                      "run `pip install .` in the folder of the sources, in a virtual environment") from why

Error = _core.Error


class UnknownKey(Error, AttributeError):
    """A key that case.toml does not know, or a kind of stage does not have."""


_spelled = {"--resume": "resume=True", "--force": "force=True"}


@contextmanager
def spelled_for_python():
    """Errors that name options of the command line name those of Python."""
    try:
        yield
    except Error as e:
        words = re.sub(r"--(?:resume|force)\b", lambda option: _spelled[option[0]], str(e))
        raise type(e)(words.replace("--set ", "")) from None
