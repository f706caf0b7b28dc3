"""Influences that several shots share: a sensor's scale, an area, the friction, a calibration standard."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.shot.shot_summary import OF_SENSOR, OF_STANDARD


@dataclass(frozen=True)
class Influence:
    """One common influence.

    Attributes
    ----------
    identity
        Name in summaries: what bears the same identity is off by the same, in every shot and campaign.
    label
        Name for people.
    u
        Standard uncertainty of the influence, in `unit`; the largest where shots state several.
    unit
        ``1`` for shares.
    """

    identity: str
    label: str
    u: float
    unit: str = "1"

    @property
    def is_sensor(self) -> bool:
        """True for a sensor's own scale, which may drift."""
        return self.identity.startswith(OF_SENSOR)


def influences_of(shots: Iterable[CampaignShot]) -> tuple[Influence, ...]:
    """List what the shots have in common, in the order in which they name it; what is exactly known is left out."""
    found: dict[str, tuple[float, str]] = {}
    for shot in shots:
        for parameter in () if shot.summary is None else shot.summary.parameters:
            for identity, u in parameter.influences:
                if u > 0:
                    known = found.get(identity, (0.0, ""))
                    found[identity] = (max(known[0], u), parameter.unit)
    return tuple(Influence(identity, label_of(identity), u, unit) for identity, (u, unit) in found.items())


def label_of(identity: str) -> str:
    """Say for people what an identity names.

    >>> label_of("sensor:breech_pressure:4711:2026-03-01")
    'breech_pressure scale, sensor 4711'
    >>> label_of("rig:mixed:bore_area")
    'bore_area'
    >>> label_of("standard:deadweight-7")
    'standard deadweight-7'
    """
    kind, _, rest = identity.partition(":")
    if f"{kind}:" == OF_SENSOR:
        role, _, sensor = rest.partition(":")
        return f"{role} scale, sensor {re.sub(r':[0-9-]{10}$', '', sensor)}"
    if f"{kind}:" == OF_STANDARD:
        return f"standard {rest}"
    return rest.rpartition(":")[2]
