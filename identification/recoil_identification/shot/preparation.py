"""One shot from aligned channels to the equation of motion as recorded: what every estimator begins with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.calibration.skew import without_skew
from recoil_processing.gaps import bridge
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.shot.kinematics import (
    AngularMotion,
    angular_motion,
    fused_motion,
    inertial_acceleration,
    seen_acceleration,
    still,
    travel_acceleration,
    travel_and_velocity,
)
from recoil_processing.shot.line_motion import LineMotion
from recoil_processing.shot.line_regression import line_motion, line_regression
from recoil_processing.shot.regression import Regression, build_regression
from recoil_processing.shot.signals import Signals, at_instants, collect_signals
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import MotionAlignment, RedundantAlignment
from recoil_rigs.shots.fired_shot import FiredShot


@dataclass(frozen=True, eq=False)
class Prepared(ReadOnlyArrays):
    """A shot's equation of motion as recorded.

    Attributes
    ----------
    motion
        Motion of carriage and tipping part; at rest of a body on a line.
    camera
        Displacement on its own clock, without the delay of its chain; None of a body on a line, whose displacement is
        among the signals.
    camera_clock
        Alignment of the camera's clock.
    acceleration_m_s2 : ndarray, shape (n,)
        Second derivative of the travel along the tipping part by the accelerometers.
    seen_m_s2 : ndarray, shape (n,)
        Second derivative of what the camera would see, by the accelerometers.
    travel_m, velocity_m_s : ndarray, shape (n,)
        Travel and velocity of `fused`, or of the accelerometers' integrals.
    fused
        Camera and accelerometers together; None without a camera that was aligned.
    inertial_m_s2 : ndarray, shape (n,)
        a' by the accelerometer, as `recorded` took it.
    static_m_s2
        Reading of the accelerometer at rest in battery.
    line
        Motion of a body on a line; None of a gun.
    """

    alignments: Mapping[str, ClockAlignment]
    signals: Signals
    motion: AngularMotion
    camera: Channel | None
    camera_clock: ClockAlignment | None
    acceleration_m_s2: Array
    seen_m_s2: Array
    travel_m: Array
    velocity_m_s: Array
    fused: FusedMotion | None
    recorded: Regression
    inertial_m_s2: Array
    static_m_s2: float
    line: LineMotion | None = None

    def without_skew(self, fired: FiredShot, skew_s: float) -> Regression:
        """Set up the equation of motion with an accelerometer that is less late.

        A clock that was aligned by the accelerometer is then as much less late, and so are the forces on it.
        """
        moved = {
            clock: replace(found, offset_s=found.offset_s - skew_s) if _aligned_by_it(clock, fired) else found
            for clock, found in self.alignments.items()
        }
        signals = self.signals if moved == dict(self.alignments) else collect_signals(fired, moved)
        acceleration = without_skew(self.signals.times_s, self.inertial_m_s2, skew_s)
        if self.line is not None:
            return line_regression(signals, fired.rig, replace(self.line, acceleration_m_s2=acceleration))
        return build_regression(signals, fired.rig.mechanism, acceleration, self.velocity_m_s, self.static_m_s2)


def prepare(fired: FiredShot) -> Prepared:
    """Set up the equation of motion of one shot.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Raises
    ------
    IdentificationError
        If an acceleration or a pressure is missing, or the record shows no recoil.
    """
    return _prepared(fired.rig.mechanism, fired, {a.clock: a for a in fired.shot.alignments})


@singledispatch
def _prepared(mechanism: Mechanism, fired: FiredShot, alignments: Mapping[str, ClockAlignment]) -> Prepared:
    if "recoil_acceleration" not in fired.roles:
        raise IdentificationError(
            "no channel of role recoil_acceleration",
            found=", ".join(c.role for c in fired.shot.channels.values() if c.role) or "no roles",
            remedy="declare its role in the rig file",
        )
    signals = collect_signals(fired, alignments)
    if not np.isfinite(signals.series.get("recoil_acceleration", 0.0)).any():
        raise IdentificationError(
            "no sample of the recoiling part's accelerometer can be used",
            expected="a record of the shot",
            remedy="check its file, its range and its cable",
        )
    if "recoil_acceleration" not in signals.series:
        raise IdentificationError("the recoiling part's accelerometer is on a clock that could not be aligned")
    motion = angular_motion(signals, fired.rig)
    filmed = fired.channel("recoil_displacement")
    camera = None if filmed is None else at_instants(filmed.recorded, fired)
    camera_clock = None if camera is None else alignments.get(camera.time_base.clock)
    along = travel_acceleration(signals, fired.rig, motion)
    seen = seen_acceleration(signals, fired.rig, motion) if fired.rig.camera_on_ground else along
    fused = fused_motion(signals, seen, camera, camera_clock, along if fired.rig.camera_on_ground else None)
    travel, velocity = travel_and_velocity(fused, along, signals.step_s)
    static = mechanism.at_rest["recoil_acceleration"]
    inertial = inertial_acceleration(signals, fired.rig, motion)
    return Prepared(
        alignments=alignments,
        signals=signals,
        motion=motion,
        camera=camera,
        camera_clock=camera_clock,
        acceleration_m_s2=along,
        seen_m_s2=seen,
        travel_m=travel,
        velocity_m_s=velocity,
        fused=fused,
        recorded=build_regression(signals, mechanism, inertial, velocity, static),
        inertial_m_s2=inertial,
        static_m_s2=static,
    )


@_prepared.register
def _prepared_of_line(mechanism: Line, fired: FiredShot, alignments: Mapping[str, ClockAlignment]) -> Prepared:
    signals = collect_signals(fired, alignments)
    static = mechanism.at_rest["recoil_acceleration"]
    line = line_motion(signals, fired.rig)
    acceleration = bridge(line.acceleration_m_s2, otherwise=static) - static
    return Prepared(
        alignments=alignments,
        signals=signals,
        motion=still(signals.times_s.size),
        camera=None,
        camera_clock=None,
        acceleration_m_s2=acceleration,
        seen_m_s2=acceleration,
        travel_m=line.travel_m,
        velocity_m_s=line.velocity_m_s,
        fused=None,
        recorded=line_regression(signals, fired.rig, line),
        inertial_m_s2=line.acceleration_m_s2,
        static_m_s2=static,
        line=line,
    )


def _aligned_by_it(clock: str, fired: FiredShot) -> bool:
    """Return whether a clock was aligned by the accelerometer on the recoiling part."""
    accelerometer = fired.shot.by_role("recoil_acceleration")
    align = next((source.align for source in fired.rig.sources if source.name == clock), None)
    if accelerometer is None or not isinstance(align, RedundantAlignment | MotionAlignment):
        return False
    return align.against == accelerometer.name
