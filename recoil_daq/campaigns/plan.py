"""The plan of a campaign, from the options of `simulate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from recoil_acquisition.declaration import declared
from recoil_acquisition.errors import Fault
from recoil_rigs.twin.campaign import CampaignPlan

OPTIONS: Mapping[str, tuple[str, str]] = {
    "added_mass_kg": ("--added-mass", ""),
    "u_added_mass_kg": ("--u-added-mass", ""),
    "charges": ("--charges", ""),
    "friction_scatter": ("--friction-scatter", ""),
    "repeatability": ("--repeatability", ""),
    "mass_steps": ("--mass-step", "KG@SHOT"),
    "configurations": ("--configuration", "NAME@SHOT"),
    "drifts": ("--drift", "CHANNEL=REL"),
    "outliers": ("--outlier", "CHANNEL=REL@SHOT"),
}
"""Key of the plan -> its option, and how that is written if it is put together of parts."""


def plan_of_options(given: Mapping[str, Any], shots: int) -> CampaignPlan:
    """Return the plan of a campaign of so many shots.

    Parameters
    ----------
    given
        Key of the plan -> what the command line has: a number, the charges with commas between them, or the texts of
        an option that may be repeated.

    Raises
    ------
    ValueError
        With every fault of the options, each by its name.
    """
    table: dict[str, Any] = {}
    for key, value in given.items():
        if key == "charges":
            table[key] = value.split(",")
        elif key in ("mass_steps", "configurations"):
            table[key] = _by_shot(key, value)
        elif key == "drifts":
            table[key] = _drifts(value)
        elif key == "outliers":
            table[key] = _outliers(value)
        else:
            table[key] = value
    faults: list[Fault] = []
    plan = declared(CampaignPlan, table, (), faults)
    if plan is None:
        raise ValueError("; ".join(_said(fault) for fault in faults))
    plan.check_shots(shots)
    return plan


def _by_shot(key: str, texts: Sequence[str]) -> dict[int, str]:
    """Return shot -> what happens from it on."""
    planned: dict[int, str] = {}
    for text in texts:
        what, number = _at_shot(key, text)
        if number in planned:
            raise ValueError(f"{OPTIONS[key][0]} is given twice for shot {number}")
        planned[number] = what
    return planned


def _drifts(texts: Sequence[str]) -> dict[str, str]:
    """Return channel -> by what its gain drifts."""
    drifts: dict[str, str] = {}
    for text in texts:
        channel, size = _parted("drifts", text, text, "=")
        if channel in drifts:
            raise ValueError(f"{OPTIONS['drifts'][0]} is given twice for {channel}")
        drifts[channel] = size
    return drifts


def _outliers(texts: Sequence[str]) -> dict[int, dict[str, str]]:
    """Return shot -> channel -> what its gain is off."""
    outliers: dict[int, dict[str, str]] = {}
    for text in texts:
        what, number = _at_shot("outliers", text)
        channel, size = _parted("outliers", text, what, "=")
        errors = outliers.setdefault(number, {})
        if channel in errors:
            raise ValueError(f"{OPTIONS['outliers'][0]} is given twice for {channel} at shot {number}")
        errors[channel] = size
    return outliers


def _at_shot(key: str, text: str) -> tuple[str, int]:
    """Take a text apart into what happens and the number of the shot."""
    what, number = _parted(key, text, text, "@")
    try:
        return what, int(number)
    except ValueError:
        raise ValueError(_wanted(key, text)) from None


def _parted(key: str, text: str, piece: str, sign: str) -> tuple[str, str]:
    """Take a piece of an option's text apart at its last sign."""
    before, _, after = piece.rpartition(sign)
    if not (before and after):
        raise ValueError(_wanted(key, text))
    return before, after


def _wanted(key: str, text: str) -> str:
    option, written = OPTIONS[key]
    return f"{option} takes {written}, not {text!r}"


def _said(fault: Fault) -> str:
    """Say a fault of the plan by the name of the option that is at fault."""
    key = str(fault.parts[0]) if fault.parts else ""
    return f"{OPTIONS[key][0]}: {fault.problem}" if key in OPTIONS else fault.problem
