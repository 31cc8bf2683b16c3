"""The paper's two animations of a case, from its snapshots: ./moraine movie CASE.

grains: the bed in 3D by grain pressure, as Fig. 5. section: a vertical section with velocities, spins and slip, as Fig. 10. Each
snapshot is one frame, nothing is made up between them; colours and arrows have one scale over the whole movie.
"""
import argparse
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

from . import force_figures, frames, results, spheres
from . import section as sections
from .progress import readable
from .results import MissingData, Snapshot
from .style import ink, plt

kPa = 1e3


def pressure_scale(pressures):
    """A round upper end of the colours, kPa, which few of all grains' pressures are above."""
    return frames.round_up(np.percentile(np.concatenate(pressures), 97) / kPa)


class Picture:
    """A figure of so many pixels with the title of the case, a caption that changes, and a colour bar of pressure."""

    def __init__(self, size, title, stage, upper, colours):
        dpi = min(size[0] / 8, size[1] / 6)  # so that 8 x 6 inches have room for text of the size that figures have, whatever the pixels
        self.inches, text = np.array(size) / dpi, {"color": ink, "va": "center"}
        self.figure = plt.figure(figsize=self.inches, dpi=dpi)
        self.figure.text(0.02, 0.965, title, fontsize=9, **text)
        self.figure.text(0.02, 0.93, f"stage {stage.name}", fontsize=8, **text)
        self.caption = self.figure.text(0.98, 0.965, "", fontsize=9, ha="right", **text)
        scale = plt.cm.ScalarMappable(plt.Normalize(0, upper), colours)
        self.bar = self.figure.colorbar(scale, extend="max", cax=self.figure.add_axes([0.915, 0.25, 0.016, 0.5]))
        self.bar.set_label("grain pressure (kPa)")

    def pixels(self, caption):
        self.caption.set_text(caption)
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())


def grains(files, size, title, stage):
    """Draws one frame for each snapshot: the bed in 3D by grain pressure, fixed grains grey, under the outline of the top wall."""
    pressures, tops, heights = [], [], []
    for snapshot in map(Snapshot, files):
        g = snapshot.grains
        pressures.append(g["pressure"][g["role"] == 0])
        tops.append((g["position"][:, 2] + g["radius"]).max())
        heights.append(snapshot.top_wall)
    upper, box = pressure_scale(pressures), Snapshot(files[0]).box
    picture = Picture(size, title, stage, upper, spheres.colour_map())
    r = Snapshot(files[0]).grains["radius"].max()
    walls = [z for z in heights if np.isfinite(z) and z < 2 * max(tops)]
    corners = np.array([[a, b, z] for a in (0, box[0]) for b in (0, box[1]) for z in (0, max(tops + walls))])
    area = np.array([0.88, 0.88]) * size
    view = spheres.View(corners, np.full(8, r), at_most=area)
    axes = picture.figure.add_axes([0, 0.02, 0.88, 0.88])
    axes.set(xlim=(0, area[0]), ylim=(area[1], 0))
    axes.set_axis_off()
    shift = (area - [view.width / 2, view.height / 2]) / 2
    wall, = axes.plot([], [], color="0.3", lw=0.9, clip_on=False)
    for name, at, offset in (("x", (box[0], 0, 0), (5, -5)), ("y", (0, box[1], 0), (-6, -4))):
        (u0, v0), (u1, v1) = (np.array(view.place(np.array(p))) + shift for p in ((0, 0, 0), at))
        axes.plot([u0, u1], [v0, v1], color="0.3", lw=0.9, zorder=0)
        axes.annotate(f"{name}, {max(at):.2f} m", ((u0 + u1) / 2, (v0 + v1) / 2), offset, textcoords="offset points", fontsize=7,
                      ha="left" if offset[0] > 0 else "right", va="top")
    shown = None
    for file in files:
        snapshot = Snapshot(file)
        g = snapshot.grains
        colour = np.where((g["role"] == 0)[:, None], spheres.colours(g["pressure"] / (kPa * upper)), force_figures.fixed_grey)
        image = spheres.draw(g["position"], g["radius"], colour, view)
        if shown:
            shown.remove()
        extent = shift[0], shift[0] + image.shape[1], shift[1] + image.shape[0], shift[1]
        shown = axes.imshow(image, extent=extent, interpolation="nearest", aspect="auto", zorder=1)
        axes.set(xlim=(0, area[0]), ylim=(area[1], 0))
        z = snapshot.top_wall
        if z in walls:
            ring = np.array([[0, 0, z], [box[0], 0, z], [box[0], box[1], z], [0, box[1], z], [0, 0, z]])
            wall.set_data(np.array(view.place(ring)) + shift[:, None])
        else:
            wall.set_data([], [])
        yield picture


def section(files, size, title, stage):
    """Draws one frame for each snapshot: a vertical section along the middle of the box, with velocities, spins and slip."""
    pressures, cuts, tops = [], [], []
    first = Snapshot(files[0]).grains
    diameter = 2 * first["radius"].mean()
    for snapshot in map(Snapshot, files):
        g = snapshot.grains
        tops.append((g["position"][:, 2] + g["radius"]).max())
        pressures.append(g["pressure"][g["role"] == 0])
        cuts.append(sections.section(snapshot))
    upper, width = pressure_scale(pressures), cuts[0].width
    scales = force_figures.section_scales(cuts, diameter)
    del cuts
    picture = Picture(size, title, stage, upper, force_figures.warm)
    low, room = np.array([0.08, 0.09]), np.array([0.80, 0.74])  # of the picture
    scale = min(room * picture.inches / [width, max(tops)])  # inches per metre
    wide, tall = extent = scale * np.array([width, max(tops)]) / picture.inches
    place = [*(low + (room - extent) / 2), wide, tall]
    axes = picture.figure.add_axes(place)
    key = picture.figure.add_axes([0.03, 0.885 - 0.18 / picture.inches[1], 0.94, 0.36 / picture.inches[1]])
    force_figures.section_key(key, 1 / scale, diameter, **scales)
    for file in files:
        axes.clear()
        snapshot = Snapshot(file)
        force_figures.draw_section(axes, sections.section(snapshot), kPa, upper, diameter, **scales)
        axes.set(xlim=(0, width), ylim=(0, max(tops)), xlabel="x (m)", ylabel="z (m)")
        yield picture


kinds = {"grains": grains, "section": section}


def counted(pictures, number, what):
    """The pictures; on a terminal with a line that says how many are done and how long the rest will take."""
    began, live = time.monotonic(), sys.stderr.isatty()
    for k, picture in enumerate(pictures):
        yield picture
        if live:
            left = (time.monotonic() - began) / (k + 1) * (number - k - 1)
            print(f"\r{what}: frame {k + 1} of {number}  ETA {readable(left)} \033[K", end="", file=sys.stderr, flush=True)
    if live:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def encode(images, path, size, fps, title):
    """Writes RGBA images as an MP4, made aside and then renamed, so that a movie of before stays until there is a new one."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    command = ["ffmpeg", "-nostdin", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{size[0]}x{size[1]}",
               "-r", f"{fps:g}", "-i", "pipe:0", "-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p",
               "-movflags", "+faststart", "-metadata", f"title={title}", "-f", "mp4", str(aside)]
    with tempfile.TemporaryFile() as words:
        ffmpeg = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=words)
        try:
            try:
                for image in images:
                    ffmpeg.stdin.write(image.tobytes())
                ffmpeg.stdin.close()
            except BrokenPipeError:  # it says why
                pass
            if ffmpeg.wait():
                words.seek(0)
                said = words.read().decode(errors="replace").strip().splitlines() or [f"ended with {ffmpeg.returncode}"]
                raise MissingData(f"{path}: ffmpeg failed: {said[0]}")
            aside.replace(path)
        finally:
            if ffmpeg.poll() is None:
                ffmpeg.kill()
                ffmpeg.wait()
            aside.unlink(missing_ok=True)


def make(case, kind, path, stage=None, fps=10, size=(1280, 960)):
    """Writes a movie of kind "grains" or "section" of a case (moraine.open) to path. Returns the number of frames."""
    frames.free_for(path, b"ftyp", "MP4")
    stage, files = frames.snapshots(case, stage, 2, "a movie")
    texts, title = frames.captions(stage, files), frames.title(case)
    drawn = counted(kinds[kind](files, size, title, stage), len(files), kind)
    try:
        encode((picture.pixels(text) for picture, text in zip(drawn, texts)), path, size, fps, title)
    finally:
        plt.close("all")
    return len(files)


def arguments(parser):
    def rate(text):
        value = float(text)
        if not 0.1 <= value <= 120:
            raise argparse.ArgumentTypeError(f"{text}: expected 0.1 to 120 frames a second")
        return value

    def pixels(text):
        width, height = (int(n) for n in text.split("x"))
        if not (320 <= width <= 7680 and 240 <= height <= 4320) or width % 2 or height % 2:
            raise argparse.ArgumentTypeError(f"{text}: expected even numbers from 320x240 to 7680x4320")
        return width, height

    rate.__name__, pixels.__name__ = "number", "size, WIDTHxHEIGHT,"  # as argparse puts them into its messages
    parser.add_argument("case", metavar="CASE", help="directory of the case")
    parser.add_argument("--only", choices=list(kinds), help="one of the two movies (default: both)")
    parser.add_argument("--stage", metavar="NAME", help="the stage to show (default: the last that shears)")
    parser.add_argument("--fps", type=rate, default=10, metavar="N", help="snapshots shown in a second (default: %(default)g)")
    parser.add_argument("--size", type=pixels, default=(1280, 960), metavar="WxH", help="of the picture (default: 1280x960)")
    parser.add_argument("--output", metavar="DIR", help="where they go (default: CASE/figures)")


def run(args):
    case = results.open(args.case)
    if not shutil.which("ffmpeg"):
        raise MissingData("there is no ffmpeg on the PATH, which makes the movies; install it (Debian: apt-get install ffmpeg)")
    directory = Path(args.output or case.directory / "figures")
    if directory.exists() and not directory.is_dir():
        raise MissingData(f"{directory}: is a file; expected a directory for the movies")
    directory.mkdir(parents=True, exist_ok=True)
    for kind in [args.only] if args.only else kinds:
        path = directory / f"{kind}.mp4"
        number = make(case, kind, path, args.stage, args.fps, args.size)
        print(f"{path}: {number} frames, {number / args.fps:.3g} s, {path.stat().st_size / 1e6:.2g} MB")
