"""Which snapshots of a case are shown, one after the other, and what is said of each: for the movies and the page in 3D."""
import numpy as np

from .results import MissingData, Snapshot


def snapshots(case, name=None, least=1, what="a page"):
    """Stage and files of the snapshots to show: of the stage of that name; else of the last that shears; else of the last that has any."""
    if name is None:
        have = [s for s in case.stages if any((case.output / "snapshots").glob(f"{s.index + 1:02d}-{s.name}-*.h5"))]
        if not have:
            raise MissingData(f"{case.output}/snapshots: there is no snapshot; the key output.snapshot_interval says how often a run writes one")
        stage = ([s for s in have if s.sheared] or have)[-1]
    else:
        stage = case.stage(name)
    found = stage.snapshots
    if len(found) < least:
        raise MissingData(f"{found[0].file}: is the only snapshot of stage {stage.name}; {what} takes {least} at least: "
                          "a shorter output.snapshot_interval gives more")
    return stage, [s.file for s in found]  # opened one at a time: all of a long run may not fit into memory


def times(stage, files):
    """Time in the stage, s, and shear strain, of each snapshot; the latter from the series, none where the stage does not shear."""
    time = np.array([Snapshot(f).stage_time for f in files])
    if not stage.sheared:
        return time, None
    rows = stage.series
    return time, np.interp(time, rows["stage_time"], rows["shear_strain"])


def captions(stage, files):
    time, strain = times(stage, files)
    if strain is None:
        return [f"t = {t:.3f} s" for t in time]
    return [f"t = {t:.3f} s    shear strain {s:.3f}" for t, s in zip(time, strain)]


def title(case):
    return case.settings.get("title") or case.directory.resolve().name


def free_for(path, mark, what):
    """Raises MissingData where a file of another kind is at the path: it is not overwritten. mark: what is in the first bytes of `what`."""
    if path.is_dir():
        raise MissingData(f"{path}: is a directory; expected the name of a file")
    if path.exists():
        with path.open("rb") as file:
            if mark not in file.read(1000):
                raise MissingData(f"{path}: is there already, and is no {what}; move it, or give another --output")


def round_up(value):
    """To the next round number: the upper end of a scale of colours."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(m * power for m in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if m * power >= value * (1 - 1e-9)))
