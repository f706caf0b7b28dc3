"""Usability of a shot: usable, for the record only, or not usable."""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum

from recoil_acquisition.remark import Reason


class Usability(StrEnum):
    """State of a shot's verdict, the best first."""

    USABLE = "usable"
    RECORD_ONLY = "record only"
    """The record is sound, but a mass of it would not be valid."""
    NOT_USABLE = "not usable"


def usability(failed: Collection[object], against_mass: Collection[Reason]) -> Usability:
    """Return what a shot is good for.

    Parameters
    ----------
    failed
        Checks that failed.
    against_mass
        Reasons against the mass beside the failed checks.
    """
    if failed:
        return Usability.NOT_USABLE
    return Usability.RECORD_ONLY if against_mass else Usability.USABLE
