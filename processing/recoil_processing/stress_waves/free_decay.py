"""Stretches in which a structure rings freely: between the knocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_processing.gaps import near, runs_of

Array = NDArray[np.float64]
Window = tuple[int, int]

LONGEST_WINDOW = 640
"""Samples of a window after a knock."""
PREDICTION_ORDER = 28
"""Samples from which the next one is predicted: two for each of a dozen modes, and some for the noise. A window
between knocks is seen whole from twice as many on."""
KNOCK = 12.0
"""Error of the prediction over its median, at a knock: 4.5 standard deviations of white noise, forward and backward."""
COARSE_KNOCK = 0.2
"""The same over the loudness there, for the first search."""
FINE_KNOCK = 0.03
"""The same for the second one: what is predicted to 30 dB rings freely, however low the noise."""
RIDGE = 1e-9
"""Power of the white noise assumed beside the recorded one, over that of the ringing."""


def free_windows(shot: Array, shortest: int) -> tuple[Window, ...]:
    """Find the windows of free ringing: between the knocks, as long as it is heard.

    Free ringing can be predicted from its own past or future, a knock from neither. Knocks are where the
    error of a linear prediction stands out of its usual size, and of what rings there.

    Parameters
    ----------
    shot : ndarray, shape (n,)
        From the shot on.
    shortest
        Samples of a window that is worth fitting.

    Returns
    -------
    tuple of (begin, end)
        Sample indices, as for a slice.
    """
    if shot.size < max(shortest, 16):
        return ()
    order = min(PREDICTION_ORDER, shot.size // 8)
    loudness = np.sqrt(np.convolve(shot**2, np.full(shortest, 1.0 / shortest), mode="same"))
    free: tuple[Window, ...] = ((0, shot.size),)
    # the knocks themselves spoil the first prediction; the second is fitted between them
    for least in (COARSE_KNOCK, FINE_KNOCK):
        missed = _unpredicted(shot, free, order)
        knocks = near(missed > np.maximum(KNOCK * float(np.median(missed)), least * loudness), 2)
        free = tuple(runs_of(~knocks))
    heard = loudness > max(2.0 * float(np.quantile(loudness, 0.02)), 0.01 * float(loudness.max()))
    windows = []
    for begin, end in free:
        last = min(end, begin + LONGEST_WINDOW)
        audible = np.flatnonzero(heard[begin:last])
        if audible.size:
            last = int(begin + audible[-1] + 1)
            if last - begin >= shortest:
                windows.append((begin, last))
    return tuple(windows)


def _unpredicted(shot: Array, windows: tuple[Window, ...], order: int) -> Array:
    """Size of the error with which each sample is predicted, from those before or behind it, whichever is better.

    Only inside a knock both fail: behind it the ringing is free already, before it, it still is.
    """
    products = hankel_covariance(shot, windows, order)
    # a little white noise keeps the equations regular where nothing is random
    ridge = (RIDGE * products[0, 0] + np.finfo(np.float64).tiny) * np.eye(order)
    forward = np.linalg.solve(products[:-1, :-1] + ridge, products[:-1, -1])[::-1]
    backward = np.linalg.solve(products[1:, 1:] + ridge, products[1:, 0])[::-1]
    ahead = np.convolve(shot, np.append(1.0, -forward))[: shot.size]
    behind = np.convolve(shot, np.append(-backward, 1.0))[order:]
    return np.minimum(np.abs(ahead), np.abs(behind))


def hankel_covariance(shot: Array, windows: tuple[Window, ...], lag: int) -> Array:
    """Sum over all windows of the products of samples up to a lag apart, shape (lag + 1, lag + 1).

    The entry one further down the diagonal has lost the first product of each window and gained one behind
    its last: one row is computed, the others follow.

    Parameters
    ----------
    shot : ndarray, shape (n,)
    windows
        Those of no more than `lag` samples are left out.

    Returns
    -------
    ndarray, shape (lag + 1, lag + 1)
        Zero if every window is left out.
    """
    first_row = np.zeros(lag + 1)
    begins, ends = [], []
    for begin, end in windows:
        if end - begin > lag:
            shifted = np.lib.stride_tricks.sliding_window_view(shot[begin:end], lag + 1)
            # plain sums: a threaded scalar product of this size waits longer for its threads than it computes
            first_row += np.einsum("tj,t->j", shifted, shot[begin : end - lag])
            begins.append(shot[begin : begin + lag + 1])
            ends.append(np.append(shot[end - lag : end], 0.0))
    if not begins:
        return np.zeros((lag + 1, lag + 1))
    lost, gained = np.array(begins), np.array(ends)
    change = np.einsum("wi,wj->ij", gained, gained) - np.einsum("wi,wj->ij", lost, lost)
    covariance = np.empty((lag + 1, lag + 1))
    covariance[0] = covariance[:, 0] = first_row
    for row in range(lag):
        covariance[row + 1, 1:] = covariance[row, :-1] + change[row, :-1]
    return covariance
