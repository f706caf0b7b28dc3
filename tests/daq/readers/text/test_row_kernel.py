from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.text.row_kernel import kernel_at_hand, read_plain_rows

pytestmark = pytest.mark.skipif(not kernel_at_hand(), reason="needs numba, the extra `fast`")

DIGITS = st.text("0123456789", max_size=24)
PRINTED = st.tuples(
    st.sampled_from(["", "-", "+"]), DIGITS, st.sampled_from(["", "."]), DIGITS,
    st.one_of(st.just(""), st.integers(-330, 330).map(lambda power: f"e{power}")),
).map("".join)  # fmt: skip


def is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


@settings(deadline=None, max_examples=400)
@given(
    st.lists(st.one_of(PRINTED, st.floats(allow_nan=False, allow_infinity=False).map(repr)), min_size=1, max_size=14)
)
@example(["9007199254740993"])  # 2^53 + 1: no float64, and halfway between two
@example(["0.000345584192064786", "-0", "-0.0", "1e22", "1e23", "1e-22", "8.5e-23", "000000000000000000000001"])
@example(["123456789012345678901234567890", "0.00000000000000000000000000000000001", "1e400", "1e-400"])
def test_numbers_are_the_nearest_to_what_is_printed_bit_by_bit(cells: list[str]) -> None:
    numbers = [cell for cell in cells if is_number(cell)]
    if not numbers:
        return
    columns = read_plain_rows("".join(f"{cell}\n" for cell in numbers).encode(), ";", ".", 1, len(numbers))
    assert columns is not None
    expected = np.array([float(cell) for cell in numbers])
    expected[np.isinf(expected)] = np.nan
    assert columns[0].tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"1;2\n3;4\n", [[1, 3], [2, 4]]),
        (b" 1 ;  2\r\n3;4 \r\n", [[1, 3], [2, 4]]),
        (b"1;\n;4\n", [[1, np.nan], [np.nan, 4]]),
        (b"1.;.5\n+3;-4e-1\n", [[1, 3], [0.5, -0.4]]),
    ],
)
def test_cells_may_be_spaced_signed_or_empty(text: bytes, expected: list[list[float]]) -> None:
    np.testing.assert_array_equal(read_plain_rows(text, ";", ".", 2, 2), expected)


def test_the_mark_may_be_a_comma() -> None:
    np.testing.assert_array_equal(read_plain_rows(b"1,5\t-2,25e1\n", "\t", ",", 2, 1), [[1.5], [-22.5]])


@pytest.mark.parametrize(
    "text",
    [
        b"1;2;3\n4;5\n", b"1\n2;3\n", b"1;2\n\n", b"1;2\n", b"1;2\n3;4\n5;6\n", b"1;2\n3;4", b"", b"\n",
        b"1;x\n3;4\n", b"1;0x10\n3;4\n", b"1;1_0\n3;4\n", b"1;nan\n3;4\n", b"1;inf\n3;4\n", b"1;-\n3;4\n",
        b"1;.\n3;4\n", b"1;2e\n3;4\n", b"1;2e+\n3;4\n", b"1;e5\n3;4\n", b"1;2 3\n3;4\n", b"1;--2\n3;4\n",
        b'1;"2"\n3;4\n', b"1;2,5\n3;4\n", b"1;2\r3;4\n\n", b"1;2\n3;4\r\r\n", b"1;\xb2\n3;4\n",
        b"1;2\x003\n3;4\n",
    ],
)  # fmt: skip
def test_whatever_is_written_otherwise_is_left_to_another_parser(text: bytes) -> None:
    assert read_plain_rows(text, ";", ".", 2, 2) is None


@pytest.mark.parametrize(("separator", "point"), [(" ", "."), (",", ","), ("", "."), (";;", "."), ("e", ".")])
def test_what_could_be_two_things_is_left_to_another_parser(separator: str, point: str) -> None:
    assert read_plain_rows(b"1\n", separator, point, 1, 1) is None


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=80), st.integers(1, 4), st.integers(0, 6))
def test_no_bytes_do_harm(text: bytes, width: int, count: int) -> None:
    columns = read_plain_rows(text + b"\n", ";", ".", width, count)
    assert columns is None or columns.shape == (width, count)


def test_many_numbers_that_need_more_than_one_rounding_are_left_to_another_parser() -> None:
    assert read_plain_rows(b"12345678901234567\n" * 100, ";", ".", 1, 100) is None
