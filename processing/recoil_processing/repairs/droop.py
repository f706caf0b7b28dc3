"""The droop of a piezoelectric chain, inverted, and what that costs.

A charge amplifier of time constant T passes ``s T / (s T + 1)``: a lasting quantity drains away. From rest the
inverse is exact, ``x = (y - rest) + integral(y - rest) / T`` (it is the high-pass's differential equation
``x' = y' + y / T``, integrated once). It trades the droop for a drift: a rest level that is off by e adds ``e t / T``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_not_negative, require_positive
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.repairs.bridged_gaps import bridge_errors
from recoil_processing.repairs.repair import Repair, RepairKind, changed


@dataclass(frozen=True, eq=False)
class DroopCorrection(ReadOnlyArrays):
    """A channel without its droop.

    Attributes
    ----------
    samples : ndarray, shape (n_samples,)
        Samples without droop, the rest level still in them; lost samples stay lost.
    u : ndarray, shape (n_samples,)
        Standard uncertainty that the correction adds, in the unit of the samples. That of the rest level,
        ``u_rest t / T``, is the same error in all of them and grows linearly.
    by_constant : ndarray, shape (n_samples,)
        Error that is left by a time constant that is too long by its standard uncertainty, with its sign.
    """

    samples: Array
    u: Array
    by_constant: Array
    repair: Repair


def invert_droop(
    samples: Array,
    step_s: float,
    time_constant_s: float,
    rest: float,
    *,
    u_time_constant_s: float = 0.0,
    u_rest: float = 0.0,
    noise: float = 0.0,
) -> DroopCorrection:
    """Undo the droop of a chain that was at rest when the record began.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples, evenly spaced; lost ones are NaN. They are bridged by straight lines for the integral, and stay lost.
    time_constant_s
        Time constant T that is declared.
    rest
        Level at rest, from the pre-trigger baseline.
    u_time_constant_s, u_rest
        Standard uncertainties of these two.
    noise
        Standard deviation of white noise of the samples; integrated it walks by ``noise sqrt(t step) / T``.

    Raises
    ------
    ValueError
        If the time constant or the step is not positive, an uncertainty is negative, the rest level is not finite,
        or none of the samples is there.
    """
    require_positive(time_constant_s=time_constant_s, step_s=step_s)
    require_not_negative(u_time_constant_s=u_time_constant_s, u_rest=u_rest, noise=noise)
    if not math.isfinite(rest):
        raise ValueError(f"rest must be finite, not {rest}")
    lost = np.isnan(samples)
    whole = bridge(samples)
    drained = integrate(whole - rest, step_s)
    corrected = samples + drained / time_constant_s
    since = step_s * np.arange(samples.size)
    by_constant = drained / time_constant_s**2 * u_time_constant_s
    variance = by_constant**2 + noise**2 * since * step_s / time_constant_s**2
    if u_rest:
        variance += (u_rest * since / time_constant_s) ** 2
    gaps = bridge_errors(whole, lost, step_s) if lost.any() else []
    for gap in gaps:
        # behind a gap the integral is off for good by what its bridge may miss
        variance[gap.first + 1 :] += (gap.error * gap.duration_s / time_constant_s) ** 2
    u = np.sqrt(variance)
    largest = float(np.max(np.abs(drained))) / time_constant_s
    sentence = (
        f"the droop of a chain of T = {time_constant_s:g} s was inverted: at most {largest:.3g} were put back, "
        f"known to {float(u[-1]):.2g} (u) at the record's end"
    )
    if gaps:
        sentence += f"; {len(gaps)} gaps were bridged for the integral and stay lost"
    figures = {
        "time_constant_s": time_constant_s,
        "u_time_constant_s": u_time_constant_s,
        "rest": rest,
        "u_rest": u_rest,
        "largest_correction": largest,
        "u_at_end": float(u[-1]),
        "drift_per_s_of_u_rest": u_rest / time_constant_s,
        "gaps": float(len(gaps)),
    }
    return DroopCorrection(
        corrected, u, by_constant, Repair(RepairKind.DROOP_CORRECTED, changed(samples, corrected), sentence, figures)
    )
