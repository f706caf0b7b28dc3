"""Reasons against a shot's mass, by the accelerometer or by the camera alone, and notes for its reader."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.measured import measured, worded
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import MassConstancy
from recoil_identification.calibration.suspicion import ShotSuspicion
from recoil_identification.calibration.trace import MassTrace
from recoil_identification.estimate.mass import ACCELERATION, RANDOM
from recoil_identification.estimate.rounding import rounded, significant
from recoil_identification.estimators.endogeneity import Endogeneity
from recoil_identification.rows.camera_rows import LATE
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.route import Route
from recoil_identification.shot.sensor_doubts import nearly_doubted, weighed_doubts
from recoil_processing.alignment.align import INNOVATION_LIMITS, MOST_SET_ASIDE
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.error_source import ErrorSource
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.release import SUSTAINED
from recoil_processing.shot.signals import Signals
from recoil_processing.shot.verdict.consequence import LEAST_CONSEQUENCE
from recoil_processing.shot.verdict.mass_reasons import (
    against_losses,
    against_signals,
    doubted_clocks,
    doubts_of,
    failed_checks,
    lost_share,
    unused_channels,
)
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import CARRIAGE_ROLES

PLAIN = ("reverse", "forward")
"""Methods that regress one side of the equation of motion on the other, behind one low-pass."""
HIDDEN_U = 2.0
"""Standard uncertainties up to which a drift may hide that moves the mass found."""
LARGEST_UNEXPLAINED = 0.05
"""Share of the acceleration that may be left in a coloured way: by friction that hangs on the place it is below 1 %."""
MOST_UNEXPLAINED = 0.2
"""Share beyond which what is left explains the motion as well as a mass does, and no number is given."""
QUIET_REST = 2.0
"""Noise of the shot over that of the rest from which on it is mentioned."""
LARGEST_ROUTE_GAP = 3.0
"""Combined standard uncertainties by which the two routes to the acceleration may differ."""
LARGEST_SHIFT = 4.0
"""Standard uncertainties by which frames and forces may call for another offset of the clock than it was aligned by."""
UNCHECKED = (
    "no accelerometer on the recoiling part was used: what it checks is not checked, the camera's scale and a skew of "
    "the recorder's channels among it"
)
JUDGED_TOGETHER = (
    ReasonCode.RIG,
    ReasonCode.SENSOR,
    ReasonCode.BREECH_CHAIN,
    ReasonCode.METHOD,
    ReasonCode.CONSTANCY,
)
"""Codes of reasons that many shots judge better than one: they tell by how much sensors are off, what nobody stated of
the breech chain and its like, and whether the mass changes or a force acts that no gauge reads; a rig file is doubted
for all of them, and a campaign has a method of its own."""


def reasons_against(
    fired: FiredShot,
    route: Route,
    trace: MassTrace,
    constancy: MassConstancy | None,
    endogeneity: Endogeneity | None = None,
    chain: ShotSuspicion | None = None,
) -> tuple[Reason, ...]:
    """Say what speaks against the result.

    Parameters
    ----------
    trace
        Mass over time by the method that was asked for.
    endogeneity
        Test on bias of force on acceleration as recorded; None where that cannot be told.
    chain
        Suspicion of the breech chain where nobody states it; None where the shot can tell nothing.

    Returns
    -------
    tuple of Reason
        One sentence each, with its limit; empty if nothing does.
    """
    unused = () if route.tracked is None else unused_channels(fired)
    reasons = reasons_against_record(fired, route.signals, trace, route.filtered, unused)
    reasons += _against_the_rate(route.recorded)
    reasons += [one for one, held in weighed_doubts(route.calibration, constancy, chain) if not held]
    reasons += _against_what_hides(route.calibration, constancy)
    reasons += _against_the_method(route, endogeneity)
    if not route.calibration.inferred.converged:
        text = "mass and sensors' errors did not settle: check areas, units and signals of the pressures"
        reasons.append(Reason(ReasonCode.CONVERGENCE, "shot", text))
    reasons += _against_the_fit(route) if route.tracked is None else against_the_track(route.tracked, route.calibration)
    return tuple(reasons)


def reasons_against_record(
    fired: FiredShot, signals: Signals, trace: MassTrace, filtered: Regression, unused: Collection[str] = ()
) -> list[Reason]:
    """Say what speaks against the record of a shot, whatever its mass was found by: what the range says, and the trace.

    Parameters
    ----------
    fired, signals
    trace
        Mass over time by the method that gives the mass.
    filtered
        Regression behind the filter, which tells what of the pulse was lost.
    unused
        Channels that the mass does not hang on.
    """
    reasons = [
        *failed_checks(fired.shot, unused),
        *doubts_of(fired.rig),
        *doubted_clocks(fired),
        *against_signals(signals, fired.rig),
        *against_losses(fired.shot, lost_share(filtered)),
    ]
    if trace.share < (least := filtered.least_identified):
        text = f"only {100 * trace.share:.0f} % of the interval could be identified (limit {100 * least:.0f} %)"
        reasons.append(Reason(ReasonCode.TRACE, "shot", text))
    return reasons


def _against_the_rate(recorded: Regression) -> Iterator[Reason]:
    """Say that the record has too few samples of the force that drives the part: it may have missed the most of it."""
    driving = int(np.count_nonzero(recorded.inside & recorded.acts))
    if driving < SUSTAINED:
        text = (
            f"the net force drives the part for {driving} samples only (limit {SUSTAINED}), {recorded.rate_hz:g} a "
            "second: what a sample stands for nobody knows; record faster"
        )
        yield Reason(ReasonCode.LOST_FORCE, "breech_pressure", text)


def _against_what_hides(calibration: Calibration, constancy: MassConstancy | None) -> Iterator[Reason]:
    """Say that the mass hangs on its constancy: where the force hardly varies, little else tells it from a zero."""
    # a mean of a mass that drifts is moved by a part of the drift, and that is what one number means
    if constancy is None or not constancy.constant or abs(constancy.moved_by_drift) <= 1.0:
        return
    drift = 100 * HIDDEN_U * constancy.u_drift_rel
    moved = abs(constancy.moved_by_drift) * drift
    # stretches that differ are what a drift makes of them: they do not excuse it
    by_rows = calibration.by_rows
    expanded = 100 * by_rows.coverage_factor * by_rows.u_kg / by_rows.mass_kg
    if moved > expanded:
        yield Reason(
            ReasonCode.HIDDEN_DRIFT,
            "shot",
            f"a drift of the mass of {drift:.2g} % could hide, and would move the mass found by {moved:.2g} %, more "
            f"than its U95 of {expanded:.2g} %: the force varies too little here; let the record begin at rest, or "
            "state the zero of the accelerometer",
        )


def _against_the_method(route: Route, endogeneity: Endogeneity | None) -> Iterator[Reason]:
    """Say that a plain regression is biased here, by the report's own test or by Frisch's bracket."""
    other = "take the default method"
    if route.method == "paper" and endogeneity is not None and endogeneity.biased:
        yield Reason(ReasonCode.METHOD, "paper", f"the method paper is biased in this shot: {endogeneity}; {other}")
    if route.method in PLAIN:
        masses = [route.estimates[method].mass_kg for method in PLAIN]
        u_kg, apart = route.estimates[route.method].u_kg, max(masses) - min(masses)
        if apart > LEAST_CONSEQUENCE * u_kg:
            yield Reason(
                ReasonCode.METHOD,
                route.method,
                f"the method {route.method} is biased in this shot: force on acceleration and acceleration on force "
                f"lie {significant(apart, 2)} kg apart, {apart / u_kg:.2g} of its u (limit {LEAST_CONSEQUENCE:g}); "
                f"{other}",
            )


def _against_the_fit(route: Route) -> Iterator[Reason]:
    """Say what speaks against a fit of the accelerometer's rows."""
    calibration, shift, estimates = route.calibration, route.zero_shift, route.estimates
    if shift is not None and shift.demanded and not shift.confirmed:
        yield Reason(
            ReasonCode.ZERO,
            ACCELERATION,
            worded(
                "either the accelerometer's zero shifted at the shot ",
                shift.told,
                ", or a gauge is off: without a camera that is aligned the shot cannot tell",
            ),
        )
    yield from _against_the_rest(calibration)
    if "kinematic" in estimates:
        inertial, camera = estimates["reverse"], estimates["kinematic"]
        # both routes share the forces, so only what they do not share counts
        apart = abs(inertial.mass_kg - camera.mass_kg)
        own = math.hypot(*(r.u_kg for e in (inertial, camera) for r in e.budget if _not_shared(r.source)))
        if apart > LARGEST_ROUTE_GAP * own:
            yield Reason(
                ReasonCode.ROUTES,
                "shot",
                f"the accelerometer gives {rounded(inertial.mass_kg, own)[0]} kg and the camera "
                f"{rounded(camera.mass_kg, own)[0]} kg, "
                f"{apart / own:.1f} standard uncertainties apart (limit {LARGEST_ROUTE_GAP:g})",
            )


def _against_the_rest(calibration: Calibration) -> Iterator[Reason]:
    """Say that what mass and forces leave of the acceleration is no noise."""
    share = calibration.noise.unexplained_share
    if share > LARGEST_UNEXPLAINED:
        yield Reason(
            ReasonCode.RESIDUAL,
            "shot",
            f"mass and forces leave {100 * share:.2g} % of the acceleration unexplained, in a way that no noise is "
            f"(limit {100 * LARGEST_UNEXPLAINED:g} %): friction or forces are not what the rig says, or areas, units "
            "or signals of the pressures are wrong",
        )


def require_explained(calibration: Calibration) -> None:
    """Refuse a mass where most of the motion is explained without one.

    Raises
    ------
    IdentificationError
        If what is left in a coloured way is more than `MOST_UNEXPLAINED` of the acceleration.
    """
    share = calibration.noise.unexplained_share
    if share > MOST_UNEXPLAINED:
        raise IdentificationError(
            "acceleration and forces do not show one motion",
            expected=f"at most {100 * MOST_UNEXPLAINED:g} % of the acceleration that mass and forces leave unexplained",
            found=f"{100 * share:.3g} %",
            remedy="check areas, units, polarities and clocks of the pressures, and the friction",
        )


def _not_shared(source: ErrorSource) -> bool:
    return source in (RANDOM, ACCELERATION, CAMERA_SCALE)


def against_the_track(tracked: TrackedRecoil, calibration: Calibration) -> Iterator[Reason]:
    """Say what speaks against a mass by this camera track, one sentence each, with its limit."""
    found, clock = tracked.found, tracked.clock
    yield from _against_the_rest(calibration)
    noise = noise_sigma(tracked.positions_m)
    if noise > 0 and (found.marker_sigma_m / noise) ** 2 > INNOVATION_LIMITS[1]:
        yield _of_track(
            "the camera track is ",
            measured(1e3 * found.marker_sigma_m, "mm", ".3g"),
            " off what the forces drive, its own noise is ",
            measured(1e3 * noise, "mm", ".3g"),
            ": a dropped frame, a wrong frame rate or a force that is wrong",
        )
    if found.set_aside > MOST_SET_ASIDE * (found.frames + found.set_aside):
        yield _of_track(f"{found.set_aside} of {found.frames + found.set_aside} frames contradict their neighbours")
    if not tracked.by_force:
        shift_s = calibration.inferred.value(LATE.name)
        apart = abs(shift_s) / max(clock.u_offset_s, 1e-9)
        if apart > LARGEST_SHIFT:
            yield _of_track(
                f"camera track and forces call for an offset of clock {clock.clock} {1e6 * shift_s:+.0f} us away, "
                f"{apart:.1f} of its standard uncertainties (limit {LARGEST_SHIFT:g})"
            )


def _of_track(*pieces: str) -> Reason:
    return Reason(ReasonCode.TRACK, "recoil_displacement", worded(*pieces))


def against_this_shot(reasons: Sequence[Reason], rig: Rig) -> tuple[Reason, ...]:
    """Return the reasons for which the shot is left out of a campaign.

    What many shots are judged by together is none of them, and neither is a carriage sensor that is noisy in a weak
    shot: it has its part in the budget. Where something is suspected that is the rig's, what it leaves unexplained of
    the trace is its, too.
    """
    codes = {one.code for one in reasons}
    together = (*JUDGED_TOGETHER, *((ReasonCode.TRACE,) if ReasonCode.BREECH_CHAIN in codes else ()))
    carriage = {spec.name for spec in rig.channels if spec.role in CARRIAGE_ROLES}
    return tuple(
        reason
        for reason in reasons
        if reason.code not in together and not (reason.code is ReasonCode.NOISE and reason.about in carriage)
    )


def notes_on(fired: FiredShot, route: Route, trace: MassTrace) -> tuple[Note, ...]:
    """Say what a reader should know although it does not make the result invalid.

    Parameters
    ----------
    fired
        Shot and rig; a role that the rig has no channel of is one of its assumptions, and no note.
    route
        Signals and inference of the mass.
    trace
        Mass over time by the method that gives the report's mass.
    """
    signals, shift, recorded = route.signals, route.zero_shift, route.recorded
    notes = [] if route.tracked is None else notes_on_track(fired, route.tracked, route.calibration)
    notes += [
        Note(
            NoteCode.ROLE,
            role,
            f"no usable channel of role {role}: its term in the equation of motion is taken at rest",
        )
        for role in CARRIAGE_ROLES
        if role not in signals.series and fired.rig.by_role(role) is not None
    ]
    if recorded.cut_short:
        text = "the record ends before the recoil does: the interval ends with it"
        notes.append(Note(NoteCode.RECORD_END, None, text))
    size = route.calibration.noise.size
    if recorded.begins_in_motion(rested=signals.baseline_s[0] != signals.baseline_s[1]):
        text = (
            "the record begins in motion: its noise is what the mass and the forces leave of it, and the zero of an "
            "accelerometer is known as its `u_zero_rel` says, to 1 % of its range if left out"
        )
        notes.append(Note(NoteCode.MOTION_NOISE, "shot", text))
    if route.tracked is None and size > QUIET_REST:
        text = (
            f"mass and forces leave {size:.1f} times the noise of the rest before the shot: it is taken for noise of "
            "the motion, and what that costs is in u"
        )
        notes.append(Note(NoteCode.MOTION_NOISE, "shot", text))
    notes += [
        Note(NoteCode.NOT_IDENTIFIED, None, f"{count} samples not identified: {reason}")
        for reason, count in trace.reasons.items()
    ]
    notes += nearly_doubted(route.calibration)
    if shift is not None and shift.demanded and shift.confirmed:
        text = worded(
            "the accelerometer's zero shifted at the shot ",
            shift.told,
            ", as force and camera tell: it is taken off, at the cost of a wider interval; check its mounting and "
            "charge amplifier",
        )
        notes.append(Note(NoteCode.ZERO, ACCELERATION.of, text))
    return tuple(notes)


def notes_on_track(fired: FiredShot, tracked: TrackedRecoil, calibration: Calibration) -> list[Note]:
    """Say what a reader should know of a mass by this camera track although it does not make the result invalid."""
    notes = [Note(NoteCode.UNCHECKED, ACCELERATION.of, UNCHECKED)]
    if tracked.by_force:
        text = (
            f"clock {tracked.clock.clock} is aligned by camera track and forces, and its offset is found with the mass "
            f"(u {1e6 * calibration.inferred.u(LATE.name):.1f} us)"
        )
        notes.append(Note(NoteCode.CLOCK, tracked.clock.clock, text))
    ignored = [c for c in fired.shot.quality if c.verdict == "fail" and c.channel in unused_channels(fired)]
    notes += [Note(NoteCode.NOT_USED, c.channel, worded(f"not used: {c.channel}: ", c.detail)) for c in ignored]
    return notes
