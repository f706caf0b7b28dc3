"""The errors of a regression's rows: how large they are before the shot, and what the motion adds to them.

What a model leaves of a shot is no measure of its noise: a gauge that is off leaves much, and must not be excused by
it. So the noise at rest is that of the pre-trigger baseline behind the filter, with what is proportional to what is
measured (straightness of the gauges, the mechanism's own give), a share of the acceleration at each instant. What the
motion adds is found from the shot with all that sensors may be off released
(`recoil_identification.rows.motion_noise`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.correlation import Correlation
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.equation_of_motion import PIECES, ramps
from recoil_identification.rows.motion_noise import PARTS, MotionParts
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPassFilter
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression, spaced_rows

PROPORTIONAL = 1e-3
"""Standard deviation of what is proportional to the acceleration, share of it."""
TURNING = 0.5
"""Share of a dry friction that is not known of where it turns from one direction to the other, standard deviation."""
LEAST_LEFT = 10
"""Rows beyond the released columns, for the size to mean anything."""
LEAST_PIVOT = 1e-9
"""Singular value over the largest one, of columns of length one, below which the others say the same."""
REACH = 6.0
"""Reach of the filter's kernel to either side, in periods of its cut-off."""
LEAST_NOISE_M_S2 = 1e-9
"""Noise, m/s^2, that records without any error are given."""
GAIN_POINTS = 4001
"""Points of the filter's gain, for its mean square."""


@dataclass(frozen=True, eq=False)
class RowNoise(ReadOnlyArrays):
    """Standard deviations of the errors behind a regression's filter.

    Attributes
    ----------
    rest_m_s2 : ndarray, shape (n,)
        Standard deviation of every sample of the regression's grid by the baseline, with what is proportional to the
        acceleration.
    size
        Noise by the shot over that by the baseline; 1 where there was no baseline.
    degrees_of_freedom
        Degrees of freedom with which the size is known.
    sensors_m_s2
        Part of `rest_m_s2` that is white noise of the sensors, and so correlated by the filter alone; 0 where that is
        not known.
    density
        Density of the accelerometer's part of `sensors_m_s2`, (m/s^2)^2/Hz, two-sided.
    parts
        Shapes of what the motion adds; None where nothing is added.
    sizes_m_s2 : ndarray, shape (PARTS,)
        Size of each of them.
    unexplained_share
        Size of the coloured parts together over the root mean square of the acceleration: what friction and forces are
        not as the rig says.
    """

    rest_m_s2: Array
    size: float
    degrees_of_freedom: float
    sensors_m_s2: float = 0.0
    density: float = 0.0
    parts: MotionParts | None = None
    sizes_m_s2: Array = field(default_factory=lambda: np.zeros(PARTS))
    unexplained_share: float = 0.0

    @cached_property
    def sigma_m_s2(self) -> Array:
        """Standard deviation of every sample, what the motion adds included, shape (n,)."""
        if self.parts is None:
            return self.rest_m_s2
        return np.asarray(np.sqrt(self.rest_m_s2**2 + (self.parts.shapes**2) @ self.sizes_m_s2**2))


def row_noise(regression: Regression, mass_kg: float, baseline: BaselineNoise | None = None) -> RowNoise:
    """Find the noise of a filtered regression at rest.

    Parameters
    ----------
    regression
        Regression with the columns of all shapes in which the accelerometer's zero may have shifted.
    mass_kg
        First estimate.
    baseline
        Noise of the pre-trigger baseline; without one nothing is known of it but what is proportional.
    """
    rows = spaced_rows(regression)
    level = 0.0 if baseline is None else math.hypot(baseline.slow_acceleration, baseline.slow_force / mass_kg)
    level *= math.sqrt(_mean_square_gain(regression))
    sigma = np.maximum(np.hypot(level, PROPORTIONAL * regression.acceleration_m_s2), LEAST_NOISE_M_S2)
    sigma = np.hypot(sigma, regression.turning_m_s2(TURNING, mass_kg))
    if baseline is None or not level > 0:
        return RowNoise(sigma, 1.0, _size(regression, rows, np.ones(rows.size))[1])
    size, left = _size(regression, rows, sigma[rows])
    return RowNoise(sigma, size, left, level, baseline.slow_acceleration**2 * regression.step_s)


def by_filter(regression: Regression, times_s: Array) -> Array:
    """Return the correlation of white noise behind a regression's filter at some instants, shape (n_times, n_times)."""
    apart_s = np.abs(times_s[:, np.newaxis] - times_s)
    if regression.low_pass is None:
        return np.asarray(apart_s == 0.0, dtype=np.float64)
    kernel = _Kernel.of(regression.low_pass, regression.rate_hz)
    return np.asarray(kernel.correlation(apart_s) / float(kernel.correlation(np.zeros(1))[0]))


def rest_covariance(
    regression: Regression, rows: NDArray[np.intp], noise: RowNoise, camera: CameraRows | None
) -> Array:
    """Return the covariance at rest of the motion's rows, m/s^2, and of a camera's frames after them, over their own.

    White noise behind the filter is correlated by the filter. The accelerometer's part of it is in the frames too, as
    its double integral from the onset on, and with it what makes them noisier than that. Noise that is not known to be
    white is taken for independent.

    Returns
    -------
    ndarray, shape (n_rows + n_frames, n_rows + n_frames)
    """
    n, frames = rows.size, 0 if camera is None else camera.times_s.size
    found = np.diag(np.concatenate([noise.rest_m_s2[rows] ** 2, np.ones(frames)]))
    low_pass = regression.low_pass
    if low_pass is None or not noise.sensors_m_s2 > 0:
        return found
    times_s = regression.times_s[rows]
    kernel = _Kernel.of(low_pass, regression.rate_hz)
    gain = float(kernel.correlation(np.zeros(1))[0])
    own = noise.sensors_m_s2**2 / gain
    near = kernel.correlation(np.abs(times_s[:, np.newaxis] - times_s))
    found[:n, :n] += own * (near - gain * np.eye(n))
    if camera is None:
        return found
    moving_s = np.maximum(camera.times_s - camera.onset_s, 0.0)
    own = min(noise.density, own)
    # the frames are compared with what the accelerometer read, so that its noise is taken off them
    shared = -own * kernel.integrated_twice(times_s[:, np.newaxis] - camera.onset_s, moving_s) / camera.sigma_m
    of_frames = max(own, camera.density) * walked(moving_s) / np.outer(camera.sigma_m, camera.sigma_m)
    found[:n, n:], found[n:, :n] = shared, shared.T
    found[n:, n:] += of_frames
    return found


def correlation_of(
    regression: Regression,
    rows: NDArray[np.intp],
    noise: RowNoise,
    camera: CameraRows | None,
    *,
    at_rest: Array | None = None,
    parts: Array | None = None,
) -> Correlation | None:
    """Return the correlation of the motion's rows, and of a camera's frames after them.

    Parameters
    ----------
    at_rest
        Their covariance at rest, where `rest_covariance` has found it before.
    parts
        Covariance of each part that comes with the motion for a size of one, where it is known.

    Returns
    -------
    Correlation or None
        Correlation of the rows; None for recorded signals, which have passed no filter.

    Raises
    ------
    IdentificationError
        If the rows' noise is alike to the last digits, behind a cut-off near to half the rate.
    """
    if regression.low_pass is None:
        return None
    covariance = rest_covariance(regression, rows, noise, camera) if at_rest is None else at_rest.copy()
    n = rows.size
    if noise.parts is not None and np.any(noise.sizes_m_s2):
        if parts is None:
            times_s = regression.times_s[rows]
            parts = noise.parts.covariances(times_s, rows, by_filter(regression, times_s))
        covariance[:n, :n] += np.tensordot(noise.sizes_m_s2**2, parts, 1)
    sigma = np.concatenate([noise.sigma_m_s2[rows], np.ones(len(covariance) - n)])
    try:
        return Correlation.of(covariance / np.outer(sigma, sigma))
    except np.linalg.LinAlgError as error:
        raise IdentificationError(
            "the noise of neighbouring rows cannot be told apart",
            expected="a cut-off far below half the rate",
            found=f"{regression.low_pass.cutoff_hz:.4g} Hz at {regression.rate_hz:.4g} samples/s",
            remedy="ask for a lower cut-off, or for none",
        ) from error


def walked(moving_s: Array) -> Array:
    """Return the covariance of the double integral of white noise of density one, after so long; shape (n, n)."""
    shorter, product = np.minimum.outer(moving_s, moving_s), np.multiply.outer(moving_s, moving_s)
    return (product - np.add.outer(moving_s, moving_s) * shorter / 2 + shorter**2 / 3) * shorter


@dataclass(frozen=True, eq=False)
class _Kernel(ReadOnlyArrays):
    """Response of a filter to white noise of density one.

    Attributes
    ----------
    lags_s : ndarray, shape (n,)
        Evenly spaced about zero.
    weights_per_s : ndarray, shape (n,)
        Weight of what lies that far away.
    """

    lags_s: Array
    weights_per_s: Array

    @staticmethod
    @lru_cache(maxsize=8)
    def of(low_pass: LowPassFilter, rate_hz: float) -> _Kernel:
        """Return the response of a filter at a rate; all covariances of a shot ask for one."""
        samples = math.ceil(REACH * rate_hz / low_pass.cutoff_hz)
        impulse = np.zeros(2 * samples + 1)
        impulse[samples] = rate_hz
        return _Kernel(np.arange(-samples, samples + 1) / rate_hz, low_pass.apply(impulse, rate_hz))

    def correlation(self, apart_s: Array) -> Array:
        """Return the covariance of filtered noise at instants that are so far apart, any shape."""
        lags_s, whole = self._correlation
        return np.interp(apart_s, lags_s, whole, left=0.0, right=0.0)

    @cached_property
    def _correlation(self) -> tuple[Array, Array]:
        step_s = float(self.lags_s[1] - self.lags_s[0])
        size = 2 * self.lags_s.size - 1
        whole = np.fft.irfft(np.fft.rfft(self.weights_per_s, size) ** 2, size) * step_s
        lags_s = np.asarray(step_s * (np.arange(size) - size // 2), dtype=np.float64)
        return lags_s, whole

    def integrated_twice(self, since_s: Array, moving_s: Array) -> Array:
        """Return the covariance of filtered noise with what the noise from zero on integrates to.

        It is the integral of ``g(u) (d + u)`` from -d to `since_s`, g being the kernel and d how much later the
        integral's instant is.

        Parameters
        ----------
        since_s : ndarray, shape (n_rows, 1)
            Instants of the filtered noise.
        moving_s : ndarray, shape (n_frames,)
            Time since the double integral begins, s; not negative.
        """
        step_s = float(self.lags_s[1] - self.lags_s[0])
        whole, first = (integrate(part, step_s) for part in (self.weights_per_s, self.lags_s * self.weights_per_s))
        later_s = moving_s - since_s

        def between(integral: Array) -> Array:
            up_to = np.interp(np.maximum(since_s, -later_s), self.lags_s, integral)
            return np.asarray(up_to - np.interp(-later_s, self.lags_s, integral))

        return later_s * between(whole) + between(first)


def _size(regression: Regression, rows: NDArray[np.int64], sigma: Array) -> tuple[float, float]:
    """Return the root mean square of what is left of the rows with everything released, and its degrees of freedom."""
    r = regression
    columns = [*r.forces_n.T[:-1], r.friction_direction, r.released, r.release_per_s]
    columns += [] if r.shifts is None else [*r.shifts.T]
    table = np.column_stack(columns)[rows]
    if rows.size - table.shape[1] - PIECES >= LEAST_LEFT:
        changes = ramps(r.times_s[rows], r.interval_s, PIECES)
        table = np.column_stack([table, changes * r.smooth_force_n[rows, np.newaxis]])
    table = table / sigma[:, np.newaxis]
    table = table / np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    u, sizes, _ = np.linalg.svd(table, full_matrices=False)
    spanned = u[:, sizes > LEAST_PIVOT * sizes.max()]
    response = r.acceleration_m_s2[rows] / sigma
    residual = response - spanned @ (spanned.T @ response)
    left = float(max(rows.size - spanned.shape[1], 1))
    return math.sqrt(float(residual @ residual) / left), left


def _mean_square_gain(regression: Regression) -> float:
    """Return the share of a white noise's variance that passes the regression's filter."""
    low_pass = regression.low_pass
    if low_pass is None:
        return 1.0
    nyquist_hz = 0.5 * regression.rate_hz
    frequencies_hz = np.linspace(0.0, min(10.0 * low_pass.cutoff_hz, 0.999 * nyquist_hz), GAIN_POINTS)
    squared = low_pass.gain(frequencies_hz, regression.rate_hz) ** 2
    return float(np.mean(squared)) * float(frequencies_hz[-1]) / nyquist_hz
