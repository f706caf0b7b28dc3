"""One archive of a day: each file in it is known by its digest, and the same folder gives the same bytes."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_acquisition.errors import CorruptFileError, ReadError, StoreError
from recoil_daq.handover import archive as module
from recoil_daq.handover.archive import check_archive, pack
from recoil_daq.live.output_folder import OutputFolder

FILES = {
    "0001.h5": b"a shot" * 1000, "shotlog.csv": b"shot,notes\n0001,\n", "captures/0001.rdlog": bytes(range(256)),
    "reports/0001/report.html": b"<title>", "empty": b"",
}  # fmt: skip
SHA256SUM = shutil.which("sha256sum")


@pytest.fixture
def day(tmp_path: Path) -> Path:
    for name, content in FILES.items():
        path = tmp_path / "day" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return tmp_path / "day"


def test_every_file_is_in_it_with_its_digest(day: Path) -> None:
    done = pack(day)
    assert done.archive == day.with_name("day.zip")
    assert done.files == len(FILES)
    assert done.sha256 == hashlib.sha256(done.archive.read_bytes()).hexdigest()
    with zipfile.ZipFile(done.archive) as opened:
        assert {name: opened.read(f"day/{name}") for name in FILES} == FILES
    checked = check_archive(done.archive)
    assert checked.whole
    assert {one.file: one.sha256 for one in checked.files} == {
        name: hashlib.sha256(content).hexdigest() for name, content in FILES.items()
    }


@pytest.mark.skipif(SHA256SUM is None, reason="no sha256sum here")
def test_what_is_unpacked_is_checked_by_the_usual_program(day: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(pack(day).archive) as opened:
        opened.extractall(tmp_path / "home")
    command = [str(SHA256SUM), "-c", "SHA256SUMS"]
    done = subprocess.run(command, cwd=tmp_path / "home" / "day", check=True, capture_output=True)
    assert done.stdout.count(b": OK") == len(FILES)


def test_the_same_folder_gives_the_same_bytes_whenever_it_is_packed(day: Path, tmp_path: Path) -> None:
    first = pack(day, tmp_path / "one.zip")
    again = tmp_path / "elsewhere" / "day"
    for name in reversed(FILES):
        (again / name).parent.mkdir(parents=True, exist_ok=True)
        (again / name).write_bytes(FILES[name])
        os.utime(again / name, (1e9, 1e9))
    assert pack(again, tmp_path / "two.zip").sha256 == first.sha256


@pytest.mark.parametrize("place", range(0, 3000, 97))
def test_a_byte_that_changed_is_found_wherever_it_is(place: int, day: Path) -> None:
    archive = pack(day).archive
    content = bytearray(archive.read_bytes())
    content[place * len(content) // 3000] ^= 0x20
    archive.write_bytes(content)
    try:
        whole = check_archive(archive).whole
    except CorruptFileError:
        return
    # a local header is read by nobody but for its lengths: the name that counts is that of the list at the end
    in_data = any(bytes(content).count(one) for one in FILES.values() if one)
    assert not whole or in_data


def repacked(archive: Path, change: Callable[[dict[str, bytes]], None], **how: Any) -> None:
    """Write an archive anew with other members."""
    with zipfile.ZipFile(archive) as opened:
        members = {name: opened.read(name) for name in opened.namelist()}
    change(members)
    with zipfile.ZipFile(archive, "w", **how) as into:
        for name, content in members.items():
            into.writestr(name, content)


@pytest.mark.parametrize(
    ("change", "file", "fault"),
    [
        (lambda members: members.update({"day/0001.h5": b"another"}), "0001.h5", "has another digest than when packed"),
        (lambda members: members.pop("day/0001.h5"), "0001.h5", "is missing"),
        (lambda members: members.update({"day/x.exe": b""}), "day/x.exe", "is not among those that were packed"),
    ],
)
def test_what_is_not_as_it_was_packed_is_named(
    change: Callable[[dict[str, bytes]], None], file: str, fault: str, day: Path, run: Callable[..., Result]
) -> None:
    archive = pack(day).archive
    repacked(archive, change)
    assert {one.file: one.fault for one in check_archive(archive).files if one.fault} == {file: fault}
    done = run("explain", archive, "--check")
    assert done.exit_code == 1
    assert fault in done.output


def test_another_programs_compression_is_not_unpacked_to_any_size(day: Path) -> None:
    archive = pack(day).archive
    repacked(archive, lambda members: members.update({"day/0001.h5": bytes(1 << 20)}), compression=zipfile.ZIP_DEFLATED)
    (fault,) = {one.fault for one in check_archive(archive).files if one.file == "0001.h5"}
    assert fault == "was packed by another program"


@pytest.mark.parametrize(
    "content", [b"PK\x05\x06" + bytes(18), b"not a zip", b"", b"PK\x03\x04nothing", b"PK\x03\x04" + bytes(500)]
)
def test_what_is_no_archive_of_a_day_is_refused_in_one_line(
    content: bytes, tmp_path: Path, run: Callable[..., Result]
) -> None:
    (tmp_path / "a.zip").write_bytes(content)
    done = run("explain", tmp_path / "a.zip", "--check")
    assert done.exit_code == 3
    assert "this is no archive of a day" in done.output
    assert done.output.count("\n") <= 2


def test_nothing_is_overwritten_and_nothing_left_behind(day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = day.with_name("day.zip")
    there.write_bytes(b"mine")
    with pytest.raises(StoreError, match="exists already"):
        pack(day)
    assert there.read_bytes() == b"mine"
    there.unlink()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "give_name", fail)
    with pytest.raises(StoreError, match="No space left on device"):
        pack(day)
    assert [path.name for path in day.parent.iterdir()] == ["day"]


def test_a_file_that_changes_while_it_is_packed_ends_it(day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = module._info

    def grow(name: str) -> zipfile.ZipInfo:
        if name.endswith("0001.h5"):
            with (day / "0001.h5").open("ab") as stream:
                stream.write(b"more")
            time.sleep(0.01)
        return whole(name)

    monkeypatch.setattr(module, "_info", grow)
    with pytest.raises(ReadError, match="changes while it is packed"):
        pack(day)
    assert [path.name for path in day.parent.iterdir()] == ["day"]


def test_links_and_locks_are_left_out_and_links_are_named(day: Path) -> None:
    (day / "elsewhere").symlink_to(day.parent)
    (day / ".shotlog.csv.lock").write_bytes(b"")
    (day / ".0001.h5.0123abcd.partial").write_bytes(b"half")
    done = pack(day)
    assert (done.files, done.left_out) == (len(FILES), ("elsewhere",))


def test_a_folder_without_shots_and_one_that_is_armed_are_refused(
    day: Path, tmp_path: Path, run: Callable[..., Result]
) -> None:
    (tmp_path / "notes").mkdir()
    done = run("pack", tmp_path / "notes")
    assert (done.exit_code, "no shot file and no capture" in done.output) == (3, True)
    with OutputFolder(day):
        done = run("pack", day)
    assert (done.exit_code, "a live session writes to this folder" in done.output) == (3, True)
