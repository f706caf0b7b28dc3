from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.text import text_table
from recoil_acquisition.readers.text.cells import split_cells, split_unit, unique_names
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import find_block, printed_decimals
from recoil_acquisition.readers.text_file import LongText, TextFile, decode_head, read_text


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("AI 1/acc (m/s2)", "AI 1/acc", "m/s2"),
        ("Time int/der 1/AI 1/v (m/s)", "Time int/der 1/AI 1/v", "m/s"),
        ("AI 1/force (left) (kN)", "AI 1/force (left)", "kN"),
        ("OT/level (g (peak))", "OT/level", "g (peak)"),
        ("Video/Camera 0 ()", "Video/Camera 0", ""),
        ("Time (-)", "Time", ""),
        ("plain", "plain", ""),
        ("Feature #1 - X [px]", "Feature #1 - X", "px"),
        ("Feature #1 - X, mm", "Feature #1 - X", "mm"),
        ("a, b (V)", "a, b", "V"),
        ("p, bar(a)", "p", "bar(a)"),
        ("p (bar(a))", "p", "bar(a)"),
        ("f, x(t)", "f, x", "t"),
    ],
)
def test_the_last_parentheses_are_the_unit(heading: str, name: str, unit: str) -> None:
    assert split_unit(heading) == (name, unit)


def test_equal_names_are_told_apart_without_taking_a_name_that_exists() -> None:
    names, notes = unique_names(["a", "b", "a", "a#2", "a"])
    assert names == ("a", "b", "a#3", "a#2", "a#4")
    assert len(notes) == 1
    assert "'a'" in notes[0]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_every_usual_encoding_gives_the_same_text(encoding: str, tmp_path: Path) -> None:
    text = "Größe [°]\r\n1,5\r\n"
    path = tmp_path / "a.txt"
    path.write_bytes(text.encode(encoding))
    assert read_text(path).lines(2) == ["Größe [°]", "1,5"]
    assert decode_head(text.encode(encoding)) == text.replace("\r\n", "\n")


def test_a_head_that_ends_inside_a_character_is_still_utf_8() -> None:
    assert decode_head("aä".encode()[:-1]) == "a\ufffd"


def test_a_damaged_utf_16_file_is_corrupt(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xff\xfe\x00\xdc\x00\xdc")
    with pytest.raises(CorruptFileError, match="UTF-16"):
        read_text(path)


def test_a_missing_file_is_a_read_error(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="cannot be read"):
        read_text(tmp_path / "none")


def text_file(text: str) -> TextFile:
    return TextFile(Path("x.csv"), text.encode(), "utf-8")


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=100)
@given(
    rows=st.lists(
        st.tuples(*[st.one_of(st.none(), st.floats(allow_nan=False, allow_infinity=False))] * 3),
        min_size=1,
        max_size=12,
    ),
    separator=st.sampled_from(["\t", ";", ","]),
    comma=st.booleans(),
    trailing=st.booleans(),
)
def test_a_block_gives_back_the_numbers_bit_by_bit(
    rows: list[tuple[float | None, ...]], separator: str, comma: bool, trailing: bool
) -> None:
    comma = comma and separator != ","
    lines = [separator.join("" if v is None else repr(v) for v in (1.0, *row)) + separator * trailing for row in rows]
    text = "".join(line.replace(".", "," if comma else ".") + "\n" for line in lines)
    block = find_block(text_file(text), 0, separator, ["n", "a", "b", "c"], decimal_comma=comma)
    values = read_rows(block)
    expected = np.array([[1.0, *(np.nan if v is None else v for v in row)] for row in rows])
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize(
    ("text", "place", "found"),
    [
        ("1,2\n3,x4\n5,6\n", "line 2, column 'b'", "'x4'"),
        ("1,2\n3,4,5\n5,6\n", "line 2", "3"),
        ("1,2\n3\n5,6\n", "line 2", "1"),
        ("1,2\n\n5,6\n", "line 2", "1"),
        ("1,2\n3,1_0\n5,6\n", "line 2, column 'b'", "'1_0'"),
        ("1,2\n3,1.2.3\n5,6\n", "line 2, column 'b'", "'1.2.3'"),
        ('1,2\n3,4"\n5,6\n', "line 2, column 'b'", "'4\"'"),
    ],
)
def test_a_damaged_row_is_named_by_line_and_column(text: str, place: str, found: str) -> None:
    block = find_block(text_file(text), 0, ",", ["a", "b"], decimal_comma=False)
    with pytest.raises(CorruptFileError) as caught:
        read_rows(block)
    assert caught.value.place == place
    assert caught.value.found == found


def test_infinite_and_named_lost_samples_are_nan() -> None:
    block = find_block(text_file("1;NaN\n2;-INF\n3; \n4;1e999\n5;2\n"), 0, ";", ["a", "b"], decimal_comma=False)
    np.testing.assert_array_equal(read_rows(block)[:, 1], [np.nan, np.nan, np.nan, np.nan, 2.0])


@pytest.mark.parametrize(
    ("text", "rows", "why"),
    [
        ("1,2\n3,4\n", 2, ""),
        ("1,2\n3,4\n\n  \n", 2, ""),
        ("1,2\n3,4", 1, "no line end"),
        ("1,2\n3\n", 1, "fewer than 2 cells"),
        ("1,2\n3", 1, "no line end"),
    ],
)
def test_a_last_row_that_may_be_cut_is_left_out(text: str, rows: int, why: str) -> None:
    block = find_block(text_file(text), 0, ",", ["a", "b"], decimal_comma=False)
    assert block.row_count == rows
    assert why in block.dropped
    assert bool(why) == bool(block.dropped)


def test_no_complete_row_is_an_error() -> None:
    with pytest.raises(CorruptFileError, match="no complete row"):
        find_block(text_file("1,2"), 0, ",", ["a", "b"], decimal_comma=False)


@pytest.mark.parametrize(
    ("cells", "decimals"),
    [(["0.000000", "0.000020"], 6), (["0", "0.5", "1.25"], 2), (["1.5E-008"], 9), (["10", "20"], 0), (["1,25"], 2)],
)
def test_the_last_printed_digit_is_found(cells: list[str], decimals: int) -> None:
    block = find_block(text_file("".join(f"{c};1\n" for c in cells)), 0, ";", ["t", "a"], decimal_comma=True)
    assert printed_decimals(block, 0) == decimals


def test_a_fixed_number_of_digits_counts_where_it_says_least() -> None:
    rows = [f"{t:.7g}" for t in np.linspace(1.0, 900.0, 3000)]
    block = find_block(text_file("".join(f"{c};1\n" for c in rows)), 0, ";", ["t", "a"], decimal_comma=False)
    assert printed_decimals(block, 0) == 4


def test_quoted_headings_lose_their_quotes() -> None:
    assert split_cells('"Time (s)","a, b (V)"', ",") == ["Time (s)", "a, b (V)"]


@pytest.mark.parametrize("trailing", ["", ";"])
@pytest.mark.parametrize("comments", ["", "#\n", "# a;b;c;d;e\n#\n", "#\n# x\n#;\n"])
def test_comments_before_between_and_behind_the_rows_are_no_rows(comments: str, trailing: str) -> None:
    text = f"{comments}1;2{trailing}\n# between\n3;4{trailing}\n{comments}"
    block = find_block(text_file(text), 0, ";", ["a", "b"], decimal_comma=False, comment="#")
    assert block.format.width == 2 + bool(trailing)
    assert block.row_count == 2
    assert block.dropped == ""
    assert read_rows(block).tolist() == [[1.0, 2.0], [3.0, 4.0]]


@pytest.mark.parametrize("line_end", ["\n", "\r"])
@pytest.mark.parametrize("piece_bytes", [16, 17, 31, 64])
@pytest.mark.parametrize("count", [3, 40])
def test_a_block_in_pieces_has_every_row_once_with_its_line(
    piece_bytes: int, count: int, line_end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_table, "PIECE_BYTES", piece_bytes)
    head = "heading\n" * 3
    text = head + "".join(f"{i},{10 * i}\n" for i in range(count))
    path = tmp_path / "a.csv"
    path.write_bytes(text.replace("\n", line_end).encode())
    block = find_block(LongText(path), len(head), ",", ["a", "b"], decimal_comma=False)
    assert (block.row_count, block.first_line) == (count, 4)
    assert block.pieces[0].start == block.start
    assert block.pieces[-1].stop == block.stop == len(text) - 1
    at_line = 4
    for piece in block.pieces:
        assert piece.line == at_line
        at_line += piece.rows
        rows = block.text(piece)
        assert rows.endswith(b"\n")
        assert rows.count(b"\n") == piece.rows
        assert rows.startswith(f"{piece.line - 4},".encode())
    assert [p.stop for p in block.pieces[:-1]] == [p.start for p in block.pieces[1:]]
    assert all(piece.stop - piece.start < 2 * piece_bytes for piece in block.pieces)
    assert (len(block.pieces) > 1) == (len(text) - len(head) - 1 > piece_bytes)
    assert read_rows(block).tolist() == [[float(i), 10.0 * i] for i in range(count)]


def test_a_row_longer_than_a_piece_is_refused_with_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_table, "PIECE_BYTES", 16)
    text = "1,2\n3,4\n" + "5," + "6" * 60 + "\n7,8\n"
    block = find_block(text_file(text), 0, ",", ["a", "b"], decimal_comma=False)
    with pytest.raises(CorruptFileError, match="a line is longer than 16 bytes") as caught:
        _ = block.pieces
    assert caught.value.place == "line 3"


def test_a_cell_is_placed_by_its_line_and_column() -> None:
    block = find_block(text_file("x\n1,2\n3,4\n"), 2, ",", ["a", "b"], decimal_comma=False)
    assert (block.place(0, "a"), block.place(1, "b")) == ("line 2, column 'a'", "line 3, column 'b'")


@pytest.mark.parametrize(
    ("tail", "rows", "dropped"), [("3,4", 1, True), ("3", 1, True), ("", 1, False), ("# 3", 1, True)]
)
def test_the_last_rows_of_a_long_file_are_judged_by_its_end(
    tail: str, rows: int, dropped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the end is looked at, and nothing before the block's beginning."""
    monkeypatch.setattr(text_table, "PIECE_BYTES", 6)
    block = find_block(text_file(f"a,b\n1,2\n{tail}"), 4, ",", ["a", "b"], decimal_comma=False, comment="#")
    assert (block.row_count, bool(block.dropped)) == (rows, dropped)
    assert block.stop == 7


def test_the_digits_of_a_long_block_are_those_of_whole_cells_at_its_ends() -> None:
    rows = "".join(f"{i / 1000:.3f};1\n" for i in range(4000))
    block = find_block(text_file(rows), 0, ";", ["t", "a"], decimal_comma=False)
    assert printed_decimals(block, 0) == 3
    assert printed_decimals(block, 1) == 0


def test_what_stands_beside_a_short_block_says_nothing_of_its_digits(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("9.12345678;9\n0.5;1.25\n0.25;1.5\n0.87654321;1")
    block = find_block(LongText(path), 13, ";", ["t", "a"], decimal_comma=False)
    assert block.dropped
    assert (printed_decimals(block, 0), printed_decimals(block, 1)) == (2, 2)


def test_a_block_of_true_length_is_cut_between_its_rows() -> None:
    row = "1.5,-0.25\n"
    count = text_table.PIECE_BYTES // 6  # more than one piece
    block = find_block(text_file(row * count), 0, ",", ["a", "b"], decimal_comma=False)
    assert len(block.pieces) > 1
    assert block.row_count == count
    assert all((piece.stop - piece.start) == piece.rows * len(row) for piece in block.pieces[:-1])


@pytest.mark.parametrize("trailing", ["", ";"])
@pytest.mark.parametrize("comment", ["", "# " + "x;" * 100_000 + "\n"])
def test_rows_of_many_columns_are_as_wide_as_they_are_written(comment: str, trailing: str) -> None:
    """A line of 200 KB, or a remark as long, is found whole."""
    names = [f"c{i}" for i in range(50_000)]
    text = comment + ";".join(["1.5"] * len(names)) + trailing + "\n"
    block = find_block(text_file(text), 0, ";", names, decimal_comma=False, comment="#")
    assert block.format.width == len(names) + bool(trailing)


def test_every_whole_row_at_the_beginning_of_a_block_of_long_rows_says_its_digits() -> None:
    rest = ";1" * 1500
    rows = "".join(f"{cell}{rest}\n" for cell in ("1", "1.25", "2", "2.5", "2.75", "3"))
    block = find_block(text_file(rows), 0, ";", ["t", *(f"c{i}" for i in range(1500))], decimal_comma=False)
    assert printed_decimals(block, 0) == 2


@pytest.mark.parametrize("further", range(12))
def test_what_is_left_of_a_long_row_says_nothing_of_another_columns_digits(further: int) -> None:
    """The end of a block that is looked at may begin within a row, whose first cells are not the first columns'."""
    rest = ";0.123456789" * 300
    rows = "".join(
        f"{cell}{rest}\n" for cell in ("1.123456", "2.123456", "10.12345", "100.1234", "1000.123", "2000.123")
    )
    rows = rows[:-1] + "0" * further + "\n"
    block = find_block(text_file(rows), 0, ";", ["t", *(f"c{i}" for i in range(300))], decimal_comma=False)
    assert printed_decimals(block, 0) == 3
