"""A Kalman filter and fixed-interval smoother whose inputs' intensities follow the data.

A linear state moves from step to step by one constant matrix and by inputs that are known; independent drivers
of white noise push it, each with an intensity of its own at every step. Between the steps scalars are seen that
are linear in the state. The unknown force of an inverse problem is a component of such a state (input estimation
by state augmentation: E. Lourens, E. Reynders, G. De Roeck, G. Degrande, G. Lombaert, "An augmented Kalman filter
for force identification in structural dynamics", Mech. Syst. Signal Process. 27, 2012).

The backward pass is that of P. de Jong, "Smoothing and interpolation with the state-space model", J. Am. Stat.
Assoc. 84(408), 1989: a vector r and a matrix N per step, which give the same as the recursion of Rauch, Tung and
Striebel without any inverse. They also give the likelihood's derivative by the logarithm of each intensity q,
``q (r' G r - tr(G N)) / 2`` with q G the covariance that the driver adds in a step (S. J. Koopman, N. Shephard,
Biometrika 79, 1992), and its information ``q^2 tr(G N G N) / 2``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

Indices = NDArray[np.int64]

STEP_OF_LOG_INTENSITY = 0.4
"""Standard deviation of the change of ln q from step to step."""
MOST_SCORINGS = 25
NEGLIGIBLE_GAIN = 0.2
"""Gain of the log-likelihood below which scoring ends."""
LONGEST_SCORING = 2.0
"""Amount by which ln q may change at once."""
LEAST_INFORMATION = 1e-6
"""Information on ln q of a step: where nothing is told of it, the neighbours decide."""
LOG_INTENSITIES = (-60.0, 40.0)
"""Limits of ln q."""


@dataclass(frozen=True, eq=False)
class InputModel:
    """A state, what drives it and what was seen of it.

    Attributes
    ----------
    transition : ndarray, shape (n_states, n_states)
    inputs : ndarray, shape (n_steps - 1, n_states)
        Amount that is added to the state at each step.
    growths : ndarray, shape (n_drivers, n_states, n_states)
        Covariance that each driver of intensity 1 adds in one step.
    start : ndarray, shape (n_states,)
    start_covariance : ndarray, shape (n_states, n_states)
    steps : ndarray of int64, shape (n_seen,)
        Step at which each scalar was seen, ascending.
    rows : ndarray, shape (n_seen, n_states)
    values, variances : ndarray, shape (n_seen,)

    Raises
    ------
    ValueError
        If the shapes do not fit, steps do not ascend or lie outside, or a variance is not positive.
    """

    transition: Array
    inputs: Array
    growths: Array
    start: Array
    start_covariance: Array
    steps: Indices
    rows: Array
    values: Array
    variances: Array

    def __post_init__(self) -> None:
        n, seen = self.start.size, self.values.size
        wanted = {
            "transition": (n, n),
            "inputs": (self.inputs.shape[0], n),
            "growths": (self.growths.shape[0], n, n),
            "start_covariance": (n, n),
            "steps": (seen,),
            "rows": (seen, n),
            "variances": (seen,),
        }
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have the shape {shape}, not {getattr(self, name).shape}")
        if seen and (np.any(np.diff(self.steps) < 0) or self.steps[0] < 0 or self.steps[-1] >= self.count):
            raise ValueError(f"steps must ascend within 0 to {self.count - 1}")
        if not np.all(self.variances > 0):
            raise ValueError("variances must be positive")

    @property
    def count(self) -> int:
        """Steps."""
        return int(self.inputs.shape[0]) + 1


@dataclass(frozen=True, eq=False)
class Smoothed(ReadOnlyArrays):
    """The state given all that was seen.

    Attributes
    ----------
    states : ndarray, shape (n_steps, n_states)
    covariances : ndarray, shape (n_steps, n_states, n_states)
    log_intensities : ndarray, shape (n_drivers, n_steps - 1)
        ln q of each driver.
    log_likelihood
        Log likelihood of what was seen, up to a constant.
    innovation_statistic
        Mean squared normalised innovation; 1 if the noise levels fit.
    score, information : ndarray, shape (n_drivers, n_steps - 1)
        First derivative of the log-likelihood by ln q, and the expected second one.
    """

    states: Array
    covariances: Array
    log_intensities: Array
    log_likelihood: float
    innovation_statistic: float
    score: Array
    information: Array


@dataclass(frozen=True, eq=False)
class _Forward:
    """Predicted states (n_steps, n) and covariances, and per scalar innovation, its variance and the gain (n,)."""

    states: Array
    covariances: Array
    innovations: Array
    variances: Array
    gains: Array

    @property
    def log_likelihood(self) -> float:
        return -0.5 * float(np.sum(np.log(self.variances) + self.innovations**2 / self.variances))


def log_likelihood(model: InputModel, log_intensities: Array) -> float:
    """Return the log-likelihood of what was seen, up to a constant.

    Parameters
    ----------
    log_intensities : ndarray, shape (n_drivers,) or (n_drivers, n_steps - 1)
    """
    return _forward(model, _full(model, log_intensities)).log_likelihood


def smooth_inputs(model: InputModel, log_intensities: Array) -> Smoothed:
    """Estimate the state at every step from all that was seen.

    Parameters
    ----------
    log_intensities : ndarray, shape (n_drivers,) or (n_drivers, n_steps - 1)
    """
    log_q = _full(model, log_intensities)
    forward = _forward(model, log_q)
    n, last = model.start.size, model.count - 1
    r, N = np.zeros(n), np.zeros((n, n))
    all_r, all_N = np.zeros((model.count, n)), np.zeros((model.count, n, n))
    F = model.transition
    at = model.values.size
    steps = model.steps.tolist()
    innovations, variances = forward.innovations.tolist(), forward.variances.tolist()
    squares = model.rows[:, :, np.newaxis] * model.rows[:, np.newaxis, :]
    for step in range(last, -1, -1):
        if step < last:
            r, N = F.T @ r, F.T @ N @ F
        while at and steps[at - 1] == step:
            at -= 1
            h, v, s, K = model.rows[at], innovations[at], variances[at], forward.gains[at]
            r = r + h * (v / s - float(K @ r))
            NK = N @ K
            across = h[:, np.newaxis] * NK
            N = N - across - across.T + squares[at] * (1.0 / s + float(K @ NK))
        all_r[step], all_N[step] = r, N
    P = forward.covariances
    states = forward.states + np.einsum("tij,tj->ti", P, all_r)
    q = np.exp(log_q)
    behind_r, behind_N = all_r[1:], all_N[1:]
    score, information = np.zeros_like(q), np.zeros_like(q)
    for driver, G in enumerate(model.growths):
        grown = G @ behind_N
        driven = np.einsum("ti,ij,tj->t", behind_r, G, behind_r)
        score[driver] = 0.5 * q[driver] * (driven - np.trace(grown, axis1=1, axis2=2))
        information[driver] = 0.5 * q[driver] ** 2 * np.einsum("tij,tji->t", grown, grown)
    return Smoothed(
        states=states,
        covariances=P - P @ all_N @ P,
        log_intensities=log_q,
        log_likelihood=forward.log_likelihood,
        innovation_statistic=float(np.mean(forward.innovations**2 / forward.variances)),
        score=score,
        information=information,
    )


def follow_intensities(
    model: InputModel, log_intensities: Array, *, step_of_log_intensity: float = STEP_OF_LOG_INTENSITY
) -> Smoothed:
    """Estimate the state with intensities that follow the data.

    The logarithm of each intensity is a random walk; the walk that makes what was seen likeliest is found by
    Fisher's scoring, from the given one on.

    Parameters
    ----------
    log_intensities : ndarray, shape (n_drivers,) or (n_drivers, n_steps - 1)
        Logarithms of the intensities to begin with.
    step_of_log_intensity
        Standard deviation of the walk's step.
    """
    from scipy.linalg import solveh_banded

    found = smooth_inputs(model, log_intensities)
    tie = 1.0 / step_of_log_intensity**2
    reached, length = _posterior(found, tie), LONGEST_SCORING
    for _ in range(MOST_SCORINGS):
        change = np.zeros_like(found.log_intensities)
        for driver, log_q in enumerate(found.log_intensities):
            pull = tie * np.diff(log_q)
            slope = found.score[driver] + np.append(pull, 0.0) - np.insert(pull, 0, 0.0)
            band = np.zeros((2, log_q.size))
            band[1] = np.maximum(found.information[driver], LEAST_INFORMATION)
            band[1, :-1] += tie
            band[1, 1:] += tie
            band[0, 1:] = -tie
            change[driver] = np.clip(solveh_banded(band, slope), -length, length)
        better = smooth_inputs(model, np.clip(found.log_intensities + change, *LOG_INTENSITIES))
        posterior = _posterior(better, tie)
        if posterior < reached:
            # too far: the expected second derivative is not the real one
            length *= 0.25
            if length < 0.1:
                break
            continue
        gained, found, reached = posterior - reached, better, posterior
        if gained < NEGLIGIBLE_GAIN:
            break
    return found


def _posterior(found: Smoothed, tie: float) -> float:
    return found.log_likelihood - 0.5 * tie * float(np.sum(np.diff(found.log_intensities, axis=1) ** 2))


def _full(model: InputModel, log_intensities: Array) -> Array:
    """Give every driver an intensity at every step."""
    values = np.asarray(log_intensities, dtype=np.float64)
    shape = (model.growths.shape[0], model.count - 1)
    if values.shape == shape[:1]:
        values = np.repeat(values[:, np.newaxis], shape[1], axis=1)
    if values.shape != shape:
        raise ValueError(f"log_intensities must have the shape {shape[:1]} or {shape}, not {values.shape}")
    return values


def _forward(model: InputModel, log_q: Array) -> _Forward:
    n, seen = model.start.size, model.values.size
    states, covariances = np.zeros((model.count, n)), np.zeros((model.count, n, n))
    innovations, variances, gains = np.zeros(seen), np.zeros(seen), np.zeros((seen, n))
    F, FT = model.transition, model.transition.T
    growth = np.tensordot(np.exp(log_q).T, model.growths, axes=1)
    x, P = model.start.copy(), model.start_covariance.copy()
    at, steps, values, noise = 0, model.steps.tolist(), model.values.tolist(), model.variances.tolist()
    for step in range(model.count):
        states[step], covariances[step] = x, P
        while at < seen and steps[at] == step:
            h = model.rows[at]
            Ph = P @ h
            s = float(h @ Ph) + noise[at]
            v = values[at] - float(h @ x)
            K = Ph / s
            x = x + K * v
            P = P - K[:, np.newaxis] * Ph
            innovations[at], variances[at], gains[at] = v, s, K
            at += 1
        if step < model.count - 1:
            x = F @ x + model.inputs[step]
            P = F @ P @ FT + growth[step]
    if not (np.all(np.isfinite(innovations)) and np.all(variances > 0)):
        # beyond what float64 can hold; never the likeliest
        return _Forward(states, covariances, np.full(seen, math.inf), np.ones(seen), gains)
    return _Forward(states, covariances, innovations, variances, gains)
