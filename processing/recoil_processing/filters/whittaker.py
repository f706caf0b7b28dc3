"""Whittaker's smoother of order 3: the smoothest record that is still near the samples, each by its weight.

It minimises ``sum w (y - z)^2 + lambda sum (d3 z)^2`` with d3 the third differences (E. T. Whittaker, "On a new
method of graduation", Proc. Edinburgh Math. Soc. 41, 1922; P. H. C. Eilers, "A perfect smoother", Anal. Chem.
75, 2003). Far from the ends it is a zero-phase low-pass; at the ends and over gaps it goes on as a parabola,
without padding and without a bridge. For short records and lossy ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.zero_phase_filter import (
    HALF_POWER,
    FilterDescription,
    check_below_nyquist,
    check_cutoff,
    check_finite,
    check_shape,
)
from recoil_processing.gaps import near

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ORDER = 3
"""Of the differences; a parabola passes unchanged, whatever the cut-off and the weights."""
LARGEST_PENALTY = 1e12
"""Over the largest weight; beyond it double precision no longer solves the equations."""
_STENCIL = np.array([-1.0, 3.0, -3.0, 1.0])
_TIME_CONSTANTS = 4.0
_REFINEMENTS = 3


@dataclass(frozen=True)
class WhittakerLowPass:
    """A Whittaker smoother of order 3.

    Attributes
    ----------
    cutoff_hz : float
        -3 dB point for even sampling and unit weights, far from the ends: there the amplitude is
        ``1 / (1 + lambda (2 sin(pi f / rate))^6)``. The penalty lambda follows from it and the rate.

    Raises
    ------
    ValueError
        If the cut-off is not positive and finite.
    """

    cutoff_hz: float

    def __post_init__(self) -> None:
        check_cutoff(self.cutoff_hz)

    def penalty(self, rate_hz: float) -> float:
        """Return lambda for a sampling rate.

        Raises
        ------
        ValueError
            If the cut-off is not below the Nyquist frequency, or so far below it that the equations cannot
            be solved in double precision.
        """
        check_below_nyquist(self.cutoff_hz, rate_hz)
        penalty = (1.0 / HALF_POWER - 1.0) / (2.0 * math.sin(math.pi * self.cutoff_hz / rate_hz)) ** (2 * ORDER)
        if penalty > LARGEST_PENALTY:
            root = 0.5 * ((1.0 / HALF_POWER - 1.0) / LARGEST_PENALTY) ** (1.0 / (2 * ORDER))
            least_hz = rate_hz / math.pi * math.asin(root)
            raise ValueError(
                f"at {rate_hz:g} samples/s a Whittaker smoother can be solved for cut-offs from {least_hz:.3g} Hz, "
                f"not {self.cutoff_hz:g} Hz; take a LowPass, or thin the record first"
            )
        return penalty

    def reach_samples(self, rate_hz: float) -> int:
        """How far a sample spreads to either side: beyond, under 1 % is left of a disturbance that lasts.

        Four time constants of the slowest root, see `_slowest`.
        """
        return math.ceil(_TIME_CONSTANTS / -math.log(self._slowest(rate_hz)))

    def memory_samples(self, rate_hz: float, tolerance: float) -> int:
        """Return how far a sample has an influence above a tolerance, see `recoil_processing.filters.filter_blocks`."""
        return math.ceil(math.log(tolerance / 100.0) / math.log(self._slowest(rate_hz)))

    def _slowest(self, rate_hz: float) -> float:
        """Magnitude of the slowest root within the unit circle of ``1 + lambda (2 - z - 1/z)^3``."""
        angles = np.pi * (2 * np.arange(ORDER) + 1) / ORDER
        middle = 2.0 - self.penalty(rate_hz) ** (-1.0 / ORDER) * np.exp(1j * angles)
        split = np.sqrt(middle**2 - 4.0)
        roots = np.concatenate([(middle + split) / 2.0, (middle - split) / 2.0])
        sizes = np.abs(roots)
        return float(np.max(sizes[sizes < 1.0]))

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude far from the ends, any shape, at a sampling rate or in the limit of high rates."""
        if rate_hz is None:
            ratio = frequency_hz / self.cutoff_hz
        else:
            check_below_nyquist(self.cutoff_hz, rate_hz)
            ratio = np.sin(np.pi * frequency_hz / rate_hz) / math.sin(math.pi * self.cutoff_hz / rate_hz)
        return np.asarray(1.0 / (1.0 + (1.0 / HALF_POWER - 1.0) * ratio ** (2 * ORDER)))

    def apply(self, samples: Array, rate_hz: float, weights: Array | None = None) -> Array:
        """Smooth samples along their first axis.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
            Finite where their weight is not zero.
        rate_hz : float
        weights : ndarray, shape (n_samples,), optional
            Of the samples, inverse to their variances; 1 by default. At weight w the cut-off is that of the
            penalty ``lambda / w``.

        Returns
        -------
        ndarray of float64, same shape
            A new array, with a value for every sample, those of weight zero among them.

        Raises
        ------
        ValueError
            If the cut-off does not suit the rate, a sample of positive weight is not finite, the weights are
            negative, not finite or not one for each sample, or fewer than three are positive.
        """
        check_shape(samples)
        penalty = self.penalty(rate_hz)
        count = samples.shape[0]
        if weights is None:
            check_finite(samples)
            used = np.ones(count)
        else:
            used = np.asarray(weights, dtype=np.float64)
            if used.shape != (count,) or not np.all(np.isfinite(used) & (used >= 0)):
                raise ValueError(f"weights must be {count} finite numbers of at least 0, one for each sample")
            if count and np.count_nonzero(used) < min(ORDER, count):
                raise ValueError(f"{np.count_nonzero(used)} of {count} samples have a weight; {ORDER} are needed")
        known = np.where((used > 0).reshape((-1,) + (1,) * (samples.ndim - 1)), samples, 0.0)
        check_finite(known)
        if count <= ORDER:
            # a parabola goes through them all
            return known
        return _smoothest(known, used, penalty)

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Smooth a channel with missing samples, which get no weight.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,)
            Missing ones are NaN.
        rate_hz : float

        Returns
        -------
        filtered : ndarray of float64, shape (n_samples,)
            In gaps the parabola that the neighbours go on as.
        trusted : ndarray of bool, shape (n_samples,)
            False within the filter's reach of a missing sample: there the smoother differs from that of the
            other channels, and no longer commutes with anything.

        Raises
        ------
        ValueError
            If fewer than three samples are there, one is infinite, or as in `apply`.
        """
        missing = np.isnan(samples)
        if not missing.any():
            return self.apply(samples, rate_hz), np.ones(samples.shape, dtype=bool)
        if np.count_nonzero(~missing) < ORDER:
            raise ValueError(f"{np.count_nonzero(~missing)} of {samples.size} samples are there; {ORDER} are needed")
        filtered = self.apply(samples, rate_hz, (~missing).astype(np.float64))
        return filtered, ~near(missing, self.reach_samples(rate_hz))

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is, see `recoil_processing.filters.zero_phase_filter.FilterDescription`."""
        wider = (1.0 / HALF_POWER - 1.0) ** (-1.0 / (2 * ORDER))
        parameters = {}
        half_hz: float | None = wider * self.cutoff_hz
        if rate_hz is not None:
            sine = wider * math.sin(math.pi * self.cutoff_hz / rate_hz)
            half_hz = rate_hz / math.pi * math.asin(sine) if sine <= 1.0 else None
            parameters["penalty"] = self.penalty(rate_hz)
        return FilterDescription("whittaker", ORDER, 1, self.cutoff_hz, half_hz, "none", 0.0, rate_hz, parameters)


def _smoothest(samples: Array, weights: Array, penalty: float) -> Array:
    """Solve ``(W + lambda D'D) z = W y`` by Cholesky's decomposition of its seven diagonals, refined."""
    from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

    largest = float(weights.max())
    weight, stiffness = weights / largest, penalty / largest
    bands = np.zeros((ORDER + 1, weights.size))
    bands[0] = weight
    rows = weights.size - ORDER
    for j in range(ORDER + 1):
        for k in range(j, ORDER + 1):
            bands[k - j, j : j + rows] += stiffness * _STENCIL[j] * _STENCIL[k]
    try:
        factor = cholesky_banded(bands, lower=True, check_finite=False)
    except LinAlgError as error:
        raise ValueError(
            "the smoother has no solution in double precision: its gaps are too long for its cut-off; filter the "
            "parts between them each by itself"
        ) from error
    shaped = weight.reshape((-1,) + (1,) * (samples.ndim - 1))
    smooth = np.asarray(cho_solve_banded((factor, True), shaped * samples, check_finite=False), dtype=np.float64)
    for _ in range(_REFINEMENTS):
        # differences of the smooth record are exact to its own digits, those of the assembled matrix are not
        rest = shaped * (samples - smooth) - stiffness * _bent(np.diff(smooth, ORDER, axis=0))
        smooth += cho_solve_banded((factor, True), rest, check_finite=False)
    return smooth


def _bent(differences: Array) -> Array:
    """Apply the transpose of the third differences, shape (n - 3, ...) to (n, ...)."""
    margin = [(ORDER, ORDER)] + [(0, 0)] * (differences.ndim - 1)
    return np.asarray(-np.diff(np.pad(differences, margin), ORDER, axis=0), dtype=np.float64)
