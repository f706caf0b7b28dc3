"""Texts of unknown encoding: what their first lines, their places and their errors are."""

from __future__ import annotations

import codecs
from pathlib import Path

import pytest

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers import text_file
from recoil_acquisition.readers.text_file import LongText, TextFile, decode_head, read_text


def both(path: Path, content: bytes) -> tuple[TextFile, LongText]:
    path.write_bytes(content)
    return read_text(path), LongText(path)


@pytest.mark.parametrize("mark", [b"", codecs.BOM_UTF8])
def test_lines_and_where_they_begin_are_counted_from_the_first_byte_of_text(tmp_path: Path, mark: bytes) -> None:
    for file in both(tmp_path / "a.txt", mark + "a\nµs\n\nlast".encode()):
        assert file.lines(2) == ["a", "µs"]
        assert file.lines(9) == ["a", "µs", "", "last"]
        assert [file.line_start(k) for k in range(5)] == [0, 2, 6, 7, file.size]
        assert file.size == 11
        assert file.read(2, 5) == "µs".encode()


@pytest.mark.parametrize(
    ("declared", "stored", "mark"),
    [
        ("utf-16-le", "utf-16-le", codecs.BOM_UTF16_LE),
        ("utf-16-be", "utf-16-be", codecs.BOM_UTF16_BE),
        ("utf-16-le", "utf-16-le", b""),
        ("cp1252", "utf-16-le", codecs.BOM_UTF16_LE),
        (None, "utf-16-be", codecs.BOM_UTF16_BE),
    ],
)
@pytest.mark.parametrize("chunk_bytes", [3, 1 << 22])
def test_a_byte_order_mark_counts_more_than_what_is_declared_and_is_no_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, declared: str | None, stored: str, mark: bytes, chunk_bytes: int
) -> None:
    monkeypatch.setattr(text_file, "CHUNK_BYTES", chunk_bytes)
    path = tmp_path / "a.txt"
    path.write_bytes(mark + "a;µ\n1;2\n".encode(stored))
    file = LongText(path, declared)
    assert file.read(0, file.size) == "a;µ\n1;2\n".encode()
    assert file.encoding == "utf-8"


@pytest.mark.parametrize("chunk_bytes", [4, 1 << 22])
def test_where_a_text_is_no_utf_16_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk_bytes: int) -> None:
    monkeypatch.setattr(text_file, "CHUNK_BYTES", chunk_bytes)
    path = tmp_path / "a.txt"
    path.write_bytes(codecs.BOM_UTF16_LE + "abcdefg".encode("utf-16-le") + b"\x00\xdc" + "h".encode("utf-16-le"))
    with pytest.raises(CorruptFileError, match="byte 16: is not the UTF-16"):
        LongText(path)


def test_half_a_character_at_the_end_of_a_head_is_left_out() -> None:
    assert decode_head(codecs.BOM_UTF16_LE + "abc".encode("utf-16-le") + b"d") == "abc"
    assert decode_head("aµ".encode()[:-1]) == "a�"
