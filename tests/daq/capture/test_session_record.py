"""The log of a session says again what it was, what crossed, and how much room it needs."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from recoil_acquisition.capture.session_record import (
    CompleteShot,
    Kept,
    LiveRecord,
    OperatorRecords,
    RecordedSource,
    kept_of,
    live_record_of,
    longer,
    operator_records,
    reserve_bytes,
    session_folder,
)
from recoil_acquisition.devices.can_device import CanDevice
from recoil_acquisition.devices.device import Device
from recoil_acquisition.devices.serial_device import SerialDevice
from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import Kind, Record
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.trigger import Decision, Edge, Trigger
from tests.builders.live_sources import ANCHOR

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
TRIGGER = Trigger((Edge("pressure", 5e4),), pre_s=0.2, post_s=0.3)
CROSSED = Decision(10.5, "suppressed", "not armed", "pressure", 0, 50, 1e5, 10.499)
STRETCH = Kept(10.5, 10.5, 10.3, 10.8, "pressure crossed: not armed")


def of_source(number: int, kind: int, span_us: int | None = 5_000) -> Record:
    return Record(7, number, kind, int(10e9), b"abc", span_us, 100, 3, 40)


def test_sources_are_numbered_in_the_order_of_the_session() -> None:
    assert [RECORD.number(name) for name in ("bus", "port")] == [0, 1]
    with pytest.raises(KeyError, match="other"):
        RECORD.number("other")


def test_a_record_of_a_source_is_the_block_that_was_read_of_it() -> None:
    block = RECORD.block(of_source(1, Kind.SERIAL))
    assert (block.source, block.kind, block.host_ns, block.payload) == ("port", "serial", int(10e9), b"abc")
    assert block.empty_ns == int(10e9) - 5_000_000
    assert RECORD.block(of_source(0, Kind.CAN, None)).empty_ns is None


@pytest.mark.parametrize(("number", "kind"), [(2, Kind.SERIAL), (0xFFFF, Kind.EVENT), (0, Kind.CLOCK), (1, 99)])
def test_a_record_of_no_source_of_the_session_or_of_no_devices_kind_is_refused(number: int, kind: int) -> None:
    with pytest.raises(StoreError, match=f"record 7 of the journal is of source {number}, which is unknown"):
        RECORD.block(of_source(number, kind))


def test_a_session_that_had_a_spare_folder_is_the_same_session() -> None:
    assert live_record_of({**RECORD.to_json(), "spare": "/elsewhere"}, Path("j")) == RECORD


@pytest.mark.parametrize("change", [{"schema": "recoil-daq/live/2"}, {"rig_name": 3}, {"more": 1}])
def test_a_session_of_another_schema_or_other_fields_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(StoreError, match=r"j: is of no live acquisition: .* expected a session recoil-daq/live/1"):
        live_record_of({**RECORD.to_json(), **change}, Path("j"))
    with pytest.raises(StoreError, match="is of no live acquisition"):
        live_record_of({key: value for key, value in RECORD.to_json().items() if key != "schema"}, Path("j"))


def test_what_crossed_without_a_shot_is_kept_as_a_shot_would_have_been() -> None:
    assert kept_of(CROSSED, TRIGGER) == STRETCH
    assert kept_of(replace(CROSSED, value=0.0), TRIGGER) == STRETCH


def test_what_became_a_shot_and_an_operators_own_key_are_not_kept() -> None:
    for outcome in ("trigger", "extension"):
        assert kept_of(replace(CROSSED, outcome=outcome, reason=""), TRIGGER) is None
    assert kept_of(replace(CROSSED, value=None), TRIGGER) is None


def later(by_s: float, why: str = STRETCH.why) -> Kept:
    one = STRETCH
    return Kept(one.first_s + by_s, one.last_s + by_s, one.start_s + by_s, one.stop_s + by_s, why)


def test_a_stretch_that_follows_on_the_last_for_the_same_reason_makes_it_longer() -> None:
    first = later(-60.0)
    followed = longer([first, STRETCH], later(0.4))
    assert followed == [first, replace(STRETCH, last_s=10.9, stop_s=later(0.4).stop_s)]
    assert longer([STRETCH], replace(STRETCH, start_s=STRETCH.stop_s, stop_s=12.0)) == [replace(STRETCH, stop_s=12.0)]


def test_a_stretch_within_the_last_one_does_not_shorten_it() -> None:
    inner = replace(STRETCH, last_s=10.6, stop_s=10.7)
    assert longer([STRETCH], inner) == [replace(STRETCH, last_s=10.6)]


def test_stretches_apart_or_for_another_reason_stay_their_own() -> None:
    assert longer([], STRETCH) == [STRETCH]
    for one in (later(0.6), later(0.1, "rate crossed: not armed")):
        assert longer([STRETCH], one) == [STRETCH, one]


def test_a_stretch_lies_within_a_span_that_has_its_first_and_its_last_instant() -> None:
    stretch = replace(STRETCH, last_s=10.9)
    assert stretch.within([(0.0, 1.0), (10.5, 11.0)])
    for spans in ([], [(10.5, 10.9)], [(10.6, 11.0)], [(10.0, 10.7), (10.7, 11.0)]):
        assert not stretch.within(spans)


def test_how_long_a_stretch_lasted_is_said_in_words() -> None:
    assert STRETCH.lasting == "once"
    assert replace(STRETCH, last_s=12.75).lasting == "over 2.250 s"


def test_a_log_says_again_what_was_decided_kept_and_closed(tmp_path: Path) -> None:
    shot, apart = CompleteShot("0001", 10.5), later(60.0)
    for closed in (True, False):
        folder = tmp_path / f"{closed}"
        writer = LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 16)
        writer.say(Kind.CLOCK, int(10e9), asdict(ANCHOR))
        writer.say(Kind.DECISION, int(10.5e9), asdict(CROSSED))
        for stretch in (STRETCH, later(0.4), apart):
            writer.say(Kind.KEPT, int(stretch.last_s * 1e9), asdict(stretch))
        writer.say(Kind.SHOT, int(10.5e9), asdict(shot))
        writer.close(in_order=closed)
        kept = (replace(STRETCH, last_s=10.9, stop_s=later(0.4).stop_s), apart)
        assert operator_records(open_log(folder)) == OperatorRecords((CROSSED,), (shot,), kept, closed)


def test_a_record_of_the_log_that_cannot_be_understood_is_named(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "j", RECORD.to_json(), 0, segment_bytes=1 << 16) as writer:
        writer.say(Kind.SHOT, int(10.5e9), {"shot": "../0001", "trigger_s": 10.5})
    with pytest.raises(StoreError, match=r"record \d+ cannot be understood"):
        operator_records(open_log(tmp_path / "j"))


@pytest.mark.parametrize(
    ("wall_ns", "name"),
    [
        (0, "19700101T000000.000000Z"),
        (1_700_000_000_123_456_789, "20231114T221320.123456Z"),
        (999, "19700101T000000.000000Z"),
        (1_000, "19700101T000000.000001Z"),
    ],
)
def test_a_journal_is_named_by_its_beginning_in_utc(wall_ns: int, name: str) -> None:
    assert session_folder(Path("out"), wall_ns) == Path("out") / "journal" / name


@pytest.mark.parametrize(
    ("devices", "bytes_per_s"),
    [
        ([], 0),
        ([CanDevice("a", {"interface": "virtual"})], 8000 * 88),
        ([CanDevice("a", {"interface": "virtual", "bitrate": 500_000})], 4000 * 88),
        ([SerialDevice("b", {"port": "x", "baudrate": 921_600})], 92_160),
        ([SerialDevice("b", {"port": "x", "baudrate": 9_600}), SimpleNamespace(bytes_per_s=12.8e6)], 960 + 12_800_000),
    ],
)
def test_room_is_asked_for_all_that_the_devices_can_deliver(devices: list[Device], bytes_per_s: int) -> None:
    assert reserve_bytes(devices, 60.0) == 60 * bytes_per_s
