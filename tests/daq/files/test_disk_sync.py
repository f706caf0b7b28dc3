"""What is forced to the disk is there, on each system by the call that empties the drive's own memory."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from recoil_acquisition.files import disk_sync


@pytest.mark.parametrize("force", [disk_sync.sync, disk_sync.sync_data])
def test_macos_empties_the_memory_of_the_drive_too(
    force: object, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    whole: list[int] = []
    monkeypatch.setattr(disk_sync, "_whole", whole.append)
    monkeypatch.setattr(os, "fsync", lambda _: pytest.fail("fsync leaves it in the drive's memory"))
    monkeypatch.setattr(os, "fdatasync", lambda _: pytest.fail("so does fdatasync"), raising=False)
    with (tmp_path / "file").open("wb") as stream:
        force(stream.fileno())  # type: ignore[operator]
        assert whole == [stream.fileno()]


def test_a_file_system_without_that_call_gets_the_usual_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(_: int) -> None:
        raise OSError(errno.ENOTSUP, "not supported")

    usual: list[int] = []
    monkeypatch.setattr(disk_sync, "_whole", refuse)
    monkeypatch.setattr(os, "fsync", usual.append)
    with (tmp_path / "file").open("wb") as stream:
        disk_sync.sync_data(stream.fileno())
        assert usual == [stream.fileno()]


def test_a_disk_that_fails_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(disk_sync, "_whole", fail)
    monkeypatch.setattr(os, "fsync", fail)
    with (tmp_path / "file").open("wb") as stream, pytest.raises(OSError, match="Input/output"):
        disk_sync.sync(stream.fileno())
