"""A journal that was left over becomes captures: its shots, and everything beside them."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.session_record import CompleteShot, Kept
from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.record import HEAD_SIZE
from recoil_acquisition.log.segment import LOCK_NAME
from recoil_acquisition.log.writer import LogWriter
from recoil_daq.cli import app
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.recover import recover_folder, recover_journal
from recoil_daq.live.recovered import recovered_document
from recoil_daq.live.tables import print_recovered
from tests.builders.left_journals import NAME, RIG, leave_journal, times_in
from tests.builders.live_logs import source_in


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


def test_a_shot_under_way_is_cut_from_its_recorded_trigger(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    leave_journal(tmp_path, triggers_s=(12.0, 14.8))
    ((done,), _) = recover_folder(tmp_path, None)
    first, second = done.shots
    assert [first.name, second.name] == ["0001", "0002"]
    assert first.missing == ("dewetron", "camera")
    assert first.shot_file is None
    print_recovered(tmp_path, recovered_document([done]))
    command = f"{RIG.path} {first.path} FILES --out {tmp_path}"
    assert f"finish shot 0001 with `recoil-daq ingest {command}`" in capsys.readouterr().out.replace("\n", "")
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


def test_a_shot_of_which_no_file_can_be_made_keeps_no_other_from_its_capture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    leave_journal(tmp_path, triggers_s=(12.0, 14.0))
    live = replace(RIG, sources=RIG.sources[1:3], reference_clock="imu")
    monkeypatch.setattr("recoil_daq.live.recover.parse_rig", lambda *_, **__: live)

    def refuse(_rig: object, files: list[Path], **_: object) -> None:
        raise ReadError("has 3 samples", path=files[0])

    monkeypatch.setattr("recoil_daq.live.recover.ingest_files", refuse)
    ((done,), failed) = recover_folder(tmp_path, None)
    assert failed == []
    assert [(shot.name, shot.shot_file, shot.path.exists()) for shot in done.shots] == [
        ("0001", None, True), ("0002", None, True),
    ]  # fmt: skip
    assert done.removed
    print_recovered(tmp_path, recovered_document([done]))
    printed = " ".join(capsys.readouterr().out.split())
    assert "no shot file of shot 0001 can be made of its capture: " in printed
    assert "0002.rdlog: has 3 samples" in printed


def test_a_folder_that_a_live_session_writes_to_is_refused(tmp_path: Path) -> None:
    """Both would give the next number to a shot, and one would take away what the other is writing."""
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    with OutputFolder(tmp_path):
        done, (failed,) = recover_folder(tmp_path, None)
        assert done == []
        assert "a live session writes to this folder; end it first" in str(failed)
        assert not (tmp_path / "captures").exists()
        ((one,), _) = recover_folder(tmp_path, tmp_path / "other", keep=True)
        assert [shot.path for shot in one.shots] == [tmp_path / "other" / "captures" / "0001.rdlog"]
    assert journal.exists()
    assert recover_folder(tmp_path, None)[0][0].removed


def test_a_journal_that_cannot_be_removed_is_recovered_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    leave_journal(tmp_path, triggers_s=(12.0,))

    def refuse(folder: Path) -> None:
        raise StoreError("cannot be removed: Read-only file system", path=folder)

    monkeypatch.setattr("recoil_acquisition.log.folder.remove_log", refuse)
    ((done,), failed) = recover_folder(tmp_path, tmp_path / "other")
    assert failed == []
    assert (done.removed, done.elsewhere) == (False, True)
    print_recovered(tmp_path, recovered_document([done]))
    printed = " ".join(capsys.readouterr().out.split())
    assert "all of the journal is in these captures; it cannot be removed: " in printed
    assert "cannot be removed: Read-only file system" in printed


def test_a_folder_that_can_only_be_read_is_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that was taken out of a machine that lost its power holds the lock's file, and is mounted to be read."""
    journal = leave_journal(tmp_path, triggers_s=(12.0,))
    (journal / LOCK_NAME).touch()
    opened = os.open

    def read_only(path: Path, flags: int, *mode: int, **more: Any) -> int:
        if flags & os.O_RDWR and str(path).startswith(str(journal)):
            raise OSError(errno.EROFS, "Read-only file system")
        return opened(path, flags, *mode, **more)

    monkeypatch.setattr("recoil_acquisition.log.segment.os.open", read_only)
    ((done,), failed) = recover_folder(tmp_path, tmp_path / "other", keep=True)
    assert failed == []
    assert [shot.name for shot in done.shots] == ["0001"]
