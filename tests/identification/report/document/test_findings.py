"""What documents list under ``findings`` is what they say in sentences, in the same order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode, Severity
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import InputFile
from recoil_identification.campaign.combination import combine
from recoil_identification.report.content.campaign_tables import changed
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.report_files import seal_fault
from recoil_identification.targets.target_document import target_document
from recoil_identification.targets.target_result import TargetResult
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import identified, virtual_shot

SHOT_FILE = InputFile("0001.h5", "ab" * 32, 3, "", "shot file")
ALTERNATING = (0.0, 80.0, 0.0, 120.0, 0.0, 80.0, 0.0, 120.0)
REASON = Reason(ReasonCode.RESIDUAL, "shot", "it does not fit")
NOTE = Note(NoteCode.NO_LOG_ROW, "shotlog.csv", "shotlog.csv has no row")


def texts(document: Mapping[str, Any], severity: Severity) -> list[str]:
    return [one["text"] for one in document["findings"] if one["severity"] == severity]


def assert_agree(document: Mapping[str, Any]) -> None:
    """Findings are the reasons, then what warns, then the notes."""
    assert texts(document, Severity.FATAL) == document["reasons"]
    assert texts(document, Severity.NOTE) == document["notes"]
    weights = [list(Severity).index(Severity(one["severity"])) for one in document["findings"]]
    assert weights == sorted(weights, reverse=True)
    assert document["valid"] == (not texts(document, Severity.FATAL))
    for one in document["findings"]:
        assert one.keys() - {"figures"} == {"code", "about", "severity", "text"}
        assert one["code"]


@pytest.mark.parametrize("reasons", [(), (REASON, REASON.again("it does not fit at all"))], ids=["valid", "not valid"])
def test_a_report_lists_reasons_warnings_and_notes(reasons: tuple[Reason, ...]) -> None:
    virtual, found = virtual_shot("mixed"), identified("mixed")
    warns = QualityCheck("acc", Check.RANGE, "warn", "89 % of its range")
    shot = replace(virtual.shot, quality=(*virtual.shot.quality, warns))
    found = replace(found, reasons=reasons, notes=(NOTE, *found.notes))
    document = report_document(shot, found, version="1.2.3", shot_file=SHOT_FILE)
    assert_agree(document)
    assert not seal_fault(document)
    assert {"code": "range", "about": "acc", "severity": "warn", "text": "acc: 89 % of its range"} in document[
        "findings"
    ]
    assert NOTE.to_json() in document["findings"]
    assert len(texts(document, Severity.WARN)) == sum(check.verdict == "warn" for check in shot.quality)


@pytest.mark.whole_way
def test_a_campaign_lists_its_signals_as_warnings_and_tells_no_change_twice() -> None:
    sound, stepped = (campaign_of(ALTERNATING, seed=4, step_kg=step).shots for step in ({}, {4: -12.0}))
    for shots, valid in ((sound, True), (stepped, False)):
        document = campaign_document(combine(shots), version="1.2.3", inputs=[], parameters={})
        assert document["valid"] == valid
        assert_agree(document)
        assert texts(document, Severity.WARN) == [signal["detail"] for signal in document["signals"]]
        told = [(one["code"], one["about"]) for one in document["findings"] if one["severity"] == Severity.WARN]
        assert told == [(signal["kind"], signal["influence"]) for signal in document["signals"]]
    assert ("mass step", "mass") in told
    # the reason says it already
    assert changed(document) == []
    silent = [one for one in document["findings"] if one["severity"] != Severity.FATAL]
    assert len(changed({**document, "findings": silent})) == 1


@pytest.mark.parametrize("reasons", [(), (REASON,)], ids=["valid", "not valid"])
def test_a_target_lists_reasons_and_notes(reasons: tuple[Reason, ...]) -> None:
    found = TargetResult("stiffness", "Stiffness", "By inverse dynamics.", (), reasons=reasons, notes=(NOTE,))
    document = target_document(virtual_shot("mixed").shot, found, version="1.2.3", shot_file=SHOT_FILE)
    assert_agree(document)
    assert document["findings"] == [one.to_json() for one in (*reasons, NOTE)]
