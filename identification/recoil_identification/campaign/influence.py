"""Influences that several shots share: a sensor's scale, an area, the friction, a calibration standard."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.estimate.mass import FRICTION
from recoil_identification.inference.unknown import Scope
from recoil_identification.rows.breech_chain import chain_source
from recoil_identification.rows.camera_rows import OTHER
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.known_forces import declared_source
from recoil_identification.rows.sensor_priors import RELEASE
from recoil_identification.rows.unread_resistance import SHARE, SLIDE
from recoil_identification.shot.shot_summary import OF_DYNAMIC, OF_SENSOR, OF_SHAPE, OF_STANDARD
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import BORE_FRICTION
from recoil_rigs.tables.force_input import AREAS

OF_ONE_RIG: Mapping[str, ErrorSource] = MappingProxyType(
    {
        **{area: ErrorSource(SourceKind.AREA, area) for area in AREAS},
        "friction": FRICTION,
        **{str(source): source for source in (BORE_FRICTION, RELEASE, *DISTORTIONS)},
        "unread_share": SHARE,
        "slide_friction": SLIDE,
        OTHER.name: ErrorSource(SourceKind.CARRIAGE_PART),
    }
)
"""Last part of the identity of what shots of one rig share -> its source."""


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
    """

    identity: str
    source: ErrorSource
    u: float
    unit: str = "1"

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
    found: dict[str, tuple[float, str]] = {}
    for shot in shots:
        for parameter in () if shot.summary is None else shot.summary.parameters:
            for identity, u in parameter.influences:
                if u > 0:
                    known = found.get(identity, (0.0, ""))
                    found[identity] = (max(known[0], u), parameter.unit)
    return tuple(Influence(identity, source_of(identity), u, unit) for identity, (u, unit) in found.items())


def source_of(identity: str) -> ErrorSource:
    """Return what an identity names.

    >>> str(source_of("sensor:breech_pressure:4711:2026-03-01"))
    'breech_pressure scale, sensor 4711'
    >>> str(source_of("dynamic:breech_pressure:4711"))
    'breech_pressure dynamic scale, sensor 4711'
    >>> str(source_of("rig:mixed:bore_area"))
    'bore_area'
    >>> str(source_of("rig:mixed:declared load on p:1"))
    'declared load on p:1'
    >>> str(source_of("standard:deadweight-7"))
    'standard deadweight-7'
    """
    kind, _, rest = identity.partition(":")
    if f"{kind}:" == OF_SENSOR:
        role, _, sensor = rest.partition(":")
        return ErrorSource(SourceKind.SENSOR_SCALE, role, re.sub(r":[0-9-]{10}$", "", sensor))
    if f"{kind}:" == OF_DYNAMIC:
        role, _, sensor = rest.partition(":")
        return ErrorSource(SourceKind.SENSOR_DYNAMIC, role, sensor)
    if f"{kind}:" == OF_STANDARD:
        return ErrorSource(SourceKind.STANDARD, rest)
    if (of_force := declared_source(identity)) is not None:
        return of_force
    name = rest.rpartition(":")[2]
    if name.startswith(OF_SHAPE):
        return ErrorSource(SourceKind.UNREAD_SHAPE, detail=name.removeprefix(OF_SHAPE))
    for late in (ErrorSource(kind, name.partition(" ")[0]) for kind in (SourceKind.DELAY, SourceKind.LINE)):
        if name == late:
            return late
    return OF_ONE_RIG.get(name) or chain_source(name) or ErrorSource(SourceKind.DECLARED, name)
