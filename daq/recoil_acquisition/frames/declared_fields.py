"""Frame types and their fields, as a framing declares them."""

from __future__ import annotations

from typing import Any

from recoil_acquisition.frames.declared_table import Table
from recoil_acquisition.frames.field import TYPE_SIZES, Elements, Field, FrameType, Selector

ORDERS = ("little", "big")

_MOST_IN_ARRAY = 1024


def frame_types(top: Table, kind: str, *, big_endian: bool) -> tuple[FrameType, ...]:
    """Read ``fields``, or each of ``frames``; a frame with ``when`` alone is known and holds nothing of use."""
    if "frames" not in top.values:
        return (_frame_type(top, kind, big_endian=big_endian),)
    for key in ("fields", "when", "tlv"):
        if key in top.values:
            top.fault(key, "stands in each of `frames` where there are several")
    rows = top.values["frames"]
    if not isinstance(rows, list | tuple) or not rows:
        top.fault("frames", f"must be a list of tables, found {rows!r}")
        return ()
    known = {"when", "fields"} | ({"tlv"} if kind != "delimiter" else set())
    return tuple(
        _frame_type(Table(row, f"{top.where}.frames[{i}]", known, top.faults), kind, big_endian=big_endian)
        for i, row in enumerate(rows)
    )


def _frame_type(table: Table, kind: str, *, big_endian: bool) -> FrameType:
    when = _selector(table, kind) if "when" in table.values else None
    elements = _elements(table) if "tlv" in table.values else None
    if when is not None and "fields" not in table.values and ".frames[" in table.where:
        return FrameType((), when)
    rows = table.values.get("fields")
    if not isinstance(rows, list | tuple) or not rows:
        table.fault("fields", "must be a list of at least one field")
        rows = []
    fields = [
        field
        for i, row in enumerate(rows)
        for field in _fields(row, f"{table.where}.fields[{i}]", table, kind, elements, big_endian=big_endian)
    ]
    return FrameType(tuple(fields), when, elements)


def _fields(
    row: Any, where: str, within: Table, kind: str, elements: Elements | None, *, big_endian: bool
) -> list[Field]:
    """Read one field, or the several of an array: they follow each other and differ in their names only."""
    known = {"name", "at", "scale", "offset", "unit", "plausible", "count"}
    known |= {"type", "endian", "bits"} if kind != "delimiter" else set()
    known |= {"id"} if elements is not None else set()
    table = Table(row, where, known, within.faults)
    type_ = table.choice("type", tuple(TYPE_SIZES)) if kind != "delimiter" else "text"
    first = table.whole("at", None if elements is None else 0)
    return [
        Field(
            name=name,
            at=first + i * TYPE_SIZES.get(type_, 1),
            type=type_,
            big_endian=table.choice("endian", ORDERS, "big" if big_endian else "little") == "big",
            scale=table.number("scale", 1.0),
            offset=table.number("offset", 0.0),
            unit=table.text("unit", ""),
            element=table.whole("id") if elements is not None else None,
            bits=_bits(table, type_),
            plausible=_plausible(table),
        )
        for i, name in enumerate(_names(table))
    ]


def _names(table: Table) -> list[str]:
    """Names of an array: a list, or one name and ``count``, which gives name_0, name_1 and so on."""
    names = table.values.get("name")
    if isinstance(names, list | tuple):
        if "count" in table.values:
            table.fault("count", "excludes a list of names")
        if not names or not all(isinstance(name, str) and name for name in names):
            table.fault("name", f"must be a text or a list of texts, found {names!r}")
            return ["?"]
        return list(names)
    name = table.text("name")
    if "count" not in table.values:
        return [name]
    return [f"{name}_{i}" for i in range(table.whole("count", lowest=1, highest=_MOST_IN_ARRAY))]


def _bits(table: Table, type_: str) -> tuple[int, int] | None:
    if "bits" not in table.values:
        return None
    pair = table.values["bits"]
    width = 8 * TYPE_SIZES.get(type_, 0)
    if type_[0] not in "ui":
        table.fault("bits", f"are those of whole numbers, not of {type_}")
        return None
    if (
        not isinstance(pair, list | tuple)
        or len(pair) != 2
        or not all(isinstance(n, int) and not isinstance(n, bool) for n in pair)
        or not (pair[0] >= 0 and 1 <= pair[1] <= 63 and pair[0] + pair[1] <= width)
    ):
        table.fault("bits", f"must be the lowest bit and the number of bits, within {width} of them, found {pair!r}")
        return None
    return pair[0], pair[1]


def _plausible(table: Table) -> tuple[float, float] | None:
    if "plausible" not in table.values:
        return None
    pair = table.values["plausible"]
    if (
        not isinstance(pair, list | tuple)
        or len(pair) != 2
        or not all(isinstance(n, int | float) and not isinstance(n, bool) for n in pair)
        or not pair[0] < pair[1]
    ):
        table.fault("plausible", f"must be the least and the greatest value, found {pair!r}")
        return None
    return float(pair[0]), float(pair[1])


def _selector(table: Table, kind: str) -> Selector:
    when = table.table("when", {"at", "equals"} | ({"text"} if kind != "delimiter" else set()))
    equals = when.values.get("equals")
    if kind == "delimiter":
        return Selector(when.whole("at"), when.text("equals").encode())
    if "text" in when.values:
        if "equals" in when.values:
            when.fault("text", "excludes `equals`")
        return Selector(when.whole("at"), when.text("text").encode())
    if isinstance(equals, str):
        return Selector(when.whole("at"), when.hex_bytes("equals"))
    if isinstance(equals, bool) or not isinstance(equals, int) or not 0 <= equals <= 255:
        when.fault("equals", f"must be a byte from 0 to 255 or bytes in hexadecimal, found {equals!r}")
        return Selector(0, b"\0")
    return Selector(when.whole("at"), bytes([equals]))


def _elements(table: Table) -> Elements:
    tlv = table.table("tlv", {"from", "len", "len_includes", "id", "id_first", "endian"})
    return Elements(
        start=tlv.whole("from"),
        length_type=tlv.choice("len", ("u8", "u16")),
        id_type=tlv.choice("id", ("u8", "u16")),
        length_includes=tlv.whole("len_includes", 0),
        id_first=tlv.flag("id_first"),
        big_endian=tlv.choice("endian", ORDERS, "big") == "big",
    )
