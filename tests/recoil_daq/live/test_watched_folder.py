"""Where a live session waits for files is said; a folder that is missing is refused where its name is a mistake."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from recoil_acquisition.errors import ReadError
from recoil_daq.live import acquisition
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.shot import LiveOptions, LiveOutcome
from recoil_daq.live.shots.dropped_files import DroppedFiles
from recoil_rigs.rig import load_rig
from tests.builders.range_session import Told


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """Return a rig whose devices are not there."""
    text = load_rig("mixed").text
    text = text.replace('device = { virtual = "pty" }', f'device = {{ port = "{tmp_path}/none", baudrate = 9600 }}')
    text = text.replace('device = { virtual = "virtual" }', 'device = { interface = "virtual", channel = "quiet" }')
    assert "device = { virtual" not in text
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "mixed.dbc").write_text(load_rig("mixed").databases["mixed.dbc"], encoding="utf-8")
    return tmp_path / "rig.toml"


def test_a_folder_whose_name_is_misspelt_is_refused_with_the_nearest(run, rig: Path, tmp_path: Path) -> None:
    (tmp_path / "incoming").mkdir()
    result = run("ingest", rig, "--live", "--watch", tmp_path / "incomming", "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert f"error: {tmp_path}/incomming: no such folder to watch; found {tmp_path}/incoming; correct" in result.stderr
    assert not (tmp_path / "incomming").exists()
    assert not (tmp_path / "out").exists()


def test_a_file_is_no_folder_to_watch(run, rig: Path, tmp_path: Path) -> None:
    result = run("ingest", rig, "--live", "--watch", rig, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "rig.toml: is no folder to watch; correct --watch, or make the folder first" in result.stderr


def test_the_folder_of_the_shot_files_is_not_watched(rig: Path, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="is the folder of the shot files, and cannot be watched"):
        run_live(load_rig(rig), LiveOptions(tmp_path / "out", watch=tmp_path / "x" / ".." / "out"), Told())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("watched", [True, False])
def test_what_is_waited_for_and_where_is_said(tmp_path: Path, watched: bool) -> None:
    options = LiveOptions(tmp_path, watch=tmp_path / "in" if watched else None)
    files = DroppedFiles(load_rig("mixed"), options, Told(), {"camera", "dewetron"}, 0.7)
    away = "are not waited for: --watch FOLDER does, or `recoil-daq ingest` takes them later"
    where = f"are waited for in {tmp_path}/in, which was missing and is made" if watched else away
    assert files.where == f"files of camera, dewetron {where}"
    assert files.folder_made == watched
    assert DroppedFiles(load_rig("mixed"), options, Told(), set(), 0.7).where == ""
    again = DroppedFiles(load_rig("mixed"), options, Told(), {"camera"}, 0.7)
    assert "made" not in again.where


def test_a_folder_that_is_no_misspelling_is_made(tmp_path: Path, rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Path | None] = []
    worker = SimpleNamespace(ask=lambda *_, **__: None, close=lambda: None)
    monkeypatch.setattr(acquisition, "WarmWorker", lambda: worker)

    def live(_: object, options: LiveOptions, *__: object, **___: object) -> SimpleNamespace:
        made.append(options.watch)
        return SimpleNamespace(run=lambda: LiveOutcome("mixed"), last=None)

    monkeypatch.setattr(acquisition, "LiveRange", live)
    run_live(load_rig(rig), LiveOptions(tmp_path / "out", watch=tmp_path / "from-the-recorder"), Told())
    assert made == [tmp_path / "from-the-recorder"]
    with pytest.raises(ReadError, match="no such folder to watch"):
        run_live(load_rig(rig), LiveOptions(tmp_path / "out", watch=tmp_path / "none" / "of-it"), Told())


def test_a_journal_that_was_recovered_is_named_and_not_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journals = [tmp_path / "journal" / name for name in ("1", "2", "3")]
    (tmp_path / "recovered").mkdir()
    for name in ("1", "2"):
        (tmp_path / "recovered" / f"{name}.rdlog").touch()
    read: list[Path] = []

    def recovered(journal: Path, *_: object, **__: object) -> None:
        read.append(journal)
        raise ReadError("cannot be read", path=journal)

    monkeypatch.setattr(acquisition, "find_logs", lambda _: journals)
    monkeypatch.setattr(acquisition, "recover_journal", recovered)
    display = Told()
    acquisition._recover(load_rig("mixed"), LiveOptions(tmp_path), display)
    assert read == [tmp_path / "journal" / "3"]
    assert display.told("2 journals are still there: ")
