"""TOML of a rig file within bounds: the parser alone takes minutes and gigabytes over a key of many parts.

What is proposed to a person is written as a rig file has it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

LARGEST_BYTES = 1_000_000
"""The largest rig file that is read; one of 500 channels has some 150,000 bytes."""
LONGEST_WORD = 1000
"""Characters of a number or a bare key."""
MOST_KEY_PARTS = 16
DEEPEST_NESTING = 32
MOST_TABLES = 5000

_STRING_OR_COMMENT = re.compile(
    r'"""[^\\"]*(?:(?:\\.|"(?!""))[^\\"]*)*"""'
    r"|'''.*?'''"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|\#[^\n]*",
    re.DOTALL,
)
_LONG_WORD = re.compile(rf"[\w.+:-]{{{LONGEST_WORD + 1}}}")
_LONG_KEY = re.compile(rf"(?:[\w-]+[ \t]*\.[ \t]*){{{MOST_KEY_PARTS}}}")
_LINE_NUMBER = re.compile(r"at line (\d+)")
_PLAIN_VALUE = re.compile(r"([\w.-]+)[ \t]*=[ \t]*([^\s\"'\[{#][^\"'\[\]{}#]*?)[ \t]*(?:#.*)?")
"""A key with a value that is neither text nor list nor table, perhaps with a comment behind it."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_SHOWN = 60
_BRACKET = re.compile(r"[\[\]{}]")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t"}


def toml_value(value: Any) -> str:
    """Write a value as a rig file has it, within one line: a text, number, date, list or table."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {toml_value(one)}' for key, one in value.items())} }}"
    return f"[{', '.join(map(toml_value, value))}]" if isinstance(value, list | tuple) else str(value)


def toml_key(key: str) -> str:
    """Write a key as a rig file has it."""
    return key if _BARE_KEY.fullmatch(key) else _quoted(key)


def _quoted(text: str) -> str:
    return '"' + "".join(_ESCAPES.get(sign) or _spelled(sign) for sign in text) + '"'


def _spelled(sign: str) -> str:
    """Return a sign as a text of TOML has it; half of a pair, which no file holds, becomes a sign of its own."""
    if sign.isprintable():
        return sign
    code = 0xFFFD if 0xD800 <= ord(sign) <= 0xDFFF else ord(sign)
    return f"\\U{code:08x}" if code > 0xFFFF else f"\\u{code:04x}"


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a text within bounds.

    Raises
    ------
    ValueError
        If it is no TOML, or beyond the bounds.
    """
    _check_bounds(text)
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{error}{_line_at_fault(text, str(error))}") from error


def _line_at_fault(text: str, problem: str) -> str:
    """Return the line that the parser names, and how its value is written where that alone is no TOML."""
    number = _LINE_NUMBER.search(problem)
    lines = text.split("\n")
    if number is None or int(number[1]) > len(lines):
        return ""
    line = lines[int(number[1]) - 1].strip()
    shown = f": {line[:_SHOWN]!r}"
    found = _PLAIN_VALUE.fullmatch(line)
    if found is None or not isinstance(typed_value(found[2]), str):
        return shown
    if _DECIMAL_COMMA.fullmatch(found[2]):
        return f"{shown}; a number has a decimal point: {found[1]} = {found[2].replace(',', '.')}"
    return f"{shown}; what is no plain number stands in quotes: {found[1]} = {_quoted(found[2])[:_SHOWN]}"


def typed_value(text: str) -> Any:
    """Read a value that somebody typed, as a rig file would have it; a word without quotes is a text."""
    try:
        return parse_toml(f"value = {text}")["value"]
    except ValueError:
        return text.strip()


def _check_bounds(text: str) -> None:
    if len(text) > LARGEST_BYTES:
        raise ValueError(f"{len(text)} characters; a rig file has up to {LARGEST_BYTES}")
    # A string may be a part of a key, and so leaves a word; a comment leaves nothing
    plain = _STRING_OR_COMMENT.sub(lambda found: "" if found[0].startswith("#") else "s", text)
    word = _LONG_WORD.search(plain)
    if word is not None:
        raise ValueError(f"a number or key of more than {LONGEST_WORD} characters: {word[0][:20]}...")
    key = _LONG_KEY.search(plain)
    if key is not None:
        raise ValueError(f"a key of more than {MOST_KEY_PARTS} parts: {key[0][:20]}...")
    if plain.count("[[") > MOST_TABLES:
        raise ValueError(f"more than {MOST_TABLES} tables `[[...]]`")
    depth = 0
    for bracket in _BRACKET.finditer(plain):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > DEEPEST_NESTING:
            raise ValueError(f"arrays or tables nested more than {DEEPEST_NESTING} deep")
