"""Universal Files: time responses of datasets 58 and 58b.

Read here and not by pyuff, which reads every sample with every header, loses signs beyond ASCII in
units, and stops at blank lines and at exponents written with D.

Layout: University of Cincinnati, SDRL, *Universal File Formats*, file type 58, "Function at Nodal
DOF": a line ``-1``, the type, eleven lines of fixed columns, the values, a line ``-1``. In ``58b``
the values are binary and the type's line states byte order, floating point format and length.
"""

from __future__ import annotations

import mmap
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import StoredTime, resolution_of, selected, time_from_stamps
from recoil_acquisition.readers.containers.time_axis import axis_unit_s
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import Statements, statements_in
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.readers.text.dewesoft_time import is_absolute, parse_dewesoft_stamp
from recoil_acquisition.readers.time.wall_clock import DateOrder, about_unread_start, is_dated, parse_wall_clock
from recoil_acquisition.readers.uff.printed import printed_numbers
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark

HEADER_LINES = 11
MOST_HEADER_BYTES = 4096
MOST_DATASETS = 20_000
IEEE = 2
SINGLE, DOUBLE = 2, 4
"""Ordinate types of real numbers; 5 and 6 are complex."""
TIME_RESPONSE, TIME = 1, 17
FUNCTIONS = {
    0: "a general function", 2: "an auto spectrum", 3: "a cross spectrum", 4: "a frequency response",
    5: "a transmissibility", 6: "a coherence", 7: "an auto correlation", 8: "a cross correlation",
    9: "a power spectral density", 12: "a spectrum",
}  # fmt: skip

_BEGIN = re.compile(rb"[ \t\r\n]*-1[ \t]*\r?\n[ \t]*(\d{1,5})[ \t]*(b?)([^\r\n]*)\r?\n")
_END = re.compile(rb"^[ \t]*-1[ \t]*\r?$", re.MULTILINE)
_END_HERE = re.compile(rb"[ \t\r\n]*-1[ \t]*(?=\r|\n|\Z)")

PRINTED_DIGITS = 6
"""Digits of the abscissa's start and step in the header (format E13.5)."""
_DATE_LINE = 2
"""Index of the line, among a dataset's five of identification, that begins by convention with date and time."""


@dataclass(frozen=True)
class UffDataset:
    """One dataset of type 58.

    Attributes
    ----------
    at, data_at, data_end
        Bytes where the dataset begins, and where its values begin and end.
    lines
        Lines of its header, eleven.
    ordinate
        Type of the values, `SINGLE` or `DOUBLE`, or a complex one.
    start, step
        First and step of an even abscissa, in its unit.
    abscissa_label, abscissa_unit, unit, label
        Labels and units of the abscissa and of the values; empty for ``NONE``.
    """

    at: int
    data_at: int
    data_end: int
    binary: bool
    big_endian: bool
    lines: tuple[str, ...]
    function: int
    entity: str
    node: int
    direction: int
    ordinate: int
    count: int
    even: bool
    start: float
    step: float
    abscissa_kind: int
    abscissa_label: str
    abscissa_unit: str
    label: str
    unit: str
    stated_bytes: int


@dataclass(frozen=True)
class UnreadPart:
    """A part of a file that is not read, in words, and whether that shows that the file was cut off."""

    text: str
    is_cut: bool = False


def iter_datasets(data: bytes, size: int) -> Iterator[UffDataset | UnreadPart]:
    """Walk the datasets of a mapped file.

    Raises
    ------
    ValueError
        If a header contradicts itself, with the byte.
    """
    at = walked = 0
    while at < size:
        walked += 1
        if walked > MOST_DATASETS:
            raise ValueError(f"more than {MOST_DATASETS} datasets")
        begin = _BEGIN.match(data, at)
        if begin is None:
            rest = data[at : at + 4096].strip()
            if rest and not rest.strip(b"\0"):
                yield UnreadPart(f"NUL bytes stand behind byte {at}: power or the disk failed", is_cut=True)
            elif rest:
                yield UnreadPart(f"what begins at byte {at} is no dataset", is_cut=True)
            return
        number, binary, rest = int(begin[1]), begin[2] == b"b", begin[3]
        if number != 58:
            end = _END.search(data, begin.end())
            text = f"dataset {number} at byte {at}" if end else f"dataset {number} is cut"
            yield UnreadPart(text, is_cut=end is None)
        else:
            found = _function(data, size, at, begin.end(), binary, rest)
            yield found
            end = _END_HERE.match(data, found.data_end) if isinstance(found, UffDataset) else None
        if end is None:
            return
        at = end.end()


def _function(data: bytes, size: int, at: int, head_at: int, binary: bool, rest: bytes) -> UffDataset | UnreadPart:
    cut = UnreadPart(f"the dataset at byte {at} is cut off", is_cut=True)
    lines, data_at = [], head_at
    for _ in range(HEADER_LINES):
        end = data.find(b"\n", data_at, min(size, head_at + MOST_HEADER_BYTES))
        if end < 0:
            return cut
        lines.append(_text(data[data_at:end]))
        data_at = end + 1
    try:
        ordinate, count, spacing, start, step = _form(lines[6])
        function, kind = int(lines[5][:5]), int(lines[7][:10])
        node, direction = int(lines[5][41:51] or 0), int(lines[5][51:55] or 0)
        form = [int(field) for field in rest.split()[:4]] if binary else []
    except ValueError as error:
        raise ValueError(f"the header of the dataset at byte {at} is damaged: {error}") from error
    if binary and (len(form) < 4 or form[0] not in (1, 2) or form[1] != IEEE):
        return UnreadPart(f"the dataset at byte {at} is not in IEEE floating point ({form[:2]}): no more is read")
    if not 0 < count <= size:
        raise ValueError(f"the dataset at byte {at} states {count} values in a file of {size} bytes")
    if binary:
        ends = [data_at + width * count for width in _widths(ordinate, spacing == 1)]
        closed = [end for end in ends if end <= size and _END_HERE.match(data, end)]
        if not closed:
            return cut
        data_end = closed[0]
    else:
        closing = _END.search(data, data_at)
        if closing is None:
            return cut
        data_end = closing.start()
    return UffDataset(
        at, data_at, data_end, binary, bool(binary and form[0] == 2), tuple(lines), function,
        _name(lines[5][31:41]), node, direction, ordinate, count, spacing == 1, start, step, kind,
        _name(lines[7][26:46]), _name(lines[7][47:67]), _name(lines[8][26:46]), _name(lines[8][47:67]),
        form[3] if binary else 0,
    )  # fmt: skip


def _form(line: str) -> tuple[int, int, int, float, float]:
    """Read the line of the values' form: type, number, spacing, start and step of the abscissa."""
    try:
        return _form_of(line.split()[:5])
    except ValueError:  # of fields that touch only their columns tell where each ends
        return _form_of([line[at:end] for at, end in pairwise((0, 10, 20, 30, 43, 56))])


def _form_of(fields: Sequence[str]) -> tuple[int, int, int, float, float]:
    ordinate, count, spacing, *abscissa = fields
    start, step = (float(field.replace("D", "E").replace("d", "e")) for field in abscissa)
    return int(ordinate), int(count), int(spacing), start, step


def _widths(ordinate: int, even: bool) -> tuple[int, ...]:
    """Return the bytes that one value may take; writers differ in the type of an uneven abscissa."""
    if even:
        return {2: (4,), 4: (8,), 5: (8,), 6: (16,)}.get(ordinate, ())
    return {2: (8,), 4: (16, 12), 5: (12,), 6: (24, 20)}.get(ordinate, ())


def _text(line: bytes) -> str:
    """Decode a line; the format is ASCII, and programs put UTF-8 or Latin-1 into it."""
    try:
        return line.rstrip(b"\r").decode("utf-8")
    except UnicodeDecodeError:
        return line.rstrip(b"\r").decode("latin-1")


def _name(text: str) -> str:
    stripped = text.strip()
    return "" if stripped.upper() == "NONE" else stripped


class UffReader:
    """Reader of Universal Files, dataset 58."""

    name = "UFF 58"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; uneven abscissas are read, samples are not.

        Raises
        ------
        ReadError
            If it holds no time response.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a whole Universal File"):
            with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                # A map is searched and cut as bytes are
                found = list(iter_datasets(data, len(data)))  # type: ignore[arg-type]
            if found and isinstance(found[0], UnreadPart) and found[0].is_cut:
                raise CorruptFileError("no whole dataset", path=path, found=found[0].text, remedy="export it again")
            return _recording(path, found, declared.clock)


def _recording(path: Path, found: list[UffDataset | UnreadPart], clock: str) -> Recording:
    notes: list[Remark] = [
        Note(NoteCode.CUT if r.is_cut else NoteCode.LEFT_OUT, None, f"{r.text}: left out")
        for r in found
        if isinstance(r, UnreadPart)
    ]
    incomplete = next((r.text for r in found if isinstance(r, UnreadPart) and r.is_cut), "")
    chosen: list[tuple[UffDataset, StoredTime]] = []
    left_out: dict[str, str] = {}
    damage: CorruptFileError | None = None
    for data in (d for d in found if isinstance(d, UffDataset)):
        time: StoredTime | str = _why_not(data)
        if not time:
            try:
                if not data.binary:  # what cannot be read later must not be listed now
                    _values(path, data)
                time = _time(path, data, clock, notes)
            except CorruptFileError as error:
                damage = damage or error
                time = f"{error.problem}: {error.found}"
        if isinstance(time, str):
            notes.append(Note(NoteCode.LEFT_OUT, _label(data), f"{_label(data)}: {time}: left out"))
            left_out[_label(data)] = time
        else:
            chosen.append((data, time))
    if damage is not None and not chosen:
        raise damage
    _check_one_recording(path, [data for data, _ in chosen])
    plain = [_label(data) for data, _ in chosen]
    repeated = {name for name, count in Counter(plain).items() if count > 1}
    names, name_notes = unique_names(
        [f"{n} {d.node} {d.direction}" if n in repeated else n for n, (d, _) in zip(plain, chosen, strict=True)]
    )
    channels = []
    for name, (data, time) in zip(names, chosen, strict=True):
        if any(ord(c) > 126 for c in data.unit + data.label):
            text = f"{name}: signs beyond ASCII in its unit or label, whose encoding is not stated: {data.unit!r}"
            notes.append(Note(NoteCode.UNITS, name, text))
        if not data.unit:
            notes.append(Note(NoteCode.UNITS, name, f"{name}: no unit is stated"))
        header = SignalHeader(
            name, data.unit, time.time_base.count,
            metadata={"header": list(data.lines), "label": data.label, "node": data.node, "direction": data.direction},
        )  # fmt: skip
        texts = {f"line {number}": line for number, line in enumerate(data.lines[:_DATE_LINE], 1)}
        beside = Statements(texts | statements_in(data.lines[: _DATE_LINE + 3]))
        channels.append(StoredChannel(header, time.time_base, partial(_samples, path, data, time.kept), beside=beside))
    metadata = {"datasets": len(found)}
    start = _start([data for data, _ in chosen], notes)
    return container_recording(
        path, UffReader.name, channels, metadata, [*notes, *name_notes], incomplete, start, left_out
    )


def _check_one_recording(path: Path, chosen: list[UffDataset]) -> None:
    """Refuse a channel that was recorded more than once: the datasets' dates, whole seconds, put none at its time."""
    dates: dict[tuple[str, int, int], str] = {}
    for data in chosen:
        date = data.lines[_DATE_LINE].strip()
        first = dates.setdefault((_label(data), data.node, data.direction), date)
        if date != first and _is_date(first) and _is_date(date):
            raise ReadError(
                f"a second recording begins at {date}: {_label(data)} is in the file once more", path=path,
                place=f"dataset at byte {data.at}", expected=f"one recording, that of {first}",
                remedy="export one recording per file",
            )  # fmt: skip


def _is_date(text: str) -> bool:
    return is_absolute(text) or is_dated(text)


def _start(chosen: list[UffDataset], notes: list[Remark]) -> AbsoluteStart | None:
    """Return the date that all datasets state; if they do not agree there is none."""
    stated = {data.lines[_DATE_LINE].strip() for data in chosen}
    dates = sorted(text for text in stated if _is_date(text))
    if len(dates) == 1 and len(stated) == 1:
        try:
            stamp = (parse_dewesoft_stamp if is_absolute(dates[0]) else parse_wall_clock)(dates[0])
        except ValueError:
            stamp = None
        if stamp is not None and stamp.order is not DateOrder.OPEN:
            return AbsoluteStart(stamp.second.isoformat(), stamp.zone, "third identification line of the datasets")
        notes.append(about_unread_start("as the third identification line of its datasets", dates[0]))
        return None
    if dates:
        shown = ", ".join(dates[:4]) + (" ..." if len(dates) > 4 else "")
        text = f"not all datasets state the same date ({shown}): the start is not known"
        if len(dates) > 1:
            text += ", and signals are laid beside each other as if they had begun together"
            notes.append(Caution(CautionCode.OTHER_STARTS, None, text))
        else:
            notes.append(Note(NoteCode.TIME, None, text))
    return None


def _label(data: UffDataset) -> str:
    named = data.entity or data.lines[0].strip()
    return named if named and named.upper() != "NONE" else f"node {data.node} {data.direction}"


def _why_not(data: UffDataset) -> str:
    """Say why a dataset is no time response; empty if it is one."""
    if data.function != TIME_RESPONSE:
        return FUNCTIONS.get(data.function, f"function {data.function}") + ", not a time response"
    if data.ordinate not in (SINGLE, DOUBLE):
        return "complex values" if data.ordinate in (5, 6) else f"ordinate type {data.ordinate}"
    if data.abscissa_kind not in (0, TIME):
        return f"an abscissa of type {data.abscissa_kind}, not time"
    unit_s = _unit_s(data)
    return unit_s if isinstance(unit_s, str) else ""


def _unit_s(data: UffDataset) -> float | str:
    """Return the seconds of the abscissa's unit, or why it is none of time; a type of time speaks for itself."""
    return axis_unit_s(data.abscissa_label if data.abscissa_kind != TIME else "", data.abscissa_unit)


def _time(path: Path, data: UffDataset, clock: str, notes: list[Remark]) -> StoredTime | str:
    factor = _unit_s(data)
    if isinstance(factor, str):
        return factor
    if not data.abscissa_unit:
        text = f"{_label(data)}: its abscissa states no unit: read as seconds"
        notes.append(Note(NoteCode.TIME, _label(data), text))
    try:
        if not data.even:
            times = _values(path, data)[0]
            resolution = _resolution(data, times)
            stored = time_from_stamps(clock, times.astype(np.float64) * factor, resolution * factor)
            if stored.note:
                notes.append(Note(NoteCode.TIME, _label(data), f"{_label(data)}: {stored.note}"))
            return stored
        base = TimeBase.uniform(clock, data.start * factor, data.step * factor, data.count)
    except ValueError as error:
        return f"its time is wrong ({error})"
    last_digit = 0.5 * 10.0 ** (np.floor(np.log10(data.step)) - PRINTED_DIGITS + 1)
    if last_digit * data.count > 0.1 * data.step and abs(1 / data.step - round(1 / data.step)) > 1e-9 / data.step:
        text = (
            f"{_label(data)}: its step has {PRINTED_DIGITS} digits: time may be off by up to"
            f" {last_digit * data.count * factor:.1g} s at the end"
        )
        notes.append(Note(NoteCode.TIME, _label(data), text))
    return StoredTime(base, None, "")


def _resolution(data: UffDataset, times: NDArray[Any]) -> float:
    """Return the step of an uneven abscissa's numbers; as text they have six digits."""
    if data.binary:
        return resolution_of(times)
    largest = float(np.abs(times).max())
    return float(10.0 ** (np.floor(np.log10(largest)) - PRINTED_DIGITS + 1)) if largest else 0.0


def _values(path: Path, data: UffDataset, start: int = 0, stop: int | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
    """Read abscissas, empty if they are even, and ordinates of one dataset, shape (stop - start,) each."""
    stop = data.count if stop is None else stop
    if not data.binary:
        return _printed(path, data, start, stop)
    order = ">" if data.big_endian else "<"
    width = (data.data_end - data.data_at) // data.count
    ordinate = f"{order}f{4 if data.ordinate == SINGLE else 8}"
    fields = [("y", ordinate)]
    if not data.even:
        fields.insert(0, ("x", f"{order}f{width - np.dtype(ordinate).itemsize}"))
    with path.open("rb") as file:
        file.seek(data.data_at + start * width)
        rows = np.frombuffer(file.read((stop - start) * width), np.dtype(fields))
    return rows["x"] if not data.even else np.empty(0), rows["y"]


def _printed(path: Path, data: UffDataset, start: int, stop: int) -> tuple[NDArray[Any], NDArray[Any]]:
    with path.open("rb") as file:
        file.seek(data.data_at)
        content = file.read(data.data_end - data.data_at)
    expected = data.count * (1 if data.even else 2)
    try:
        numbers = printed_numbers(content, expected, double=data.ordinate == DOUBLE, even=data.even)
    except ValueError as error:
        raise CorruptFileError(
            "the values of a dataset are not as it states", path=path, place=f"dataset at byte {data.at}",
            found=str(error), remedy="export it again",
        ) from error  # fmt: skip
    if data.even:
        return np.empty(0), numbers[start:stop]
    return numbers[0::2][start:stop], numbers[1::2][start:stop]


def _samples(
    path: Path, data: UffDataset, kept: NDArray[np.int64] | None, start: int, stop: int
) -> NDArray[np.float64]:
    values = selected(kept, lambda first, last: _values(path, data, first, last)[1], start, stop).astype(np.float64)
    if values.size != stop - start:
        raise ValueError(f"{values.size} values of {stop - start}")
    return values
