"""A camera track and the forces of one recoil on one clock, and the mass that brings them in line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.shot.clocks.camera_track import CameraTrack
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass
from recoil_processing.shot.clocks.force_clocks import METHOD as BY_FORCE
from recoil_processing.shot.clocks.force_clocks import recoil_only
from recoil_processing.shot.clocks.forced_recoil import ForcedRecoil, carriage_lacks, require_forces
from recoil_processing.shot.kinematics import fused_motion, travel_and_velocity
from recoil_processing.shot.signals import Signals, at_instants
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot


@dataclass(frozen=True, eq=False)
class TrackedRecoil(ReadOnlyArrays):
    """A camera track and the forces on one clock, and the mass that brings them in line.

    Attributes
    ----------
    camera
        Displacement on its own clock, without the delay of its chain.
    clock
        Alignment of the camera's clock, as it was aligned.
    by_force
        Whether nothing but the forces tells the clock's offset.
    found
        A first mass, with the noise of frames and forces.
    track
        Frames of the motion that agree with their neighbours.
    fused
        Camera track and forces together.
    travel_m, velocity_m_s : ndarray, shape (n,)
    """

    camera: Channel
    clock: ClockAlignment
    by_force: bool
    forced: ForcedRecoil
    found: DoubleImpulseMass
    track: CameraTrack
    fused: FusedMotion | None
    travel_m: Array
    velocity_m_s: Array

    @property
    def positions_m(self) -> Array:
        """Positions of the recoil; NaN where a frame was lost, and when the part runs back, shape (n_frames,)."""
        return recoil_only(self.camera.measured)

    @classmethod
    def of(cls, fired: FiredShot, signals: Signals) -> TrackedRecoil:
        """Find the mass twice: by the motion that the forces give, and with the end of travel that frames tell.

        Parameters
        ----------
        fired
            Shot with its alignments, and its rig.

        Raises
        ------
        IdentificationError
            If frames, forces or the carriage's accelerometers are missing, or frames and forces have nothing in
            common.
        """
        camera, clock = _camera_of(fired)
        require_forces(signals)
        require_carriage(signals, fired.rig)
        by_force = clock.method == BY_FORCE
        u_shift_s = math.inf if by_force else clock.u_offset_s
        times, positions = camera.time_base.times_s, recoil_only(camera.measured)
        forced = ForcedRecoil.of(fired, signals)
        first = forced.camera_track_mass(clock.to_reference(times), positions, u_shift_s=u_shift_s)
        corrected = forced.corrected(first)
        along = corrected.along_m_s2
        seen_along = along if fired.rig.camera_on_ground else None
        track = replace(camera, samples=positions)
        fused = fused_motion(signals, corrected.acceleration_m_s2, track, clock, seen_along)
        travel, velocity = travel_and_velocity(fused, along, signals.step_s)
        forced = ForcedRecoil.of(fired, signals, first.mass_kg, velocity)
        frames_s = clock.to_reference(times)
        found = forced.camera_track_mass(frames_s, positions, u_shift_s=u_shift_s)
        rough = DoubleIntegral.of(forced.acceleration_m_s2, float(signals.times_s[0]), signals.step_s)
        frames = CameraTrack.of(frames_s, positions, forced.inputs.release_s, forced.recorded.interval_s[1], rough)
        return cls(camera, clock, by_force, forced, found, frames, fused, travel, velocity)

    @property
    def u_shift_s(self) -> float:
        """Standard uncertainty of the clock's offset without the camera track and the forces."""
        return math.inf if self.by_force else self.clock.u_offset_s

    @property
    def rate(self) -> tuple[float, float]:
        """Drift by which the frames lie where they lie, if it was found from them, and its u without them.

        A drift that other records told is none of the frames': 0 is left of it, to its standard uncertainty.
        """
        allowance = (self.clock.details or {}).get("drift_allowance")
        if not self.by_force or allowance is None:
            return 0.0, self.clock.u_drift
        return self.clock.drift, float(allowance)


def require_carriage(signals: Signals, rig: Rig) -> None:
    """Refuse signals that do not tell how the tipping part moves, on which the camera's origin is.

    Raises
    ------
    IdentificationError
        Naming every role that is missing.
    """
    missing = carriage_lacks(signals, rig)
    if missing:
        raise IdentificationError(
            f"no usable channel of role {', '.join(missing)}: "
            + (
                "a camera on the ground sees the bore turn, and nothing tells how much it does"
                if rig.camera_on_ground
                else "a camera sees the recoil relative to the tipping part, and nothing tells how that moves itself"
            ),
            expected="accelerometers and a gyro on the carriage or the tipping part, or one on the recoiling part",
            remedy="declare their roles in the rig file, or mend the alignment",
        )


def _camera_of(fired: FiredShot) -> tuple[Channel, ClockAlignment]:
    camera = fired.shot.by_role("recoil_displacement")
    if camera is None:
        raise IdentificationError(
            "no channel of role recoil_displacement",
            found=", ".join(c.role for c in fired.shot.channels.values() if c.role) or "no roles",
            remedy="declare its role in the rig file, or take another --method",
        )
    name = camera.time_base.clock
    if name == fired.shot.reference_clock:
        return at_instants(camera, fired), ClockAlignment(name, 0.0, 0.0, 0.0, 0.0, "ok", "reference")
    clock = next((a for a in fired.shot.alignments if a.clock == name), None)
    if clock is None or clock.status == "failed":
        raise IdentificationError(
            "the camera's track of the recoiling part is on a clock that could not be aligned",
            found="; ".join(clock.reasons) if clock is not None else "no alignment",
            remedy="check the track, or how the rig file aligns the camera",
        )
    return at_instants(camera, fired), clock
