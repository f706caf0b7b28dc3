"""Frames per second of the readers and the decoder of CAN logs, beside python-can's and asammdf's own.

Every figure is of processor time, and both sides of a comparison are measured in the same run.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pytest

from recoil_acquisition.readers.can.asc import read_asc
from recoil_acquisition.readers.can.blf_objects import read_blf
from recoil_acquisition.readers.can.candump import read_candump
from recoil_acquisition.readers.can.decoding import SignalLayout, bit_runs_of, layout_of
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.can.mdf import read_mdf
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.can.recording import CanRecording
from recoil_acquisition.readers.reader import Declarations
from tests.builders.beside import Beside, fastest_s, in_turns
from tests.builders.mdf_logs import bus_log

FRAMES = 100_000
DECODED = 1_000_000

DBC = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: RIG\n\n' + "".join(
    f"BO_ {256 + m} M{m}: 8 RIG\n"
    + "".join(f' SG_ s{k} : {16 * k}|16@1- (0.01,0) [0|0] "m/s^2" RIG\n' for k in range(4))
    + "\n"
    for m in range(2)
)


def written(folder: Path, suffix: str, frames: int) -> Path:
    path = folder / f"log.{suffix}"
    data = np.random.default_rng(4).bytes(8 * frames)
    with can.Logger(path) as writer:
        for i in range(frames):
            writer.on_message_received(
                can.Message(
                    timestamp=1.7e9 + 1e-4 * i,
                    arbitration_id=0x100 + i % 5,
                    is_extended_id=i % 5 == 0,
                    data=data[8 * i : 8 * i + 8],
                    channel=i % 2,
                )
            )
    return path


READ: dict[str, tuple[Callable[[Path], CanLog], float]] = {
    "asc": (lambda path: read_asc(path.read_bytes()), 3.0),
    "log": (lambda path: read_candump(path.read_bytes()), 3.0),
    "blf": (lambda path: read_blf(path, path.read_bytes()), 1.3),
}


def read_beside_python_can(folder: Path, suffix: str, frames: int, *, rounds: int = 5) -> Beside:
    """Time the reading of a log, after checking that both count the same frames."""
    path = written(folder, suffix, frames)
    read, _ = READ[suffix]

    def pythons() -> int:
        with can.LogReader(path) as log:
            return sum(1 for _ in log)

    assert pythons() == read(path).frames.key.size == frames
    return in_turns(lambda: read(path), pythons, rounds)


def decoded_beside_cantools(frames: int, *, rounds: int = 5) -> Beside:
    """Time the decoding of 8 signals of 2 messages, after checking that both find the same; frames are at hand."""
    data = np.random.default_rng(4).integers(0, 256, (frames, 8), dtype=np.uint8)
    messages = cantools.database.load_string(DBC, "dbc").messages
    layouts = [[layout_of(signal) for signal in message.signals] for message in messages]
    each = [row.tobytes() for row in data]

    def ours() -> list[np.ndarray[Any, Any]]:
        return [one.decode(data[m::2]) for m in range(2) for one in layouts[m] if one is not None]

    def theirs() -> list[dict[str, Any]]:
        return [messages[i % 2].decode(frame, decode_choices=False) for i, frame in enumerate(each)]  # type: ignore[misc]

    np.testing.assert_allclose(ours()[0], [frame["s0"] for frame in theirs()[::2]], rtol=1e-12)
    return in_turns(ours, theirs, rounds)


def extracted_beside_asammdf(folder: Path, frames: int, *, rounds: int = 5) -> tuple[Beside, float]:
    """Time the decoding of a bus log in MDF, after checking that both find the same; return that, and opening too."""
    from asammdf import MDF

    data = np.random.default_rng(4).bytes(8 * frames)
    path = folder / "bus.mf4"
    path.write_bytes(bus_log([(i * 100_000, 0x100 + i % 2, data[8 * i : 8 * i + 8]) for i in range(frames)]))
    dbc = folder / "bus.dbc"
    dbc.write_text(DBC)
    database = load_database(DBC, path)
    log = read_mdf(path)

    def ours(log: CanLog) -> list[np.ndarray[Any, Any]]:
        recording = CanRecording(path, "", log, database, Declarations("can", database=DBC))
        return [recording.read(header.name) for header in recording.signals]

    with MDF(path) as file:

        def theirs() -> Any:
            return file.extract_bus_logging({"CAN": [(str(dbc), 0)]})

        extracted = theirs()  # warm
        np.testing.assert_allclose(extracted.get("s1", group=0).samples, ours(log)[1], rtol=1e-12)
        took = in_turns(lambda: ours(log), theirs, rounds)
    return took, fastest_s(lambda: ours(read_mdf(path)), max(rounds // 2, 1))


@pytest.mark.parametrize("suffix", READ)
def test_logs_are_read_faster_than_by_python_can(suffix: str, tmp_path: Path, capsys: Any) -> None:
    took = read_beside_python_can(tmp_path, suffix, FRAMES)
    with capsys.disabled():
        print(
            f"\n{suffix}: {FRAMES / took.ours_s / 1e3:.0f} thousand frames/s, "
            f"python-can {FRAMES / took.theirs_s / 1e3:.0f}, {took.times:.1f} times"
        )
    assert took.times >= READ[suffix][1]


@pytest.mark.parametrize(("order", "target_m"), [("little", 10.0), ("big", 5.0)])
def test_four_signals_of_each_frame_are_decoded(order: str, target_m: float, capsys: Any) -> None:
    data = np.random.default_rng(4).integers(0, 256, (DECODED, 8), dtype=np.uint8)
    little = order == "little"
    layouts = [
        SignalLayout(
            f"s{k}",
            "",
            bit_runs_of(16 * k + (0 if little else 7), 16, little_endian=little),
            16,
            "signed",
            0.01,
            1.0,
            "",
            (),
        )
        for k in range(4)
    ]
    took_s = fastest_s(lambda: [layout.decode(data) for layout in layouts])
    with capsys.disabled():
        print(f"\n{order} endian, 4 signals: {DECODED / took_s / 1e6:.1f} million frames/s")
    assert target_m * 1e6 * took_s <= DECODED


def test_decoding_is_faster_than_cantools(capsys: Any) -> None:
    took = decoded_beside_cantools(FRAMES)
    with capsys.disabled():
        print(
            f"\n8 signals of 2 messages: {FRAMES / took.ours_s / 1e6:.1f} million frames/s, "
            f"{took.times:.0f} times cantools"
        )
    assert took.times >= 20


def test_decoding_is_faster_than_asammdfs_extraction(tmp_path: Path, capsys: Any) -> None:
    took, whole_s = extracted_beside_asammdf(tmp_path, FRAMES)
    with capsys.disabled():
        print(
            f"\nMDF bus logging, 8 signals of 2 messages: {FRAMES / took.ours_s / 1e6:.1f} million frames/s decoded, "
            f"{FRAMES / whole_s / 1e6:.2f} with opening; asammdf extracts {FRAMES / took.theirs_s / 1e6:.2f}: "
            f"{took.times:.1f} times"
        )
    assert took.times >= 5
