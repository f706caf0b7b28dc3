from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError
from recoil_acquisition.frames.scan import PortStream
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.record import MARK
from recoil_acquisition.readers.captured import sources_of
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.captured_port import _reads, back_dated, without_steps
from recoil_acquisition.readers.serial.plain import SerialBytesReader
from recoil_acquisition.readers.table import surest_claim
from recoil_acquisition.readers.time.increasing_stamps import increasing
from recoil_acquisition.remark import Caution, CautionCode
from tests.builders import rdlog_bytes
from tests.builders.opened_files import open_bytes
from tests.builders.serial_packets import stamped_capture, summed
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import FRAMING, serial_capture, serial_frame, serial_frames


class PortReader:
    """The reader of captures, or of plain bytes, as a file's beginning asks for."""

    def open(self, path: Path, declared: Declarations) -> Any:
        begins = path.exists() and path.read_bytes().startswith(MARK)
        return (CaptureReader() if begins else SerialBytesReader()).open(path, declared)


READER = PortReader()


def port_capture(reads: Sequence[tuple[int, bytes]]) -> bytes:
    session = {"sources": [{"name": "imu", "kind": "serial"}]}
    return rdlog_bytes.rdlog(session, [(0, rdlog_bytes.SERIAL, host_ns, data) for host_ns, data in reads])


def opened(tmp_path: Path, content: bytes, **keys: Any) -> Recording:
    framing = {key: value for key, value in {**FRAMING, **keys}.items() if value is not None}
    return open_bytes(READER, "a.bin", tmp_path, content, Declarations("imu", framing=framing))


def test_the_device_clock_is_unwrapped_and_counts_from_the_first_frame(tmp_path: Path) -> None:
    recording = opened(tmp_path, serial_capture(serial_frames(40)))
    base = recording.time_base("gyro")
    np.testing.assert_allclose(base.times_s, 1e-3 * np.arange(40), atol=1e-12)
    assert base.clock == "imu"
    assert base.absolute_start is None
    np.testing.assert_allclose(recording.read("gyro"), 0.01 * np.arange(40), rtol=1e-6)
    assert recording.metadata["device_time_of_first_frame_s"] == pytest.approx((2**32 - 5000) * 1e-6)
    assert recording.metadata["counter_gaps"] == 0
    assert recording.metadata["host_start"] == "2023-11-14T22:13:20.003000Z"
    assert recording.notes == ()


def test_integers_keep_their_raw_counts(tmp_path: Path) -> None:
    recording = opened(tmp_path, serial_capture(serial_frames(5)))
    raw = recording.raw("temperature")
    assert raw is not None
    assert raw.counts.tolist() == [150] * 5
    assert (raw.gain, raw.offset, raw.unit) == (0.01, 20.0, "degC")
    assert recording.raw("gyro") is None


def test_every_loss_is_counted_and_noted(tmp_path: Path) -> None:
    frames = serial_frames(40)
    damaged = bytearray(frames[10])
    damaged[9] ^= 0xFF
    content = serial_capture([*frames[:10], bytes(damaged), *frames[11:20], b"noise", *frames[22:]])
    recording = opened(tmp_path, content)
    counts = {
        k: recording.metadata[k]
        for k in ("received", "bad_checksum", "skipped_bytes", "counter_gaps", "missing_frames")
    }
    assert counts == {"received": 37, "bad_checksum": 1, "skipped_bytes": 21, "counter_gaps": 2, "missing_frames": 3}
    assert sum(word in note for note in recording.notes for word in ("checksum", "21 of", "3 frames are missing")) == 3


def test_samples_whose_device_time_does_not_increase_are_left_out(tmp_path: Path) -> None:
    ticks = [0, 1000, 2000, 1500, 2000, 3000]
    frames = [serial_frame(i, t, float(i)) for i, t in enumerate(ticks)]
    recording = opened(tmp_path, serial_capture(frames))
    assert recording.read("gyro").tolist() == [0.0, 1.0, 2.0, 5.0]
    assert any("stepped back 1 times" in note for note in recording.notes)
    assert any("gyro: 2 of 6 samples do not increase" in note for note in recording.notes)


def test_the_hosts_clock_is_fitted_below_its_delays(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    frames = serial_frames(400, first=0, ticks=0)
    host_ns = 5_000_000 + (np.arange(400) * 1_000_100 + rng.exponential(3e5, 400)).astype(np.int64)
    host_ns[[0, 399]] = 5_000_000 + np.array([0, 399]) * 1_000_100
    content = port_capture([(int(t), frame) for t, frame in zip(host_ns, frames, strict=True)])
    fit = opened(tmp_path, content).metadata["clock_fit"]
    assert fit["drift"] == pytest.approx(1e-4, abs=6 * fit["u_drift"])
    assert fit["u_drift"] < 3e-4
    assert fit["offset_s"] == pytest.approx(0.0, abs=1e-4)
    assert 1e-4 < fit["typical_delay_s"] < 4e-4
    assert (fit["steps"], fit["wrong_stamps"], fit["frames"]) == ([], 0, 400)
    assert opened(tmp_path, content).metadata["host_start"] is None


def test_without_a_device_clock_frames_are_dated_back_from_their_read(tmp_path: Path) -> None:
    content = serial_capture(serial_frames(12), per_read=3)
    recording = opened(tmp_path, content, device_time=None, baudrate=160000)
    expected = np.array([3e-3 * read - 1e-3 * behind for read in range(4) for behind in (2, 1, 0)])
    np.testing.assert_allclose(recording.time_base("gyro").times_s, expected, atol=1e-12)
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2023-11-14T22:13:20.003000", "UTC")


def read_in_bursts(sent: dict[int, bytes], *, stands_still: bool = False) -> bytes:
    """A capture of frames sent each millisecond, by their numbers, that an adapter hands over each 16 ms."""
    reads: dict[int, bytes] = {}
    for number, frame in sent.items():
        at_ms = 16 * (number // 16 + 1)
        if stands_still and 320 < at_ms <= 400:
            at_ms = 400
        reads[at_ms] = reads.get(at_ms, b"") + frame
    return port_capture([(1_000_000 * at_ms, data) for at_ms, data in reads.items()])


@pytest.mark.parametrize("stands_still", [False, True])
def test_frames_that_reads_deliver_in_bursts_are_dated_by_their_counter(tmp_path: Path, *, stands_still: bool) -> None:
    sent = {k: frame for k, frame in enumerate(serial_frames(960)) if k not in (100, 101, 333)}
    recording = opened(tmp_path, read_in_bursts(sent, stands_still=stands_still), device_time=None, baudrate=3e6)
    times_s = recording.time_base("gyro").times_s
    assert np.ptp(times_s - 1e-3 * np.array(list(sent))) < 1.5e-3
    assert any("samples are dated by the frames' counter instead" in note for note in recording.notes)
    assert not any(isinstance(note, Caution) for note in recording.notes)


def test_without_a_counter_reads_in_bursts_are_a_warning(tmp_path: Path) -> None:
    recording = opened(
        tmp_path, read_in_bursts(dict(enumerate(serial_frames(960)))), device_time=None, counter=None, baudrate=3e6
    )
    (note,) = (note for note in recording.notes if "bursts" in note)
    assert isinstance(note, Caution)
    assert note.code == CautionCode.LATE_STAMPS
    assert "declare the frames' `counter` in `framing`" in note


def read_by_a_host_that_stands_still(sent: dict[int, bytes], largest: int | None = None) -> bytes:
    """A capture of frames sent each millisecond, each read at once but for .3 s; a read holds so many at most."""
    reads: list[tuple[int, bytes]] = []
    for number, frame in sent.items():
        at_ms = 600 if 300 <= number < 600 else number
        if reads and reads[-1][0] == 1_000_000 * at_ms:
            reads[-1] = (reads[-1][0], reads[-1][1] + frame)
        else:
            reads.append((1_000_000 * at_ms, frame))
    cut = []
    for at_ns, data in reads:
        pieces = [data[i : i + (largest or len(data))] for i in range(0, len(data), largest or len(data))]
        cut += [(at_ns + 30_000 * k, piece) for k, piece in enumerate(pieces)]
    return port_capture(sorted(cut, key=lambda one: one[0]))


@pytest.mark.parametrize("largest", [None, 512])
def test_frames_that_a_host_read_late_are_dated_by_their_counter(tmp_path: Path, largest: int | None) -> None:
    sent = {k: frame for k, frame in enumerate(serial_frames(960)) if k not in (100, 101, 333)}
    content = read_by_a_host_that_stands_still(sent, largest)
    recording = opened(tmp_path, content, device_time=None, baudrate=921600)
    times_s = recording.time_base("gyro").times_s
    assert np.ptp(times_s - 1e-3 * np.array(list(sent))) < 5e-4
    assert any("samples are dated by the frames' counter instead" in note for note in recording.notes)
    assert not any(isinstance(note, Caution) for note in recording.notes)


@pytest.mark.parametrize("largest", [None, 512])
def test_without_a_counter_no_frame_is_lost_behind_a_stall_and_it_is_a_warning(
    tmp_path: Path, largest: int | None
) -> None:
    content = read_by_a_host_that_stands_still(dict(enumerate(serial_frames(960))), largest)
    recording = opened(tmp_path, content, device_time=None, counter=None, baudrate=921600)
    assert recording.read("gyro").size == 960
    (note,) = (note for note in recording.notes if isinstance(note, Caution))
    assert note.code == CautionCode.LATE_STAMPS
    assert "the host stood still once, for up to" in note
    assert "declare the frames' `counter` in `framing`" in note


def test_a_baud_rate_that_carries_less_than_was_read_dates_nothing_back(tmp_path: Path) -> None:
    frames = serial_frames(400)
    content = port_capture([(1_000_000 * k, frame) for k, frame in enumerate(frames)])
    recording = opened(tmp_path, content, device_time=None, baudrate=9600)
    assert recording.read("gyro").size == 400
    assert np.ptp(recording.time_base("gyro").times_s - 1e-3 * np.arange(400)) < 1.1e-3
    (note,) = (note for note in recording.notes if isinstance(note, Caution))
    assert "more than a line of the declared 9600 baud carries" in note


@pytest.mark.parametrize(
    ("counts", "told"),
    [(lambda k: 2 * k, "by 2 from frame to frame"), (lambda k: k % 100, "from 0 to 99, by 1 from frame to frame")],
)
def test_a_counter_that_counts_otherwise_than_declared_dates_nothing(
    tmp_path: Path, counts: Callable[[int], int], told: str
) -> None:
    content = b"".join(serial_frame(counts(k), 1000 * k, 0.01 * k) for k in range(500))
    with pytest.raises(ReadError, match="counts otherwise than declared, and frames are dated by it") as caught:
        opened(tmp_path, content, device_time=None, rate_hz=1000.0)
    assert told in str(caught.value)
    by_clock = opened(tmp_path, content)
    assert np.allclose(by_clock.time_base("gyro").times_s, 1e-3 * np.arange(500), rtol=0, atol=1e-9)
    (note,) = (note for note in by_clock.notes if isinstance(note, Caution))
    assert (note.code, told in note) == (CautionCode.OTHER_COUNT, True)


def test_a_counter_that_began_anew_dates_nothing_by_a_rate(tmp_path: Path) -> None:
    content = b"".join(serial_frames(200) + serial_frames(200))
    with pytest.raises(ReadError, match="frame 201: the packet counter goes back, and frames are dated by it"):
        opened(tmp_path, content, device_time=None, rate_hz=1000.0)
    frames = serial_frames(100)
    frames[40] = serial_frame(5000, 0, 0.0)
    recording = opened(tmp_path, b"".join(frames), device_time=None, rate_hz=1000.0)
    assert recording.read("gyro").size >= 99


def test_reads_whose_host_times_go_back_are_refused(tmp_path: Path) -> None:
    reads = [(1_000_000 * (k if k < 50 else k - 20), frame) for k, frame in enumerate(serial_frames(100))]
    with pytest.raises(CorruptFileError, match=r"read 51: the host's times of the reads go back.*-0.019 s"):
        opened(tmp_path, port_capture(reads), device_time=None, baudrate=921600)


def test_a_host_clock_without_a_date_gives_no_absolute_start(tmp_path: Path) -> None:
    content = serial_capture(serial_frames(12), host_ns=0)
    assert opened(tmp_path, content, device_time=None, baudrate=115200).absolute_start is None


def test_a_declared_rate_dates_frames_by_their_counter(tmp_path: Path) -> None:
    frames = serial_frames(20)
    stream = b"".join(frames[:5] + frames[8:])
    recording = opened(tmp_path, stream, device_time=None, rate_hz=500.0)
    np.testing.assert_allclose(recording.time_base("gyro").times_s, np.r_[0:5, 8:20] / 500.0)
    recording = opened(tmp_path, stream, device_time=None, counter=None, rate_hz=500.0)
    np.testing.assert_allclose(recording.time_base("gyro").times_s, np.arange(17) / 500.0)
    assert any("cannot be seen" in note for note in recording.notes)


def test_a_plain_file_of_bytes_is_opened_but_not_claimed(tmp_path: Path) -> None:
    stream = b"".join(serial_frames(20))
    assert surest_claim(Head(stream))[0] is Claim.NO
    recording = opened(tmp_path, stream)
    assert recording.signals[2].sample_count == 20
    assert "clock_fit" not in recording.metadata


def test_what_nothing_dates_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="nothing dates the frames") as caught:
        opened(tmp_path, serial_capture(serial_frames(5)), device_time=None)
    assert "baudrate" in str(caught.value.remedy)


def test_a_missing_or_faulty_framing_and_no_frames_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="without its framing"):
        READER.open(tmp_path / "a.bin", Declarations("imu"))
    with pytest.raises(ReadError, match=r"framing is faulty: .*framing.max"):
        opened(tmp_path, b"", max=-1)
    with pytest.raises(CorruptFileError, match="not one frame"):
        opened(tmp_path, b"")


def test_fields_of_frames_without_device_time_are_no_signals(tmp_path: Path) -> None:
    fields = FRAMING["fields"]
    frames = [
        {"when": {"at": 2, "equals": 0}, "fields": fields},
        {"fields": [{"name": "other", "at": 8, "type": "f32"}]},
    ]
    stream = b"".join(serial_frame(256 * i + (i % 2), 1000 * i, 1.0) for i in range(6))
    recording = opened(tmp_path, stream, fields=None, frames=frames)
    assert "other" not in [s.name for s in recording.signals]
    assert any("other: no frame that holds it has an instant" in note for note in recording.notes)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    reads=st.lists(st.tuples(st.integers(-(2**63), 2**63 - 1), st.binary(min_size=1, max_size=20)), max_size=8),
    cut=st.integers(0, 300),
)
def test_a_capture_gives_back_its_reads_up_to_any_cut(tmp_path: Path, reads: list[tuple[int, bytes]], cut: int) -> None:
    def stream_of(content: bytes) -> PortStream:
        path.write_bytes(content)
        (source,) = sources_of(read_capture(path))
        return PortStream.of_reads(_reads(source), incomplete=source.incomplete)

    path = tmp_path / "a.rdlog"
    content = port_capture(reads)
    capture = stream_of(content)
    assert capture.stream == b"".join(data for _, data in reads)
    assert capture.host_ns.tolist() == [t for t, _ in reads]
    assert (capture.incomplete, capture.breaks) == ("", ())
    left = stream_of(content[: len(port_capture([])) + cut])
    assert capture.stream.startswith(left.stream)
    assert left.host_ns.tolist() == capture.host_ns.tolist()[: left.host_ns.size]


@pytest.mark.parametrize("how", ["lost", "reopened", "a record is missing"])
def test_nothing_is_joined_over_where_the_port_was_interrupted(tmp_path: Path, how: str) -> None:
    framing = {
        "kind": "delimiter",
        "separator": ",",
        "baudrate": 115200,
        "fields": [{"name": "a", "at": 0}, {"name": "b", "at": 1}],
    }
    session = {"sources": [{"name": "imu", "kind": "serial"}]}
    reads = [(0, rdlog_bytes.SERIAL, 10**6, b"1,10\n2,2"), (0, rdlog_bytes.SERIAL, 3 * 10**6, b"0,40\n5,50\n")]
    if how == "a record is missing":
        content = rdlog_bytes.rdlog(session, [reads[0], (0, rdlog_bytes.SERIAL, 2 * 10**6, b"0\n3,3"), reads[1]])
        gone = rdlog_bytes.record(2, 0, rdlog_bytes.SERIAL, 2 * 10**6, b"0\n3,3", 1, 8)
        assert content.count(gone) == 1
        content = content.replace(gone, b"")
    else:
        between = (0, rdlog_bytes.EVENT, 2 * 10**6, rdlog_bytes.event(how, "pulled"))
        content = rdlog_bytes.rdlog(session, [reads[0], between, reads[1]])
    path = tmp_path / "a.rdlog"
    path.write_bytes(content)
    recording = READER.open(path, Declarations("imu", framing=framing))
    # a joined line would be (2, 20); (0, 40) is the end of a line of which the beginning is gone
    assert recording.read("a").tolist() in ([1.0, 5.0], [1.0, 0.0, 5.0])
    assert 20.0 not in recording.read("b").tolist()
    assert bool(recording.incomplete) == (how == "a record is missing")


def test_bytes_of_a_cut_record_have_no_host_time() -> None:
    times_s = back_dated(np.array([10, 20]) * 10**9, np.array([5, 9]), np.array([5, 7, 12]), 1.0)
    np.testing.assert_array_equal(times_s, [0.0, 8.0, np.nan])


def test_a_single_frame_has_no_clock_to_compare() -> None:
    device_s = np.array([1.0, 2.0])
    instants, fit = without_steps(device_s, np.array([0.0, np.nan]), 0, None)
    assert fit is None
    np.testing.assert_array_equal(instants, device_s)


def ported(ticks_us: np.ndarray, counts: np.ndarray, *, latency_s: float = 0.016, cut: int = 0) -> bytes:
    """Keep frames of a device at 1 kHz as a port delivers them that is read every so often."""
    frames = [serial_frame(int(c), int(t), float(c)) for c, t in zip(counts, ticks_us, strict=True)]
    sent_s = np.asarray(counts) * 1e-3 + 2e-4
    rng = np.random.default_rng(4)
    ends_s = np.cumsum(latency_s * rng.uniform(0.95, 1.05, round(sent_s[-1] / latency_s) + 2))
    reads = np.searchsorted(ends_s, sent_s)
    content = port_capture(
        [
            (10**18 + round(ends_s[r] * 1e9), b"".join(frames[i] for i in np.flatnonzero(reads == r)))
            for r in np.unique(reads)
        ]
    )
    return content[: len(content) - cut]


@pytest.mark.exhaustive
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    # near an end only the counter and a few reads tell, so that a step is seen there if it is longer than two reads
    where=st.one_of(
        st.tuples(st.integers(200, 1290), st.integers(4000, 40_000)),
        st.tuples(st.integers(6, 1490), st.integers(40_000, 30_000_000)),
    ),
    forward=st.booleans(),
    lost=st.sets(st.integers(1, 1498), max_size=30),
)
def test_a_step_of_the_device_clock_is_taken_out_and_costs_no_sample(
    tmp_path: Path, where: tuple[int, int], forward: bool, lost: set[int]
) -> None:
    at, step_us = where[0], where[1] if forward else -where[1]
    counts = np.array([i for i in range(1500) if i not in lost])
    at = int(counts[at]) if at < counts.size - 6 else int(counts[-6])
    recording = opened(tmp_path, ported(5_000_000 + 1000 * counts + np.where(counts >= at, step_us, 0), counts))
    (step,) = recording.metadata["clock_fit"]["steps"]
    assert step["step_s"] == pytest.approx(step_us / 1e6, abs=1e-6)
    assert recording.metadata["missing_frames"] == len(lost)
    np.testing.assert_array_equal(recording.read("gyro"), counts)
    np.testing.assert_allclose(recording.time_base("gyro").times_s, counts / 1e3, atol=1e-6)
    (note,) = [note for note in recording.notes if "stepped by" in note]
    assert note.startswith(f"the device's clock stepped by {step_us / 1e6:+.6f} s (u ")
    assert note.endswith("s: taken out")


@pytest.mark.parametrize("step_us", [-700_000, -40_000, 60_000, 9_000_000])
def test_a_step_is_found_without_a_packet_counter_too(tmp_path: Path, step_us: int) -> None:
    counts = np.arange(1500)
    ticks = 5_000_000 + 1000 * counts + np.where(counts >= 600, step_us, 0)
    recording = opened(tmp_path, ported(ticks, counts), counter=None)
    (step,) = recording.metadata["clock_fit"]["steps"]
    assert abs(step["step_s"] - step_us / 1e6) < max(6 * step["u_step_s"], 1e-3)
    assert step["index"] == 600
    np.testing.assert_array_equal(recording.read("gyro"), counts)


def test_frames_of_a_cut_record_are_on_the_side_of_the_last_step(tmp_path: Path) -> None:
    counts = np.arange(1500)
    content = ported(5_000_000 + 1000 * counts - np.where(counts >= 800, 250_000, 0), counts, latency_s=0.1, cut=5)
    recording = opened(tmp_path, content)
    assert recording.incomplete
    kept = recording.signals[2].sample_count
    assert 1400 <= kept < 1500
    np.testing.assert_allclose(recording.time_base("gyro").times_s, np.arange(kept) / 1e3, atol=1e-6)


def test_wrong_stamps_of_a_device_are_told_and_cost_no_sample(tmp_path: Path) -> None:
    counts = np.arange(1500)
    ticks = 5_000_000 + 1000 * counts
    ticks[[300, 301, 900]] += [41_900, -500_000, 2_000_000]
    recording = opened(tmp_path, ported(ticks, counts))
    assert recording.metadata["clock_fit"]["wrong_stamps"] == 3
    np.testing.assert_array_equal(recording.read("gyro"), counts)
    np.testing.assert_allclose(recording.time_base("gyro").times_s, counts / 1e3, atol=1e-3)
    assert any("3 stamps of the device do not fit its clock" in note for note in recording.notes)


def test_a_sound_clock_is_given_exactly_as_it_was_stamped(tmp_path: Path) -> None:
    counts = np.arange(1500)
    recording = opened(tmp_path, ported(5_000_000 + 1000 * counts, counts))
    np.testing.assert_array_equal(recording.time_base("gyro").times_s, 1000 * counts * 1e-6)


def test_without_host_times_a_jump_is_told_and_left_in(tmp_path: Path) -> None:
    counts = np.arange(400)
    ticks = 5_000_000 + 1000 * counts + np.where(counts >= 150, 500_000, 0)
    frames = [serial_frame(int(c), int(t), float(c)) for c, t in zip(counts, ticks, strict=True)]
    recording = opened(tmp_path, b"".join(frames))
    (note,) = [note for note in recording.notes if "jumps" in note]
    assert note.startswith("the device's clock jumps at 1 places as the packet counter does not, first by +0.501000 s")
    assert recording.time_base("gyro").times_s[-1] == pytest.approx(0.899)
    lost = opened(tmp_path, b"".join(serial_frame(i, 1000 * i, 0.0) for i in range(400) if not 100 < i < 300))
    assert not [note for note in lost.notes if "jumps" in note]


def test_what_a_capture_begins_and_ends_with_is_told_from_what_lies_between(tmp_path: Path) -> None:
    frames = serial_frames(20)
    recording = opened(tmp_path, frames[0][5:] + b"".join(frames[1:10]) + b"noise" + b"".join(frames[10:]) + b"\xaa")
    assert recording.metadata["skipped_bytes"] == 11 + 5 + 1
    assert recording.metadata["skipped_at_ends"] == 11 + 1


def test_the_longest_gap_is_told_in_frames_and_seconds(tmp_path: Path) -> None:
    frames = [serial_frame(i, 1000 * i, 0.0) for i in range(100) if i not in (10, 40, 41, 42)]
    metadata = opened(tmp_path, b"".join(frames)).metadata
    assert (metadata["counter_gaps"], metadata["missing_frames"], metadata["counted_frames"]) == (2, 4, 96)
    assert (metadata["longest_gap_frames"], metadata["unsized_gaps"]) == (3, 0)
    assert metadata["longest_gap_s"] == pytest.approx(4e-3)


def test_only_later_instants_increase() -> None:
    assert increasing(np.array([np.nan, 1.0, 1.0, 3.0, 2.0, np.nan, 4.0])).tolist() == [
        False,
        True,
        False,
        True,
        False,
        False,
        True,
    ]


def test_a_ready_made_framing_is_enough_for_real_xbus_captures_which_lose_only_the_samples_of_clock_steps() -> None:
    recording = READER.open(shared_file("serial/output1.bin"), Declarations("imu", framing={"ready_made": "xsens-mti"}))
    assert recording.metadata["received"] == 100
    assert recording.metadata["counter_gaps"] == 0
    kept = recording.signals[0].sample_count
    assert 80 < kept < 100
    assert any(f"{100 - kept} of 100 samples" in note for note in recording.notes)
    counted = {"ready_made": "xsens-mti", "without": ["device_time"], "rate_hz": 100.0}
    recording = READER.open(shared_file("serial/output1.bin"), Declarations("imu", framing=counted))
    assert recording.signals[0].sample_count == 100
    np.testing.assert_allclose(recording.time_base("packet_counter").times_s, np.arange(100) / 100.0)


@pytest.mark.parametrize(("name", "precision"), [("output1", "f32"), ("output2", "fp12.20"), ("output3", "fp16.32")])
def test_a_wrong_precision_of_an_xsens_is_told_with_the_files_own(name: str, precision: str) -> None:
    path = shared_file(f"serial/{name}.bin")
    for declared in ("f32", "fp12.20", "fp16.32", "f64"):
        framing = {"ready_made": "xsens-mti", "precision": declared}
        recording = READER.open(path, Declarations("imu", framing=framing))
        told = f'the file\'s are those of `precision = "{precision}"`'
        if declared == precision:
            assert recording.read("acceleration_x").size > 80
            continue
        with pytest.raises(ReadError, match=r"'acceleration_x' is not in the file") as caught:
            recording.read("acceleration_x")
        assert told in str(caught.value)
        (note,) = (one for one in recording.notes if one.startswith("acceleration_x, acceleration_y, acceleration_z:"))
        assert told in note


def xbus(*elements: tuple[int, bytes]) -> bytes:
    body = b"".join(struct.pack(">HB", identifier, len(data)) + data for identifier, data in elements)
    content = bytes([0xFF, 0x36, len(body)]) + body
    return b"\xfa" + content + bytes([-sum(content) & 0xFF])


def test_elements_that_no_frame_holds_are_told_with_those_that_are_there(tmp_path: Path) -> None:
    frames = [
        xbus((0x1020, i.to_bytes(2)), (0x1060, (100 * i).to_bytes(4)), (0x4023, struct.pack(">3d", i, 0, 0)))
        for i in range(9)
    ]
    path = tmp_path / "a.bin"
    path.write_bytes(b"".join(frames))
    recording = READER.open(path, Declarations("imu", framing={"ready_made": "xsens-mti"}))
    assert any('the file\'s are those of `precision = "f64"`' in note for note in recording.notes)
    assert "status_word: no frame holds element 0xe020, but 0x1020, 0x1060, 0x4023: not a signal" in recording.notes
    with pytest.raises(ReadError, match=r"'status_word' is not in the file.*no frame holds element 0xe020"):
        recording.read("status_word")
    with pytest.raises(MissingChannelError, match="status_wort"):
        recording.read("status_wort")
    recording = READER.open(path, Declarations("imu", framing={"ready_made": "xsens-mti", "precision": "f64"}))
    assert recording.read("acceleration_x").tolist() == list(range(9))


def test_of_many_elements_that_a_device_sends_the_first_twelve_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    others = [(0x0100 + i, b"x") for i in range(15)]
    path.write_bytes(b"".join(xbus((0x1060, (100 * i).to_bytes(4)), *others) for i in range(9)))
    notes = READER.open(path, Declarations("imu", framing={"ready_made": "xsens-mti", "without": ["counter"]})).notes
    (told,) = (note for note in notes if note.startswith("status_word"))
    twelve = ", ".join(f"0x{0x100 + i:04x}" for i in range(12))
    assert told == f"status_word: no frame holds element 0xe020, but {twelve}: not a signal"


def keller_reply(pressure_bar: float) -> bytes:
    return summed(b"\x01\x49" + struct.pack(">fB", pressure_bar, 0), "crc16-modbus", "big")


def test_polled_replies_are_dated_back_from_their_reads_and_half_ones_time_out(tmp_path: Path) -> None:
    path = tmp_path / "keller.bin"
    replies = [keller_reply(20.0 + i) for i in range(5)]
    reads = [(0.02 * i, reply) for i, reply in enumerate(replies)]
    path.write_bytes(stamped_capture([*reads[:3], (0.06, replies[3][:6]), (0.6, replies[4])]))
    recording = READER.open(path, Declarations("brake", framing={"ready_made": "keller"}))
    assert recording.read("pressure_1").tolist() == [20.0, 21.0, 22.0, 24.0]
    np.testing.assert_allclose(recording.time_base("pressure_1").times_s, [0.0, 0.02, 0.04, 0.6])
    assert recording.metadata["timed_out"] == 1
    assert "1 silences ended a half frame" in recording.notes
    assert any(note == "error: no frame holds it: not a signal" for note in recording.notes)


MODBUS = {
    "kind": "idle",
    "baudrate": 19200,
    "checksum": {"algo": "crc16-modbus"},
    "fields": [{"name": "p", "at": 3, "type": "u16", "endian": "big", "unit": "mbar"}],
}


def test_frames_between_silences_need_host_times(tmp_path: Path) -> None:
    path = tmp_path / "modbus.bin"
    frames = [summed(b"\x01\x03\x02" + struct.pack(">H", 1000 + i), "crc16-modbus") for i in range(4)]
    reads = [
        (0.1 * i + 1e-3 * half, frame[half * 3 : half * 3 + 3 + half])
        for i, frame in enumerate(frames)
        for half in (0, 1)
    ]
    path.write_bytes(stamped_capture(reads))
    recording = READER.open(path, Declarations("brake", framing=MODBUS))
    assert recording.read("p").tolist() == [1000.0, 1001.0, 1002.0, 1003.0]
    assert recording.metadata["skipped_bytes"] == 0
    path.write_bytes(b"".join(frames))
    with pytest.raises(ReadError, match="without host times") as caught:
        READER.open(path, Declarations("brake", framing=MODBUS))
    assert "capture" in str(caught.value.remedy)


def test_a_counter_may_count_in_steps(tmp_path: Path) -> None:
    frames = [serial_frame(10 * i, 1000 * i, float(i)) for i in (0, 1, 2, 5, 6)]
    recording = opened(
        tmp_path,
        b"".join(frames),
        counter={"field": "counter", "modulo": 65536, "step": 10},
        device_time=None,
        rate_hz=100.0,
    )
    assert (recording.metadata["counter_gaps"], recording.metadata["missing_frames"]) == (1, 2)
    np.testing.assert_allclose(recording.time_base("gyro").times_s, [0.0, 0.01, 0.02, 0.05, 0.06])


def test_implausible_frames_are_counted_and_noted(tmp_path: Path) -> None:
    fields = [
        {**field, **({"plausible": [-1.0, 1.0]} if field["name"] == "gyro" else {})} for field in FRAMING["fields"]
    ]
    frames = [serial_frame(i, 1000 * i, 50.0 if i == 7 else 0.5) for i in range(20)]
    recording = opened(tmp_path, b"".join(frames), fields=fields)
    assert (recording.metadata["implausible"], recording.metadata["missing_frames"]) == (1, 1)
    assert any("a value beyond what is declared plausible" in note for note in recording.notes)
