"""A film and the forces of one recoil on one clock, and the mass that brings them in line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.shot import ClockAlignment, Shot
from identification.estimators.double_impulse import DoubleImpulseMass
from identification.force_clocks import METHOD as BY_FORCE
from identification.force_clocks import recoil_only
from identification.forced_recoil import CARRIAGE_ROLES, ForcedRecoil, require_forces
from identification.kinematics import fused_motion, travel_and_velocity
from identification.signals import Signals, at_instants
from processing.fusion import FusedMotion
from rigs.rig import Rig

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FilmedRecoil:
    """A film and the forces on one clock, and the mass that brings them in line.

    Attributes
    ----------
    camera : Channel
        Displacement on its own clock, without the delay of its chain.
    clock : ClockAlignment
        Of that clock, moved to where film and forces agree.
    by_force : bool
        Whether nothing but the forces tells the clock's offset.
    forced : ForcedRecoil
    found : DoubleImpulseMass
    fused : FusedMotion or None
        Film and forces together.
    travel_m, velocity_m_s : ndarray, shape (n,)
    """

    camera: Channel
    clock: ClockAlignment
    by_force: bool
    forced: ForcedRecoil
    found: DoubleImpulseMass
    fused: FusedMotion | None
    travel_m: Array
    velocity_m_s: Array

    @property
    def frame_times_s(self) -> Array:
        """Of the frames, on the reference clock, shape (n_frames,)."""
        return np.asarray(self.clock.to_reference(self.camera.time_base.times_s))

    @property
    def positions_m(self) -> Array:
        """Of the recoil; NaN where a frame was lost, and when the part runs back, shape (n_frames,)."""
        return recoil_only(self.camera.measured)

    @classmethod
    def of(cls, shot: Shot, rig: Rig, signals: Signals) -> FilmedRecoil:
        """Find the mass twice: by the motion that the forces give, and with the end of travel that the film then tells.

        Parameters
        ----------
        shot : Shot
            With its alignments.
        rig : Rig
        signals : Signals

        Raises
        ------
        IdentificationError
            If film, forces or the carriage's accelerometers are missing, or film and forces have nothing in common.
        """
        camera, clock = _camera_of(shot, rig)
        require_forces(signals)
        require_carriage(signals)
        by_force = clock.method == BY_FORCE
        u_shift_s = math.inf if by_force else clock.u_offset_s
        times, positions = camera.time_base.times_s, recoil_only(camera.measured)
        forced = ForcedRecoil.of(shot, rig, signals)
        first = forced.film_mass(clock.to_reference(times), positions, u_shift_s=u_shift_s)
        corrected = forced.corrected(first)
        fused = fused_motion(signals, corrected.acceleration_m_s2, replace(camera, samples=positions), clock)
        travel, velocity = travel_and_velocity(fused, corrected.acceleration_m_s2, signals.step_s)
        forced = ForcedRecoil.of(shot, rig, signals, first.mass_kg, velocity)
        probes = forced.inputs.probes.table[:, forced.inputs.probes.per_unit.shape[1] :]
        found = forced.film_mass(clock.to_reference(times), positions, u_shift_s=u_shift_s, probes_n=probes)
        moved = replace(clock, offset_s=clock.offset_s + found.shift_s)
        return cls(camera, moved, by_force, forced, found, fused, travel, velocity)


def require_carriage(signals: Signals) -> None:
    """Refuse signals that do not tell how the tipping part moves, on which the camera's origin is.

    Raises
    ------
    IdentificationError
        Naming every role that is missing.
    """
    missing = [r for r in CARRIAGE_ROLES if r not in signals.series or not np.isfinite(signals.series[r]).any()]
    if missing:
        raise IdentificationError(
            f"no usable channel of role {', '.join(missing)}: a camera sees the recoil relative to the "
            "tipping part, and without them nothing tells how that moves itself",
            expected="accelerometers on the carriage, or one on the recoiling part",
            remedy="declare their roles in the rig file, or mend the alignment",
        )


def _camera_of(shot: Shot, rig: Rig) -> tuple[Channel, ClockAlignment]:
    camera = shot.by_role("recoil_displacement")
    if camera is None:
        raise IdentificationError(
            "no channel of role recoil_displacement",
            found=", ".join(c.role for c in shot.channels.values() if c.role) or "no roles",
            remedy="declare its role in the rig file, or take another --method",
        )
    name = camera.time_base.clock
    if name == shot.reference_clock:
        return at_instants(camera, shot, rig), ClockAlignment(name, 0.0, 0.0, 0.0, 0.0, "ok", "reference")
    clock = next((a for a in shot.alignments if a.clock == name), None)
    if clock is None or clock.status == "failed":
        raise IdentificationError(
            "the camera's track of the recoiling part is on a clock that could not be aligned",
            found="; ".join(clock.reasons) if clock is not None else "no alignment",
            remedy="check the track, or how the rig file aligns the camera",
        )
    return at_instants(camera, shot, rig), clock
