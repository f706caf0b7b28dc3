"""A check is a remark by its verdict, and keeps its name."""

from __future__ import annotations

import pytest

from recoil_acquisition.remark import Caution, Note, Reason, Remark
from recoil_acquisition.shot.quality_check import Check, QualityCheck, Verdict


@pytest.mark.parametrize(
    ("verdict", "kind", "severity"), [("fail", Reason, "fatal"), ("warn", Caution, "warn"), ("ok", Note, "note")]
)
def test_a_check_is_a_remark_by_its_verdict(verdict: Verdict, kind: type[Remark], severity: str) -> None:
    remark = QualityCheck("acc", Check.RANGE, verdict, "31 samples clipped").remark()
    assert type(remark) is kind
    text = "acc: 31 samples clipped"
    assert remark.to_json() == {"code": "range", "about": "acc", "severity": severity, "text": text}


def test_a_check_that_only_another_version_makes_keeps_its_name() -> None:
    known = QualityCheck.named("acc", "range", "ok", "")
    assert (known, known.check) == (QualityCheck("acc", Check.RANGE, "ok", ""), Check.RANGE)
    for name in ("drop-outs", ""):
        foreign = QualityCheck.named("acc", name, "fail", "")
        assert (foreign.check, foreign.name, foreign.to_json()["check"]) == (Check.OTHER, name, name)
        assert foreign.remark().code is Check.OTHER
