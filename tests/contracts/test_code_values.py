"""Values of codes that documents carry: users' scripts depend on them, so that none changes and none goes."""

from __future__ import annotations

from enum import StrEnum

import pytest

from recoil_acquisition.errors import ErrorCode, FaultCode, FileEnd
from recoil_acquisition.remark import CautionCode, NoteCode, Severity

VALUES: dict[type[StrEnum], str] = {
    ErrorCode: (
        "read, format, corrupt, channel, framing, store, rig, device, alignment, identification, worker, shortage, "
        "other, cut off, no source, exists"
    ),
    FaultCode: (
        "syntax, missing, unknown, duplicate, type, value, range, unit, contradiction, ambiguous, file, changed, "
        "at rest, unusual, overdue"
    ),
    NoteCode: "reader, no log row, not checked, sensitivity, assumption, session",
    CautionCode: "reader, loss, log fault",
    FileEnd: "missing, unclear, there",
    Severity: "note, warn, fatal",
}


@pytest.mark.parametrize("codes", VALUES, ids=lambda codes: codes.__name__)
def test_the_values_of_codes_stay(codes: type[StrEnum]) -> None:
    assert [code.value for code in codes] == VALUES[codes].split(", ")
