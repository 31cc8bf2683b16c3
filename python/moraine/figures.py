"""The paper's figures, by name, and the command that draws them: ./moraine figures CASE..."""
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Callable
import sys

from . import bed_figures, force_figures, measure, shearing, style, water_figures
from .results import Results, MissingData


class Selection:
    """Cases to draw, sheared ones in order of normal stress and seed; and the one that stands for all where only one is shown."""

    def __init__(self, cases):
        self.cases = [c for c in cases if any(s.sheared for s in c.stages)]
        if not self.cases:
            raise MissingData(f"{cases[0].directory}: no case with a shear stage" if cases else "no case was given")
        self.cases.sort(key=lambda c: (c.normal_stress, c.seed))
        self.one = min(self.cases, key=lambda c: abs(c.normal_stress - 80e3))  # the paper's choice for its Figs. 5 to 7, 10, 11, 13

    @property
    def alike(self):
        """All with the normal stress of the one."""
        return [c for c in self.cases if c.normal_stress == self.one.normal_stress]

    @cached_property
    def shear(self):
        return shearing.of(self.one)

    @property
    def consolidated(self):
        return shearing.mirrored(self.one.stage("consolidate").snapshots[-1], self.shear.direction)

    @property
    def sheared(self):
        return self.shear.snapshots[-1]

    @property
    def wet(self):
        """Shear stages with pore water."""
        return [s for c in self.cases for s in c.stages if s.sheared and s.wet]

    @property
    def wet_one(self):
        if not self.wet:
            raise MissingData("no case has a shear stage with pore water")
        return min(self.wet, key=lambda s: s.case is not self.one)

    @property
    def figures(self):
        """Those that concern these cases."""
        return [f for f in all_figures if self.wet or not f.wet]

    def last(self, name):
        return float(self.shear.series[name][-1])


@dataclass(frozen=True)
class Figure:
    name: str
    caption: str
    draw: Callable[[Selection], object]  # gives a Matplotlib figure
    many: bool = False  # whether it makes sense only for several normal stresses
    wet: bool = False   # whether it makes sense only with pore water


all_figures = (
    Figure("fig04-friction-dilation", "Shear friction and dilation against shear strain (the paper's Fig. 4). Lines: mean over the "
           "seeds, smoothed over a strain of 0.01; bands: from the least to the largest. Stages of shear that follow each other are drawn with their signs.",
           lambda s: bed_figures.friction_dilation(s.cases)),
    Figure("taylor", "Taylor's relation: friction (lines) against the friction of the critical state and dilation rate (dashed), means over the seeds; below, "
           "what of the friction is neither, over all runs: mean and range. Windows of 0.02 of strain.", lambda s: bed_figures.taylor(s.cases)),
    Figure("fig05-pressure", "Pressure on each grain, the sum of its normal contact forces over its surface, in units of the normal "
           "stress (Fig. 5).", lambda s: force_figures.pressure_3d(s.sheared, s.one.normal_stress)),
    Figure("fig06-force-network", "Normal forces in a vertical slice, consolidated and sheared; free grains only (Fig. 6).",
           lambda s: force_figures.force_network(s.consolidated, s.sheared)),
    Figure("force-distribution", "Distribution of contact forces and of grain pressures (par. 31).",
           lambda s: force_figures.force_distribution([s.consolidated, s.sheared], ["consolidated", "sheared"], s.one.normal_stress)),
    Figure("fig07-stereonets", "Directions of the strongest half of the normal forces, equal-angle projection of the lower "
           "hemisphere (Fig. 7). Plus: maximum compressive stress after the paper (normal stress and shear stress added).",
           lambda s: force_figures.stereonets(s.consolidated, s.sheared, s.last("shear_stress"), s.last("normal_stress"))),
    Figure("fig08-displacement", "Displacement along the shear direction at the end, slab means one grain diameter thick (Fig. 8). Dots: "
           "single grains at the lowest stress.", lambda s: bed_figures.displacement(s.cases)),
    Figure("fig09-porosity", "Porosity of horizontal slabs at the end, each sphere cut exactly (Fig. 9). The slabs at floor and "
           "top wall are left out.", lambda s: bed_figures.porosity(s.cases)),
    Figure("fig10-section", "Vertical section through the upper part of the bed at the last snapshots of the shear (Fig. 10; times above the panels): contact pressure, "
           "rotation (black arrows), velocity (white), slip at contacts (green). Grains that spin along with the shear have a black rim.",
           lambda s: force_figures.section(s.shear.snapshots[-3:], s.one.normal_stress)),
    Figure("fig11-rotation", "Rotation of each free grain since shear began, about each axis (Fig. 11). Plus: mean.",
           lambda s: bed_figures.rotations(s.sheared)),
    Figure("fig13-laboratory", "Shear stress and dilation beside what the paper's text states of real materials (Fig. 13, Table 2, par. 52).",
           lambda s: bed_figures.laboratory(s.alike)),
    Figure("fig14-mohr-coulomb", "Mohr-Coulomb lines (Fig. 14, Table 2). Circles: each run, smoothed peak and ultimate; crosses: raw peaks.",
           lambda s: bed_figures.mohr_coulomb([measure.strengths(c) for c in s.cases]), many=True),
    Figure("consolidation", "Consolidation: volumetric strain, and what is still to come of it, with exponential fits to the collapse of the "
           "loose top and to the creep after it (par. 29).", lambda s: bed_figures.consolidation(s.cases)),
    Figure("sheared-bed", "The bed, the displacement in it, its friction and its dilation.", lambda s: force_figures.sheared_bed(s.one)),
    Figure("water-shear", "Shear in water: shear stress over what grains and water together press on the wall, over what the grains alone press on "
           "it, pressure of the water in the shear zone, and dilation. Smoothed over a strain of 0.01.",
           lambda s: water_figures.shear([s.wet_one], [""]), wet=True),
    Figure("water-pressure", "Pressure of the water over hydrostatic, mean of each level of cells, with depth below the top wall and time.",
           lambda s: water_figures.pressure(s.wet_one), wet=True),
)


def draw(selection, directory, formats=("pdf", "svg", "png"), only=(), say=print):
    """Draws what can be drawn into directory/NAME.*. Returns {name: why} of those that lack data; says so, too."""
    unknown = set(only) - {f.name for f in all_figures}
    if unknown:
        raise MissingData(f"no figure {', '.join(sorted(unknown))}; there are {', '.join(f.name for f in all_figures)}")
    missing = {}
    for figure in all_figures if only else selection.figures:
        if figure.many and not only and len({c.normal_stress for c in selection.cases}) < 2:
            missing[figure.name] = "it needs cases of several normal stresses"
            say(f"{figure.name}: left out: {missing[figure.name]}")
            continue
        if only and figure.name not in only:
            continue
        try:
            style.save(figure.draw(selection), Path(directory) / figure.name, formats)
        except (MissingData, ValueError) as why:
            missing[figure.name] = str(why)
            say(f"{figure.name}: not drawn: {why}")
        else:
            say(f"{Path(directory) / figure.name}.{formats[0]}")
    return missing


def find(directories):
    """The cases in these directories: each itself, or all below it that have results."""
    cases = []
    for directory in map(Path, directories):
        if (directory / "output" / "case.toml").exists():
            cases.append(Results(directory))
            continue
        below = sorted(p.parents[1] for p in directory.rglob("output/case.toml"))
        if not below:
            cases.append(Results(directory))  # says what is wrong with it
        cases += map(Results, below)
    return cases


def arguments(parser):
    parser.add_argument("CASE", nargs="+", help="a case, or a directory with cases below it, such as CASE/sweep")
    parser.add_argument("--output", metavar="DIR", help="where they go (default: figures/ in the first directory given)")
    parser.add_argument("--format", default="pdf,png", help="of pdf, svg, png (default: %(default)s)")
    parser.add_argument("--only", default="", metavar="NAME,NAME", help="only these: " + ", ".join(f.name for f in all_figures))


def run(args):
    formats = args.format.split(",")
    if bad := set(formats) - {"pdf", "svg", "png"}:
        raise MissingData(f"--format {','.join(sorted(bad))}: expected pdf, svg or png")
    cases, early = find(args.CASE), {}
    for case in cases:
        try:
            for stage in case.stages:
                if stage.sheared:
                    stage.series
        except MissingData as why:
            early[case] = why
    if len(early) < len(cases):  # else each figure names what it lacks
        for case, why in early.items():
            print(f"left out: {why}")
        cases = [c for c in cases if c not in early]
    selection = Selection(cases)
    missing = draw(selection, args.output or Path(args.CASE[0]) / "figures", formats, [n for n in args.only.split(",") if n])
    failed = [f.name for f in all_figures if f.name in missing and not (f.many and len(cases) == 1)]
    if failed:
        print(f"not drawn, see above: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0
