"""What a capture holds of its sources, whatever its session says of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.readers.captured import CapturedEvent, CapturedSource, sources_of
from tests.builders import rdlog_bytes

IMU = {"name": "imu", "kind": "serial"}


def sources_in(
    path: Path, session: dict[str, Any], records: Sequence[tuple[int, int, int, bytes]] = ()
) -> tuple[CapturedSource, ...]:
    path.write_bytes(rdlog_bytes.rdlog(session, records))
    return sources_of(read_capture(path))


@pytest.mark.parametrize("other", [None, "imu", 7, ["name", "kind"], {}, {"name": "x"}, {"kind": "can"}])
def test_a_source_is_found_by_its_number_behind_one_that_is_not_named(tmp_path: Path, other: object) -> None:
    records = [(0, rdlog_bytes.SERIAL, 1, b"other"), (1, rdlog_bytes.SERIAL, 2, b"imu")]
    (source,) = sources_in(tmp_path / "x.rdlog", {"sources": [other, IMU]}, records)
    assert (source.name, source.kind) == ("imu", "serial")
    assert [record.payload for record in source.records] == [b"imu"]
    assert source.incomplete == ""


@pytest.mark.parametrize("session", [{}, {"sources": None}, {"sources": {"0": IMU}}, {"sources": "imu"}])
def test_a_session_that_names_no_sources_has_none(tmp_path: Path, session: dict[str, Any]) -> None:
    assert sources_in(tmp_path / "x.rdlog", session) == ()


def test_what_is_missing_of_a_source_is_said_of_it_alone(tmp_path: Path) -> None:
    path = tmp_path / "x.rdlog"
    records = [(i % 2, rdlog_bytes.SERIAL, i, bytes(20 + i)) for i in range(8)]
    sources_in(path, {"sources": [IMU, {"name": "bus", "kind": "can"}]}, records)
    whole = path.read_bytes()

    def incomplete(content: bytes) -> list[str]:
        path.write_bytes(content)
        return [source.incomplete for source in sources_of(read_capture(path))]

    # two of the first source, which has 20, 22, 24 and 26 bytes
    third, fifth = (rdlog_bytes.record(i + 1, *records[i], i // 2, position) for i, position in ((2, 20), (4, 42)))
    missing = whole.replace(third, b"").replace(fifth, b"")
    assert incomplete(missing) == ["2 of its records are missing or damaged", ""]
    cut = "the file is damaged or ends inside a record: it may have been cut"
    assert incomplete(whole[:-1]) == [cut, cut]
    damaged = bytearray(whole)
    damaged[whole.index(third) + 70] ^= 1
    assert incomplete(bytes(damaged)) == ["1 of its records are missing or damaged", cut]
    assert incomplete(whole) == ["", ""]


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"wall_ns": 3, "monotonic_ns": "2", "within_ns": 1}, Anchor(3, 2, 1)),
        (None, None),
        ([3, 2, 1], None),
        ({"wall_ns": 3}, None),
        ({"wall_ns": "x", "monotonic_ns": 2, "within_ns": 1}, None),
        ({"wall_ns": float("inf"), "monotonic_ns": 2, "within_ns": 1}, None),
    ],
)
def test_the_clocks_of_the_host_are_known_if_the_session_says_them(
    tmp_path: Path, stated: object, expected: Anchor | None
) -> None:
    (source,) = sources_in(tmp_path / "x.rdlog", {"sources": [IMU], "anchor": stated})
    assert source.anchor == expected


def test_what_happened_to_a_device_is_told_apart_from_what_it_delivered(tmp_path: Path) -> None:
    lost = (0, rdlog_bytes.EVENT, 5, rdlog_bytes.event("lost", "pulled"))
    silent = [lost, (0, rdlog_bytes.EVENT, 6, b"{}"), (0, rdlog_bytes.EVENT, 7, b"no JSON")]
    (source,) = sources_in(tmp_path / "x.rdlog", {"sources": [IMU]}, silent)
    assert source.events == (CapturedEvent(5, "lost", "pulled"),)
    assert not source.delivered
    (source,) = sources_in(tmp_path / "x.rdlog", {"sources": [IMU]}, [lost, (0, rdlog_bytes.SERIAL, 8, b"x")])
    assert source.events == (CapturedEvent(5, "lost", "pulled"),)
    assert source.delivered
