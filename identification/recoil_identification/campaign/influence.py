"""Influences that several shots share: a sensor's scale, an area, the friction, a calibration standard."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.inference.unknown import Scope
from recoil_identification.shot.shared_identity import OF_DYNAMIC, OF_SENSOR, source_of
from recoil_processing.shot.error_source import ErrorSource, SourceKind


@dataclass(frozen=True)
class Influence:
    """One common influence.

    Attributes
    ----------
    identity
        Name in summaries: what bears the same identity is off by the same, in every shot and campaign.
    source
        Source of the error, which is its name for people.
    u
        Standard uncertainty of the influence, in `unit`; the largest where shots state several.
    unit
        ``1`` for shares.
    degrees_of_freedom
        Degrees of freedom of `u`, the fewest where shots state several; infinite where it is taken as known.
    """

    identity: str
    source: ErrorSource
    u: float
    unit: str = "1"
    degrees_of_freedom: float = math.inf

    @property
    def is_sensor(self) -> bool:
        """True for a sensor's own scale, which may drift."""
        return self.identity.startswith(OF_SENSOR)

    @property
    def scope(self) -> Scope:
        """Reach of it: all that a sensor measures, or all that is measured on a rig."""
        return "sensor" if self.identity.startswith((OF_SENSOR, OF_DYNAMIC)) else "rig"

    @property
    def is_shape(self) -> bool:
        """True for one shape of the force that no gauge reads, which is no error of anything that is stated."""
        return self.source.kind is SourceKind.UNREAD_SHAPE


def influences_of(shots: Iterable[CampaignShot]) -> tuple[Influence, ...]:
    """List what the shots have in common, in the order in which they name it; what is exactly known is left out."""
    found: dict[str, Influence] = {}
    for summary in (shot.summary for shot in shots if shot.summary is not None):
        for parameter in summary.parameters:
            for identity, u in parameter.influences:
                if u > 0:
                    freedom = summary.degrees_of_freedom.get(identity, math.inf)
                    one = found.get(identity) or Influence(identity, source_of(identity), u, parameter.unit, freedom)
                    fewest = min(one.degrees_of_freedom, freedom)
                    found[identity] = replace(one, u=max(one.u, u), unit=parameter.unit, degrees_of_freedom=fewest)
    return tuple(found.values())
