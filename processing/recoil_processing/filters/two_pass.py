"""A recursive filter run forward and backward: its sections, its padding and how each pass starts.

The recursion is the transposed direct form II of second-order sections (A. V. Oppenheim, R. W. Schafer,
Discrete-Time Signal Processing, section 6.3), which keeps low cut-offs accurate where one polynomial of
the whole order does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.zero_phase_filter import check_finite, not_finite

Array = NDArray[np.float64]
Start = Literal["steady", "mean of ten"]

STANDARD_MEAN = 10
"""Samples whose mean the first two outputs of a pass are, by SAE J211-1 and ISO 6487."""
SAMPLES_AT_ONCE = 4096
"""Samples of each column that are worked on at a time: they stay in the processor's cache."""


def sweep(sections: Array, state: Array, rows: Array, *, backward: bool = False) -> Array:
    """Filter rows once, from first to last or from last to first, and leave the state behind.

    Parameters
    ----------
    sections : ndarray, shape (n_sections, 6)
    state : ndarray, shape (n_sections, 2, ...)
        State of the recursion, changed in place.
    rows : ndarray, shape (n, ...)
        Rows to filter; they are not changed.

    Returns
    -------
    ndarray of float64, shape (n, ...)
    """
    # scipy.signal has this recursion too, but takes a third of a second to import
    from scipy.linalg.lapack import dtbtrs

    count = rows.shape[0]
    if count == 0:
        return rows.copy()
    inputs, states = (rows[::-1] if backward else rows).reshape(count, -1), state.reshape(*state.shape[:2], -1)
    filtered: Array = np.empty(inputs.shape, order="F")
    # each section is a triangular system of equations with three diagonals, of ones, a1 and a2
    bands = [np.repeat([[1.0, a1, a2]], min(count, SAMPLES_AT_ONCE), axis=0).T for *_, a1, a2 in sections]
    for start in range(0, count, SAMPLES_AT_ONCE):
        part = inputs[start : start + SAMPLES_AT_ONCE]
        for band, at, (b0, b1, b2, _, a1, a2) in zip(bands, states, sections, strict=True):
            driven = np.multiply(part, b0, order="F")
            driven[1:] += b1 * part[:-1]
            driven[2:] += b2 * part[:-2]
            driven[:2] += at[: part.shape[0]]
            outputs, _ = dtbtrs(band[:, : part.shape[0]], driven, uplo="L", diag="U", overwrite_b=True)
            later = b2 * part[-2:] - a2 * outputs[-2:]
            at[:] = b1 * part[-1] - a1 * outputs[-1] + (later[0] if part.shape[0] > 1 else at[1]), later[-1]
            part = outputs
        filtered[start : start + SAMPLES_AT_ONCE] = part
    state[...] = states.reshape(state.shape)
    filtered = filtered.reshape(rows.shape)
    return np.asarray(filtered[::-1] if backward else filtered, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class TwoPass:
    """A recursion at one sampling rate, run forward and then backward.

    Attributes
    ----------
    sections : ndarray, shape (n_sections, 6)
        ``b0 b1 b2 1 a1 a2`` of one pass.
    padding_samples
        Samples by which either end is continued, by odd reflection; a record that is shorter is continued by all that
        it has but one.
    start : {"steady", "mean of ten"}
        Each pass starts as if its first sample had always been there, or by the rule of the standards
        (one section only): its first two outputs are the mean of its first ten inputs.
    """

    sections: Array
    padding_samples: int
    start: Start = "steady"

    @cached_property
    def _steady(self) -> Array:
        """State of the sections after a constant 1, shape (n_sections, 2)."""
        states, level = np.empty((len(self.sections), 2)), 1.0
        for state, (b0, b1, b2, _, a1, a2) in zip(states, self.sections, strict=True):
            output = level * (b0 + b1 + b2) / (1.0 + a1 + a2)
            state[:] = output - b0 * level, b2 * level - a2 * output
            level = output
        return states

    @property
    def least_samples(self) -> int:
        """Samples of the shortest record that can be filtered."""
        return 1 if self.start == "steady" else STANDARD_MEAN

    def steady_state(self, level: Array) -> Array:
        """Return the state after inputs that have always been at a level, shape (...) to (n_sections, 2, ...)."""
        return self._steady.reshape(self._steady.shape + (1,) * np.ndim(level)) * level

    def begin(self, inputs: Array) -> tuple[Array, Array]:
        """Start a pass.

        Parameters
        ----------
        inputs : ndarray, shape (n, ...)
            Inputs of the pass, the first ones in its order: ten, or all if there are fewer.

        Returns
        -------
        outputs : ndarray, shape (0, ...) or (2, ...)
            Outputs that the start itself sets; the recursion goes on after them.
        state : ndarray, shape (n_sections, 2, ...)
        """
        if self.start == "steady":
            return inputs[:0], self.steady_state(inputs[0])
        _, b1, b2, _, a1, a2 = self.sections[0]
        level = np.mean(inputs[:STANDARD_MEAN], axis=0)
        later = b2 * inputs[1] - a2 * level
        state = np.stack([b1 * inputs[1] - a1 * level + b2 * inputs[0] - a2 * level, later])
        return np.stack([level, level]), state[np.newaxis]

    def run(self, samples: Array) -> Array:
        """Filter a whole record along its first axis.

        Parameters
        ----------
        samples : ndarray, shape (n, ...)

        Returns
        -------
        ndarray of float64, same shape
            A new array.

        Raises
        ------
        ValueError
            If a sample is not finite, or the record is too short for the standards' start.
        """
        if samples.size == 0:
            return np.array(samples, dtype=np.float64)
        samples, count = np.asarray(samples, dtype=np.float64), samples.shape[0]
        if count < self.least_samples:
            raise too_short(count)
        length = min(self.padding_samples, count - 1)
        check_finite(samples[: length + 1])
        check_finite(samples[-length - 1 :])
        head, tail = reflected(samples, length), reflected(samples[::-1], length)[::-1]
        outputs, state = self.begin(np.concatenate([head[:STANDARD_MEAN], samples[:STANDARD_MEAN]]))
        sweep(self.sections, state, head[outputs.shape[0] :])
        forward = sweep(self.sections, state, samples)
        # a missing or infinite sample stays in the state of a recursion for ever
        if not np.all(np.isfinite(state)):
            raise not_finite()
        tail = sweep(self.sections, state, tail)
        end = np.concatenate([forward[-STANDARD_MEAN:], tail[-STANDARD_MEAN:]])
        outputs, state = self.begin(end[::-1])
        sweep(self.sections, state, tail[: tail.shape[0] - outputs.shape[0]], backward=True)
        return sweep(self.sections, state, forward, backward=True)


def reflected(samples: Array, length: int) -> Array:
    """Continue a record backward from its first sample by odd reflection about it, which keeps value and slope.

    Parameters
    ----------
    samples : ndarray, shape (n, ...)
        The record's beginning, more than `length` samples of it.

    Returns
    -------
    ndarray, shape (length, ...)
        Filtered rows in the order of time, a new array.
    """
    return np.asarray(2.0 * samples[:1] - samples[length:0:-1])


def too_short(count: int) -> ValueError:
    """Return the error for a record that is shorter than the standards' start."""
    return ValueError(f"the standards' start needs {STANDARD_MEAN} samples, not {count}")
