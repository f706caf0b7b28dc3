"""Datasets of a Universal File: where they are, and what the headers of type 58 say.

Layout: University of Cincinnati, SDRL, *Universal File Formats*, file type 58, "Function at Nodal
DOF": a line ``-1``, the type, eleven lines of fixed columns, the values, a line ``-1``. In ``58b``
the values are binary and the type's line states byte order, floating point format and length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

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


@dataclass(frozen=True)
class UffDataset:
    """One dataset of type 58.

    Attributes
    ----------
    at, data_at, data_end
        Bytes where it begins, where its values begin and end.
    lines
        The eleven lines of its header.
    ordinate
        `SINGLE` or `DOUBLE`, or a complex type.
    start, step
        Of an even abscissa, in its unit.
    abscissa_label, abscissa_unit, unit, label
        Empty for ``NONE``.
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
class Remark:
    """A note on what is not read, and whether that shows that the file was cut off."""

    text: str
    is_cut: bool = False


def iter_datasets(data: bytes, size: int) -> Iterator[UffDataset | Remark]:
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
                yield Remark(f"NUL bytes stand behind byte {at}: power or the disk failed", is_cut=True)
            elif rest:
                yield Remark(f"what begins at byte {at} is no dataset", is_cut=True)
            return
        number, binary, rest = int(begin[1]), begin[2] == b"b", begin[3]
        if number != 58:
            end = _END.search(data, begin.end())
            yield Remark(f"dataset {number} at byte {at}") if end else Remark(f"dataset {number} is cut", is_cut=True)
        else:
            found = _function(data, size, at, begin.end(), binary, rest)
            yield found
            end = _END_HERE.match(data, found.data_end) if isinstance(found, UffDataset) else None
        if end is None:
            return
        at = end.end()


def _function(data: bytes, size: int, at: int, head_at: int, binary: bool, rest: bytes) -> UffDataset | Remark:
    cut = Remark(f"the dataset at byte {at} is cut off", is_cut=True)
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
        return Remark(f"the dataset at byte {at} is not in IEEE floating point ({form[:2]}): no more is read")
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
