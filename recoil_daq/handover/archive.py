"""One archive of a day, with the digest of each file in it: to carry home, to keep, and to be checked there.

A ZIP file whose members are stored as they are, in the order of their names and without times: the same folder gives
the same bytes on every computer, and damage costs the file that it is in. ``SHA256SUMS`` in it is what ``sha256sum -c``
checks after it is unpacked.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import zipfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import CorruptFileError, ReadError, StoreError, visible
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_daq.handover.day_files import DayFiles
from recoil_daq.terminal.result import Printed, Progress

SUMS = "SHA256SUMS"
_DIGEST = re.compile(r"[0-9a-f]{64}")
_GAP = "  "
"""Blanks between digest and name, as ``sha256sum`` writes them."""
_PIECE = 1 << 20
_LARGEST_SUMS = 1 << 26
_BEGINNING = (1980, 1, 1, 0, 0, 0)
_MODE = 0o100644 << 16


@dataclass(frozen=True, repr=False)
class Packed(Printed):
    """An archive that was packed.

    Attributes
    ----------
    sha256
        Digest of the archive itself.
    files, size_bytes
        Number of files in it, and their size together.
    left_out
        Links and other things in the folder that are no regular files.
    """

    archive: Path
    sha256: str
    files: int
    size_bytes: int
    left_out: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the document that ``pack --json`` prints."""
        return {"schema": "recoil-daq/pack/1", **asdict(self), "archive": str(self.archive)}

    def show(self) -> None:
        """Print what is in it and how it is checked."""
        from recoil_daq.terminal.handover import print_packed

        print_packed(self.to_json())


def pack(folder: str | Path, out: str | Path | None = None, *, progress: Progress = lambda _: None) -> Packed:
    """Pack all files of a day into one archive.

    Parameters
    ----------
    folder
        Folder of the shot files.
    out
        Archive; beside the folder, with its name, if left out.
    progress
        Function called with how much is packed.

    Raises
    ------
    ReadError
        If there is no such folder, no shot in it, or a file changes while it is packed.
    StoreError
        If the archive is there already, or cannot be written; nothing of it is left then.
    """
    place = Path(folder).resolve()
    archive = place.with_name(f"{place.name}.zip") if out is None else Path(out)
    found = DayFiles.of(Path(folder))
    if archive.exists():
        raise StoreError.exists(archive, "give another --out, or remove it", "the archive")
    inside = archive.resolve().is_relative_to(place)
    partial = partial_path(archive)
    sums, total = [], sum(path.stat().st_size for path in found.files)
    try:
        with zipfile.ZipFile(partial, "x") as into:
            done = 0
            for path in found.files:
                name = path.relative_to(found.folder).as_posix()
                sha256, size = _add(into, path, f"{place.name}/{name}")
                sums.append(f"{sha256}{_GAP}{name}")
                done += size
                progress(f"{done / 1e6:.0f} of {total / 1e6:.0f} MB")
            into.writestr(_info(f"{place.name}/{SUMS}"), "".join(f"{line}\n" for line in sums))
        sha256 = _digest(partial)
        give_name(partial, archive)
    except FileExistsError:
        raise StoreError.exists(archive, "give another --out, or remove it", "the archive") from None
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror or error}",
            path=archive,
            remedy="check space and permissions, or choose --out" + (" outside of the folder" if inside else ""),
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
    left_out = tuple(path.relative_to(found.folder).as_posix() for path in found.left_out)
    return Packed(archive, sha256, len(found.files), total, left_out)


def _add(into: zipfile.ZipFile, path: Path, name: str) -> tuple[str, int]:
    """Store a file; return its digest and its size. ReadError if it cannot be read, or changes meanwhile."""
    digest, size = hashlib.sha256(), 0
    try:
        stream = path.open("rb")
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror or error}", path=path) from error
    with stream:
        before = os.fstat(stream.fileno())
        info = _info(name)
        info.file_size = before.st_size
        with into.open(info, "w") as member:
            while True:
                try:
                    piece = stream.read(_PIECE)
                except OSError as error:
                    raise ReadError(f"cannot be read: {error.strerror or error}", path=path) from error
                if not piece:
                    break
                digest.update(piece)
                size += len(piece)
                if size > before.st_size:
                    break
                member.write(piece)
        after = path.stat()
    if size != before.st_size or (after.st_mtime_ns, after.st_size) != (before.st_mtime_ns, before.st_size):
        raise ReadError("changes while it is packed", path=path, remedy="end what writes it, and pack again")
    return digest.hexdigest(), size


def _info(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _BEGINNING)
    info.create_system, info.external_attr = 3, _MODE
    return info


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True)
class CheckedFile:
    """File of an archive.

    Attributes
    ----------
    fault
        Sentence on what is wrong with it; empty if it is as it was packed.
    """

    file: str
    sha256: str
    size_bytes: int
    fault: str = ""


@dataclass(frozen=True, repr=False)
class CheckedArchive(Printed):
    """An archive whose files were compared with their digests."""

    archive: Path
    files: tuple[CheckedFile, ...]

    @property
    def whole(self) -> bool:
        """Whether every file is there as it was packed, and no other."""
        return not any(one.fault for one in self.files)

    def to_json(self) -> dict[str, Any]:
        """Return the document that ``explain --check --json`` prints of an archive."""
        files = [{**asdict(one), "fault": one.fault or None} for one in self.files]
        document = {"schema": "recoil-daq/explain-archive/1", "archive": str(self.archive)}
        return {**document, "whole": self.whole, "files": files}

    def show(self) -> None:
        """Print what is not as it was packed, and how many files are."""
        from recoil_daq.terminal.handover import print_checked_archive

        print_checked_archive(self.to_json())


def is_archive(path: Path) -> bool:
    """Return whether a file is a ZIP archive by its name or its beginning: one that is spoilt at once is one, too."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            return path.suffix.lower() == ".zip" or stream.read(4) in (b"PK\x03\x04", b"PK\x05\x06")
    except OSError:
        return False


def check_archive(path: Path, *, progress: Progress = lambda _: None) -> CheckedArchive:
    """Compare each file of an archive with its digest.

    Raises
    ------
    CorruptFileError
        If it is no archive that `pack` made, or its list of digests is damaged.
    ReadError
        If it cannot be read.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return CheckedArchive(path, tuple(_checked(archive, path, progress)))
    except (zipfile.BadZipFile, EOFError, NotImplementedError, ValueError, RuntimeError) as error:
        raise _no_archive(path, str(error)) from error
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror or error}", path=path) from error


def _checked(archive: zipfile.ZipFile, path: Path, progress: Progress) -> Iterator[CheckedFile]:
    members = {info.filename: info for info in archive.infolist()}
    lists = [name for name in members if re.fullmatch(rf"[^/]+/{SUMS}", name)]
    if len(lists) != 1 or len(members) != len(archive.infolist()) or members[lists[0]].file_size > _LARGEST_SUMS:
        raise _no_archive(path, f"{len(lists)} lists {SUMS}")
    top = lists[0].removesuffix(SUMS)
    stated: dict[str, str] = {}
    for line in archive.read(lists[0]).decode().splitlines():
        sha256, _, name = line.partition(_GAP)
        if not name or _DIGEST.fullmatch(sha256) is None:
            raise _no_archive(path, f"a line of {SUMS} that states no digest")
        stated[name] = sha256
    for number, (name, sha256) in enumerate(stated.items(), 1):
        progress(f"{number} of {len(stated)} files")
        yield _file(archive, members.get(f"{top}{name}"), name, sha256)
    for name, info in members.items():
        if name != lists[0] and name.removeprefix(top) not in stated:
            yield CheckedFile(visible(name), "", info.file_size, "is not among those that were packed")


def _file(archive: zipfile.ZipFile, info: zipfile.ZipInfo | None, name: str, sha256: str) -> CheckedFile:
    if info is None:
        return CheckedFile(visible(name), sha256, 0, "is missing")
    if info.compress_type != zipfile.ZIP_STORED:  # as packed; else a small member may hold any amount
        return CheckedFile(visible(name), sha256, info.file_size, "was packed by another program")
    digest = hashlib.sha256()
    try:
        with archive.open(info) as member:
            while piece := member.read(_PIECE):
                digest.update(piece)
    except (zipfile.BadZipFile, EOFError, ValueError) as error:
        return CheckedFile(visible(name), sha256, info.file_size, f"is damaged: {error}")
    same = digest.hexdigest() == sha256
    return CheckedFile(visible(name), sha256, info.file_size, "" if same else "has another digest than when packed")


def _no_archive(path: Path, found: str) -> CorruptFileError:
    return CorruptFileError(
        "this is no archive of a day", path=path, expected="a file that `recoil-daq pack` made", found=found,
        remedy="copy it again",
    )  # fmt: skip
