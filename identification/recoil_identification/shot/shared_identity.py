"""Identities of what many shots share: which error of which sensor, rig or standard an unknown of a summary is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from recoil_identification.estimate.mass import FRICTION
from recoil_identification.rows.breech_chain import chain_source
from recoil_identification.rows.camera_rows import OTHER
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.known_forces import declared_source
from recoil_identification.rows.sensor_priors import RELEASE
from recoil_identification.rows.unread_resistance import SHARE, SLIDE
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import BORE_FRICTION
from recoil_rigs.tables.force_input import AREAS

OF_SENSOR, OF_DYNAMIC, OF_STANDARD, OF_RIG = "sensor:", "dynamic:", "standard:", "rig:"
"""Beginnings of identities, by what they are of."""
OF_SHAPE = "unread_force-"
"""Beginning of the last part of a rig's identity that is one shape of the force that no gauge reads."""
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
