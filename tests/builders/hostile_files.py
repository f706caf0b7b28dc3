"""Recordings that are made to take memory and time: small, and sound as far as their first bytes tell."""

from __future__ import annotations

import gzip
import sqlite3
import struct
import tempfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from tests.builders.can_logs import can_sqlite
from tests.builders.container_files import hdf5_file, mat_file, mat_v73_file, small_wave, uff_header, uff_text
from tests.builders.mdf3_files import DATA, NEAREST, TIME, OldFile
from tests.builders.mdf_logs import Blocks, identification_block
from tests.builders.vendor_files import (
    asc_log,
    blf_log,
    blf_object,
    can_entries,
    candump_log,
    dewesoft_text,
    motion_rows,
)

PACKED = 25_000_000
"""Bytes that packed files unpack to, whatever their size."""


def _blf(objects: bytes, copies: int) -> bytes:
    """A log of one container that unpacks to many copies of some objects."""
    packed = zlib.compress(objects * copies, 9)
    body = struct.pack("<H6xL4x", 2, len(objects) * copies) + packed
    head = blf_log(can_entries(3))[:144]
    return head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body


def blf_frames(_size: int) -> bytes:
    frame = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 256, bytes(8)))
    return _blf(frame, PACKED // len(frame))


def blf_events(_size: int) -> bytes:
    event = struct.pack("<4sHHLL", b"LOBJ", 16, 9, 16, 999)
    return _blf(event, PACKED // len(event))


def blf_fd_frames(_size: int) -> bytes:
    frame = blf_object(101, 5, struct.pack("<BBBBLLLLLLLHBBL", 1, 0, 0, 0, 256, *[0] * 6, 0, 0, 0, 0))
    return _blf(frame, PACKED // len(frame))


def blf_plain_events(size: int) -> bytes:
    event = struct.pack("<4sHHLL", b"LOBJ", 16, 9, 16, 999)
    return blf_log(can_entries(3))[:144] + event * (size // len(event))


def gzip_log(_size: int) -> bytes:
    text = asc_log(can_entries(3))
    return gzip.compress(text + b"\n" * PACKED, 9)


def sqlite_blob(size: int) -> bytes:
    return can_sqlite(can_entries(3), extra=[(1.0, 1, 0, 0, 0, 8, bytes(size))] * 3)


def sqlite_text_stamp(size: int) -> bytes:
    return can_sqlite(can_entries(3), extra=[("1" * size, "2" * size, 0, 0, 0, 8, b"")])


def _database(page_size: int, rows: int, width: int) -> bytearray:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.db"
        with closing(sqlite3.connect(path)) as base:
            base.execute(f"PRAGMA page_size = {page_size}")
            base.execute(
                "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER,"
                " error INTEGER, dlc INTEGER, data BLOB)"
            )
            row = (1.5, 1, 0, 0, 0, min(width, 8), bytes(width))
            base.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", [row] * rows)
            base.commit()
        return bytearray(path.read_bytes())


def sqlite_shared_pages(size: int) -> bytes:
    """All pointers of each inner page lead to the one page below: rows without end out of few pages."""
    page = 512
    content = _database(page, max(size // 40, 4000), 8)
    inner = [at for at in range(page, len(content), page) if content[at] == 5][:8]
    leaf = next(at for at in range(page, len(content), page) if content[at] == 13)
    for at, below in zip(inner, [*inner[1:], leaf], strict=True):
        child = struct.pack(">L", below // page + 1)
        (cells,) = struct.unpack_from(">H", content, at + 3)
        for k in range(cells):
            place = struct.unpack_from(">H", content, at + 12 + 2 * k)[0]
            content[at + place : at + place + 4] = child
        content[at + 8 : at + 12] = child
    return bytes(content)


def sqlite_shared_overflow(size: int) -> bytes:
    """Every row's data run on into the chain of pages of the first row's."""
    rows = 20
    content = _database(4096, rows, size)[:]
    tails: list[int] = []
    for at in range(4096, len(content), 4096):
        if content[at] == 13:
            (cells,) = struct.unpack_from(">H", content, at + 3)
            tails += [at + struct.unpack_from(">H", content, at + 8 + 2 * k)[0] for k in range(cells)]
    return bytes(content) if not tails else _with_one_tail(content, tails)


def _with_one_tail(content: bytearray, cells: list[int]) -> bytes:
    def local_end(at: int) -> int:
        payload, n = 0, 0
        while True:
            payload = payload << 7 | content[at + n] & 0x7F
            n += 1
            if not content[at + n - 1] & 0x80:
                break
        while content[at + n] & 0x80:
            n += 1
        n += 1
        usable = 4096
        least = (usable - 12) * 32 // 255 - 23
        local = least + (payload - least) % (usable - 4)
        return at + n + (local if local <= usable - 35 else least)

    first = content[local_end(cells[0]) : local_end(cells[0]) + 4]
    for at in cells:
        content[local_end(at) : local_end(at) + 4] = first
    return bytes(content)


def uff_short_numbers(size: int) -> bytes:
    count = size // 2
    return b"    -1\n    58\n" + uff_header(count) + b"1 " * count + b"\n    -1\n"


def uff_other_datasets(size: int) -> bytes:
    return uff_text(np.arange(8.0)) + b"-1\n15\n-1\n" * (size // 9)


def uff_without_end(size: int) -> bytes:
    return b"    -1\n    58\n" + uff_header(1000) + b" \n" * (size // 2)


def uff_spaces(size: int) -> bytes:
    return uff_text(np.arange(8.0)) + b"    -1\n  15\n" + (b"-1" + b" " * 1000 + b"x\n") * (size // 1003)


def _hdf5_packed(*names: str) -> bytes:
    def fill(file: Any) -> None:
        for name in names:
            data = file.create_dataset(name, (PACKED // 8,), "f8", compression="gzip", chunks=(PACKED // 80,))
            data[:] = 0.0
            data.attrs["sample_rate"] = 1000.0

    return hdf5_file(fill)


def hdf5_zeros(_size: int) -> bytes:
    return _hdf5_packed("a")


def hdf5_times(_size: int) -> bytes:
    return _hdf5_packed("time", "a")


def hdf5_many(size: int) -> bytes:
    def fill(file: Any) -> None:
        for k in range(size // 500):
            file.create_dataset(f"d{k}", data=np.zeros(3)).attrs["sample_rate"] = 10.0

    return hdf5_file(fill, libver="latest")


def hdf5_link(size: int) -> bytes:
    def fill(file: Any) -> None:
        import h5py

        file.create_dataset("a", data=np.zeros(size // 8)).attrs["sample_rate"] = 10.0
        file["b"] = h5py.ExternalLink("/etc/passwd", "/")
        file["time"] = h5py.SoftLink("/time")

    return hdf5_file(fill)


def hdf5_deep(size: int) -> bytes:
    """Groups within groups, which the library follows from the root each time."""

    def fill(file: Any) -> None:
        group = file
        for _ in range(size // 150):
            group = group.create_group("g")
        group.create_dataset("a", data=np.zeros(3)).attrs["sample_rate"] = 10.0

    return hdf5_file(fill, libver="latest")


def hdf5_wide(size: int) -> bytes:
    def fill(file: Any) -> None:
        for k in range(size // 10):
            file.create_group(f"g{k}")

    return hdf5_file(fill, libver="latest")


def hdf5_attributes(size: int) -> bytes:
    def fill(file: Any) -> None:
        data = file.create_dataset("a", data=np.zeros(3))
        data.attrs["sample_rate"] = 10.0
        for k in range(size // 7):
            data.attrs[f"x{k}"] = 1.0

    return hdf5_file(fill, libver="latest")


def hdf5_shapes(size: int) -> bytes:
    """Datasets of terabytes of which nothing, or one block, was ever written."""

    def fill(file: Any) -> None:
        for k in range(size // 3000):
            made = {"shape": (1 << 40,), "chunks": (1 << 16,), "dtype": "f8"}
            data = file.create_dataset(f"a{k}", **made, **({"compression": "gzip"} if k % 2 else {}))
            data.attrs["sample_rate"] = 10.0
            if k % 2:
                data[0] = 1.0

    return hdf5_file(fill)


def hdf5_circle(size: int) -> bytes:
    """Groups that hold themselves and one another."""

    def fill(file: Any) -> None:
        file.create_dataset("a", data=np.zeros(3)).attrs["sample_rate"] = 10.0
        groups = [file.create_group(f"g{k}") for k in range(20)]
        for k, group in enumerate(groups):
            for n, other in enumerate([file["/"], *groups[: size // 10_000]]):
                group[f"again {k} {n}"] = other

    return hdf5_file(fill)


def mat_zeros(_size: int) -> bytes:
    return mat_file({"t": np.zeros(PACKED // 8), "x": np.zeros(PACKED // 8)}, compressed=True)


def mat_columns(_size: int) -> bytes:
    columns = np.zeros((20_000, 100))
    columns[:, -1] = np.arange(20_000) / 8
    return mat_file({"X": columns}, compressed=True)


def mat73_zeros(size: int) -> bytes:
    return mat_v73_file({"t": np.zeros(size // 16), "x": np.zeros(size // 16)})


def _measured(columns: int, rows: int, data_links: int, packed: bool) -> bytes:
    """Channels that share one byte of a record; records that are listed again and again."""
    blocks = Blocks(identification_block(b"MDF     "))
    following = 0
    for k in range(columns):
        following = blocks.column(f"c{k}", 0, 0, 0, 8, following)
    first = blocks.column("t", 3, 0, 0, 0, following, conversion=blocks.linear(0.0, 0.001))
    group = blocks.add(
        "##CG", (0, first, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, rows * data_links, 0, 0, 0, 1, 0)
    )  # fmt: skip
    raw = bytes(rows)
    if packed:
        inside = zlib.compress(raw, 9)
        data = blocks.add("##DZ", (), struct.pack("<2sBxLQQ", b"DT", 0, 0, len(raw), len(inside)) + inside)
    else:
        data = blocks.add("##DT", (), raw)
    if data_links > 1:
        offsets = struct.pack("<B3xLQ", 1, data_links, rows)
        data = blocks.add("##DL", (0, *[data] * data_links), offsets)
    return blocks.closed(blocks.add("##DG", (0, group, data, 0), bytes(8)))


def mdf_shared_byte(size: int) -> bytes:
    return _measured(size // 2 // 250, size // 2, 1, packed=False)


def mdf_listed_again(size: int) -> bytes:
    return _measured(2, size // 2, size // 2 // 8, packed=False)


def mdf_packed(_size: int) -> bytes:
    return _measured(2, PACKED, 1, packed=True)


def mdf_one_table(size: int) -> bytes:
    """A file whose channels all have the one conversion, a table as long as one can be."""
    blocks = Blocks(identification_block(b"MDF     "))
    table = blocks.table([(float(n), 0.0) for n in range(min(size // 32, 32_000))])
    following = 0
    for number in range(size // 2 // 240):
        following = blocks.column(f"c{number}", 0, 0, 0, 8, following, conversion=table)
    first = blocks.column("t", 3, 0, 0, 0, following, conversion=blocks.linear(0.0, 0.001))
    group = blocks.add("##CG", (0, first, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, 9, 0, 0, 0, 1, 0))
    return blocks.closed(blocks.add("##DG", (0, group, blocks.add("##DT", (), bytes(9)), 0), bytes(8)))


def mdf_ranges_over_one_another(size: int) -> bytes:
    """Channels with a conversion each, of which the next one begins within it."""
    blocks = Blocks(identification_block(b"MDF     "))
    count, ranges = size // 2 // (80 + 240), min(size // 2 // 24, 21_000)  # 65,535 numbers at most
    first = len(blocks.content)
    head = struct.pack("<4s4xQQ4QBBHHHdd", b"##CC", 80 + 8 + 24 * ranges, 4, *[0] * 4, 6, 0, 0, 0, 3 * ranges + 1, 0, 0)
    blocks.content += head * count + bytes(8 + 24 * ranges)
    following = 0
    for n in range(count):
        following = blocks.column("a", 0, 0, 0, 8, following, conversion=first + 80 * n)
    following = blocks.column("t", 3, 0, 0, 0, following, conversion=blocks.linear(0.0, 0.001))
    group = blocks.add("##CG", (0, following, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, 9, 0, 0, 0, 1, 0))
    return blocks.closed(blocks.add("##DG", (0, group, blocks.add("##DT", (), bytes(9)), 0), bytes(8)))


def _old_group(file: OldFile, columns: int, conversion: int = 0, long_name: int = 0) -> int:
    """The first of some channels that share one byte, and of their time."""
    following = file.channel("t", TIME, 0, 0, 0, rate=0.001)
    for _ in range(columns):
        following = file.channel(
            "a", DATA, 0, 8, 0, following, conversion=conversion, long_name=long_name, comment=long_name
        )
    return following


def old_mdf_shared_byte(size: int) -> bytes:
    file = OldFile()
    group = file.group(_old_group(file, size // 2 // 228), 1, size // 2)
    return file.closed(file.data_group(group, file.records(bytes(size // 2))))


def old_mdf_shared_records(size: int) -> bytes:
    """Groups that all have the same records."""
    file, following = OldFile(), 0
    records = file.records(bytes(size // 2))
    for _ in range(size // 2 // 514):
        following = file.data_group(file.group(_old_group(file, 1), 1, size // 2), records, following)
    return file.closed(following)


def old_mdf_one_table(size: int) -> bytes:
    """Channels that all have the longest of conversions, and the longest of names and comments."""
    file = OldFile()
    table = file.conversion(NEAREST, *[float(n) for n in range(8000)])
    group = file.group(_old_group(file, (size - 64_000) // 228, table, file.text("n" * 60_000)), 1, 9)
    return file.closed(file.data_group(group, file.records(bytes(9))))


def old_mdf_over_one_another(size: int) -> bytes:
    """Blocks of channels of which the next one begins within each."""
    file = OldFile()
    group = file.group(len(file.content) + 30, 1, 9)
    first = len(file.content)
    for at in range(first, first + size, 8):
        file.content += struct.pack("<2sHI", b"CN", 228, at + 8)
    return file.closed(file.data_group(group, file.records(bytes(9))))


def old_mdf_tables_over_one_another(size: int) -> bytes:
    """Channels with a table each, of which the next one begins within it: its keys rise all the same."""
    file, pairs, count = OldFile(), min(size // 2 // 16, 60_000), min(size // 2 // (64 + 228), 16_000)
    tables = bytearray(64 * count + 16 * (pairs + 4))
    for n in range(1, len(tables) // 16):
        # the four highest bytes of a key; every fourth key begins with the length that a table states
        struct.pack_into("<2H", tables, 16 * n + 2, (n - 1) % 4, 16 + (n - 1) // 4)
    for at in range(0, 64 * count, 64):
        struct.pack_into("<2sH", tables, at, b"CC", 0xFFFF)
        struct.pack_into("<2H", tables, at + 42, NEAREST, pairs)
    first = file.records(tables)
    following = file.channel("t", TIME, 0, 0, 0, rate=0.001)
    for n in range(count):
        following = file.channel("a", DATA, 0, 8, 0, following, conversion=first + 64 * n)
    return file.closed(file.data_group(file.group(following, 1, 9), file.records(bytes(9))))


def text_zeros(size: int) -> bytes:
    return dewesoft_text(motion_rows()) + bytes(size)


def text_long_line(size: int) -> bytes:
    return dewesoft_text(motion_rows()) + b"1" * size


def text_columns(size: int) -> bytes:
    return b"Time (s)" + b";a" * (size // 2) + b"\n0.0" + b";1" * (size // 2) + b"\n"


def text_lines(size: int) -> bytes:
    return dewesoft_text(motion_rows()) + b"\n" * size


def candump_zeros(size: int) -> bytes:
    return candump_log(can_entries(3000)) + bytes(size)


def candump_line(size: int) -> bytes:
    return candump_log(can_entries(3)) + b"(1.0) can0 1#" + b"0" * size


def wave_zeros(size: int) -> bytes:
    return small_wave() + bytes(size)


HOSTILE: Mapping[str, Callable[[int], bytes]] = {
    made.__name__: made
    for made in (
        blf_frames, blf_events, blf_fd_frames, blf_plain_events, gzip_log,
        sqlite_blob, sqlite_text_stamp, sqlite_shared_pages, sqlite_shared_overflow,
        uff_short_numbers, uff_other_datasets, uff_without_end, uff_spaces,
        hdf5_zeros, hdf5_times, hdf5_many, hdf5_link, hdf5_deep, hdf5_wide, hdf5_attributes, hdf5_shapes, hdf5_circle,
        mat_zeros, mat_columns, mat73_zeros,
        mdf_shared_byte, mdf_listed_again, mdf_packed, mdf_one_table,
        mdf_ranges_over_one_another,
        old_mdf_shared_byte, old_mdf_shared_records, old_mdf_one_table, old_mdf_over_one_another,
        old_mdf_tables_over_one_another,
        text_zeros, text_long_line, text_columns, text_lines, candump_zeros, candump_line, wave_zeros,
    )
}  # fmt: skip
"""Name -> what makes such a file of about so many bytes; packed ones are smaller."""
