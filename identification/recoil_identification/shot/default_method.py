"""Which method gives the mass where nobody asked for one: a rule over the channels that a shot has."""

from __future__ import annotations

from recoil_acquisition.errors import IdentificationError
from recoil_identification.calibration.methods import Method
from recoil_processing.shot.motion_role import motion_lacks, motion_role
from recoil_rigs.shots.fired_shot import FiredShot


def default_method(fired: FiredShot) -> Method:
    """Return the method for the channels that a shot has.

    ``calibrated`` where the recoiling part's acceleration was recorded, ``camera`` where only its travel was; on a line
    speed and travel are differentiated for ``calibrated``. What a channel without a sample recorded, or one on a clock
    that could not be aligned, does not count.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Raises
    ------
    IdentificationError
        If neither was recorded.
    """
    role = motion_role(fired)
    if role is not None:
        return "camera" if fired.rig.mechanism.needs_carriage(role) else "calibrated"
    raise IdentificationError(
        ", and ".join(motion_lacks(fired, one) for one in fired.rig.mechanism.motion_roles),
        expected="an accelerometer on the recoiling part, or a camera that follows it, and the forces",
        found=", ".join(c.role for c in fired.shot.channels.values() if c.role) or "no roles",
        remedy="add its file, or declare its role in the rig file",
    )
