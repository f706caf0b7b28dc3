"""A program that saves the shot log in place and pauses in the middle: no row and no cell of it is lost."""

import csv
import io
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import ErrorCode, ReadError, StoreError
from recoil_acquisition.store import shared_file
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from tests.builders.saved_logs import long_ago, saved

HEAD = "shot,configuration,exclude,notes"
ROWS = [f"000{k},ring,,note {k}" for k in range(1, 9)]
ROWS[5:] = ["0006,ring,misfire,früh", "0007,bare,misfire,cold", "0008,ring,misfire,warm"]
OURS = "\n".join((HEAD, *ROWS, ""))
ORDERS = ("cell", "row", "read", "accept", "restore", "other")


@contextmanager
def at_once() -> Iterator[None]:
    """Have nobody wait: what is in part is refused as when it was waited for."""
    waits = patch.multiple(shared_file, QUIET_S=0.0, COARSE_S=0.0, LONGEST_SAVE_S=0.0)
    with waits, patch.object(os, "fsync"):  # which is what most of the time goes to
        yield


def set_cells(log: Path, shot: str, **cells: str) -> ShotLog:
    return ShotLog.changed(log, lambda found: found.with_cells(shot, cells), ())


def looked_at(log: Path, text: str = OURS) -> Path:
    """Return a log that a command saw."""
    saved(log, text)
    ShotLog.changed(log, lambda found: found, ())
    return log


def table(content: bytes) -> dict[str, dict[str, str]]:
    """Read a log by the standard library."""
    return {row["shot"]: row for row in csv.DictReader(io.StringIO(content.decode(), newline=""))}


def saved_text(order: str) -> str:
    """Return what a person saves: a cell emptied, others changed, two rows added, some other order."""
    rows = [*ROWS, "0010,new,,theirs", "0011,new,misfire,theirs too"]
    rows[1], rows[6] = "0002,ring 2,,other", "0007,bare,,cold"
    rows = rows[::-1] if order == "reversed" else rows
    return "\n".join((HEAD, *rows, "" if order != "no end" else "x")).removesuffix("\nx")


@pytest.mark.exhaustive
@settings(max_examples=20, deadline=None)
@given(
    known=st.booleans(),
    order=st.sampled_from(("same", "reversed", "no end")),
    cuts=st.tuples(st.integers(0, 400), st.integers(0, 400)).map(sorted),
    commands=st.tuples(*(st.lists(st.sampled_from(ORDERS), max_size=4) for _ in range(3))),
)
@example(known=True, order="same", cuts=[150, 150], commands=(["cell", "accept", "cell", "row"], [], []))
@example(known=False, order="same", cuts=[0, 160], commands=(["row"], ["cell", "read", "row"], []))
def test_whatever_commands_run_in_a_save_that_is_cut_anywhere_nothing_is_lost(known, order, cuts, commands) -> None:
    with TemporaryDirectory() as folder, at_once():
        log = Path(folder) / SHOT_LOG
        looked_at(log) if known else saved(log, OURS)
        done: dict[tuple[str, str], str] = {}
        content = saved_text(order).encode()
        cuts = [min(cut, len(content)) for cut in cuts]
        with log.open("wb", buffering=0) as stream:
            for k, (start, stop) in enumerate(((0, cuts[0]), (cuts[0], cuts[1]), (cuts[1], len(content)))):
                stream.write(content[start:stop])
                for number, command in enumerate(commands[k]):
                    run(log, command, f"{k}{number}", done)
        # and once more, as any later command does
        with suppress(ReadError):
            set_cells(log, "0001", notes="last")
        found = ShotLog.changed(log, lambda one: one, (), as_it_is=True)
        written = table(log.read_bytes())
        assert {row.shot for row in found.rows} == set(written)
        for shot, row in {**table(content), "0001": {"shot": "0001", "configuration": "ring"}}.items():
            for column, text in row.items():
                expected = {text, done.get((shot, column), text), "last"}
                assert written[shot][column] in expected, (shot, column, text)
        for (shot, column), text in done.items():
            assert written[shot][column] in (text, "last"), (shot, column, text)


def run(log: Path, command: str, number: str, done: dict[tuple[str, str], str]) -> None:
    """Run a command; what it says done is done."""
    with suppress(ReadError, StoreError):
        match command:
            case "cell":
                set_cells(log, "0003", notes=f"ours {number}")
                done["0003", "notes"] = f"ours {number}"
            case "other":
                set_cells(log, "0009", exclude=f"ours {number}")
                done["0009", "exclude"] = f"ours {number}"
            case "row":
                set_cells(log, f"9{number}", notes="added")
                done[f"9{number}", "notes"] = "added"
            case "read":
                ShotLog.read(log, ())
            case "accept":
                ShotLog.changed(log, lambda one: one, (), as_it_is=True)
            case "restore":
                ShotLog.restored(log)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (OURS[: OURS.index("0006")], "3 of its 8 rows, 6, 7, 8"),
        (OURS[: OURS.index("0006") + 9], "2 of its 8 rows, 7, 8"),
        (OURS[:-3], "the end of its last line"),
        (OURS[: OURS.index("exclude") + 3], "1 of its 4 columns"),
        (OURS[:3], "the rest of it"),
        ("", "the rest of it"),
        (None, "8 of its 8 rows, 1, 2, 3, 4, 5, 6, 7, 8"),
    ],
)
def test_what_is_plainly_half_is_refused_by_who_reads_and_who_writes(tmp_path: Path, text, said) -> None:
    log = looked_at(tmp_path / SHOT_LOG)
    log.unlink() if text is None else saved(log, text)
    if text is None:
        long_ago(tmp_path)
    for use in (lambda: ShotLog.read(log, ()), lambda: set_cells(log, "0009", notes="ours")):
        long_ago(tmp_path)
        with pytest.raises(ReadError, match=f"lacks what was there when a command last looked: .*{said}") as refused:
            use()
        assert refused.value.code is ErrorCode.CUT_OFF
    assert (log.read_text(encoding="utf-8") if log.exists() else None) == text


@pytest.mark.real_time
def test_what_is_plainly_half_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_file, "QUIET_S", 0.1)
    monkeypatch.setattr(shared_file, "COARSE_S", 0.0)
    log = looked_at(tmp_path / SHOT_LOG)
    log.write_text(OURS[:150], encoding="utf-8")

    def go_on() -> None:
        time.sleep(0.5)
        log.write_text(OURS, encoding="utf-8")

    saving = threading.Thread(target=go_on)
    saving.start()
    found = ShotLog.read(log, ())
    saving.join()
    assert len(found.rows) == 8


def test_who_reads_sees_what_was_written_late_and_writes_nothing(tmp_path: Path) -> None:
    log = saved(tmp_path / SHOT_LOG, OURS)
    with at_once(), log.open("r+", encoding="utf-8") as late:
        set_cells(log, "0001", configuration="bare")
        late.write(saved_text("same"))
        late.flush()
        before = sorted((path, path.read_bytes()) for path in tmp_path.iterdir())
        found = ShotLog.read(log, ())
        assert sorted((path, path.read_bytes()) for path in tmp_path.iterdir()) == before
    assert found.row("0001").configuration == "bare"
    assert found.row("0002").configuration == "ring 2"
    with at_once():
        assert ShotLog.changed(log, lambda one: one, ()).sha256 == found.sha256


@pytest.mark.parametrize(
    "text",
    [
        "\n".join((HEAD, *ROWS[::-1], "")),  # sorted otherwise
        OURS.replace("notes", "remarks"),  # a column renamed
        OURS.replace(",", ";"),
        OURS.replace("000", "").replace("\n", "\r\n"),  # a spreadsheet's numbers
        OURS.replace("ring", ""),  # cells emptied
        OURS.replace(HEAD, f"{HEAD},own") + "0012,ring,,x,y\n",
        OURS.removesuffix("\n"),
    ],
)
def test_what_a_person_means_is_taken_at_once(tmp_path: Path, text: str) -> None:
    log = saved(looked_at(tmp_path / SHOT_LOG), text)
    assert len(ShotLog.read(log, ()).rows) >= 8
    set_cells(log, "a", exclude="ours")
    assert log.read_text(encoding="utf-8").startswith(text.replace("\r\n", "\n"))


@pytest.mark.parametrize("text", [OURS.replace(f"{ROWS[3]}\n", ""), f"{HEAD}\n", "shot,notes\n1,a\n", None])
def test_what_a_person_takes_out_is_asked_about_once(tmp_path: Path, text: str | None) -> None:
    log = looked_at(tmp_path / SHOT_LOG)
    log.unlink() if text is None else saved(log, text)
    with at_once():
        with pytest.raises(ReadError, match=r"log --dir .* --restore`, or say by `--accept`"):
            set_cells(log, "0009", notes="ours")
        ShotLog.changed(log, lambda one: one, (), as_it_is=True)
        set_cells(log, "0009", notes="ours")
        assert "0004" not in {row.shot for row in ShotLog.read(log, ()).rows}


def test_what_a_stale_program_wrote_over_is_put_back(tmp_path: Path) -> None:
    log = saved(tmp_path / SHOT_LOG, "shot,notes\na,theirs\n")
    set_cells(log, "b", notes="ours")
    saved(log, "shot,notes\na,theirs again\n")  # opened before the command
    with pytest.raises(ReadError, match="1 of its 2 rows, b;"):
        ShotLog.read(log, ())
    ShotLog.restored(log)
    assert log.read_text(encoding="utf-8") == "shot,notes\na,theirs again\nb,ours\n"


def test_where_files_have_no_second_names_the_one_that_is_replaced_is_moved(tmp_path: Path, monkeypatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    log = saved(tmp_path / SHOT_LOG, OURS)
    monkeypatch.setattr(os, "link", refuse)
    with at_once(), log.open("r+", encoding="utf-8") as late:
        set_cells(log, "0001", configuration="bare")
        late.write(saved_text("same"))
        late.flush()
        set_cells(log, "0001", exclude="cold")
    written = table(log.read_bytes())
    assert (written["0001"]["configuration"], written["0002"]["configuration"]) == ("bare", "ring 2")
    assert "0011" in written


def test_files_that_were_replaced_are_forgotten_when_nobody_wrote_to_them_for_long(tmp_path: Path) -> None:
    log = looked_at(tmp_path / SHOT_LOG)
    for k in range(5):
        set_cells(log, "0001", notes=str(k))
    beside = [path for path in tmp_path.iterdir() if path.suffix in (".was", ".before")]
    assert len(beside) == 10
    for path in beside:
        long_ago(path)
    with patch.object(shared_file, "KEPT_S", 30.0):
        set_cells(log, "0001", notes="last")
    assert len([path for path in tmp_path.iterdir() if path.suffix in (".was", ".before")]) == 2
