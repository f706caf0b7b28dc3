"""Recorded files that shots were made of, and shots that were made of the same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.channel import Step
from recoil_acquisition.shot.shot import InputFile

INGEST, EXCERPTS = "ingest", "excerpts"
"""Step of a shot's history, and its parameter that says which part of a source's long recording the shot is."""
MOST_NAMED = 4


@dataclass(frozen=True)
class RecordedFile:
    """A recorded file, or the part of it, that a shot was made of.

    Attributes
    ----------
    name
        Name without folders.
    sha256
        Digest of the whole file.
    size
        Bytes of the whole file.
    span_s
        Span on the source's clock, s; None for all of the file.
    """

    name: str
    sha256: str
    size: int
    span_s: tuple[float, float] | None = None

    @classmethod
    def of_shot(cls, inputs: Iterable[InputFile], history: Sequence[Step]) -> tuple[RecordedFile, ...]:
        """Return what a shot was made of, by its inputs and its history."""
        made = next((step.parameters for step in reversed(history) if step.what == INGEST), {})
        parts = made.get(EXCERPTS) or {}
        return tuple(cls(one.name, one.sha256, one.size, _span_s(parts.get(one.source))) for one in inputs)

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> RecordedFile:
        """Read it from the inputs of a report; KeyError, TypeError or ValueError if it is none."""
        return cls(str(stated["file"]), str(stated["sha256"]), int(stated["size"]), _span_s(stated.get("excerpt")))

    def overlaps(self, other: RecordedFile) -> bool:
        """Whether something of the one file is in the other: two parts of a long recording may be two shots."""
        if self.sha256 != other.sha256:
            return False
        if self.span_s is None or other.span_s is None:
            return True
        return self.span_s[0] < other.span_s[1] and other.span_s[0] < self.span_s[1]


@dataclass(frozen=True)
class Double:
    """Files that a shot shares with another one.

    Attributes
    ----------
    of
        The other shot, as it is named to people.
    files
        Names of the shot's files that the other was made of too.
    whole
        Whether those are all of them: it is the same shot under another name.
    """

    of: str
    files: tuple[str, ...]
    whole: bool

    def __str__(self) -> str:
        if self.whole:
            return f"it is made of the same recorded files as {self.of}"
        return f"{named_files(self.files)} of it {'are' if len(self.files) > 1 else 'is'} of {self.of} too"

    @classmethod
    def between(cls, files: Sequence[RecordedFile], others: Sequence[RecordedFile], of: str) -> Double | None:
        """Return what a shot has of another one, `of`; None if they have nothing in common."""
        common = [one.name for one in files if any(one.overlaps(other) for other in others)]
        # two sources may share a file
        return cls(of, tuple(dict.fromkeys(common)), len(common) == len(files)) if common else None


def named_files(names: Sequence[str]) -> str:
    """Name the first few files."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{', '.join(names[:MOST_NAMED])}{more}"


def doubles(shots: Iterable[tuple[str, Sequence[RecordedFile]]]) -> dict[int, Double]:
    """Return which shots have files of one before them that is none itself, by their places.

    Parameters
    ----------
    shots
        Shots by the names by which people know them, each with the files that it was made of.
    """
    kept: list[tuple[str, Sequence[RecordedFile]]] = []
    found: dict[int, Double] = {}
    for place, (name, files) in enumerate(shots):
        same = (Double.between(files, others, of) for of, others in kept)
        if double := next((one for one in same if one is not None), None):
            found[place] = double
        else:
            kept.append((name, files))
    return found


def _span_s(part: Any) -> tuple[float, float] | None:
    """Return a part of a recording as the history states it; one that is not understood is all of it."""
    try:
        return float(part["start_s"]), float(part["stop_s"])
    except (LookupError, TypeError, ValueError):
        return None
