"""From a declared table, as a rig file has it, to a `Framing`; every fault is reported at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from daq.errors import FramingError
from daq.frames.checksum import CHECKSUMS
from daq.frames.declared_table import Table
from daq.frames.framing import (
    DEFAULT_MAX,
    TYPE_SIZES,
    ChecksumField,
    DeviceTime,
    Elements,
    Field,
    FrameType,
    Framing,
    Length,
    PacketCounter,
    Selector,
)

_ORDERS = ("little", "big")
_WHOLE_TYPES = ("u8", "u16", "u24", "u32")
_BOTH = {"kind", "max", "checksum", "fields", "frames", "when", "counter", "device_time", "baudrate", "rate_hz"}
_KEYS = {
    "sync": _BOTH | {"sync", "length", "endian", "tlv"},
    "delimiter": _BOTH | {"delimiter", "start", "comment", "separator"},
}


def framing_from_table(table: Mapping[str, Any]) -> Framing:
    """Validate a declared framing.

    Parameters
    ----------
    table : mapping
        ``kind`` is ``sync`` (``sync``, ``length``) or ``delimiter`` (``delimiter``, ``start``,
        ``comment``, ``separator``); both have ``max``, ``checksum``, ``fields`` or several ``frames`` each with
        ``when`` and ``fields``, ``counter``, ``device_time``, ``baudrate`` and ``rate_hz``. See the README.

    Returns
    -------
    Framing

    Raises
    ------
    FramingError
        With every fault of the table.
    """
    faults: list[str] = []
    kind = table.get("kind")
    if kind not in _KEYS:
        raise FramingError("1 fault: framing.kind: must be `sync` or `delimiter`", found=repr(kind))
    top = Table(table, "framing", _KEYS[kind], faults)
    endian = top.choice("endian", _ORDERS, "little") == "big"
    length = _length(top, big_endian=endian) if kind == "sync" else Length(fixed=1)
    maximum = top.whole("max", max(DEFAULT_MAX, length.fixed or 0), lowest=1)
    checksum = _checksum(top, faults)
    types = _types(top, kind, faults, big_endian=endian)
    framing = Framing(
        kind=kind,
        types=types,
        sync=top.hex_bytes("sync") if kind == "sync" else b"",
        length=length,
        maximum=maximum,
        checksum=checksum,
        delimiter=top.text("delimiter", "\n").encode(),
        start=top.text("start", "").encode(),
        comment=top.text("comment", "").encode(),
        separator=top.text("separator", ","),
        counter=_counter(top, faults),
        device_time=_device_time(top, faults),
        baudrate=top.number("baudrate", 0.0, positive=True),
        rate_hz=top.number("rate_hz", 0.0, positive=True),
    )
    faults += _contradictions(framing)
    if faults:
        raise FramingError(f"{len(faults)} fault{'' if len(faults) == 1 else 's'}: " + " | ".join(faults))
    return framing


def _length(top: Table, *, big_endian: bool) -> Length:
    if "length" not in top.values:
        top.fault("length", 'is missing; such as { fixed = 34 } or { at = 3, type = "u8", add = 6 }')
        return Length(fixed=1)
    table = Table(top.values["length"], "framing.length", {"fixed", "at", "type", "endian", "add"}, top.faults)
    if "fixed" in table.values:
        if len(table.values) > 1:
            table.fault("fixed", "excludes the other keys")
        return Length(fixed=table.whole("fixed", lowest=1))
    order = table.choice("endian", _ORDERS, "big" if big_endian else "little")
    return Length(
        None,
        table.whole("at"),
        table.choice("type", _WHOLE_TYPES),
        order == "big",
        table.whole("add", 0, lowest=-65536),
    )


def _checksum(top: Table, faults: list[str]) -> ChecksumField | None:
    if "checksum" not in top.values:
        return None
    table = Table(top.values["checksum"], "framing.checksum", {"algo", "from", "size", "order"}, faults)
    name = table.choice("algo", ("none", *CHECKSUMS))
    start, order = table.whole("from", 0), table.choice("order", _ORDERS, "little")
    if name == "none":
        return None
    if (size := table.whole("size", CHECKSUMS[name].size)) != CHECKSUMS[name].size:
        table.fault("size", f"{name} has {CHECKSUMS[name].size} bytes, found {size}")
    return ChecksumField(CHECKSUMS[name], start, order == "big")


def _types(top: Table, kind: str, faults: list[str], *, big_endian: bool) -> tuple[FrameType, ...]:
    if "frames" not in top.values:
        return (_frame_type(top, "framing", kind, faults, big_endian=big_endian),)
    for key in ("fields", "when", "tlv"):
        if key in top.values:
            top.fault(key, "stands in each of `frames` where there are several")
    rows = top.values["frames"]
    if not isinstance(rows, list | tuple) or not rows:
        top.fault("frames", f"must be a list of tables, found {rows!r}")
        return ()
    types = []
    for i, row in enumerate(rows):
        where = f"framing.frames[{i}]"
        known = {"when", "fields"} | ({"tlv"} if kind == "sync" else set())
        types.append(_frame_type(Table(row, where, known, faults), where, kind, faults, big_endian=big_endian))
    return tuple(types)


def _frame_type(table: Table, where: str, kind: str, faults: list[str], *, big_endian: bool) -> FrameType:
    when = _selector(table, where, kind, faults) if "when" in table.values else None
    elements = _elements(table, where, faults) if "tlv" in table.values else None
    rows = table.values.get("fields")
    if not isinstance(rows, list | tuple) or not rows:
        table.fault("fields", "must be a list of at least one field")
        rows = []
    fields = tuple(
        _field(row, f"{where}.fields[{i}]", kind, faults, big_endian=big_endian, in_element=elements is not None)
        for i, row in enumerate(rows)
    )
    return FrameType(fields, when, elements)


def _field(row: Any, where: str, kind: str, faults: list[str], *, big_endian: bool, in_element: bool) -> Field:
    known = {"name", "at", "scale", "offset", "unit"}
    known |= {"type", "endian"} if kind == "sync" else set()
    known |= {"id"} if in_element else set()
    table = Table(row, where, known, faults)
    return Field(
        name=table.text("name"),
        at=table.whole("at", 0 if in_element else None),
        type=table.choice("type", tuple(TYPE_SIZES)) if kind == "sync" else "text",
        big_endian=table.choice("endian", _ORDERS, "big" if big_endian else "little") == "big",
        scale=table.number("scale", 1.0),
        offset=table.number("offset", 0.0),
        unit=table.text("unit", ""),
        element=table.whole("id") if in_element else None,
    )


def _selector(table: Table, where: str, kind: str, faults: list[str]) -> Selector:
    when = Table(table.values["when"], f"{where}.when", {"at", "equals"}, faults)
    equals = when.values.get("equals")
    if kind == "delimiter":
        return Selector(when.whole("at"), when.text("equals").encode())
    if isinstance(equals, str):
        return Selector(when.whole("at"), when.hex_bytes("equals"))
    if isinstance(equals, bool) or not isinstance(equals, int) or not 0 <= equals <= 255:
        when.fault("equals", f"must be a byte from 0 to 255 or bytes in hexadecimal, found {equals!r}")
        return Selector(0, b"\0")
    return Selector(when.whole("at"), bytes([equals]))


def _elements(table: Table, where: str, faults: list[str]) -> Elements:
    known = {"from", "len", "len_includes", "id", "id_first", "endian"}
    tlv = Table(table.values["tlv"], f"{where}.tlv", known, faults)
    return Elements(
        start=tlv.whole("from"),
        length_type=tlv.choice("len", ("u8", "u16")),
        id_type=tlv.choice("id", ("u8", "u16")),
        length_includes=tlv.whole("len_includes", 0),
        id_first=tlv.flag("id_first"),
        big_endian=tlv.choice("endian", _ORDERS, "big") == "big",
    )


def _counter(top: Table, faults: list[str]) -> PacketCounter | None:
    if "counter" not in top.values:
        return None
    table = Table(top.values["counter"], "framing.counter", {"field", "modulo"}, faults)
    return PacketCounter(table.text("field"), table.whole("modulo", lowest=2))


def _device_time(top: Table, faults: list[str]) -> DeviceTime | None:
    if "device_time" not in top.values:
        return None
    table = Table(top.values["device_time"], "framing.device_time", {"field", "tick_s", "modulo"}, faults)
    return DeviceTime(table.text("field"), table.number("tick_s", positive=True), table.whole("modulo", 0))


def _contradictions(framing: Framing) -> list[str]:
    """Find what each key alone does not show."""
    faults = []
    names = [field.name for field in framing.fields]
    faults += [
        f"framing.fields: {name!r} is there {names.count(name)} times"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]
    for key, used in (("counter", framing.counter), ("device_time", framing.device_time)):
        if used is not None and used.field not in names:
            faults.append(f"framing.{key}.field: no field {used.field!r}; there are {', '.join(names)}")
    fixed = framing.length.fixed
    if framing.kind != "sync":
        return faults
    trailer = framing.checksum.size if framing.checksum else 0
    if fixed is not None and fixed < len(framing.sync) + trailer:
        faults.append(f"framing.length.fixed: {fixed} bytes do not hold the sync bytes and the checksum")
    if fixed is not None and fixed > framing.maximum:
        faults.append(f"framing.max: {framing.maximum} is less than the fixed length {fixed}")
    if fixed is not None and framing.checksum is not None and framing.checksum.start > fixed - trailer:
        faults.append(f"framing.checksum.from: byte {framing.checksum.start} lies behind the frame's data")
    for frame_type in framing.types:
        for field in frame_type.fields:
            if fixed is not None and field.element is None and field.at + field.size > fixed - trailer:
                faults.append(f"framing.fields {field.name!r}: its bytes from {field.at} lie behind the frame's data")
    return faults
