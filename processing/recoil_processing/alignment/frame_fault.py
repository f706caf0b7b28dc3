"""Faults of a camera track from one frame on, and the times that its frames were taken at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.measured import Worded, measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags


@dataclass(frozen=True)
class FrameFault:
    """A place from which on the file's times are wrong by one frame period, or its positions by a jump.

    Attributes
    ----------
    index
        First frame of the file, counted from 0, that is wrong; a repeated picture is that frame itself.
    first, last
        Range of such frames that holds the true one with a probability of
        `recoil_processing.alignment.dropped_frames.CREDIBLE`.
    time_s
        Time that the file gives for it, on the camera's clock.
    missing
        1 for a picture that is missing, -1 for one that was written twice, 0 for a jump of the track.
    period_s
        Time by which the later times are early (late).
    log_likelihood_gain
        Log-likelihood that the correction gains.
    jump_m
        Displacement by which the later positions are too large.
    """

    index: int
    first: int
    last: int
    time_s: float
    missing: int
    period_s: float
    log_likelihood_gain: float
    jump_m: float = 0.0

    @property
    def told(self) -> Worded:
        """The fault in a sentence."""
        within = f"{self.first} to {self.last}" if self.last > self.first else f"{self.index}"
        where = f"near frame {self.index} (t = {self.time_s:.4f} s; 95 %: {within}, counted from 0)"
        if self.missing == 0:
            return worded("the track jumps by ", measured(1e3 * self.jump_m, "mm", "+.3g"), f" {where}")
        what, late = (
            ("one frame is missing", "early") if self.missing > 0 else ("one picture was written twice", "late")
        )
        return Worded(f"{what} {where}: all later times are {1e6 * self.period_s:.1f} us {late}")

    def __str__(self) -> str:
        return str(self.told)


def correct_times(times_s: Array, faults: Sequence[FrameFault]) -> tuple[Array, Flags]:
    """Give frames the times that they were taken at.

    Parameters
    ----------
    times_s : ndarray, shape (n_frames,)
        Times of the frames as the file has them.
    faults
        Jumps of the track change no time.

    Returns
    -------
    corrected_s : ndarray, shape (n_frames,)
        Corrected times on the same clock, strictly increasing.
    real : ndarray of bool, shape (n_frames,)
        Flags, false for pictures written twice, which have no time of their own: half way between two frames stands in
        its place, and their positions are to be left out.

    Raises
    ------
    ValueError
        If a fault lies outside the record.
    """
    corrected, real = np.array(times_s, dtype=np.float64), np.ones(times_s.shape, dtype=bool)
    for fault in faults:
        if not 0 < fault.index < times_s.size:
            raise ValueError(f"frame {fault.index} is none of the {times_s.size} frames behind the first one")
        corrected[fault.index :] += fault.missing * fault.period_s
        if fault.missing < 0:
            real[fault.index] = False
    own = np.flatnonzero(real)
    corrected[~real] = np.interp(np.flatnonzero(~real), own, corrected[own])
    return corrected, real
