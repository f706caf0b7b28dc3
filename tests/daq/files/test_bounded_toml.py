"""TOML within bounds: the parser never gets what would take minutes or gigabytes, and every refusal is a ValueError."""

from __future__ import annotations

import tomllib
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.files.bounded_toml import parse_toml

HOSTILE = {
    "a number of 5,000 digits": "a = " + "9" * 5000,
    "a hexadecimal number": "a = 0x" + "f" * 5000,
    "a key of many parts": ".".join("a" * 100_000) + " = 1",
    "a key of many spaced parts": "a . " * 100_000 + "a = 1",
    "a key of many quoted parts": '"a".' * 100_000 + "a = 1",
    "a key of many parts in single quotes": "'a' . " * 100_000 + "a = 1",
    "a table of many parts": "[" + ".".join("a" * 100_000) + "]",
    "a key of many parts behind a comment": '# "\n' + "a." * 100_000 + "a = 1",
    "a key of many parts behind a text": 'x = "\\"" \n' + "a." * 100_000 + "a = 1",
    "a key of many parts behind a long text": "x = '''\n\"\"\"'''\n" + "a." * 100_000 + "a = 1",
    "nested arrays": "a = " + "[" * 100_000,
    "nested tables": "a = " + "{a=" * 100_000,
    "a long text": "a = '" + "a" * 1_000_000 + "'",
    "many tables": "[[a]]\n" * 100_000,
}


@pytest.mark.parametrize("what", HOSTILE)
def test_what_would_take_minutes_is_refused_at_once(what: str) -> None:
    with pytest.raises(ValueError, match=r"nested more than|of more than|more than 5000|has up to"):
        parse_toml(HOSTILE[what])


@pytest.mark.parametrize(
    "text",
    [
        "a = [" + "1.0, " * 20_000 + "]",
        'note = "' + "a." * 5000 + '"',
        "note = '''\n" + "[" * 5000 + "a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s\n'''",
        "# " + "a." * 5000 + "\na.b.c = 1",
        '"a.b" = 1 # "\n[[c]]\nd = [[[{e = [2026-01-01]}]]]',
    ],
)
def test_what_people_write_is_parsed(text: str) -> None:
    assert parse_toml(text) == tomllib.loads(text)


def test_the_bundled_rigs_are_within_the_bounds() -> None:
    for file in resources.files("recoil_rigs").iterdir():
        if file.name.endswith(".toml"):
            assert parse_toml(file.read_text(encoding="utf-8"))["schema"]


@given(st.text(alphabet="ab.=\"'[]{}#\\\n 1", max_size=60))
def test_any_text_gives_what_the_parser_gives(text: str) -> None:
    try:
        expected = tomllib.loads(text)
    except ValueError:
        with pytest.raises(ValueError, match=r"."):
            parse_toml(text)
    else:
        assert parse_toml(text) == expected
