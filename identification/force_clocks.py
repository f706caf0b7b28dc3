"""A camera's clock from the forces: its displacement against the double integral of force over mass.

Where no accelerometer rides on the recoiling part, the motion that the clocks share is the one that the gauges'
forces drive. The mass is one of the unknowns, and so are the gauges' scales and the friction, restricted by their
calibrations: what is wrong with them must not look like time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.shot import ClockAlignment, Shot
from identification.estimators.double_impulse import DoubleImpulseMass
from identification.forced_recoil import ForcedRecoil
from identification.instants import instants
from identification.signals import collect_signals
from processing.align import failed_alignment
from processing.alignment_budget import with_uncertainty
from processing.motion_alignment import align_motion
from processing.motion_fit import MotionFit
from rigs.rig import Rig

METHOD = "force"
"""As it is reported."""
STEPS = 4
"""Of the offset, each linear; the search before them is within a frame."""
SETTLED_S = 1e-7
"""Step after which there is none."""
MOST_INFLATION = 300.0
"""Of the walk over the force's noise: beyond it forces and film do not show one motion."""
MOST_GAIN = 0.25
"""By which the mass may be off the specification; what is more is another shot's file, or a wrong scale."""


def align_by_force(
    shot: Shot, rig: Rig, own: Channel, other: Channel, drift_allowance: float, found: Mapping[str, ClockAlignment]
) -> ClockAlignment:
    """Align a camera by its displacement and the forces.

    Parameters
    ----------
    shot : Shot
    rig : Rig
    own : Channel
        The camera's displacement.
    other : Channel
        The breech pressure, on the reference clock.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before the record is seen.
    found : mapping of str to ClockAlignment
        The clocks aligned so far: brake and recuperator may be on one of them.
    """
    clock = own.time_base.clock
    try:
        signals = collect_signals(shot, rig, found)
        forced = ForcedRecoil.of(shot, rig, signals)
    except IdentificationError as error:
        return failed_alignment(clock, METHOD, str(error))
    one, two = instants(own, shot, rig), instants(other, shot, rig)
    sigma = max(forced.inputs.slow_force_n / forced.mass_kg, 1e-6)
    coarse = align_motion(
        one.times_s,
        own.measured,
        signals.start_s,
        signals.step_s,
        forced.acceleration_m_s2,
        acceleration_sigma_m_s2=sigma,
        drift_allowance=drift_allowance,
    )
    if isinstance(coarse, str):
        return failed_alignment(clock, METHOD, coarse)
    try:
        offset_s, mass = refined(forced, one.times_s, own.measured, coarse.offset_s, coarse.drift)
    except IdentificationError as error:
        return failed_alignment(clock, METHOD, str(error))
    judged = _judge(clock, coarse, offset_s, mass, forced)
    return with_uncertainty(
        judged,
        math.hypot(judged.u_offset_s, one.u_s, two.u_s),
        delays=[*one.delay.to_json(own.name), *two.delay.to_json(other.name)],
        stamps=one.stamps_to_json(),
    )


def refined(
    forced: ForcedRecoil, times_s: np.ndarray, positions_m: np.ndarray, offset_s: float, drift: float
) -> tuple[float, DoubleImpulseMass]:
    """Step the offset to where the film and the forces agree best."""
    for _ in range(STEPS):
        mapped = (1.0 + drift) * times_s + offset_s
        mass = forced.film_mass(mapped, positions_m, u_shift_s=math.inf)
        offset_s += mass.shift_s
        if abs(mass.shift_s) < SETTLED_S:
            break
    return offset_s, mass


def _judge(
    clock: str, coarse: MotionFit, offset_s: float, mass: DoubleImpulseMass, forced: ForcedRecoil
) -> ClockAlignment:
    print(
        coarse.offset_s,
        coarse.u_offset_s,
        offset_s,
        mass.u_shift_s,
        coarse.drift,
        coarse.u_drift,
        coarse.gain,
        coarse.correlation,
        coarse.second_peak,
        coarse.acceleration_density,
        coarse.innovation_statistic,
        coarse.frame_faults,
        mass.inflation,
        mass.mass_kg,
        mass.u_kg,
        mass.marker_sigma_m,
        coarse.velocity_offset_s,
        coarse.u_velocity_offset_s,
    )
    return ClockAlignment(clock, offset_s, mass.u_shift_s, coarse.drift, coarse.u_drift, "ok", METHOD, ())
