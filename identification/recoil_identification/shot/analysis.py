"""One shot from aligned channels to a mass: the order of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.measured import worded
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.causes import as_notes, by_cause
from recoil_acquisition.shot.shot import Shot
from recoil_identification.calibration.calibration import Calibration, sources_of
from recoil_identification.calibration.gauge_agreement import gauge_set_aside
from recoil_identification.calibration.mass_over_time import mass_constancy, mass_over_time
from recoil_identification.calibration.methods import FURTHER, Method, calibrated
from recoil_identification.calibration.skew import find_skew
from recoil_identification.calibration.suspicion import suspicion
from recoil_identification.calibration.trace import trace_window
from recoil_identification.calibration.uncertainty import contributions, note_on_cutoff
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.mass import forward_mass, reverse_mass
from recoil_identification.estimate.monte_carlo import propagate
from recoil_identification.estimate.reliability import of_sources, with_reliabilities
from recoil_identification.estimators.endogeneity import Endogeneity, durbin_wu_hausman
from recoil_identification.estimators.errors_in_variables import neighbouring_force
from recoil_identification.estimators.total_least_squares import total_least_squares_mass
from recoil_identification.rows.causes import SKEW
from recoil_identification.rows.suspects import suspects
from recoil_identification.shot.baseline import baselines_of
from recoil_identification.shot.camera_route import mass_by_camera, regression_by_camera
from recoil_identification.shot.camera_shot import route_by_camera
from recoil_identification.shot.default_method import default_method
from recoil_identification.shot.filter_choice import choose_filter, mass_filter
from recoil_identification.shot.force_checks import force_checks
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.method_result import CORRECTED, method_result
from recoil_identification.shot.preparation import prepare
from recoil_identification.shot.route import Route
from recoil_identification.shot.sensor_doubts import notes_on_doubts
from recoil_identification.shot.shot_summary import sensors_of, shot_summary
from recoil_identification.shot.stress_waves import find_stress_waves
from recoil_identification.shot.verdict import against_this_shot, notes_on, reasons_against, require_explained
from recoil_processing.quality.repeatability import ShotPeaks, shot_peaks
from recoil_processing.shot.camera_motion import recorded_motion
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.clocks.forced_recoil import carriage_lacks
from recoil_processing.shot.regression import MEMORY_S, Regression
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_processing.shot.signals import collect_signals
from recoil_processing.shot.thinned import THINNED_TO_HZ, thinned
from recoil_processing.shot.verdict.consequence import set_aside
from recoil_rigs.shots.assumptions import assumptions_of
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

INSTRUMENT_LAG_S = 2.5e-4
"""Lag, s, of the force that is the instrument of the test on bias: beyond its noise's correlation, short against the
pulse."""


@on_one_thread
def identify_shot(fired: FiredShot, options: Options) -> Identification:
    """Identify the recoiling mass of one shot.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Raises
    ------
    IdentificationError
        If no number can be given at all; a doubtful number is a result with reasons.
    """
    if options.thin:
        fired, names = thinned(fired)
        if names:
            found = identify_shot(fired, options)
            thinner = f"thinned to {THINNED_TO_HZ / 1e3:g} kHz for this number: {', '.join(names)}"
            note = Note(NoteCode.THINNED, None, f"{thinner}; the shot file keeps all, and the full rate has its own")
            return replace(found, notes=(note, *found.notes))
    if (left_out := _gauge_without_samples(fired)) is not None:
        return _without(*left_out, fired, options)
    if options.method != "camera" and (aside := next(iter(set_aside(fired.shot)), None)) is not None:
        # the rig keeps it: what a sensor that was there could have told is in the budget
        found = identify_shot(fired.unrecorded(aside.channel), options)
        note = Note(NoteCode.SET_ASIDE, aside.channel, worded(f"{aside.channel} is set aside: ", aside.detail))
        return replace(found, notes=(note, *found.notes))
    method = options.method or default_method(fired)
    if method == "camera" and fired.rig.mechanism.needs_carriage("recoil_displacement"):
        return _identified(route_by_camera(fired, options), fired, options)
    route = _route_by_accelerometer(fired, options, method)
    if (doubted := gauge_set_aside(route.calibration, route.signals)) is not None:
        return _without(*doubted, fired, options)
    if method not in route.estimates:
        raise IdentificationError(
            f"this shot allows no estimate by the method {method}",
            found=f"estimates by {', '.join(route.estimates)}",
            remedy="take another --method, or mend the camera's alignment and what was lost",
        )
    found = _identified(route, fired, options)
    return _beside_the_camera(found, fired) if options.compare else found


def _route_by_accelerometer(fired: FiredShot, options: Options, method: Method) -> Route:
    """Find the mass by the accelerometer on the recoiling part."""
    prepared = prepare(fired)
    signals, recorded = prepared.signals, prepared.recorded
    camera, camera_clock = prepared.camera, prepared.camera_clock
    choice = choose_filter(
        recorded, fired.shot, kind=options.low_pass, given_hz=options.cutoff_hz, campaign=options.campaign
    )
    low_pass = choice.low_pass
    scales = scale_uncertainty(fired.rig, recorded.motion_role)
    track = recorded_motion(signals, prepared.seen_m_s2, camera, camera_clock)
    mass_low_pass = mass_filter(recorded, choice, options.mass_cutoff_hz, fired.rig.mechanism.tube_axial_hz)
    inputs = EstimatorInputs(recorded, recorded, signals, fired)

    def solved(recorded: Regression) -> tuple[Regression, Regression, Regression, Calibration, ZeroShift]:
        again = replace(inputs, filtered=recorded, recorded=recorded)
        shifted, narrow, found, shift = calibrated(again, mass_low_pass, prepared.inertial_m_s2, track)
        # the trace, the skew and the figures need the whole band
        return shifted, narrow, narrow if mass_low_pass == low_pass else shifted.filtered(low_pass), found, shift

    recorded, narrow, filtered, calibration, zero_shift = solved(recorded)
    skew = find_skew(filtered, calibration)
    while skew.due_s:
        recorded = prepared.without_skew(fired, skew.corrected_s + skew.due_s)
        recorded, narrow, filtered, calibration, zero_shift = solved(recorded)
        skew = find_skew(filtered, calibration, corrected_s=skew.corrected_s + skew.due_s, steps=skew.steps + 1)
    require_explained(calibration)
    # the others take the skew as it was measured
    measured = [
        replace(one, u=skew.u_left_s) if one.source == SKEW else one
        for one in calibration.block.causes
        if one.source != SKEW or math.isfinite(skew.u_left_s)
    ]
    further = contributions(narrow, measured)
    estimates = {
        "calibrated": calibration.estimate,
        "reverse": reverse_mass(narrow, scales),
        "forward": forward_mass(narrow, scales),
        "paper": replace(forward_mass(recorded, scales), method="paper"),
    }
    estimates = {
        name: one if name == "calibrated" else replace(one, budget=(*one.budget, *further))
        for name, one in estimates.items()
    }
    left_out: dict[str, str] = {}
    if options.compare or method in FURTHER:
        try:
            both = EstimatorInputs(narrow, recorded, signals, fired)
            estimates["tls"] = total_least_squares_mass(both, scales, further)
        except (IdentificationError, ValueError) as error:
            # the arrays are this shot's: what they do not allow is no fault of who asked for a comparison
            left_out["tls"] = str(error)
    if method in left_out:
        raise IdentificationError(
            f"this shot allows no estimate by the method {method}: {left_out[method]}",
            found=f"estimates by {', '.join(estimates)}",
            remedy="take another --method",
        )
    regressions = {name: filtered if name != "paper" else recorded for name in estimates}
    on_cutoff = note_on_cutoff(recorded, narrow, calibration)
    notes = [] if on_cutoff is None else [on_cutoff]
    notes += [Note(NoteCode.NO_ESTIMATE, name, f"no estimate by {name}: {why}") for name, why in left_out.items()]
    if track is not None and (lacking := carriage_lacks(signals, fired.rig)):
        what = f"no usable channel of role {', '.join(lacking)} tells how the tipping part moves"
        against = (
            "which turns the bore" if fired.rig.camera_on_ground else "relative to which the camera sees the recoil"
        )
        text = f"{what}, {against}: its frames are not used"
        notes.append(Note(NoteCode.NOT_USED, "recoil_displacement", text))
    if camera is not None and camera_clock is not None and camera_clock.status != "failed":
        try:
            by_camera = regression_by_camera(
                recorded, signals, prepared.motion, fired.rig, camera, camera_clock, low_pass
            )
            estimates["kinematic"] = mass_by_camera(by_camera, recorded, signals, fired, camera, scales)
            regressions["kinematic"] = by_camera
        except IdentificationError as error:
            notes.append(Note(NoteCode.NO_ESTIMATE, "kinematic", f"no mass by the camera: {error}"))
    return Route(
        method=method,
        signals=signals,
        camera=camera,
        travel_m=prepared.travel_m,
        velocity_m_s=prepared.velocity_m_s,
        fused=prepared.fused,
        recorded=recorded,
        filtered=filtered,
        fitted=narrow,
        filter_choice=choice,
        mass_low_pass=mass_low_pass,
        calibration=calibration,
        estimates=estimates,
        regressions=regressions,
        notes=tuple(notes),
        zero_shift=zero_shift,
        skew=skew,
    )


def _identified(route: Route, fired: FiredShot, options: Options) -> Identification:
    """Judge a mass, follow it over time, and put all that was found together."""
    calibration, method = route.calibration, route.method
    block = calibration.block
    suspected = suspects(block.regression, route.recorded, route.signals, fired.rig, block.causes)
    constancy, chain = mass_constancy(calibration), suspicion(calibration, suspected)
    if constancy is not None and constancy.ln_bayes_factor > constancy.least_odds:
        # with the noise by which the mass is said to change, too
        beside = suspicion(constancy.beside, suspected)
        if beside is not None and beside.suspected:
            constancy, chain = replace(constancy, gain_of_chain=beside.gain), beside
    # sensors that were to explain a mass that changes would hide it
    corrections = calibration if constancy is None or constancy.constant else constancy.changed
    memory_s = route.recorded.memory_s if options.window_s == MEMORY_S else options.window_s
    window_s, window_choice = trace_window(
        memory_s, route.filtered, *corrections.correct(route.filtered), default_s=MEMORY_S
    )
    estimates, draws, averaged = (
        dict(route.estimates),
        calibration.draws(of_sources(sources_of(calibration.inferred), fired.rig)),
        calibration.estimate,
    )
    if chain is not None:
        # the mass is the mean over what nobody stated; the doubts of it are weighed without
        asked = constancy.beside if constancy is not None and constancy.by_the_chain else calibration
        estimates[averaged.method] = averaged = chain.averaged(asked.estimate)
        draws = chain.draws(draws)
    estimates = {
        name: with_reliabilities(one, fired.rig, corrected=name in CORRECTED) for name, one in estimates.items()
    }
    results = {
        name: method_result(estimate, route.regressions[name], corrections, window_s, fired.rig)
        for name, estimate in estimates.items()
    }
    trace = results[method].trace
    alignments = {one.clock: one for one in fired.shot.alignments}
    inertial = route.tracked is None
    biased = _endogeneity(route.recorded, corrections if method == "calibrated" else None) if inertial else None
    against = reasons_against(fired, route, trace, constancy, biased, chain)
    noted = notes_on(fired, route, trace)
    reasons, explained = by_cause(against, fired.shot.subjects)
    return Identification(
        options=options,
        route=route,
        specification=fired.rig.specification,
        results=results,
        sensors=sensors_of(fired.rig),
        summary=replace(
            shot_summary(calibration, fired.rig, against_this_shot(against, fired.rig), suspected),
            averaged_rel=averaged.mass_kg / calibration.estimate.mass_kg - 1.0,
        ),
        monte_carlo=propagate(draws),
        endogeneity=biased,
        constancy=constancy,
        chain=chain,
        walk=mass_over_time(calibration if constancy is None or constancy.constant else constancy.beside),
        window_choice=window_choice,
        stress_waves=find_stress_waves(fired, route.signals, route.filter_choice),
        peaks=_peaks(fired.shot, route) if inertial else None,
        alignments=alignments,
        reasons=tuple(reasons),
        baseline=baselines_of(fired, route.signals, route.camera, alignments),
        assumptions=assumptions_of(fired.rig),
        force_checks=force_checks(calibration, route.signals, fired),
        notes=(*as_notes(explained), *notes_on_doubts(calibration, constancy, chain), *noted, *route.notes),
    )


def _beside_the_camera(found: Identification, fired: FiredShot) -> Identification:
    """Set the mass by the camera and the forces alone beside one by the accelerometer."""
    clock = None if found.route.camera is None else found.alignments.get(found.route.camera.time_base.clock)
    if clock is None or clock.status == "failed" or found.route.skew is None:
        return found
    # a clock that was aligned by the accelerometer is as much less late as that was
    clock = replace(clock, offset_s=clock.offset_s - found.route.skew.corrected_s)
    aligned = fired.aligned_by(clock)
    try:
        alone = _identified(route_by_camera(aligned, found.options), aligned, found.options)
    except IdentificationError as error:
        note = Note(NoteCode.NO_ESTIMATE, "camera", f"no mass by the camera and the forces alone: {error}")
        return replace(found, notes=(*found.notes, note))
    against = (
        Note(reason.code, reason.about, f"against the mass by the camera alone: {reason}") for reason in alone.reasons
    )
    results = {**found.results, "camera": alone.results["camera"]}
    return replace(found, results=results, notes=(*found.notes, *against))


def _peaks(shot: Shot, route: Route) -> ShotPeaks:
    recorded = route.recorded
    return shot_peaks(shot.name, recorded.acceleration_m_s2, recorded.rate_hz, route.filter_choice.low_pass)


def _gauge_without_samples(fired: FiredShot) -> tuple[str, str] | None:
    """Return a gauge that tells less of a pressure than another in this shot, and why; None if there is none."""
    for role in GAUGE_ROLES:
        missing = [one.name for one in fired.rig.channels if one.role == role and one.name not in fired.channels]
        if missing and role in fired.roles:
            return missing[0], "it is not in this shot"
    if any(len(fired.roles.get(role, ())) > 1 for role in GAUGE_ROLES):
        unused = collect_signals(fired, {one.clock: one for one in fired.shot.alignments}).unused
        if unused:
            return unused[0], "its clock or some of its samples are lost"
    return None


def _without(gauge: str, why: str, fired: FiredShot, options: Options) -> Identification:
    """Identify the mass by the other gauges of a pressure, and say so."""
    found = identify_shot(fired.without(gauge), options)
    note = Note(NoteCode.SET_ASIDE, gauge, f"{gauge} is set aside: {why}")
    return replace(found, notes=(note, *found.notes), set_aside=(gauge, *found.set_aside))


def _endogeneity(recorded: Regression, corrections: Calibration | None) -> Endogeneity | None:
    """Test the signals as recorded, behind no filter; without the errors that a calibration found of the sensors."""
    acceleration, force = recorded.acceleration_m_s2, recorded.force_n
    if corrections is not None:
        acceleration, force = corrections.correct(recorded)
    lag = max(1, round(INSTRUMENT_LAG_S * recorded.rate_hz))
    instrument = neighbouring_force(np.where(np.isfinite(force), force, 0.0), lag)
    used = recorded.used & np.roll(recorded.trusted, lag) & np.roll(recorded.trusted, -lag)
    try:
        return durbin_wu_hausman(acceleration, force, instrument, used=used)
    except IdentificationError:
        return None
