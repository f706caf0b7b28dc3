"""What somebody names is opened only if it is a file: pipes, devices, sockets and folders are refused at once."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.regular_file import open_regular, read_small, require_name
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, READERS, recognise
from recoil_acquisition.store import is_shot_file, read_shot
from recoil_daq.recording.ingest import reader_of
from recoil_rigs.rig import load_rig

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")


@pytest.fixture(params=["pipe", "device", "socket", "directory"])
def special(request, tmp_path: Path) -> tuple[str, Path]:
    path = tmp_path / "special"
    if request.param == "directory":
        path.mkdir()
    elif sys.platform == "win32":
        pytest.skip("Windows has no such files")
    elif request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "device":
        path.symlink_to("/dev/zero")
    else:
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(str(path))
    return request.param, path


def test_what_is_no_file_is_refused_wherever_it_is_named(special: tuple[str, Path]) -> None:
    kind, path = special
    for named in (open_regular, recognise, load_rig, lambda path: reader_of(path, None)):
        with pytest.raises(ReadError, match=f"this is a {kind}"):
            named(path)
    with pytest.raises(StoreError, match=f"this is a {kind}"):
        read_shot(path)
    assert not is_shot_file(path)


def test_no_reader_waits_for_what_is_no_file(special: tuple[str, Path]) -> None:
    kind, path = special
    for reader in (*READERS, *BY_LAYOUT.values()):
        with pytest.raises(ReadError, match=f"this is a {kind}|extra"):
            reader.open(path, Declarations("clock"))


@posix
def test_a_link_to_a_file_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    with open_regular(tmp_path / "link") as file:
        assert file.read() == b"abc"


@pytest.mark.parametrize("name", ["none", "a\0b"])
def test_what_is_not_there_is_told(tmp_path: Path, name: str) -> None:
    with pytest.raises(ReadError, match="no such file"):
        open_regular(tmp_path / name)


def test_a_small_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    (tmp_path / "small").write_bytes(b"0123456789")
    assert read_small(tmp_path / "small", 10, "a note") == b"0123456789"
    with pytest.raises(ReadError, match="too large; expected a note of at most"):
        read_small(tmp_path / "small", 9, "a note")


@posix
def test_a_sparse_file_of_any_size_is_refused_by_its_beginning(tmp_path: Path) -> None:
    with (tmp_path / "rig.toml").open("wb") as file:
        file.truncate(1 << 25)
    with pytest.raises(ReadError, match="expected a rig file of at most 1 MB"):
        load_rig(tmp_path / "rig.toml")
    os.truncate(tmp_path / "rig.toml", 1 << 36)
    with pytest.raises(ReadError, match="most of the file was never written"):
        load_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("name", ["../a.csv", "/etc/passwd", "a/b.csv", "..", "", "n" * 300])
def test_what_a_document_calls_a_file_is_a_name_alone(name: str) -> None:
    require_name("12:30 a.csv")
    with pytest.raises(ValueError, match="which is no name of one"):
        require_name(name)
