"""A clock of a body on a line from its forces: what moved on the clock, against what drove it.

Newton's law relates the two: the acceleration is the sum of all that drives less all that resists, as recorded on the
reference clock, over a mass, less the frictions that no cell reads, which the motion itself tells on its own clock. The
mass is an unknown, and so are the frictions and the shares of the forces, restricted by what is known of them: what is
wrong with them must not look like time. A travel is differentiated twice and a speed once, behind the low-pass that
both sides pass, and at which the offset is told best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import LEAST_CORRELATION, failed_alignment, judge_redundant
from recoil_processing.alignment.redundant_alignment import Beside, RedundantFit, align_redundant
from recoil_processing.filters import LowPass
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_processing.gaps import bridge
from recoil_processing.outliers import agreeing
from recoil_processing.shot.clocks.force_clocks import METHOD, MOST_OFF, bent_m
from recoil_processing.shot.instants import anti_alias_filter, instants, with_chains
from recoil_processing.shot.line_motion import SMOOTH_SHARE, LineMotion, changes_in_s
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.shots.fired_shot import FiredShot

DERIVATIVES = {"displacement": 2, "velocity": 1, "acceleration": 0}
"""Which derivative of a quantity is the acceleration."""
WIDEST_HZ, WIDEST_SHARE = 300.0, 0.15
"""Cut-off to begin with, and the share of the slower rate that it may be."""
HALVINGS = 7
"""Times that the cut-off is halved: a travel in pixels has nothing above some hertz."""

SPEED_CHANGES = 4.0
"""Cut-off of the motion that tells the frictions, times the time in which the forces change."""
SLIDES = 2.0
"""Multiples of the speed over which a friction turns, from which on it has turned."""

MOST_CHANGE = 0.05
"""Share of the forces by which they may change within the offset's uncertainty: what is left of it the mass's own rows
tell, to which it is small then."""


def align_by_forces(
    fired: FiredShot, own: Channel, other: Channel, drift_allowance: float, found: Mapping[str, ClockAlignment]
) -> ClockAlignment:
    """Align a source by a motion of a body on a line and all of its forces.

    Parameters
    ----------
    own
        The source's travel, speed or acceleration.
    other
        The force on the reference clock that the rig names, for all of them.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before the record is seen.
    found
        Clocks aligned so far: a force may be on one of them.
    """
    clock, mechanism = own.time_base.clock, fired.rig.mechanism
    one, two = instants(own, fired), instants(other, fired)
    try:
        signals = collect_signals(fired, found)
    except IdentificationError as error:
        return failed_alignment(clock, METHOD, str(error))
    lacking = [force.name for force in fired.rig.forces if force.name not in signals.series]
    if lacking:
        return failed_alignment(clock, METHOD, f"no usable channel of force {', '.join(lacking)}")
    forces = np.column_stack(
        [
            force.sign * force.per_reading * bridge(signals.series[force.name], otherwise=0.0)
            for force in fired.rig.forces
        ]
    )
    net_n = np.asarray(forces.sum(axis=1))
    own = _sound(own, fired)
    changes_s = changes_in_s(net_n, signals.step_s)
    beside = _frictions(fired, own, one.times_s, forces, SPEED_CHANGES / changes_s)
    fit = fit_to_forces(
        one.times_s,
        own.measured,
        own.quantity,
        signals.start_s,
        signals.step_s,
        net_n / mechanism.m3,
        drift_allowance=drift_allowance,
        source_filter=anti_alias_filter(fired.rig.channel(own.name).sensor),
        beside=beside,
    )
    judged = judge_redundant(clock, fit, method=METHOD, most_u_s=MOST_CHANGE * changes_s)
    if isinstance(fit, str):
        return judged
    judged = replace(judged, details={**(judged.details or {}), "mass_kg": mechanism.m3 / fit.gain})
    off = 1.0 / fit.gain - 1.0
    if judged.status != "failed" and abs(off) > MOST_OFF:
        doubt = (
            f"motion and forces call for a mass {100 * off:+.0f} % off the specification: another shot's file, or a "
            "wrong scale"
        )
        judged = replace(judged, status="ambiguous", reasons=(*judged.reasons, doubt))
    # what moves at v is seen u / v early or late by optics that bend its travel by u
    fastest_m_s = float(np.max(np.abs(beside.columns[:, 1]))) * mechanism.m3 / (1.0 + mechanism.unread_share)
    optics_s = bent_m(fired, own) / fastest_m_s
    return with_chains(judged, [(own, one), (other, two)], math.hypot(one.u_s, optics_s), two.u_s)


def fit_to_forces(
    times_s: Array,
    samples: Array,
    quantity: str,
    start_s: float,
    step_s: float,
    driven: Array,
    *,
    drift_allowance: float,
    source_filter: AnalogLowPass | None = None,
    beside: Beside | None = None,
) -> RedundantFit | str:
    """Find the clock of a motion by what drives it, behind the low-pass at which it is told best.

    Parameters
    ----------
    times_s, samples : ndarray, shape (n_source,)
        Times on the motion's clock, and samples; lost ones NaN.
    quantity
        Key of `DERIVATIVES`.
    start_s, step_s
        Time base of the forces.
    driven : ndarray, shape (n_reference,)
        All that drives less all that resists, over any mass.
    drift_allowance, source_filter, beside
        Arguments of `align_redundant`.

    Returns
    -------
    RedundantFit or str
        A sentence where the two cannot be aligned.
    """
    slowest_s = max(float(np.median(np.diff(times_s))), step_s)
    widest_hz = min(WIDEST_HZ, WIDEST_SHARE / slowest_s)
    fits = [
        align_redundant(
            times_s,
            samples,
            start_s,
            step_s,
            driven,
            drift_allowance=drift_allowance,
            cutoff_hz=widest_hz / 2.0**halving,
            derivative=DERIVATIVES[quantity],
            source_filter=source_filter,
            beside=beside,
        )
        for halving in range(HALVINGS)
    ]
    sound = [fit for fit in fits if isinstance(fit, RedundantFit) and math.isfinite(fit.u_offset_s)]
    alike = [fit for fit in sound if fit.correlation >= LEAST_CORRELATION]
    if alike:
        return min(alike, key=lambda one: one.u_offset_s)
    return max(sound, key=lambda one: one.correlation) if sound else fits[0]


def _sound(channel: Channel, fired: FiredShot) -> Channel:
    """Return a channel without a camera's frames that contradict their neighbours."""
    if fired.rig.source(channel.time_base.clock).kind != "camera":
        return channel
    return replace(channel, samples=agreeing(channel.time_base.times_s, channel.measured))


def _frictions(fired: FiredShot, own: Channel, times_s: Array, forces_n: Array, quickest_hz: float) -> Beside:
    """Return what no cell reads of what holds the body, by its motion on its own clock, over the specification mass.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Instants of the channel's samples on its clock.
    forces_n : ndarray, shape (n_reference, n_forces)
    quickest_hz
        Frequency below which the motion is looked at: one that was differentiated is noise above.
    """
    m = fired.rig.mechanism
    step_s = float(times_s[-1] - times_s[0]) / (times_s.size - 1)
    even_s = times_s[0] + step_s * np.arange(times_s.size)
    series = {}
    for channel in fired.shot.channels.values():
        if channel.role in m.motion_roles and channel.time_base.clock == own.time_base.clock:
            at, samples = instants(channel, fired).times_s, _sound(channel, fired).measured
            known = np.isfinite(samples)
            if known.any():
                series[channel.role] = np.interp(even_s, at[known], samples[known])
    low_pass = LowPass(min(quickest_hz, SMOOTH_SHARE / step_s))
    slow = {role: low_pass.apply(samples, 1.0 / step_s) for role, samples in series.items()}
    motion = LineMotion.of(even_s, slow, (), m.at_rest["recoil_acceleration"], 0.0)
    whole = (1.0 + m.unread_share) / m.m3
    columns = -whole * np.column_stack([np.tanh(motion.velocity_m_s / motion.turning_m_s), motion.velocity_m_s])
    u = [m.u.get("friction", 0.0), m.u.get("slide_friction", 0.0)]
    several = forces_n.shape[1] > 1
    return Beside(
        columns=np.column_stack([np.interp(times_s, even_s, column) for column in columns.T]),
        sizes=np.array([m.friction, m.slide_friction]),
        parts=forces_n / m.m3 if several else np.zeros((forces_n.shape[0], 0)),
        u=np.array([*u, *(scale_uncertainty(fired.rig).gauges if several else ())]),
        # what holds a body that stands, or is about to, no friction tells
        counts=np.interp(times_s, even_s, np.abs(motion.velocity_m_s)) >= SLIDES * motion.turning_m_s,
    )
