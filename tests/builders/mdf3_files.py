"""MDF 2 and 3 files built from bytes, in either byte order."""

from __future__ import annotations

import struct
from collections.abc import Sequence

UNSIGNED, SIGNED, FLOAT, DOUBLE = range(4)
"""Data types in the byte order of the file."""
MOTOROLA, INTEL = 9, 13
"""What is added to them for an order of their own."""
DATA, TIME = 0, 1
LINEAR, INTERPOLATED, NEAREST, POLYNOMIAL, RATIONAL, NO_CONVERSION = 0, 1, 2, 6, 9, 65535
SHORT_CHANNEL, LONG_CHANNEL = 218, 228


class OldFile:
    """Blocks, each with the address that it will have.

    Parameters
    ----------
    order
        Of blocks and numbers, as `struct` writes it.
    numbers_order
        What the identification states; that of the blocks if it is None.
    """

    def __init__(
        self, *, order: str = "<", numbers_order: str | None = None, version: str = "3.30", mark: bytes = b"MDF     ",
        flags: tuple[int, int] = (0, 0), code_page: int = 0, float_format: int = 0,
    ) -> None:  # fmt: skip
        self.order, self.has_stamp = order, version >= "3.20"
        is_motorola = (numbers_order or order) == ">"
        self.content = bytearray(
            struct.pack(f"{order}8s8s8s4H28s2H", mark, version.encode(), b"tests", is_motorola, float_format,
                        int(version.replace(".", "")), code_page, b"", *flags)
        )  # fmt: skip
        self.content += bytes(208 if self.has_stamp else 164)

    def add(self, kind: str, layout: str, *fields: object) -> int:
        at = len(self.content)
        body = struct.pack(self.order + layout, *fields)
        self.content += struct.pack(f"{self.order}2sH", kind.encode(), min(4 + len(body), 0xFFFF)) + body
        return at

    def text(self, text: str, encoding: str = "latin-1") -> int:
        body = text.encode(encoding) + b"\0"
        return self.add("TX", f"{len(body)}s", body)

    def conversion(self, kind: int, *values: float, unit: bytes = b"", count: int | None = None) -> int:
        if count is None:
            count = len(values) // 2 if kind in (INTERPOLATED, NEAREST) else len(values)
        return self.add("CC", f"H2d20s2H{len(values)}d", 0, 0.0, 0.0, unit, kind, count, *values)

    def channel(
        self, name: str, kind: int, start: int, bits: int, data_type: int, following: int = 0, *, conversion: int = 0,
        source: int = 0, parts: int = 0, comment: int = 0, description: bytes = b"", rate: float = 0.0,
        long_name: int = 0, bytes_before: int = 0, length: int = LONG_CHANNEL,
    ) -> int:  # fmt: skip
        layout = "5IH32s128s4H3d2IH"
        fields = (
            following, conversion, source, parts, comment, kind, name.encode("latin-1"), description, start, bits,
            data_type, 0, 0.0, 0.0, rate, long_name, 0, bytes_before,
        )  # fmt: skip
        at = self.add("CN", layout, *fields)
        del self.content[at + length :]
        struct.pack_into(f"{self.order}H", self.content, at + 2, length)
        return at

    def group(
        self, channel: int, width: int, count: int, following: int = 0, *, number: int = 0, comment: int = 0,
        reduced: int = 0,
    ) -> int:  # fmt: skip
        fields = (following, channel, comment, number, 1, width, count, reduced)
        return self.add("CG", "3I3HII", *fields)

    def records(self, records: bytes) -> int:
        at = len(self.content)
        self.content += records
        return at

    def data_group(self, group: int, data: int, following: int = 0, *, groups: int = 1, numbers: int = 0) -> int:
        return self.add("DG", "4I2H4x", following, group, 0, data, groups, numbers)

    def closed(
        self, first: int, *, date: bytes = b"03:08:2026", time: bytes = b"14:23:05", stamp_ns: int = 0,
        offset_h: int = 0, comment: int = 0, author: bytes = b"",
    ) -> bytes:  # fmt: skip
        """All of the file, with its header."""
        length = 208 if self.has_stamp else 164
        header = struct.pack(
            f"{self.order}2sH3IH10s8s32s32s32s32s", b"HD", length, first, comment, 0, 1, date, time, author, b"", b"",
            b"range 7",
        )  # fmt: skip
        if self.has_stamp:
            header += struct.pack(f"{self.order}QhH32s", stamp_ns, offset_h, 0, b"")
        self.content[64 : 64 + length] = header
        return bytes(self.content)


def one_channel(
    stored: bytes, width: int, data_type: int, bits: int, *, file: OldFile | None = None, start: int = 0,
    conversion: tuple[float, ...] = (), conversion_at: int = 0, bytes_before: int = 0, tick_s: float = 0.5,
) -> bytes:  # fmt: skip
    """A file of a channel `a` over a count of ticks, 2 bytes behind it in each record.

    Parameters
    ----------
    stored
        Records without their ticks, one after another.
    width
        Bytes of each.
    conversion
        Its kind and its values.
    conversion_at
        Address of one that is there.
    """
    made = OldFile() if file is None else file
    count = len(stored) // width
    ticks = made.conversion(LINEAR, 0.0, tick_s, unit=b"s")
    time = made.channel("t", TIME, 0, 16, UNSIGNED, conversion=ticks, bytes_before=width)
    at = made.conversion(int(conversion[0]), *conversion[1:], unit=b"V") if conversion else conversion_at
    value = made.channel("a", DATA, start, bits, data_type, time, conversion=at, bytes_before=bytes_before)
    rows = [stored[width * n : width * (n + 1)] + struct.pack(f"{made.order}H", n) for n in range(count)]
    group = made.group(value, width + 2, count)
    return made.closed(made.data_group(group, made.records(b"".join(rows))))


def small_old_mdf(order: str = "<", mark: bytes = b"MDF     ", stated: int = 12, remark: str = "carriage") -> bytes:
    """A file of a channel of counts and one of floats, whose records stand at its end."""
    file = OldFile(order=order, mark=mark)
    time = file.channel("time", TIME, 0, 64, DOUBLE, conversion=file.conversion(NO_CONVERSION, unit=b"s"))
    scale = file.conversion(LINEAR, 1.0, 0.5, unit=b"m/s2")
    acc = file.channel("acc", DATA, 64, 16, SIGNED, time, conversion=scale, comment=file.text(remark))
    p = file.channel("p", DATA, 80, 32, FLOAT, acc, long_name=file.text("p of the recoil brake, before the valve"))
    group = file.group(p, 14, stated, comment=file.text("fast"))
    at = file.data_group(group, 0)
    rows = b"".join(struct.pack(f"{order}dhf", n / 1000, n - 3, 0.5 * n - 2.0) for n in range(12))
    struct.pack_into(f"{order}I", file.content, at + 16, file.records(rows))
    return file.closed(at)


def stored_together(rows: Sequence[tuple[int, float, int]], *, behind: bool = False) -> bytes:
    """A file of two groups, `a` of 16 bits and `b` of 8, by number of the group, time and sample."""
    file = OldFile()
    second = file.conversion(LINEAR, 0.0, 1.0, unit=b"s")
    following = 0
    for number, (name, bits) in enumerate((("b", 8), ("a", 16)), start=1):
        value = file.channel(name, DATA, 32, bits, UNSIGNED)
        time = file.channel("t", TIME, 0, 32, FLOAT, value, conversion=second)
        count = sum(row[0] == number for row in rows)
        following = file.group(time, 4 + bits // 8, count, following, number=number)
    records = b"".join(
        struct.pack("<BfB" if number == 1 else "<BfH", number, t, sample) + bytes([number]) * behind
        for number, t, sample in rows
    )
    return file.closed(file.data_group(following, file.records(records), groups=2, numbers=1 + behind))
