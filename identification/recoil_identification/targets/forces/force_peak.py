"""Peak, its instant and impulse of a force over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_identification.targets.forces.input_estimate import InputEstimate

CURVATURE_S = 4e-4
"""Time on both sides of the peak, s: where the change of the slope is taken from."""


@dataclass(frozen=True)
class ForcePeak:
    """Peak and impulse.

    Attributes
    ----------
    time_s, u_time_s
        The uncertainty is infinite where the slope does not fall through zero.
    impulse_n_s, u_impulse_n_s
        Impulse and its standard uncertainty from the release on.
    index
        Index of the sample of largest force.
    """

    force_n: float
    u_force_n: float
    time_s: float
    u_time_s: float
    impulse_n_s: float
    u_impulse_n_s: float
    index: int


def find_peak(estimate: InputEstimate, from_s: float) -> ForcePeak:
    """Find the peak of an estimated force behind an instant, and its impulse from there on.

    The peak lies where the slope passes zero; its time is as uncertain as the slope over the curvature.

    Raises
    ------
    ValueError
        If nothing lies behind the instant.
    """
    t, f = estimate.times_s, estimate.force_n
    first = int(np.searchsorted(t, from_s))
    if first >= t.size - 1:
        raise ValueError(f"the force ends at {t[-1]} s, before {from_s} s")
    i = first + int(np.argmax(f[first:]))
    step = float(t[1] - t[0])
    reach = max(1, round(CURVATURE_S / step))
    low, high = max(first, i - reach), min(t.size - 1, i + reach)
    curvature = float((estimate.slope_n_s[high] - estimate.slope_n_s[low]) / (t[high] - t[low]))
    shift, u_time = 0.0, math.inf
    if curvature < 0:
        # the slope at the sample over the curvature, at most to the neighbours
        shift = min(max(-float(estimate.slope_n_s[i]) / curvature, -step), step)
        u_time = float(estimate.u_slope_n_s[i]) / -curvature
    return ForcePeak(
        force_n=float(f[i] + 0.5 * estimate.slope_n_s[i] * shift),
        u_force_n=float(estimate.u_force_n[i]),
        time_s=float(t[i] + shift),
        u_time_s=u_time,
        impulse_n_s=float(estimate.impulse_n_s[-1] - estimate.impulse_n_s[first]),
        u_impulse_n_s=float(estimate.u_impulse_n_s[-1]),
        index=i,
    )
