"""Each cause is said once, the weightiest first, and what follows from it stays readable."""

from __future__ import annotations

from dataclasses import replace

from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.causes import Subject, by_cause, shot_findings
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from tests.builders.shots import make_shot


def test_findings_are_the_reasons_by_their_weight_then_warnings_then_what_readers_noted() -> None:
    doubt = Reason(ReasonCode.CLOCK, "imu", "hardly known")
    checks = (
        QualityCheck("a", Check.HUM, "warn", "50 Hz"), QualityCheck("can", Check.READER, "ok", "no time zone"),
        QualityCheck("a", Check.RANGE, "fail", "clipped"), QualityCheck("a", Check.LOSSES, "ok", "none"),
    )  # fmt: skip
    found = shot_findings(checks, (doubt,))
    assert [(one["code"], one["about"], one["severity"], one["text"]) for one in found] == [
        ("clock", "imu", "fatal", "hardly known"),
        ("range", "a", "fatal", "a: clipped"),
        ("hum", "a", "warn", "a: 50 Hz"),
        ("reader", "can", "note", "can: no time zone"),
    ]
    shot = replace(make_shot(), quality=checks, against_mass=(doubt,))
    assert shot.reasons == tuple(one["text"] for one in found if one["severity"] == "fatal")


BUS = (
    Subject("p_brake", "brake_pressure", "can", "pressure"),
    Subject("p_recuperator", "recuperator_pressure", "can", "pressure"),
    Subject("acc", "recoil_acceleration", "daq", "acceleration"),
)
"""Channels of a shot whose two pressures came over one bus."""


def test_reasons_begin_with_no_forces_then_no_motion_then_clocks_then_the_rest() -> None:
    checks = (
        QualityCheck("acc", Check.RANGE, "fail", "clipped"), QualityCheck("camera", Check.ALIGNMENT, "fail", "far off"),
        QualityCheck("shot", Check.ONSET, "fail", "none"), QualityCheck("p_brake", Check.CONSTANT, "fail", "always 0"),
        QualityCheck("acc", Check.CONSTANT, "fail", "always 1"),
    )  # fmt: skip
    role = Reason(ReasonCode.ROLE, "breech_pressure", "no breech pressure")
    said, explained = by_cause([*(check.remark() for check in checks), role], BUS)
    assert explained == []
    assert [str(one) for one in said] == [
        "p_brake: always 0", "no breech pressure", "shot: none", "camera: far off", "acc: clipped", "acc: always 1",
    ]  # fmt: skip
    # of the same remarks in another order the weights are the same
    assert {str(one) for one in by_cause([role, *(c.remark() for c in checks[::-1])], BUS)[0][:2]} == {
        "p_brake: always 0", "no breech pressure",
    }  # fmt: skip


def test_a_doubt_of_a_clock_and_the_check_of_its_alignment_are_said_once() -> None:
    doubt = Reason(ReasonCode.CLOCK, "can", "clock can: alignment ambiguous: hardly known")
    alignment = QualityCheck("can", Check.ALIGNMENT, "warn", "offset 1 ms; ambiguous: hardly known")
    gap = QualityCheck("daq", Check.REFERENCE_GAP, "fail", "a gap")
    assert [one["code"] for one in shot_findings((alignment,), (doubt,), BUS)] == ["clock"]
    found = shot_findings((gap, alignment), (doubt,), BUS)
    assert [(one["code"], one["severity"]) for one in found] == [("gap of the reference", "fatal"), ("clock", "note")]
    assert found[0]["text"] == "daq: a gap; this explains 1 more"


def test_what_follows_from_one_cause_is_one_reason_and_stays_readable_in_the_notes() -> None:
    checks = (
        QualityCheck("can", Check.LATE_STAMPS, "warn", "bursts; let the interface stamp"),
        QualityCheck("can", Check.CLOCK_STEPS, "warn", "stepped; check its supply"),
        QualityCheck("p_brake", Check.HELD_VALUES, "warn", "held; check the cable"),
        QualityCheck("acc", Check.HELD_VALUES, "warn", "held, too"),
        QualityCheck("can", Check.ALIGNMENT, "fail", "not to be told"),
    )  # fmt: skip
    role = Reason(ReasonCode.ROLE, "brake_pressure", "no brake pressure")
    found = shot_findings(checks, (role,), BUS)
    assert [(one["severity"], one["code"], one["text"]) for one in found] == [
        ("fatal", "late stamps", "can: bursts; let the interface stamp; this explains 4 more"),
        ("warn", "held values", "acc: held, too"),
        ("note", "alignment", "can: not to be told"),
        ("note", "role", "no brake pressure"),
        ("note", "clock steps", "can: stepped; check its supply"),
        ("note", "held values", "p_brake: held; check the cable"),
    ]
    # a warning that explains warnings is one, and another clock's is none of its
    warned = shot_findings(checks[:3], (), BUS)
    assert [one["severity"] for one in warned] == ["warn", "note", "note"]
    other = shot_findings((checks[0], QualityCheck("camera", Check.ALIGNMENT, "fail", "far off")), (), BUS)
    assert [(one["severity"], one["code"]) for one in other] == [("fatal", "alignment"), ("warn", "late stamps")]


def test_a_role_that_two_clocks_bear_is_missing_for_no_one_clock_alone() -> None:
    both = (*BUS, Subject("p_brake_2", "brake_pressure", "daq", "pressure"))
    role = Reason(ReasonCode.ROLE, "brake_pressure", "no brake pressure")
    said, explained = by_cause([QualityCheck("can", Check.ALIGNMENT, "fail", "far off").remark(), role], both)
    assert (len(said), explained) == (2, [])


def test_a_code_of_a_gauge_is_why_no_shot_is_seen_and_one_of_an_accelerometer_is_not() -> None:
    unseen = QualityCheck("shot", Check.ONSET, "fail", "no shot")
    for gauge, first in (("p_brake", "p_brake: a code; this explains 1 more"), ("acc", "shot: no shot")):
        code = QualityCheck(gauge, Check.CODE, "fail", "a code")
        assert str(by_cause([unseen.remark(), code.remark()], BUS)[0][0]) == first


def test_a_source_that_sleeps_or_loses_frames_is_said_once_and_what_is_done_without_comes_before_trifles() -> None:
    checks = (
        QualityCheck("can", Check.STREAM, "warn", "bytes"), QualityCheck("p_brake", Check.HELD_VALUES, "warn", "held"),
        QualityCheck("can", Check.MISSING_FRAMES, "warn", "frames"),
        QualityCheck("camera", Check.SET_ASIDE, "warn", "no"),
        QualityCheck("p_recuperator", Check.HELD_VALUES, "warn", "held"),
        QualityCheck("acc", Check.HELD_VALUES, "warn", "held"),
    )  # fmt: skip
    said, explained = by_cause([check.remark() for check in checks], BUS)
    assert [str(one) for one in said] == [
        "p_brake: held; this explains 1 more", "camera: no", "acc: held", "can: frames; this explains 1 more",
    ]  # fmt: skip
    assert [str(one) for one in explained] == ["can: bytes", "p_recuperator: held"]
