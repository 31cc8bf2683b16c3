"""Means with their intervals of 95 %, by Student's t, and whether two values agree within them."""
import numpy as np
from scipy import stats


def mean_interval(values):
    """Mean and half width of its 95 % interval; the half width is nan for a single value."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return values.mean(), np.nan
    return values.mean(), stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))


def further_run(values):
    """Half width of the interval, about their mean, that one more run falls into; nan for less than three values. The paper has one
    packing, whose values scatter as a single run's do here, however well the mean over many is known."""
    return mean_interval(values)[1] * np.sqrt(len(values) + 1) if len(values) > 2 else np.nan


def show(value, half, digits=2, unit=""):
    width = f" ± {half:.{digits}f}" if np.isfinite(half) else " (one run)"
    return f"{value:.{digits}f}{width}{unit}"


def compare(value, reference, half):
    """half: half width of the 95 % interval of their difference."""
    if not np.isfinite(half):
        return "too few runs to tell"
    if abs(value - reference) <= half:
        return "agrees"
    return "higher" if value > reference else "lower"
