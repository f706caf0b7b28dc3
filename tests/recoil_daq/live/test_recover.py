"""A journal that was left over becomes captures: its shots, and everything beside them."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.session_record import CompleteShot, Kept, LiveRecord, RecordedSource
from recoil_acquisition.devices.device import SERIAL, Block, event_block
from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import HEAD_SIZE, Kind
from recoil_acquisition.log.scan import FileScan
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.trigger import Decision
from recoil_daq.cli import app
from recoil_daq.live.recover import recover_folder, recover_journal, recovered_document
from recoil_daq.live.tables import print_recovered
from recoil_rigs.rig import load_rig
from tests.builders.live_logs import append, source_in, stream_in
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
    out: Path,
    *,
    triggers_s: tuple[float, ...] = (),
    disarmed_s: tuple[float, ...] = (),
    known: tuple[CompleteShot, ...] = (),
    kept: tuple[Kept, ...] = (),
    closed: bool = False,
) -> Path:
    """The inertial sensor sends its time every 10 ms from 10 s to 15 s; the bus is silent."""
    folder = out / "journal" / NAME
    writer = LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 20)
    append(writer, RECORD, [event_block("imu", int(10e9), "opened", "x"), *(imu(10.0 + 0.01 * k) for k in range(500))])
    for time_s in triggers_s:
        decision = Decision(time_s, "trigger", "", "p_brake", 0, 1, 2e6, time_s)
        writer.say(Kind.DECISION, round(time_s * 1e9), asdict(decision))
    for time_s in disarmed_s:
        decision = Decision(time_s, "suppressed", "not armed", "p_brake", 0, 1, 2e6, time_s)
        writer.say(Kind.DECISION, round(time_s * 1e9), asdict(decision))
    for stretch in kept:
        writer.say(Kind.KEPT, round(stretch.last_s * 1e9), asdict(stretch))
    for shot in known:
        writer.say(Kind.SHOT, round(shot.trigger_s * 1e9), asdict(shot))
    writer.close(in_order=closed)
    return folder


def times_in(path: Path) -> list[float]:
    stream = stream_in(path, "imu")
    return [float(stream[at : at + 8]) for at in range(0, len(stream), 8)]


def test_every_byte_comes_back_once_and_the_journal_goes(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path)
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.shots == ()
    assert done.everything == tmp_path / "recovered" / f"{NAME}.rdlog"
    assert times_in(done.everything) == pytest.approx([10.0 + 0.01 * k for k in range(500)])
    assert read_capture(done.everything).session["rig_text"] == RIG.text
    assert [event.name for event in source_in(done.everything, "imu").events] == ["opened"]
    assert not journal.exists()
    assert recover_folder(tmp_path, None) == ([], [])


def test_a_shot_under_way_is_cut_from_its_recorded_trigger(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0, 14.8))
    ((done,), _) = recover_folder(tmp_path, None)
    first, second = done.shots
    assert [first.name, second.name] == ["0001", "0002"]
    assert first.missing == ("dewetron", "camera")
    assert first.shot_file is None
    times = times_in(first.path)
    assert times[0] == pytest.approx(11.7)
    assert times[-1] == pytest.approx(12.94, abs=0.011)
    acquisition = acquisition_in(second.path)
    assert acquisition is not None
    assert acquisition.recovered
    assert [source.name for source in acquisition.sources if source.late] == ["can", "imu"]
    assert times_in(second.path)[-1] == pytest.approx(14.99)


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
    print_recovered(tmp_path, recovered_document([done]))
    assert "finish shot" not in capsys.readouterr().out


def test_captures_that_were_written_before_are_left_as_they_are(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,))
    ((first,), _) = recover_folder(tmp_path, None, keep=True)
    assert not first.removed
    file = first.shots[0].path
    before = file.stat().st_mtime_ns
    again = recover_journal(first.journal, tmp_path)
    assert [shot.name for shot in again.shots] == ["0001"]
    assert again.shots[0].was_there
    assert [path.name for path in (tmp_path / "captures").iterdir()] == ["0001.rdlog"]
    assert file.stat().st_mtime_ns == before
    assert again.everything == first.everything
    assert again.removed


def test_captures_of_another_shot_under_the_same_name_are_never_touched(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), known=(CompleteShot("0001", 12.0),))
    other = tmp_path / "captures" / "0001.rdlog"
    other.parent.mkdir()
    other.write_text("mine")
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.shots[0].path == tmp_path / "captures" / "0001-recovered.rdlog"
    assert other.read_text() == "mine"


def test_of_a_session_that_ended_in_order_only_the_shots_are_wanted(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), closed=True)
    ((done,), _) = recover_folder(tmp_path, tmp_path / "elsewhere")
    assert done.in_order
    assert done.everything is None
    assert done.shots[0].path == tmp_path / "elsewhere" / "captures" / "0001.rdlog"


def damage(journal: Path, *places: bytes) -> None:
    """Flip a byte of each record that holds one of some texts."""
    (segment,) = journal.glob("*.rdlog")
    content = bytearray(segment.read_bytes())
    for text in places:
        content[content.index(text)] ^= 0xFF
    segment.write_bytes(content)


def test_a_damaged_record_costs_itself_and_the_journal_stays_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    damage(journal, b"   10.50", b"   14.90")
    ((done,), _) = recover_folder(tmp_path, None)
    assert done.everything is not None
    times = times_in(done.everything)
    assert times == pytest.approx([10.0 + 0.01 * k for k in range(500) if k not in (50, 490)])
    assert (done.lost_records, done.damaged_bytes) == (2, 2 * (HEAD_SIZE + 8))
    assert [loss.split(", from")[0] for loss in done.losses] == 2 * ["imu: 1 records, 8 bytes"]
    assert not done.removed
    assert journal.exists()
    print_recovered(tmp_path, recovered_document([done]))
    said = " ".join(capsys.readouterr().out.split())
    assert "2 are missing, 144 bytes in damaged places could not be read" in said
    assert "what is missing at its very end is not known" in said
    assert f"the journal is kept: {journal}" in said
    assert "all of it" not in said


def test_the_command_says_by_its_code_that_a_journal_is_damaged(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path)
    damage(journal, b"   12.00")
    done = CliRunner().invoke(app, ["recover", str(tmp_path), "--json"])
    assert done.exit_code == 1, done.output
    (document,) = json.loads(done.stdout)["journals"]
    assert document["damaged"]
    (loss,) = document["losses"]
    assert document["findings"] == [{"code": "loss", "about": "imu", "severity": "warn", "text": loss}]
    assert journal.exists()


def test_a_shot_fired_while_disarmed_is_listed_cut_out_on_request_and_then_the_journal_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = leave_journal(tmp_path, triggers_s=(11.0,), disarmed_s=(13.0, 13.1), closed=True)
    ((done,), _) = recover_folder(tmp_path, None)
    assert not done.removed
    (outside,) = done.outside
    assert (outside.at_s, outside.lasting_s) == pytest.approx((3.0, 0.1))
    assert outside.why == "p_brake crossed: not armed"
    print_recovered(tmp_path, recovered_document([done]))
    said = " ".join(capsys.readouterr().out.split())
    assert f"recover {journal} --at SECONDS" in said
    assert "removed" not in said
    assert not recover_folder(tmp_path, None)[0][0].removed, "asking again does not remove it"
    ((cut,), _) = recover_folder(journal, None, at_s=[3.0])
    assert [shot.name for shot in cut.shots] == ["0001", "0002"]
    times = times_in(cut.shots[1].path)
    assert (times[0], times[-1]) == pytest.approx((12.7, 13.94))
    assert cut.outside == ()
    assert cut.removed
    assert not journal.exists()


def test_a_shot_that_was_cut_out_before_is_not_outside_any_more(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path, disarmed_s=(13.0,), closed=True)
    recover_folder(journal, None, at_s=[3.0], keep=True)
    ((again,), _) = recover_folder(journal, None)
    assert again.outside == ()
    assert again.removed


def test_what_was_recorded_without_a_look_at_it_keeps_a_journal_that_was_closed_in_order(tmp_path: Path) -> None:
    leave_journal(tmp_path, kept=(Kept(13.0, 13.2, 13.0, 14.2, "imu: recorded without a look at it"),), closed=True)
    ((done,), _) = recover_folder(tmp_path, None)
    assert [(one.at_s, one.why) for one in done.outside] == [(pytest.approx(3.0), "imu: recorded without a look at it")]
    assert not done.removed


def test_a_person_may_discard_what_is_nowhere_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    journal = leave_journal(tmp_path, disarmed_s=(13.0,), closed=True)
    ((done,), _) = recover_folder(tmp_path, None, discard=True)
    print_recovered(tmp_path, recovered_document([done]))
    said = " ".join(capsys.readouterr().out.split())
    assert "p_brake crossed: not armed" in said
    assert "removed, as was asked for" in said
    assert not journal.exists()


def test_captures_that_differ_from_the_journal_keep_it(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    ((first,), _) = recover_folder(tmp_path, None, keep=True)
    capture = first.shots[0].path
    content = capture.read_bytes()
    capture.write_bytes(content.replace(b"   12.00", b"   12.01"))
    assert capture.read_bytes() != content
    ((again,), _) = recover_folder(tmp_path, None)
    assert not again.shots[0].whole
    assert not again.removed
    assert journal.exists()


def test_everything_that_was_written_before_and_is_incomplete_keeps_the_journal(tmp_path: Path) -> None:
    journal = leave_journal(tmp_path)
    ((first,), _) = recover_folder(tmp_path, None, keep=True)
    assert first.everything is not None
    first.everything.write_bytes(first.everything.read_bytes().replace(b"   12.00", b"   12.01"))
    assert not recover_folder(tmp_path, None)[0][0].removed
    assert journal.exists()


@pytest.mark.parametrize("at_s", [-0.1, 5.1, float("nan")])
def test_an_instant_that_the_journal_does_not_hold_is_refused(tmp_path: Path, at_s: float) -> None:
    journal = leave_journal(tmp_path)
    _, (failed,) = recover_folder(journal, None, at_s=[at_s])
    assert "holds nothing at" in str(failed)
    assert "0 to 4.990 s" in str(failed)
    assert not (tmp_path / "captures").exists()


def test_what_is_no_folder_and_a_journal_of_something_else_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no such folder"):
        recover_folder(tmp_path / "none", None)
    with LogWriter(tmp_path / "j", {"schema": "x"}, 0, segment_bytes=1 << 16) as writer:
        writer.append(0, 0, 1, b"x")
    leave_journal(tmp_path)
    (done,), (failed,) = recover_folder(tmp_path, None)
    assert "of no live acquisition" in str(failed)
    assert isinstance(failed, StoreError)
    assert done.removed
    assert (tmp_path / "j").exists()


def test_captures_whose_names_look_like_those_of_a_logs_parts_are_never_taken_for_a_log(tmp_path: Path) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,), known=(CompleteShot("100000", 12.0),))
    ((done,), _) = recover_folder(tmp_path, None)
    (shot,) = done.shots
    assert shot.path == tmp_path / "captures" / "100000.rdlog"
    before = shot.path.read_bytes()
    assert recover_folder(tmp_path, None, discard=True) == ([], [])
    assert recover_folder(tmp_path / "captures", None, discard=True) == ([], [])
    assert shot.path.read_bytes() == before
    with pytest.raises(StoreError, match="holds captures and no log"):
        recover_journal(tmp_path / "captures", tmp_path, discard=True)
    assert shot.path.read_bytes() == before


def zero(path: Path, begin: int, end: int) -> None:
    content = bytearray(path.read_bytes())
    content[begin:end] = bytes(end - begin)
    path.write_bytes(content)


def records_of(path: Path, kind: Kind) -> list[tuple[int, int]]:
    """Return where the sound records of a kind begin and end."""
    log = open_log(path.parent)
    with FileScan(path, log.log_id) as scan:
        return [(scan.at - HEAD_SIZE - len(one.payload), scan.at) for one in scan if one.kind == kind]


@pytest.mark.parametrize("page", range(4))
def test_a_page_of_zeros_at_the_beginning_costs_what_was_in_it(page: int, tmp_path: Path) -> None:
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    zero(journal / "000001.rdlog", 4096 * page, 4096 * (page + 1))
    ((done,), failed) = recover_folder(tmp_path, None)
    assert failed == []
    assert done.session_by == ""
    assert [shot.name for shot in done.shots] == ["0001"]
    assert done.everything is not None
    assert len(times_in(done.everything)) >= 500 - 4096 // (HEAD_SIZE + 8) - 1


def without_session(out: Path, monkeypatch: pytest.MonkeyPatch, *, clocks: bool = False) -> Path:
    """Leave a journal as it was written before its session stood in two pages, whose first bytes are zero."""
    monkeypatch.setattr("recoil_acquisition.log.writer._SESSION_SHARE", 1 << 30)
    with monkeypatch.context() as patched:
        # a moment after the last record was read, however long the machine has been on
        patched.setattr("recoil_acquisition.log.writer.time.monotonic_ns", lambda: 16 * 10**9)
        journal = leave_journal(out, triggers_s=(12.0,))
    path = journal / "000001.rdlog"
    _, (_, session_end) = records_of(path, Kind.SESSION)
    (_, _), (_, clock_end) = records_of(path, Kind.CLOCK)
    zero(path, 0, session_end if clocks else clock_end)
    return journal


def test_a_journal_without_its_session_asks_for_its_rig_and_gives_every_frame_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = without_session(tmp_path, monkeypatch, clocks=True)
    done, failed = recover_folder(tmp_path, None)
    assert done == []
    assert "what it says of its session is damaged wherever it stands" in str(failed[0])
    assert "--rig FILE" in str(failed[0])
    ((one,), failed) = recover_folder(tmp_path, None, rig="mixed")
    assert failed == []
    assert one.everything is not None
    assert times_in(one.everything) == pytest.approx([10.0 + 0.01 * k for k in range(500)])
    assert one.session_by == "what it says of its session is damaged: read by mixed"
    assert read_capture(one.everything).session["rig_text"] == RIG.text
    (shot,) = one.shots
    assert times_in(shot.path)[0] == pytest.approx(11.7)
    assert journal.exists()
    ((again,), failed) = recover_folder(tmp_path, None, rig="mixed")
    assert (again.shots[0].was_there, failed) == (True, [])


def test_without_a_record_of_the_clocks_the_beginning_is_known_within_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = without_session(tmp_path, monkeypatch)
    begun_ns = 1_777_889_472 * 10**9
    written_ns = begun_ns + 3 * 10**9
    os.utime(journal / "000001.rdlog", ns=(written_ns, written_ns))
    ((one,), failed) = recover_folder(tmp_path, None, rig="mixed")
    assert failed == []
    assert "its times of day are known within 1." in one.session_by
    assert one.everything is not None
    stated = read_capture(one.everything).session["anchor"]
    # half of what is left of the three seconds when the time in which the records were appended is taken off
    assert 1.0e9 < stated["within_ns"] <= 1.5e9
    assert stated["wall_ns"] == begun_ns + stated["within_ns"]
    renamed = journal.rename(journal.with_name("old"))
    _, failed = recover_folder(renamed, tmp_path / "other", rig="mixed")
    assert "the folder is not named after its beginning" in str(failed[0])


def test_a_rig_whose_sources_are_others_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_session(tmp_path, monkeypatch, clocks=True)
    other = replace(RIG, sources=tuple(reversed(RIG.sources)))
    monkeypatch.setattr("recoil_daq.live.recover.load_rig", lambda _: other)
    _, failed = recover_folder(tmp_path, None, rig="other.toml")
    assert "was not acquired with rig 'mixed'" in str(failed[0])
    assert failed[0].expected == "what source 1 of the rig gives, can (can)"


def test_the_command_takes_the_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_session(tmp_path, monkeypatch, clocks=True)
    result = CliRunner().invoke(app, ["recover", str(tmp_path)])
    assert result.exit_code == 3
    result = CliRunner().invoke(app, ["recover", str(tmp_path), "--rig", "mixed", "--json"])
    (journal,) = json.loads(result.stdout)["journals"]
    assert journal["session_by"].endswith("read by mixed")
    assert [shot["shot"] for shot in journal["shots"]] == ["0001"]
