"""Shots that are made of the same recorded files: refused where one would be made, set aside where they are used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from recoil_acquisition.errors import RecoilDaqError, StoreError
from recoil_acquisition.shot.recorded_file import Double, RecordedFile, doubles, named_files
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import recorded_files

Others = Mapping[Path, tuple[RecordedFile, ...]]


def made_in(folder: Path) -> dict[Path, tuple[RecordedFile, ...]]:
    """Return what the shot files of a folder were made of; one that cannot be read says nothing."""
    found = {}
    for path in sorted(folder.glob("*.h5")):
        with suppress(RecoilDaqError, OSError):
            state = path.stat()
            found[path] = _recorded(path, state.st_mtime_ns, state.st_ctime_ns, state.st_size, state.st_ino)
    return found


@lru_cache(4096)
def _recorded(path: Path, *_state: int) -> tuple[RecordedFile, ...]:
    """Read what a shot file was made of, once as long as nobody changes it: a day's shots are looked at for each."""
    return recorded_files(path)


def made_of(path: Path, folder: Path) -> Path | None:
    """Return the shot file of a folder that was made of a recorded file; None if there is none."""
    one = _read(path)
    return next((shot for shot, files in made_in(folder).items() if any(one.overlaps(other) for other in files)), None)


def refusal(files: Sequence[RecordedFile], others: Others) -> StoreError | None:
    """Return why no shot is made of files, some or all of which another shot was made of; None if none was."""
    for path, made_of in others.items():
        double = Double.between(files, made_of, str(path))
        if double is None:
            continue
        names = named_files(double.files)
        if double.whole:
            return StoreError(
                f"these files are in {path} already", found=names,
                remedy=f"there is nothing to do; to make that shot anew, give --shot {path.stem} --overwrite",
            )  # fmt: skip
        are, them = ("are", "them") if len(double.files) > 1 else ("is", "it")
        return StoreError(
            f"{names} {are} in {path} already: shot {path.stem} was made of {them}",
            remedy=f"give this shot's own; if shot {path.stem} has another's, ingest it anew first, with --overwrite",
        )  # fmt: skip
    return None


def refused_twice(shots: Mapping[str, Sequence[Path]], folder: Path, *, overwrite: bool) -> dict[str, RecoilDaqError]:
    """Say of which shots no shot file is made, because of another shot with the same files.

    A file is read only if there is another one of its size.

    Parameters
    ----------
    shots
        Files of each shot that is to be made, by its name.
    folder
        Folder in which the shot files would be made.
    overwrite
        Whether shot files there of these names are replaced: the files that they were made of do not count then.
    """
    replaced = {folder / f"{name}.h5" for name in shots} if overwrite else set()
    there = {path: files for path, files in made_in(folder).items() if path not in replaced}
    sizes = {path: path.stat().st_size for files in shots.values() for path in files}
    times = Counter([*sizes.values(), *(one.size for files in there.values() for one in files)])
    read = {path: _read(path) for path, size in sizes.items() if times[size] > 1}
    found: dict[str, RecoilDaqError] = {}
    before: dict[Path, tuple[RecordedFile, ...]] = {}
    for name, files in shots.items():
        target = folder / f"{name}.h5"
        # a file whose size no other has is no other's
        of_shot = [read.get(path) or RecordedFile(path.name, str(path), sizes[path]) for path in files]
        if fault := refusal(of_shot, {path: one for path, one in there.items() if path != target} | before):
            found[name] = fault
        else:
            before[target] = tuple(of_shot)
    return found


def _read(path: Path) -> RecordedFile:
    one = InputFile.of(path)
    return RecordedFile(one.name, one.sha256, one.size)


def set_aside(paths: Sequence[Path], named: Sequence[Path] = ()) -> dict[Path, Double]:
    """Return which shot files are made of recorded files of one before them.

    Parameters
    ----------
    paths
        Shot files.
    named
        Shot files that are wanted whatever they are made of: those that were not found in a folder.
    """
    asked = [*(path for path in paths if path in named), *(path for path in paths if path not in named)]
    return {
        asked[place]: double
        for place, double in doubles(_made_of(asked)).items()
        if asked[place] not in named
    }  # fmt: skip


def _made_of(paths: Sequence[Path]) -> Iterator[tuple[str, tuple[RecordedFile, ...]]]:
    """Yield shot files with what they were made of; whoever reads one as a whole says what is wrong with it."""
    for path in paths:
        try:
            yield str(path), recorded_files(path)
        except RecoilDaqError:
            yield str(path), ()
