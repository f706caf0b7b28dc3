"""Which method gives the mass where nobody asked for one: a rule over the channels that a shot has."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot import Shot
from recoil_identification.identified import Method

DEFAULTS: Mapping[str, Method] = MappingProxyType(
    {"recoil_acceleration": "calibrated", "recoil_displacement": "camera"}
)
"""Role of the recoiling part's motion -> the default with it and the forces; the first that the shot has counts."""
MOTION_CHANNELS = MappingProxyType(
    {
        "recoil_acceleration": "the recoiling part's accelerometer",
        "recoil_displacement": "the camera's track of the recoiling part",
    }
)
"""The same roles in words."""


def default_method(shot: Shot) -> Method:
    """Return the method for the channels that a shot has.

    ``calibrated`` where the recoiling part's acceleration was recorded, ``camera`` where only its travel was: what a
    channel without a sample, or on a clock that could not be aligned, recorded does not count.

    Parameters
    ----------
    shot
        With its alignments.

    Raises
    ------
    IdentificationError
        If neither was recorded.
    """
    found = {role: _missing(shot, role, name) for role, name in MOTION_CHANNELS.items()}
    for role, method in DEFAULTS.items():
        if not found[role]:
            return method
    raise IdentificationError(
        ", and ".join(found.values()),
        expected="an accelerometer on the recoiling part, or a camera that follows it, and the three pressures",
        found=", ".join(c.role for c in shot.channels.values() if c.role) or "no roles",
        remedy="add its file, or declare its role in the rig file",
    )


def _missing(shot: Shot, role: str, name: str) -> str:
    """Say why a role's channel cannot be used; empty if it can."""
    channel = shot.by_role(role)
    if channel is None:
        return f"no channel of role {role}"
    if not np.isfinite(channel.measured).any():
        return f"no sample of {name} can be used"
    clock = channel.time_base.clock
    if clock != shot.reference_clock:
        known = next((a for a in shot.alignments if a.clock == clock), None)
        if known is None or known.status == "failed":
            return f"{name} is on a clock that could not be aligned"
    return ""
