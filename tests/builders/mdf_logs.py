"""MDF 4 bus logging built from bytes: closed files of sorted groups, and what loggers write until they are stopped."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

from tests.builders.vendor_files import CanEntry

START_NS = 1_700_000_000_000_000_000


class Blocks:
    """Blocks of MDF 4, each with the address that it will have."""

    def __init__(self, head: bytes) -> None:
        self.content = bytearray(head)

    def add(self, kind: str, links: Sequence[int], body: bytes) -> int:
        at = len(self.content)
        size = 24 + 8 * len(links) + len(body)
        self.content += struct.pack(f"<4s4xQQ{len(links)}Q", kind.encode(), size, len(links), *links) + body
        self.content += bytes(-len(self.content) % 8)
        return at

    def text(self, text: str) -> int:
        return self.add("##TX", (), text.encode() + bytes(8 - len(text) % 8))

    def column(
        self,
        title: str,
        kind: int,
        data_type: int,
        at: int,
        bits: int,
        following: int,
        *,
        inside: int = 0,
        conversion: int = 0,
        data: int = 0,
        bit: int = 0,
    ) -> int:
        body = struct.pack("<BBBBLLLLBBHdddddd", kind, kind // 2, data_type, bit, at, bits, 0, 0, 0, 0, 0, *[0.0] * 6)
        return self.add("##CN", (following, inside, self.text(title), 0, conversion, data, 0, 0), body)

    def linear(self, offset: float, factor: float, unit: str = "") -> int:
        unit_at = self.text(unit) if unit else 0
        return self.add("##CC", (0, unit_at, 0, 0), struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, offset, factor))

    def table(self, pairs: Sequence[tuple[float, float]], kind: int = 5) -> int:
        numbers = [number for pair in pairs for number in pair]
        body = struct.pack(f"<BBHHHdd{len(numbers)}d", kind, 0, 0, 0, len(numbers), 0.0, 0.0, *numbers)
        return self.add("##CC", (0, 0, 0, 0), body)

    def closed(self, first_group: int) -> bytes:
        """All of the file, with its header."""
        header = struct.pack(
            "<4s4xQQ6QQhhBBBBdd", b"##HD", 104, 6, first_group, 0, 0, 0, 0, 0, START_NS, 0, 0, 0, 0, 0, 0, 0, 0
        )
        self.content[64 : 64 + len(header)] = header
        return bytes(self.content)


def bus_log(
    entries: Sequence[CanEntry],
    *,
    first_s: float = 0.25,
    errors: int = 0,
    identification: bytes = b"MDF     ",
    buses: Sequence[int] = (),
) -> bytes:
    """A sorted, finished file of one or two groups, whose texts stand before its samples; on bus 1 if not on others."""
    blocks = Blocks(identification_block(identification))
    groups = [("CAN_DataFrame", entries)]
    if errors:
        groups.append(("CAN_ErrorFrame", [(0, 0, bytes(8))] * errors))
    following = 0
    for name, frames in reversed(groups):
        following = _mdf_group(blocks, name, frames, first_s, following, buses or [1] * len(frames))
    return blocks.closed(following)


def sourced_log(groups: Sequence[tuple[str, Sequence[CanEntry]]]) -> bytes:
    """A group for each source of records, which alone says on which bus they came."""
    blocks = Blocks(identification_block(b"MDF     "))
    following = 0
    for source, frames in reversed(groups):
        buses = [1] * len(frames)
        following = _mdf_group(blocks, "CAN_DataFrame", frames, 0.25, following, buses, source=source)
    return blocks.closed(following)


def _mdf_group(
    blocks: Blocks,
    name: str,
    frames: Sequence[CanEntry],
    first_s: float,
    following: int,
    buses: Sequence[int],
    source: str = "",
) -> int:
    """Columns from the last to the first, because each links to the next."""

    parts = [("ID", 0, 8, 32), ("IDE", 0, 12, 8), ("BusChannel", 0, 13, 8), ("DataLength", 0, 14, 8)]
    if source:
        parts = [part for part in parts if part[0] != "BusChannel"]
    inside = 0
    for title, data_type, at, bits in reversed([*parts, ("DataBytes", 10, 15, 64)]):
        inside = blocks.column(f"{name}.{title}", 0, data_type, at, bits, inside)
    link = blocks.column("t", 2, 4, 0, 64, blocks.column(name, 0, 10, 8, 120, 0, inside=inside))
    source_at = blocks.add("##SI", (blocks.text(source or "CAN"), 0, 0), struct.pack("<BBB5x", 2, 2, 0))
    rows = b"".join(
        struct.pack("<dIBBB8s", first_s + t / 1e9, key & 0x1FFFFFFF, key >> 31, bus, len(data), data)
        for (t, key, data), bus in zip(frames, buses, strict=True)
    )
    group = blocks.add("##CG", (0, link, 0, source_at, 0, 0), struct.pack("<QQHHLLL", 0, len(frames), 6, 0, 0, 23, 0))
    samples = blocks.add("##DT", (), rows)
    return blocks.add("##DG", (following, group, samples, 0), bytes(8))


def identification_block(mark: bytes, flags: int = 0) -> bytes:
    head = mark + b"4.10    tests   ".ljust(20, b"\0") + struct.pack("<H", 410)
    return head.ljust(60, b"\0") + struct.pack("<HH", flags, 0) + bytes(104)


COUNTS, LAST_LENGTH, OFFSETS = 0x0001, 0x0004, 0x0040
"""What a recorder has not written when it is stopped."""


def logger_file(entries: Sequence[CanEntry], *, unwritten: int = 0, first_ns: int = 250_000_000) -> bytes:
    """Frames, their data of variable length, and error frames, stored together as they came: stamps are whole ns.

    An identifier has 29 bits, and the byte behind them its flag, as loggers pack them.
    """
    mark = b"UnFinMF " if unwritten else b"MDF     "
    blocks = Blocks(identification_block(mark, unwritten))
    rows, written = b"", 0
    for time_ns, key, data in entries:
        offset = 0 if unwritten & OFFSETS else written
        packed_id = key & 0x1FFFFFFF | (key >> 31) << 31
        rows += struct.pack("<BQIBBQ", 1, first_ns + time_ns, packed_id, 1, len(data), offset)
        rows += struct.pack("<BI", 2, len(data)) + data
        written += 4 + len(data)
    rows += struct.pack("<BQ", 3, first_ns) * 2
    counts = (0, 0, 0) if unwritten & COUNTS else (len(entries), 0, 2)
    size = 0 if unwritten else written
    nanoseconds = blocks.linear(0.0, 1e-9)
    values = blocks.add("##CG", (0, 0, 0, 0, 0, 0), struct.pack("<QQHHLLL", 2, counts[0], 1, 0, 0, size, 0))
    name = "CAN_DataFrame"
    parts = [("ID", 0, 8, 29, 0), ("IDE", 0, 11, 1, 7), ("BusChannel", 0, 12, 8, 0), ("DataLength", 0, 13, 8, 0)]
    inside = blocks.column(f"{name}.DataBytes", 1, 10, 14, 64, 0, data=values)
    for title, data_type, at, bits, bit in reversed(parts):
        inside = blocks.column(f"{name}.{title}", 0, data_type, at, bits, inside, bit=bit)
    frames = blocks.column(name, 0, 10, 8, 112, 0, inside=inside)
    errors = blocks.column("t", 2, 0, 0, 64, blocks.column("CAN_ErrorFrame", 0, 10, 8, 0, 0), conversion=nanoseconds)
    last = blocks.add("##CG", (0, errors, 0, 0, 0, 0), struct.pack("<QQHHLLL", 3, counts[2], 6, 0, 0, 8, 0))
    struct.pack_into("<Q", blocks.content, values + 24, last)
    times = blocks.column("t", 2, 0, 0, 64, frames, conversion=nanoseconds)
    first = blocks.add("##CG", (values, times, 0, 0, 0, 0), struct.pack("<QQHHLLL", 1, counts[0], 6, 0, 0, 22, 0))
    group_at = blocks.add("##DG", (0, first, 0, 0), struct.pack("<B7x", 1))
    samples = blocks.add("##DT", (), rows)
    del blocks.content[samples + 24 + len(rows) :]
    struct.pack_into("<Q", blocks.content, group_at + 24 + 16, samples)
    if unwritten & LAST_LENGTH:
        struct.pack_into("<Q", blocks.content, samples + 8, 24)
    return blocks.closed(group_at)


LENGTH_CODES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def virtual_log(entries: Sequence[CanEntry], *, bus: float = 9.0, computed_times: bool = False) -> bytes:
    """Frames of FD, plain and extended ones in groups of their own, stored together.

    What all frames of a group share takes no bits of a record, but is the constant of a conversion; a frame has a
    code of its length, whose conversion is a table.

    Parameters
    ----------
    entries : sequence of (time_ns, key, data)
    bus : float
    computed_times : bool
        Whether the times are the numbers of the records, a millisecond each, too.
    """
    blocks = Blocks(identification_block(b"MDF     "))
    name, time_bytes = "CAN_DataFrame", 0 if computed_times else 8
    rows, following = b"", 0
    for time_ns, key, data in entries:
        time = b"" if computed_times else struct.pack("<Q", time_ns)
        code = struct.pack("<IB", key & 0x1FFFFFFF, LENGTH_CODES.index(len(data)))
        rows += bytes([1 + (key >> 31)]) + time + code + data.ljust(64, b"\0")
    lengths = blocks.table(list(enumerate(map(float, LENGTH_CODES))))
    for extended in (1, 0):
        inside = blocks.column(f"{name}.DataBytes", 0, 10, time_bytes + 5, 512, 0)
        inside = blocks.column(f"{name}.DataLength", 0, 0, time_bytes + 4, 4, inside, conversion=lengths)
        for title, value in (("EDL", 1.0), ("IDE", float(extended)), ("BusChannel", bus)):
            constant = blocks.linear(value, 0.0)
            inside = blocks.column(f"{name}.{title}", 6, 0, 0, 0, inside, conversion=constant)
        inside = blocks.column(f"{name}.ID", 0, 0, time_bytes, 29 if extended else 11, inside)
        frames = blocks.column(name, 0, 10, time_bytes, 8 * 69, 0, inside=inside)
        kind, bits = (3, 0) if computed_times else (2, 64)
        unit = blocks.linear(0.0, 1e-3 if computed_times else 1e-9)
        times = blocks.column("t", kind, 0, 0, bits, frames, conversion=unit)
        count = sum(key >> 31 == extended for _, key, _ in entries)
        fields = struct.pack("<QQHHLLL", 1 + extended, count, 6, 0, 0, time_bytes + 69, 0)
        following = blocks.add("##CG", (following, times, 0, 0, 0, 0), fields)
    group_at = blocks.add("##DG", (0, following, 0, 0), struct.pack("<B7x", 1))
    samples = blocks.add("##DT", (), rows)
    del blocks.content[samples + 24 + len(rows) :]
    struct.pack_into("<Q", blocks.content, group_at + 24 + 16, samples)
    return blocks.closed(group_at)


def listed_log(entries: Sequence[CanEntry], *, transposed: bool = False, first_s: float = 0.25) -> bytes:
    """Frames in several blocks, every other one packed, and their data in blocks of their own."""
    blocks = Blocks(identification_block(b"MDF     "))
    rows, values = [], b""
    for time_ns, key, data in entries:
        rows.append(struct.pack(">dIBBQ", first_s + time_ns / 1e9, key, key >> 31, len(data), 0)[:14])
        rows[-1] += struct.pack("<Q", len(values))
        values += struct.pack("<I", len(data)) + data
    half = len(rows) // 2
    name = "CAN_DataFrame"
    inside = blocks.column(f"{name}.DataBytes", 1, 10, 14, 64, 0, data=_list_of(blocks, [values], b"SD", transposed))
    for title, data_type, at, bits in [("DataLength", 0, 13, 8), ("IDE", 0, 12, 8), ("ID", 1, 8, 32)]:
        inside = blocks.column(f"{name}.{title}", 0, data_type, at, bits, inside)
    times = blocks.column("t", 2, 5, 0, 64, blocks.column(name, 0, 10, 8, 112, 0, inside=inside))
    group = blocks.add("##CG", (0, times, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, len(entries), 6, 0, 0, 22, 0))
    stored = _list_of(blocks, [b"".join(rows[:half]), b"".join(rows[half:])], b"DT", transposed)
    return blocks.closed(blocks.add("##DG", (0, group, stored, 0), bytes(8)))


def _list_of(blocks: Blocks, parts: Sequence[bytes], kind: bytes, transposed: bool) -> int:
    """A header of a list, and a list per part."""
    following = 0
    for number, part in reversed(list(enumerate(parts))):
        if number % 2:
            block = blocks.add(f"##{kind.decode()}", (), part)
        else:
            columns = 22 if transposed else 0
            packed = zlib.compress(_turned(part, columns) if transposed else part)
            block = blocks.add(
                "##DZ", (), struct.pack("<2sBxLQQ", kind, bool(transposed), columns, len(part), len(packed)) + packed
            )
        following = blocks.add("##DL", (following, block), struct.pack("<B3xLQ", 0, 1, 0))
    return blocks.add("##HL", (following,), struct.pack("<HBB4x", 0, bool(transposed), 0))


def _turned(data: bytes, columns: int) -> bytes:
    rows = len(data) // columns
    whole = data[: rows * columns]
    return b"".join(whole[column::columns] for column in range(columns)) + data[rows * columns :]


def measured_file(
    groups: Sequence[tuple[str, str, Sequence[tuple[float, float]]]], *, master: tuple[int, int, float] = (4, 64, 1.0)
) -> bytes:
    """Measured channels whose records are stored together as they came: name and unit, and stamps with samples.

    Parameters
    ----------
    groups : sequence of (name, unit, sequence of (stamp, sample))
        Stamps in ticks.
    master : tuple
        Data type and number of bits of the stamps, and the seconds of a tick.
    """
    data_type, bits, tick_s = master
    stamp = {(4, 64): "d", (4, 32): "f", (0, 32): "I", (1, 32): ">I"}[data_type, bits]
    width = struct.calcsize(stamp)
    blocks = Blocks(identification_block(b"MDF     "))
    following, records = 0, []
    for number, (name, unit, rows) in enumerate(groups, start=1):
        value = blocks.column(name, 0, 4, width, 64, 0)
        struct.pack_into("<Q", blocks.content, value + 24 + 6 * 8, blocks.text(unit))
        time = blocks.column("t", 2, data_type, 0, bits, value, conversion=blocks.linear(0.0, tick_s))
        sizes = struct.pack("<QQHHLLL", number, len(rows), 0, 0, 0, width + 8, 0)
        following = blocks.add("##CG", (following, time, blocks.text(name), 0, 0, 0), sizes)
        order = ">" if stamp.startswith(">") else "<"
        records += [
            (t * tick_s, struct.pack("<B", number) + struct.pack(f"{order}{stamp[-1]}", t) + struct.pack("<d", sample))
            for t, sample in rows
        ]
    samples = blocks.add("##DT", (), b"".join(record for _, record in sorted(records, key=lambda one: one[0])))
    return blocks.closed(blocks.add("##DG", (0, following, samples, 0), struct.pack("<B7x", 1)))
