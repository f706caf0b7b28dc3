"""A journal that was left over becomes captures: its shots, and everything beside them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from daq.acquisition import read_acquisition
from daq.capture.session_record import (
    CLOSED,
    DECISION,
    KINDS,
    OPERATOR,
    SHOT,
    CompleteShot,
    LiveRecord,
    RecordedSource,
    pack_decision,
    pack_shot,
)
from daq.devices.device import SERIAL, Block, event_block
from daq.errors import ReadError, StoreError
from daq.frames import capture_file
from daq.journal import JournalWriter
from daq.trigger import Decision
from recoil_daq.live_tables import print_recovered
from recoil_daq.recover import recover_folder, recover_journal
from rigs.rig import load_rig
from tests.builders.live_sources import ANCHOR

RIG = load_rig("mixed")
RECORD = LiveRecord(
    RIG.name, RIG.text, str(RIG.path), dict(RIG.databases), ANCHOR,
    (RecordedSource("can", "can"), RecordedSource("imu", "serial")),
)  # fmt: skip
NAME = "20260504T101112.000000Z"


def imu(time_s: float) -> Block:
    return Block("imu", round(time_s * 1e9), f"{time_s:8.2f}".encode(), SERIAL)


def leave_journal(
    out: Path, *, triggers_s: tuple[float, ...] = (), known: tuple[CompleteShot, ...] = (), closed: bool = False
) -> Path:
    """The inertial sensor sends its time every 10 ms from 10 s to 15 s; the bus is silent."""
    folder = out / "journal" / NAME
    with JournalWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 16) as writer:
        for block in [event_block("imu", int(10e9), "opened", "x"), *(imu(10.0 + 0.01 * k) for k in range(500))]:
            writer.append(RECORD.number("imu"), KINDS.index(block.kind), block.host_ns, block.payload)
        for time_s in triggers_s:
            decision = Decision(time_s, "trigger", "", "p_brake", 0, 1, 2e6, time_s)
            writer.append(OPERATOR, DECISION, round(time_s * 1e9), pack_decision(decision))
        for shot in known:
            writer.append(OPERATOR, SHOT, round(shot.trigger_s * 1e9), pack_shot(shot))
        if closed:
            writer.append(OPERATOR, CLOSED, int(16e9), b"{}")
    return folder


def times_in(path: Path) -> list[float]:
    stream = capture_file.parse_capture(path.read_bytes()).stream
    return [float(stream[at : at + 8]) for at in range(0, len(stream), 8)]


def test_every_byte_comes_back_once_and_the_journal_goes(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path)
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.shots == ()
    assert done.everything == tmp_path / "recovered" / NAME
    assert times_in(done.everything / f"{NAME}_imu.rdsc") == pytest.approx([10.0 + 0.01 * k for k in range(500)])
    document = json.loads((done.everything / f"{NAME}.json").read_text())
    assert document["session"]["rig_text"] == RIG.text
    assert [event["name"] for event in document["events"]["imu"]] == ["opened"]
    assert not journal.exists()
    assert recover_folder(tmp_path, None) == ([], [])


def test_a_shot_under_way_is_cut_from_its_recorded_trigger(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0, 14.8))
    ((done,), _) = recover_folder(tmp_path, None)
    first, second = done.shots
    assert [first.name, second.name] == ["0001", "0002"]
    assert first.missing == ("dewetron", "camera")
    assert first.shot_file is None
    times = times_in(first.folder / "0001_imu.rdsc")
    assert times[0] == pytest.approx(11.7)
    assert times[-1] == pytest.approx(12.94, abs=0.011)
    acquisition = read_acquisition(second.folder / "0002_acquisition.json")
    assert acquisition.recovered
    assert [source.name for source in acquisition.sources if source.late] == ["can", "imu"]
    assert times_in(second.folder / "0002_imu.rdsc")[-1] == pytest.approx(14.99)


def test_a_shot_keeps_the_name_that_the_session_gave_it(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), known=(CompleteShot("0042", 12.0),))
    ((done,), _) = recover_folder(tmp_path, None)
    assert [shot.name for shot in done.shots] == ["0042"]


def test_a_shot_whose_shot_file_is_there_is_not_asked_to_be_finished(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), known=(CompleteShot("0001", 12.0),))
    (tmp_path / "0001.h5").write_bytes(b"of the session")
    ((done,), _) = recover_folder(tmp_path, None)
    (shot,) = done.shots
    assert shot.shot_file == tmp_path / "0001.h5"
    print_recovered(tmp_path, [done])
    assert "finish shot" not in capsys.readouterr().out


def test_captures_that_were_written_before_are_left_as_they_are(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,))
    ((first,), _) = recover_folder(tmp_path, None, keep=True)
    assert not first.removed
    file = first.shots[0].files[0]
    before = file.stat().st_mtime_ns
    again = recover_journal(first.journal, tmp_path)
    assert [shot.name for shot in again.shots] == ["0001"]
    assert again.shots[0].was_there
    assert [path.name for path in (tmp_path / "captures").iterdir()] == ["0001"]
    assert file.stat().st_mtime_ns == before
    assert again.everything == first.everything
    assert again.removed


def test_captures_of_another_shot_under_the_same_name_are_never_touched(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), known=(CompleteShot("0001", 12.0),))
    other = tmp_path / "captures" / "0001"
    other.mkdir(parents=True)
    (other / "mine.txt").write_text("mine")
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.shots[0].folder == tmp_path / "captures" / "0001-recovered"
    assert [path.name for path in other.iterdir()] == ["mine.txt"]


def test_of_a_session_that_ended_in_order_only_the_shots_are_wanted(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), closed=True)
    ((done,), _) = recover_folder(tmp_path, tmp_path / "elsewhere")
    assert done.in_order
    assert done.everything is None
    assert done.shots[0].folder == tmp_path / "elsewhere" / "captures" / "0001"


def test_a_damaged_record_costs_itself_and_is_counted(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    segments = sorted(journal.glob("*.journal"))
    content = bytearray(segments[0].read_bytes())
    at = content.index(b"   14.90")
    content[at] ^= 0xFF
    segments[0].write_bytes(content)
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.everything is not None
    assert times_in(done.everything / f"{NAME}_imu.rdsc")[-1] == pytest.approx(14.89)
    assert done.cut_bytes > 0


def test_what_is_no_folder_and_a_journal_of_something_else_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no such folder"):
        recover_folder(tmp_path / "none", None)
    with JournalWriter(tmp_path / "j", {"schema": "x"}, 0, segment_bytes=1 << 16) as writer:
        writer.append(0, 0, 1, b"x")
    leave_journal(tmp_path)
    (done,), (failed,) = recover_folder(tmp_path, None)
    assert "of no live acquisition" in str(failed)
    assert isinstance(failed, StoreError)
    assert done.removed
    assert (tmp_path / "j").exists()
