"""Empty temporary folders that killed processes left: taken away when they are old."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import pytest

from recoil_acquisition.files.temporary_folder import LEFT_AFTER_S, temporary_folder

OLD_S = time.time() - 2.0 * LEFT_AFTER_S


def aged(path: Path) -> Path:
    os.utime(path, (OLD_S, OLD_S))
    return path


def test_empty_folders_of_killed_processes_go_and_no_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, full, young, foreign = (tmp_path / name for name in ("recoil-daq-a", "recoil-daq-b", "recoil-daq-c", "other"))
    for folder in (left, full, young, foreign):
        folder.mkdir()
    (full / "something").touch()
    for folder in (left, full, foreign):
        aged(folder)
    with temporary_folder("range") as name:
        assert Path(name).name.startswith("recoil-daq-range-")
        assert not left.exists()
        assert all(folder.exists() for folder in (full, young, foreign))
    assert not Path(name).exists()
