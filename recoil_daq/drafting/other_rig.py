"""Another rig file that a draft takes over from: of the same stand before a change, or an unfinished draft."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, ReadError, RigError
from recoil_acquisition.files.bounded_toml import LARGEST_BYTES, parse_toml
from recoil_acquisition.files.regular_file import read_small
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
    """

    path: Path
    tables: Mapping[str, Any]
    written: Mapping[str, Any]

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
        return cls(path, without_open_values(tables)[0], tables)

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
        return symbol in self.table("mechanism") and f"u_{symbol}" not in _table(self.written.get("mechanism"))

    def leaves_out(self, source: str, signal: str, key: str) -> bool:
        """Whether it has a channel of a signal and leaves out a key of the sensor, so that nobody is asked again."""
        row = _row_of(_rows(self.written.get("channel")), source, signal)
        return bool(row) and key not in _table(row.get("sensor"))

    def asks(self, source: str, signal: str, key: str) -> bool:
        """Whether a key of a signal's channel is still open in it."""
        return question_of(_row_of(_rows(self.written.get("channel")), source, signal).get(key)) is not None

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
        for row in self.rows("source"):
            if row.get("name") not in sources:
                yield f"{self.path.name} has a source {row.get('name')!r}, of which no file is given"
        for row in self.rows("channel"):
            if row.get("source") in listed and (row.get("source"), row.get("signal")) not in signals:
                channel = f"{self.path.name} has a channel {row.get('name')!r} of the signal {row.get('signal')!r}"
                yield f"{channel}, which the file of {row.get('source')!r} does not have"


def _rows(value: Any) -> tuple[Row, ...]:
    return tuple(row for row in value if isinstance(row, dict)) if isinstance(value, list) else ()


def _table(value: Any) -> Row:
    return value if isinstance(value, dict) else {}


def _row_of(channels: tuple[Row, ...], source: str, signal: str) -> Row:
    """Return the channel of a signal: of the source if several sources have such a signal."""
    rows = [row for row in channels if row.get("signal") == signal]
    own = [row for row in rows if row.get("source") == source] or rows
    return own[0] if len(own) == 1 else {}


def _kind(row: Row) -> str:
    return "dewetron" if row.get("kind") == "recorder" else str(row.get("kind"))


def _fits(match: Any, file_name: str) -> bool:
    pattern = match.replace(SHOT_PLACE, "*") if isinstance(match, str) else None
    return pattern is not None and fnmatch.fnmatch(file_name.casefold(), pattern.casefold())
