"""Repairs of a channel's samples: which ones, how many, why, and in what order.

A repaired sample is not a measured one. Every step says which samples it touched; `Repaired.then` refuses a
step that touched others, or that comes too late.

The order is that of `RepairKind.step`, from the file back to the physics:

1. drop-outs are masked: what is no measurement must enter no fit;
2. clipping is judged while the levels are still those that the converter saw;
3. gaps that no low-pass notices are bridged, but for those that a clipped tip left;
4. hum is fitted and taken off: the level at rest, which the next step integrates, must be free of it;
5. droop is inverted;
6. a zero shift is fitted last, together with the force: it is a column of the regression.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.gaps import runs_of


class RepairKind(StrEnum):
    """Kind of a repair, as reports write it."""

    DROP_OUTS_MASKED = "drop-outs masked"
    CLIPPED_REPAIRED = "clipped repaired"
    CLIPPED_MASKED = "clipped masked"
    LOST_BRIDGED = "lost samples bridged"
    HUM_SUBTRACTED = "hum subtracted"
    DROOP_CORRECTED = "droop corrected"

    @property
    def clips(self) -> bool:
        """Whether it is done to clipped samples."""
        return self in (RepairKind.CLIPPED_REPAIRED, RepairKind.CLIPPED_MASKED)

    @property
    def throughout(self) -> bool:
        """Whether it is done to all samples of a channel and not to stretches of it."""
        return self in (RepairKind.HUM_SUBTRACTED, RepairKind.DROOP_CORRECTED)

    @property
    def step(self) -> int:
        """Place in the order of repairs, from 1; both repairs of clipped samples are one step."""
        return {
            RepairKind.DROP_OUTS_MASKED: 1,
            RepairKind.CLIPPED_REPAIRED: 2,
            RepairKind.CLIPPED_MASKED: 2,
            RepairKind.LOST_BRIDGED: 3,
            RepairKind.HUM_SUBTRACTED: 4,
            RepairKind.DROOP_CORRECTED: 5,
        }[self]


@dataclass(frozen=True, eq=False)
class Repair(ReadOnlyArrays):
    """One thing that was done to a channel.

    Attributes
    ----------
    kind
        Kind of what was done.
    flags : ndarray of bool, shape (n_samples,)
        Samples that the repair touched; no other one has changed.
    sentence
        Sentence on what was done and why.
    figures
        Figures of what was found, by name, units in the names.

    Raises
    ------
    ValueError
        If the flags are not one series of bool.
    """

    kind: RepairKind
    flags: Flags
    sentence: str
    figures: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.flags.ndim != 1 or self.flags.dtype != np.bool_:
            raise ValueError(f"flags must be one series of bool, not {self.flags.dtype} of shape {self.flags.shape}")

    @property
    def count(self) -> int:
        """Number of the samples that it touched."""
        return int(np.count_nonzero(self.flags))

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types; the flags as first samples and lengths of their runs, a figure that is none null."""
        return {
            "what": self.kind.value,
            "count": self.count,
            "of": int(self.flags.size),
            "runs": [[start, stop - start] for start, stop in runs_of(self.flags)],
            "figures": {k: float(v) if math.isfinite(v) else None for k, v in self.figures.items()},
            "detail": self.sentence,
        }


@dataclass(frozen=True, eq=False)
class Repaired(ReadOnlyArrays):
    """A channel's samples and all that was done to them.

    Attributes
    ----------
    samples : ndarray, shape (n_samples,)
        Samples after the repairs; masked ones are NaN.
    repairs
        Repairs in the order in which they were done.
    left : mapping of str to ndarray, shape (n_shapes, n_samples)
        Errors that a repair may have left, by their cause: shapes of standard size, each in all samples at once.
    """

    samples: Array
    repairs: tuple[Repair, ...] = ()
    left: Mapping[str, Array] = field(default_factory=dict)

    def then(self, samples: Array, *repairs: Repair, left: Mapping[str, Array] | None = None) -> Repaired:
        """Take the result of one more step.

        Parameters
        ----------
        samples : ndarray, shape (n_samples,)
            Samples after the step.
        *repairs
            Repairs of the step; none if it found nothing to do.
        left : mapping of str to ndarray, shape (n_shapes, n_samples), optional
            Errors that the step may have left, by their cause.

        Raises
        ------
        ValueError
            If the step comes too late, or touched samples that it does not flag.
        """
        if samples.shape != self.samples.shape:
            raise ValueError(f"a repair keeps the number of samples: {self.samples.shape}, not {samples.shape}")
        last = max((r.kind.step for r in self.repairs), default=0)
        flagged = np.zeros(samples.shape, dtype=bool)
        for repair in repairs:
            if repair.kind.step < last:
                before = next(r.kind for r in self.repairs if r.kind.step == last)
                raise ValueError(f"'{repair.kind}' comes before '{before}', not after it")
            if repair.flags.shape != samples.shape:
                raise ValueError(f"'{repair.kind}' flags {repair.flags.size} samples of {samples.size}")
            flagged |= repair.flags
        silently = changed(self.samples, samples) & ~flagged
        if silently.any():
            raise ValueError(
                f"{np.count_nonzero(silently)} samples changed that no repair flags, first {int(np.argmax(silently))}"
            )
        return Repaired(samples, (*self.repairs, *repairs), {**self.left, **(left or {})})

    def to_json(self) -> list[dict[str, Any]]:
        """List the repairs in JSON types."""
        return [repair.to_json() for repair in self.repairs]


def changed(before: Array, after: Array) -> Flags:
    """Return which samples differ; one that is lost in both does not, shape (n_samples,)."""
    return np.asarray((before != after) & ~(np.isnan(before) & np.isnan(after)))
