"""Dropped files are told once, when they have stopped growing."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_daq.live.shots.folder_watch import FolderWatch


def names(watch: FolderWatch, now_s: float) -> list[str]:
    return [file.path.name for file in watch.poll(now_s)]


def test_a_file_is_told_once_and_only_after_it_has_stopped_growing(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path, settle_s=lambda _: 1.0)
    file = tmp_path / "0001.csv"
    file.write_bytes(b"a")
    assert names(watch, 0.0) == []
    assert names(watch, 0.9) == []
    file.write_bytes(b"ab")
    assert names(watch, 1.5) == []
    assert names(watch, 2.1) == []
    (dropped,) = watch.poll(2.6)
    assert (dropped.path, dropped.seen_s) == (file, 0.0)
    assert names(watch, 9.0) == []


def test_a_look_soon_after_the_last_one_does_not_read_the_folder(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path, settle_s=lambda _: 0.0)
    assert names(watch, 0.0) == []
    (tmp_path / "x.csv").write_bytes(b"x")
    assert names(watch, 0.1) == []
    assert names(watch, 0.5) == []  # seen for the first time: an earlier look would tell it now
    assert names(watch, 1.0) == ["x.csv"]


def test_what_lay_there_before_is_left_alone_until_it_changes(tmp_path: Path) -> None:
    old = tmp_path / "old.csv"
    old.write_bytes(b"old")
    watch = FolderWatch(tmp_path)
    assert names(watch, 0.0) == names(watch, 5.0) == []
    old.write_bytes(b"new")
    os.utime(old, ns=(1, 2))
    assert names(watch, 6.0) == []
    assert names(watch, 7.5) == ["old.csv"]


def test_empty_files_hidden_files_folders_and_the_shot_log_are_not_told(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path)
    (tmp_path / "shotlog.csv").write_bytes(b"shot")
    (tmp_path / "empty.csv").touch()
    (tmp_path / ".part").write_bytes(b"x")
    (tmp_path / "folder").mkdir()
    assert names(watch, 0.0) == names(watch, 5.0) == []


def test_a_file_that_is_renamed_when_it_is_done_is_told_under_its_last_name(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path)
    (tmp_path / "x.tmp").write_bytes(b"x")
    assert names(watch, 0.0) == []
    (tmp_path / "x.tmp").rename(tmp_path / "x.csv")
    assert names(watch, 0.5) == []
    assert names(watch, 1.6) == ["x.csv"]


def test_a_folder_that_is_away_for_a_moment_ends_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    watch = FolderWatch(folder)
    (folder / "a.csv").write_bytes(b"a")
    assert names(watch, 0.0) == []
    folder.rename(tmp_path / "away")
    assert names(watch, 0.5) == []
    (tmp_path / "away").rename(folder)
    assert names(watch, 1.5) == ["a.csv"]


def test_what_is_no_folder_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(ReadError, match="cannot be watched"):
        FolderWatch(file)


def test_each_file_settles_as_long_as_its_source_says(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path, settle_s=lambda name: 5.0 if "daq" in name else 0.5)
    for name in ("a_daq.csv", "a_cam.csv"):
        (tmp_path / name).write_bytes(b"x")
    assert names(watch, 0.0) == []
    assert watch.growing == {"a_daq.csv", "a_cam.csv"}
    assert names(watch, 0.6) == ["a_cam.csv"]
    assert names(watch, 4.0) == []
    assert names(watch, 5.1) == ["a_daq.csv"]


def test_a_file_that_is_taken_away_before_it_is_complete_no_longer_counts_as_growing(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path)
    (tmp_path / "x.tmp").write_bytes(b"x")
    (tmp_path / "y.csv").write_bytes(b"x")
    assert names(watch, 0.0) == []
    (tmp_path / "x.tmp").unlink()
    assert names(watch, 0.5) == []
    assert watch.growing == {"y.csv"}


def test_a_folder_that_is_away_for_long_says_why_until_it_is_back(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    watch = FolderWatch(folder)
    folder.rmdir()
    assert names(watch, 0.0) == []
    assert watch.away == ""
    assert names(watch, 1.9) == []
    assert watch.away == ""
    assert names(watch, 2.5) == []
    assert watch.away == "No such file or directory"
    folder.mkdir()
    assert names(watch, 3.1) == []
    assert watch.away == ""


def test_a_file_that_grew_within_one_tick_of_its_disks_clock_is_told_again(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path, settle_s=lambda _: 0.5)
    file = tmp_path / "a.csv"
    for text, told_s in ((b"half", 1.0), (b"half, and the rest", 3.0)):
        file.write_bytes(text)
        os.utime(file, ns=(10**18, 10**18))
        assert names(watch, told_s - 1.0) == []
        assert names(watch, told_s) == ["a.csv"]


def test_a_link_to_nothing_keeps_no_folder_from_being_watched(tmp_path: Path) -> None:
    (tmp_path / "old.csv").symlink_to(tmp_path / "nowhere")
    watch = FolderWatch(tmp_path)
    (tmp_path / "a.csv").write_bytes(b"a")
    assert names(watch, 0.0) == []
    assert names(watch, 1.5) == ["a.csv"]


def test_what_is_said_to_be_new_is_told_though_it_lay_there_before(tmp_path: Path) -> None:
    for name in ("0003_a.csv", "0004_a.csv"):
        (tmp_path / name).write_bytes(b"a")
    watch = FolderWatch(tmp_path, is_new=lambda path: path.name.startswith("0003"))
    assert names(watch, 0.0) == []
    assert names(watch, 1.5) == ["0003_a.csv"]


def test_when_a_file_was_written_is_told_by_the_clock_that_nobody_sets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An hour between the two clocks when the file is written is an hour between them when it is looked at."""
    for hours in (0, -1, 5):
        watch = FolderWatch(tmp_path)
        monkeypatch.setattr("recoil_daq.live.shots.folder_watch.time.time", lambda at=hours: 1.7e9 + 3600.0 * at)
        monkeypatch.setattr("recoil_daq.live.shots.folder_watch.time.monotonic", lambda: 100.0)
        file = tmp_path / f"{hours}.csv"
        file.write_bytes(b"a")
        os.utime(file, (1.7e9 + 3600.0 * hours - 0.25,) * 2)
        assert names(watch, 100.0) == []
        (dropped,) = watch.poll(102.0)
        assert dropped.written_s == pytest.approx(99.75)
