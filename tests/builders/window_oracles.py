"""Windows solved by other means than the engine's: the oracles of limited memory least squares."""

from __future__ import annotations

from fractions import Fraction

import numpy as np


def direct_qr(regressors: np.ndarray, response: np.ndarray, window: int) -> np.ndarray:
    """Factorise the rows of every window anew, by LAPACK."""
    rows = np.column_stack([regressors, response])
    windows = np.lib.stride_tricks.sliding_window_view(rows, window, axis=0).swapaxes(1, 2)
    estimates = np.full(regressors.shape, np.nan)
    for start in range(0, len(windows), 5000):
        triangle = np.linalg.qr(windows[start : start + 5000], mode="r")
        last = start + window - 1
        estimates[last : last + len(triangle)] = np.linalg.solve(triangle[:, :-1, :-1], triangle[:, :-1, -1:])[..., 0]
    return estimates


def exact(regressors: np.ndarray, response: np.ndarray) -> np.ndarray:
    """Solve the normal equations of one window in rational numbers."""
    rows = [[Fraction(value) for value in row] for row in np.column_stack([regressors, response]).tolist()]
    n = regressors.shape[1]
    table = [[sum((row[i] * row[j] for row in rows), Fraction(0)) for j in range(n + 1)] for i in range(n)]
    for i in range(n):
        table[i] = [value / table[i][i] for value in table[i]]
        for k in range(n):
            if k != i:
                table[k] = [a - table[k][i] * b for a, b in zip(table[k], table[i], strict=True)]
    return np.array([float(row[-1]) for row in table])


def relative_error(estimates: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Largest error of a window's parameters over its largest parameter."""
    return np.abs(estimates - truth).max(axis=1) / np.abs(truth).max(axis=1)
