"""Values of codes that documents carry: users' scripts depend on them, so that none changes and none goes."""

from __future__ import annotations

from enum import StrEnum

import pytest

from recoil_acquisition.errors import ErrorCode, FaultCode, FileEnd
from recoil_acquisition.remark import CautionCode, NoteCode, ReasonCode, Severity
from recoil_acquisition.shot.quality_check import Check
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.estimate.conformity import Word
from recoil_identification.report.document.certificate_document import Behind
from recoil_processing.repairs.repair import RepairKind
from recoil_processing.shot.error_source import SourceGroup, SourceKind

VALUES: dict[type[StrEnum], str] = {
    ErrorCode: (
        "read, format, corrupt, channel, no signal, frame rate, framing, store, rig, device, alignment, "
        "identification, worker, shortage, other, cut off, no source, not installed, exists, not valid"
    ),
    Word: "conforms, does not conform, not shown, not stated",
    Behind: "answer, report, shot, header",
    FaultCode: (
        "syntax, missing, unknown, duplicate, type, value, range, unit, contradiction, ambiguous, file, changed, "
        "at rest, unusual, overdue, later, open"
    ),
    ReasonCode: (
        "check, noise, rig, clock, role, baseline, coupling, lost force, method, sensor, constancy, hidden drift, "
        "breech chain, convergence, zero, residual, routes, track, trace, mass step, added mass, added sign, "
        "calibration, agreement, model, balance, not identified, implausible"
    ),
    NoteCode: (
        "reader, no log row, log row, correction, set aside, not used, no estimate, no advice, filter, thinned, "
        "unchecked, clock, role, record end, not identified, near limit, gauge scale, zero, added mass, agreement, "
        "motion noise, configuration, specification, identified anew, comparison, model, not checked, sensitivity, "
        "assumption, session, cut, lost, left out, second recording, time, own rate, contradiction, units, names, "
        "unmatched, unseen, track, excerpt"
    ),
    CautionCode: (
        "loss, log fault, damaged entries, unknown entries, not increasing, late stamps, other starts, other count, "
        "doubtful start"
    ),
    Check: (
        "file, file names, reader, missing frames, stream, late stamps, preview, preview compared, delivery, "
        "connection, kernel drops, damaged entries, error frames, unanswered, pre-time, trigger, journal, clock fit, "
        "clock steps, clock stamps, alignment, losses, constant, code, overflow, range, flat tops, held values, time "
        "steps, gap of the reference, baseline, steady baseline, level after, filtered noise, hum, out of band, "
        "aliasing, spectral gap, shock response, polarity, calibration, sensor, set aside, frame rate, lost frames, "
        "pictures, distance, repeated frames, held ends, marker noise, jumps, battery, peak locking, residual, onset, "
        "second sensor, velocity, carriage, force, force sign, impulse, braking, zero shift, skew, rest to rest, "
        "other"
    ),
    RepairKind: (
        "drop-outs masked, clipped repaired, clipped masked, lost samples bridged, hum subtracted, droop corrected"
    ),
    FileEnd: "missing, unclear, there",
    Severity: "note, warn, fatal",
    SignalKind: "mass step, sensor drift, outlier, added mass, calibration, chart",
    SourceGroup: "sensors, unread forces, motion noise, geometry",
    SourceKind: (
        "random, sensitivity, dynamic scale, force scale, camera scale, scale, scale and area, area, declared, "
        "standard, friction, slide friction, unread share, unread force, unread shape, force line, zero, moving zero, "
        "repair, lost samples, bridged, bridged shape, not recorded, release, gas, skew, delay, line, alignment, clock "
        "rate, camera late, camera gain, place, picture, carriage part, carriage zero, gauge difference, mass change, "
        "known impulse, known load, parameter, choice, random of shots, sensor scale, sensor dynamic scale, bore "
        "friction, linearity, hysteresis, gauge ahead, muzzle brake, tube, hanging part, breakaway, time constant, "
        "unstated, added mass"
    ),
}


@pytest.mark.parametrize("codes", VALUES, ids=lambda codes: codes.__name__)
def test_the_values_of_codes_stay(codes: type[StrEnum]) -> None:
    assert [code.value for code in codes] == VALUES[codes].split(", ")
