"""From a declared table, as a rig file has it, to a `Framing`; every fault is reported at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_acquisition.errors import FramingError
from recoil_acquisition.frames.declared_commands import checksum_of, commands_of, polls_of
from recoil_acquisition.frames.declared_fields import ORDERS, frame_types
from recoil_acquisition.frames.declared_table import Table
from recoil_acquisition.frames.field import TYPE_SIZES
from recoil_acquisition.frames.framing import BITS_PER_BYTE, DEFAULT_MAX, DeviceTime, Framing, Length, PacketCounter
from recoil_acquisition.frames.ready_made import from_ready_made

_WHOLE_TYPES = ("u8", "u16", "u24", "u32")
_ALL = {"kind", "max", "checksum", "fields", "frames", "when", "only_known", "counter", "device_time"}
_ALL |= {"baudrate", "bits_per_byte", "rate_hz", "poll", "start_commands", "stop_commands"}
_BINARY = _ALL | {"endian", "tlv"}
_KEYS = {
    "sync": _BINARY | {"timeout_s", "sync", "length", "look_ahead"},
    "fixed": _BINARY | {"timeout_s", "length"},
    "delimiter": _ALL | {"timeout_s", "delimiter", "start", "comment", "separator"},
    "cobs": _BINARY | {"timeout_s"},
    "slip": _BINARY | {"timeout_s"},
    "idle": _BINARY | {"gap_s"},
}


def framing_from_table(table: Mapping[str, Any]) -> Framing:
    """Validate a declared framing.

    Parameters
    ----------
    table : mapping
        Either ``ready_made``, the name of a framing of `frames.ready_made`, its parameters, and keys that
        replace its own; or ``kind`` and what the kind needs:

        ==============  ==========================================================================
        ``sync``        ``sync`` (hexadecimal), ``length``, ``look_ahead``
        ``fixed``       ``length = { fixed = n }``: nothing marks where a frame begins
        ``delimiter``   lines: ``delimiter``, ``start``, ``comment``, ``separator``
        ``cobs``        packets that a zero ends
        ``slip``        packets that C0 ends (RFC 1055)
        ``idle``        ``gap_s`` of silence ends a frame, by default 3.5 characters of ``baudrate``
        ==============  ==========================================================================

        ``length`` is ``{ fixed }``, ``{ at, type, endian, add }`` or ``{ at, type, endian, of = { "49" = 9 } }``.
        For all: ``max``, ``checksum = { algo, from, order, format, mark }``, ``fields`` or several ``frames`` each
        with ``when`` and ``fields``, ``only_known``, ``counter = { field, modulo, step }``, ``device_time =
        { field, tick_s, modulo }``, ``baudrate``, ``bits_per_byte``, ``rate_hz``, ``timeout_s`` of silence that
        ends a half frame, ``poll``, ``start_commands``, ``stop_commands``; for all but lines ``endian`` and ``tlv``.

    Returns
    -------
    Framing

    Raises
    ------
    FramingError
        With every fault of the table.
    """
    faults: list[str] = []
    if "ready_made" in table:
        table = from_ready_made(table, faults)
        if not table:
            raise _error(faults)
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _KEYS:
        faults.append(f"framing.kind: must be one of {', '.join(_KEYS)}, or `ready_made` be given; found {kind!r}")
        raise _error(faults)
    top = Table(table, "framing", _KEYS[kind], faults)
    big_endian = top.choice("endian", ORDERS, "little") == "big"
    length = _length(top, big_endian=big_endian) if kind in ("sync", "fixed") else Length(fixed=1)
    baudrate, bits = top.number("baudrate", 0.0, positive=True), top.whole("bits_per_byte", BITS_PER_BYTE, 7, 13)
    framing = Framing(
        kind=kind,
        types=frame_types(top, kind, big_endian=big_endian),
        sync=top.hex_bytes("sync") if kind == "sync" else b"",
        length=length,
        maximum=top.whole("max", max(DEFAULT_MAX, length.fixed or 0), lowest=1),
        checksum=checksum_of(top, lines=kind == "delimiter"),
        delimiter=top.text("delimiter", "\n").encode(),
        start=top.text("start", "").encode(),
        comment=top.text("comment", "").encode(),
        separator=top.text("separator", ","),
        counter=_counter(top),
        device_time=_device_time(top),
        baudrate=baudrate,
        bits_per_byte=bits,
        rate_hz=top.number("rate_hz", 0.0, positive=True),
        silence_s=_gap(top, baudrate) if kind == "idle" else top.number("timeout_s", 0.0, positive=True),
        look_ahead=top.flag("look_ahead"),
        only_known=top.flag("only_known"),
        poll=polls_of(top),
        start_commands=commands_of(top, "start_commands"),
        stop_commands=commands_of(top, "stop_commands"),
    )
    faults += _contradictions(framing)
    if faults:
        raise _error(faults)
    return framing


def _error(faults: list[str]) -> FramingError:
    return FramingError(f"{len(faults)} fault{'' if len(faults) == 1 else 's'}: " + " | ".join(faults))


def _length(top: Table, *, big_endian: bool) -> Length:
    if "length" not in top.values:
        top.fault("length", 'is missing; such as { fixed = 34 } or { at = 3, type = "u8", add = 6 }')
        return Length(fixed=1)
    table = top.table("length", {"fixed", "at", "type", "endian", "add", "of"})
    if "fixed" in table.values:
        if len(table.values) > 1:
            table.fault("fixed", "excludes the other keys")
        return Length(fixed=table.whole("fixed", lowest=1))
    if top.values.get("kind") == "fixed":
        table.fault("fixed", "is missing: nothing marks where a frame of kind `fixed` has its length")
        return Length(fixed=1)
    if "add" in table.values and "of" in table.values:
        table.fault("of", "excludes `add`")
    type_ = table.choice("type", _WHOLE_TYPES, "u8" if "of" in table.values else None)
    return Length(
        None,
        table.whole("at"),
        type_,
        table.choice("endian", ORDERS, "big" if big_endian else "little") == "big",
        table.whole("add", 0, lowest=-65536),
        table.whole_by_hex("of", TYPE_SIZES[type_]),
    )


def _gap(top: Table, baudrate: float) -> float:
    """Silence that ends a frame: Modbus over Serial Line V1.02, 2.5.1.1, asks for 3.5 characters of 11 bits.

    Above 19,200 baud it recommends 1.75 ms, because a host cannot time less.
    """
    if "gap_s" in top.values or not baudrate:
        return top.number("gap_s", positive=True)
    return 3.5 * 11 / baudrate if baudrate <= 19200 else 1.75e-3


def _counter(top: Table) -> PacketCounter | None:
    if "counter" not in top.values:
        return None
    table = top.table("counter", {"field", "modulo", "step"})
    modulo = table.whole("modulo", lowest=2, highest=2**62)
    return PacketCounter(table.text("field"), modulo, table.whole("step", 1, 1, max(1, modulo // 2)))


def _device_time(top: Table) -> DeviceTime | None:
    if "device_time" not in top.values:
        return None
    table = top.table("device_time", {"field", "tick_s", "modulo"})
    return DeviceTime(
        table.text("field"), table.number("tick_s", positive=True), table.whole("modulo", 0, highest=2**62)
    )


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
    if framing.kind not in ("sync", "fixed"):
        return faults
    checksum = framing.checksum
    for value, length in framing.length.by_value.items():
        if not framing.length.head <= length <= framing.maximum:
            faults.append(f"framing.length.of: {length} bytes for {value:#x} do not hold the head, or exceed `max`")
    if (fixed := framing.length.fixed) is None:
        return faults
    data = fixed - framing.trailer
    if fixed < len(framing.sync) + framing.trailer:
        faults.append(f"framing.length.fixed: {fixed} bytes do not hold the sync bytes and the checksum")
    if fixed > framing.maximum:
        faults.append(f"framing.max: {framing.maximum} is less than the fixed length {fixed}")
    if checksum is not None and checksum.start > data:
        faults.append(f"framing.checksum.from: byte {checksum.start} lies behind the frame's data")
    for field in framing.fields:
        if field.element is None and field.at + field.size > data:
            faults.append(f"framing.fields {field.name!r}: its bytes from {field.at} lie behind the frame's data")
    return faults
