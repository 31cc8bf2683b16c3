"""The runs of a study, as its report reads them: runs/NAME/seed-S/CASE/..., those that have come to their end."""
from pathlib import Path

from . import shearing
from .results import Results, MissingData
from .progress import duration


class Run:
    """A case of a study and its last stage that shears, seen along the shear.

    name: of the case in study.toml, the directory below seed-S."""

    def __init__(self, case):
        self.case, self.seed = case, case.seed
        parts = case.directory.parts
        below = [k + 1 for k, part in enumerate(parts[:-1]) if part.startswith("seed-")]
        if not below:
            raise MissingData(f"{case.directory}: expected to lie below seed-S of a study")
        self.name = parts[below[-1]]
        self.stage = shearing.of(case)
        self.rows = self.stage.series
        self.settings = self.stage.settings
        self.sigma_0 = self.settings["normal_stress"]

    @property
    def height_0(self):
        return shearing.height_0(self.rows)

    @property
    def done(self):
        """Share of the stage that has been computed."""
        return min(1.0, self.rows["stage_time"][-1] / duration(self.stage, self.height_0))


def load(study, make, note):
    """[make(case)] of the runs that shear and have come to their end; the others are named. Raises MissingData where there is none."""
    runs = []
    for file in sorted(Path(study).glob("seed-*/**/output/case.toml")):
        try:
            case = Results(file.parents[1])
            if not any(s.sheared for s in case.stages):
                continue  # a bed
            run = make(case)
            if run.done < 0.999:
                raise MissingData(f"has come to {100 * run.done:.0f} % of its shear")
            runs.append(run)
        except MissingData as why:
            note(f"left out: {file.parents[1]}: {why}")
    if not runs:
        raise MissingData(f"{study}: no run has come to its end" + "".join(f"; {w}" for w in note))
    return runs


def grouped(runs, key):
    """{key(run): runs}, in the order of the keys' first run."""
    groups = {}
    for run in runs:
        groups.setdefault(key(run), []).append(run)
    return groups
