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

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.filters.zero_phase_filter import check_finite

Start = Literal["steady", "mean of ten"]

STANDARD_MEAN = 10
"""Samples whose mean the first two outputs of a pass are, by SAE J211-1 and ISO 6487."""


@dataclass(frozen=True, eq=False)
class TwoPass(ReadOnlyArrays):
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
        from scipy.signal import sosfilt_zi  # only here: it takes a second to import

        return np.asarray(sosfilt_zi(self.sections.copy()))

    @property
    def least_samples(self) -> int:
        """Samples of the shortest record that can be filtered."""
        return 1 if self.start == "steady" else STANDARD_MEAN

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
        check_finite(samples)
        length = min(self.padding_samples, count - 1)
        padded = np.concatenate([reflected(samples, length), samples, reflected(samples[::-1], length)[::-1]])
        both = self._pass(self._pass(padded)[::-1])[::-1]
        return np.ascontiguousarray(both[length : length + count])

    def _pass(self, inputs: Array) -> Array:
        """Filter rows once, from first to last, shape (n, ...)."""
        from scipy.signal import sosfilt  # as above

        set_by_start, state = self._begun(inputs)
        # scipy takes no coefficients that are read-only
        outputs, _ = sosfilt(self.sections.copy(), inputs[len(set_by_start) :], axis=0, zi=state)
        return np.concatenate([set_by_start, outputs]) if len(set_by_start) else outputs

    def _begun(self, inputs: Array) -> tuple[Array, Array]:
        """Return the outputs that the start itself sets, shape (0, ...) or (2, ...), and the state after them."""
        if self.start == "steady":
            return inputs[:0], self._steady.reshape(self._steady.shape + (1,) * (inputs.ndim - 1)) * inputs[0]
        _, b1, b2, _, a1, a2 = self.sections[0]
        level = np.mean(inputs[:STANDARD_MEAN], axis=0)
        later = b2 * inputs[1] - a2 * level
        state = np.stack([b1 * inputs[1] - a1 * level + b2 * inputs[0] - a2 * level, later])
        return np.stack([level, level]), state[np.newaxis]


def reflected(samples: Array, length: int) -> Array:
    """Continue a record backward from its first sample by odd reflection about it, which keeps value and slope.

    Parameters
    ----------
    samples : ndarray, shape (n, ...)
        The record's beginning, more than `length` samples of it.

    Returns
    -------
    ndarray, shape (length, ...)
        Rows in the order of time, a new array.
    """
    return np.asarray(2.0 * samples[:1] - samples[length:0:-1])


def too_short(count: int) -> ValueError:
    """Return the error for a record that is shorter than the standards' start."""
    return ValueError(f"the standards' start needs {STANDARD_MEAN} samples, not {count}")
