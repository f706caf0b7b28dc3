"""MDF 2 and 3 files from bytes: what their channels, times and headers say."""

from __future__ import annotations

import struct
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.mdf3.groups import OldBlocks
from recoil_acquisition.readers.mdf3.reader import OldHeader, OldMdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise, surest_claim
from tests.builders.mdf3_files import (
    DATA,
    DOUBLE,
    FLOAT,
    INTEL,
    INTERPOLATED,
    LINEAR,
    MOTOROLA,
    NEAREST,
    NO_CONVERSION,
    POLYNOMIAL,
    RATIONAL,
    SHORT_CHANNEL,
    SIGNED,
    TIME,
    UNSIGNED,
    OldFile,
    one_channel,
    small_old_mdf,
    stored_together,
)
from tests.builders.opened_files import open_bytes

UNFINISHED = b"UnFinMF "
opened = partial(open_bytes, OldMdfReader(), "a.dat")


@pytest.mark.parametrize("version", ["2.00", "2.14", "3.00", "3.10", "3.20", "3.30"])
@pytest.mark.parametrize("mark", [b"MDF     ", UNFINISHED])
def test_a_file_says_in_its_first_bytes_that_it_is_one(version: str, mark: bytes, tmp_path: Path) -> None:
    content = OldFile(version=version, mark=mark).closed(0)
    claim, readers = surest_claim(Head(content))
    assert (claim, [reader.name for reader in readers]) == (Claim.CERTAIN, ["MDF 3"])
    (tmp_path / "a.csv").write_bytes(content)
    assert recognise(tmp_path / "a.csv").name == "MDF 3"


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"MDF     4.10    " + bytes(200), "no MDF 3 file"),
        (b"MDF     3.30    " + bytes(20), "the file is cut"),
        (bytes(8) + b"3.30    " + bytes(200), "no MDF 3 file"),
    ],
)
def test_what_is_of_another_version_or_cut_is_refused(content: bytes, problem: str, tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=problem):
        opened(tmp_path, content)


@pytest.mark.parametrize("order", ["<", ">"])
def test_blocks_and_records_are_read_in_either_byte_order(order: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, small_old_mdf(order))
    long_name = "p of the recoil brake, before the valve"
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [(long_name, "", 12), ("acc", "m/s2", 12)]
    np.testing.assert_array_equal(recording.read("acc"), 0.5 * (np.arange(12) - 3) + 1.0)
    np.testing.assert_array_equal(recording.read(long_name), 0.5 * np.arange(12) - 2.0)
    assert recording.time_base("acc").step_s == pytest.approx(1e-3)
    assert recording.signals[1].metadata == {"group": 0, "comment": "carriage"}
    raw = recording.raw("acc")
    assert raw is not None
    assert (raw.counts.tolist(), raw.gain, raw.offset, raw.unit) == ([*range(-3, 9)], 0.5, 1.0, "m/s2")
    assert (recording.notes, recording.incomplete) == ((), "")


NUMBERS = [
    (UNSIGNED, 8, "B", [0, 1, 255]), (UNSIGNED, 16, "H", [0, 1, 65535]), (UNSIGNED, 32, "I", [0, 1, 2**32 - 1]),
    (UNSIGNED, 64, "Q", [0, 1, 2**63]), (SIGNED, 8, "b", [0, -1, -128]), (SIGNED, 16, "h", [0, -1, -(2**15)]),
    (SIGNED, 32, "i", [0, -1, -(2**31)]), (SIGNED, 64, "q", [0, -1, -(2**63)]), (FLOAT, 32, "f", [0.5, -2.0, 1e20]),
    (DOUBLE, 64, "d", [0.1, -2.5, 1e300]),
]  # fmt: skip


@pytest.mark.parametrize(("of_type", "bits", "letter", "numbers"), NUMBERS)
@pytest.mark.parametrize("order", ["<", ">"])
def test_numbers_of_each_type_have_their_own_byte_order_or_that_of_the_file(
    order: str, of_type: int, bits: int, letter: str, numbers: list[float], tmp_path: Path
) -> None:
    for added, of_number in ((0, order), (INTEL, "<"), (MOTOROLA, ">")):
        stored = struct.pack(f"{of_number}3{letter}", *numbers)
        content = one_channel(stored, bits // 8, of_type + added, bits, file=OldFile(order=order))
        expected = np.array(numbers, "f4").astype(float) if letter == "f" else np.array(numbers, float)
        np.testing.assert_array_equal(opened(tmp_path, content).read("a"), expected)


def test_the_identification_states_the_order_of_numbers_even_where_blocks_have_another(tmp_path: Path) -> None:
    file = OldFile(order="<", numbers_order=">")
    ticks = file.conversion(LINEAR, 0.0, 0.5, unit=b"s")
    time = file.channel("t", TIME, 16, 8, UNSIGNED, conversion=ticks)
    group = file.group(file.channel("a", DATA, 0, 16, UNSIGNED, time), 3, 2)
    content = file.closed(file.data_group(group, file.records(b"\x01\x02\0\x03\x04\1")))
    np.testing.assert_array_equal(opened(tmp_path, content).read("a"), [0x0102, 0x0304])


@pytest.mark.parametrize(("start", "bits"), [(0, 1), (3, 5), (4, 9), (7, 12), (0, 24), (5, 19)])
@pytest.mark.parametrize(("added", "order"), [(INTEL, "little"), (MOTOROLA, "big")])
def test_numbers_that_are_packed_by_bits_are_taken_out(
    added: int, order: Literal["little", "big"], start: int, bits: int, tmp_path: Path
) -> None:
    stored = b"\x5a\xc3\x96"
    number = int.from_bytes(stored[: (start + bits + 7) // 8], order) >> start & (1 << bits) - 1
    for of_type, expected in ((UNSIGNED, number), (SIGNED, number - (number >> bits - 1 << bits))):
        content = one_channel(stored * 2, 3, of_type + added, bits, start=start)
        np.testing.assert_array_equal(opened(tmp_path, content).read("a"), [expected] * 2)


def test_a_channel_may_begin_more_bytes_into_a_record_than_its_bits_can_say(tmp_path: Path) -> None:
    content = one_channel(bytes(9000) + b"\x07\x01", 9002, UNSIGNED, 9, start=0, bytes_before=9000)
    np.testing.assert_array_equal(opened(tmp_path, content).read("a"), [0x107])


def test_the_shorter_blocks_of_older_versions_are_read(tmp_path: Path) -> None:
    file = OldFile(version="2.14")
    seconds = file.conversion(NO_CONVERSION, unit=b"s")
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=seconds, length=SHORT_CHANNEL)
    name = file.text("behind the block")
    value = file.channel("a", DATA, 64, 8, UNSIGNED, time, description=b"of the tube", length=SHORT_CHANNEL)
    file.records(struct.pack("<3I", name, name, name))
    group = file.group(value, 9, 2)
    struct.pack_into("<H", file.content, group + 2, 26)
    rows = struct.pack("<dBdB", 0.0, 7, 0.25, 8)
    recording = opened(tmp_path, file.closed(file.data_group(group, file.records(rows))))
    np.testing.assert_array_equal(recording.read("a"), [7, 8])
    assert [signal.name for signal in recording.signals] == ["a"]
    assert recording.signals[0].metadata["comment"] == "of the tube"
    assert recording.notes == ()


def test_texts_are_of_the_code_page_that_the_file_states(tmp_path: Path) -> None:
    file = OldFile(code_page=1251)
    seconds = file.conversion(NO_CONVERSION, unit=b"s")
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=seconds)
    unit = file.conversion(NO_CONVERSION, unit="кН".encode("cp1251"))
    name = file.text("сила", "cp1251")
    group = file.group(file.channel("f", DATA, 64, 8, UNSIGNED, time, conversion=unit, long_name=name), 9, 1)
    content = file.closed(file.data_group(group, file.records(bytes(9))), author="Иван".encode("cp1251"))
    recording = opened(tmp_path, content)
    assert [(s.name, s.unit) for s in recording.signals] == [("сила", "кН")]
    assert (recording.metadata["author"], recording.metadata["subject"]) == ("Иван", "range 7")
    assert "project" not in recording.metadata


@pytest.mark.parametrize("behind", [False, True])
def test_groups_that_are_stored_together_are_told_apart(behind: bool, tmp_path: Path) -> None:
    rows = [(1, 0.0, 5), (2, 0.0, 600), (1, 0.5, 6), (2, 0.25, 700), (2, 0.75, 800)]
    recording = opened(tmp_path, stored_together(rows, behind=behind))
    for number, name in ((1, "b"), (2, "a")):
        of_group = [row for row in rows if row[0] == number]
        np.testing.assert_array_equal(recording.read(name), [sample for _, _, sample in of_group])
        np.testing.assert_array_equal(recording.time_base(name).times_s, [t for _, t, _ in of_group])


def test_counts_as_times_are_exact_and_keep_the_gap_of_a_missing_sample(tmp_path: Path) -> None:
    def times(ticks: list[int]) -> Recording:
        file = OldFile()
        time = file.channel("t", TIME, 0, 32, UNSIGNED, conversion=file.conversion(LINEAR, 2.0, 1e-4, unit=b"s"))
        group = file.group(file.channel("a", DATA, 32, 8, UNSIGNED, time), 5, len(ticks))
        rows = b"".join(struct.pack("<IB", tick, 1) for tick in ticks)
        return opened(tmp_path, file.closed(file.data_group(group, file.records(rows))))

    whole = times([*range(5, 45)]).time_base("a")
    assert (whole.start_s, whole.step_s) == (pytest.approx(2.0005, abs=1e-15), pytest.approx(1e-4))
    gap = times([tick for tick in range(5, 45) if tick != 9]).time_base("a")
    assert gap.step_s is None
    np.testing.assert_allclose(gap.times_s, [2 + 1e-4 * n for n in range(5, 45) if n != 9], rtol=1e-15)


def computed(rate: float) -> bytes:
    file = OldFile()
    time = file.channel("t", TIME, 0, 0, DOUBLE, rate=rate)
    group = file.group(file.channel("a", DATA, 0, 8, UNSIGNED, time), 1, 4)
    return file.closed(file.data_group(group, file.records(bytes(range(4)))))


def test_times_that_take_no_bits_are_a_step_apart(tmp_path: Path) -> None:
    base = opened(tmp_path, computed(0.125)).time_base("a")
    assert (base.start_s, base.step_s, base.count) == (0.0, 0.125, 4)


@pytest.mark.parametrize(("rate", "problem"), [(0.0, "step"), (float("inf"), "its time is damaged")])
def test_times_without_a_step_leave_their_channels_out(rate: float, problem: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=problem):
        opened(tmp_path, computed(rate))


def test_a_further_time_is_named_and_its_step_changes_no_channel(tmp_path: Path) -> None:
    file = OldFile()
    value = file.channel("a", DATA, 0, 8, UNSIGNED)
    further = file.channel("further", TIME, 0, 0, DOUBLE, value, rate=0.25)
    group = file.group(file.channel("t", TIME, 0, 0, DOUBLE, further, rate=0.5), 1, 4)
    recording = opened(tmp_path, file.closed(file.data_group(group, file.records(bytes(range(4))))))
    assert recording.read("a").tolist() == [0, 1, 2, 3]
    assert [note.split(" of group 0")[0] for note in recording.notes] == ["further"]


def test_what_is_no_number_or_of_no_known_kind_is_named_and_left_out(tmp_path: Path) -> None:
    file = OldFile(float_format=1)
    seconds = file.conversion(NO_CONVERSION, unit=b"s")
    following = file.channel("t", TIME, 0, 64, DOUBLE + INTEL, conversion=seconds)
    conversions = {
        "expo": file.conversion(7, *range(7)), "log": file.conversion(8, *range(7)), "odd": file.conversion(99),
        "formula": file.conversion(10), "words": file.conversion(11), "ranges": file.conversion(12),
        "day": file.conversion(132), "hour": file.conversion(133), "cut": file.conversion(1, 1.0, 2.0, count=2),
    }  # fmt: skip
    for name, at in conversions.items():
        following = file.channel(name, DATA, 64, 8, UNSIGNED, following, conversion=at)
    for name, data_type in (("text", 7), ("bytes", 8), ("vax", 4), ("vaxen", FLOAT), ("later", 17)):
        following = file.channel(name, DATA, 64, 32, data_type, following)
    following = file.channel("array", DATA, 64, 8, UNSIGNED, following, parts=64)
    following = file.channel("wide", DATA, 64, 72, UNSIGNED, following)
    following = file.channel("beyond", DATA, 97, 8, UNSIGNED, following)
    following = file.channel("kind", 2, 64, 8, UNSIGNED, following)
    group = file.group(file.channel("a", DATA, 64, 8, UNSIGNED, following), 13, 2, reduced=64)
    recording = opened(tmp_path, file.closed(file.data_group(group, file.records(struct.pack("<dIxdIx", 0, 1, 1, 2)))))
    assert [signal.name for signal in recording.signals] == ["a"]
    named = {note.split(" of group 0: ")[0]: note.split(" of group 0: ")[-1] for note in recording.notes}
    assert [named[name].split(":")[0] for name in conversions] == [
        "an exponential conversion", "a logarithmic conversion", "conversion 99", "a formula as text",
        "an enumeration (value to text)", "an enumeration (range to text)", "a date", "a time", "damaged",
    ]  # fmt: skip
    assert "has 62 bytes for 4 numbers" in named["cut"]
    assert (named["text"], named["bytes"]) == ("text: left out", "bytes: left out")
    assert all("float of VAX" in named[name] for name in ("vax", "vaxen", "later"))
    assert named["array"] == "an array or a structure: left out"
    assert named["wide"].startswith("damaged: 72 bits")
    assert named["beyond"].startswith("damaged: 8 bits")
    assert named["kind"] == "of no known channel type: left out"
    assert any(note.startswith("reduced samples") for note in recording.notes)


def test_frames_of_a_bus_are_named(tmp_path: Path) -> None:
    content = small_old_mdf().replace(b"acc\0", b"CAN_DataFrame.ID\0\0\0\0"[:4])
    assert opened(tmp_path, content).notes == ()
    file = OldFile()
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=b"s"))
    frames = file.group(file.channel("CAN_DataFrame.ID", DATA, 64, 32, UNSIGNED, time), 12, 1)
    following = file.data_group(frames, file.records(bytes(12)))
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=b"s"))
    group = file.group(file.channel("a", DATA, 64, 8, UNSIGNED, time), 9, 1)
    recording = opened(tmp_path, file.closed(file.data_group(group, file.records(bytes(9)), following)))
    assert [signal.name for signal in recording.signals] == ["a"]
    assert recording.notes == ("frames of a bus in this file are not read: those of MDF 4 are",)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("stated", "flags"), [(0, 0), (3, 0), (3, 1), (2**32 - 1, 3)])
def test_records_of_a_file_that_was_never_finalised_are_counted(
    order: str, stated: int, flags: int, tmp_path: Path
) -> None:
    content = bytearray(small_old_mdf(order, UNFINISHED, stated))
    struct.pack_into(f"{order}H", content, 60, flags)
    for left, count in ((0, 12), (1, 11), (14, 11), (15, 10)):
        recording = opened(tmp_path, bytes(content[: len(content) - left]))
        assert recording.signals[1].sample_count == count
        np.testing.assert_array_equal(recording.read("acc"), 0.5 * (np.arange(count) - 3) + 1.0)
        expected = f"the recording was never finalised: its {count} records are counted by their bytes"
        assert (recording.notes, recording.incomplete) == ((expected,), expected)


def test_records_with_a_number_before_and_behind_are_counted_with_both(tmp_path: Path) -> None:
    file = OldFile(mark=UNFINISHED)
    time = file.channel("t", TIME, 0, 8, UNSIGNED, conversion=file.conversion(LINEAR, 0.0, 1.0, unit=b"s"))
    group = file.group(file.channel("a", DATA, 8, 8, UNSIGNED, time), 2, 0, number=7)
    at = file.data_group(group, 0, numbers=2)
    records = b"".join(bytes([7, n, 9 * n, 7]) for n in range(5))
    struct.pack_into("<I", file.content, at + 16, file.records(records))
    np.testing.assert_array_equal(opened(tmp_path, file.closed(at)).read("a"), [0, 9, 18, 27, 36])


def test_records_are_counted_up_to_the_next_block(tmp_path: Path) -> None:
    file = OldFile(mark=UNFINISHED)
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=b"s"))
    value = file.channel("a", DATA, 64, 8, UNSIGNED, time)
    data = file.records(b"".join(struct.pack("<dB", n, n) for n in range(5)))
    group = file.group(value, 9, 0)
    recording = opened(tmp_path, file.closed(file.data_group(group, data)))
    np.testing.assert_array_equal(recording.read("a"), range(5))


def test_a_file_without_finalised_counts_of_other_things_is_read_as_it_is(tmp_path: Path) -> None:
    content = bytearray(small_old_mdf(mark=UNFINISHED, stated=7))
    struct.pack_into("<2H", content, 60, 0x0002, 0)
    recording = opened(tmp_path, bytes(content))
    assert recording.read("acc").size == 7
    assert recording.notes == ("the recording was never finalised",)


def test_a_file_that_was_never_finalised_and_has_two_groups_or_flags_of_its_program_is_refused(tmp_path: Path) -> None:
    with_flags = bytearray(small_old_mdf(mark=UNFINISHED))
    struct.pack_into("<2H", with_flags, 60, 0x0002, 1)
    two_groups = stored_together([(1, 0.0, 5), (2, 0.0, 600)]).replace(b"MDF     ", UNFINISHED)
    for content in (bytes(with_flags), two_groups):
        with pytest.raises(ReadError, match="never finalised: its counts cannot be trusted"):
            opened(tmp_path, content)


def test_samples_beyond_the_end_of_the_file_are_refused(tmp_path: Path) -> None:
    for content in (small_old_mdf(stated=13), small_old_mdf()[:-1], small_old_mdf(stated=2**32 - 1)):
        with pytest.raises(CorruptFileError, match="samples are missing"):
            opened(tmp_path, content)


def test_a_group_without_a_link_to_its_records_is_refused(tmp_path: Path) -> None:
    file = OldFile()
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=b"s"))
    group = file.group(file.channel("a", DATA, 64, 8, UNSIGNED, time), 9, 1)
    with pytest.raises(CorruptFileError, match="samples are missing: 0 of 1"):
        opened(tmp_path, file.closed(file.data_group(group, 0)))


def test_channels_that_lie_over_one_another_are_counted_by_their_bytes(tmp_path: Path) -> None:
    file = OldFile()
    following = file.channel("t", TIME, 0, 0, UNSIGNED, rate=0.001)
    for number in range(300):
        following = file.channel(f"n{number}", DATA, 0, 9, UNSIGNED, following)
    group = file.group(following, 2, 300_000)
    with pytest.raises(ReadError, match=f"0 bytes of records, {300_000 * (300 * 2 + 8)} of channels"):
        opened(tmp_path, file.closed(file.data_group(group, file.records(bytes(600_000)))))


@pytest.mark.parametrize(("unit", "unit_s"), [(b"s", 1.0), (b"ms", 1e-3), (b"us", 1e-6), (b"min", 60.0)])
def test_times_are_in_the_unit_that_their_conversion_states(unit: bytes, unit_s: float, tmp_path: Path) -> None:
    file = OldFile()
    time = file.channel("t", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=unit))
    value = file.channel("a", DATA, 64, 8, UNSIGNED, time)
    rows = b"".join(struct.pack("<dB", 2.0 * n, n) for n in range(5))
    content = file.closed(file.data_group(file.group(value, 9, 5), file.records(rows)))
    base = opened(tmp_path, content).time_base("a")
    np.testing.assert_allclose(base.times_s, 2.0 * unit_s * np.arange(5), rtol=1e-12)
    with pytest.raises(ReadError, match=r"its time is in 'turns', which is no unit of time"):
        opened(tmp_path, content.replace(unit.ljust(20, b"\0") + struct.pack("<H", NO_CONVERSION),
                                         b"turns".ljust(20, b"\0") + struct.pack("<H", NO_CONVERSION)))  # fmt: skip


CONVERSIONS = [
    (NO_CONVERSION,), (LINEAR, 3.0, -0.25), (INTERPOLATED, 2.0, 5.0, 90.0, -1.0, 200.0, 7.0),
    (NEAREST, 2.0, 5.0, 90.0, -1.0, 200.0, 7.0), (POLYNOMIAL, 3.0, 0.0, 0.0, 2.0, 0.0, 0.0),
    (POLYNOMIAL, 3.0, 7.0, 0.25, 2.0, 1.0, 0.5), (RATIONAL, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    (RATIONAL, 0.0, 4.0, 8.0, 0.0, 0.0, 2.0),
]  # fmt: skip
STORED = bytes([0, 1, 2, 3, 45, 46, 47, 145, 146, 199, 200, 255])


@pytest.mark.parametrize("conversion", CONVERSIONS, ids=str)
def test_conversions_are_those_of_asammdf(conversion: tuple[float, ...], tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "a.mdf"
    path.write_bytes(one_channel(STORED, 1, UNSIGNED, 8, conversion=conversion))
    recording = OldMdfReader().open(path, Declarations("c"))
    with asammdf.MDF(path) as mdf:
        expected = mdf.get("a")
    np.testing.assert_allclose(recording.read("a"), expected.samples, rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(recording.time_base("a").times_s, expected.timestamps)
    assert recording.signals[0].unit == expected.unit == "V"


def test_a_table_of_more_pairs_than_the_length_of_a_block_can_say_is_read(tmp_path: Path) -> None:
    keys = np.arange(6000.0)
    pairs = np.column_stack([keys, keys % 7]).ravel().tolist()
    path = tmp_path / "a.mdf"
    stored = np.array([0, 5, 3000, 5999], "<u2").tobytes()
    path.write_bytes(one_channel(stored, 2, UNSIGNED, 16, conversion=(NEAREST, *pairs)))
    recording = OldMdfReader().open(path, Declarations("c"))
    np.testing.assert_array_equal(recording.read("a"), [0, 5, 3000 % 7, 5999 % 7])


LOCAL_S = round((datetime(2026, 8, 3, 14, 23, 5) - datetime(1970, 1, 1)).total_seconds())
HOUR_S = 3600


def header(
    version: str = "3.30", *, stamp_s: int = 0, stamp_ns: int = 0, offset_h: int = 0, **texts: bytes
) -> OldHeader:
    file = OldFile(version=version)
    return OldHeader(OldBlocks(file.closed(0, stamp_ns=stamp_s * 10**9 + stamp_ns, offset_h=offset_h, **texts)))


@pytest.mark.parametrize("version", ["2.14", "3.10", "3.30"])
def test_date_and_time_are_of_an_unknown_zone(version: str) -> None:
    found = header(version)
    assert found.start is not None
    assert (found.start.text, found.start.zone) == ("2026-08-03T14:23:05.000000000", "unknown")
    assert (found.metadata["version"], found.metadata["program"]) == (version, "tests")
    assert found.metadata["utc_offset_h"] == (0 if version >= "3.20" else None)
    assert found.notes == []


@pytest.mark.parametrize(
    ("offset_h", "ahead_s", "zone"),
    [
        (2, 0, "+02:00"),  # local time
        (2, HOUR_S, "+03:00"),  # local time without the hour of summer
        (2, 2 * HOUR_S, "+02:00"),  # UTC
        (-5, 0, "-05:00"),
        (-5, HOUR_S, "-04:00"),
        (-5, -5 * HOUR_S, "-05:00"),
        (1, 0, "+01:00"),
        (1, HOUR_S, "unknown"),  # without the hour of summer, or UTC
        (0, 0, "unknown"),  # what is written where none is known
        (0, HOUR_S, "unknown"),
        (14, 0, "+14:00"),
        (15, 0, "unknown"),  # no zone has it
        (-15, HOUR_S, "unknown"),
    ],
)
def test_the_zone_is_taken_where_both_starts_leave_no_other(offset_h: int, ahead_s: int, zone: str) -> None:
    found = header(stamp_s=LOCAL_S - ahead_s, stamp_ns=250_000_001, offset_h=offset_h)
    assert found.start is not None
    assert (found.start.text, found.start.zone) == ("2026-08-03T14:23:05.250000001", zone)
    assert found.notes == []
    assert found.metadata["utc_offset_h"] == offset_h


@pytest.mark.parametrize("ahead_s", [1, -1, 3 * HOUR_S, -2 * HOUR_S, LOCAL_S - 5])
def test_starts_that_are_at_odds_are_said_to_be_and_give_no_zone(ahead_s: int) -> None:
    found = header(stamp_s=LOCAL_S - ahead_s, stamp_ns=250_000_001, offset_h=2)
    assert found.start is not None
    assert (found.start.text, found.start.zone) == ("2026-08-03T14:23:05.000000000", "unknown")
    assert "at odds" in found.notes[0]


@pytest.mark.parametrize(
    ("date", "time"),
    [(b"", b""), (b"2026-08-03", b"14:23:05"), (b"01:01:1970", b"00:00:00"), (b"01:01:2500", b"00:00:00")],
)
def test_a_date_that_is_none_is_no_start(date: bytes, time: bytes) -> None:
    found = header(stamp_s=LOCAL_S, offset_h=2, date=date, time=time)
    assert found.start is None
    assert found.notes == []


@pytest.mark.parametrize(("length", "offset_h"), [(174, 2), (173, None)])
def test_a_header_may_end_behind_its_offset(length: int, offset_h: int | None) -> None:
    content = bytearray(OldFile().closed(0, stamp_ns=LOCAL_S * 10**9, offset_h=2))
    struct.pack_into("<H", content, 66, length)
    assert OldHeader(OldBlocks(bytes(content))).metadata["utc_offset_h"] == offset_h


def test_version_and_program_may_fill_their_fields_with_spaces() -> None:
    content = bytearray(OldFile().closed(0))
    content[8:24] = b"3.30    recorder"
    said = OldHeader(OldBlocks(bytes(content))).metadata
    assert (said["version"], said["program"]) == ("3.30", "recorder")
