"""The errors of a regression's rows: how large they are before the shot, and whether they are larger in it.

What a model leaves of a shot is no measure of its noise: a gauge that is off leaves much, and must not be excused by
it. So the noise is that of the pre-trigger baseline behind the filter, and for the rest, which is proportional to what
is measured (straightness of the gauges, the mechanism's own give), a share of the acceleration at each instant. Only
its size as a whole is taken from the shot, with every scale, the friction, zero shifts and a mass that changes
released, and between narrow limits (restricted maximum likelihood).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.camera_rows import CameraRows
from recoil_identification.equation_of_motion import PIECES, ramps
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression, spaced_rows

Array = NDArray[np.float64]

PROPORTIONAL = 1e-3
"""Standard deviation of what is proportional to the acceleration, share of it."""
LEAST_SIZE, LARGEST_SIZE = 0.9, 2.0
"""Limits between which the shot tells the size of the noise, over that of the baseline."""
SLOWER = 0.25
"""Of the cut-off, behind which the force tells how a mass that changes would be felt."""
LEAST_LEFT = 10
"""Rows beyond the released columns, for the size to mean anything."""
LEAST_PIVOT = 1e-9
"""Singular value over the largest one, of columns of length one, below which the others say the same."""
REACH, PER_PERIOD = 6.0, 20.0
"""Of the filter's kernel to either side, in periods of its cut-off, and cells in one of these."""
LEAST_NOISE_M_S2 = 1e-9
"""For records without any error."""
GAIN_POINTS = 4001
"""Of the filter's gain, for its mean square."""


@dataclass(frozen=True, eq=False)
class RowNoise(ReadOnlyArrays):
    """Standard deviations of the errors behind a regression's filter.

    Attributes
    ----------
    sigma_m_s2 : ndarray, shape (n,)
        Of every sample of the regression's grid.
    size
        What the shot says of the noise over what the baseline does, before the limits; 1 where there was no baseline.
    degrees_of_freedom
        With which the size is known.
    sensors_m_s2
        What of it is white noise of the sensors, and so correlated by the filter alone; 0 where that is not known.
    density
        Of the accelerometer's part of that, (m/s^2)^2/Hz, two-sided.
    """

    sigma_m_s2: Array
    size: float
    degrees_of_freedom: float
    sensors_m_s2: float = 0.0
    density: float = 0.0


def row_noise(regression: Regression, mass_kg: float, quiet: BaselineNoise | None = None) -> RowNoise:
    """Find the noise of a filtered regression.

    Parameters
    ----------
    regression
        With the columns of all shapes in which the accelerometer's zero may have shifted.
    mass_kg
        First estimate.
    quiet
        Noise of the pre-trigger baseline; without one the shot alone tells the noise.
    """
    rows = spaced_rows(regression)
    level = 0.0 if quiet is None else math.hypot(quiet.slow_acceleration, quiet.slow_force / mass_kg)
    level *= math.sqrt(_mean_square_gain(regression))
    if quiet is None or not level > 0:
        size, left = _size(regression, rows, np.ones(rows.size))
        return RowNoise(np.full(regression.times_s.size, max(size, LEAST_NOISE_M_S2)), 1.0, left)
    sigma = np.hypot(level, PROPORTIONAL * regression.acceleration_m_s2)
    size, left = _size(regression, rows, sigma[rows])
    limited = min(max(size, LEAST_SIZE), LARGEST_SIZE)
    density = (limited * quiet.slow_acceleration) ** 2 * regression.step_s
    return RowNoise(limited * sigma, size, left, limited * level, density)


def correlation_root(
    regression: Regression, rows: NDArray[np.intp], noise: RowNoise, camera: CameraRows | None
) -> Array | None:
    """Return the lower triangle of the correlation of the motion's rows, and of a camera's frames after them.

    White noise behind the filter is correlated by the filter. The accelerometer's part of it is in the frames too, as
    its double integral from the onset on, and with it what makes them noisier than that.

    Returns
    -------
    ndarray, shape (n_rows + n_frames, n_rows + n_frames), or None
        None where the noise is not known to be white, or has not passed a filter.
    """
    low_pass = regression.low_pass
    if low_pass is None or not noise.sensors_m_s2 > 0:
        return None
    times_s, sigma = regression.times_s[rows], noise.sigma_m_s2[rows]
    frames_s, sigma_m = (np.zeros(0), np.zeros(0)) if camera is None else (camera.times_s, camera.sigma_m)
    reach_s, step_s = REACH / low_pass.cutoff_hz, 1.0 / (PER_PERIOD * low_pass.cutoff_hz)
    cells_s = np.arange(times_s[0] - reach_s, max([times_s[-1] + reach_s, *frames_s[-1:]]), step_s)
    # what a noise of density one in each cell makes of rows and frames
    samples = math.ceil(reach_s * regression.rate_hz)
    kernel = np.zeros(2 * samples + 1)
    kernel[samples] = regression.rate_hz
    kernel = low_pass.apply(kernel, regression.rate_hz)
    lags_s = regression.step_s * np.arange(-samples, samples + 1)
    behind = np.interp(times_s[:, np.newaxis] - cells_s, lags_s, kernel, left=0.0, right=0.0) * math.sqrt(step_s)
    passed = behind @ behind.T
    shared = noise.sensors_m_s2**2 / float(np.mean(np.diag(passed)))
    covariance = np.diag(np.concatenate([sigma**2 - noise.sensors_m_s2**2, sigma_m**2]))
    n = times_s.size
    covariance[:n, :n] += shared * passed
    if camera is not None:
        # the frames are compared with what the accelerometer read, so that its noise is taken off them
        walked = np.maximum(frames_s[:, np.newaxis] - cells_s, 0.0) * (cells_s >= camera.onset_s) * math.sqrt(step_s)
        own = min(noise.density, shared)
        covariance[:n, n:] = -own * behind @ walked.T
        covariance[n:, :n] = covariance[:n, n:].T
        covariance[n:, n:] += max(own, camera.density) * walked @ walked.T
    deviations = np.concatenate([sigma, sigma_m])
    return np.asarray(np.linalg.cholesky(covariance / np.outer(deviations, deviations)))


def _size(regression: Regression, rows: NDArray[np.int64], sigma: Array) -> tuple[float, float]:
    """Return the root mean square of what is left of the rows with everything released, and its degrees of freedom."""
    r = regression
    columns = [*r.forces_n.T[:3], r.friction_direction, r.released, r.release_per_s]
    columns += [] if r.shifts is None else [*r.shifts.T]
    table = np.column_stack(columns)[rows]
    if rows.size - table.shape[1] - PIECES >= LEAST_LEFT:
        changes = ramps(r.times_s[rows], r.interval_s, PIECES)
        table = np.column_stack([table, changes * _smooth_force_n(r)[rows, np.newaxis]])
    table = table / sigma[:, np.newaxis]
    table = table / np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    u, sizes, _ = np.linalg.svd(table, full_matrices=False)
    spanned = u[:, sizes > LEAST_PIVOT * sizes[0]]
    response = r.acceleration_m_s2[rows] / sigma
    residual = response - spanned @ (spanned.T @ response)
    left = float(max(rows.size - spanned.shape[1], 1))
    return math.sqrt(float(residual @ residual) / left), left


def _smooth_force_n(regression: Regression) -> Array:
    """Return the net force without the gauges' noise: columns that hold it would explain the rows' own, which it is."""
    low_pass = regression.low_pass
    if low_pass is None:
        return regression.force_n
    slower = replace(low_pass, cutoff_hz=SLOWER * low_pass.cutoff_hz)
    return slower.apply(regression.force_n, regression.rate_hz)


def _mean_square_gain(regression: Regression) -> float:
    """Return the share of a white noise's variance that passes the regression's filter."""
    low_pass = regression.low_pass
    if low_pass is None:
        return 1.0
    nyquist_hz = 0.5 * regression.rate_hz
    frequencies_hz = np.linspace(0.0, min(10.0 * low_pass.cutoff_hz, 0.999 * nyquist_hz), GAIN_POINTS)
    squared = low_pass.gain(frequencies_hz, regression.rate_hz) ** 2
    return float(np.mean(squared)) * float(frequencies_hz[-1]) / nyquist_hz
