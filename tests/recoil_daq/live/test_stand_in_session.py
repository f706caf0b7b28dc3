"""A journal whose beginning is damaged, or that states nothing of its session any more: its rig file stands in."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import HEAD_SIZE, Kind
from recoil_acquisition.log.scan import FileScan
from recoil_daq.cli import app
from recoil_daq.live.recover import recover_folder
from tests.builders.left_journals import RIG, leave_journal, times_in


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
    monkeypatch.setattr("recoil_daq.live.stand_in_session.load_rig", lambda _: other)
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
