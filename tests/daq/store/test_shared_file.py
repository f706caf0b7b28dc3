"""A file that commands change and people save in place: who waits for whom, and what is kept."""

import subprocess
import sys
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.file_lock import FileLock
from recoil_acquisition.store import shared_file
from recoil_acquisition.store.shared_file import QUIET_S, backups_of
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from tests.builders.log_races import KINDS, run_race
from tests.builders.saved_logs import saved

HOLDER = """
import sys, time
from pathlib import Path
from recoil_acquisition.files.file_lock import FileLock
with FileLock(Path(sys.argv[1]), 0.0):
    print("held", flush=True)
    time.sleep(60)
"""


def set_cell(log: Path, shot: str, text: str) -> ShotLog:
    return ShotLog.changed(log, lambda found: found.with_cells(shot, {"notes": text}), ())


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", range(len(KINDS)))
def test_no_race_loses_a_row_or_a_cell(tmp_path: Path, number: int) -> None:
    race = run_race(tmp_path / "shots", number)
    assert race.kind == KINDS[number]
    assert (race.lost, race.refused) == ([], [])


@pytest.mark.exhaustive
def test_what_others_wrote_a_moment_ago_is_waited_for_also_where_it_ends_on_a_whole_line(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    log.write_text("shot,notes\na,theirs\n", encoding="utf-8")
    begun_s = time.monotonic()

    def go_on() -> None:
        time.sleep(0.5)
        with log.open("a", encoding="utf-8") as stream:
            stream.write("b,theirs too\n")

    saving = threading.Thread(target=go_on)
    saving.start()
    found = ShotLog.read(log, ())
    saving.join()
    assert [row.shot for row in found.rows] == ["a", "b"]
    assert time.monotonic() - begun_s > QUIET_S


def test_what_a_command_wrote_is_not_waited_for(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    begun_s = time.monotonic()
    for k in range(10):
        set_cell(log, str(k), "ours")
        assert len(ShotLog.read(log, ()).rows) == k + 1
    assert time.monotonic() - begun_s < QUIET_S


@pytest.mark.exhaustive
def test_a_half_that_equals_what_a_command_wrote_before_is_waited_for(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    first = set_cell(log, "a", "ours").path.read_bytes()
    second = set_cell(log, "b", "ours").path.read_bytes()
    log.write_bytes(first)

    def go_on() -> None:
        time.sleep(0.5)
        log.write_bytes(second)

    saving = threading.Thread(target=go_on)
    saving.start()
    assert len(ShotLog.read(log, ()).rows) == 2
    saving.join()


@pytest.mark.exhaustive
def test_a_save_between_the_check_and_the_replacement_stays_with_the_change_made_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, name = saved(tmp_path / SHOT_LOG, "shot,notes,exclude\na,before,cold\n"), shared_file._name
    others = iter(("shot,notes,exclude\na,after,\nb,theirs,misfire\n",))

    def after_another(temporary: Path, target: Path, *, overwrite: bool) -> None:
        if text := next(others, ""):
            target.write_text(text, encoding="utf-8")
        name(temporary, target, overwrite=overwrite)

    monkeypatch.setattr(shared_file, "_name", after_another)
    done = set_cell(log, "c", "ours")
    expected = "shot,notes,exclude\na,after,\nb,theirs,misfire\nc,ours,\n"
    assert log.read_text(encoding="utf-8") == expected
    assert done.sha256 == ShotLog.read(log, ()).sha256


@pytest.mark.exhaustive
def test_what_is_written_late_into_the_file_that_was_replaced_is_taken_by_the_next_command(tmp_path: Path) -> None:
    log = saved(tmp_path / SHOT_LOG, "shot,notes,exclude\na,,\n")
    with log.open("r+", encoding="utf-8") as late:
        set_cell(log, "c", "ours")
        late.write("shot,notes,exclude\na,theirs,cold\nb,,misfire\n")
    set_cell(log, "d", "ours")
    assert log.read_text(encoding="utf-8") == "shot,notes,exclude\na,theirs,cold\nb,,misfire\nc,ours,\nd,ours,\n"
    # and once only
    ShotLog.changed(log, lambda found: found.with_cells("b", {"exclude": ""}), ())
    assert set_cell(log, "d", "still").row("b").exclude == ""


@pytest.mark.real_time
def test_a_log_that_a_program_takes_away_and_puts_back_is_waited_for(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    set_cell(log, "a", "ours")
    content = log.read_bytes()
    log.unlink()

    def put_back() -> None:
        time.sleep(0.4)
        saved(log, content + b"b,,,,,,,,,theirs\n")

    saving = threading.Thread(target=put_back)
    saving.start()
    assert [row.shot for row in set_cell(log, "c", "ours").rows] == ["a", "b", "c"]
    saving.join()


@pytest.mark.real_time
def test_a_log_that_is_saved_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_file, "LONGEST_SAVE_S", 0.5)
    log = tmp_path / SHOT_LOG
    stop = threading.Event()

    def save() -> None:
        while not stop.is_set():
            log.write_text("shot,notes\na,theirs\n", encoding="utf-8")
            stop.wait(0.02)

    log.write_text("shot,notes\na,theirs\n", encoding="utf-8")
    saving = threading.Thread(target=save)
    saving.start()
    try:
        with pytest.raises(ReadError, match=r"another program has been changing it for 0\.5 s; close it there"):
            set_cell(log, "b", "ours")
    finally:
        stop.set()
        saving.join()
    assert log.read_text(encoding="utf-8") == "shot,notes\na,theirs\n"


def test_the_lock_of_a_process_that_died_is_free(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    lock = tmp_path / f".{SHOT_LOG}.lock"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(lock)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(TimeoutError, match=r"another command has held it for 0\.1 s"):
            FileLock(lock, 0.1)
        holder.kill()
        holder.wait()
        set_cell(log, "a", "ours")


def test_threads_of_one_process_wait_for_one_another(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: set_cell(log, f"s{k}", str(k)), range(24)))
    assert {row.shot: row.notes for row in ShotLog.read(log, ()).rows} == {f"s{k}": str(k) for k in range(24)}


def test_what_was_replaced_is_kept_where_somebody_else_wrote_it_or_a_cell_is_gone(tmp_path: Path) -> None:
    log = saved(tmp_path / SHOT_LOG, "shot,notes\na,theirs\n")
    set_cell(log, "b", "ours")
    assert [one.read_text(encoding="utf-8") for one in backups_of(log)] == ["shot,notes\na,theirs\n"]
    set_cell(log, "c", "ours")
    assert len(backups_of(log)) == 1
    set_cell(log, "a", "changed")
    assert [one.read_text(encoding="utf-8") for one in backups_of(log)] == [
        "shot,notes\na,theirs\n",
        "shot,notes\na,theirs\nb,ours\nc,ours\n",
    ]


@pytest.mark.exhaustive
def test_what_is_kept_is_bounded_in_number_and_never_thrown_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / SHOT_LOG
    monkeypatch.setattr(shared_file, "KEPT_S", 0.0)
    for k in range(60):
        saved(log, f"shot,notes\na,{k}\nb,theirs\n")
        set_cell(log, "b", "ours")
    files = backups_of(log)
    assert len(files) <= shared_file.MOST_BACKUPS + 1
    with zipfile.ZipFile(tmp_path / f"{SHOT_LOG}.bak.zip") as archive:
        texts = [archive.read(name).decode() for name in archive.namelist()]
    texts += [one.read_text(encoding="utf-8") for one in files]
    assert {f"shot,notes\na,{k}\nb,theirs\n" for k in range(60)} <= set(texts)
    assert len(list(tmp_path.iterdir())) == len(files) + 4  # the log, its lock, what was seen, the archive


def test_who_reads_writes_nothing(tmp_path: Path) -> None:
    log = saved(tmp_path / SHOT_LOG, "shot,notes\na,theirs\n")
    ShotLog.read(log)
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.skipif(sys.platform == "win32", reason="links are those of POSIX")
def test_a_link_in_the_place_of_the_lock_is_not_written_through(tmp_path: Path) -> None:
    other = saved(tmp_path / "other.txt", "precious")
    (tmp_path / f".{SHOT_LOG}.lock").symlink_to(other)
    with pytest.raises(StoreError, match="cannot be written"):
        set_cell(tmp_path / SHOT_LOG, "a", "ours")
    assert other.read_text(encoding="utf-8") == "precious"


def test_a_damaged_lock_file_costs_a_wait_alone(tmp_path: Path) -> None:
    log = tmp_path / SHOT_LOG
    set_cell(log, "a", "ours")
    for content in (b"", b"\xff", b"[1, 2]", b'{"ours": [[1]], "before": {}}', b'{"ours": 3}', b"[" * 9000):
        (tmp_path / f".{SHOT_LOG}.lock").write_bytes(content)
        saved(log, log.read_bytes())
        assert set_cell(log, "a", f"after {len(content)}").rows[0].notes == f"after {len(content)}"
