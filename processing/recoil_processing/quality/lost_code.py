"""A value that stands for lost samples: always the same, where no sensor reads, with nothing on the way to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.quality.limits import Outcome

LEAST = 3
"""Samples of one value that are no coincidence."""
LEAST_GAP = 0.5
"""Share of all other samples' span in which none of them may lie beside the code: what is clipped goes there."""
FAR = 3.0
"""Spans of all other samples by which a code is off where no range is declared."""


@dataclass(frozen=True)
class LostCode:
    """Value that stands for lost samples, in the unit of the samples, and how many there are."""

    value: float
    count: int

    def outcome(self, unit: str) -> Outcome:
        """Say it, and what to do: neither range nor polarity mends it."""
        return "fail", worded(
            f"{self.count} samples are exactly ",
            measured(self.value, unit, ".6g"),
            ", with none near it: a code for samples that were not measured; export them as empty cells, or declare it "
            "as `missing` in the layout of its source",
        )


def find_lost_code(samples: Array, limits: tuple[float, float] | None) -> LostCode | None:
    """Look for a value outside of a sensor's range that returns exactly, far from every other; None if there is none.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    limits
        Declared range of the sensor, in the unit of the samples; None where none is declared.
    """
    present = samples[np.isfinite(samples)]
    if present.size < 2 * LEAST:
        return None
    for value in (float(present.min()), float(present.max())):
        at = present == value
        count = int(np.count_nonzero(at))
        if not LEAST <= count < present.size / 2:
            continue
        others = present[~at]
        span, gap = float(np.ptp(others)), float(np.min(np.abs(others - value)))
        outside = gap > FAR * span if limits is None else not limits[0] <= value <= limits[1]
        if outside and span > 0 and gap > LEAST_GAP * span:
            return LostCode(value, count)
    return None
