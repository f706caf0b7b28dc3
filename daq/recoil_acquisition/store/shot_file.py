"""The shot file: one firing in one HDF5 file, written whole or not at all.

Where each value stands in the file is described in `recoil_acquisition.store.layout`. A shot file is made in
memory, written under a temporary name beside its own, forced to the disk, read back, compared with
the shot bit for bit (`first_difference`), and only then renamed. A reader never meets half a file under the final name.
`shot_summary` reads headers and small tables alone.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakValueDictionary

from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import ReadError, StoreError, system_errors_as
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.files.regular_file import FileState, read_beginning, state_of
from recoil_acquisition.files.shot_name import check_shot_name
from recoil_acquisition.processes.reader_process import EXPANSION, READER, SPARE_BYTES
from recoil_acquisition.readers.hdf5.kind import SIGNATURE
from recoil_acquisition.shot.acquisition import AT_TRIGGER
from recoil_acquisition.shot.causes import Subject, reasons_of, shot_findings
from recoil_acquisition.shot.recorded_file import RecordedFile
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.shot.usability import Usability, usability
from recoil_acquisition.store.channel_layout import signals_of, time_groups
from recoil_acquisition.store.file_tree import Group, last_word, tree_of
from recoil_acquisition.store.layout import (
    ENTRY_NAMES,
    SCHEMA,
    read_acquisition_of,
    read_against_mass,
    read_alignments,
    read_clock_fits,
    read_history,
    read_inputs,
    read_layout,
    read_quality,
    read_started,
    write_layout,
)
from recoil_acquisition.store.seal import SEAL
from recoil_acquisition.store.table import finite, json_text, read_text


def first_difference(one: Shot, other: Shot) -> str | None:
    """Name the first value in which two shots differ, samples compared bit for bit; None if there is none."""
    both = zip(_values(one), _values(other), strict=False)  # the names of the channels come before them
    return next((name for (name, value), (_, its) in both if value != its), None)


def _values(shot: Shot) -> Iterator[tuple[str, Any]]:
    """Yield all that a shot states, each with its name; what may hold NaN, which must equal itself, as text."""
    for name in ("name", "rig_name", "rig_text", "reference_clock", "inputs", "quality", "started", "started_source"):
        yield name, getattr(shot, name)
    yield "acquisition", shot.acquisition
    yield "databases", None if shot.databases is None else dict(shot.databases)
    yield "against_mass", [reason.to_json() for reason in shot.against_mass]
    yield "clock_fits", [(clock, json_text(fit)) for clock, fit in shot.clock_fits.items()]
    yield "history", _history(shot)
    yield (
        "alignments",
        [
            json_text([a.clock, *map(float, (a.offset_s, a.u_offset_s, a.drift, a.u_drift)), a.status, a.method])
            + json_text([list(a.reasons), a.details])
            for a in shot.alignments
        ],
    )
    yield "names of the channels", list(shot.channels)
    for name, channel in shot.channels.items():
        base, raw, of = channel.time_base, channel.raw, f"of channel {name!r}"
        yield f"samples {of}", _bits(channel.samples)
        stamps = None if base.stamps_s is None else _bits(base.stamps_s)
        yield f"time base {of}", (base.clock, base.start_s, base.step_s, base.count, base.absolute_start, stamps)
        yield f"raw counts {of}", None if raw is None else (raw.gain, raw.offset, raw.unit, _bits(raw.counts))
        for key in ("quantity", "signal", "role", "u_rel", "resolution"):
            yield f"{key} {of}", getattr(channel, key)
        yield f"history {of}", _history(channel)


def _bits(values: NDArray[Any]) -> tuple[str, tuple[int, ...], bytes]:
    """Return what differs wherever a bit does: NaN equals itself, and 0.0 does not equal -0.0."""
    return values.dtype.str, values.shape, values.tobytes()


def _history(value: Shot | Channel) -> list[tuple[str, str, str]]:
    return [(step.what, step.version, json_text(step.parameters)) for step in value.history]


def summarise_layout(file: Any) -> dict[str, Any]:
    """Say what is in an open shot file in JSON types; only headers and small tables are read.

    Raises
    ------
    KeyError, ValueError, TypeError, OSError
        As `read_layout`.
    """
    entry = file["entry"]
    name = read_text(entry, "entry_identifier")
    check_shot_name(name)
    channels = [
        (int(signal.attrs["order"]), _channel_summary(signal.attrs, group["time"].attrs, int(signal.shape[0])))
        for _, group in time_groups(entry, ENTRY_NAMES)
        for _, signal in signals_of(group)
    ]
    quality = read_quality(entry)
    acquisition = read_acquisition_of(entry)
    started, source = read_started(entry)
    if not started and acquisition is not None:
        started, source = acquisition.trigger_utc, AT_TRIGGER
    against_mass = read_against_mass(entry)
    rows = [row for _, row in sorted(channels, key=lambda placed: placed[0])]
    subjects = [Subject(row["name"], row["role"], row["clock"], row["quantity"]) for row in rows]
    state = usability([check for check in quality if check.verdict == "fail"], against_mass)
    return {
        "schema": SCHEMA,
        "shot": name,
        "rig": read_text(entry["rig"], "name"),
        "reference_clock": read_text(entry["rig"], "reference_clock"),
        "started": started or None,
        "started_source": source or None,
        "usable": state is Usability.USABLE,
        "state": state.value,
        "reasons": list(reasons_of(quality, against_mass, subjects)),
        "findings": shot_findings(quality, against_mass, subjects),
        "channels": rows,
        "alignments": [a.to_json() for a in read_alignments(entry)],
        "quality": [c.to_json() for c in quality],
        "inputs": [
            {"file": i.name, "sha256": i.sha256, "size": i.size, "source": i.source, "reader": i.reader}
            for i in read_inputs(entry)
        ],
        "acquisition": None if acquisition is None else json.loads(json_text(acquisition.to_json())),
        "clock_fits": finite(read_clock_fits(entry)),
    }


def _channel_summary(signal: Any, time: Any, count: int) -> dict[str, Any]:
    return {
        "name": str(signal["channel"]),
        "quantity": str(signal["quantity"]),
        "unit": str(signal["units"]),
        "role": str(signal["role"]),
        "clock": str(signal["clock"]),
        "signal": str(signal["source_signal"]),
        "count": count,
        "lost": int(signal["lost"]),
        "rate_hz": finite(float(time["rate_hz"])),
        "start_s": finite(float(time["start_s"])),
        "end_s": finite(float(time["end_s"])),
        "u_rel": finite(float(signal["u_rel"])),
    }


Found = TypeVar("Found")

_HELD: WeakValueDictionary[FileState, Shot] = WeakValueDictionary()
"""Shots that this process wrote, read back and still holds, by their files as they were then."""


def _held(path: Path) -> Shot | None:
    """Return the shot of a file that this process wrote and nobody changed since, where it is still held."""
    try:
        return _HELD.get(state_of(path)) if _HELD else None
    except OSError:
        return None


def write_shot(shot: Shot, path: Path, *, overwrite: bool = False) -> Shot:
    """Write a shot file; it bears its final name only when it is complete and verified.

    Parameters
    ----------
    path
        The file; folders that are missing on the way are made.
    overwrite
        Whether a file of that name may be replaced.

    Returns
    -------
    Shot
        Shot as it was read back. As long as somebody holds it, and nobody changes the file, it is not read again.

    Raises
    ------
    StoreError
        If the file exists and may not be replaced, cannot be written, or does not read back as
        it was written. Nothing of it is left then.
    TypeError
        If a history parameter, an alignment detail or a clock fit is not of a JSON type.
    """
    path = Path(path)
    if not overwrite and os.path.lexists(path):
        raise StoreError.exists(path, _OTHER_NAME)
    if path.is_dir():
        raise StoreError("this is a folder", path=path, expected="the name of a shot file")
    image = _image(shot, path)
    temporary = partial_path(path)
    remedy = "choose another folder with --out, or make room and give permission there"
    try:
        with system_errors_as(StoreError, path, "written", remedy):
            path.parent.mkdir(parents=True, exist_ok=True)
            _write(image, temporary)
            back = _verify(shot, temporary, path)
            try:
                give_name(temporary, path, overwrite=overwrite)
            except FileExistsError as error:
                raise StoreError.exists(path, _OTHER_NAME) from error
    finally:
        # After a rename there is nothing left to remove; a disk that refuses this too has been reported
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        _HELD[state_of(path)] = back
    return back


def read_shot(path: str | Path) -> Shot:
    """Read a shot file: the exact shot that was written.

    Raises
    ------
    StoreError
        If there is no such file, or it is not a complete and undamaged shot file.
    """
    if (held := _held(Path(path))) is not None:
        return held
    return _unchanged(Path(path), "all", read_layout)


def shot_summary(path: Path) -> dict[str, Any]:
    """Say what is in a shot file, without reading its samples.

    Returns
    -------
    dict
        Summary in JSON types only: ``shot``, ``rig``, ``started`` and ``started_source`` (None if unknown),
        ``reference_clock``, ``usable``, ``state``, ``reasons``, ``findings``, and lists of ``channels`` (name,
        quantity, unit, role, clock, signal, count, lost, rate_hz, start_s, end_s, u_rel), ``alignments``, ``quality``
        and ``inputs``; ``acquisition`` (None if the shot was not acquired live) and ``clock_fits`` (by source). A
        number that is not finite is None.

    Raises
    ------
    StoreError
        As `read_shot`.
    """
    return _unchanged(Path(path), "headers", summarise_layout)


def shot_file_of(path: Path) -> InputFile:
    """Describe a shot file for the provenance of what is made of it, with the seal that it bears.

    Raises
    ------
    StoreError
        If it is no shot file.
    ReadError
        If it cannot be read to its end.
    """
    return replace(InputFile.of(path), seal=str(_asked(path, "schema").attrs.get(SEAL, "")))


def recorded_files(path: Path) -> tuple[RecordedFile, ...]:
    """Say which recorded files a shot file was made of, reading nothing else of it; StoreError as `read_shot`."""
    if (held := _held(Path(path))) is not None:
        return RecordedFile.of_shot(held.inputs, held.history)
    with _map_to_store_error(Path(path)):
        entry = _tree(Path(path), "origin")["entry"]
        return RecordedFile.of_shot(read_inputs(entry), read_history(entry))


def is_shot_file(path: Path) -> bool:
    """Return whether a file is a shot file of any version, or HDF5 that is damaged beyond telling.

    Parameters
    ----------
    path
        File of any kind; one that cannot be read is none.
    """
    try:
        if read_beginning(Path(path), len(SIGNATURE)) != SIGNATURE:
            return False
    except ReadError:
        return False
    try:
        schema = _asked(Path(path), "schema").attrs.get("schema")
    except StoreError:
        return True
    return str(schema).startswith(SCHEMA.rpartition("/")[0])


def _image(shot: Shot, path: Path) -> bytes:
    """Make the whole file in memory, so that a full disk is an error of one plain write."""
    image = _packed(shot, path, compressed=True)
    if _content_bytes(shot) > EXPANSION * len(image) + SPARE_BYTES // 2:
        # such a file would be refused as one that expands without bounds
        return _packed(shot, path, compressed=False)
    return image


def _content_bytes(shot: Shot) -> int:
    channels = shot.channels.values()
    counts = sum(channel.raw.counts.nbytes for channel in channels if channel.raw is not None)
    return counts + sum(channel.samples.nbytes + 8 * channel.time_base.count for channel in channels)


def _packed(shot: Shot, path: Path, *, compressed: bool) -> bytes:
    import h5py

    try:
        # The name goes nowhere: the core driver without a backing store keeps the file in memory
        with h5py.File("shot", "w", driver="core", backing_store=False) as file:
            write_layout(file, shot, compressed=compressed)
            file.flush()
            image: bytes = file.id.get_file_image()
    except (ValueError, UnicodeError) as error:
        raise StoreError(f"holds a value that HDF5 cannot store: {error}", path=path) from error
    return image


def _write(image: bytes, path: Path) -> None:
    with path.open("xb") as stream:
        stream.write(image)


def _verify(shot: Shot, temporary: Path, path: Path) -> Shot:
    remedy = "nothing was kept; check the disk and write it again"
    try:
        # written by this very process, which need not fear it
        back = _unchanged(temporary, "all", read_layout, own=True)
        difference = first_difference(shot, back)
    except StoreError as error:
        raise StoreError(f"does not read back: {error.problem}", path=path, remedy=remedy) from error
    if difference is not None:
        raise StoreError(f"does not read back as it was written: {difference}", path=path, remedy=remedy)
    return back


_OTHER_NAME = "choose another name, or replace it with --overwrite"


def _unchanged(path: Path, what: str, make: Callable[[Group], Found], *, own: bool = False) -> Found:
    """Make something of the tree of a file, and refuse it if the file was changed since: what is wrong comes first."""
    with _map_to_store_error(path):
        tree = _tree(path, what, own=own)
        found = make(tree)
        if tree.changed:
            raise ValueError(tree.changed)
        return found


def _tree(path: Path, what: str, *, own: bool = False) -> Group:
    """Read the tree of a file that claims to be a shot file; ``what`` as for `store.file_tree.write_tree`."""
    expected = f"a shot file, {SCHEMA}"
    try:
        head = read_beginning(path, len(SIGNATURE))
    except ReadError as error:
        raise StoreError(error.problem, path=path, expected=expected) from error
    if head != SIGNATURE:
        found = "an empty file" if not head else f"a file that begins with {head!r}"
        raise StoreError("this is not an HDF5 file", path=path, expected=expected, found=found)
    tree = _asked(path, what, own=own)
    schema = tree.attrs.get("schema")
    if schema != SCHEMA:
        found = "HDF5 of something else" if schema is None else f"schema {schema!r}"
        raise StoreError("this is not a shot file of this version", path=path, expected=expected, found=found)
    if tree.attrs.get("complete") != 1:
        raise StoreError("this shot file was never completed", path=path, remedy="ingest the shot again")
    return tree


def _asked(path: Path, what: str, *, own: bool = False) -> Group:
    """Let a file be read: in the process that is there for it, or in this one if it is its own."""
    with _map_to_store_error(path):
        if own:
            from recoil_acquisition.store.file_tree import write_tree

            answer, fault = bytearray(), ""
            write_tree(path, what, answer.extend)
        else:
            answer, fault = READER.ask(path, what, path.stat().st_size)
        word = {} if fault else last_word(answer)
        if fault := fault or word.get("fault", ""):
            raise ValueError(fault)
        return tree_of(answer, word.get("changed", ""))


@contextlib.contextmanager
def _map_to_store_error(path: Path) -> Iterator[None]:
    """Map everything that the content of a shot file can cause to `StoreError`."""
    try:
        yield
    except (
        OSError,
        LookupError,
        ValueError,
        TypeError,
        AttributeError,
        ArithmeticError,
        RuntimeError,
        MemoryError,
    ) as error:
        reason = " ".join(str(error.args[0] if isinstance(error, KeyError) and error.args else error).split())
        raise StoreError(
            f"is damaged: {reason}", path=path, expected=f"a shot file, {SCHEMA}",
            remedy="restore it from a copy, or ingest the shot again",
        ) from error  # fmt: skip
