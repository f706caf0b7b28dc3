from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from recoil_acquisition.files import new_file
from recoil_acquisition.files.new_file import give_name, partial_path, remove_partials, sync_folder


def _refusing_folders(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    fsync = os.fsync

    def refused(descriptor: int) -> None:
        if os.path.isdir(f"/proc/self/fd/{descriptor}"):  # noqa: PTH112 - a descriptor has no Path
            raise OSError(number, os.strerror(number))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", refused)


linux = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not say what a descriptor is")


def test_partial_names_are_hidden_unlike_each_other_and_keep_the_ending_where_it_counts(tmp_path: Path) -> None:
    path = tmp_path / "7.mat"
    names = {partial_path(path).name for _ in range(20)}
    assert len(names) == 20
    assert all(name.startswith(".7.mat.") and name.endswith(".partial") for name in names)
    kept = partial_path(path, keeps_suffix=True)
    assert (kept.parent, kept.suffix, kept.name.startswith(".7.")) == (tmp_path, ".mat", True)


def test_only_what_is_partial_of_that_very_name_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "[1].h5"
    mine, others = partial_path(path), [partial_path(tmp_path / "1.h5"), path, tmp_path / ".[1].h5.notes.partial"]
    for file in (mine, *others):
        file.write_text("x")
    remove_partials(path)
    assert sorted(tmp_path.iterdir()) == sorted(others)
    remove_partials(tmp_path / "nowhere" / "1.h5")


def test_a_name_that_is_taken_is_replaced_only_where_that_is_asked_for(tmp_path: Path) -> None:
    temporary, path = tmp_path / "t", tmp_path / "p"
    temporary.write_text("new")
    path.write_text("old")
    with pytest.raises(FileExistsError):
        give_name(temporary, path)
    assert path.read_text() == "old"
    give_name(temporary, path, overwrite=True)
    assert path.read_text() == "new"


@linux
@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP, errno.EACCES])
def test_a_file_system_that_cannot_force_folders_takes_files_all_the_same(tmp_path: Path, monkeypatch, number) -> None:
    _refusing_folders(monkeypatch, number)
    (tmp_path / "t").write_text("x")
    give_name(tmp_path / "t", tmp_path / "p")
    assert (tmp_path / "p").read_text() == "x"


@linux
@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC])
def test_a_disk_that_fails_is_an_error_and_leaves_no_new_name(tmp_path: Path, monkeypatch, number) -> None:
    _refusing_folders(monkeypatch, number)
    (tmp_path / "t").write_text("x")
    with pytest.raises(OSError, match=os.strerror(number)):
        give_name(tmp_path / "t", tmp_path / "p")
    assert not (tmp_path / "p").exists()


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(new_file.os, "name", "posix")
    with pytest.raises(FileNotFoundError):
        sync_folder(tmp_path / "nowhere")
