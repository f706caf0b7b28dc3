"""Another rig file that a draft takes over from: of the same stand before a change, or an unfinished draft."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, ReadError, RigError
from recoil_acquisition.files.bounded_toml import LARGEST_BYTES, parse_toml
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.shot_name import composed
from recoil_rigs.tables.knowledge import KNOWLEDGE
from recoil_rigs.tables.open_values import question_of, without_open_values
from recoil_rigs.tables.rig_tables import LAYOUT_KINDS, SHOT_PLACE

Row = Mapping[str, Any]


@dataclass(frozen=True)
class OtherRig:
    """Values that another rig file states; nothing of it is validated.

    Attributes
    ----------
    tables
        Tables of the file without its open values.
    written
        Tables of the file as they stand there.
    answered
        Whether somebody answered some of them since.
    """

    path: Path
    tables: Mapping[str, Any]
    written: Mapping[str, Any]
    answered: bool = False

    @classmethod
    def read(cls, path: Path) -> OtherRig:
        """Read a rig file, finished or not.

        Raises
        ------
        ReadError, RigError
            If there is none, or it is no TOML.
        """
        content = read_small(path, LARGEST_BYTES, "a rig file")
        try:
            tables = parse_toml(content.decode("utf-8-sig").replace("\r\n", "\n"))
        except UnicodeDecodeError as error:
            raise ReadError("is not UTF-8 text", path=path, place=f"byte {error.start}") from error
        except ValueError as error:
            raise RigError(path, [Fault(("TOML",), str(error), FaultCode.SYNTAX)]) from error
        return cls(path, without_open_values(tables).tables, tables)

    def with_answers(self, answers: Row) -> OtherRig:
        """Put what somebody answered before what it states; what it leaves open stays so."""
        tables = dict(self.tables)
        for key, value in answers.items():
            if isinstance(value, dict):
                tables[key] = {**self.table(key), **value}
            elif isinstance(value, list):
                tables[key] = [*_over(self.rows(key), _rows(value))]
            else:
                tables[key] = value
        return replace(self, tables=tables, answered=True)

    @property
    def reason(self) -> str:
        """Reason for a value that is taken over from it."""
        as_there = f"as in {self.path.name}" if self.written else ""
        return ", or ".join(filter(None, ("as answered" if self.answered else "", as_there)))

    def rows(self, key: str) -> tuple[Row, ...]:
        """Return the tables of an array, those that are tables."""
        return _rows(self.tables.get(key))

    def table(self, key: str) -> Row:
        """Return a table; empty if there is none."""
        return _table(self.tables.get(key))

    def databases(self) -> tuple[Path, ...]:
        """Return the CAN databases that it names, beside it."""
        names = dict.fromkeys(row["database"] for row in self.rows("source") if isinstance(row.get("database"), str))
        return tuple(self.path.parent / name for name in names)

    def source_of(self, file_name: str, kind: str) -> Row:
        """Return the source that a file is of: by its ``match``, else the one of its kind; empty if there is none."""
        of_kind = [row for row in self.rows("source") if _kind(row) == kind]
        fitting = [row for row in of_kind if _fits(row.get("match"), file_name)]
        chosen = fitting or of_kind
        return chosen[0] if len(chosen) == 1 else {}

    def laid_out(self, file_name: str) -> tuple[str, Row]:
        """Return kind and source of a file for which a layout of its table is declared; empty if there is none."""
        rows = [row for row in self.rows("source") if _table(row.get("layout")) and _kind(row) in LAYOUT_KINDS]
        fitting = [row for row in rows if _fits(row.get("match"), file_name)]
        return (_kind(fitting[0]), fitting[0]) if len(fitting) == 1 else ("", {})

    def roles_of(self, sources: Collection[str]) -> dict[str, str]:
        """Return the roles that channels of some sources have, each with the channel's name."""
        rows = [row for row in self.rows("channel") if row.get("source") in sources]
        return {str(row["role"]): str(row.get("name")) for row in rows if row.get("role")}

    def channel_of(self, source: str, signal: str) -> Row:
        """Return the channel that a signal of a source is; empty if there is none."""
        return _row_of(self.rows("channel"), source, signal)

    def sensor_of(self, source: str, signal: str) -> Row:
        """Return what it states of a signal's sensor."""
        return _table(self.channel_of(source, signal).get("sensor"))

    def takes_as_exact(self, symbol: str) -> bool:
        """Whether it states a value of the mechanism, and neither states nor asks for its uncertainty."""
        written = _table(self.written.get("mechanism"))
        return symbol in self.table("mechanism") and symbol in written and f"u_{symbol}" not in written

    def leaves_out(self, source: str, signal: str, key: str) -> bool:
        """Whether it has a channel of a signal and leaves out a key of the sensor, so that nobody is asked again."""
        row = _row_of(_rows(self.written.get("channel")), source, signal)
        # of a channel without a role nobody asked what its sensor is
        return "role" in row and key not in _table(row.get("sensor"))

    def asks(self, source: str, signal: str, key: str) -> bool:
        """Whether a key of a signal's channel is still open in it."""
        return question_of(_row_of(_rows(self.written.get("channel")), source, signal).get(key)) is not None

    def asks_to_know(self, key: str) -> bool:
        """Whether a key of what is known beside certificates is still open in it."""
        return question_of(_table(self.written.get(KNOWLEDGE)).get(key)) is not None

    def unmatched(self, sources: Collection[str], signals: frozenset[tuple[str, str]]) -> Iterator[str]:
        """Yield what it has that is in none of the files.

        Parameters
        ----------
        sources
            Names of the files' sources.
        signals
            Source and name of each signal of the files.
        """
        listed = {source for source, _ in signals}
        there = {(source, composed(signal)) for source, signal in signals}
        for row in self.rows("source"):
            if row.get("name") not in sources:
                yield f"{self.path.name} has a source {row.get('name')!r}, of which no file is given"
        for row in self.rows("channel"):
            if row.get("source") in listed and (row.get("source"), composed(str(row.get("signal")))) not in there:
                channel = f"{self.path.name} has a channel {row.get('name')!r} of the signal {row.get('signal')!r}"
                yield f"{channel}, which the file of {row.get('source')!r} does not have"


def _over(rows: Iterable[Row], answered: Sequence[Row]) -> Iterator[Row]:
    """Yield rows with what was answered of each, then those of which nothing was stated before."""
    left = {_identity(one): one for one in answered}
    for row in rows:
        more = left.pop(_identity(row), {})
        merged = {**row, **more}
        if _table(row.get("sensor")) and _table(more.get("sensor")):
            merged["sensor"] = {**row["sensor"], **more["sensor"]}
        yield merged
    yield from left.values()


def _identity(row: Row) -> tuple[Any, ...]:
    """Return by what a row is known: a channel by its signal, a source by its name."""
    return (row.get("source"), row["signal"]) if "signal" in row else (row.get("name"),)


def _rows(value: Any) -> tuple[Row, ...]:
    return tuple(row for row in value if isinstance(row, dict)) if isinstance(value, list) else ()


def _table(value: Any) -> Row:
    return value if isinstance(value, dict) else {}


def _row_of(channels: tuple[Row, ...], source: str, signal: str) -> Row:
    """Return the channel of a signal: of the source if several sources have such a signal."""
    rows = [row for row in channels if composed(str(row.get("signal", ""))) == composed(signal)]
    own = [row for row in rows if row.get("source") == source] or rows
    return own[0] if len(own) == 1 else {}


def _kind(row: Row) -> str:
    return "dewetron" if row.get("kind") == "recorder" else str(row.get("kind"))


def _fits(match: Any, file_name: str) -> bool:
    pattern = match.replace(SHOT_PLACE, "*") if isinstance(match, str) else None
    return pattern is not None and fnmatch.fnmatch(composed(file_name).casefold(), composed(pattern).casefold())
