"""Stamps in bursts are told from jitter, lost samples and pauses; a counter dates such frames."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.can.log import CANDUMP
from recoil_acquisition.readers.can.recording import CanRecording
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.time.bursts import find_bursts
from recoil_acquisition.remark import Caution, CautionCode

RNG = np.random.default_rng(5)
EVEN = np.arange(1260) * 1e-3
DBC = """VERSION ""
BO_ 256 IMU: 8 X
 SG_ Accel : 0|16@1- (0.01,0) [0|0] "g" X
 SG_ counter : 16|8@1+ (1,0) [0|0] "" X
"""


def packed(sent_s: np.ndarray, per_packet_s: float = 16e-3, apart_s: float = 0.126e-3) -> np.ndarray:
    """Stamps of a host that reads packets: frames of one are stamped one behind the other, when it is read."""
    packet = np.ceil(sent_s / per_packet_s + 1e-9)
    first = np.r_[True, np.diff(packet) > 0]
    place = np.arange(sent_s.size) - np.maximum.accumulate(np.where(first, np.arange(sent_s.size), 0))
    return packet * per_packet_s + apart_s * place


def test_packets_of_a_host_are_bursts() -> None:
    found = find_bursts(packed(EVEN))
    assert found is not None
    assert found.stamps == 16
    assert found.within_s == pytest.approx(15 * 0.126e-3)
    assert found.pause_s == pytest.approx(16e-3 - 15 * 0.126e-3)
    assert "stamps come in bursts, 16 within 1.89 ms and then none for 14.1 ms" in str(found)


@pytest.mark.parametrize(
    "times_s",
    [
        EVEN,
        np.sort(EVEN + RNG.exponential(2e-4, EVEN.size)),
        EVEN + 0.4e-3 * RNG.uniform(-1, 1, EVEN.size),
        EVEN[RNG.random(EVEN.size) > 0.3],
        np.delete(EVEN, np.r_[100:400, 700:702, 900:1100]),
        np.sort(RNG.uniform(0, 1.26, 1260)),
        np.sort(np.r_[EVEN, EVEN + 1e-4]),
        EVEN[:20],
        np.r_[0:40, 5000:5040, 90000:90040] * 1e-3,
    ],
    ids=["even", "waits", "jitter", "lost", "gaps", "at random", "pairs", "few", "switched on now and then"],
)
def test_other_stamps_are_none(times_s: np.ndarray) -> None:
    assert find_bursts(times_s) is None


def log(
    tmp_path: Path,
    counts: np.ndarray,
    counters: tuple[str, ...],
    sent_s: np.ndarray,
    stalls_s: tuple[tuple[float, float], ...] = (),
) -> CanRecording:
    stamps_s = packed(sent_s)
    for start_s, stop_s in stalls_s:
        late = (stamps_s >= start_s) & (stamps_s < stop_s)
        stamps_s[late] = stop_s + 2e-6 * np.arange(late.sum())
    lines = [
        f"({1_700_000_000 + at_s:.6f}) can0 100#{struct.pack('<hB5x', k, int(count) % 256).hex()}"
        for k, (at_s, count) in enumerate(zip(stamps_s.tolist(), counts.tolist(), strict=True))
    ]
    path = tmp_path / "a.log"
    path.write_text("\n".join(lines) + "\n")
    return CANDUMP.open(path, Declarations("can", database=DBC, counters=counters))


def test_frames_stamped_in_bursts_are_dated_by_their_counter(tmp_path: Path) -> None:
    kept = RNG.random(EVEN.size) > 0.02
    sent_s = 1.0003 * EVEN[kept]
    recording = log(tmp_path, np.arange(EVEN.size)[kept], ("IMU.counter",), sent_s)
    times_s = recording.time_base("IMU.Accel").times_s
    late_s = times_s - sent_s
    assert np.ptp(late_s) < 1.5e-3
    assert np.ptp(packed(sent_s) - sent_s) > 12e-3
    assert recording.time_base("IMU.Accel").rate_hz == pytest.approx(1000.0, rel=2e-3)
    assert any("samples are dated by IMU.counter instead" in note for note in recording.notes)
    assert not any(isinstance(note, Caution) for note in recording.notes)


def test_a_host_that_stands_still_now_and_then_hides_no_beat(tmp_path: Path) -> None:
    stalls_s = ((0.2001, 0.2799), (0.5101, 0.7299), (1.0101, 1.0599))
    times_s = log(tmp_path, np.arange(EVEN.size), ("IMU.counter",), EVEN, stalls_s).time_base("IMU.Accel").times_s
    assert np.ptp(times_s - EVEN) < 1.5e-3


def test_without_a_counter_bursts_are_a_warning_and_stamps_stay(tmp_path: Path) -> None:
    recording = log(tmp_path, np.arange(EVEN.size), (), EVEN)
    stamps_s = packed(EVEN)
    assert recording.time_base("IMU.Accel").times_s == pytest.approx(stamps_s - stamps_s[0], abs=2e-6)
    (note,) = (note for note in recording.notes if "bursts" in note)
    assert isinstance(note, Caution)
    assert (note.code, note.about) == (CautionCode.LATE_STAMPS, "IMU")
    assert "IMU: stamps come in bursts" in note
    assert "declare a signal that counts them in `counters`" in note
    stuck = log(tmp_path, np.zeros(EVEN.size), ("IMU.counter",), EVEN)
    assert any("bursts" in note and "IMU.counter does not count" in note for note in stuck.notes)
