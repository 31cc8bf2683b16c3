"""Consolidation under the top wall: how fast the bed compacts (par. 29), and the inertia number of its shear (par. 28)."""
from dataclasses import dataclass

import numpy as np
from scipy import optimize


@dataclass(frozen=True)
class Decay:
    amplitude: float    # volumetric strain that is still to come when the fit begins
    time: float         # s, in which the rate falls to 1/e
    time_se: float
    final: float        # volumetric strain at the end of the decay
    begin: float        # s since the stage began: where the fit begins
    r_squared: float


def volumetric_strain(stage):
    """Time since the stage began (s) and (H_0 - H)/H_0, positive where the bed compacts."""
    rows = stage.series
    return rows["stage_time"], 1 - rows["height"] / rows["height"][0]


def exponential(time, strain, begin=0.0):
    """Fits strain = final - amplitude exp(-(t - begin)/time), whose rate decays exponentially, to the rows from `begin` on."""
    time, strain = np.asarray(time, float), np.asarray(strain, float)
    t, e = time[time >= begin], strain[time >= begin]
    if len(t) < 5:
        raise ValueError(f"an exponential needs at least 5 rows from {begin} s on, not {len(t)}")
    span = np.ptp(e) or 1.0

    def model(t, final, amplitude, rate):
        return final - amplitude * np.exp(-(t - begin) * rate)

    guess = e[-1] / span, (e[-1] - e[0]) / span, 5 / (t[-1] - begin)
    (final, amplitude, rate), covariance = optimize.curve_fit(model, t, e / span, p0=guess, method="lm", maxfev=20000)
    left = ((e / span - model(t, final, amplitude, rate))**2).sum()
    all_ = ((e / span - (e / span).mean())**2).sum()
    return Decay(amplitude * span, 1 / rate, np.sqrt(covariance[2, 2]) / rate**2, final * span, begin, 1 - left / all_)


def phases(time, strain, split=0.1):
    """The two exponentials of a bed under a light wall: the collapse of its loose top in hundredths of a second, fitted to all
    rows, and the slow creep after `split` s. Raises ValueError or RuntimeError where no such curve fits."""
    return exponential(time, strain), exponential(time, strain, split)


def inertia_number(strain_rate, radius, density, sigma_0):
    """I = gamma_dot r sqrt(rho/sigma_0), eq. 1. 1/s, m, kg/m^3, Pa."""
    return strain_rate * radius * np.sqrt(density / sigma_0)
