"""A clock from a motion that both it and the reference clock recorded, in the same quantity or in two.

Travel against acceleration is `alignment.motion_alignment`: the accelerometer's noise, integrated twice, is
a part of that model. Quantities one integral apart are compared as a channel and its repeat
(`alignment.redundant_alignment`), the integral differentiated first: behind the common low-pass a derivative
is sound, where an integrated acceleration has a walk of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import (
    failed_alignment,
    judge_motion,
    judge_redundant,
)
from recoil_processing.alignment.motion_alignment import align_motion
from recoil_processing.alignment.redundant_alignment import align_redundant
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.shot.clocks.camera_stand import Aligned, by_its_stand
from recoil_processing.shot.clocks.force_clocks import align_by_force, bent_m
from recoil_processing.shot.clocks.line_clocks import DERIVATIVES, align_by_forces
from recoil_processing.shot.instants import anti_alias_filter, instants, with_chains
from recoil_processing.shot.kinematics import (
    LEAST_NOISE_SHARE,
    acceleration_noise,
    angular_motion,
    bridged_kicks,
    seen_acceleration,
)
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.rig import MOTIONS, Rig, Source
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import FORCE_ROLES

Evenly = tuple[float, float, Array]
"""Start and step of even instants of the reference clock, and samples there."""

ROUNDED_S = 1e-6
"""Unit to which programs round the time of a frame."""
WHOLE = 1e-6
"""Share by which a number of frames per second, or of microseconds, may be off a whole one."""
_DERIVATIVES = ("displacement", "velocity", "acceleration", "angular_rate", "angular_acceleration")


def align_by_motion(
    fired: FiredShot,
    source: Source,
    against: str,
    drift_allowance: float,
    found: Mapping[str, ClockAlignment],
) -> ClockAlignment:
    """Align a source by one of its channels and a channel of the reference clock of another quantity.

    Parameters
    ----------
    against
        Name of the reference clock's channel.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before the record is seen.
    found
        Clocks aligned so far: what moves the carriage may be on one of them.
    """
    drift_allowance = allowed_drift(fired, source, drift_allowance)
    spec = fired.rig.motion_channel(source)
    own = None if spec is None else fired.shot.channels.get(spec.name)
    other = fired.shot.channels.get(against)
    if (
        own is not None
        and own.role == "recoil_displacement"
        and _without_samples(other)
        and _rode_along(fired.rig, against)
    ):
        # what rode along recorded nothing; what drives the motion did
        other = fired.shot.by_role("breech_pressure") or other
    if own is None or other is None:
        what = (
            f"channel {against}" if own is not None else f"channel {spec.name}" if spec else "a channel of the motion"
        )
        return failed_alignment(source.name, "motion", f"{what} is not in this shot")
    if other.time_base.clock != fired.shot.reference_clock:
        return failed_alignment(source.name, "motion", f"channel {against} is not on the reference clock")
    if other.role in FORCE_ROLES and own.quantity in DERIVATIVES:
        return align_by_forces(fired, own, other, drift_allowance, found)
    if other.role == "breech_pressure" and own.role == "recoil_displacement":
        return align_by_force(fired, own, other, drift_allowance, found)
    if other.quantity not in MOTIONS.get(own.quantity, ()):
        problem = f"a channel of {own.quantity} is not the motion of one of {other.quantity}"
        return failed_alignment(source.name, "motion", problem)
    if other.quantity == "acceleration":
        return _by_travel(fired, own, other, drift_allowance, found)
    start, step, samples = evenly(fired, other)
    derivative = _DERIVATIVES.index(own.quantity) < _DERIVATIVES.index(other.quantity)
    reference = start, step, samples if derivative else np.gradient(samples, step)
    return align_by_comparison(
        fired, own, other, reference, drift_allowance=drift_allowance, method="motion", derivative=derivative
    )


def allowed_drift(fired: FiredShot, source: Source, drift_allowance: float) -> float:
    """Return the standard uncertainty of a source's rate: its clock's, and that of the frames per second as stated.

    A frame of whole microseconds is a rounded one, unless the frames per second are a whole number: such a number was
    set at the camera.
    """
    channels = [c for c in fired.shot.channels.values() if c.time_base.clock == source.name]
    if source.kind != "camera" or not channels:
        return drift_allowance
    rate_hz = channels[0].time_base.rate_hz
    if source.u_frame_rate is not None:
        return math.hypot(drift_allowance, source.u_frame_rate / rate_hz)
    ticks = 1.0 / (rate_hz * ROUNDED_S)
    rounded = abs(ticks - round(ticks)) < WHOLE * ticks and abs(rate_hz - round(rate_hz)) > WHOLE * rate_hz
    return math.hypot(drift_allowance, 1.0 / (math.sqrt(12.0) * ticks)) if rounded else drift_allowance


def _without_samples(channel: Channel | None) -> bool:
    return channel is None or not np.isfinite(channel.measured).any()


def _rode_along(rig: Rig, name: str) -> bool:
    return any(c.name == name and c.role == "recoil_acceleration" for c in rig.channels)


def align_by_comparison(
    fired: FiredShot,
    own: Channel,
    other: Channel,
    reference: Evenly,
    *,
    drift_allowance: float,
    method: str,
    derivative: bool = False,
) -> ClockAlignment:
    """Align a source by a channel and what it should show.

    Parameters
    ----------
    own, other
        Channel of the source, and the one of the reference clock that `reference` was made of.
    reference
        Start, step, and what the source's channel should show but for its gain.
    method
        Name of the method in the alignment.
    derivative
        Whether it is the derivative of the source's channel that should.
    """
    one, two = instants(own, fired), instants(other, fired)
    sensor = fired.rig.channel(own.name).sensor
    fit = align_redundant(
        one.times_s,
        own.measured,
        *reference,
        drift_allowance=drift_allowance,
        derivative=derivative,
        source_filter=anti_alias_filter(sensor),
    )
    found = judge_redundant(own.time_base.clock, fit, method=method)
    return with_chains(found, [(own, one), (other, two)], one.u_s, two.u_s)


@dataclass(frozen=True)
class Bend:
    """Bend of a travel by optics, as what it is beside an acceleration and a clock.

    A bow of ``4 u s (1 - s)`` over the share s of the travel L has the acceleration ``8 u (v / L)^2`` and lasts for
    some ``L / v``: beside an accelerometer that is quiet it is most of what parts the two. What moves at v is seen
    ``u / v`` early or late.

    Attributes
    ----------
    density
        Noise density of an acceleration that is as uncertain, (m/s^2)^2/Hz.
    u_s
        Standard uncertainty of an instant, s.
    """

    density: float
    u_s: float

    @classmethod
    def of(cls, travel_m: Array, acceleration_m_s2: Array, step_s: float, u_bent_m: float) -> Bend:
        """Return it of a travel, shape (n_frames,), and its acceleration, shape (n,), evenly spaced."""
        reach_m = float(np.nanmax(travel_m) - np.nanmin(travel_m))
        speed_m_s = float(np.ptp(integrate(acceleration_m_s2, step_s)))
        if not (reach_m > 0 and speed_m_s > 0):
            return NO_BEND
        return cls(4.0 * u_bent_m**2 * (speed_m_s / reach_m) ** 3, u_bent_m / speed_m_s)


NO_BEND = Bend(0.0, 0.0)


def _by_travel(
    fired: FiredShot, own: Channel, other: Channel, drift_allowance: float, found: Mapping[str, ClockAlignment]
) -> ClockAlignment:
    """Compare a travel or velocity that is seen with the accelerometers' motion of the recoiling part."""
    clock = own.time_base.clock
    if other.role != "recoil_acceleration":
        return failed_alignment(clock, "motion", f"channel {other.name} must have the role recoil_acceleration")
    try:
        signals = collect_signals(fired, found)
    except IdentificationError as error:
        return failed_alignment(clock, "motion", str(error))
    rig, motion = fired.rig, angular_motion(signals, fired.rig)
    acceleration = seen_acceleration(signals, rig, motion)
    if own.quantity == "velocity":
        reference = signals.start_s, signals.step_s, acceleration
        return align_by_comparison(
            fired, own, other, reference, drift_allowance=drift_allowance, method="motion", derivative=True
        )
    one, two = instants(own, fired), instants(other, fired)

    optics, on_carriage = NO_BEND, rig.mechanism.needs_carriage(own.role)
    if own.role == "recoil_displacement" and not on_carriage:
        optics = Bend.of(own.measured, acceleration, signals.step_s, rig.channel(own.name).sensor.u_bent_m)

    def by(acceleration: Array) -> Aligned:
        largest = float(np.nanmax(np.abs(acceleration - np.nanmedian(acceleration)), initial=0.0))
        sigma = max(acceleration_noise(signals, acceleration), LEAST_NOISE_SHARE * largest)
        sigma = max(sigma, math.sqrt(optics.density / signals.step_s))
        # the pre-trigger baseline fixes the zero; what is left of it is the fit's own unknown
        fit = align_motion(
            one.times_s,
            own.measured,
            signals.start_s,
            signals.step_s,
            acceleration,
            acceleration_sigma_m_s2=sigma,
            drift_allowance=drift_allowance,
            onset_s=signals.onset_s,
            kicks_s=bridged_kicks(signals, acceleration),
            u_bend_m=bent_m(fired, own),
        )
        judged = judge_motion(
            clock,
            fit,
            u_gain=math.hypot(own.u_rel, other.u_rel),
            noise_density=sigma**2 * signals.step_s,
            frame_period_s=1.0 / own.time_base.rate_hz,
        )
        return fit, judged

    found_by = by(acceleration)
    judged = found_by[1]
    if on_carriage:
        judged = by_its_stand(rig, clock, found_by, lambda other: by(seen_acceleration(signals, other, motion)))
    return with_chains(judged, [(own, one), (other, two)], math.hypot(one.u_s, optics.u_s), two.u_s)


def evenly(fired: FiredShot, channel: Channel) -> Evenly:
    """Start, step and samples of a channel on even instants of its clock, lost samples bridged."""
    found = instants(channel, fired)
    times, step = found.times_s, found.stamps.step_s if found.stamps.even else 1.0 / channel.time_base.rate_hz
    samples = bridge(channel.measured, otherwise=0.0)
    if channel.time_base.step_s is None:
        grid = times[0] + step * np.arange(int((times[-1] - times[0]) / step) + 1)
        samples = np.interp(grid, times, samples)
    return float(times[0]), step, samples
