"""A rig file that is being drafted: tables of keys with the reason for each value, or the question in its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import KeyPath, Row, visible
from recoil_acquisition.files.bounded_toml import toml_key, toml_value
from recoil_daq.drafting.answer import Read, as_toml
from recoil_rigs.tables.open_values import OPEN_MARK

NO_REASONS: Mapping[KeyPath, str] = MappingProxyType({})
_WIDTH = 44
"""Column behind which the reasons of a table's values stand, if the values leave room."""


@dataclass(frozen=True)
class Question:
    """A value that only a person knows.

    Attributes
    ----------
    meaning
        Meaning of the value, with its unit, where it is found and what is usual.
    proposal
        Value that the evidence speaks for; None if there is none.
    read
        Reads what somebody types in answer to it.
    opens
        Whether the files tell more once it is answered.
    """

    meaning: str
    proposal: Any = None
    read: Read = field(default=as_toml, repr=False, compare=False)
    opens: bool = False

    def __str__(self) -> str:
        offered = "" if self.proposal is None else f"{_plain(self.proposal)}? "
        return f"{OPEN_MARK} {offered}{self.meaning}"


@dataclass(frozen=True)
class Entry:
    """A key of a table.

    Attributes
    ----------
    value
        Value in TOML's types, or a `Question`.
    reason
        Reason for the value, which stands beside it; empty if it needs none.
    """

    key: str
    value: Any
    reason: str = ""

    @property
    def is_open(self) -> bool:
        """Whether a question stands in place of the value."""
        return isinstance(self.value, Question)


@dataclass(frozen=True)
class Table:
    """A table of the file, with the tables that stand in it.

    Attributes
    ----------
    heading
        Heading as it stands in the file, such as ``[[channel]]``; empty for the top of the file.
    comments
        Lines of comment above it.
    left_out
        Whether all of it stands behind comment signs, ready to be taken in.
    """

    heading: str
    entries: tuple[Entry, ...]
    comments: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    left_out: bool = False

    def value(self, key: str) -> Any:
        """Return the value of a key; None if the table does not have it."""
        return next((one.value for one in self.entries if one.key == key), None)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the table and of those in it."""
        for line in self._lines():
            yield f"# {line}".rstrip() if self.left_out else line

    def _lines(self) -> Iterator[str]:
        yield from (visible(comment) if self.left_out else f"# {visible(comment)}" for comment in self.comments)
        if self.heading:
            yield self.heading
        for one in self.entries:
            if _is_rows(one.value):
                yield f"{toml_key(one.key)} = ["
                yield from (f"    {toml_value(row)}," for row in one.value)
                yield "]"
                continue
            text = f"{toml_key(one.key)} = {toml_value(str(one.value) if one.is_open else one.value)}"
            yield f"{text:<{_WIDTH}} # {visible(one.reason)}" if one.reason else text
        for table in self.tables:
            if table.heading:
                yield ""
            yield from table.lines()


@dataclass(frozen=True)
class OpenEntry:
    """A question of a draft, and the place of its key in the rig file."""

    parts: KeyPath
    question: Question


@dataclass(frozen=True)
class RigDraft:
    """The draft of a rig file.

    Attributes
    ----------
    tables
        Tables in the order of the file.
    """

    tables: tuple[Table, ...] = field(default_factory=tuple)

    def text(self) -> str:
        """Return the text of the rig file."""
        return "\n\n".join("\n".join(table.lines()) for table in self.tables) + "\n"

    def questions(self) -> tuple[OpenEntry, ...]:
        """Return the questions in the order of the file."""
        return tuple(one for table, place in self._placed() if not table.left_out for one in _open_in(table, place))

    def answered(self, values: Mapping[KeyPath, Any], reasons: Mapping[KeyPath, str] = NO_REASONS) -> RigDraft:
        """Put values in the places of questions, by the keys that `questions` gives; None leaves a key out.

        Parameters
        ----------
        reasons
            Reasons for some of the values.
        """
        return RigDraft(
            tuple(
                table if table.left_out else _answered(table, place, values, reasons) for table, place in self._placed()
            )
        )

    def _placed(self) -> Iterator[tuple[Table, KeyPath]]:
        """Yield the tables with the places of their keys in the rig file."""
        counts: dict[str, int] = {}
        for table in self.tables:
            key = table.heading.strip("[]")
            if table.heading != f"[[{key}]]" or table.left_out:
                yield table, tuple(key.split(".")) if key else ()
                continue
            yield table, (Row(key, str(table.value("name")), counts.get(key, 0)),)
            counts[key] = counts.get(key, 0) + 1


def _open_in(table: Table, where: KeyPath) -> Iterator[OpenEntry]:
    for one in table.entries:
        if isinstance(one.value, Question):
            yield OpenEntry((*where, one.key), one.value)
    for inner in table.tables:
        yield from _open_in(inner, (*where, *_inner_place(inner)))


def _inner_place(table: Table) -> tuple[str, ...]:
    """Return the keys of a table below the one that it stands in: ``sensor`` of ``[channel.sensor]``."""
    return tuple(table.heading.strip("[]").split(".")[1:])


def _answered(table: Table, where: KeyPath, values: Mapping[KeyPath, Any], reasons: Mapping[KeyPath, str]) -> Table:
    entries = []
    for one in table.entries:
        key = (*where, one.key)
        if not one.is_open or key not in values:
            entries.append(one)
        elif values[key] is not None:
            entries.append(replace(one, value=values[key], reason=reasons.get(key, one.reason)))
    inner = tuple(_answered(one, (*where, *_inner_place(one)), values, reasons) for one in table.tables)
    return replace(table, entries=tuple(entries), tables=inner)


def _is_rows(value: Any) -> bool:
    """Whether a value is a list of tables, each of which gets a line."""
    return isinstance(value, list) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else toml_value(value)
