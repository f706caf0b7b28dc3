"""A blow in a long record: where it acts, which is a small part of the record, and how quick it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.filters import LowPass
from recoil_processing.gaps import near
from recoil_processing.noise import noise_sigma

ACTS = 0.1
"""Share of its largest value from which on a signal acts."""
NOISES = 6.0
"""Multiples of the noise that it must exceed."""
SHORT = 0.1
"""Share of a record that a blow lasts at the most; what acts for longer is a motion of its own."""
SMOOTH_SHARE = 0.2
"""Cut-off behind which it is looked for, share of the rate."""
QUICKER = 2.0
"""Cut-off that a blow needs, times the time for which it acts."""


@dataclass(frozen=True, eq=False)
class Blow(ReadOnlyArrays):
    """One or several blows of a record.

    Attributes
    ----------
    flags : ndarray of bool, shape (n,)
        Samples at which it acts, and as many before and behind.
    lasts_s
        Time for which it acts.
    """

    flags: Flags
    lasts_s: float

    @classmethod
    def of(cls, samples: Array, within: Flags, rate_hz: float) -> Blow | None:
        """Find the blows of a signal; None where it acts for more than a small part of its record.

        Parameters
        ----------
        samples : ndarray, shape (n,)
            Samples, none missing.
        within : ndarray of bool, shape (n,)
            Samples among which they are looked for.
        """
        if not within.any():
            return None
        smooth = LowPass(SMOOTH_SHARE * rate_hz).apply(samples, rate_hz)
        size = np.abs(smooth - float(np.median(smooth)))
        acts = within & (size > max(ACTS * float(size[within].max()), NOISES * noise_sigma(samples)))
        count = int(np.count_nonzero(acts))
        if not 0 < count <= SHORT * np.count_nonzero(within):
            return None
        return cls(near(acts, count) & within, count / rate_hz)

    @property
    def cutoff_hz(self) -> float:
        """Cut-off of a low-pass that leaves it what it is."""
        return QUICKER / self.lasts_s
