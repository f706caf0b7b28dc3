"""One shot without an accelerometer on the recoiling part: from the camera's track and the forces to a mass."""

from __future__ import annotations

import math
from dataclasses import replace

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.remark import Note, NoteCode
from recoil_acquisition.shot.shot import Shot
from recoil_identification.calibration.methods import by_camera, with_residual
from recoil_identification.rows.camera_rows import LATE
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.camera_route import LARGEST_CUTOFF_HZ, mass_by_camera, regression_by_camera
from recoil_identification.shot.filter_choice import LARGEST_SHARE_OF_RATE, FilterChoice
from recoil_identification.shot.identified import Options
from recoil_identification.shot.route import Route
from recoil_identification.shot.verdict import require_explained
from recoil_processing.shot.regression import MASS_ROLES, PRESSURE_ROLES, missing_forces
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.shots.fired_shot import FiredShot

LONGEST_GAP_S = 1e-3
"""Longest gap of lost frames that is bridged, s: a tenth of the low-pass's period, over which a travel bends less than
its frames are uncertain."""


def route_by_camera(fired: FiredShot, options: Options) -> Route:
    """Find the recoiling mass of one shot by the camera's track of the recoiling part and the forces.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Raises
    ------
    IdentificationError
        If no number can be given at all; a doubtful number is a result with reasons.
    """
    missing = [role for role in PRESSURE_ROLES if fired.shot.by_role(role) is None]
    if missing:
        raise missing_forces(missing)
    alignments = {a.clock: a for a in fired.shot.alignments}
    tracked = TrackedRecoil.of(fired, collect_signals(fired, alignments))
    forced, camera = tracked.forced, tracked.camera
    signals = forced.signals
    choice = _slow_filter(fired.shot, options)
    calibration = by_camera(tracked)
    require_explained(calibration)
    clock = replace(tracked.clock, offset_s=tracked.clock.offset_s + calibration.inferred.value(LATE.name))
    regression = regression_by_camera(
        forced.recorded,
        signals,
        forced.motion,
        fired.rig,
        camera,
        clock,
        choice.low_pass,
        longest_gap_s=LONGEST_GAP_S,
    )
    calibration = with_residual(calibration, regression)
    estimates = {"camera": calibration.estimate}
    notes: tuple[Note, ...] = ()
    try:
        estimates["kinematic"] = mass_by_camera(regression, forced.recorded, signals, fired, camera, forced.scales)
    except IdentificationError as error:
        text = f"no mass by the acceleration from the camera: {error}"
        notes = (Note(NoteCode.NO_ESTIMATE, "kinematic", text),)
    return Route(
        method="camera",
        signals=signals,
        camera=camera,
        travel_m=tracked.travel_m,
        velocity_m_s=tracked.velocity_m_s,
        fused=tracked.fused,
        recorded=forced.recorded,
        filtered=regression,
        fitted=regression,
        filter_choice=choice,
        mass_low_pass=choice.low_pass,
        calibration=calibration,
        estimates=estimates,
        regressions=dict.fromkeys(estimates, regression),
        notes=notes,
        tracked=tracked,
    )


def _slow_filter(shot: Shot, options: Options) -> FilterChoice:
    """Choose the low-pass of the mass over time; the mass itself passes none."""
    if options.cutoff_hz is not None and options.cutoff_hz < LARGEST_CUTOFF_HZ:
        low_pass = options.low_pass.at(options.cutoff_hz)
        return FilterChoice(low_pass, "given", None, f"{options.cutoff_hz:g} Hz were asked for")
    rates = [c.time_base.rate_hz for c in shot.channels.values() if c.role in MASS_ROLES]
    slowest = min((rate for rate in rates if math.isfinite(rate)), default=math.inf)
    cutoff_hz = min(LARGEST_CUTOFF_HZ, LARGEST_SHARE_OF_RATE * slowest)
    reason = (
        f"the fixed {cutoff_hz:g} Hz: a displacement that is differentiated twice for the mass over time bears no more"
        + ("" if options.cutoff_hz is None else f", {options.cutoff_hz:g} Hz were asked for")
    )
    return FilterChoice(options.low_pass.at(cutoff_hz), "default", None, reason)
