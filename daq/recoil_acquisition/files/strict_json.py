"""JSON that this project wrote, read so that nothing in it is passed over.

The standard library takes the last of two values of one key, and words for numbers that JSON does not have: a document
that was changed by hand or by another program would be read as somebody else sees it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError


def read_json(content: str | bytes, *, finite: bool = True) -> Any:
    """Read JSON.

    Parameters
    ----------
    finite
        Whether every number is; null stands in our documents for one that is not.

    Raises
    ------
    ValueError
        If it is none, has a key twice in one object, or has a number that is not finite and must be.
    RecursionError
        If it is nested too deeply.
    """
    if not finite:
        return json.loads(content, object_pairs_hook=_each_once)
    return json.loads(
        content, object_pairs_hook=_each_once, parse_constant=_finite, parse_float=_finite, parse_int=_whole
    )


@contextmanager
def told_in_one_line(
    what: str, path: Path, *, expected: str | None = None, remedy: str | None = None
) -> Iterator[None]:
    """Refuse a document that lacks something, or has it in the place of something else, whatever fails by it.

    Parameters
    ----------
    what
        Words for what the document cannot be taken for.

    Raises
    ------
    ReadError
        Of `path`, with what was found.
    """
    try:
        yield
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        found = f"no {error}" if isinstance(error, LookupError) else str(error)
        raise ReadError(what, path=path, expected=expected, found=found, remedy=remedy) from error


def as_floats(stated: Mapping[str, Any], kind: type[Any]) -> dict[str, Any]:
    """Return values with whole numbers as floats where a data class has floats.

    Another program that writes a document anew may write 283 for 283.0, and both print the same as a float alone.
    """
    floats = {one.name for one in fields(kind) if "float" in str(one.type)}
    return {name: float(value) if type(value) is int and name in floats else value for name, value in stated.items()}


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for at, name in enumerate(names) if name in names[:at])
        raise ValueError(f"the key {twice[:80]!r} twice in one object")
    return found


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"the number {text[:20]}")
    return number


def _whole(text: str) -> int:
    _finite(text)
    return int(text)
