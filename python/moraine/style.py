"""How the figures look: sizes of a journal's columns, small sans-serif type, colours that stay in order when printed in grey."""
from itertools import cycle
import logging
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

logging.getLogger("fontTools").setLevel(logging.ERROR)  # it warns of the dates in fonts

column, page = 3.4, 7.0  # inches: one column, the whole width
ink = "0.12"
sequential = matplotlib.colors.ListedColormap(plt.get_cmap("viridis")(np.linspace(0.04, 0.95, 256)))

plt.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 8, "axes.labelsize": 8, "axes.titlesize": 8, "legend.fontsize": 7,
    "xtick.labelsize": 7, "ytick.labelsize": 7, "axes.linewidth": 0.6, "xtick.major.width": 0.6, "ytick.major.width": 0.6,
    "lines.linewidth": 1.0, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "svg.fonttype": "path", "svg.hashsalt": "moraine", "pdf.fonttype": 42, "savefig.bbox": "tight", "savefig.pad_inches": 0.03,
    "figure.dpi": 100, "savefig.dpi": 160,  # of what is rasterised inside a vector figure
})


def lines(count):
    """Colour, dashes and marker for each of an ordered family of curves: light to dark, told apart in grey, too."""
    shades = plt.get_cmap("viridis_r")(np.linspace(0.12, 1.0, max(count, 2)))[:count]
    dashes = cycle(["-", (0, (5, 1.2)), (0, (2.5, 1)), (0, (5, 1, 1, 1)), (0, (1, 0.8)), (0, (7, 1, 1, 1, 1, 1))])
    markers = cycle("osD^v<>ph*")
    return [{"color": c, "linestyle": d, "marker": m} for c, d, m in zip(shades, dashes, markers)]


def panel(axes, letter):
    """(a), (b), ... above the upper left corner."""
    axes.set_title(f"({letter})", loc="left", fontweight="bold", pad=4)


def save(figure, stem, formats=("pdf", "svg", "png"), dpi=None):
    """Writes STEM.pdf, .svg, .png and closes the figure. Returns the paths. dpi: of the PNG."""
    stem = Path(stem)
    stem.parent.mkdir(parents=True, exist_ok=True)
    paths = []
    for kind in formats:
        path = stem.with_name(f"{stem.name}.{kind}")
        figure.savefig(path, dpi=dpi, metadata={"Date": None} if kind == "svg" else {"CreationDate": None} if kind == "pdf" else None)
        if kind == "png":  # 255 colours are enough, at a third of the size
            with Image.open(path) as image:
                small = image.convert("RGB").quantize(255, dither=Image.Dither.FLOYDSTEINBERG)
            small.save(path, optimize=True)
        paths.append(path)
    plt.close(figure)
    return paths
