"""A camera's clock from the forces: its displacement against the double integral of force over mass.

Where no accelerometer rides on the recoiling part, the motion that the clocks share is the one that the gauges'
forces drive. The mass is one of the unknowns, and so are the gauges' scales and the friction, restricted by their
calibrations: what is wrong with them must not look like time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import failed_alignment, judge_motion
from recoil_processing.alignment.motion_alignment import align_motion
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.shot.clocks.camera_stand import Aligned, by_its_stand, contradicts_stand
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass
from recoil_processing.shot.clocks.forced_recoil import ForcedRecoil
from recoil_processing.shot.instants import instants, with_chains
from recoil_processing.shot.kinematics import LEAST_NOISE_SHARE
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot

METHOD: Final = "force"
"""Name of the method in alignments and reports."""
STEPS = 4
"""Steps of the offset, each linear; the search before them is within a frame."""
SETTLED_S = 1e-7
"""Step after which there is none."""
MOST_OFF = 0.25
"""Share by which the mass may be off the specification; more is a wrong scale or area, or another shot's camera
track."""
U_MODEL_S = 5e-6
"""Standard uncertainty of the offset: what a rigid part, its release and the chains of camera and gauges, taken as
simultaneous, are off. Assumed, from no certificate: `tests/benchmarks/test_camera_benchmark.py` prints the offset's
error over its u."""
MEDIAN_FRAMES = 5
"""Frames in a row that decide where the recoil ends."""
LEAST_NOISE_M_S2 = 1e-6
"""Noise of the forces over the mass; no gauges are better."""


def align_by_force(
    fired: FiredShot, own: Channel, other: Channel, drift_allowance: float, found: Mapping[str, ClockAlignment]
) -> ClockAlignment:
    """Align a camera by its displacement and the forces.

    Only the recoil is compared: when the part runs back, forces that no gauge reads hold it.

    Parameters
    ----------
    own
        The camera's displacement.
    other
        The breech pressure, on the reference clock.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before the record is seen.
    found
        Clocks aligned so far: brake and recuperator may be on one of them.
    """
    clock = own.time_base.clock
    one, two = instants(own, fired), instants(other, fired)
    positions = recoil_only(own.measured)
    try:
        signals = collect_signals(fired, found)
        forced = ForcedRecoil.of(fired, signals)
        u_bend_m = bent_m(fired, own)
        coarse = _by_motion(forced, one.times_s, positions, drift_allowance, u_bend_m)
        if isinstance(coarse, str):
            return failed_alignment(clock, METHOD, coarse)
        offset_s, mass = refined(forced, one.times_s, positions, coarse.offset_s, coarse.drift)
    except IdentificationError as error:
        return failed_alignment(clock, METHOD, str(error))

    # with the forces' errors as the camera track finds them, that alone is judged
    def judged_by(forced: ForcedRecoil, mass: DoubleImpulseMass) -> Aligned:
        fit = _by_motion(forced.corrected(mass), one.times_s, positions, drift_allowance, u_bend_m)
        judged = judge_motion(
            clock,
            fit,
            u_gain=MOST_OFF,
            noise_density=_noise_m_s2(forced) ** 2 * signals.step_s,
            frame_period_s=1.0 / own.time_base.rate_hz,
            method=METHOD,
        )
        return fit, judged

    def by(rig: Rig) -> Aligned:
        other = ForcedRecoil.of(replace(fired, rig=rig), signals)
        try:
            _, other_mass = refined(other, one.times_s, positions, coarse.offset_s, coarse.drift)
        except IdentificationError as error:
            return str(error), failed_alignment(clock, METHOD, str(error))
        return judged_by(other, other_mass)

    fit, judged = judged_by(forced, mass)
    stands = by_its_stand(fired.rig, clock, (fit, judged), by)
    if isinstance(fit, str) or judged.status == "failed" or contradicts_stand(stands):
        return stands
    # scale and zero of an accelerometer cannot be estimated from the forces
    details = {k: v for k, v in (judged.details or {}).items() if k not in ("u_bias_m_s2", "gain_bias_correlation")}
    details |= {"mass_kg": mass.mass_kg, "u_force_s": mass.u_shift_s}
    middle_s = offset_s + coarse.drift * fit.origin_s
    own_s = middle_s - fit.drift * fit.origin_s
    judged = replace(judged, offset_s=own_s, u_offset_s=max(mass.u_shift_s, judged.u_offset_s), details=details)
    specification = fired.rig.specification.mass_kg
    if abs(mass.mass_kg / specification - 1.0) > MOST_OFF:
        off = 100 * (mass.mass_kg / specification - 1.0)
        doubt = (
            f"camera track and forces call for a mass {off:+.0f} % off the specification: another shot's camera track, "
            "or a wrong scale"
        )
        judged = replace(judged, status="ambiguous", reasons=(*judged.reasons, doubt))
    return with_chains(judged, [(own, one), (other, two)], U_MODEL_S, one.u_s, two.u_s)


def bent_m(fired: FiredShot, own: Channel) -> float:
    """Return what optics may bend the recoil by that a channel shows, m; 0 for other motions."""
    return fired.channels[own.name].spec.sensor.u_bent_m if own.role == "recoil_displacement" else 0.0


def refined(
    forced: ForcedRecoil, times_s: Array, positions_m: Array, offset_s: float, drift: float
) -> tuple[float, DoubleImpulseMass]:
    """Step a clock's offset to where camera track and forces agree best; return it, and the mass there.

    Parameters
    ----------
    times_s, positions_m : ndarray, shape (n_frames,)
        Times on the camera's clock, and positions.
    offset_s, drift
        Offset and drift to begin with; the drift is kept.

    Raises
    ------
    IdentificationError
        If too few frames saw the motion, or force and displacement have nothing in common.
    """
    for _ in range(STEPS):
        mapped = (1.0 + drift) * times_s + offset_s
        mass = forced.camera_track_mass(mapped, positions_m, u_shift_s=math.inf)
        offset_s += mass.shift_s
        if abs(mass.shift_s) < SETTLED_S:
            break
    return offset_s, mass


def recoil_only(positions_m: Array) -> Array:
    """Return a displacement up to its largest value, what comes later NaN, shape (n_frames,)."""
    seen = np.flatnonzero(np.isfinite(positions_m))
    if seen.size < MEDIAN_FRAMES:
        return positions_m
    middle = np.median(np.lib.stride_tricks.sliding_window_view(positions_m[seen], MEDIAN_FRAMES), axis=1)
    # a single frame that is wrong is no end of the recoil
    last = seen[int(np.argmax(middle)) + MEDIAN_FRAMES // 2]
    return np.where(np.arange(positions_m.size) <= last, positions_m, np.nan)


def _by_motion(
    forced: ForcedRecoil, times_s: Array, positions_m: Array, drift_allowance: float, u_bend_m: float
) -> MotionFit | str:
    return align_motion(
        times_s,
        positions_m,
        forced.signals.start_s,
        forced.signals.step_s,
        forced.acceleration_m_s2,
        acceleration_sigma_m_s2=_noise_m_s2(forced),
        drift_allowance=drift_allowance,
        u_bend_m=u_bend_m,
    )


def _noise_m_s2(forced: ForcedRecoil) -> float:
    largest = float(np.nanmax(np.abs(forced.inputs.force_n), initial=0.0)) / forced.mass_kg
    return max(forced.inputs.slow_force_n / forced.mass_kg, LEAST_NOISE_SHARE * largest, LEAST_NOISE_M_S2)
