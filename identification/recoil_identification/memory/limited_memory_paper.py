"""The textbook's limited memory least squares: one row taken in and one given up at every sample.

With P = (X'X)^-1 of the window, the Sherman-Morrison formula (J. Sherman and W. J. Morrison, Annals of Mathematical
Statistics 21, 1950, 124-127) takes a row x, y in,

    e = y - x'theta,  g = P x,  P <- P - g g' / (1 + x'g),  theta <- theta + g e / (1 + x'g),

and gives one up with the signs of the second terms and of x'g turned round. The residual sum of squares gains
e^2 / (1 + x'g), or loses e^2 / (1 - x'g).

It is here so that published results can be repeated, and for comparison. **It drifts**: each subtraction leaves
round-off of the size of what is subtracted, nothing takes it away again, and the sum of squares can fall below zero.
A shot followed by silence is the worst case: with five regressors correlated by 0.9995 whose amplitude falls from 2500
to 0.05, estimates of the silence are wrong by tens of per cent after the first shots. A denominator that comes out
negative restarts the recursion here, which hides the drift for a while; the textbook has no such rescue.
`limited_memory_least_squares` has neither a recursion nor a subtraction, and is quicker.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from recoil_acquisition.errors import RecoilDaqError
from recoil_identification.memory.gram_kernel import kernel_at_hand
from recoil_identification.memory.window_factors import FloatArray
from recoil_identification.memory.window_policy import WindowPolicy
from recoil_identification.memory.windowed_estimates import WindowedEstimates, WindowStatus

LEAST_RECIPROCAL_CONDITION = 1e-14
"""Of the first window's X'X, scaled to a diagonal of one: below, there is no inverse to begin with."""


def paper_limited_memory(
    regressors: FloatArray,
    response: FloatArray,
    weights: FloatArray | None,
    policy: WindowPolicy,
    engine: str = "auto",
) -> WindowedEstimates:
    """Estimate every window by taking one row in and giving one up.

    Parameters
    ----------
    regressors : ndarray, shape (n_samples, n_parameters)
    response : ndarray, shape (n_samples,) or (n_samples, n_outputs)
    weights : ndarray, shape (n_samples,), or None
    policy : WindowPolicy
        Without a least excitation: the recursion keeps no sums to compare with it.
    engine : {"auto", "numpy", "numba"}
        ``"numpy"`` runs the recursion in plain Python, ``"auto"`` takes numba where it is installed.

    Returns
    -------
    WindowedEstimates
        `smallest_pivot` is NaN. Where a denominator is not positive any more, which exact arithmetic does not
        know, the window is `WindowStatus.COLLINEAR` and the recursion begins anew from the rows of the next one.

    Raises
    ------
    ValueError
        If the policy has a least excitation.
    RecoilDaqError
        If the engine ``"numba"`` is asked for and numba is not installed.
    """
    if policy.min_excitation.any():
        raise ValueError('method "paper" takes no min_excitation')
    n_samples, n_parameters = regressors.shape
    outputs = response.reshape(n_samples, -1)
    rows = np.column_stack([regressors, outputs])
    present = ~np.isnan(rows).any(axis=1)
    if weights is not None:
        present &= weights > 0.0
        rows *= np.sqrt(weights)[:, np.newaxis]
    rows[~present] = 0.0
    total = np.concatenate([[0], np.cumsum(present, dtype=np.int64)])
    count = total[1:] - total[np.maximum(np.arange(1, n_samples + 1) - policy.window, 0)]
    status = np.where(count < policy.needed_count, WindowStatus.TOO_FEW_SAMPLES, WindowStatus.COLLINEAR).astype(
        np.uint8
    )
    if not policy.partial:
        status[: policy.window - 1] = WindowStatus.WINDOW_NOT_FULL
    estimates = np.full((n_samples, n_parameters, outputs.shape[1]), np.nan)
    diagonals = np.full((n_samples, n_parameters), np.nan)
    left = np.full(outputs.shape, np.nan)
    recur = _recursion(engine)
    k = 0
    while k < n_samples:
        begun = _begun(rows[max(k + 1 - policy.window, 0) : k + 1], n_parameters) if status[k] == 4 else None
        if begun is None:
            k += 1
            continue
        inverse, parameters, sums = begun
        estimates[k], diagonals[k], left[k], status[k] = parameters, np.diag(inverse), sums, WindowStatus.IDENTIFIED
        k = recur(rows, policy.window, k + 1, inverse, parameters, sums, status, estimates, diagonals, left)
    degrees = np.maximum(count - n_parameters, 1)[:, np.newaxis]
    with np.errstate(invalid="ignore"):  # a sum of squares that has drifted below zero has no root
        errors = np.sqrt((left / degrees)[:, np.newaxis] * diagonals[..., np.newaxis])
    if policy.max_relative_error is not None:
        precise = (errors[:, 0] <= policy.max_relative_error * np.abs(estimates[:, 0])).all(axis=1)
        status[~precise & (status == WindowStatus.IDENTIFIED)] = WindowStatus.NO_EXCITATION
    for values in (estimates, errors, left):
        values[status != WindowStatus.IDENTIFIED] = np.nan
    one = response.ndim == 1
    return WindowedEstimates(
        parameters=estimates[..., 0] if one else estimates,
        standard_errors=errors[..., 0] if one else errors,
        residual_sum_of_squares=left[:, 0] if one else left,
        marks=status,
        pivots=np.full(n_samples, np.nan),
        counts=count,
        window=int(policy.window),
    )


def _begun(rows: FloatArray, n_parameters: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Inverse, estimates and residual sums of squares of the rows of one window; None where there is no inverse."""
    regressors, outputs = rows[:, :n_parameters], rows[:, n_parameters:]
    scale = np.sqrt((regressors**2).sum(axis=0))
    if not scale.all():
        return None
    triangle = np.asarray(np.linalg.qr(regressors / scale, mode="r"))
    if triangle.shape[0] < n_parameters or np.linalg.cond(triangle) ** -2 < LEAST_RECIPROCAL_CONDITION:
        return None
    root = np.linalg.solve(triangle, np.eye(n_parameters)) / scale[:, np.newaxis]
    parameters = np.linalg.lstsq(regressors / scale, outputs, rcond=None)[0] / scale[:, np.newaxis]
    return root @ root.T, parameters, ((outputs - regressors @ parameters) ** 2).sum(axis=0)


def _recur(
    rows: FloatArray,
    window: int,
    first: int,
    inverse: FloatArray,
    parameters: FloatArray,
    sums: FloatArray,
    status: Any,
    estimates: FloatArray,
    diagonals: FloatArray,
    left: FloatArray,
) -> int:
    """Run the recursion from row `first` to the end, or to where it breaks down; return the row after."""
    n_parameters, n_outputs = parameters.shape
    gain = np.empty(n_parameters)
    for k in range(first, rows.shape[0]):
        for sign in (1.0, -1.0):
            if sign < 0.0 and k < window:
                continue
            i = k if sign > 0.0 else k - window
            product = 0.0
            for a in range(n_parameters):
                g = 0.0
                for b in range(n_parameters):
                    g += inverse[a, b] * rows[i, b]
                gain[a] = g
                product += g * rows[i, a]
            denominator = 1.0 + sign * product
            if not denominator > 0.0:
                return k + 1
            for o in range(n_outputs):
                error = rows[i, n_parameters + o]
                for a in range(n_parameters):
                    error -= rows[i, a] * parameters[a, o]
                for a in range(n_parameters):
                    parameters[a, o] += sign * gain[a] * error / denominator
                sums[o] += sign * error * error / denominator
            for a in range(n_parameters):
                for b in range(n_parameters):
                    inverse[a, b] -= sign * gain[a] * gain[b] / denominator
        if status[k] == 4:  # enough samples: `WindowStatus.COLLINEAR` until there is a number
            status[k] = 0
            for a in range(n_parameters):
                diagonals[k, a] = inverse[a, a]
                for o in range(n_outputs):
                    estimates[k, a, o] = parameters[a, o]
            for o in range(n_outputs):
                left[k, o] = sums[o]
    return int(rows.shape[0])


@cache
def _recursion(engine: str) -> Callable[..., int]:
    """Compile the recursion where that is asked for or possible."""
    if engine == "numpy" or (engine == "auto" and not kernel_at_hand()):
        return _recur
    try:
        from numba import njit
    except ImportError as error:
        raise RecoilDaqError(
            "the compiled recursion needs numba",
            remedy="install it by `pip install 'recoil-daq[fast]'`, or take the engine 'numpy'",
        ) from error
    try:
        return njit(cache=True, nogil=True)(_recur)
    except (RuntimeError, OSError):
        # there is no folder where compiled code could be kept: it is compiled for this process alone
        return njit(nogil=True)(_recur)
