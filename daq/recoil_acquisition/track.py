"""One camera marker's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class Track(ReadOnlyArrays):
    """One marker's path, as a camera's tracking software exported it.

    Attributes
    ----------
    name
        The feature's name in the file.
    axes
        Names of the axes, for example ``("X", "Y")``.
    positions : ndarray of float64, shape (n_frames, n_axes)
        Places of the marker in the unit of the file; a lost frame is NaN on every axis.
    frame_numbers : ndarray of int64, shape (n_frames,)
        Numbers of the frames that the file holds; a gap is a frame that is not in the file.
    unit
        Unit as the file spells it; empty if the file states none.
    time_base
        Stamped time base, on the camera's clock.
    """

    name: str
    axes: tuple[str, ...]
    positions: NDArray[np.float64]
    frame_numbers: NDArray[np.int64]
    unit: str
    time_base: TimeBase

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.positions.shape != (self.time_base.count, len(self.axes)):
            raise ValueError(f"track {self.name!r}: shape {self.positions.shape} does not fit its frames and axes")

    @property
    def lost(self) -> NDArray[np.bool_]:
        """True for each frame that was lost, shape (n_frames,)."""
        return np.asarray(np.isnan(self.positions).any(axis=1), dtype=np.bool_)
