"""Curves made of characters: 2 x 4 dots of braille to each, or plain ASCII where the terminal has no braille."""
import numpy as np

_dots = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # of U+2800
_gutter = 9  # characters left of the curve, for its limits


def _polyline(columns, rows):
    """All dots on the way from each point to the next."""
    a, b = np.diff(columns), np.diff(rows)
    steps = np.maximum(np.maximum(abs(a), abs(b)), 1)
    along = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
    way = along / np.repeat(steps, steps)
    trace = [np.rint(np.repeat(start[:-1], steps) + way * np.repeat(d, steps)) for start, d in ((columns, a), (rows, b))]
    return [np.append(t, end[-1]).astype(int) for t, end in zip(trace, (columns, rows))]


def _scaled(values, low, high, dots):
    return np.rint((values - low) / (high - low) * (dots - 1)).astype(int) if high > low else np.full(len(values), dots // 2)


def _cells(x, y, width, height, braille):
    grid = np.zeros((4 * height, 2 * width), bool)
    columns, rows = _polyline(_scaled(x, x.min(), x.max(), 2 * width), _scaled(y, y.min(), y.max(), 4 * height))
    grid[4 * height - 1 - rows, columns] = True
    cells = grid.reshape(height, 4, width, 2).transpose(0, 2, 1, 3)
    if braille:
        codes = 0x2800 + (cells * _dots).sum(axis=(2, 3))
        return ["".join(map(chr, line)) for line in codes]
    return ["".join(" '.:"[int(c[:2].any()) + 2 * int(c[2:].any())] for c in line) for line in cells]


def plot(title, x, y, width, height, log=False, x_label="", braille=True):
    """`height` lines of `width` characters: title with the newest value, curve with its limits, limits and name of x."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    shown = np.isfinite(x) & np.isfinite(y) & ((y > 0) if log else True)
    newest = f"{y[-1]:.3g}" if len(y) and np.isfinite(y[-1]) else "-"
    head = f"{title}  {newest}"[:width - 1]
    x, y = x[shown] + 0.0, y[shown] + 0.0  # no -0
    inner, rows = width - _gutter - 1, height - 2
    if not len(y) or inner < 4 or rows < 1:
        lines = [head] + [""] * (height - 1)
    else:
        curve = _cells(x, np.log10(y) if log else y, inner, rows, braille)
        limits = [f"{y.max():.3g}"] + [""] * (rows - 2) + [f"{y.min():.3g}"] * (rows > 1)
        low, high = f"{x.min():.3g}", f"{x.max():.3g}"
        x_label = x_label if len(low + x_label + high) + 2 <= inner else ""
        foot = low + x_label.center(inner - len(low) - len(high)) + high
        bar = "\u2502" if braille else "|"
        lines = [head]
        lines += [f"{limit:>{_gutter - 1}}{bar}{line}" for limit, line in zip(limits, curve)]
        lines += [f"{'log ' if log else '':>{_gutter}}{foot}"]
    return [line[:width].ljust(width) for line in lines]
