"""Velocity and acceleration from a noisy displacement: what every method takes and gives.

The methods are `motion.jerk_smoother` (the most accurate on a recoil, and the only one to take uneven steps
and gaps as they are), `motion.smoothing_spline` and `motion.savitzky_golay`. Each works in units
of its own, the marker's noise and the usual step between frames, so that the result is the same whatever the times are
counted in: a smoothing parameter that is searched in seconds between 0 and the number of frames, as some
libraries do, is never found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_processing.noise import noise_sigma

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

WHITENESS_LAGS = 10
"""Of the residuals' correlation."""
_CENTRAL = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0
GAP_STEPS = 1.5
"""Usual steps between neighbours beyond which there is a gap."""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """A displacement, smoothed, and its derivatives at the frames.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    position, velocity, acceleration : ndarray, shape (n,)
        m, m/s and m/s^2; NaN where the frame was lost.
    u_position, u_velocity, u_acceleration : ndarray, shape (n,)
        Standard uncertainties; NaN there too. What they hold differs between the methods.
    edge : ndarray of bool, shape (n,)
        Frames within half a window of an end or a gap, and lost ones: no peak may be read there.
    method : str
    sigma : float
        Of the displacement's white noise, m.
    residual : ndarray, shape (n,)
        Displacement less `position`; NaN where the frame was lost.
    """

    times_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    u_position: Array
    u_velocity: Array
    u_acceleration: Array
    edge: Flags
    method: str
    sigma: float
    residual: Array

    @property
    def whiteness(self) -> float:
        """Mean over the first lags of the residuals' squared correlation times the pairs in it.

        About 1 for white residuals (Box and Pierce 1970, J. Am. Stat. Assoc. 65), much more where motion was
        smoothed away. Pairs across lost frames drop out; NaN where none are left.
        """
        e = self.residual - np.nanmean(self.residual)
        variance = float(np.nanmean(e**2))
        figures = []
        for lag in range(1, WHITENESS_LAGS + 1):
            products = e[lag:] * e[:-lag]
            products = products[np.isfinite(products)]
            if products.size and variance > 0:
                figures.append(products.size * (float(products.mean()) / variance) ** 2)
        return float(np.mean(figures)) if figures else math.nan

    def peak_acceleration(self) -> tuple[float, float, float]:
        """Return instant, value and standard uncertainty of the largest acceleration by magnitude, edges left out.

        Raises
        ------
        ValueError
            If every frame is an edge.
        """
        inner = np.where(self.edge, -1.0, np.abs(np.where(self.edge, 0.0, self.acceleration)))
        i = int(np.argmax(inner))
        if inner[i] < 0:
            raise ValueError(f"all {self.times_s.size} frames are edges or lost: there is no peak to read")
        return float(self.times_s[i]), float(self.acceleration[i]), float(self.u_acceleration[i])


def second_derivative(samples: Array, step_s: float) -> Array:
    """Differentiate even samples twice, that were low-pass filtered and have no noise left to speak of.

    The central difference of sixth order (Fornberg 1988, Math. Comput. 51) is right to ``(w h)^6 / 560``, w being the
    angular frequency and h the step; two gradients in a row lose ``(w h)^2 / 3``, 3 % at a twentieth
    of the sampling rate.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        n at least 3; the three at each end are differentiated by gradients.
    step_s : float

    Returns
    -------
    ndarray, shape (n,)
    """
    result = np.gradient(np.gradient(samples, step_s), step_s)
    if samples.size >= _CENTRAL.size:
        result[3:-3] = np.convolve(samples, _CENTRAL, mode="valid") / step_s**2
    return result


@dataclass(frozen=True, eq=False)
class ScaledTrack:
    """The frames with a position, in units of the usual step and of the noise.

    Attributes
    ----------
    all_times_s, all_positions_m : ndarray, shape (n,)
        As they were given.
    seen : ndarray of bool, shape (n,)
    step_s : float
        Median step between frames.
    sigma_m : float
    times : ndarray, shape (n_seen,)
        In steps, from the first frame that was seen.
    positions : ndarray, shape (n_seen,)
        In standard deviations, from the first one.
    """

    all_times_s: Array
    all_positions_m: Array
    seen: Flags
    step_s: float
    sigma_m: float
    times: Array
    positions: Array

    @classmethod
    def of(cls, times_s: Array, positions_m: Array, sigma_m: float | None, least_frames: int) -> ScaledTrack:
        """Check a track and scale it.

        Parameters
        ----------
        times_s : ndarray, shape (n,)
            Strictly increasing.
        positions_m : ndarray, shape (n,)
            Lost frames NaN.
        sigma_m : float or None
            Of the white noise; None: from the third differences, which needs even steps.
        least_frames : int
            With a position.

        Raises
        ------
        ValueError
            If shapes do not fit, times do not increase, too few frames have a position, or the noise is not
            positive or cannot be told.
        """
        if times_s.ndim != 1 or times_s.shape != positions_m.shape:
            raise ValueError(f"times and positions must be equally many, not {times_s.shape}, {positions_m.shape}")
        if not (np.all(np.isfinite(times_s)) and np.all(np.diff(times_s) > 0)):
            raise ValueError("times_s must increase strictly")
        if np.any(np.isinf(positions_m)):
            raise ValueError("positions_m must be finite, or NaN where a frame was lost")
        seen = np.isfinite(positions_m)
        if np.count_nonzero(seen) < least_frames:
            raise ValueError(
                f"{np.count_nonzero(seen)} of {seen.size} frames have a position; {least_frames} are needed"
            )
        sigma = noise_sigma(positions_m) if sigma_m is None else sigma_m
        if not (math.isfinite(sigma) and sigma > 0):
            told = "cannot be told from the third differences" if sigma_m is None else f"must be positive, not {sigma}"
            raise ValueError(f"the noise of the positions {told}; give sigma_m")
        step = float(np.median(np.diff(times_s)))
        t, z = times_s[seen], positions_m[seen]
        return cls(times_s, positions_m, seen, step, float(sigma), (t - t[0]) / step, (z - z[0]) / sigma)

    def edges(self, half_window: Array, *, gap_lengths: float = math.inf) -> Flags:
        """Find the frames within half a window of an end or a gap, shape (n_seen,).

        Parameters
        ----------
        half_window : ndarray, shape (n_seen,)
            In steps. Frames beside an end or a gap are edges whatever it is.
        gap_lengths : float
            How far a gap reaches at most, in its own lengths.
        """
        length = np.diff(self.times)
        length = np.concatenate([[math.inf], np.where(length > GAP_STEPS, gap_lengths * length, 0.0), [math.inf]])
        starts, ends = length[:-1] > 0, length[1:] > 0
        run = np.cumsum(starts) - 1
        since = self.times - self.times[starts][run]
        until = self.times[ends][run] - self.times
        half = np.maximum(half_window, 0.5)
        near_start = since < np.minimum(half, length[:-1][starts][run])
        near_end = until < np.minimum(half, length[1:][ends][run])
        return np.asarray(near_start | near_end)

    def derivatives(self, states: Array, deviations: Array, edge: Flags, method: str) -> Derivatives:
        """Put a method's result back into SI and between the lost frames.

        Parameters
        ----------
        states, deviations : ndarray, shape (n_seen, 3)
            Position, velocity and acceleration in the track's units, and their standard uncertainties.
        edge : ndarray of bool, shape (n_seen,)
        method : str
        """
        scale = self.sigma_m / self.step_s ** np.arange(3)
        full = np.full((2, self.seen.size, 3), np.nan)
        full[0, self.seen] = states * scale
        full[0, self.seen, 0] += self.all_positions_m[self.seen][0]
        full[1, self.seen] = deviations * scale
        edges = np.ones(self.seen.size, dtype=bool)
        edges[self.seen] = edge
        (x, v, a), (u_x, u_v, u_a) = full[0].T, full[1].T
        return Derivatives(
            self.all_times_s, x, v, a, u_x, u_v, u_a, edges, method, self.sigma_m, self.all_positions_m - x
        )
