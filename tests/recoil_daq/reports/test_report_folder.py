"""A report that replaces another: whatever ends the program, one whole report is there or is restored."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.segment import FolderLock
from recoil_daq.reports.report_folder import publish, refuse_existing, way_inside

NAMES = ("report.html", "report.json", "mass.csv")
NOTES = {"notes.txt": "mine", "photos/1.txt": "a photo"}

KILLED = """
import os, sys
from pathlib import Path
from recoil_daq.reports.report_folder import publish

left = 0

def counted(call):
    def count(*arguments, **named):
        global left
        left -= 1
        if left < 0:
            os.kill(os.getpid(), 9)
        return call(*arguments, **named)
    return count

for name in ("rename", "replace", "unlink", "rmdir", "link", "mkdir"):
    setattr(os, name, counted(getattr(os, name)))

def replace(folder, text):
    def write(folder):
        for name in ("report.html", "report.json", "mass.csv", f"of {text}.pdf"):
            (folder / name).write_text(text)
    publish(folder, write, obsolete=[path.name for path in folder.glob("of *.pdf")])

# a process for each step, of one that has imported all
for line in sys.stdin:
    left, text = int(line.split()[0]), line.rstrip("\\n").partition(" ")[2]
    child = os.fork()
    if not child:
        replace(Path(sys.argv[1]), text)
        os._exit(0)
    print(os.waitpid(child, 0)[1], flush=True)
"""


def writer(text: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        for name in NAMES:
            (folder / name).write_text(text)

    return write


def contents(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def reported(tmp_path: Path) -> Path:
    """A report with somebody's notes beside it."""
    folder = tmp_path / "reports" / "r"
    publish(folder, writer("old"))
    for name, text in NOTES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_only_what_is_written_is_replaced(reported: Path) -> None:
    publish(reported, writer("new"))
    assert contents(reported) == dict.fromkeys(NAMES, "new") | NOTES
    assert [path.name for path in reported.parent.iterdir()] == ["r"]


def test_a_folder_in_a_report_keeps_what_is_not_written_again(reported: Path) -> None:
    def write(folder: Path) -> None:
        (folder / "photos").mkdir()
        (folder / "photos" / "2.txt").write_text("another")

    publish(reported, write)
    assert contents(reported) == dict.fromkeys(NAMES, "old") | NOTES | {"photos/2.txt": "another"}


def test_what_tells_of_the_older_report_goes_with_it(reported: Path) -> None:
    publish(reported, writer("new"), obsolete=("notes.txt", "photos/1.txt", "report.json", "never/there.txt"))
    assert contents(reported) == dict.fromkeys(NAMES, "new")
    assert [path.name for path in reported.parent.iterdir()] == ["r"]


@pytest.mark.whole_way
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL that a process sends to itself")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="a process that is killed is made by fork")
def test_a_kill_at_any_step_leaves_a_whole_report_that_the_next_run_finds(reported: Path) -> None:
    (reported / "of old.pdf").write_text("old")
    texts, step, done = set(), 0, False
    command = [sys.executable, "-c", KILLED, str(reported)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as killing:
        assert killing.stdin is not None
        assert killing.stdout is not None
        while not done:
            killing.stdin.write(f"{step} new {step}\n")
            killing.stdin.flush()
            ended_by = int(killing.stdout.readline())
            assert ended_by in (0, 9)
            done = ended_by == 0
            with pytest.raises(StoreError, match="exists already"):
                refuse_existing(reported, NAMES)
            found = contents(reported)
            assert {name: found.pop(name) for name in NOTES} == NOTES
            assert len(set(found.values())) == 1, f"step {step}: a mixed report: {found}"
            assert sorted(found) == sorted((*NAMES, f"of {found['mass.csv']}.pdf")), f"step {step}: of two reports"
            texts |= set(found.values())
            assert [path.name for path in reported.parent.iterdir()] == ["r"], f"step {step}: something is left over"
            step += 1
    assert killing.returncode == 0
    assert step > 10
    assert "old" in texts
    assert f"new {step - 1}" in texts


def test_a_page_that_cannot_be_written_names_the_folder_that_was_asked_for_and_leaves_none(tmp_path: Path) -> None:
    def write(folder: Path) -> None:
        raise StoreError("the report page cannot be written", path=folder / "report.html")

    with pytest.raises(StoreError) as caught:
        publish(tmp_path / "c" / "d", write)
    assert caught.value.path == tmp_path / "c" / "d"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt, PermissionError(13, "Permission denied")])
@pytest.mark.parametrize("failing", [0, 1])
def test_a_failure_between_the_renames_brings_the_old_report_back(
    reported: Path, monkeypatch: pytest.MonkeyPatch, failing: int, error: BaseException
) -> None:
    rename, calls = Path.rename, []

    def fail_once(self: Path, target: Path) -> Path:
        calls.append(target)
        if len(calls) == failing + 1:
            raise error
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail_once)
    with pytest.raises((StoreError, KeyboardInterrupt)):
        publish(reported, writer("new"))
    assert contents(reported) == dict.fromkeys(NAMES, "old") | NOTES
    assert [path.name for path in reported.parent.iterdir()] == ["r"]


def test_a_file_that_comes_while_the_folders_change_places_is_kept(
    reported: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.rename

    def late(self: Path, target: Path) -> Path:
        if self == reported:
            (reported / "late.txt").write_text("late")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", late)
    publish(reported, writer("new"))
    assert contents(reported) == dict.fromkeys(NAMES, "new") | NOTES | {"late.txt": "late"}


def test_what_another_run_is_writing_is_left_alone(reported: Path) -> None:
    theirs = reported.parent / ".r.0123abcd.partial"
    theirs.mkdir()
    lock = FolderLock(theirs)
    publish(reported, writer("new"))
    assert theirs.is_dir()
    lock.release()
    refuse_existing(reported, ())
    assert not theirs.exists()


def test_the_leftovers_of_a_shot_of_a_longer_name_are_not_taken(reported: Path) -> None:
    other = reported.parent / ".r.2.0123abcd.partial"
    other.mkdir()
    publish(reported, writer("new"))
    assert other.is_dir()


@pytest.mark.skipif(os.name == "nt", reason="a link needs an administrator there")
def test_a_folder_behind_a_link_is_exchanged_where_it_is(reported: Path, tmp_path: Path) -> None:
    (tmp_path / "linked").symlink_to(reported, target_is_directory=True)
    publish(tmp_path / "linked", writer("new"))
    assert (tmp_path / "linked").is_symlink()
    assert contents(reported) == dict.fromkeys(NAMES, "new") | NOTES


def test_a_file_system_without_links_will_do(reported: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    publish(reported, writer("new"))
    assert contents(reported) == dict.fromkeys(NAMES, "new") | NOTES


@pytest.mark.parametrize(
    "way",
    [None, 5, ["x"], "/etc/report.html", "C:/a/report.html", r"\\host\share\a", "//host/a", "../../out/a", "a\0b"],
)
def test_a_way_of_somebody_s_document_leads_nowhere_but_inside(way: object, tmp_path: Path) -> None:
    home = tmp_path / "season" / "campaign"
    assert way_inside(home, way, tmp_path / "season") is None
    found = way_inside(home, "../reports/0001/report.html", tmp_path / "season")
    assert found == (tmp_path / "season" / "reports" / "0001" / "report.html").resolve()
