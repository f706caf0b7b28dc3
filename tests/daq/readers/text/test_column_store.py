from __future__ import annotations

import errno
import gc
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers import text_file
from recoil_acquisition.readers.text import column_store, text_table
from recoil_acquisition.readers.text.column_store import ColumnStore, NumberFile
from recoil_acquisition.readers.text.text_table import TextBlock, find_block
from recoil_acquisition.readers.text_file import LongText


def block_of(folder: Path, text: str, encoding: str = "utf-8") -> TextBlock:
    path = folder / "a.csv"
    path.write_bytes(text.encode(encoding))
    return find_block(LongText(path), 0, ";", ["a", "b", "c"], decimal_comma=False)


@pytest.fixture
def _in_many_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_table, "PIECE_BYTES", 500)


NUMBERS = np.random.default_rng(3).normal(size=(300, 3)) * [1e-9, 1.0, 1e12]
NUMBERS[[5, 120, 299], [1, 2, 1]] = np.nan


def text_of(numbers: np.ndarray, line_end: str = "\n") -> str:
    return "".join(";".join("" if np.isnan(v) else repr(float(v)) for v in row) + line_end for row in numbers)


@pytest.mark.usefixtures("_in_many_pieces")
@pytest.mark.parametrize("memory", [0, 1 << 26])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_pieces_give_every_number_to_the_last_bit(
    memory: int, line_end: str, encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(column_store, "MEMORY_BYTES", memory)
    block = block_of(tmp_path, text_of(NUMBERS, line_end), encoding)
    assert len(block.pieces) > 10
    store = ColumnStore(block)
    for i in range(3):
        np.testing.assert_array_equal(store.column(i), NUMBERS[:, i])
        for start, stop in ((0, 1), (17, 250), (299, 300), (300, None), (40, 20)):
            np.testing.assert_array_equal(store.column(i, start, stop), NUMBERS[start:stop, i])
    np.testing.assert_array_equal(store.lost, [0, 2, 1])
    del store
    gc.collect()


@pytest.mark.usefixtures("_in_many_pieces")
@pytest.mark.parametrize(
    ("cell", "found"), [("x", "'x'"), ("1,5", "'1,5'"), ("1;2", "4"), ("1\r2", "'1\\\\r2'"), ("ä", "'ä'")]
)
def test_a_damaged_cell_in_a_later_piece_is_named_by_its_line(cell: str, found: str, tmp_path: Path) -> None:
    lines = text_of(NUMBERS).split("\n")
    lines[250] = f"1;{cell};3"
    store = ColumnStore(block_of(tmp_path, "\n".join(lines)))
    with pytest.raises(CorruptFileError, match=f"line 251.*{found}"):
        store.column(0)


@pytest.mark.usefixtures("_in_many_pieces")
def test_a_row_with_a_cell_less_is_never_filled_up(tmp_path: Path) -> None:
    lines = text_of(NUMBERS).split("\n")
    lines[200] = "1;2"
    with pytest.raises(CorruptFileError, match="line 201: a row does not fit the header; expected 3 cells, found 2"):
        ColumnStore(block_of(tmp_path, "\n".join(lines))).column(0)


@pytest.mark.usefixtures("_in_many_pieces")
def test_a_line_without_end_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="a line is longer than 500 bytes"):
        _ = block_of(tmp_path, "1;2;3\n" + "4" * 2000 + ";5;6\n1;2;3\n").pieces


@pytest.mark.usefixtures("_in_many_pieces")
def test_stamps_are_told_in_the_order_of_the_file_and_kept_beside_the_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(column_store, "MEMORY_BYTES", 0)
    block = block_of(tmp_path, "".join(f"t{i};{i * 0.5};{'' if i == 7 else i}\n" for i in range(500)))
    told: list[str] = []

    def seconds(cells: Sequence[str]) -> np.ndarray:
        told.extend(cells)
        return np.array([float(cell[1:]) for cell in cells])

    store = ColumnStore(block, seconds, 0)
    np.testing.assert_array_equal(store.column(0), np.arange(500.0))
    np.testing.assert_array_equal(store.column(1, 100, 300), np.arange(100, 300) * 0.5)
    np.testing.assert_array_equal(store.lost, [0, 0, 1])
    assert told == [f"t{i}" for i in range(500)]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_parts_are_what_reading_at_once_gives(encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_file, "PART_BYTES", 11)
    file = block_of(tmp_path, text_of(NUMBERS), encoding).file
    for start, stop in ((0, file.size), (5, 300), (40, 40), (file.size - 3, file.size + 5)):
        assert b"".join(file.parts(start, stop)) == file.read(start, stop)


def test_a_file_that_becomes_shorter_is_an_error(tmp_path: Path) -> None:
    block = block_of(tmp_path, text_of(NUMBERS))
    assert block.row_count == len(NUMBERS)
    (tmp_path / "a.csv").write_bytes(b"1;2;3\n")
    with pytest.raises(ReadError, match="became shorter"):
        ColumnStore(block).column(0)


def test_numbers_written_by_several_threads_are_read_back_from_anywhere() -> None:
    numbers = np.random.default_rng(1).normal(size=4000)
    file = NumberFile(Path("x.csv"))
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda at: file.write(at, numbers[at : at + 100]), range(3900, -100, -100)))
    for start, count in ((0, 4000), (17, 300), (3999, 1), (5, 0)):
        found = np.empty(count)
        file.read(start, found)
        np.testing.assert_array_equal(found, numbers[start : start + count])


def test_numbers_that_are_not_there_are_an_error() -> None:
    file = NumberFile(Path("x.csv"))
    file.write(0, np.zeros(3))
    with pytest.raises(ReadError, match="became shorter"):
        file.read(2, np.empty(2))


class FullDisk:
    def seek(self, at: int) -> int:
        return at

    def write(self, _data: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        return None


def test_no_room_for_numbers_is_an_error_that_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: FullDisk())
    with pytest.raises(ReadError, match=r"No space left on device.*TMPDIR"):
        NumberFile(Path("x.csv")).write(0, np.zeros(3))
