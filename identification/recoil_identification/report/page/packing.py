"""The packed content of a page beside its text: figures with their samples, the report, plotly's script.

::

    packed text  base64 of gzip of
      4 bytes      length of the JSON that follows, little-endian
      JSON         the document; an array in it is {"packed": [place, count, kind, ...]}
      arrays       from `place` on, counted from the end of the JSON

A curve needs no more than a screen can show and a read-out can say. ``steps`` are whole numbers of a step from an
origin on, each less the one before it, or less what the two before it lead to, whichever is less; the four bytes of all
numbers stand apart from one another: of a smooth curve all but the lowest bytes are equal, which gzip then takes out.
Of what ascends, as instants do, a step is a tenth of the way between two neighbours at the most. ``powers`` are those
of e, for what spans decades. ``f8`` are numbers as they are. A gap is a byte of a mask.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array

LEAST_STEPS = 64
"""Arrays of fewer numbers are left as they are."""
FINENESS = 2.0**-14
"""Step, as a share of what all but the outermost numbers span: a fifteenth of a pixel on a screen of 1000."""
FINENESS_OF_POWERS = 2.0**-15
"""Step of logarithms."""
OUTERMOST = 2.0
"""Percent of the numbers on either side that have no part in that."""
DECADES = 1e4
"""Ratio of the largest to the smallest of positive numbers, from which on they are kept by their logarithms."""
LARGEST_STEP_NUMBER = 2**29
"""Differences of two such numbers, made positive, fill 32 bits."""
STEPS_PER_INSTANT = 10.0
"""Least steps from one instant of a time base with jitter to the next, so that zooming in shows each at its place."""
GRID_TOLERANCE = 1e-3
"""Share of its step by which the instants of an even grid may stand off it."""


def packed(document: Any) -> str:
    """Pack a document whose arrays are numpy's.

    Parameters
    ----------
    document
        Document of JSON types, without NaN, and arrays of one axis of float64, NaN for a gap.

    Returns
    -------
    str
        Text of the characters of base64, the same for the same document.
    """
    arrays = bytearray()

    def place(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return {"packed": _put(value, arrays)}
        return str(value)

    written = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=place)
    # bytes of a file's name that are no text stand in JSON by their numbers
    text = written.encode("utf-8", "backslashreplace")
    return _compressed(len(text).to_bytes(4, "little") + text + bytes(arrays))


@lru_cache(maxsize=1)
def packed_file(path: Path) -> str:
    """Pack a file as it is: base64 of gzip of it."""
    return _compressed(path.read_bytes())


def unpacked(text: str) -> Any:
    """Return a packed document again, as a page's script does.

    Raises
    ------
    ValueError
        If the text is none.
    """
    content = gzip.decompress(base64.b64decode(text))
    end = 4 + int.from_bytes(content[:4], "little")

    def filled(value: dict[str, Any]) -> Any:
        # a column of somebody's shot log may bear this name, too
        place = value.get("packed")
        return _get(content[end:], *place) if isinstance(place, list) else value

    return json.loads(content[4:end], object_hook=filled)


def _compressed(content: bytes) -> str:
    # no time of day in it, so that the same page has the same bytes
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode("ascii")


def _put(values: Array, arrays: bytearray) -> list[Any]:
    """Append an array, and return where and how it is there."""
    at, count = len(arrays), int(values.size)
    present = np.isfinite(values)
    known, kind, step = values[present], "steps", 0.0
    if count >= LEAST_STEPS and known.size:
        if 0.0 < DECADES * known.min() < known.max():
            known, kind = np.log(known), "powers"
        step = FINENESS_OF_POWERS if kind == "powers" else _step(known)
    if step <= 0.0 or np.ptp(known) >= LARGEST_STEP_NUMBER * step:
        arrays += np.where(present, values, np.nan).astype("<f8").tobytes()
        return [at, count, "f8"]
    numbers = np.zeros(count, dtype=np.int64)
    numbers[present] = np.round((known - known[0]) / step)
    gaps = not present.all()
    if gaps:
        # a gap repeats what is before it
        numbers = numbers[np.maximum.accumulate(np.where(present, np.arange(count), 0))]
    differences, order = np.diff(numbers, prepend=0), 1
    twice = np.diff(differences, prepend=0)
    if np.log2(1.0 + np.abs(twice)).sum() < np.log2(1.0 + np.abs(differences)).sum() and np.abs(twice).max() < 2**31:
        differences, order = twice, 2
    folded = np.where(differences < 0, -2 * differences - 1, 2 * differences).astype("<u4")
    arrays += folded.view(np.uint8).reshape(-1, 4).T.tobytes()
    if gaps:
        arrays += present.astype(np.uint8).tobytes()
    return [at, count, kind, float(known[0]), step, gaps, order]


@np.errstate(over="ignore", invalid="ignore")
def _step(values: Array) -> float:
    """Return the step whose multiples stand for values; 0 where none would do."""
    span = float(np.ptp(values))
    if not 0.0 < span < math.inf:
        return 0.0 if span else 1.0
    differences, apart = np.diff(values), values - values[0]
    sizes = np.abs(differences)
    numbers = np.round(apart / sizes[sizes > 0.0].min())
    last = int(np.argmax(numbers))
    if 0.0 < numbers[last] < LARGEST_STEP_NUMBER:
        # the instants of a uniform time base are kept to the last digits
        even = float(apart[last] / numbers[last])
        if np.all(np.abs(apart - even * numbers) < GRID_TOLERANCE * even):
            return even
    low, high = np.percentile(values, [OUTERMOST, 100.0 - OUTERMOST])
    step = FINENESS * float(high - low if high > low else span)
    if np.all(differences > 0.0):
        step = min(step, float(np.percentile(differences, OUTERMOST)) / STEPS_PER_INSTANT)
    return step


def _get(arrays: bytes, at: int, count: int, kind: str, origin: float = 0.0, step: float = 0.0, gaps: bool = False,
         order: int = 1) -> Array:  # fmt: skip
    if kind == "f8":
        return np.frombuffer(arrays, "<f8", count, at).copy()
    planes = np.frombuffer(arrays, np.uint8, 4 * count, at).reshape(4, count)
    folded = np.ascontiguousarray(planes.T).view("<u4").reshape(-1).astype(np.int64)
    numbers = np.where(folded % 2, -(folded + 1) // 2, folded // 2)
    for _ in range(order):
        numbers = np.cumsum(numbers)
    values = origin + step * numbers
    if kind == "powers":
        values = np.exp(values)
    if gaps:
        values[np.frombuffer(arrays, np.uint8, count, at + 4 * count) == 0] = np.nan
    return values
