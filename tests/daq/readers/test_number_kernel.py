from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq.readers import text_table
from daq.readers.number_kernel import read_plain
from daq.readers.text_file import LongText
from daq.readers.text_table import find_block, parse_piece

pytest.importorskip("numba")

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
PRINTED = st.one_of(
    st.tuples(NUMBERS, st.sampled_from(["r", ".15g", ".17g", ".3f", ".6E", "+.9e"])).map(
        lambda pair: repr(pair[0]) if pair[1] == "r" else format(pair[0], pair[1])
    ),
    st.from_regex(r"\A[+-]?(\d{1,25}(\.\d{0,25})?|\.\d{1,25})([eE][+-]?\d{1,3})?\Z").filter(str.isascii),
    st.just(""),
)


def expected(cell: str) -> float:
    value = float(cell or "nan")
    return value if np.isfinite(value) else np.nan


@settings(deadline=None, max_examples=300)
@given(cells=st.lists(st.tuples(PRINTED, PRINTED), min_size=1, max_size=8), comma=st.booleans(), end=st.booleans())
def test_every_number_is_the_one_of_float_to_the_last_bit(cells: list[tuple[str, str]], comma: bool, end: bool) -> None:
    text = "".join(";".join(row) + ("\r\n" if end else "\n") for row in cells)
    found = read_plain(
        text.replace(".", "," if comma else ".").encode(), len(cells), 2, ";", decimal_comma=comma
    )  # fmt: skip
    assert found is not None
    wanted = np.array([[expected(cell) for cell in row] for row in cells])
    np.testing.assert_array_equal(found, wanted)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(wanted) & ~np.isnan(wanted))


@settings(deadline=None, max_examples=300)
@given(cell=st.text(alphabet="0123456789+-.,eE x\r\n;\0", max_size=8))
def test_what_is_no_number_is_never_read_as_one(cell: str) -> None:
    text = f"1;2\n{cell};3\n4;5\n".encode()
    found = read_plain(text, 3, 2, ";", decimal_comma=False)
    if found is not None:
        assert found.shape == (3, 2)
        assert found[1, 0] == expected(cell.strip()) or np.isnan(expected(cell.strip()))


@pytest.mark.parametrize("text", [b"1;2\n3\n", b"1;2\n3;4;5\n", b"1;2\n", b"1;2\n3;4\n5;6\n", b"1;2\n3;4", b"\n\n"])
def test_rows_of_another_width_or_number_are_left_to_what_names_them(text: bytes) -> None:
    assert read_plain(text, 2, 2, ";", decimal_comma=False) is None


def test_compiled_and_plain_reading_of_a_file_agree(tmp_path, monkeypatch) -> None:
    numbers = np.random.default_rng(5).normal(size=(4000, 3)) * [1e-12, 1.0, 1e9]
    path = tmp_path / "a.csv"
    path.write_text("".join(";".join(f"{v:.15G}" for v in row) + "\n" for row in numbers))
    tables = []
    for long_bytes in (0, 1 << 40):
        monkeypatch.setattr(text_table, "LONG_BYTES", long_bytes)
        block = find_block(LongText(path), 0, ";", ["a", "b", "c"], decimal_comma=False)
        tables.append(np.concatenate([parse_piece(block, piece)[0] for piece in block.pieces]))
    np.testing.assert_array_equal(tables[0], tables[1])
