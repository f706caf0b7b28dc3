"""Agreement of the carriage's accelerometers with the camera, which sees the recoil relative to the carriage.

The recoiling part's accelerometer feels the motion over the ground; the travel along the tipping part is that
less the carriage's. So a share of the travel comes from each of the carriage's accelerometers, and a sensor that
is turned, or read in another's place, is off by twice that share, which moves clock and scale of the camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot import ClockAlignment, QualityCheck, Shot
from recoil_processing.alignment.align import INNOVATION_LIMITS
from recoil_processing.quality.motion_checks import check_carriage
from recoil_processing.shot.camera_motion import recorded_motion
from recoil_processing.shot.clocks.forced_recoil import CARRIAGE_ACCELERATIONS
from recoil_processing.shot.signals import at_instants
from recoil_processing.shot.verdict.motion_quality import Recoil
from recoil_rigs.rig import Rig

Array = NDArray[np.float64]

LARGEST_U = 0.3
"""Standard uncertainty of a part's share: from here on a turned sensor could not be distinguished from a sound one."""


def check_carriage_by_camera(
    shot: Shot, rig: Rig, recoil: Recoil, camera: Channel, alignment: ClockAlignment | None
) -> Iterator[QualityCheck]:
    """Check the carriage's accelerometers, as far as the camera's clock was found by the motion.

    Parameters
    ----------
    camera
        Displacement on its own clock.
    alignment
        Of that clock.

    Yields
    ------
    QualityCheck
        By the channel of each of `CARRIAGE_ACCELERATIONS` whose part the camera track identifies, where it fits the
        accelerometers.
    """
    signals, motion = recoil.signals, recoil.motion
    angle = rig.mechanism.phi20 - rig.mechanism.phi10 + motion.beta
    parts = dict(zip(CARRIAGE_ACCELERATIONS, (motion.f_x * np.cos(angle), motion.f_y * np.sin(angle)), strict=True))
    parts = {role: part for role, part in parts.items() if role in signals.series}
    track = recorded_motion(signals, recoil.acceleration, at_instants(camera, shot, rig), alignment)
    if track is None or not parts:
        return
    before = signals.times_s < signals.onset_s
    shapes = np.column_stack([part - np.median(part[before]) if before.any() else part for part in parts.values()])
    whitened = track.motion.likeliest(shapes, range(len(parts)), track.densities)
    found = None if whitened is None else whitened.solve(range(len(parts)))
    if found is None or found.innovation_statistic > INNOVATION_LIMITS[1]:
        return
    for j, role in enumerate(parts):
        channel = shot.by_role(role)
        if channel is None:
            continue
        u = math.hypot(math.sqrt(float(found.covariance[2 + j, 2 + j])), channel.u_rel)
        if u > LARGEST_U:
            continue
        yield QualityCheck(
            channel.name,
            "carriage",
            *check_carriage(float(found.shifts_m_s2[j]), u, polarity=rig.channel(channel.name).polarity),
        )
