"""Follows a case that is running, or not yet: progress and the curves one looks at first, in the terminal and in a picture."""
import argparse
import math
import os
from pathlib import Path
import shutil
import signal
import sys
import textwrap
import time

from . import shearing
from .results import MissingData
from .progress import Progress, readable
from .textplot import plot


def arguments(parser):
    def seconds(text):
        value = float(text)
        if not 0 < value < math.inf:
            raise argparse.ArgumentTypeError(f"{text}: expected a time above 0 s")
        return value

    parser.add_argument("case", metavar="CASE", help="directory of the case")
    parser.add_argument("--interval", type=seconds, default=2, metavar="SECONDS", help="between two looks at the results (2)")
    parser.add_argument("--once", action="store_true", help="show what there is now and end")
    parser.add_argument("--time", action="store_true", help="curves of all stages against time, not of the present one")
    picture = parser.add_mutually_exclusive_group()
    picture.add_argument("--png", metavar="FILE", help="the picture that is kept up to date (CASE/output/watch.png)")
    picture.add_argument("--no-png", action="store_true", help="no picture")


def panels(kind):
    """What is drawn in a stage of this kind: (title, column, logarithmic)."""
    first = {
        "settle": ("contacts per grain", "coordination", False),
        "shear": ("shear friction", "shear_friction", False),
        "shear_stress": ("shear strain", "shear_strain", False),
    }.get(kind, ("normal stress, Pa", "normal_stress", False))
    return [first, ("dilation, diameters", "dilation_diameters", False),
            ("kinetic energy, J", "kinetic", True), ("unbalanced force", "unbalanced_force", True)]


def curves(progress, by_time):
    """The rows to draw, and name and values of x; of shear in the direction that shearing.py says. A stage driven by stress may stand
    still, so its strain is no axis."""
    stage, series = progress.stage, shearing.drawn_series(progress.series, progress.case.stages)
    if by_time:
        return series, "time, s", series["time"]
    if stage.kind == "shear":
        rows = shearing.joined(shearing.drawn(stage))
        return rows, "shear strain", rows["shear_strain"]
    own = series.rows(series["stage"] == stage.index)
    return own, "stage time, s", own["stage_time"]


def title(progress):
    return progress.case.settings.get("title") or str(progress.directory)


def status(progress, state):
    """Pieces of text, in groups that each begin a line."""
    stage, last = progress.stage, progress.last
    to = f"strain {progress.strain:.3g} of {stage.settings['strain']:.3g}" if not stage.settings["duration"] else \
        f"{last('stage_time'):.3g} s of {stage.settings['duration']:.3g} s"
    where = [f"stage {stage.name} ({stage.index + 1} of {len(progress.case.stages)})", f"{100 * progress.fraction:.1f} %", to]
    clock = [f"time {last('time'):.4g} s", f"{len(progress.series)} rows"]
    left = progress.left()
    if state == "finished":
        clock.append("finished")
    elif state == "running":
        clock.append(f"ETA {readable(left[0])}" if left else "ETA not known yet")
        if left and stage is not progress.case.stages[-1]:
            clock.append(f"all stages {readable(left[1])}")
    joules, relative = progress.residue()
    energy = f"residue {joules:.1e} J, {relative:.0e} of the energy put in" if math.isfinite(joules) else "no energy ledger"
    numbers = [f"dilation {last('dilation_diameters'):+.3f} diameters", f"porosity {last('porosity'):.3f}", energy]
    if stage.sheared:
        friction = shearing.along(stage).series["shear_friction"]
        numbers.insert(0, f"friction {friction[-1]:.3f}, peak {friction.max():.3f}")
    again = f"./moraine run {progress.directory} --resume"
    if state == "stopped":
        return [where, clock, numbers, [progress.why_stopped], [f"To go on: {again}"]]
    if state == "silent":
        since = readable(progress.silence()[0])
        return [where, clock, numbers, [f"no new row for {since}: has the run been stopped? {again}"]]
    return [where, clock, numbers]


def wrapped(pieces, width):
    lines = []
    for piece in pieces:
        if lines and len(lines[-1]) + 3 + len(piece) <= width:
            lines[-1] += "   " + piece
        else:
            lines += textwrap.wrap(piece, width)
    return lines


def view(progress, state, notes, by_time, width, height, braille):
    """Lines that fill a terminal of this size, but for its last line."""
    if progress.case is None:
        waits = f"waiting for {progress.file}: there are no rows yet; ./moraine run {progress.directory} writes them"
        return wrapped([waits], width)
    done = round(progress.fraction * min(width, 60))
    bar = ("\u2588", "\u2591") if braille else ("#", ".")
    lines = [title(progress)[:width], bar[0] * done + bar[1] * (min(width, 60) - done)]
    for pieces in status(progress, state) + [[n] for n in notes]:
        lines += wrapped(pieces, width)

    rows, x_label, x = curves(progress, by_time)
    wanted, left = panels(progress.stage.kind), height - 1 - len(lines)
    shape = {across: (width // across, left * across // len(wanted)) for across in (1, 2, 4) if across == 1 or width // across >= 28}
    across = max(shape, key=lambda a: min(shape[a][1], shape[a][0] / 3))  # the least distorted panels
    wide, high = shape[across][0], min(shape[across][1], shape[across][0] // 2)
    if high < 4:  # too low for all: as many as there is room for
        high, wanted = 4, wanted[:left // 4 * across]
    for k in range(0, len(wanted), across):
        row = [plot(t, x, rows[c], wide, high, log, x_label, braille) for t, c, log in wanted[k:k + across]]
        lines += ["".join(parts).rstrip() for parts in zip(*row)]
    return lines[:height - 1]


class Picture:
    """A PNG of the same curves. Written aside and renamed, so that a viewer never sees half of it."""

    def __init__(self, file, by_time):
        from . import style  # takes a moment to load, which --no-png saves
        self.plt, self.page, self.colour = style.plt, style.page, style.lines(2)[1]["color"]
        self.file, self.by_time, self.problem = Path(file), by_time, ""
        self._took, self._drawn, self._due = 0.0, -math.inf, False

    def follow(self, progress, new, last):
        """Draws where there is something new, yet spends a tenth of the time on it at most: the run needs the processor."""
        self._due |= new
        began = time.monotonic()
        if self.problem or not self._due or progress.case is None or not (last or began > self._drawn + 10 * self._took):
            return
        aside = self.file.with_name(f".{self.file.name}.{os.getpid()}")
        try:
            self._draw(progress, aside)
            aside.replace(self.file)
        except OSError as why:
            self.problem = f"{self.file}: cannot be written: {why.strerror or why}; going on without a picture"
        finally:
            try:
                aside.unlink(missing_ok=True)
            except OSError:
                pass  # as unwritable as the picture
        self._drawn, self._due = time.monotonic(), False
        self._took = self._drawn - began

    def _draw(self, progress, file):
        rows, x_label, x = curves(progress, self.by_time)
        figure, axes = self.plt.subplots(2, 2, figsize=(self.page, 4.6), layout="constrained")
        try:
            for ax, (name, column, log) in zip(axes.flat, panels(progress.stage.kind)):
                ax.plot(x, rows[column], color=self.colour)
                if log and (rows[column] > 0).any():
                    ax.set_yscale("log")
                ax.set(xlabel=x_label, ylabel=name)
            stage = progress.stage
            figure.suptitle(f"{title(progress)}\nstage {stage.name}, {100 * progress.fraction:.1f} %, "
                            f"time {progress.last('time'):.4g} s", fontsize=8, parse_math=False)
            figure.align_ylabels()
            figure.savefig(file, format="png", dpi=150)
        finally:
            self.plt.close(figure)


class Screen:
    """Redraws in place on a terminal; elsewhere prints each new block below the last."""

    def __init__(self, in_place):
        self.in_place = in_place
        sys.stdout.reconfigure(errors="replace")
        plain = os.environ.get("LC_ALL") in ("C", "POSIX") or os.environ.get("TERM") == "linux"  # the console has no braille
        self.braille = not plain and sys.stdout.encoding.lower().replace("-", "") == "utf8"

    def __enter__(self):
        if self.in_place:
            print("\033[?25l\033[2J", end="", flush=True)  # no cursor, empty screen
        return self

    def __exit__(self, *_):
        if self.in_place:
            print("\033[?25h", end="", flush=True)

    def show(self, lines):
        if self.in_place:
            print("\033[H" + "".join(f"{line}\033[K\n" for line in lines) + "\033[J", end="", flush=True)
        else:
            print("\n".join(lines) + "\n", flush=True)


def follow(args):
    progress = Progress(args.case)
    picture = None if args.no_png else Picture(args.png or progress.output / "watch.png", args.time)
    new, state = progress.look(), progress.state
    if args.once and state == "waiting":
        raise MissingData(f"there are no rows in {progress.file} yet; run the case first: ./moraine run {progress.directory}")
    with Screen(sys.stdout.isatty() and not args.once and state != "finished") as screen:
        shown = None
        while True:
            ends = args.once or state == "finished"
            problem = picture.problem if picture else ""
            if picture:
                picture.follow(progress, new, ends)
            notes = [picture.problem] if picture and picture.problem and (screen.in_place or not problem) else []
            if screen.in_place or new or state != shown:
                screen.show(view(progress, state, notes, args.time, *shutil.get_terminal_size(), screen.braille))
                shown = state
            if ends:
                return 0
            time.sleep(args.interval)
            new, state = progress.look(), progress.state


def run(args):
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # by way of what restores the terminal
    try:
        return follow(args)
    except BrokenPipeError:  # of ./moraine watch CASE | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
