"""The ranges of multiplexers' values in a DBC text, as few values that stand for them while it is parsed.

cantools lists every value of a range, and builds and checks the message's signals for each: 0-65535, which tools write,
takes it eight seconds. Values between which no range of the message begins or ends carry the same signals, so one of
them is enough.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise

_STRING = r'"(?:\\"|[^"])*?"'
_REMARK = re.compile(rf"({_STRING})|//[^\n]*")
_RANGES = re.compile(rf"{_STRING}|\bSG_MUL_VAL_\s+(\d[^;]*)(?=;|\Z)", re.ASCII)
_PART = re.compile(rf"{_STRING}|\bBO_\s+(\d+)\s+\w+\s*:|\bSG_\s+\w+\s+(?:m(\d+))?(M)?\s*:", re.ASCII)
_ENTRY = re.compile(r"(\d+)\s+(\w+)\s+(\w+)\s+(.*)", re.ASCII | re.DOTALL)
_RANGE = re.compile(r"\s*(-?\d{1,20})\s*-\s*(\d{1,20})\s*", re.ASCII)

MOST_VISITS = 1e7
"""Visits of signals, by multiplexer and value, that cantools makes for a database: it takes 4 s for this."""
_PER_VALUE = 250
"""Visits that one value more takes the time of."""
MOST_SIGNALS = 10_000
"""Signals of a message: cantools takes a second for so many. A frame has 512 bits."""


class MultiplexerRanges:
    """The multiplexers' ranges of a DBC text.

    Attributes
    ----------
    short_text
        Text in which the first value of a range stands for all of its that carry the same signals.

    Raises
    ------
    ValueError
        If a range is none, or cantools would be busy with the multiplexers, or the signals of a message, for minutes.
    """

    def __init__(self, text: str) -> None:
        text = _REMARK.sub(lambda found: found[1] or " ", text)
        entries = [_entry_of(found[1]) for found in _RANGES.finditer(text) if found[1]]
        markers, signals = _markers_and_signals(text)
        for key, count in signals.items():
            if count > MOST_SIGNALS:
                raise ValueError(f"message {key} has {count} signals, where {MOST_SIGNALS} are the most that is read")
        cuts = {key: {end for value in values for end in (value, value + 1)} for key, values in markers.items()}
        for key, _, _, ranges in entries:
            cuts.setdefault(key, set()).update(end for one in ranges for end in (one.start, one.stop))
        self._values: dict[int, list[int]] = {key: sorted(ends) for key, ends in cuts.items()}
        _check_visits(
            [(key, child, parent, self._count(key, ranges)) for key, child, parent, ranges in entries], markers
        )
        self.short_text = _RANGES.sub(lambda found: self._shorten(found[1]) if found[1] else found[0], text)

    def _places(self, key: int, one: range) -> range:
        return range(bisect_left(self._values[key], one.start), bisect_left(self._values[key], one.stop))

    def _count(self, key: int, ranges: Iterable[range]) -> int:
        return sum(len(self._places(key, one)) for one in ranges)

    def _shorten(self, entry: str) -> str:
        key, child, parent, ranges = _entry_of(entry)
        values = [self._values[key][at] for one in ranges for at in self._places(key, one)]
        return f"SG_MUL_VAL_ {key} {child} {parent} {', '.join(f'{value}-{value}' for value in dict.fromkeys(values))}"

    def in_full(self, key: int, values: Iterable[int]) -> list[range]:
        """Return the ranges that some values of the short text's message stand for, merged and increasing."""
        stops = dict(pairwise(self._values.get(key, ())))
        merged: list[range] = []
        for value in sorted(values):
            one = range(value, stops.get(value, value + 1))
            if merged and merged[-1].stop == one.start:
                one = range(merged.pop().start, one.stop)
            merged.append(one)
        return merged


def _entry_of(text: str) -> tuple[int, str, str, list[range]]:
    entry = _ENTRY.fullmatch(text)
    ranges = [_RANGE.fullmatch(one) for one in entry[4].split(",")] if entry else []
    found = [range(int(one[1]), int(one[2]) + 1) for one in ranges if one]
    if not entry or len(found) < len(ranges) or not all(one.start < one.stop for one in found):
        raise ValueError(f"SG_MUL_VAL_ {' '.join(text.split())[:80]}: no ranges such as 0-3, 7-7")
    return int(entry[1]), entry[2], entry[3], found


def _markers_and_signals(text: str) -> tuple[dict[int, list[int]], dict[int, int]]:
    """Return the values by which signals are marked, such as 5 of ``m5``, and the number of signals, by message."""
    key = -1
    markers: dict[int, list[int]] = defaultdict(list)
    signals: dict[int, int] = defaultdict(int)
    for found in _PART.finditer(text):
        if found[1]:
            key = int(found[1])
        elif not found[0].startswith('"'):
            signals[key] += 1
            if found[2]:
                markers[key].append(int(found[2]))
    return markers, signals


def _check_visits(entries: list[tuple[int, str, str, int]], markers: dict[int, list[int]]) -> None:
    children: dict[tuple[int, str], list[tuple[str, int]]] = defaultdict(list)
    for key, child, parent, count in entries:
        children[key, parent].append((child, count))
    known: dict[tuple[int, str], float] = {}

    def visits(key: int, name: str, above: frozenset[str]) -> float:
        if name in above:
            raise ValueError(f"message {key}: the multiplexer {name} depends on itself")
        if (key, name) not in known:
            below = children.get((key, name), [])
            own = sum(count for _, count in below) * float(_PER_VALUE + len(below))
            known[key, name] = own + sum(count * visits(key, child, above | {name}) for child, count in below)
        return known[key, name]

    total = sum(float(len(set(values))) * (_PER_VALUE + len(values)) for values in markers.values())
    for key, name in list(children):
        total += visits(key, name, frozenset())
        if total > MOST_VISITS:
            raise ValueError(f"message {key}: too many values of multiplexers, among them {name}'s")
    if total > MOST_VISITS:
        raise ValueError(f"{sum(map(len, markers.values()))} multiplexed signals, which is too many for one message")
