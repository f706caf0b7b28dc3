"""The machine-readable report, the contents of ``report.json``."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from recoil_acquisition.remark import Note, NoteCode, Remark, findings_of
from recoil_acquisition.shot.acquisition import AT_TRIGGER
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.recorded_file import RecordedFile
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_identification.calibration.hidden_errors import hidden_errors
from recoil_identification.calibration.mass_over_time import SEED as SEED_OF_CONSTANCY
from recoil_identification.calibration.mass_over_time import MassOverTime
from recoil_identification.calibration.skew import RecorderSkew
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.budget import COVERAGE
from recoil_identification.estimate.conformity import stated_conformity
from recoil_identification.estimate.mass import MEASURAND
from recoil_identification.estimate.monte_carlo import SEED as SEED_OF_MONTE_CARLO
from recoil_identification.estimate.rpe import RPE_MEANING
from recoil_identification.estimate.rpe import SEED as SEED_OF_RPE
from recoil_identification.report.document.report_files import (
    CURVES_FILE,
    DRAWN,
    SCHEMA,
    TRACE_COLUMNS,
    TRACE_FILE,
    budget_rows,
    computer,
    sealed,
    stated,
    to_json,
)
from recoil_identification.report.document.traceability import (
    channels_of,
    constants_of,
    correlations_of,
    estimates_of,
    rig_of,
    sensor_of_source,
)
from recoil_identification.shot.firing_record import CURVES
from recoil_identification.shot.identified import Identification, Result
from recoil_identification.shot.peaks import peaks_of
from recoil_identification.shot.sensor_doubts import likeliest_sensor
from recoil_identification.shot.stress_waves import StressWaves
from recoil_processing.shot.error_source import ErrorSource
from recoil_rigs.rig import Rig
from recoil_rigs.shots.rig_correction import Correction
from recoil_rigs.tables.calibration_day import CalibrationDay
from recoil_rigs.tables.issue import NOTHING_STATED, Issue
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

METHOD_NOTES = {
    "calibrated": "acceleration on forces, both filtered alike, every sensor's scale restricted by its calibration",
    "reverse": "acceleration on force, both filtered alike",
    "forward": "force on acceleration, both filtered alike",
    "camera": "displacement on the double integral of all forces, every gauge's scale restricted by its calibration",
    "kinematic": "as reverse, with the acceleration from the camera's displacement",
    "paper": "force on acceleration, unfiltered, as published in 2013: low by errors in variables",
    "tls": "total least squares behind the low-pass, the noises' ratio from the baseline; over time as reverse",
}


def report_document(
    shot: Shot,
    found: Identification,
    *,
    version: str,
    shot_file: InputFile,
    truth: Mapping[str, Any] | None = None,
    row: ShotLogRow | None = None,
    beside: Sequence[InputFile] = (),
    corrections: Sequence[Correction] = (),
    rig_text: str | None = None,
    files: Mapping[str, str] | None = None,
    rig: Rig | None = None,
    issued: Issue = NOTHING_STATED,
    drawn: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Build the report of one shot, JSON types only.

    Parameters
    ----------
    version
        Version of the package.
    shot_file
        The shot file itself, for the provenance.
    truth
        Hidden values of a virtual shot: ``m3``.
    row
        Row of the shot log; None where it has none.
    beside
        Files that were read beside the shot file, for the provenance.
    corrections
        Corrections of a corrected rig file.
    rig_text
        The text of that file.
    files
        Name -> text of what is written beside the report, for its digests.
    rig
        Rig as the shot was fired with it, for the chains of its sensors; None where they are not at hand.
    issued
        Identity of the report, and the tolerance of the mass.
    drawn
        Forms in which its page is drawn, for the provenance; None of an earlier version, which did not state them.

    Returns
    -------
    dict
        Keys as published in the README; numbers that are not finite are null. Its provenance holds all that it takes
        to make it again from the shot file, and the digest of the report itself.
    """
    chosen = found.chosen
    estimate = chosen.estimate
    warnings = [check.remark() for check in shot.quality if check.verdict == "warn"]
    previews = [check for check in shot.quality if check.check in (Check.PREVIEW, Check.PREVIEW_COMPARED)]
    proven = [check.remark() for check in previews if check.verdict == "ok"]
    document = {
        "schema": SCHEMA,
        "shot": shot.name,
        "rig": shot.rig_name,
        **started(shot),
        "calibration_day": CalibrationDay.of_shot(shot).to_json(),
        "shot_log": None if row is None else row.to_json(),
        "corrections": [one.to_json() for one in corrections],
        "measurand": MEASURAND,
        "mass": {
            "value": estimate.mass_kg,
            "u": estimate.u_kg,
            "U95": list(found.interval_kg),
            "U_kg": found.expanded_kg,
            "u_all_read": found.u_all_read_kg,
            "unit": "kg",
            "specification": found.specification.mass_kg,
            "u_specification": found.specification.u_kg,
            "specification_of": found.specification.to_json(),
            "method": estimate.method,
        },
        "rpe_percent": {
            "value": chosen.rpe_percent,
            "U95": list(chosen.rpe_interval_percent),
            "meaning": RPE_MEANING,
        },
        "E_n": found.normalised_error,
        "deviation": found.deviation,
        "conformity": _conformity(found, issued),
        "issued": issued.to_json(),
        "interval_s": list(found.route.filtered.interval_s),
        "window_s": chosen.trace.window_s,
        "window_reason": "given" if found.window_choice is None else found.window_choice.reason,
        "identified_share": chosen.trace.share,
        "trace": {"file": TRACE_FILE, "columns": list(TRACE_COLUMNS)},
        "curves": {"file": CURVES_FILE, "columns": ["time_s", *CURVES]},
        **_peaks(found),
        "baseline": [one.to_json() for one in found.baseline],
        "budget": budget_rows(
            estimate.budget,
            lambda row: f"sensor {found.sensors[row.source]}" if row.scope == "sensor" else row.scope,
            _estimates(found),
        ),
        "correlations": correlations_of(found.route.calibration.inferred),
        "could_hide": [
            stated(one, "source", "largest_error", "unit", "mass_kg", "sensitivity_kg")
            for one in hidden_errors(found.route.calibration)
        ],
        "campaign": _campaign(found),
        "uncertainty": _uncertainty(found),
        "endogeneity": _endogeneity(found),
        "constancy": _constancy(found),
        "breech_chain": _breech_chain(found),
        "mass_over_time": _mass_over_time(found.walk),
        "alignment": [a.to_json() for a in found.alignments.values()],
        "quality": [c.to_json() for c in shot.quality],
        "filter": {**found.route.filter_choice.to_json(), "mass_cutoff_hz": _mass_cutoff_hz(found)},
        "zero_shift": _zero_shift(found.route.zero_shift),
        "repairs": [*(one.to_json() for one in found.route.signals.repairs), *_fitted_zero(shot, found)],
        "skew": _skew(found.route.skew),
        "fusion": _fusion(found),
        "ringing": [_ringing(one) for one in found.stress_waves],
        "peak_acceleration": {
            "recorded_m_s2": None if found.peaks is None else found.peaks.raw,
            "filtered_m_s2": None if found.peaks is None else found.peaks.filtered,
        },
        "methods": [_method(name, result, found) for name, result in found.results.items()],
        "sensors": [
            {
                "source": source,
                "pull": pull,
                "normalised_residual": found.route.calibration.normalised_residuals[source],
                **({} if rig is None else sensor_of_source(source, rig)),
            }
            for source, pull in found.route.calibration.pulls.items()
        ],
        "channels": [] if rig is None else channels_of(shot, rig),
        "constants": [] if rig is None else constants_of(rig),
        "valid": found.valid,
        "reasons": list(found.reasons),
        "notes": [*(check.remark() for check in previews), *found.notes],
        "findings": findings_of(found.reasons, warnings, [*proven, *_unsaid(found.notes, warnings)]),
        "assumptions": found.assumptions,
        "force_checks": [one.to_json() for one in found.force_checks],
        "provenance": {
            "version": version,
            "computer": computer(),
            "inputs": provenance_inputs(shot, shot_file, beside),
            "outputs": outputs_of(files or {}),
            **({} if drawn is None else {DRAWN: dict(drawn)}),
            "rig": rig_of(shot),
            "corrected_rig": rig_text,
            "parameters": {
                "options": found.options.to_json(),
                "seeds": {
                    "rpe": SEED_OF_RPE,
                    "monte_carlo": SEED_OF_MONTE_CARLO,
                    "constancy": SEED_OF_CONSTANCY,
                },
                "method": found.route.method,
                "cutoff_hz": found.route.filtered.low_pass.cutoff_hz if found.route.filtered.low_pass else None,
                "half_order": found.route.filtered.low_pass.describe().order if found.route.filtered.low_pass else None,
                "window_s": found.options.window_s,
                **stated(estimate, "rows", "residual_m_s2"),
            },
        },
    }
    if truth is not None and "m3" in truth:
        true_kg = true_mass_kg(truth)
        document["truth"] = {"mass_kg": true_kg, "error_percent": 100 * (estimate.mass_kg / true_kg - 1)}
    return sealed(to_json(document))


def true_mass_kg(truth: Mapping[str, Any]) -> float:
    """Return the mass that the forces of a virtual shot moved: the recoiling part's, and the oil that went along."""
    forces = truth.get("unread", {}).get("forces", {})
    return float(truth["m3"]) + float(forces.get("carried_oil_kg", 0.0))


def outputs_of(files: Mapping[str, str]) -> list[dict[str, str]]:
    """List the files that are written beside a document, by name and text, with their digests."""
    return [{"file": name, "sha256": hashlib.sha256(text.encode("utf-8")).hexdigest()} for name, text in files.items()]


def started(shot: Shot) -> dict[str, str | None]:
    """Say when a shot was, and what tells it; null where nothing does."""
    when, source = shot.started, shot.started_source
    if not when and shot.acquisition is not None:
        when, source = shot.acquisition.trigger_utc, AT_TRIGGER
    return {"started": when or None, "started_source": source or None}


def provenance_inputs(shot: Shot, shot_file: InputFile, beside: Sequence[InputFile]) -> list[dict[str, Any]]:
    """List the shot file, what was read beside it, and what it was made of, with their digests.

    Of a long recording the ``excerpt`` that the shot is stands beside the digest of the whole.
    """
    spans = [None] * (1 + len(beside)) + [one.span_s for one in RecordedFile.of_shot(shot.inputs, shot.history)]
    return [
        {"file": f.name, "sha256": f.sha256, "size": f.size, "source": f.source, "reader": f.reader}
        | ({"seal": f.seal} if f.seal else {})
        | ({} if span_s is None else {"excerpt": {"start_s": span_s[0], "stop_s": span_s[1]}})
        for f, span_s in zip((shot_file, *beside, *shot.inputs), spans, strict=True)
    ]


def _conformity(found: Identification, issued: Issue) -> dict[str, Any]:
    """State the conformity of the mass with its tolerance."""
    estimate = found.chosen.estimate
    return stated_conformity(
        issued, found.specification, estimate.mass_kg, estimate.u_kg, estimate.degrees_of_freedom, valid=found.valid,
        expanded_kg=found.expanded_kg,
    )  # fmt: skip


def _estimates(found: Identification) -> Mapping[ErrorSource, float]:
    """Return by how much each source is off, by the method of the mass; empty for one that has no unknown for it."""
    calibration = found.route.calibration
    if found.chosen.estimate.method != calibration.estimate.method:
        return {}
    return estimates_of(calibration.inferred, calibration.sources)


def _mass_cutoff_hz(found: Identification) -> float | None:
    """Return the cut-off of the mass's own fit; None for the camera's, which passes no filter."""
    return None if found.route.method == "camera" else found.route.mass_low_pass.cutoff_hz


def _peaks(found: Identification) -> dict[str, dict[str, Any]]:
    """Return the quantities of the shot; of a body on a line those of the pressures that it has not are None."""
    peaks = peaks_of(found)
    told = {name: peak for name, peak in peaks.items() if math.isfinite(peak.u)}
    names = [*peaks]
    if not found.route.recorded.recoils_once:
        names = [*dict.fromkeys((*(f"{role}_pa" for role in GAUGE_ROLES), *peaks))]

    def by_name(values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: values.get(name) for name in names}

    return {
        "peaks": by_name({name: peak.value for name, peak in peaks.items()}),
        "peaks_u": by_name({name: peak.u for name, peak in told.items()}),
        "peaks_u_shared": by_name({name: peak.u_shared for name, peak in told.items()}),
        "peaks_degrees_of_freedom": by_name({name: peak.degrees_of_freedom for name, peak in told.items()}),
        "peaks_U95": by_name({name: list(peak.interval) for name, peak in told.items()}),
        "peaks_ruled_by": by_name({name: peak.ruled_by for name, peak in told.items()}),
    }


def _zero_shift(shift: ZeroShift | None) -> dict[str, Any] | None:
    if shift is None:
        return None
    return stated(
        shift, "demanded", "confirmed", "criterion", "step_m_s2", "u_step_m_s2", "decaying_m_s2", "u_decaying_m_s2",
        "time_constant_s", "kick_m_s", "u_kick_m_s",
    )  # fmt: skip


def _skew(skew: RecorderSkew | None) -> dict[str, Any] | None:
    if skew is None:
        return None
    return {
        "skew_s": skew.skew_s,
        "u_skew_s": skew.u_s,
        "corrected_s": skew.corrected_s,
        "reason": skew.reason,
    }


def _endogeneity(found: Identification) -> dict[str, Any] | None:
    test = found.endogeneity
    if test is None:
        return None
    return {
        **stated(test, "statistic", "p", "biased", "bias_percent"),
        "detail": str(test),
    }


def _constancy(found: Identification) -> dict[str, Any] | None:
    test = found.constancy
    if test is None:
        return None
    return {
        "p": test.p_value,
        "constant": test.constant,
        **stated(
            test, "kind", "ln_bayes_factor", "could_hide_percent", "p_drift", "p_step", "normalised_residual", "gain",
            "before_kg", "u_before_kg", "after_kg", "u_after_kg", "change_kg", "u_change_kg", "instant_s", "interval_s",
        ),
        # of the log likelihood, too: which explains the shot better
        "likeliest_sensor": stated(likeliest_sensor(found.route.calibration), "source", "gain"),
        "detail": str(test),
    }  # fmt: skip


def _breech_chain(found: Identification) -> dict[str, Any] | None:
    """State what the shot says of the breech chain where the rig states nothing of it."""
    chain = found.chain
    if chain is None:
        return None
    return {
        **stated(chain, "suspected", "source", "size", "u_size", "ln_bayes_factor", "gain", "others"),
        "moves_percent": 100 * chain.moves_rel,
        "spread_percent": 100 * chain.spread_rel,
        "swings_hz": None if math.isnan(chain.swings_hz) else chain.swings_hz,
        "detail": str(chain),
    }


def _mass_over_time(walk: MassOverTime) -> dict[str, Any]:
    """State the mass as one that may change, together with all sensors: a random walk, at its nodes."""
    nodes = walk.at_nodes
    return {"time_s": nodes.times_s.tolist(), "mass_kg": nodes.mass_kg.tolist(), "u_kg": nodes.u_kg.tolist()}


def _unsaid(notes: Sequence[Note], warnings: Sequence[Remark]) -> list[Note]:
    """Return the notes without those of what a check sets aside, which warns of it."""
    aside = {one.about for one in warnings if one.code is Check.SET_ASIDE}
    return [note for note in notes if note.code is not NoteCode.SET_ASIDE or note.about not in aside]


def _campaign(found: Identification) -> dict[str, Any]:
    """Return what combines this shot with others; a camera's rows have passed no low-pass."""
    shift, low_pass = found.route.zero_shift, None if found.route.method == "camera" else found.route.fitted.low_pass
    cutoff_hz = None if low_pass is None else low_pass.cutoff_hz
    return found.summary.to_json(cutoff_hz=cutoff_hz, zero_shift=shift is not None and shift.demanded)


def _uncertainty(found: Identification) -> dict[str, Any]:
    """State how the interval came about, and what a Monte Carlo method says of it."""
    estimate = found.chosen.estimate
    bracket = found.frisch_bracket_kg
    said: dict[str, Any] = {
        "degrees_of_freedom": estimate.degrees_of_freedom,
        "coverage": COVERAGE,
        "coverage_factor": found.expanded_kg / estimate.u_kg if estimate.u_kg else estimate.coverage_factor,
        "U_kg": found.expanded_kg,
        "interval_by": found.interval_by,
        "frisch_bracket_kg": None if bracket is None else list(bracket),
        "monte_carlo": None,
    }
    drawn = found.distribution
    if drawn is not None:
        low, high = drawn.differences(estimate.interval_kg)
        said["monte_carlo"] = {
            **stated(drawn, "draws", "seed"),
            "mean_kg": drawn.mean,
            "u_kg": drawn.u,
            "interval_kg": list(drawn.interval),
            "shortest_kg": list(drawn.shortest),
            "tolerance_kg": drawn.tolerance,
            "converged": drawn.converged,
            "difference_kg": [low, high],
            "agrees": drawn.validates(estimate.interval_kg),
        }
    return said


def _fusion(found: Identification) -> dict[str, Any] | None:
    fused = found.route.fused
    if fused is None:
        return None
    end = int(np.argmin(np.abs(fused.times_s - found.route.filtered.interval_s[1])))
    fastest = int(np.argmax(fused.velocity_m_s))
    alignment = found.alignments.get(found.route.camera.time_base.clock) if found.route.camera is not None else None
    return {
        "travel_m": {"value": fused.position_m[end], "u": fused.u_position_m[end]},
        "largest_velocity_m_s": {"value": fused.velocity_m_s[fastest], "u": fused.u_velocity_m_s[fastest]},
        "gain": {"value": fused.gain, "u": fused.u_gain},
        "zero_m_s2": {"value": fused.bias_m_s2, "u": fused.u_bias_m_s2},
        "innovation_statistic": fused.innovation_statistic,
        "frames_rms_m": fused.rms_residual_m,
        "clock_shift_sigma": None if alignment is None else fused.shift_statistic(alignment.u_offset_s),
        "frames_set_aside": fused.frames_set_aside,
    }


def _fitted_zero(shot: Shot, found: Identification) -> list[dict[str, Any]]:
    """List a shifted zero among the repairs: it is taken off every sample since the onset."""
    accelerometer = shot.by_role("recoil_acceleration")
    if found.route.zero_shift is None or not found.route.zero_shift.demanded or accelerometer is None:
        return []
    times_s, onset_s = found.route.signals.times_s, found.route.signals.onset_s
    count = int(np.count_nonzero(times_s >= onset_s))
    return [
        {
            "channel": accelerometer.name,
            "what": "zero shift fitted",
            "samples": f"{count} of {times_s.size}",
            "detail": f"the zero shifted {found.route.zero_shift}: a column of the regression",
            "count": count,
            "of": int(times_s.size),
            "figures": {},
            "spans_s": [[onset_s, float(times_s[-1])]],
        }
    ]


def _ringing(found: StressWaves) -> dict[str, Any]:
    report = found.report
    return {
        **stated(found, "channel", "role"),
        "energy_share": report.ringing_share,
        "modes": [
            {**stated(mode, "frequency_hz", "damping_ratio", "energy_share", "amplitude"), "unit": found.unit}
            for mode in report.modes
        ],
    }


def _method(name: str, result: Result, found: Identification) -> dict[str, Any]:
    return {
        "name": name,
        "mass_kg": result.estimate.mass_kg,
        "u_kg": result.estimate.u_kg,
        "deviation_percent": 100 * (result.estimate.mass_kg / found.specification.mass_kg - 1),
        "rpe_percent": result.rpe_percent,
        "identified_share": result.trace.share,
        "note": METHOD_NOTES.get(name, ""),
    }
