"""Derivatives by a Kalman smoother whose jerk is white noise, of an intensity that follows the motion.

State ``[x, v, a]``; over a step h its covariance grows by ``q [[h^5/20, h^4/8, h^3/6], [h^4/8, h^3/3, h^2/2],
[h^3/6, h^2/2, h]]`` (Bar-Shalom, Li, Kirubarajan 2001, Estimation with Applications to Tracking and Navigation,
section 6.2.3: continuous white noise jerk). Lost frames and uneven steps need nothing special. With one q for
all it is a quintic smoothing spline (Wahba 1978, J. R. Stat. Soc. B 40) that is too stiff for the shot and too
loose for the rest. Here every step has its own: ln q is a random walk, and the walk that makes the positions
likeliest is found by scoring, from the likeliest constant on.

The backward pass is that of de Jong (1989), J. Am. Stat. Assoc. 84(408): a vector r and a matrix N per step, from
which the likelihood's derivative by ln q is ``q (r' G r - tr(G N)) / 2`` with q G the growth (Koopman and Shephard
1992, Biometrika 79), and its information ``q^2 tr(G N G N) / 2``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_processing.motion.derivative import Derivatives, ScaledTrack

Array = NDArray[np.float64]

LEAST_FRAMES = 8
"""For three derivatives and an intensity."""
STEP_OF_LOG_INTENSITY = 0.7
"""Standard deviation of the change of ln q from frame to frame."""
LOG_INTENSITIES = (-18.0, 14.0)
"""Limits of ln q, in the track's units: from a parabola to interpolation."""
MOST_SCORINGS = 30
NEGLIGIBLE_GAIN = 0.1
"""Of the log-likelihood, below which scoring ends."""
LONGEST_SCORING = 2.0
"""By which ln q may change at once."""
LEAST_INFORMATION = 1e-6
"""On ln q of a step: where the motion is smooth there is none, and the neighbours decide."""
START_FRAMES = 6
"""Whose parabola is where the filter starts from."""
LOOSENESS = 1e4
"""Variance of that start over that of the parabola: it is hardly told twice."""


@dataclass(frozen=True, eq=False)
class _Pass:
    """One run of the smoother: states (n, 3), covariances (n, 3, 3), and what the intensities should do (n - 1,)."""

    states: Array
    covariances: Array
    score: Array
    information: Array
    log_likelihood: float


def smooth_jerk(
    times_s: Array, positions_m: Array, *, sigma_m: float | None = None, adaptive: bool = True
) -> Derivatives:
    """Estimate velocity and acceleration.

    The uncertainties are those of the smoother given the intensities, of noise and motion alike. Intensities that
    follow the motion follow the noise a little too: on a recoil the errors are 0.5 to 0.9 of the uncertainties, on
    a motion that really has one intensity they are up to 1.3 of them.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Strictly increasing; steps may be uneven.
    positions_m : ndarray, shape (n,)
        Lost frames NaN.
    sigma_m : float, optional
        Of the positions' white noise; from the third differences if left out.
    adaptive : bool
        Whether the intensity follows the motion; otherwise it is one for all, the likeliest.

    Returns
    -------
    Derivatives
        Half a window is half a period of the frequency at which the smoother passes one half of the amplitude;
        beside a gap no more than the gap's length, beyond which the frames on its other side tell as much.

    Raises
    ------
    ValueError
        As `recoil_processing.motion.derivative.ScaledTrack.of`.
    """
    track = ScaledTrack.of(times_s, positions_m, sigma_m, LEAST_FRAMES)
    log_q = np.full(track.times.size - 1, _likeliest_constant(track))
    found = _smooth(track, log_q)
    if adaptive:
        log_q, found = _follow(track, log_q, found)
    deviations = np.sqrt(np.maximum(np.diagonal(found.covariances, axis1=1, axis2=2), 0.0))
    # one half is passed where w^6 = q per step and unit of noise; half a period is pi / w
    half = np.pi * np.exp(-np.concatenate([log_q, log_q[-1:]]) / 6.0)
    method = "white jerk, intensity by likelihood" + (", following the motion" if adaptive else "")
    return track.derivatives(found.states, deviations, track.edges(half, gap_lengths=1.0), method)


def _likeliest_constant(track: ScaledTrack) -> float:
    from scipy.optimize import minimize_scalar

    steps = track.times.size - 1

    def misfit(log_q: float) -> float:
        return -_filter(track, np.full(steps, log_q))[1]

    low, high = LOG_INTENSITIES
    coarse = np.arange(low, high + 1, 4.0)
    near = float(coarse[int(np.argmin([misfit(log_q) for log_q in coarse]))])
    bounds = max(near - 4.0, low), min(near + 4.0, high)
    return float(minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 0.05}).x)


def _follow(track: ScaledTrack, log_q: Array, found: _Pass) -> tuple[Array, _Pass]:
    """Improve ln q by scoring under its random walk until the posterior rises no more."""
    from scipy.linalg import solveh_banded

    steps = np.diff(track.times)
    tie = 1.0 / (STEP_OF_LOG_INTENSITY**2 * 0.5 * (steps[1:] + steps[:-1]))
    reached = found.log_likelihood
    for _ in range(MOST_SCORINGS):
        pull = tie * np.diff(log_q)
        slope = found.score + np.append(pull, 0.0) - np.insert(pull, 0, 0.0)
        band = np.zeros((2, log_q.size))
        band[1] = np.maximum(found.information, LEAST_INFORMATION) + np.append(tie, 0.0) + np.insert(tie, 0, 0.0)
        band[0, 1:] = -tie
        change = np.clip(solveh_banded(band, slope), -LONGEST_SCORING, LONGEST_SCORING)
        tried = np.clip(log_q + change, *LOG_INTENSITIES)
        better = _smooth(track, tried)
        posterior = better.log_likelihood - 0.5 * float(tie @ np.diff(tried) ** 2)
        if posterior < reached:
            break
        log_q, found, gained, reached = tried, better, posterior - reached, posterior
        if gained < NEGLIGIBLE_GAIN:
            break
    return log_q, found


def _growth(steps: Array) -> Array:
    """Upper triangle of G, row by row, shape (n, 6)."""
    h = steps
    return np.stack([h**5 / 20, h**4 / 8, h**3 / 6, h**3 / 3, h**2 / 2, h], axis=1)


_FULL = [0, 1, 2, 1, 3, 4, 2, 4, 5]
"""Of the upper triangle of a symmetric matrix, in all nine places."""


def _filter(track: ScaledTrack, log_q: Array) -> tuple[list[tuple[float, ...]], float]:
    """Run the Kalman filter forward: predicted states, covariances, innovations and gains, and the log-likelihood."""
    steps = np.diff(track.times)
    x0, x1, x2, p00, p01, p02, p11, p12, p22 = _start(track)
    growths = (_growth(steps) * np.exp(log_q)[:, None]).tolist()
    rows: list[tuple[float, ...]] = []
    for z, h, g in zip(track.positions.tolist(), [*steps.tolist(), 0.0], [*growths, [0.0] * 6], strict=True):
        s, v = p00 + 1.0, z - x0
        k0, k1, k2 = p00 / s, p01 / s, p02 / s
        rows.append((x0, x1, x2, p00, p01, p02, p11, p12, p22, v, s, k0, k1, k2))
        x1, x2 = x1 + k1 * v, x2 + k2 * v
        # the position's own row by k = p / s, which is exact, not by a difference
        p11, p12, p22, p00, p01, p02 = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02, k0, k1, k2
        half = 0.5 * h * h
        x0, x1 = x0 + k0 * v + h * x1 + half * x2, x1 + h * x2
        a02, a12 = p02 + h * p12 + half * p22, p12 + h * p22
        a01, a11 = p01 + h * p11 + half * p12, p11 + h * p12
        p00 = p00 + h * p01 + half * p02 + h * a01 + half * a02 + g[0]
        p01, p02 = a01 + h * a02 + g[1], a02 + g[2]
        p11, p12, p22 = a11 + h * a12 + g[3], a12 + g[4], p22 + g[5]
    innovations = np.array(rows)[:, 9:11]
    return rows, -0.5 * float(np.sum(np.log(innovations[:, 1]) + innovations[:, 0] ** 2 / innovations[:, 1]))


def _start(track: ScaledTrack) -> list[float]:
    """State and covariance at the first frame: a parabola through the first ones, held very loosely."""
    t = track.times[:START_FRAMES]
    shapes = np.column_stack([np.ones_like(t), t, 0.5 * t**2])
    covariance = np.linalg.inv(shapes.T @ shapes)
    state = covariance @ shapes.T @ track.positions[:START_FRAMES]
    return [*state.tolist(), *(LOOSENESS * covariance)[np.triu_indices(3)].tolist()]


def _smooth(track: ScaledTrack, log_q: Array) -> _Pass:
    rows, log_likelihood = _filter(track, log_q)
    steps = np.diff(track.times)
    r0 = r1 = r2 = n00 = n01 = n02 = n11 = n12 = n22 = 0.0
    back: list[tuple[float, ...]] = []
    for row, h in zip(reversed(rows), [0.0, *reversed(steps.tolist())], strict=True):
        v, s, k0, k1, k2 = row[9:]
        half = 0.5 * h * h
        r1, r2 = r1 + h * r0, r2 + h * r1 + half * r0
        b02, b12 = n02 + h * n01 + half * n00, n12 + h * n11 + half * n01
        b01, b11 = n01 + h * n00, n11 + h * n01
        n22 = n22 + h * n12 + half * n02 + h * b12 + half * b02
        n12, n11, n02, n01 = b12 + h * b02, b11 + h * b01, b02, b01
        m0, m1, m2 = n00 * k0 + n01 * k1 + n02 * k2, n01 * k0 + n11 * k1 + n12 * k2, n02 * k0 + n12 * k1 + n22 * k2
        r0 += v / s - (k0 * r0 + k1 * r1 + k2 * r2)
        n00 += 1.0 / s - 2.0 * m0 + k0 * m0 + k1 * m1 + k2 * m2
        n01, n02 = n01 - m1, n02 - m2
        back.append((r0, r1, r2, n00, n01, n02, n11, n12, n22))
    forward, backward = np.array(rows), np.array(back[::-1])
    r, n = backward[:, :3, None], backward[:, 3:][:, _FULL].reshape(-1, 3, 3)
    p = forward[:, 3:9][:, _FULL].reshape(-1, 3, 3)
    q = np.exp(log_q)
    growth = _growth(steps)[:, _FULL].reshape(-1, 3, 3)
    grown = growth @ n[1:]
    driven = (r[1:].transpose(0, 2, 1) @ growth @ r[1:])[:, 0, 0]
    return _Pass(
        states=forward[:, :3] + (p @ r)[:, :, 0],
        covariances=p - p @ n @ p,
        score=0.5 * q * (driven - np.trace(grown, axis1=1, axis2=2)),
        information=0.5 * q**2 * np.einsum("nij,nji->n", grown, grown),
        log_likelihood=log_likelihood,
    )
