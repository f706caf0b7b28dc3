"""Notes of readers carry codes, so that nobody has to search their words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode
from tests.builders.vendor_files import DBC, asc_log, can_entries, dewesoft_text, motion_rows, tracks_text

LOST = [*motion_rows(), (0.003, float("nan"), 0.1)]
CAN = Declarations("can", database=DBC)


def notes_of(path: Path, content: bytes, declared: Declarations) -> set[tuple[object, str | None]]:
    path.write_bytes(content)
    return {(note.code, note.about) for note in recognise(path).open(path, declared).notes}


def test_a_note_of_another_package_is_a_readers() -> None:
    header, base = SignalHeader("p", "bar", 3), TimeBase.uniform("recorder", 0.0, 1e-3, 3)
    channel = StoredChannel(header, base, lambda start, stop: np.array([1.0, 9.9e37, 2.0])[start:stop])
    caution = Caution(CautionCode.LATE_STAMPS, "p", "late")
    recording = Recording(Path("a"), "other", [channel], metadata={}, notes=["three words only", caution])
    recording.read("p")
    own, same, marked = recording.notes
    assert (type(own), own.code, own.about, own) == (Note, NoteCode.READER, None, "three words only")
    assert same is caution
    assert (marked.code, marked.about) == (NoteCode.LOST, "p")


@pytest.mark.parametrize(
    ("name", "content", "declared", "expected"),
    [
        ("a.csv", dewesoft_text(motion_rows())[:-3], Declarations("dewetron"), {(NoteCode.CUT, None)}),
        ("a.csv", dewesoft_text(LOST), Declarations("dewetron"), {(NoteCode.LOST, "AI 1/acc")}),
        ("a.csv", tracks_text(skip=(12,)), Declarations("camera"), {(NoteCode.LOST, None)}),
        ("a.csv", tracks_text(lost=(12,)), Declarations("camera"), {(NoteCode.LOST, "Feature #1")}),
        (
            "a.asc",
            asc_log(can_entries(), extra=["   9.0 1  100 Rx d 8 00 01", "   9.1 1  5ff Rx d 1 00"]),
            CAN,
            {(CautionCode.DAMAGED_ENTRIES, None), (NoteCode.UNMATCHED, None)},
        ),
        (
            "a.asc",
            asc_log(can_entries(), extra=["   0.000000 1  100 Rx d 8 00 00 00 00 00 00 00 00"]),
            CAN,
            {(CautionCode.NOT_INCREASING, "ACC")},
        ),
    ],
)
def test_what_a_note_is_and_is_about(
    name: str, content: bytes, declared: Declarations, expected: set[tuple[object, str | None]], tmp_path: Path
) -> None:
    assert expected <= notes_of(tmp_path / name, content, declared)


def test_a_start_that_no_instrument_has_is_a_caution_with_file_and_date() -> None:
    header = SignalHeader("p", "bar", 3)
    for text, said in (("1904-01-01T00:00:00", 1), ("2026-08-03T12:23:05", 0)):
        start = AbsoluteStart(text, "unknown", "the head")
        channel = StoredChannel(header, TimeBase.uniform("recorder", 0.0, 1e-3, 3, start), lambda a, b: np.ones(b - a))
        recording = Recording(Path("x/shot.dat"), "other", [channel], metadata={}, absolute_start=start)
        assert [note.code for note in recording.notes] == [CautionCode.DOUBTFUL_START] * said
        assert all("shot.dat: its start, 1904-01-01T00:00:00 (the head)" in note for note in recording.notes)
