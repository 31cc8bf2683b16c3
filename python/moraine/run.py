"""A run in this process: stepped, read as NumPy arrays, and steered on the way.

    with moraine.Run("my-bed") as run:
        run.every(1000, lambda run: print(run.stage, run.time, run.latest["shear_friction"]))
        while run.stage != "shear":
            run.step(1000)
        run.set("normal_stress", "40 kPa")        # from this step on
        run.finish()

The bits are those of `moraine run`. Results go to CASE/output as they do there, and can be opened meanwhile with moraine.open.
"""
from __future__ import annotations

import operator
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

try:
    from . import _core
except ImportError as why:
    raise ImportError("moraine.Run and moraine.Case need the compiled part of the package, which is not built here: "
                      f"pip install . in the folder of the sources, in a virtual environment ({why})") from None

if TYPE_CHECKING:
    import numpy as np

Error = _core.Error
Value = float | int | str  # a number in SI units, or a text with a unit


class Run:
    """The case in `directory`, opened to be run here.

    set: keys and values in place of those in case.toml, as with `--set`. backend: "auto", "cpu" or "cuda". threads: 0 for all cores.
    resume: go on from the checkpoint that an earlier run has left. force: replace the results of an earlier run.
    keep_events: a run that is resumed meets the changes that were made after its checkpoint again, at their steps; False leaves them out.

    Raises moraine.Error, with the program's words. While a run is open no other may write to the same results, in any process.
    """

    def __init__(self, directory: str | os.PathLike, *, set: Mapping[str, Value] | None = None, backend: str = "auto",
                 threads: int = 0, resume: bool = False, force: bool = False, keep_events: bool = True):
        self.directory = Path(directory)
        pairs = [(key, _text(value)) for key, value in (set or {}).items()]
        self._run = _core.Run(self.directory.absolute(), pairs, backend, threads, resume, force, not keep_events)
        self._callbacks: list[tuple[int, Callable[[Run], object]]] = []
        self._calling = False

    # Steps.

    def step(self, steps: int = 1) -> int:
        """Advances so many steps, but not beyond the end of the stage, and returns how many that were.

        Where a stage ends the next one begins at once, so that `stage` is then the next one's name; the last stage stays. With pore
        water a run stops at steps at which grains and water meet, so it may go some steps further. Callbacks are called on the way.
        Control-C writes a checkpoint and raises KeyboardInterrupt; the run may then go on.
        """
        steps = _count("step", steps, "0 steps")
        if self._calling:
            raise Error("step: called from a callback of this run, which is in the middle of a step; expected it after that")
        self._run.begin_stage()  # where an interrupted one has ended
        first, stage, done = self.step_number, self.stage_index, 0
        while done < steps and not self.finished and self.stage_index == stage:
            at = first + done
            until = min([first + steps, *((at // every + 1) * every for every, _ in self._callbacks)])
            done += self._run.step(until - at)
            if self.stage_index == stage:
                self._call(at, first + done)
        return done

    def finish(self, progress: bool = True) -> None:
        """Runs the case to its end, with a progress bar unless `progress` is False."""
        bar = _Bar(self) if progress and not self.finished else None
        try:
            while not self.finished:
                self.step(self._run.steps if bar is None else bar.slice())
                if bar:
                    bar.show()
        finally:
            if bar:
                bar.close()

    def every(self, steps: int, callback: Callable[[Run], object]) -> None:
        """Calls callback(run) at each multiple of so many steps of a stage, or with pore water at the first exchange after it.

        It may read everything, and change loads with `set`. It is not called when a stage begins, nor at the last step of one that another
        follows, as that has begun by then. What it raises ends the step that it is called from; the run stays open.
        """
        if not callable(callback):
            raise Error(f"every({steps}, {callback!r}): expected a function that takes the run")
        self._callbacks.append((_count("every", steps, "1 step"), callback))

    def _call(self, before: int, now: int) -> None:
        self._calling = True
        try:
            for every, callback in list(self._callbacks):  # one may add another
                if now // every > before // every:
                    callback(self)
        except KeyboardInterrupt:  # as in the steps themselves
            self.checkpoint()
            raise
        finally:
            self._calling = False

    def set(self, load: str, value: Value) -> None:
        """From this step on a load is another: normal_stress, shear_stress (Pa), velocity (of the top layer, m/s), top_pressure or
        bottom_pressure (of the water, Pa).

        value: a number in SI units or a text with a unit. The change is an event: it stands in the checkpoint, in output/events.csv and in
        the log, so that the run may be resumed and replayed (`moraine replay`) with the same bits. Raises moraine.Error where the load does
        not drive the present stage.
        """
        self._run.set(load, _text(value))

    def checkpoint(self) -> None:
        """Writes a checkpoint now, beside those that are written as the case asks for."""
        self._run.checkpoint()

    def close(self) -> None:
        """Lets go of the results. What has been computed since the last checkpoint is computed again where the run is resumed."""
        self._run.close()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *what) -> None:
        self.close()

    # Where the run is.

    @property
    def stage(self) -> str:
        """Name of the present stage"""
        return self._run.stage

    @property
    def stages(self) -> list[str]:
        """Names of all stages"""
        return self._run.stages

    @property
    def kind(self) -> str:
        """Of the present stage: settle, consolidate, shear ..."""
        return self._run.kind

    @property
    def stage_index(self) -> int:
        """Of the present stage, from 0"""
        return self._run.stage_index

    @property
    def step_number(self) -> int:
        """Steps since the stage began"""
        return self._run.step_number

    @property
    def steps(self) -> int:
        """Of the whole stage, with the present time step"""
        return self._run.steps

    @property
    def dt(self) -> float:
        """Time step, s"""
        return self._run.dt

    @property
    def time(self) -> float:
        """s, since the case began"""
        return self._run.time

    @property
    def stage_time(self) -> float:
        """s, since the stage began"""
        return self._run.stage_time

    @property
    def finished(self) -> bool:
        """Whether the case has come to its end"""
        return self._run.finished

    @property
    def latest(self) -> dict[str, float]:
        """The latest row of the series, by column, in SI units (as in series.h5)"""
        return self._run.latest()

    @property
    def events(self) -> list[tuple[str, int, str, float]]:
        """Loads that were changed so far: stage, step, key, value in SI"""
        return self._run.events()

    # The bed.

    @property
    def grains(self) -> _core.Grains:
        """The grains at the present step, as read-only arrays, which stay as they are when the run goes on.

        They stand in memory order: row k is grain grains.ids[k]."""
        return self._run.grains()

    @property
    def bed(self) -> _core.Bed:
        """The same with contacts, pressures and pore water, which takes some ten times as long to read."""
        return self._run.bed()

    @property
    def ids(self) -> np.ndarray:
        """Of the grains, n: their rows in snapshots"""
        return self.grains.ids

    @property
    def radii(self) -> np.ndarray:
        """m, n"""
        return self.grains.radii

    @property
    def positions(self) -> np.ndarray:
        """m, n x 3; a grain that has left by a periodic side is not taken back"""
        return self.grains.positions

    @property
    def velocities(self) -> np.ndarray:
        """m/s, n x 3, half a step before the positions"""
        return self.grains.velocities

    @property
    def spins(self) -> np.ndarray:
        """rad/s, n x 3, half a step before the positions"""
        return self.grains.spins

    @property
    def pressures(self) -> np.ndarray:
        """Of the grains, Pa, n"""
        return self.bed.pressures

    @property
    def water_pressures(self) -> np.ndarray | None:
        """Of the cells of the pore water, Pa over hydrostatic, n_z x n_y x n_x; None in a dry stage"""
        return self.bed.water_pressures

    def __repr__(self) -> str:
        return f"Run({str(self.directory)!r}: stage {self.stage}, step {self.step_number} of {self.steps})"


def _count(call: str, value: int, least: str) -> int:
    """A number of steps, at least so many."""
    try:
        number = operator.index(value)  # also of NumPy
    except TypeError:
        number = -1
    if number < int(least.split()[0]):
        raise Error(f"{call}({value!r}): expected {least} or more, a whole number")
    return min(number, 2**62)


def _text(value: Value) -> str:
    """As `--set` takes it."""
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    return str(value)


class _Bar:
    """Progress of a run on a terminal or in a notebook, over all stages; a stage counts by its steps."""

    def __init__(self, run: Run):
        from tqdm.auto import tqdm
        self.run, self.stage = run, None
        self.tqdm, self.bar = tqdm, None
        self.show()

    def slice(self) -> int:
        """Steps until the bar is looked at again."""
        return max(1, self.run.steps // 500)

    def show(self) -> None:
        run = self.run
        if self.stage != run.stage_index:
            self.close()
            self.stage = run.stage_index
            self.bar = self.tqdm(desc=run.stage, total=run.steps, initial=run.step_number, unit="step", unit_scale=True)
        self.bar.total = run.steps
        self.bar.n = run.step_number
        self.bar.refresh() if run.finished else self.bar.update(0)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.n = self.bar.total if self.run.stage_index != self.stage or self.run.finished else self.bar.n
            self.bar.refresh()
            self.bar.close()
