"""The mains' harmonics in the pre-trigger baseline, by least squares with one frequency for all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.repairs.hum_line import HumLine

ABOVE_DB = 10.0
"""Level by which a line must rise over its neighbours."""
NEIGHBOURS = 8
"""Frequencies beside a line that its height is compared with."""
CHANCE = 0.001
"""Probability that noise makes as high a line, over all that are looked at."""
TOLERANCE = 0.01
"""Tolerance of the mains' frequency, relative."""
LEAST_PER_PERIOD = 5.0
"""Samples per period of the highest harmonic that is looked at."""


@dataclass(frozen=True, eq=False)
class MainsFit:
    """Lines of one mains, and how well they explain the pre-trigger baseline."""

    nominal_hz: float
    frequency_hz: float
    u_frequency_hz: float
    lines: tuple[HumLine, ...]
    misfit: float


@dataclass(frozen=True, eq=False)
class Baseline(ReadOnlyArrays):
    """The samples before the shot.

    Attributes
    ----------
    times_s, samples : ndarray, shape (n,)
        Times from their middle, and samples.
    """

    times_s: Array
    samples: Array
    rate_hz: float
    length_s: float

    def coarser(self, rate_hz: float) -> Baseline | None:
        """Return means of neighbouring samples at about a lower rate; None where that is no saving."""
        every = int(self.rate_hz / rate_hz)
        if every < 2:
            return None
        count = self.times_s.size // every
        times, samples = (a[: count * every].reshape(count, every).mean(axis=1) for a in (self.times_s, self.samples))
        return Baseline(times, samples, self.rate_hz / every, self.length_s)

    def fit(self, nominal_hz: float, harmonics: int) -> MainsFit | None:
        """Fit the harmonics of one mains that stand out; None if none does."""
        from scipy.optimize import minimize_scalar

        numbers = [k for k in range(1, harmonics + 1) if k * nominal_hz * LEAST_PER_PERIOD <= self.rate_hz]
        excess, noise = self._excess(nominal_hz, numbers, numbers)
        chosen = [k for k in numbers if _stands_out(excess[k], len(numbers))]
        if not chosen:
            return None
        variance = float(np.mean([noise[k] for k in chosen])) * self.samples.size / 4.0
        u_before = TOLERANCE * nominal_hz / math.sqrt(3.0)

        def misfit(hz: float) -> float:
            residual = self._residual(hz, chosen)
            return float(residual @ residual) / variance + ((hz - nominal_hz) / u_before) ** 2

        # beyond three times the tolerance it is no mains; within it the misfit has one valley
        reach = 3 * TOLERANCE * nominal_hz
        found = minimize_scalar(misfit, bounds=(nominal_hz - reach, nominal_hz + reach), method="bounded")
        hz = float(found.x)
        if abs(hz - nominal_hz) > 0.98 * reach:
            # the pre-trigger baseline holds waves, but not of this mains: a better frequency lies beyond
            return None
        excess, noise = self._excess(hz, chosen, numbers)
        values, covariance = self._lines(hz, chosen, noise, u_before)
        lines = [_line(k, hz, i, values, covariance, 10 * math.log10(excess[k])) for i, k in enumerate(chosen)]
        residual = self._residual(hz, chosen)
        n = residual.size
        # Schwarz's criterion: the mains with more lines in the band must not win by their number
        likelihood = n * math.log(max(float(residual @ residual), 1e-300)) + 2 * len(chosen) * math.log(n)
        u_hz = math.sqrt(covariance[-1, -1])
        return MainsFit(nominal_hz, hz, u_hz, tuple(lines), likelihood + ((hz - nominal_hz) / u_before) ** 2)

    def _design(self, hz: float, numbers: Sequence[int]) -> Array:
        angles = 2 * np.pi * hz * np.outer(self.times_s, numbers)
        drift = self.times_s / self.length_s
        return np.column_stack([np.cos(angles), np.sin(angles), np.ones_like(drift), drift])

    @cached_property
    def _waves(self) -> dict[int, NDArray[np.complex128]]:
        return {}

    def _at(self, periods: int, samples: NDArray[np.complex128]) -> complex:
        """Return the sum of samples times a wave of so many periods in the baseline, which turns back if negative."""
        wave = self._waves.get(abs(periods))
        if wave is None:
            wave = np.exp(-2j * np.pi * abs(periods) / self.length_s * self.times_s)
            self._waves[abs(periods)] = wave
        return complex(wave @ samples if periods > 0 else np.vdot(wave, samples))

    def _residual(self, hz: float, numbers: Sequence[int]) -> Array:
        q, _ = np.linalg.qr(self._design(hz, numbers))
        return np.asarray(self.samples - q @ (q.T @ self.samples))

    def _excess(
        self, hz: float, fitted: Sequence[int], numbers: Sequence[int]
    ) -> tuple[dict[int, float], dict[int, float]]:
        """Return the power of each fitted line over its neighbours', and theirs, as squared amplitudes.

        Neighbours are multiples of one over the length beside the line, at least one away from all harmonics, in
        what the fit leaves: the lines' own skirts are gone there.
        """
        design = self._design(hz, fitted)
        values = np.linalg.lstsq(design, self.samples, rcond=None)[0]
        residual = self.samples - design @ values
        n, step = len(fitted), 1.0 / self.length_s
        away = np.arange(1, 4 * NEIGHBOURS)
        away = np.concatenate([-away, away])
        excess, noise = {}, {}
        for i, k in enumerate(fitted):
            beside = k * hz + step * away
            free = np.min(np.abs(beside[:, None] - hz * np.asarray(numbers)), axis=1) > 0.49 * step
            free &= (beside > 0.75 * step) & (beside < 0.45 * self.rate_hz)
            nearest = away[free][np.argsort(np.abs(away[free]), kind="stable")][:NEIGHBOURS]
            # a neighbour's wave is the line's times one of whole periods in the baseline, which serves all lines
            shifted = np.asarray(residual * (design[:, i] - 1j * design[:, n + i]), dtype=np.complex128)
            spectrum = np.array([self._at(int(periods), shifted) for periods in nearest])
            noise[k] = float(np.mean(np.abs(spectrum) ** 2)) * 4.0 / self.samples.size**2
            power = float(values[i] ** 2 + values[n + i] ** 2)
            # 120 dB below a line nothing is measured any more
            noise[k] = max(noise[k], 1e-12 * power)
            excess[k] = power / noise[k] if power > 0 else 0.0
        return excess, noise

    def _lines(self, hz: float, chosen: Sequence[int], noise: dict[int, float], u_before: float) -> tuple[Array, Array]:
        """Return cosine and sine amplitudes, level and drift, and their covariance with the frequency's at the end."""
        design = self._design(hz, chosen)
        values = np.linalg.lstsq(design, self.samples, rcond=None)[0]
        n = len(chosen)
        slope = np.zeros(self.times_s.size)
        for i, k in enumerate(chosen):
            slope += 2 * np.pi * k * self.times_s * (values[n + i] * design[:, i] - values[i] * design[:, n + i])
        full = np.column_stack([design, slope])
        scale = np.sqrt((full**2).sum(axis=0))
        scale[scale == 0] = 1.0
        # the noise is that beside the lines: a squared amplitude of it is 4 / n of the variance of a white one
        variance = float(np.mean([noise[k] for k in chosen])) * self.samples.size / 4.0
        information = (full / scale).T @ (full / scale) / variance
        information[-1, -1] += 1.0 / (scale[-1] * u_before) ** 2
        return np.asarray(values), np.asarray(np.linalg.pinv(information) / np.outer(scale, scale))


def _stands_out(excess: float, looked_at: int) -> bool:
    """Return whether a line is beyond the limit, and beyond what chance makes of any of those looked at."""
    # scipy.stats takes half a second to import
    from scipy.special import fdtrc

    high = excess > 10 ** (ABOVE_DB / 10)
    return bool(high and fdtrc(2, 2 * NEIGHBOURS, excess) * looked_at < CHANCE)


def _line(k: int, hz: float, i: int, values: Array, covariance: Array, excess_db: float) -> HumLine:
    n = (values.size - 2) // 2
    c, s = float(values[i]), float(values[n + i])
    amplitude = math.hypot(c, s)
    own = covariance[np.ix_([i, n + i], [i, n + i])]
    along, across = np.array([c, s]) / amplitude, np.array([-s, c]) / amplitude
    return HumLine(
        harmonic=k,
        frequency_hz=k * hz,
        u_frequency_hz=k * math.sqrt(covariance[-1, -1]),
        amplitude=amplitude,
        u_amplitude=math.sqrt(float(along @ own @ along)),
        phase_rad=math.atan2(-s, c),
        u_phase_rad=math.sqrt(float(across @ own @ across)) / amplitude,
        excess_db=excess_db,
    )
