"""Captures of CAN buses: two stamps per frame, decoded like any log."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition import conformance as rules
from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.frames import can_rows as capture
from recoil_acquisition.readers.can.log import CANDUMP
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS, recognise
from tests.builders import can_captures, rdlog_bytes
from tests.builders import vendor_files as build
from tests.builders.can_rows import pack_row
from tests.builders.opened_files import open_bytes
from tests.builders.rdlog_bytes import at_record_end

DECLARED = Declarations("can", database=build.DBC)
MAGNITUDES = {"ACC.ax": (-10, 10), "ACC.p": (0, 20), "GYR.gx": (-1, 10), "EXT.low": (0, 100), "EXT.high": (0, 100)}
CASE = Case(
    "can-capture",
    next(reader for reader in READERS if reader.name == "recoil-daq capture"),
    can_captures.can_capture(can_captures.can_records(build.can_entries())),
    DECLARED,
    MAGNITUDES,
    at_record_end,
)
opened = partial(open_bytes, CaptureReader(), "bus.rdlog", declared=DECLARED)


@pytest.mark.exhaustive
@pytest.mark.parametrize("rule", rules.RULES, ids=lambda rule: rule.__name__)
def test_a_can_capture_keeps_every_rule_of_readers(rule: Callable[[Case, Path], None], tmp_path: Path) -> None:
    rule(CASE, tmp_path)


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=8))
def test_flipped_bytes_of_a_capture_are_refused_or_read(tmp_path: Path, flips: list[tuple[float, int]]) -> None:
    rules.flipped_bytes_are_refused_or_read(CASE, tmp_path, [flips])


def test_a_capture_is_recognised_by_its_first_record(tmp_path: Path) -> None:
    path = tmp_path / "without_suffix"
    path.write_bytes(CASE.content)
    assert recognise(path) is CASE.reader


def test_a_capture_holds_the_same_samples_as_a_log_of_the_same_bus(tmp_path: Path) -> None:
    entries = build.can_entries()
    log = tmp_path / "bus.log"
    log.write_bytes(build.candump_log(entries))
    vendor = CANDUMP.open(log, DECLARED)
    live = opened(tmp_path, CASE.content)
    assert [s.name for s in live.signals] == [s.name for s in vendor.signals]
    for signal in vendor.signals:
        np.testing.assert_array_equal(live.read(signal.name), vendor.read(signal.name))
        np.testing.assert_allclose(
            live.time_base(signal.name).times_s, vendor.time_base(signal.name).times_s, rtol=0, atol=1e-6
        )


def test_a_capture_without_device_time_is_dated_by_the_host(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries(), device=False, drift=0.0)
    live = opened(tmp_path, can_captures.can_capture(records))
    assert live.metadata["dated_by"] == "host"
    assert live.clock_fit is None
    assert any("host's clock" in note for note in live.notes)
    np.testing.assert_allclose(np.diff(live.time_base("ACC.ax").times_s), 1e-3, rtol=1e-9)


def test_both_stamps_and_the_fit_are_kept(tmp_path: Path) -> None:
    entries = build.can_entries(400)
    live = opened(tmp_path, can_captures.can_capture(can_captures.can_records(entries)))
    np.testing.assert_array_equal(live.device_ns, [can_captures.DEVICE_ZERO_NS + t for t, _, _ in entries])
    assert live.host_ns[0] == can_captures.HOST_ZERO_NS + 300_000
    assert live.clock_fit is not None
    assert live.metadata["clock_fit"]["drift"] == pytest.approx(2e-5, abs=1e-8)
    assert live.metadata["host_time_of_first_frame_ns"] == int(live.host_ns[0])
    json.dumps(live.metadata)


def test_the_anchor_gives_the_wall_clock_of_the_first_frame(tmp_path: Path) -> None:
    live = opened(tmp_path, CASE.content)
    assert live.absolute_start is not None
    assert live.absolute_start.text == "2023-11-14T22:13:20.250300"
    assert live.absolute_start.zone == "UTC"
    plain = can_captures.can_capture(can_captures.can_records(build.can_entries()), anchored=False)
    assert opened(tmp_path, plain).absolute_start is None


def test_a_first_frame_that_was_read_late_is_dated_by_when_it_was_sent(tmp_path: Path) -> None:
    late_ns = can_captures.HOST_ZERO_NS + 50_000_000
    rows = [capture.ROW.unpack(record) for record in can_captures.can_records(build.can_entries(400))]
    records = [capture.ROW.pack(device_ns, max(host_ns, late_ns), *rest) for device_ns, host_ns, *rest in rows]
    start = opened(tmp_path, can_captures.can_capture(records)).absolute_start
    assert start is not None
    sent = dt.datetime.fromisoformat("2023-11-14T22:13:20.250300")
    assert abs(dt.datetime.fromisoformat(start.text) - sent) < dt.timedelta(microseconds=20)


def test_a_step_of_the_interfaces_clock_costs_no_sample(tmp_path: Path) -> None:
    entries = build.can_entries(900)
    stepped = [(t - 300_000_000 if t >= 400_000_000 else t, key, data) for t, key, data in entries]
    records = [
        capture.ROW.pack(*capture.ROW.unpack(a)[:1], *capture.ROW.unpack(b)[1:])
        for a, b in zip(can_captures.can_records(stepped), can_captures.can_records(entries), strict=True)
    ]
    live = opened(tmp_path, can_captures.can_capture(records))
    assert live.read("ACC.ax").size == 900
    np.testing.assert_allclose(np.diff(live.time_base("ACC.ax").times_s), 1e-3, atol=1e-5)
    assert [round(step["step_s"], 4) for step in live.metadata["clock_fit"]["steps"]] == [-0.3]
    assert any("stepped by -0.3000" in note for note in live.notes)


@pytest.mark.parametrize(("event", "steps"), [("reopened", [0.003]), ("lost", [])])
def test_a_step_that_uneven_frames_hide_is_found_where_the_bus_was_opened_anew(
    tmp_path: Path, event: str, steps: list[float]
) -> None:
    true_ns = np.cumsum(np.random.default_rng(5).integers(1_000_000, 9_000_000, 1000)).tolist()
    first = int(np.argmin(np.diff(true_ns)[300:500])) + 301  # 3 ms more before it are nothing unusual
    entries = [(at_ns, 0x101, bytes(8)) for at_ns in true_ns]
    stepped = [(at_ns + (3_000_000 if i >= first else 0), key, data) for i, (at_ns, key, data) in enumerate(entries)]
    records: list[Any] = [
        capture.ROW.pack(*capture.ROW.unpack(a)[:1], *capture.ROW.unpack(b)[1:])
        for a, b in zip(can_captures.can_records(stepped), can_captures.can_records(entries, drift=0.0), strict=True)
    ]
    records.insert(first, (can_captures.HOST_ZERO_NS + true_ns[first] - 500_000, rdlog_bytes.event(event, "slcan")))
    live = opened(tmp_path, can_captures.can_capture(records))
    assert [round(step["step_s"], 6) for step in live.metadata["clock_fit"]["steps"]] == steps


def test_single_wrong_stamps_cost_no_sample(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries(900))
    late = capture.ROW.unpack(records[1000])
    records[1000] = capture.ROW.pack(late[0] + 41_900_000, *late[1:])
    live = opened(tmp_path, can_captures.can_capture(records))
    assert sum(live.read(name).size for name in ("ACC.ax", "GYR.gx", "EXT.kind")) == len(records)
    assert any("do not fit its clock" in note for note in live.notes)


def test_events_and_error_frames_are_told(tmp_path: Path) -> None:
    records: list[Any] = [*can_captures.can_records(build.can_entries())]
    host_ns = can_captures.HOST_ZERO_NS + 10_000_000
    records.insert(25, (host_ns, rdlog_bytes.event("lost", "slcan /dev/ttyACM0: gone")))
    records.insert(26, (host_ns + 1000, rdlog_bytes.event("reopened", "slcan /dev/ttyACM0 after 3 tries")))
    records.insert(
        27,
        pack_row(
            device_ns=1, host_ns=host_ns, identifier=0x4, flags=capture.ERROR, data=bytes([0, 1, 0, 0, 0, 0, 0, 0])
        ),
    )
    live = opened(tmp_path, can_captures.can_capture(records))
    assert live.read("ACC.ax").size == 30
    assert live.metadata["error_frames"] == 1
    assert live.metadata["error_frame_times"] == [{"host_ns": host_ns, "class": 4}]
    assert [event["name"] for event in live.metadata["events"]] == ["lost", "reopened"]
    assert any("lost 1 times" in note for note in live.notes)
    assert any("1 error frames" in note for note in live.notes)


def test_how_often_the_bus_was_lost_and_what_the_driver_could_not_read_are_told_apart(tmp_path: Path) -> None:
    names = ["lost", "reopened", "lost", "reopened", "unreadable", "reopened"]
    events: list[Any] = [
        (can_captures.HOST_ZERO_NS, rdlog_bytes.event(name, f"{name} {i}")) for i, name in enumerate(names)
    ]
    live = opened(tmp_path, can_captures.can_capture([*events, *can_captures.can_records(build.can_entries())]))
    assert [note for note in live.notes if "lost" in note or "read" in note] == [
        "the bus was lost 2 times while it was recorded: frames are missing there",
        "the driver could not read some entries: unreadable: unreadable 4",
    ]


def test_of_a_bus_that_is_lost_again_and_again_every_loss_counts_and_the_first_are_listed(tmp_path: Path) -> None:
    events: list[Any] = [(can_captures.HOST_ZERO_NS + i, rdlog_bytes.event("lost", f"{i}")) for i in range(201)]
    live = opened(tmp_path, can_captures.can_capture([*events, *can_captures.can_records(build.can_entries())]))
    assert [event["detail"] for event in live.metadata["events"]] == [f"{i}" for i in range(200)]
    assert any("lost 201 times" in note for note in live.notes)


def test_a_frame_of_64_bytes_is_none_that_is_damaged(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    device_ns, host_ns, *_ = capture.ROW.unpack(records[-1])
    longest = pack_row(
        device_ns=device_ns, host_ns=host_ns, identifier=0x123, flags=capture.DEVICE_TIME | capture.FD, data=bytes(64)
    )
    metadata = opened(tmp_path, can_captures.can_capture([*records, longest])).metadata
    assert (metadata["data_frames"], metadata["damaged_entries"]) == (len(records) + 1, 0)


def test_a_classic_frame_of_more_than_eight_bytes_contradicts_itself(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    device_ns, host_ns, *_ = capture.ROW.unpack(records[-1])
    longest = pack_row(
        device_ns=device_ns, host_ns=host_ns, identifier=0x123, flags=capture.DEVICE_TIME, data=bytes(12)
    )
    metadata = opened(tmp_path, can_captures.can_capture([*records, longest])).metadata
    assert (metadata["data_frames"], metadata["damaged_entries"]) == (len(records), 1)


def test_a_frame_that_asks_another_for_its_data_is_counted_and_holds_none(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    asking = [
        pack_row(device_ns=1, host_ns=can_captures.HOST_ZERO_NS, identifier=0x100, flags=flags, data=b"")
        for flags in (capture.REMOTE, capture.REMOTE | capture.DEVICE_TIME, capture.ERROR)
    ]
    metadata = opened(tmp_path, can_captures.can_capture([*asking, *records])).metadata
    assert (metadata["remote_frames"], metadata["error_frames"], metadata["damaged_entries"]) == (2, 1, 0)
    assert (metadata["data_frames"], metadata["dated_by"]) == (len(records), "interface")


def stamped_by(records: list[bytes], flags: int, count: int | None = None) -> list[bytes]:
    """Give the first records other flags of their stamps."""
    packed = [capture.ROW.unpack(one) for one in records]
    changed = [capture.ROW.pack(*one[:3], one[3] | flags, *one[4:]) for one in packed[:count]]
    return changed + (records[count:] if count else [])


def test_a_controllers_stamps_date_the_frames_and_two_clocks_that_are_mixed_do_not(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    kernels = opened(tmp_path, can_captures.can_capture(records))
    alone = opened(tmp_path, can_captures.can_capture(stamped_by(records, capture.HARDWARE_TIME)))
    mixed = opened(tmp_path, can_captures.can_capture(stamped_by(records, capture.HARDWARE_TIME, 5)))
    assert [one.metadata["dated_by"] for one in (kernels, alone, mixed)] == ["interface", "hardware", "host"]
    assert alone.metadata["clock_fit"] == kernels.metadata["clock_fit"]
    assert mixed.metadata["clock_fit"] is None
    assert mixed.metadata["damaged_entries"] == mixed.metadata["unknown_entries"] == 0


def test_damaged_records_are_counted(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    spoilt = bytearray(records[3])
    spoilt[23] = 65
    records[3] = bytes(spoilt)
    live = opened(tmp_path, can_captures.can_capture(records))
    assert live.metadata["damaged_entries"] == 1
    assert live.metadata["data_frames"] == len(records) - 1


def test_entries_with_flags_that_are_not_known_are_told_from_damage(tmp_path: Path) -> None:
    records = can_captures.can_records(build.can_entries())
    device_ns, host_ns, *_ = capture.ROW.unpack(records[-1])
    later = pack_row(device_ns=device_ns, host_ns=host_ns, identifier=0x123, flags=0x200, data=bytes(8))
    live = opened(tmp_path, can_captures.can_capture([*records, later]))
    assert (live.metadata["damaged_entries"], live.metadata["unknown_entries"]) == (0, 1)
    assert any("1 entries have flags that are not known" in note for note in live.notes)
    with pytest.raises(ReadError, match="flags of 1 entries are not known"):
        opened(tmp_path, can_captures.can_capture([later]))


def test_a_capture_without_database_or_frames_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.rdlog"
    path.write_bytes(CASE.content)
    with pytest.raises(ReadError, match="without its database"):
        CaptureReader().open(path, Declarations("can"))
    with pytest.raises(CorruptFileError, match="no data frames"):
        opened(tmp_path, can_captures.can_capture([]))
    with pytest.raises(CorruptFileError, match="not one sound record"):
        opened(tmp_path, b"something else")


def test_a_record_that_holds_no_whole_rows_costs_itself_alone(tmp_path: Path) -> None:
    rows = can_captures.can_records(build.can_entries())
    host_ns = int.from_bytes(rows[20][8:16], "little")
    reads = [(0, rdlog_bytes.CAN, host_ns, b"".join(part)) for part in (rows[:20], [*rows[20:23], b"x"], rows[23:])]
    live = opened(tmp_path, rdlog_bytes.rdlog({"sources": [{"name": "can", "kind": "can"}]}, reads))
    assert live.metadata["data_frames"] == len(rows)
    assert live.metadata["damaged_entries"] == 1


def test_a_row_is_as_long_as_documented() -> None:
    assert capture.ROW_SIZE == capture.ROW.size == 88
