"""Data are put together from their blocks, each once, and none that cannot be."""

from __future__ import annotations

import struct
import zlib

import pytest

from recoil_acquisition.readers.mdf import data_blocks
from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError, MdfUnsupportedError
from recoil_acquisition.readers.mdf.data_blocks import DataBlocks

AT = 64
COLUMNS_APART = 0x8000_0000


def block(kind: bytes, links: tuple[int, ...], body: bytes) -> bytes:
    return (
        struct.pack(f"<4s4xQQ{len(links)}Q", b"##" + kind, 24 + 8 * len(links) + len(body), len(links), *links) + body
    )


def packed(data: bytes, *, method: int = 0, columns: int = 0, stated: int | None = None) -> bytes:
    content = zlib.compress(data)
    size = len(data) if stated is None else stated
    return block(b"DZ", (), struct.pack("<2sBxLQQ", b"DT", method, columns, size, len(content)) + content)


def file_of(*blocks: bytes) -> bytes:
    return bytes(AT) + b"".join(blocks)


def listed(kind: bytes, *, flags: int = 0) -> bytes:
    """A list of two blocks, which follow it."""
    first = AT + len(block(kind, (0, 0, 0), bytes(8)))
    data = block(b"DT", (), b"abc")
    return file_of(block(kind, (0, first, first + len(data)), struct.pack("<II", flags, 2)), data, packed(b"def" * 9))


@pytest.mark.parametrize("kind", [b"DL", b"LD"])
def test_blocks_of_a_list_follow_one_another(kind: bytes) -> None:
    assert bytes(DataBlocks(listed(kind)).read(AT)) == b"abc" + b"def" * 9


def test_nothing_is_linked_to_no_data() -> None:
    assert DataBlocks(bytes(100)).read(0).size == 0
    assert DataBlocks(file_of(block(b"HL", (0,), bytes(8)))).read(AT).size == 0


def test_a_block_whose_length_was_not_written_reaches_to_the_end() -> None:
    content = bytearray(file_of(block(b"DT", (), b"abcdef")))
    struct.pack_into("<Q", content, AT + 8, 24)
    assert DataBlocks(bytes(content)).read(AT).size == 0
    assert bytes(DataBlocks(bytes(content), AT).read(AT)) == b"abcdef"


def test_columns_that_were_turned_into_rows_are_turned_back() -> None:
    rows = bytes(range(21))  # five rows of four and a byte
    turned = b"".join(rows[:20][column::4] for column in range(4)) + rows[20:]
    assert bytes(DataBlocks(file_of(packed(turned, method=1, columns=4))).read(AT)) == rows


def chained_to_itself() -> bytes:
    return file_of(block(b"DL", (AT, 0), bytes(8)))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (chained_to_itself(), "lead back"),
        (file_of(block(b"TX", (), b"text")), "holds no data"),
        (file_of(block(b"DT", (), b"abc"))[:-1], "the file is cut"),
        (file_of(block(b"DT", (), b"abc"))[: AT + 10], "the file is cut"),
        (file_of(packed(b"abc" * 9, stated=26)), "does not unpack to its stated size"),
        (file_of(packed(b"abc" * 9, stated=28)), "does not unpack to its stated size"),
        (file_of(packed(b"abc" * 9, stated=1 << 40)), "cannot have its stated size"),
        (file_of(packed(b"abc", method=1)), "rows without columns"),
        (file_of(packed(b"abc"))[:-3] + b"xyz", "does not unpack"),
        (file_of(block(b"DZ", (), b"DT")), "shorter than its header"),
        (file_of(block(b"LD", (0,), b"")), "ends early"),
    ],
)
def test_blocks_that_cannot_be_are_refused(content: bytes, problem: str) -> None:
    with pytest.raises(MdfDamageError, match=problem):
        DataBlocks(content).read(AT)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (listed(b"LD", flags=COLUMNS_APART), "invalidation bits that are kept apart"),
        (file_of(packed(b"abc", method=6)), "packed by the method 6"),
    ],
)
def test_what_is_not_read_is_named(content: bytes, what: str) -> None:
    with pytest.raises(MdfUnsupportedError, match=what):
        DataBlocks(content).read(AT)


def test_unpacked_blocks_have_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    content = file_of(packed(bytes(200_000)))
    assert DataBlocks(content).read(AT).size == 200_000
    monkeypatch.setattr(data_blocks, "SPARE_BYTES", 0)
    assert len(content) * data_blocks.LARGEST_RATIO < 200_000
    with pytest.raises(MdfDamageError, match="cannot have its stated size"):
        DataBlocks(content).read(AT)


def test_the_bound_is_one_of_all_blocks_together(monkeypatch: pytest.MonkeyPatch) -> None:
    content = file_of(packed(bytes(200_000)), packed(bytes(200_000)))
    monkeypatch.setattr(data_blocks, "SPARE_BYTES", 200_000)
    assert len(content) * data_blocks.LARGEST_RATIO < 200_000
    blocks = DataBlocks(content)
    assert blocks.read(AT).size == 200_000
    with pytest.raises(MdfDamageError, match="cannot have its stated size"):
        blocks.read(content.index(b"##DZ", AT + 4))


def test_a_list_header_without_a_list_has_no_data_however_often_it_is_read() -> None:
    blocks = DataBlocks(file_of(block(b"HL", (0,), bytes(8))))
    assert blocks.read(AT).size == blocks.read(AT).size == 0


def test_a_block_whose_length_was_not_written_ends_at_the_next_block() -> None:
    content = bytearray(file_of(block(b"DT", (), b"abcdefgh"), block(b"TX", (), b"text")))
    struct.pack_into("<Q", content, AT + 8, 24)
    assert bytes(DataBlocks(bytes(content), AT).read(AT)) == b"abcdefgh"
