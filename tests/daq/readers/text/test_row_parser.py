from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.row_format import RowFormat
from recoil_acquisition.readers.text.row_parser import RowParser, count_byte, parse_plainly, parse_strictly

WORDS = "|nan|-NaN|Nan|INF|-inf|Infinity|1e999| 2 |-9|--|1.|.5|+3|1e|x|1_0|4\r5"
CELLS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.sampled_from(WORDS.split("|")),
    st.text(st.sampled_from("0123456789.,eE+- \r\t"), max_size=4),
)


def row_format(missing: tuple[str, ...] = ()) -> RowFormat:
    return RowFormat(Path("x.csv"), "utf-8", ";", ("a", "b", "c"), 3, decimal_comma=False, missing=missing)


def outcome(read: Callable[[], tuple[np.ndarray, list[list[str]]]]) -> tuple[str, object, object]:
    try:
        values, texts = read()
    except CorruptFileError as error:
        return str(error), None, None
    return "", values.tobytes(), texts


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=150)
@given(
    pieces=st.lists(st.lists(st.lists(CELLS, min_size=3, max_size=3), min_size=1, max_size=4), min_size=1, max_size=4),
    line_end=st.sampled_from(["\n", "\r\n"]),
    missing=st.sampled_from([(), ("--",), ("-9",)]),
    text_columns=st.sampled_from([(), (0,), (2,)]),
)
@example(
    pieces=[[["1", "2", "3"]], [["1", "", "3"]], [["1", "2"]]],
    line_end="\r\n",
    missing=(),
    text_columns=(),
)
@example(pieces=[[["1", "2", "3"], ["4", "5"]]], line_end="\n", missing=(), text_columns=(2,))
@example(pieces=[[["1", "2", "3"]], [["1", "2", "3", "4"]]], line_end="\n", missing=(), text_columns=())
@example(pieces=[[["1", "2", "\r3"]], [["1", "2", "3"]]], line_end="\n", missing=(), text_columns=())
def test_a_parser_reads_piece_by_piece_what_reading_cell_by_cell_does(
    pieces: list[list[list[str]]],
    line_end: str,
    missing: tuple[str, ...],
    text_columns: tuple[int, ...],
) -> None:
    rows = row_format(missing=missing)
    parser = RowParser(rows, text_columns)
    line = 1
    for piece in pieces:
        text = "".join(";".join(cells) + line_end for cells in piece).encode()
        expected = outcome(partial(parse_strictly, rows, text, line, text_columns))
        found = outcome(partial(parser.parse, text, line, len(piece)))
        assert found == expected
        line += len(piece)


def test_a_parser_goes_on_after_rows_that_it_refused() -> None:
    parser = RowParser(row_format())
    with pytest.raises(CorruptFileError, match="line 3, column 'b'"):
        parser.parse(b"1;2;3\n1;x;3\n", 2, 2)
    values, _ = parser.parse(b"4;5;6\n7;8;9\n", 4, 2)
    np.testing.assert_array_equal(values, [[4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])


def test_rows_are_never_fewer_or_more_than_they_were_counted() -> None:
    assert parse_plainly(row_format(), b"1;2;3\n4;5;6\n", 3, ()) is None
    assert parse_plainly(row_format(), b"1;2;3\n4;5;6\n", 1, ()) is None
    parsed = parse_plainly(row_format(), b"7;8;9\n", 1, ())
    assert parsed is not None
    np.testing.assert_array_equal(parsed[0], [[7.0, 8.0, 9.0]])


@pytest.mark.parametrize(("encoding", "word"), [("utf-8", "Größe"), ("cp1252", "Größe €"), ("shift_jis", "速度")])
def test_words_are_decoded_as_the_text_is_encoded(encoding: str, word: str) -> None:
    rows = RowFormat(Path("x.csv"), encoding, ";", ("a", "b"), 2, decimal_comma=False)
    text = f"1;{word}\n2;{word}\n".encode(encoding)
    values, texts = RowParser(rows, (1,)).parse(text, 1, 2)
    assert texts == [[word, word]]
    np.testing.assert_array_equal(values[:, 0], [1.0, 2.0])


@given(st.binary(max_size=300), st.binary(min_size=1, max_size=1))
def test_a_byte_is_counted_as_often_as_it_is_there(text: bytes, byte: bytes) -> None:
    assert count_byte(text, byte) == text.count(byte)
