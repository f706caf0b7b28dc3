"""When a recording began, and in which zone, by what the header of an MDF 3 file states."""

from __future__ import annotations

import struct
from datetime import datetime

import pytest

from recoil_acquisition.readers.mdf3.groups import OldBlocks
from recoil_acquisition.readers.mdf3.reader import OldHeader
from tests.builders.mdf3_files import OldFile

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
