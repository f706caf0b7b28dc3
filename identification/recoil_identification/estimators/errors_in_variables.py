"""The mass where force and acceleration are both noisy: two corrections of the paper's regression.

Force on acceleration is low by the share of noise in the acceleration's power (W. A. Fuller, Measurement Error Models,
Wiley, 1987, section 1.1). What corrects it:

`deming_mass`
    Total least squares with a known ratio of the noises (W. E. Deming, Statistical Adjustment of Data, 1943).
`instrumental_mass`
    A third series that goes with the motion and not with the noise takes one factor's place (O. Reiersol, Arkiv
    Mat. Astr. Fys. 32A, 1945). The force some samples before and after is one: its noise is another.

All are roots of an estimating equation ``sum psi_t(m) = 0``; their uncertainty is that of the sum over its slope,
with psi's correlation in time as an autoregressive model tells it, and no less than the noise of the pre-trigger
baseline allows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.gaps import runs_of
from recoil_processing.shot.clocks.autoregressive_noise import long_run_variance

LEAST_ROWS = 20
"""Fewest rows: with less there is no telling errors that are correlated from a mass that is wrong."""


@dataclass(frozen=True)
class CorrectedMass:
    """A mass corrected for noise of its regressor.

    Attributes
    ----------
    mass_kg, u_kg
        Mass and its standard uncertainty by the random errors, correlated as they are.
    """

    mass_kg: float
    u_kg: float
    rows: int


def deming_mass(
    acceleration_m_s2: Array,
    force_n: Array,
    noise_ratio_kg: float,
    *,
    baseline_sigma_m_s2: float = 0.0,
) -> CorrectedMass:
    """Estimate by total least squares: the distances to the line are weighted by both noises.

    Parameters
    ----------
    acceleration_m_s2, force_n : ndarray, shape (n,)
    noise_ratio_kg
        Standard deviation of the force's noise over that of the acceleration's, N per m/s^2. At 0 the estimate is
        that of acceleration on force, at infinity that of force on acceleration.
    baseline_sigma_m_s2
        Noise of ``a - F / m`` per sample in the pre-trigger baseline; 0 if it is not known.

    Raises
    ------
    ValueError
        If shapes do not fit, a used sample is not finite or the ratio is negative or not a number.
    IdentificationError
        If there are too few rows, or force and acceleration have nothing in common.
    """
    a, f, pieces = _checked(acceleration_m_s2, force_n)
    if not noise_ratio_kg >= 0:
        raise ValueError(f"noise_ratio_kg must be zero or positive, not {noise_ratio_kg}")
    if math.isinf(noise_ratio_kg):
        mass = float(a @ f / (a @ a))
        return _finished(mass, f, a * (f - mass * a), float(a @ a), pieces, baseline_sigma_m_s2)
    ratio = noise_ratio_kg**2
    saa, sff, saf = float(a @ a), float(f @ f), float(a @ f)
    # positive root of  saf m^2 + (ratio saa - sff) m - ratio saf = 0, without cancellation
    middle = 0.5 * (sff - ratio * saa)
    root = math.hypot(middle, noise_ratio_kg * saf)
    mass = (middle + root) / saf if middle > 0 else ratio * saf / (root - middle)
    scores = (f - mass * a) * (ratio * a + mass * f)
    return _finished(mass, f, scores, ratio * saa + 2.0 * mass * saf - sff, pieces, baseline_sigma_m_s2)


def instrumental_mass(
    acceleration_m_s2: Array,
    force_n: Array,
    instrument: Array,
    *,
    used: Flags | None = None,
) -> CorrectedMass:
    """Estimate with an instrument: ``m = sum z F / sum z a``.

    Parameters
    ----------
    acceleration_m_s2, force_n, instrument : ndarray, shape (n,)
        The instrument z goes with the motion; its errors go with neither of the two others'.
    used : ndarray of bool, shape (n,), optional

    Raises
    ------
    ValueError
        If shapes do not fit, or a used sample is not finite.
    IdentificationError
        If there are too few rows, or force, acceleration and instrument have nothing in common.
    """
    a, f, pieces = _checked(acceleration_m_s2, force_n, used)
    z = instrument[np.ones(force_n.shape, dtype=bool) if used is None else used]
    if z.shape != a.shape or not np.all(np.isfinite(z)):
        raise ValueError("the instrument must be as long as the force and finite where it is used")
    both = float(z @ a)
    mass = float(z @ f) / both if both != 0 else math.nan
    if not mass > 0:
        raise IdentificationError(
            "the instrument does not go with the motion",
            found=f"a mass of {mass:.3g} kg",
            remedy="take an instrument that is proportional to the acceleration",
        )
    return _finished(mass, f, z * (f - mass * a), both, pieces)


def neighbouring_force(force_n: Array, lag: int) -> Array:
    """Return the mean of the force some samples before and after: an instrument, shape (n,).

    Beyond the ends the force is taken for what it is at the end.

    Parameters
    ----------
    force_n : ndarray, shape (n,)
    lag
        Samples, at least 1; beyond the correlation of the force's noise, and short against the pulse.

    Raises
    ------
    ValueError
        If the lag is not positive, or not shorter than the record.
    """
    if not 1 <= lag < force_n.size:
        raise ValueError(f"lag must be at least 1 and less than the {force_n.size} samples, not {lag}")
    before = np.concatenate([np.full(lag, force_n[0]), force_n[:-lag]])
    after = np.concatenate([force_n[lag:], np.full(lag, force_n[-1])])
    return np.asarray(0.5 * (before + after))


def _checked(
    acceleration: Array, force: Array, used: Flags | None = None
) -> tuple[Array, Array, list[tuple[int, int]]]:
    """Return the used samples, and begin and end of their pieces of consecutive ones."""
    used = np.ones(force.shape, dtype=bool) if used is None else used
    if force.ndim != 1 or not acceleration.shape == force.shape == used.shape:
        raise ValueError(
            f"acceleration, force and flags must be equally long, not {acceleration.shape}, {force.shape}, {used.shape}"
        )
    a, f = acceleration[used], force[used]
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(f))):
        raise ValueError("used samples must be finite")
    if a.size < LEAST_ROWS:
        raise IdentificationError(
            f"only {a.size} samples to estimate the mass from",
            expected=f"at least {LEAST_ROWS}",
            remedy="check for lost samples in the identification interval",
        )
    common = float(a @ f)
    if not common > 0:
        raise IdentificationError(
            "force and acceleration do not go together: no positive mass relates them",
            found=f"a sum of their products of {common:.3g} N m/s^2",
            remedy="check areas, units and polarities in the rig file",
        )
    lengths = [end - begin for begin, end in runs_of(used)]
    ends = np.cumsum(lengths).tolist()
    return a, f, [(end - length, end) for end, length in zip(ends, lengths, strict=True)]


def _finished(
    mass: float,
    f: Array,
    scores: Array,
    slope: float,
    pieces: list[tuple[int, int]],
    baseline_sigma_m_s2: float = 0.0,
) -> CorrectedMass:
    """Take the uncertainty of a root from that of the sum of its scores."""
    variance = long_run_variance([scores[begin:end] for begin, end in pieces])
    least = mass**2 * baseline_sigma_m_s2 / math.sqrt(float(f @ f))
    return CorrectedMass(mass, max(math.sqrt(variance) / abs(slope), least), f.size)
