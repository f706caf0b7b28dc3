"""One measured time series of one quantity."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.quantity import SI_UNITS


@dataclass(frozen=True)
class Step:
    """One line of a value's history.

    Attributes
    ----------
    what
        The operation, for example ``convert to SI``.
    version
        Version of the package that did it.
    parameters
        Parameters of the step, units in the names; JSON types only.
    """

    what: str
    version: str
    parameters: dict[str, Any] = field(default_factory=dict)


MASK_OVERLOADS = "mask overloads"
"""Operation that loses the samples which an instrument marked as beyond its range; ``samples`` is how many."""


@dataclass(frozen=True, eq=False)
class RawCounts(ReadOnlyArrays):
    """Numbers as the source stored them, beside the physical samples: ``source unit = gain * counts + offset``.

    Attributes
    ----------
    counts : ndarray of integers, shape (n_samples,)
    gain, offset
        Line from counts to the source's own unit.
    unit
        Unit of what `gain` and `offset` lead to, as the source spells it.
    """

    counts: NDArray[np.integer[Any]]
    gain: float
    offset: float
    unit: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.counts.dtype.kind not in "iu":
            raise ValueError(f"raw counts must be integers, not {self.counts.dtype}")


@dataclass(frozen=True, eq=False)
class Channel(ReadOnlyArrays):
    """One measured time series of one quantity on one time base, in SI.

    Attributes
    ----------
    name
        Name of the channel in the rig.
    quantity
        A key of `recoil_acquisition.quantities.quantity.SI_UNITS`.
    samples : ndarray of float64 or float32, shape (n_samples,)
        Values, SI; a lost sample is NaN.
    signal
        Name of the signal in the source's file.
    role
        Role in the equation of motion; empty if the channel has none.
    u_rel
        Relative standard uncertainty of the sensor's scale.
    resolution
        Smallest step between two sample values in SI; 0 if the source does not say.
    raw
        Counts as the source stored them, one for each sample; None where it stored none.

    Raises
    ------
    ValueError
        If the quantity is unknown, or lengths or types contradict the above.
    """

    name: str
    quantity: str
    samples: NDArray[np.floating[Any]]
    time_base: TimeBase
    signal: str = ""
    role: str = ""
    u_rel: float = 0.0
    resolution: float = 0.0
    raw: RawCounts | None = None
    history: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.quantity not in SI_UNITS:
            raise ValueError(f"unknown quantity {self.quantity!r}")
        if self.samples.shape != (self.time_base.count,):
            raise ValueError(
                f"channel {self.name!r}: {self.samples.shape} samples on a time base of {self.time_base.count}"
            )
        if self.samples.dtype not in (np.float64, np.float32):
            raise ValueError(f"channel {self.name!r}: samples must be float64 or float32, not {self.samples.dtype}")
        if self.raw is not None and self.raw.counts.shape != self.samples.shape:
            raise ValueError(
                f"channel {self.name!r}: {self.raw.counts.shape} raw counts beside {self.samples.shape} samples"
            )

    def __repr__(self) -> str:
        rate, clock = f"{self.time_base.rate_hz:.6g} Hz", self.time_base.clock
        return f"Channel({self.name!r}: {self.quantity} in {self.unit}, {self.samples.size} at {rate} on {clock!r})"

    @property
    def unit(self) -> str:
        """SI unit of the samples."""
        return SI_UNITS[self.quantity]

    @property
    def lost(self) -> NDArray[np.bool_]:
        """True for each sample that the instrument lost, shape (n_samples,)."""
        lost: NDArray[np.bool_] = np.isnan(self.samples)
        return lost

    @property
    def overloads(self) -> int:
        """Number of the lost samples that the instrument marked as beyond its range."""
        return sum(int(step.parameters.get("samples", 0)) for step in self.history if step.what == MASK_OVERLOADS)

    @property
    def measured(self) -> NDArray[np.float64]:
        """The samples as float64, shape (n_samples,); NaN where there is no number: lost, or infinite.

        An infinite sample says that something was beyond what the instrument can measure, and no more.
        """
        samples = np.array(self.samples, dtype=np.float64)
        samples[~np.isfinite(samples)] = np.nan
        return samples

    def with_samples(self, samples: NDArray[np.floating[Any]], step: Step) -> Channel:
        """Return a new channel with other samples, no raw counts, and one more line of history."""
        return replace(self, samples=samples, raw=None, history=(*self.history, step))
