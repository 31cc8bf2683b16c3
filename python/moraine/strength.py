"""Shear strength: peak and ultimate values of a sheared stage, and the Mohr-Coulomb line through several (eq. 2).

Definitions. All is read along the direction of the stage (shearing.py), over its own strain; dilation is that since shear began.
Shear friction is tau/sigma', both as measured at the same instant. Two ways to read a peak off it:
  raw       the largest value of a series with a row every 0.05 s (a strain of 0.0025), as the paper's was. Such a series is
            noisy, so this is the peak of the strength plus a few standard deviations of the noise
  smoothed  the largest mean over a shear strain of 0.02
The ultimate value is the mean over the last third of the strain. Strengths tau_p and tau_u are friction times sigma_0.
"""
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from . import paper, shearing
from .results import MissingData

window = 0.02       # of shear strain, over which the smoothed peak is a mean
late = 2 / 3        # of the strain at the end: where the ultimate state begins


@dataclass(frozen=True)
class Strength:
    peak_raw: float         # friction
    peak_raw_strain: float
    peak: float             # smoothed
    peak_strain: float      # middle of the window
    ultimate: float
    ultimate_std: float     # of the rows in the last third
    dilation: float         # mean grain diameters, mean over the last tenth of the strain
    dilation_end: float     # strain at which 95 % of that is reached, smoothed
    contraction: float      # deepest point below H_0, diameters
    strain: float           # at the end
    tau_peak_raw: float     # largest shear stress of the same rows as peak_raw, Pa


def smoothed(strain, values, width=window):
    """Means of the rows within width/2 of each; nan where the window reaches beyond the data."""
    strain, values = np.asarray(strain, float), np.asarray(values, float)
    order = np.argsort(strain, kind="stable")  # shear may go along -x, and a layer that a stress drives to and fro
    strain, values = strain[order], values[order]
    total = np.concatenate([[0], np.cumsum(values)])
    half = width / 2 * (1 + 1e-9)
    first = np.searchsorted(strain, strain - half, side="left")
    last = np.searchsorted(strain, strain + half, side="right")
    mean = (total[last] - total[first]) / (last - first)
    mean[(strain - half < strain[0] - half * 1e-6) | (strain + half > strain[-1] + half * 1e-6)] = np.nan
    as_given = np.empty_like(mean)
    as_given[order] = mean
    return as_given


def every(times, interval):
    """Indices of the rows nearest to 0, interval, 2 interval, ... A row may lie half a time step before or after its time."""
    wanted = np.arange(times[0], times[-1] + 1e-3 * interval, interval)
    return np.unique(np.searchsorted((times[1:] + times[:-1]) / 2, wanted))


def strength(stage, sampling=paper.sampling, until=None):
    """Of a sheared stage. `sampling`: seconds between the rows that the raw peak is read from; `until`: strain to stop at."""
    rows = shearing.along(stage).series
    if until is not None:
        rows = rows.rows(rows["shear_strain"] <= until)
    strain, friction, dilation = rows["shear_strain"], rows["shear_friction"], rows["dilation_diameters"]
    raw = every(rows["stage_time"], sampling)
    raw = raw[strain[raw] > 0]
    if not len(raw):
        raise MissingData(f"{rows.file}: no row {sampling:g} s after the shear began")
    top = raw[np.argmax(friction[raw])]
    mean = smoothed(strain, friction)
    best = int(np.nanargmax(mean)) if np.isfinite(mean).any() else top
    ultimate = friction[strain >= late * strain[-1]]
    final = dilation[strain >= 0.9 * strain[-1]].mean()
    change = final - dilation[0]  # of the stage: a later one begins with what earlier ones have left
    swell = np.sign(change) * (smoothed(strain, dilation) - dilation[0])
    reached = np.flatnonzero(swell >= 0.95 * np.abs(change))
    return Strength(friction[top], strain[top], mean[best] if np.isfinite(mean[best]) else friction[top], strain[best],
                    ultimate.mean(), ultimate.std(), final, strain[reached[0]] if len(reached) else np.nan,
                    dilation.min(), strain[-1], rows["shear_stress"][raw].max())


def slope(x, y, width=window):
    """dy/dx of the straight line through the rows within width/2 of each; nan where the window reaches beyond the data, or has but one place."""
    x = np.asarray(x, float)
    mean_x, mean_y = smoothed(x, x, width), smoothed(x, y, width)
    spread = smoothed(x, x * x, width) - mean_x**2
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(spread > 1e-9 * width**2, (smoothed(x, x * np.asarray(y, float), width) - mean_x * mean_y) / spread, np.nan)


@dataclass(frozen=True)
class Taylor:
    """Taylor's relation, friction = mu_cs + d eps_v / d gamma: what shear does beyond the friction of the critical state lifts the bed.
    With the height H that the bed has and the way x of its top, d eps_v / d gamma = dH/dx whatever the thickness that deforms."""
    strain: np.ndarray
    friction: np.ndarray    # smoothed
    rate: np.ndarray        # dH/dx over the same windows
    mu_cs: float            # mean of friction - dH/dx over the last third of the strain
    area: float             # of friction above mu_cs over the strain; times H_0 it is the dilation that the friction asks for, m

    @property
    def residual(self):
        """friction - mu_cs - dH/dx"""
        return self.friction - self.mu_cs - self.rate

    @property
    def at_peak(self):
        """Index of the smoothed peak, of the rows whose dilation rate is known."""
        return int(np.nanargmax(np.where(np.isfinite(self.rate), self.friction, np.nan)))


def taylor(stage):
    """Of a sheared stage, by windows as those of the smoothed peak. Raises MissingData where it is too short for one."""
    rows = shearing.along(stage).series
    strain = rows["shear_strain"]
    friction, rate = smoothed(strain, rows["shear_friction"]), slope(strain, rows["dilation"] / shearing.height_0(rows))
    late_rows = (strain >= late * strain[-1]) & np.isfinite(friction) & np.isfinite(rate)
    if not late_rows.any():
        raise MissingData(f"{rows.file}: too short for a window of {window:g} of strain")
    mu_cs = (friction - rate)[late_rows].mean()
    return Taylor(strain, friction, rate, mu_cs, np.trapz(rows["shear_friction"] - mu_cs, strain))


@dataclass(frozen=True)
class MohrCoulomb:
    phi: float          # angle of internal friction, degrees
    C: float            # cohesion, Pa
    phi_se: float       # asymptotic standard errors
    C_se: float
    points: int

    def interval(self, level=0.95):
        """Half widths of the confidence intervals of phi and C (Student's t)."""
        t = stats.t.ppf(0.5 + level / 2, self.points - 2)
        return t * self.phi_se, t * self.C_se

    def tau(self, sigma_0):
        return self.C + np.asarray(sigma_0) * np.tan(np.radians(self.phi))


def mohr_coulomb(sigma_0, tau):
    """Fits tau = C + sigma_0 tan(phi) (eq. 2) by Levenberg-Marquardt, as in par. 30. Pa. At least three points."""
    sigma_0, tau = np.asarray(sigma_0, float), np.asarray(tau, float)
    if len(np.unique(sigma_0)) < 2 or len(tau) < 3:
        raise ValueError(f"a Mohr-Coulomb line needs at least 3 points at 2 normal stresses, not {len(tau)} at "
                         f"{len(np.unique(sigma_0))}")
    scale = sigma_0.max()
    (C, phi), covariance = optimize.curve_fit(lambda s, C, phi: C + s * np.tan(phi), sigma_0 / scale, tau / scale,
                                              p0=(0.0, 0.5), method="lm")
    C_se, phi_se = np.sqrt(np.diag(covariance))
    return MohrCoulomb(np.degrees(phi), C * scale, np.degrees(phi_se), C_se * scale, len(tau))
