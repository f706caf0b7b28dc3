from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x07", r"\x1b[31mred\x07"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x9b31m", r"\x9b31m"),
        ("shot\u202e5h.1\u2066", r"shot\u202e5h.1\u2066"),
        ("bytes \udcff", r"bytes \udcff"),
        ("Prüfstand 5 µm², 試験", "Prüfstand 5 µm², 試験"),
    ],
)
def test_what_a_terminal_obeys_is_spelled(text: str, shown: str) -> None:
    assert visible(text) == shown


@given(st.text())
def test_it_is_one_printable_line_and_nothing_changes_twice(text: str) -> None:
    shown = visible(text)
    assert len(shown.splitlines()) <= 1
    assert visible(shown) == shown
    assert not any(ord(c) < 32 or 0x7F <= ord(c) < 0xA0 for c in shown)
