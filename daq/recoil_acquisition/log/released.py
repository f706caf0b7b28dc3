"""Records of a log that were given back on purpose: spans of numbers, within the log and within each source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

WHOLE = -1
"""Key of the numbers within the log, beside those of the sources."""

Span = tuple[int, int, int]
"""First and last number, and bytes of payload."""


class Released:
    """Spans that were released so far, of the log and of each source."""

    def __init__(self, spans: Mapping[int, Sequence[Span]] | None = None) -> None:
        self._spans = {key: merged(found) for key, found in (spans or {}).items()}

    @classmethod
    def from_json(cls, said: Mapping[str, Any]) -> Released:
        """Read what `to_json` gave.

        Raises
        ------
        ValueError, TypeError, KeyError, AttributeError, OverflowError
            If it is anything else.
        """
        spans = {WHOLE: said["records"]} | {int(source): found for source, found in said["sources"].items()}
        return cls({key: [(int(a), int(b), int(size)) for a, b, size in found] for key, found in spans.items()})

    def to_json(self) -> dict[str, Any]:
        """Return the content of a record that says so."""
        sources = {str(source): found for source, found in self._spans.items() if source != WHOLE}
        return {"records": self.of(WHOLE), "sources": sources}

    def add(self, spans: Mapping[int, Sequence[int]]) -> None:
        """Add one span of each key."""
        for key, (first, last, size) in spans.items():
            self._spans[key] = merged([*self.of(key), (first, last, size)])

    def of(self, key: int) -> list[Span]:
        """Return the spans of a source, or of the whole log, in their order."""
        return self._spans.get(key, [])

    @property
    def records(self) -> int:
        """Number of records of the log."""
        return sum(last - first + 1 for first, last, _ in self.of(WHOLE))


def merged(spans: Sequence[Span]) -> list[Span]:
    """Join spans (first, last, bytes) of numbers that follow one another."""
    joined: list[Span] = []
    for first, last, size in sorted(spans):
        if joined and joined[-1][1] + 1 == first:
            joined[-1] = (joined[-1][0], last, joined[-1][2] + size)
        else:
            joined.append((first, last, size))
    return joined
