"""Files of an export: written beside their place, read back, compared, and only then named.

Nothing is left behind where it fails, and nothing is overwritten unasked.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import RecoilDaqError, StoreError, system_errors_as
from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import Exporter, Representation, exact_table, first_difference
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.packages.extras import EXTRAS

Progress = Callable[[str], None]


@dataclass(frozen=True)
class ExportedFile:
    """One file that was written and verified.

    Attributes
    ----------
    clocks
        Clocks of its sources.
    channels
        Names of the channels that are in the file.
    samples
        Number of samples of all channels together.
    size
        Size in bytes.
    exact
        Whether every number of every channel is that of the shot.
    losses
        Differences from the shot, of numbers or of what is stated about them, one line each.
    left_out
        Channels that the format cannot carry.
    """

    path: Path
    clocks: tuple[str, ...]
    channels: tuple[str, ...]
    samples: int
    size: int
    exact: bool
    losses: tuple[str, ...]
    left_out: tuple[str, ...]


def write_export(
    content: Content,
    exporter: Exporter,
    folder: Path,
    stem: str,
    *,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> tuple[ExportedFile, ...]:
    """Write all files of an export; they bear their names only when all of them are verified.

    Parameters
    ----------
    folder
        Folder of the files, made if it is not there.
    stem
        Beginning of the files' names; a file of one time base has the name of its group behind it.
    progress
        Function that is given the name of each file.

    Returns
    -------
    tuple of ExportedFile

    Raises
    ------
    StoreError
        If a file exists and may not be replaced, cannot be written, does not read back as it was written, or the
        format's library is missing.
    """
    parts = [(f"{stem}{exporter.suffix}", content)]
    if not exporter.single_file:
        parts = [(f"{stem}_{group.name}{exporter.suffix}", content.only([group])) for group in content.groups]
    for name, _ in parts:
        if os.path.lexists(folder / name) and not (overwrite and (folder / name).is_file()):
            raise StoreError.exists(folder / name, _OTHER)
    new_folders = [f for f in (folder, *folder.parents) if not f.exists()]
    temporaries: list[Path] = []
    written: list[tuple[Path, ExportedFile]] = []
    placed: list[Path] = []
    try:
        with system_errors_as(StoreError, folder, "written", _ROOM):
            folder.mkdir(parents=True, exist_ok=True)
            for name, part in parts:
                progress(name)
                target = folder / name
                temporary = partial_path(target, keeps_suffix=True)
                temporaries.append(temporary)
                written.append((temporary, _write(part, exporter, temporary, target)))
            for temporary, file in written:
                try:
                    give_name(temporary, file.path, overwrite=overwrite)
                except FileExistsError as error:
                    raise StoreError.exists(file.path, _OTHER) from error
                if not overwrite:
                    placed.append(file.path)
            placed.clear()
    finally:
        for left in (*temporaries, *placed):
            with contextlib.suppress(OSError):
                left.unlink(missing_ok=True)
        for empty in new_folders:
            with contextlib.suppress(OSError):
                empty.rmdir()  # refused where it holds something
    return tuple(file for _, file in written)


def _write(content: Content, exporter: Exporter, temporary: Path, target: Path) -> ExportedFile:
    """Write one file under a temporary name, which the caller removes, and verify it."""
    try:
        with system_errors_as(StoreError, target, "written", _ROOM):
            carried = exporter.carried(content)
            kept = tuple(name for table in carried.tables for name in table.samples)
            if not kept:
                raise _nothing_left(exporter, carried, target)
            exporter.write(content, temporary)
            difference = first_difference(carried.tables, exporter.read_back(content, temporary))
            size = temporary.stat().st_size
    except ImportError as error:
        raise StoreError(
            f"{exporter.name} needs {error.name or 'a library that is not installed'}", path=target,
            remedy=EXTRAS[exporter.extra].remedy if exporter.extra in EXTRAS else "install it",
        ) from error  # fmt: skip
    except StoreError:
        raise
    except RecoilDaqError as error:
        raise StoreError(f"does not read back: {error.problem}", path=target, remedy=_REMEDY) from error
    except Exception as error:
        # The libraries that write raise what they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StoreError(
            f"{exporter.name} cannot hold this: {reason}", path=target, remedy="choose another --format"
        ) from error
    if difference is not None:
        raise StoreError(f"does not read back as it was written: {difference}", path=target, remedy=_REMEDY)
    samples = sum(array.size for table in carried.tables for array in table.samples.values())
    clocks = tuple(dict.fromkeys(g.clock for g in content.groups if any(c.name in kept for c in g.channels)))
    exact = first_difference(tuple(exact_table(group) for group in content.groups), carried.tables, values_only=True)
    return ExportedFile(target, clocks, kept, samples, size, exact is None, carried.losses, carried.left_out)


def _nothing_left(exporter: Exporter, carried: Representation, target: Path) -> StoreError:
    return StoreError(
        f"{exporter.name} can carry none of these channels: {'; '.join(carried.losses)}", path=target,
        remedy="choose another --format",
    )  # fmt: skip


_REMEDY = "nothing was kept; check the disk, or choose another --format"
_ROOM = "choose another folder with --out, or make room and give permission there"


_OTHER = "choose another --out, or replace it with --overwrite"
