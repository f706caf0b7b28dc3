"""Usability of a shot, and reasons against its mass.

::

    Usability    usable | record only | not usable
    Reason       one thing that speaks against the mass: a code, what it is about, and a sentence with its remedy
"""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum


class Usability(StrEnum):
    """State of a shot's verdict, the best first."""

    USABLE = "usable"
    RECORD_ONLY = "record only"
    """The record is sound, but a mass of it would not be valid."""
    NOT_USABLE = "not usable"


class ReasonCode(StrEnum):
    """Kind of a reason: what decisions are made by, never its words.

    Those up to `LOST_FORCE` are of the record, and known at the range; those behind it only an estimate can tell.
    """

    CHECK = "check"
    NOISE = "noise"
    RIG = "rig"
    CLOCK = "clock"
    ROLE = "role"
    BASELINE = "baseline"
    COUPLING = "coupling"
    LOST_FORCE = "lost force"
    METHOD = "method"
    SENSOR = "sensor"
    CONSTANCY = "constancy"
    CONVERGENCE = "convergence"
    ZERO = "zero"
    RESIDUAL = "residual"
    ROUTES = "routes"
    TRACK = "track"
    TRACE = "trace"


class Reason(str):
    """Reason against a shot's mass, in one sentence: the figure, its limit, and what to do about it.

    It is its text, so that it is printed and compared as that; decisions are made by its code.

    Attributes
    ----------
    code
        Its kind.
    about
        Channel, clock, source, role, method or row of the budget; ``shot`` where it is none of them.
    """

    __slots__ = ("about", "code")
    code: ReasonCode
    about: str

    def __new__(cls, code: ReasonCode, about: str, text: str) -> Reason:
        """Attach code and subject to a text."""
        self = super().__new__(cls, text)
        self.code, self.about = code, about
        return self

    def __reduce__(self) -> tuple[type[Reason], tuple[ReasonCode, str, str]]:
        """Keep code and subject where it is given to another process."""
        return Reason, (self.code, self.about, str(self))

    def to_json(self) -> dict[str, str]:
        """Return it in JSON types."""
        return {"code": self.code.value, "about": self.about, "text": str(self)}


def usability(failed: Collection[object], against_mass: Collection[Reason]) -> Usability:
    """Return what a shot is good for.

    Parameters
    ----------
    failed
        Checks that failed.
    against_mass
        What speaks against its mass beside them.
    """
    if failed:
        return Usability.NOT_USABLE
    return Usability.RECORD_ONLY if against_mass else Usability.USABLE
