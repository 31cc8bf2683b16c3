"""Files of HDF5 that are looked at before HDF5 sees them: it hangs, or ends the program, on some that are damaged.

Snapshots and checkpoints begin with a seal, as src/output/sealed.hpp says: the SHA-256 of all that follows. Files without one (the
series, which grows; what earlier versions have written) are read by a process of their own, which may hang or die.
"""
import hashlib
import multiprocessing
import os
from pathlib import Path
import re
import stat

import h5py

size = 512
patience = 5, 20e6  # s, and more for so many bytes a second, for a file without a seal; a series takes some milliseconds


class MissingData(Exception):
    """A file or dataset that an analysis needs is not there; the message names it and says what would help."""


def seal(file, like=None):
    """Of a file that was changed, or made with userblock_size=512; kind and format are those of the file `like`."""
    data = Path(file).read_bytes()
    kind = Path(like or file).read_bytes()[80:size].partition(b"\n")[0]
    rest = (kind + b"\nbytes %d\n" % len(data)).ljust(size - 80, b"\n") + data[size:]
    Path(file).write_bytes(b"moraine sha256 %s\n" % hashlib.sha256(rest).hexdigest().encode() + rest)


def is_sealed(file):
    """True if the seal is there and right, False if there is none; raises MissingData where the file is damaged."""
    try:
        if not stat.S_ISREG(os.stat(file).st_mode):  # a pipe would be waited for
            raise MissingData(f"{file}: not a file")
        with open(file, "rb") as f:
            head = f.read(size)
            if head.startswith(b"\x89HDF\r\n\x1a\n"):
                return False
            found = re.match(rb"moraine sha256 ([0-9a-f]{64})\n\w+ \d+\nbytes (\d+)\n", head)
            if not found:
                raise MissingData(f"{file}: cannot be read as HDF5: not a file of Moraine, or damaged")
            if os.fstat(f.fileno()).st_size != int(found[2]):
                raise MissingData(f"{file}: damaged: {os.fstat(f.fileno()).st_size} bytes where it had {int(found[2])}")
            digest = hashlib.sha256(head[80:])
            while part := f.read(1 << 20):
                digest.update(part)
    except FileNotFoundError:
        raise MissingData(f"there is no {file}") from None
    except OSError as why:
        raise MissingData(f"{file}: cannot be read: {why.strerror or why}") from None
    if digest.hexdigest().encode() != found[1]:
        raise MissingData(f"{file}: damaged: its SHA-256 is not the one that it was written with")
    return True


def _read_plainly(file, what, how):
    try:
        with h5py.File(file, "r", **how) as h5:
            return what(h5)
    except FileNotFoundError:
        raise MissingData(f"there is no {file}") from None
    except (OSError, RuntimeError, ValueError, TypeError, KeyError) as why:  # as HDF5 finds it damaged
        raise MissingData(f"{file}: cannot be read as HDF5: {why}") from None


def _answer(pipe, file, what, how):
    try:
        pipe.send((_read_plainly(file, what, how), None))
    except Exception as why:
        pipe.send((None, why))


def _read_apart(file, what, how):
    ours, its = multiprocessing.Pipe(duplex=False)
    reader = multiprocessing.get_context("fork").Process(target=_answer, args=(its, file, what, how), daemon=True)
    reader.start()
    its.close()
    try:
        seconds = patience[0] + os.stat(file).st_size / patience[1]
        if not ours.poll(seconds):
            raise MissingData(f"{file}: HDF5 has not read it in {seconds:.0f} s: damaged, or on a disk that is very slow")
        result, problem = ours.recv()
    except EOFError:
        raise MissingData(f"{file}: damaged: HDF5 dies of reading it") from None
    finally:
        reader.kill()
        reader.join()
        ours.close()
    if problem:
        raise problem
    return result


def read(file, what, sealed=None, **how):
    """what(h5) of the open file; sealed: what is_sealed() has found."""
    if is_sealed(file) if sealed is None else sealed:
        return _read_plainly(file, what, how)
    return _read_apart(file, what, how)
