"""Arguments of numerical functions: what no result can be had of is refused, in the same words everywhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array


def require_positive(**values: float) -> None:
    """Raise ValueError, by its name, for a number that is not positive and finite."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive, not {value}")


def require_not_negative(**values: float) -> None:
    """Raise ValueError, by its name, for a number that is negative or none."""
    for name, value in values.items():
        if not value >= 0:
            raise ValueError(f"{name} must not be negative, not {value}")


def require_increasing(**instants: Array) -> None:
    """Raise ValueError, by its name, for what is no series of instants each of which is later than the one before."""
    for name, times in instants.items():
        if times.ndim != 1 or not np.all(np.diff(times) > 0):
            raise ValueError(f"{name} must increase strictly")


def require_finite(**series: Array) -> None:
    """Raise ValueError, by its name, for samples some of which are missing or infinite."""
    for name, samples in series.items():
        if not np.all(np.isfinite(samples)):
            raise ValueError(f"{name} must be finite; bridge lost samples first")


def require_alike(**series: NDArray[Any]) -> None:
    """Raise ValueError for what are not series of equal length, by all of their names."""
    shapes = [one.shape for one in series.values()]
    if len(shapes[0]) != 1 or len(set(shapes)) > 1:
        raise ValueError(f"{' and '.join(series)} must be equally many, not {' and '.join(map(str, shapes))}")
