"""Which method gives the mass where nobody asked for one: a rule over the channels that a shot has."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot import Shot
from recoil_identification.calibration.methods import Method
from recoil_processing.shot.motion_role import MOTION_CHANNELS, motion_lacks, motion_role

DEFAULTS: Mapping[str, Method] = MappingProxyType(
    {"recoil_acceleration": "calibrated", "recoil_displacement": "camera"}
)
"""Role of the recoiling part's motion -> the default with it and the forces; the first that the shot has counts."""


def default_method(shot: Shot) -> Method:
    """Return the method for the channels that a shot has.

    ``calibrated`` where the recoiling part's acceleration was recorded, ``camera`` where only its travel was: what a
    channel without a sample, or on a clock that could not be aligned, recorded does not count.

    Parameters
    ----------
    shot
        Shot with its alignments.

    Raises
    ------
    IdentificationError
        If neither was recorded.
    """
    role = motion_role(shot)
    if role is not None:
        return DEFAULTS[role]
    raise IdentificationError(
        ", and ".join(motion_lacks(shot, one) for one in MOTION_CHANNELS),
        expected="an accelerometer on the recoiling part, or a camera that follows it, and the three pressures",
        found=", ".join(c.role for c in shot.channels.values() if c.role) or "no roles",
        remedy="add its file, or declare its role in the rig file",
    )
