"""The plan of a campaign, from the options of `simulate`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from recoil_acquisition.errors import Fault
from recoil_acquisition.quantities.declaration import declared
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
    table = dict(given)
    for key, value in given.items():
        if OPTIONS[key][1]:
            table[key] = _taken_apart(key, value)
    if "charges" in table:
        table["charges"] = table["charges"].split(",")
    faults: list[Fault] = []
    plan = declared(CampaignPlan, table, (), faults)
    if plan is None:
        raise ValueError("; ".join(_said(fault) for fault in faults))
    plan.check_shots(shots)
    return plan


def _taken_apart(key: str, texts: Sequence[str]) -> dict[Any, Any]:
    """Return what is planned by shot, by channel, or by shot and channel, as the option is written."""
    option, written = OPTIONS[key]
    form = re.sub("KG|NAME|REL", "(?P<what>.+)", written)
    form = form.replace("CHANNEL", "(?P<channel>.+)").replace("SHOT", r"(?P<shot>-?\d+)")
    planned: dict[Any, Any] = {}
    for text in texts:
        found = re.fullmatch(form, text, re.DOTALL)
        if found is None:
            raise ValueError(f"{option} takes {written}, not {text!r}")
        parts = found.groupdict()
        place: list[Any] = [int(parts["shot"])] if "shot" in parts else []
        place += [parts["channel"]] if "channel" in parts else []
        within = planned if len(place) == 1 else planned.setdefault(place[0], {})
        if place[-1] in within:
            where = " at ".join(f"shot {one}" if isinstance(one, int) else one for one in reversed(place))
            raise ValueError(f"{option} is given twice for {where}")
        within[place[-1]] = parts["what"]
    return planned


def _said(fault: Fault) -> str:
    """Say a fault of the plan by the name of the option that is at fault."""
    key = str(fault.parts[0]) if fault.parts else ""
    return f"{OPTIONS[key][0]}: {fault.problem}" if key in OPTIONS else fault.problem
