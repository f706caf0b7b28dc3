"""Which channel of a shot tells how the recoiling part moved: by its role the method of the mass is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from recoil_rigs.shots.fired_shot import FiredShot

MOTION_CHANNELS: Mapping[str, str] = MappingProxyType(
    {
        "recoil_acceleration": "the recoiling part's accelerometer",
        "recoil_displacement": "the camera's track of the recoiling part",
    }
)
"""Roles of the recoiling part's motion, in words; the first that a shot has counts."""
LINE_CHANNELS: Mapping[str, str] = MappingProxyType(
    {
        "recoil_acceleration": "the body's accelerometer",
        "recoil_velocity": "the body's speed",
        "recoil_displacement": "the body's displacement",
    }
)
"""Those of a body on a line likewise: what is no acceleration is differentiated."""


def roles_of_motion(fired: FiredShot) -> Mapping[str, str]:
    """Return the roles that may tell the motion of a shot's mechanism, in words, in the order in which they count."""
    return LINE_CHANNELS if fired.rig.mechanism.on_a_line else MOTION_CHANNELS


def motion_role(fired: FiredShot) -> str | None:
    """Return the role of what tells the motion; None where nothing does.

    What a channel without a sample, or on a clock that could not be aligned, recorded does not count.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.
    """
    return next((role for role in roles_of_motion(fired) if not motion_lacks(fired, role)), None)


def motion_lacks(fired: FiredShot, role: str) -> str:
    """Say why a role's channel cannot tell the motion; empty if it can."""
    shot = fired.shot
    channel, name = shot.by_role(role), roles_of_motion(fired)[role]
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
