"""How far a case is, read off its output folder alone: the run itself knows nothing of who watches."""
from collections import deque
from pathlib import Path
import time

import numpy as np

from . import results as cases, sealed, shearing
from .results import MissingData

window = 300  # s of the clock over which the pace of a run is measured


def duration(stage, height, porosity=None):
    """Of a stage, s of model time; `height`: H_0 of the bed, that when shear began, m; `porosity`: when the stage began. As
    duration_of() in src/run/stages.cpp."""
    s = stage.settings
    if s["duration"] > 0:
        return s["duration"]
    if s.get("porosity", 0) > 0:
        shrunk = (1 - porosity) / (1 - s["porosity"])  # volume at the end over that of the start
        return (1 - shrunk if stage.kind == "uniaxial" else -np.log(shrunk) / 3) / s["strain_rate"]
    return s["strain"] / abs(s["velocity"] / height if s["velocity"] else s["strain_rate"])


def readable(seconds):
    s = int(seconds)
    for unit, size, below, part in (("d", 86400, "h", 3600), ("h", 3600, "min", 60), ("min", 60, "s", 1)):
        if s >= size:
            return f"{s // size} {unit} {s % size // part} {below}"
    return f"{s} s"


class Progress:
    """`look()` from time to time; then `state` is waiting, running, silent, stopped or finished.

    Except while waiting: case, series (all rows), stage and own (its rows).
    """

    def __init__(self, directory):
        self.directory = Path(directory)
        self.output = self.directory / "output"
        self.file = self.output / "series.h5"
        if not self.file.exists() and not (self.directory / "case.toml").is_file():
            raise MissingData(f"{self.directory} is no case directory: there is no {self.directory}/case.toml")
        self.case, self.series, self.stage, self.own = None, (), None, ()
        self._stamp = None
        self._finished = 0.0, False  # as _checkpoint() returns it
        self._seen = deque()  # (clock, model time, rows), of this stage

    def look(self):
        """Reads what there is now. True if rows have come, or gone."""
        began = time.monotonic()
        for pause in (0.1, 0.2, 0.4, 0.8, None):  # files that are being written, or replaced, may be out of step for a moment
            try:
                return self._look()
            except MissingData:
                if pause is None or time.monotonic() > began + 2:
                    raise
                time.sleep(pause)

    def _look(self):
        try:
            stat = self.file.stat()
        except (FileNotFoundError, NotADirectoryError):
            before, self.case, self.series, self._stamp = self.case, None, (), None
            return before is not None
        stamp = (stat.st_ino, stat.st_size, stat.st_mtime_ns)
        if stamp == self._stamp:
            return False
        case = cases.open(self.directory)
        series = case.series
        if not len(series):
            return False
        index = int(series["stage"][-1])
        if not 0 <= index < len(case.stages):
            raise MissingData(f"{self.file}: has rows of stage {index}, but its case.toml has {len(case.stages)} stages")
        before, time_before = self.stage.index if self.case else None, self.series["time"][-1] if self.case else 0
        self.case, self.series, self.stage = case, series, case.stages[index]
        self.own = self.stage.series
        if index != before or series["time"][-1] < time_before:  # the latter after a resume
            self._seen.clear()
            self._recall()
        self._seen.append((stat.st_mtime, series["time"][-1], len(series)))
        while len(self._seen) > 2 and self._seen[1][0] < stat.st_mtime - window:
            self._seen.popleft()
        self._stamp = stamp
        return True

    def _recall(self):
        """The newest snapshot tells the pace before a second row has been seen to come."""
        files = sorted(self.output.glob(f"snapshots/{self.stage.index + 1:02d}-{self.stage.name}-*.h5"))
        try:
            clock, at = files[-1].stat().st_mtime, cases.Snapshot(files[-1]).time
        except (IndexError, OSError, MissingData):
            return
        if at < self.series["time"][-1]:
            self._seen.append((clock, at, np.count_nonzero(self.series["time"] <= at)))

    def last(self, column):
        return float(self.own[column][-1])

    @property
    def height_0(self):
        """Of the bed when the stage, or the course of shear that it goes on with, began, m."""
        return self.last("height") - self.last("dilation")

    @property
    def duration(self):
        return duration(self.stage, self.height_0, self.own["porosity"][0])

    @property
    def fraction(self):
        return min(1.0, self.last("stage_time") / self.duration)

    @property
    def strain(self):
        """In the direction that ends the stage: of shear, or axial."""
        if self.stage.kind == "uniaxial":
            return abs(self.last("dilation")) / self.height_0
        return float(shearing.along(self.stage).series["shear_strain"][-1])

    def _pace(self, what):
        """Model time (1) or rows (2) for a second of the clock; 0 if not known yet."""
        first, last = self._seen[0], self._seen[-1]
        return (last[what] - first[what]) / (last[0] - first[0]) if last[0] > first[0] else 0.0

    def left(self):
        """Seconds of the clock until the end of the stage, and of the case; none if not known yet."""
        rate = self._pace(1)
        if rate <= 0:
            return None
        since = time.time() - self._seen[-1][0]
        stage = max(0.0, (self.duration - self.last("stage_time")) / rate - since)
        later, goes_on = 0.0, self.stage.sheared
        porosity = self.stage.settings.get("porosity") or self.last("porosity")
        for other in self.case.stages[self.stage.index + 1:]:
            goes_on = goes_on and other.sheared
            height = self.height_0 if goes_on else self.last("height")
            # The time step of a stage, hence how fast it advances, goes with its f, unless the case gives dt.
            faster = 1 if self.case.settings["model"]["dt"] else other.settings["f"] / self.stage.settings["f"]
            later += duration(other, height, porosity) / (rate * faster)
            porosity = other.settings.get("porosity") or porosity
        return stage, stage + later

    def residue(self):
        """J, and relative to the energy put in: work of wall and layers, and what the grains fell. NaN without a ledger."""
        fell = self.own["potential"][0] - self.last("potential")
        put_in = sum(max(0.0, e) for e in (self.last("top_wall_work"), self.last("layers_work"), fell))
        return self.last("residue"), abs(self.last("residue")) / put_in if put_in > 0 else 0.0

    def _checkpoint(self):
        """(when written, whether it says that the case has finished)"""
        file = self.output / "checkpoint.h5"
        try:
            written = file.stat().st_mtime
            if written != self._finished[0]:  # it may be large, and must be read whole
                self._finished = written, sealed.read(file, lambda h5: bool(h5.attrs["finished"]), locking=False)
        except (MissingData, OSError):
            return 0.0, False
        return self._finished

    def silence(self):
        """Seconds since the last row, and whether that is much longer than usual."""
        row, sign = self._seen[-1][0], max(self._seen[-1][0], self._checkpoint()[0])
        usual = [3 * self.case.settings["output"]["checkpoint_interval"]]  # a run that computes writes one at least so often
        if pace := self._pace(2):
            usual.append(10 / pace)
        now = time.time()
        return now - row, now - sign > max(30.0, min(usual))

    @property
    def why_stopped(self):
        """What the run's log ends with, if the run has stopped before the end of the case; else nothing."""
        try:
            lines = (self.output / "log.txt").read_text(errors="replace").splitlines()
        except OSError:
            return ""
        return lines[-1] if lines and lines[-1].startswith("stopped: ") else ""

    @property
    def state(self):
        if self.case is None:
            return "waiting"
        steps = self.last("step")
        ends = self.stage.index == len(self.case.stages) - 1 and steps > 0  # the end falls on the nearest step
        if ends and self.last("stage_time") * (1 + 0.6 / steps) >= self.duration or self._checkpoint()[1]:
            return "finished"
        return "stopped" if self.why_stopped else "silent" if self.silence()[1] else "running"
