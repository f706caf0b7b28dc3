"""Whatever stands in place of a number in the head of a text is refused in one line, or read."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from tests.builders import oscilloscope_texts, text_tables
from tests.builders.lvm_files import Lvm, columns
from tests.builders.opened_files import RECORDER, open_bytes
from tests.contracts.test_reader_rules import CASES, DECLARED_CASES

HOSTILE = (
    "²", "9" * 5000, "1e999", "1e308", "1e-320", "1e9", "1e-9", "-1e-3", "-1", "0", "nan", "inf", "-inf", "", "0x10",
    " ", "1,5", "\0",
    "1_000", "１２", "٣", "1e", "--1", "1.5", "99999999999999999999", "1" + "0" * 400, "x",
)  # fmt: skip
"""What may stand where a number is due."""
NUMBER = re.compile(rb"[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?")
HEAD_BYTES = 1500
MOST_NUMBERS = int(os.environ.get("RECOIL_DAQ_HOSTILE_NUMBERS", "8"))
"""Numbers of a head, spread evenly over it, that each are replaced by every value; the environment asks for more."""
LONGEST_OF_ONE_S, MOST_KB = 5.0, 500_000
"""Processor time and memory that a file may take."""
SEPARATORS, LONGEST_S = 50_000, 2.0
"""Signs of each kind behind a line of a head, and the processor time that the file may take."""
STRIDE = 7
"""Numbers from one that is replaced to the next, so that all of a head have their turn."""
READERS = Path(__file__).parents[2] / "daq" / "recoil_acquisition" / "readers"
TEXTS = [case for case in (*CASES, *DECLARED_CASES) if not re.search(rb"[\0-\x08]", case.content[:HEAD_BYTES])]


def read_whole(case: Case, folder: Path, content: bytes) -> str:
    """Claim a file and read all that a recording gives; return the line that refuses it, empty if nothing does."""
    try:
        surest_claim(Head(content))
        recording = case.open(folder, content)
        assert all(map(str, recording.notes))
        assert recording.absolute_start is None or recording.absolute_start.text
        recording.tracks()
        for header in recording.signals:
            recording.time_base(header.name)
            recording.read(header.name)
            recording.overloads(header.name)
    except ReadError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("case", TEXTS, ids=lambda case: case.name)
def test_no_number_of_a_head_ends_in_another_exception(case: Case, tmp_path: Path) -> None:
    places = list(NUMBER.finditer(case.content, 0, HEAD_BYTES))
    for which, value in enumerate(HOSTILE):
        refused_in_one_line(case, tmp_path, places[which * STRIDE % len(places)], value)


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", TEXTS, ids=lambda case: case.name)
def test_no_value_at_any_number_of_a_head_takes_long_or_much(case: Case, tmp_path: Path) -> None:
    resource = pytest.importorskip("resource", reason="Windows tells no largest memory")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    places = list(NUMBER.finditer(case.content, 0, HEAD_BYTES))
    for place in places[:: max(len(places) // MOST_NUMBERS, 1)]:
        for value in HOSTILE:
            begin = time.process_time()
            refused_in_one_line(case, tmp_path, place, value)
            assert time.process_time() - begin < LONGEST_OF_ONE_S, (place[0], value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_KB


def refused_in_one_line(case: Case, folder: Path, place: re.Match[bytes], value: str) -> None:
    said = read_whole(case, folder, case.content[: place.start()] + value.encode() + case.content[place.end() :])
    # Universal Files say by exceptions of their own what is wrong with a head
    assert case.name == "uff" or "Error:" not in said, (place[0], value, said)
    assert "\n" not in said


def instants(folder: Path, content: bytes, declared: Declarations = RECORDER) -> TimeBase:
    recording = open_bytes(None, "a.txt", folder, content, declared)
    return recording.time_base(recording.signals[0].name)


LVM, RIGOL = Lvm([columns()]).content(), oscilloscope_texts.rigol(40).content
FAST = LVM.replace(b"0.001000", b"1e-9")
MEMORY = oscilloscope_texts.rigol_memory(40).content
NO_RECORDING, APART = "the stated time is that of no recording", "the stated times cannot be told apart"


@pytest.mark.parametrize(
    ("content", "number", "hostile", "said"),
    [
        (LVM, "Delta_X\t0.001000", "Delta_X\t1e-320", NO_RECORDING),
        (LVM, "Delta_X\t0.001000", "Delta_X\t1e308", NO_RECORDING),
        (LVM, "X0\t0.0000000000000000E+0", "X0\t1e999", "a segment states no step of time"),
        (LVM, "X0\t0.0000000000000000E+0", "X0\t1e13", NO_RECORDING),
        (FAST, "X0\t0.0000000000000000E+0", "X0\t1e9", APART),
        (RIGOL, "2.000000e-06", "-1e-3", NO_RECORDING),
        (RIGOL, "2.000000e-06", "1e-320", NO_RECORDING),
        (RIGOL, "2.000000e-06", "1e308", NO_RECORDING),
        (RIGOL, "-4.000000e-05", "1e10", APART),
        (MEMORY, "t0 = -4e-05", "t0 = " + "9" * 30, NO_RECORDING),
        (MEMORY, "tInc = 2e-06", "tInc = " + "9" * 30, NO_RECORDING),
    ],
)  # fmt: skip
def test_a_stated_time_that_no_recording_has_is_refused_with_what_was_found(
    content: bytes, number: str, hostile: str, said: str, tmp_path: Path
) -> None:
    spoilt = content.replace(number.encode(), hostile.encode(), 1)
    assert spoilt != content
    with pytest.raises(ReadError, match=said) as caught:
        instants(tmp_path, spoilt)
    assert caught.value.found
    assert caught.value.remedy


@pytest.mark.parametrize("count", ["²", "9" * 6000, "1e999", "٣"])
def test_a_count_that_is_no_number_of_samples_says_nothing(count: str, tmp_path: Path) -> None:
    spoilt = LVM.replace(b"Samples\t40\t40", f"Samples\t{count}\t{count}".encode())
    assert spoilt != LVM
    recording = open_bytes(None, "a.lvm", tmp_path, spoilt)
    assert recording.read("acc").size == 40
    assert not recording.incomplete


def test_a_fraction_of_a_second_that_is_no_number_dates_nothing(tmp_path: Path) -> None:
    spoilt = LVM.replace(b"12:23:05.7570000000000000001", "12:23:05.²".encode())
    assert spoilt != LVM
    assert open_bytes(None, "a.lvm", tmp_path, spoilt).absolute_start is None


def test_a_declared_rate_is_held_to_the_same(tmp_path: Path) -> None:
    layout = {**text_tables.BARE_LAYOUT, "rate_hz": 1e-300}
    with pytest.raises(ReadError, match=NO_RECORDING):
        instants(tmp_path, text_tables.BARE, Declarations("dewetron", layout=layout))


def test_what_digits_are_is_said_in_one_place() -> None:
    testing = re.compile(r"\.is(?:digit|numeric|decimal)\(")
    found = {path.relative_to(READERS).as_posix() for path in READERS.rglob("*.py") if testing.search(path.read_text())}
    # of bytes `isdigit` means those of ASCII, and a version is that of an installed library
    assert found == {"text/cells.py", "foreign_formats.py", "dewesoft/native.py"}


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", TEXTS, ids=lambda case: case.name)
def test_a_head_of_separators_alone_takes_no_longer_than_its_size_asks_for(case: Case, tmp_path: Path) -> None:
    whole = b"\t" * SEPARATORS + b"," * SEPARATORS + b";" * SEPARATORS
    lines = case.content.splitlines(keepends=True)
    # the files of a reader share its lines
    alike = [one.name for one in TEXTS if one.reader is case.reader]
    for at in range(alike.index(case.name), min(len(lines), 12), len(alike)):
        kept = lines[at].rstrip(b"\r\n")
        begin = time.process_time()
        read_whole(case, tmp_path, b"".join([*lines[:at], kept, whole, lines[at][len(kept) :], *lines[at + 1 :]]))
        assert time.process_time() - begin < LONGEST_S, at
