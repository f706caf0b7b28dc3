"""Which channel of a shot tells how the recoiling part moved: by its role the method of the mass is chosen."""

from __future__ import annotations

import numpy as np

from recoil_rigs.shots.fired_shot import FiredShot


def motion_role(fired: FiredShot) -> str | None:
    """Return the role of what tells the motion; None where nothing does.

    What a channel without a sample, or on a clock that could not be aligned, recorded does not count.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.
    """
    return next((role for role in fired.rig.mechanism.motion_roles if not motion_lacks(fired, role)), None)


def motion_lacks(fired: FiredShot, role: str) -> str:
    """Say why a role's channel cannot tell the motion; empty if it can."""
    shot = fired.shot
    channel, name = shot.by_role(role), fired.rig.mechanism.motion_roles[role]
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
