"""Which channel of a shot tells how the recoiling part moved: by its role the method of the mass is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from recoil_acquisition.shot import Shot

MOTION_CHANNELS: Mapping[str, str] = MappingProxyType(
    {
        "recoil_acceleration": "the recoiling part's accelerometer",
        "recoil_displacement": "the camera's track of the recoiling part",
    }
)
"""Roles of the recoiling part's motion, in words; the first that a shot has counts."""


def motion_role(shot: Shot) -> str | None:
    """Return the role of what tells the motion; None where nothing does.

    What a channel without a sample, or on a clock that could not be aligned, recorded does not count.

    Parameters
    ----------
    shot
        Shot with its alignments.
    """
    return next((role for role in MOTION_CHANNELS if not motion_lacks(shot, role)), None)


def motion_lacks(shot: Shot, role: str) -> str:
    """Say why a role's channel cannot tell the motion; empty if it can."""
    channel, name = shot.by_role(role), MOTION_CHANNELS[role]
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
