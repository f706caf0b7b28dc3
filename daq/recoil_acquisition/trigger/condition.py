"""Conditions of a trigger on one channel: an edge, a window, the slope of the signal, the width of a pulse.

Every condition comes down to one question: does a quantity made of the samples reach a level, after it has been
below a rearm level? The quantity is the sample itself, its depth inside a window, or its rate of change; the sign is
turned round for a falling slope. *Level* and *rearm level* are Dewesoft's words. The state between the two is NI's
hysteresis: a condition that is met stays met until the quantity is below the rearm level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Threshold:
    """A condition with a level.

    Attributes
    ----------
    level
        Level that a sample at it or beyond it reaches.
    rearm
        Level beyond which, on the other side, the signal must have been before; None for `level` itself, which does not
        protect from noise.
    slope
        Side from which the level is reached: ``rising`` from below, ``falling`` from above.
    """

    channel: str
    level: float
    rearm: float | None = None
    slope: Literal["rising", "falling"] = "rising"

    def __post_init__(self) -> None:
        if self.slope not in ("rising", "falling"):
            raise ValueError(f"slope must be 'rising' or 'falling', not {self.slope!r}")
        if not math.isfinite(self.level):
            raise ValueError(f"level must be finite, not {self.level!r}")
        if self.rearm is None:
            return
        if not math.isfinite(self.rearm):
            raise ValueError(f"rearm must be finite, not {self.rearm!r}")
        if self.rearm > self.level if self.slope == "rising" else self.rearm < self.level:
            side = "above" if self.slope == "rising" else "below"
            raise ValueError(
                f"rearm {self.rearm!r} must not be {side} the level {self.level!r} of a {self.slope} slope"
            )

    @property
    def thresholds(self) -> tuple[float, float]:
        """Level and rearm level of the quantity that is compared."""
        rearm = self.level if self.rearm is None else self.rearm
        return (self.level, rearm) if self.slope == "rising" else (-self.level, -rearm)

    def compared(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the quantity that is compared, shape (n_samples,)."""
        return values if self.slope == "rising" else -values

    def bounds(self, lowest: float, highest: float) -> tuple[float, float]:
        """Return what the quantity cannot leave while the samples are between `lowest` and `highest`."""
        return (lowest, highest) if self.slope == "rising" else (-highest, -lowest)


@dataclass(frozen=True)
class Edge(Threshold):
    """The signal reaches a level, in the unit of its channel; see `Threshold`."""

    def border(self, before: float, at: float) -> float:  # noqa: ARG002 - a window needs them
        """Return the value that the signal crossed between two samples."""
        return self.level


@dataclass(frozen=True)
class Window:
    """The signal enters or leaves the range between two levels.

    Attributes
    ----------
    low, high
        Borders, in the unit of the channel. A sample on a border has entered, or has left.
    on
        Way through a border that counts: ``enter`` or ``leave``.
    hysteresis
        Distance beyond a border, on the other side, at which the signal must have been before.
    """

    channel: str
    low: float
    high: float
    on: Literal["enter", "leave"] = "enter"
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f"low must be below high, both finite, not {self.low!r} and {self.high!r}")
        if self.on not in ("enter", "leave"):
            raise ValueError(f"on must be 'enter' or 'leave', not {self.on!r}")
        if not 0 <= self.hysteresis < math.inf:
            raise ValueError(f"hysteresis must be finite and not negative, not {self.hysteresis!r}")
        if self.on == "leave" and not 2 * self.hysteresis < self.high - self.low:
            raise ValueError(f"hysteresis must be less than half the window, not {self.hysteresis!r}")

    @property
    def thresholds(self) -> tuple[float, float]:
        """Level and rearm level of the quantity that is compared."""
        return 0.0, -self.hysteresis

    def compared(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how deep inside the window the samples are, or how far outside, shape (n_samples,)."""
        depth = np.minimum(values - self.low, self.high - values)
        return depth if self.on == "enter" else -depth

    def bounds(self, lowest: float, highest: float) -> tuple[float, float]:
        """Return what the quantity cannot leave while the samples are between `lowest` and `highest`."""
        shallowest = min(lowest - self.low, self.high - highest)
        deepest = min(highest - self.low, self.high - lowest)
        return (shallowest, deepest) if self.on == "enter" else (-deepest, -shallowest)

    def border(self, before: float, at: float) -> float:
        """Return the value that the signal crossed between two samples."""
        outside = before if self.on == "enter" else at
        return self.low if outside <= self.low else self.high


@dataclass(frozen=True)
class RateOfChange(Threshold):
    """The slope of the signal reaches a rate; level and rearm level in the channel's unit per second.

    The rate at a sample is taken from the last sample that lies `over_s` or more before it, or from the one just before
    if `over_s` is 0. Lost samples do not count.

    Attributes
    ----------
    over_s
        Time over which the rate is taken, against noise.
    """

    over_s: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.over_s < math.inf:
            raise ValueError(f"over_s must be finite and not negative, not {self.over_s!r}")


@dataclass(frozen=True)
class PulseWidth(Threshold):
    """A pulse beyond a level lasts longer or shorter than a time; ``falling`` for a pulse downwards.

    A pulse begins at the first sample that reaches the level and ends at the first beyond the rearm level again.
    With `longer_than_s` alone the condition is met as soon as the pulse has lasted so long; otherwise when the
    pulse ends, for that instant. A pulse that was there when arming is none.

    Attributes
    ----------
    longer_than_s
        Least width, seconds.
    shorter_than_s
        Width that a pulse must stay below, seconds.
    """

    longer_than_s: float | None = None
    shorter_than_s: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.longer_than_s is None and self.shorter_than_s is None:
            raise ValueError("a pulse width needs longer_than_s, shorter_than_s, or both")
        for name, limit_s in (("longer_than_s", self.longer_than_s), ("shorter_than_s", self.shorter_than_s)):
            if limit_s is not None and not 0 < limit_s < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {limit_s!r}")
        if (self.longer_than_s or 0.0) >= (math.inf if self.shorter_than_s is None else self.shorter_than_s):
            raise ValueError(f"longer_than_s {self.longer_than_s!r} must be below {self.shorter_than_s!r}")


Condition = Edge | Window | RateOfChange | PulseWidth
