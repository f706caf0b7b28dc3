"""The mass by the weak form: both sides of the equation of motion, averaged by smooth functions of bounded support.

Multiplied by a function phi that vanishes with its derivatives at the ends of its support, and integrated,
``m a' = F'`` holds for the averages ``<phi, a'>`` and ``<phi, F'>``: a low-pass of finite reach on both
(D. M. Bortz, D. A. Messenger and V. Dukic, Bull. Math. Biol. 85, 2023).

Functions overlap, so that their averages' errors are correlated; for white noise of the samples the covariance is
known up to a factor, and the rows are made independent with it. Directions in which the functions differ by
rounding alone are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.read_only import ReadOnlyArrays

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ORDER = 6
"""Power of the function ``(1 - s^2)^p``, ``s`` from -1 to 1: five derivatives vanish at its ends."""
HALF_WIDTH_S = 2e-3
"""Half width of the acceleration's functions: they pass one half at 400 Hz, and nothing of stress waves beyond 1200
Hz."""
PER_HALF_WIDTH = 3
"""Functions per half width: more of them tell nothing more."""
LEAST_INDEPENDENCE = 1e-6
"""Share of the largest variance below which a direction of the functions is not used."""
LEAST_ROWS = 5


@dataclass(frozen=True, eq=False)
class WeakMass(ReadOnlyArrays):
    """Mass by the weak form.

    Attributes
    ----------
    mass_kg, u_kg
        Mass and its standard uncertainty by the random errors.
    noise
        Noise of the averages' residuals: as white noise per sample of the acceleration in m/s^2, in which ringing
        beyond the functions' band is not; over what was given where a displacement was averaged.
    rows
        Independent rows.
    residuals : ndarray, shape (n_rows,)
        Residuals of independent rows, over the noise.
    sensitivities_kg : ndarray, shape (n_perturbations,)
        Amount by which the mass is too large if the force is by one of the perturbations.
    """

    mass_kg: float
    u_kg: float
    noise: float
    rows: int
    residuals: Array
    sensitivities_kg: Array


def weak_mass(
    times_s: Array,
    acceleration_m_s2: Array,
    force_n: Array,
    *,
    half_width_s: float = HALF_WIDTH_S,
    used: Flags | None = None,
    force_sigma_n: float = 0.0,
    baseline_sigma_m_s2: float = 0.0,
    perturbations_n: Array | None = None,
) -> WeakMass:
    """Estimate by averages of the acceleration on averages of the force.

    Parameters
    ----------
    times_s, acceleration_m_s2, force_n : ndarray, shape (n,)
        Evenly sampled, unfiltered.
    used : ndarray of bool, shape (n,), optional
        Functions that reach a sample that is not used are left out.
    force_sigma_n
        White noise of the force per sample; what it adds to the averages' power is taken off.
    baseline_sigma_m_s2
        White noise of the acceleration per sample in the pre-trigger baseline; the noise is no less.
    perturbations_n : ndarray, shape (n, n_perturbations), optional
        Errors that the force may have.

    Raises
    ------
    ValueError
        If shapes do not fit, or a width or noise is not a length or a noise.
    IdentificationError
        If too few functions are left, or force and acceleration have nothing in common.
    """
    used = _checked(times_s, (acceleration_m_s2, force_n), used, half_width_s, (force_sigma_n, baseline_sigma_m_s2))
    part, step_s = _around(used), float(times_s[1] - times_s[0])
    half = int(half_width_s / step_s)
    stride = max(1, half // PER_HALF_WIDTH)
    offsets_s = np.linspace(-half * step_s, half * step_s, 2 * half + 1)
    kernel = np.maximum(1.0 - (offsets_s / half_width_s) ** 2, 0.0) ** ORDER
    perturbations = np.zeros((times_s.size, 0)) if perturbations_n is None else perturbations_n
    if part.stop - part.start < kernel.size:
        return _estimate(np.zeros((0, 2)), np.zeros((0, 0)), 0.0, 0.0)
    columns = np.where(used[:, None], np.column_stack([force_n, acceleration_m_s2, perturbations]), 0.0)[part]
    whole = np.convolve(~used[part], np.ones(kernel.size), mode="valid")[::stride] < 0.5
    averages = np.column_stack([np.convolve(column, kernel, mode="valid")[::stride] for column in columns.T])[whole]
    # functions of one shape at whole strides: their products depend on how far they are apart
    products = np.convolve(kernel, kernel)[kernel.size - 1 :: stride]
    apart = np.abs(np.subtract.outer(np.flatnonzero(whole), np.flatnonzero(whole)))
    covariance = np.append(products, 0.0)[np.minimum(apart, products.size)]
    rows = _independent(covariance, averages)
    return _estimate(rows[:, :2], rows[:, 2:], baseline_sigma_m_s2, force_sigma_n)


def _checked(
    times: Array, series: tuple[Array, ...], used: Flags | None, half_width: float, noises: tuple[float, ...]
) -> Flags:
    used = np.ones(times.shape, dtype=bool) if used is None else used
    if times.ndim != 1 or times.size < 2 or any(one.shape != times.shape for one in (*series, used)):
        raise ValueError(f"times and series must be equally long, not {times.shape}, {[one.shape for one in series]}")
    if not all(np.all(np.isfinite(one[used])) for one in series):
        raise ValueError("used samples must be finite")
    if not (math.isfinite(half_width) and half_width > 2.0 * float(times[1] - times[0])):
        raise ValueError(f"half_width_s must be longer than two samples, not {half_width}")
    if not all(math.isfinite(noise) and noise >= 0 for noise in noises):
        raise ValueError(f"noises must be zero or positive, not {noises}")
    return used


def _around(used: Flags) -> slice:
    at = np.flatnonzero(used)
    return slice(int(at[0]), int(at[-1]) + 1) if at.size else slice(0, 1)


def _independent(covariance: Array, averages: Array) -> Array:
    """Turn averages into independent ones of unit variance."""
    if covariance.size == 0:
        return averages
    variances, directions = np.linalg.eigh(covariance)
    kept = variances > max(LEAST_INDEPENDENCE * float(variances[-1]), 0.0)
    return np.asarray((directions[:, kept] / np.sqrt(variances[kept])).T @ averages)


def _estimate(averages: Array, perturbations: Array, least_noise: float, force_sigma_n: float) -> WeakMass:
    if averages.shape[0] < LEAST_ROWS:
        raise IdentificationError(
            f"only {averages.shape[0]} functions of bounded support fit between the samples that can be used",
            expected=f"at least {LEAST_ROWS}",
            remedy="check for lost samples in the identification interval, or take narrower functions",
        )
    f, y = averages.T
    power = float(f @ f)
    noise_power = min(f.size * force_sigma_n**2, 0.5 * power)
    inverse = float(f @ y) / (power - noise_power)
    if not inverse > 0:
        raise IdentificationError(
            "force and motion do not go together: no positive mass relates them",
            found=f"an acceleration per force of {inverse:.3g} 1/kg",
            remedy="check areas, units and polarities in the rig file",
        )
    residual = y - inverse * f
    found = math.sqrt(float(residual @ residual) / (f.size - 1))
    noise = max(found, math.hypot(least_noise, force_sigma_n * inverse))
    # a wave that rings while the force is large is in the rows of large force
    robust = math.sqrt(float((f * residual) @ (f * residual)))
    u_inverse = max(noise * math.sqrt(power), robust) / (power - noise_power)
    over = residual / noise if noise > 0 else residual
    sensitivities = f @ perturbations / (power - noise_power) / inverse
    return WeakMass(1.0 / inverse, u_inverse / inverse**2, noise, int(f.size), over, sensitivities)
