"""From a declared table, as a rig file has it, to a `Framing`; every fault is reported at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, FramingError, KeyPath, Row
from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.field import TYPE_SIZES, Elements, Field, FrameType, Selector
from recoil_acquisition.frames.framing import (
    DEFAULT_MAX,
    ChecksumField,
    Command,
    DeviceTime,
    Framing,
    Length,
    PacketCounter,
    Poll,
)
from recoil_acquisition.frames.framing_tables import (
    ChecksumTable,
    FieldTable,
    FrameTable,
    FramingTable,
    LengthTable,
    RequestTable,
    WhenTable,
)
from recoil_acquisition.frames.ready_made import from_ready_made
from recoil_acquisition.quantities.declaration import declared, unknown_keys

_FRAMING = "framing"
"""Key that a framing has in its source."""

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
    table
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

    Raises
    ------
    FramingError
        With every fault of the table.
    """
    faults: list[Fault] = []
    if "ready_made" in table:
        table = from_ready_made(table, faults)
        if not table:
            raise _error(faults)
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _KEYS:
        problem = f"must be one of {', '.join(_KEYS)}, or `ready_made` be given; found {kind!r}"
        faults += unknown_keys(table, sorted({key for keys in _KEYS.values() for key in keys}), (_FRAMING,))
        code = FaultCode.VALUE if "kind" in table else FaultCode.MISSING
        raise _error([*faults, Fault((_FRAMING, "kind"), problem, code)])
    own = {key: value for key, value in table.items() if key in _KEYS[kind]}
    faults += unknown_keys(table, sorted(_KEYS[kind]), (_FRAMING,))
    top = declared(FramingTable, own, (_FRAMING,), faults)
    if top is None:
        raise _error(faults)
    framing = _Declared(top, faults).framing()
    if not faults:
        faults += _contradictions(framing)
    if faults:
        raise _error(faults)
    return framing


def _error(faults: Sequence[Fault]) -> FramingError:
    count = f"{len(faults)} fault{'' if len(faults) == 1 else 's'}"
    return FramingError(f"{count}: " + " | ".join(str(fault) for fault in faults), faults)


class _Declared:
    """A framing whose keys are sound each alone, being made; what does not fit together is appended to the faults."""

    def __init__(self, top: FramingTable, faults: list[Fault]) -> None:
        self._top, self._faults = top, faults
        self._lines = top.kind == "delimiter"

    def framing(self) -> Framing:
        """Return the framing; of no use if there are faults."""
        top = self._top
        length = self._length(top.length) if top.kind in ("sync", "fixed") else Length(fixed=1)
        if top.kind == "sync" and top.sync is None:
            self._fault(("sync",), 'must be bytes in hexadecimal, such as "AA 55"; it is missing', FaultCode.MISSING)
        return Framing(
            kind=top.kind,
            types=self._frame_types(),
            sync=top.sync or b"",
            length=length,
            maximum=top.max or max(DEFAULT_MAX, length.fixed or 0),
            checksum=self._checksum(top.checksum, ("checksum",), lines=self._lines),
            delimiter=top.delimiter.encode(),
            start=top.start.encode(),
            comment=top.comment.encode(),
            separator=top.separator,
            counter=self._counter(),
            device_time=None if top.device_time is None else DeviceTime(**top.device_time.model_dump()),
            baudrate=top.baudrate or 0.0,
            bits_per_byte=top.bits_per_byte,
            rate_hz=top.rate_hz or 0.0,
            silence_s=self._gap_s() if top.kind == "idle" else top.timeout_s or 0.0,
            look_ahead=top.look_ahead,
            only_known=top.only_known,
            poll=tuple(
                Poll(self._request(one, ("poll", i)), one.every_s, one.timeout_s) for i, one in enumerate(top.poll)
            ),
            start_commands=self._commands("start_commands"),
            stop_commands=self._commands("stop_commands"),
        )

    def _fault(self, key: KeyPath, problem: str, code: FaultCode = FaultCode.CONTRADICTION) -> None:
        self._faults.append(Fault((_FRAMING, *key), problem, code))

    def _length(self, table: LengthTable | None) -> Length:
        if table is None:
            problem = 'is missing; such as { fixed = 34 } or { at = 3, type = "u8", add = 6 }'
            self._fault(("length",), problem, FaultCode.MISSING)
            return Length(fixed=1)
        if table.fixed is not None:
            if len(table.model_fields_set) > 1:
                self._fault(("length", "fixed"), "excludes the other keys")
            return Length(fixed=table.fixed)
        if self._top.kind == "fixed":
            problem = "is missing: nothing marks where a frame of kind `fixed` has its length"
            self._fault(("length", "fixed"), problem, FaultCode.MISSING)
            return Length(fixed=1)
        if table.at is None:
            self._fault(("length", "at"), "is missing: the byte of the length field, from 0", FaultCode.MISSING)
        if table.type is None and table.of is None:
            self._fault(("length", "type"), "is missing; one of u8, u16, u24, u32", FaultCode.MISSING)
        if table.add is not None and table.of is not None:
            self._fault(("length", "of"), "excludes `add`")
        kind = table.type or "u8"
        big_endian = (table.endian or self._top.endian) == "big"
        by_value = self._by_value(table.of or {}, TYPE_SIZES[kind])
        return Length(None, table.at or 0, kind, big_endian, table.add or 0, by_value)

    def _by_value(self, numbers: Mapping[str, Any], size: int) -> Mapping[int, int]:
        """Return lengths by values of so many bytes, which are written in hexadecimal."""
        found = {}
        for text, number in numbers.items():
            try:
                value = int.from_bytes(bytes.fromhex(text), "big")
            except ValueError:
                value = -1
            if not 0 <= value < 256**size:
                self._fault(("length", "of"), f"{text!r} is no value of {size} bytes in hexadecimal", FaultCode.VALUE)
            elif isinstance(number, bool) or not isinstance(number, int) or number < 1:
                problem = f"the length for {text!r} must be a whole number from 1, found {number!r}"
                self._fault(("length", "of"), problem, FaultCode.VALUE)
            else:
                found[value] = number
        return MappingProxyType(found)

    def _gap_s(self) -> float:
        """Return the silence that ends a frame: Modbus over Serial Line V1.02, 2.5.1.1: 3.5 characters of 11 bits.

        Above 19,200 baud it recommends 1.75 ms, because a host cannot time less.
        """
        baudrate = self._top.baudrate
        if self._top.gap_s is not None:
            return self._top.gap_s
        if baudrate is None:
            self._fault(("gap_s",), "is missing; or declare `baudrate`", FaultCode.MISSING)
            return 1.0
        return 3.5 * 11 / baudrate if baudrate <= 19200 else 1.75e-3

    def _counter(self) -> PacketCounter | None:
        table = self._top.counter
        if table is None:
            return None
        if table.step > max(1, table.modulo // 2):
            highest = max(1, table.modulo // 2)
            problem = f"must be a whole number up to {highest}, found {table.step}"
            self._fault(("counter", "step"), problem, FaultCode.RANGE)
        return PacketCounter(table.field, table.modulo, table.step)

    def _checksum(self, table: ChecksumTable | None, where: KeyPath, *, lines: bool) -> ChecksumField | None:
        if table is None or table.algo == "none":
            return None
        form = table.format or ("hex" if lines else "binary")
        if lines and form == "binary":
            self._fault((*where, "format"), "must be hex: a binary checksum may hold the delimiter of lines")
        size = CHECKSUMS[table.algo].size
        if table.size not in (None, size):
            self._fault((*where, "size"), f"{table.algo} has {size} bytes, found {table.size}")
        mark = ("*" if lines else "") if table.mark is None else table.mark
        return ChecksumField(CHECKSUMS[table.algo], table.start, table.order == "big", form == "hex", mark.encode())

    def _request(self, table: RequestTable, where: KeyPath) -> bytes:
        """Return the bytes of a request, with its checksum if one is declared."""
        as_text = table.text is not None
        if as_text == (table.hex is not None):
            problem = 'or `text` is needed, such as hex = "01 49 01" or text = "$VNRRG,08"'
            self._fault((*where, "hex"), problem, FaultCode.CONTRADICTION if as_text else FaultCode.MISSING)
            return b""
        data = (table.text or "").encode() if as_text else table.hex or b""
        checksum = self._checksum(table.checksum, (*where, "checksum"), lines=as_text)
        if checksum is not None and checksum.start >= len(data):
            self._fault((*where, "checksum", "from"), f"byte {checksum.start} lies behind the request")
            return data
        data += b"" if checksum is None else checksum.of(data)
        return data + table.end.encode() if as_text else data

    def _commands(self, key: str) -> tuple[Command, ...]:
        return tuple(
            Command(self._request(one, (key, i)), one.wait_s or 0.0) for i, one in enumerate(getattr(self._top, key))
        )

    def _frame_types(self) -> tuple[FrameType, ...]:
        """Return the types of ``frames``, or the one of ``fields``; one with ``when`` alone holds nothing of use."""
        if self._top.frames is None:
            return (self._frame_type(self._top, ()),)
        for key in ("fields", "when", "tlv"):
            if key in self._top.model_fields_set:
                self._fault((key,), "stands in each of `frames` where there are several")
        return tuple(self._frame_type(one, ("frames", i)) for i, one in enumerate(self._top.frames))

    def _frame_type(self, table: FrameTable, where: KeyPath) -> FrameType:
        if self._lines and where and table.tlv is not None:
            self._fault((*where, "tlv"), "unknown key; lines have no elements", FaultCode.UNKNOWN)
        when = None if table.when is None else self._selector(table.when, (*where, "when"))
        elements = None
        if (tlv := table.tlv) is not None:
            elements = Elements(**tlv.model_dump(exclude={"endian"}), big_endian=tlv.endian == "big")
        if where and when is not None and "fields" not in table.model_fields_set:
            return FrameType((), when)
        if not table.fields:
            self._fault((*where, "fields"), "must be a list of at least one field", FaultCode.MISSING)
        rows = [self._fields(one, (*where, "fields", i), elements) for i, one in enumerate(table.fields)]
        return FrameType(tuple(field for row in rows for field in row), when, elements)

    def _fields(self, table: FieldTable, where: KeyPath, elements: Elements | None) -> list[Field]:
        """Return one field, or the several of an array."""
        given = table.model_fields_set
        needed = {"at"} if elements is None else {"id"}
        needed |= set() if self._lines else {"type"}
        unfit = given & ({"type", "endian", "bits"} if self._lines else set())
        unfit |= given & ({"id"} if elements is None else set())
        for key in sorted(needed - given):
            self._fault((*where, key), "is missing", FaultCode.MISSING)
        for key in sorted(unfit):
            problem = f"unknown key: {'lines have no such' if self._lines else 'there is no `tlv`'}"
            self._fault((*where, key), problem, FaultCode.UNKNOWN)
        kind = "text" if self._lines else table.type or "u8"
        if table.bits is not None and (kind[0] not in "ui" or sum(table.bits) > 8 * TYPE_SIZES[kind]):
            whole = f"must be the lowest bit and the number of bits, within {8 * TYPE_SIZES[kind]} of them"
            self._fault((*where, "bits"), whole if kind[0] in "ui" else f"are those of whole numbers, not of {kind}")
        names = table.name
        if table.count is not None and len(names) > 1:
            self._fault((*where, "count"), "excludes a list of names")
        elif table.count is not None:
            names = [f"{names[0]}_{i}" for i in range(table.count)]
        return [
            Field(
                name=name,
                at=(table.at or 0) + i * TYPE_SIZES.get(kind, 1),
                type=kind,
                big_endian=(table.endian or self._top.endian) == "big",
                scale=table.scale,
                offset=table.offset,
                unit=table.unit,
                element=table.id if elements is not None else None,
                bits=table.bits,
                plausible=table.plausible,
            )
            for i, name in enumerate(names)
        ]

    def _selector(self, table: WhenTable, where: KeyPath) -> Selector:
        if self._lines:
            if not isinstance(table.equals, str) or not table.equals:
                self._fault((*where, "equals"), f"must be a text, found {table.equals!r}", FaultCode.TYPE)
            return Selector(table.at, str(table.equals).encode())
        if table.text is not None:
            if table.equals is not None:
                self._fault((*where, "text"), "excludes `equals`")
            return Selector(table.at, table.text.encode())
        if isinstance(table.equals, str):
            try:
                return Selector(table.at, bytes.fromhex(table.equals))
            except ValueError:
                problem = f"must be bytes in hexadecimal, found {table.equals!r}"
                self._fault((*where, "equals"), problem, FaultCode.VALUE)
                return Selector(table.at, b"")
        if table.equals is None or not 0 <= table.equals <= 255:
            problem = f"must be a byte from 0 to 255 or bytes in hexadecimal, found {table.equals!r}"
            self._fault((*where, "equals"), problem, FaultCode.VALUE)
            return Selector(table.at, b"")
        return Selector(table.at, bytes([table.equals]))


def _contradictions(framing: Framing) -> list[Fault]:
    """Find what each key alone does not show."""
    fields = (_FRAMING, "fields")
    names = [field.name for field in framing.fields]
    doubled = [name for name in sorted(set(names)) if names.count(name) > 1]
    faults = [Fault(fields, f"{name!r} is there {names.count(name)} times", FaultCode.DUPLICATE) for name in doubled]
    for key, used in (("counter", framing.counter), ("device_time", framing.device_time)):
        if used is not None and used.field not in names:
            problem = f"no field {used.field!r}; there are {', '.join(names)}"
            faults.append(Fault((_FRAMING, key, "field"), problem, FaultCode.UNKNOWN))
    if framing.kind in ("sync", "fixed"):
        wrong = _contradictions_of_length(framing)
        faults += [Fault((_FRAMING, *key), problem, FaultCode.CONTRADICTION) for key, problem in wrong]
    return faults


def _contradictions_of_length(framing: Framing) -> list[tuple[KeyPath, str]]:
    faults: list[tuple[KeyPath, str]] = [
        (("length", "of"), f"{length} bytes for {value:#x} do not hold the head, or exceed `max`")
        for value, length in framing.length.by_value.items()
        if not framing.length.head <= length <= framing.maximum
    ]
    if (fixed := framing.length.fixed) is None:
        return faults
    data, checksum = fixed - framing.trailer, framing.checksum
    if fixed < len(framing.sync) + framing.trailer:
        faults.append((("length", "fixed"), f"{fixed} bytes do not hold the sync bytes and the checksum"))
    if fixed > framing.maximum:
        faults.append((("max",), f"{framing.maximum} is less than the fixed length {fixed}"))
    if checksum is not None and checksum.start > data:
        faults.append((("checksum", "from"), f"byte {checksum.start} lies behind the frame's data"))
    return faults + [
        ((Row("fields", field.name),), f"its bytes from {field.at} lie behind the frame's data")
        for field in framing.fields
        if field.element is None and field.at + field.size > data
    ]
