"""The shot log: a row for each shot of a folder, by the program and by people in any spreadsheet.

``shotlog.csv`` stands beside the shot files. `recoil_acquisition.store.spreadsheet` keeps the file as it was written,
`recoil_acquisition.store.shared_file` what several write at once; here are the columns that have a meaning, and whose
row is whose.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.shot_name import shot_name_fault
from recoil_acquisition.store.shared_file import (
    FileKind,
    LateWriting,
    SharedFile,
    digest,
    last_seen,
    late_writing,
    read_settled,
)
from recoil_acquisition.store.shot_log_row import COLUMNS, KNOWN, NUMBERS, POSSIBLE, ShotLogRow
from recoil_acquisition.store.spreadsheet import LARGEST_BYTES, Spreadsheet
from recoil_acquisition.store.written_number import decimal_mark, number_in, number_to_write

SHOT_LOG = "shotlog.csv"
_DECIDING = (*NUMBERS, "configuration", "exclude")
_ATTEMPTS = 20
"""Number of attempts at a log that others save again and again."""
_LEAST_LIKENESS = 0.85
"""Likeness from which on a column is taken for one that decides and is misspelt: the value in it would not count."""


@dataclass(frozen=True, repr=False)
class ShotLog:
    """The shot log of a folder; a log that is changed is another one until it is written.

    Attributes
    ----------
    rows
        Rows in the order of the file.
    sha256
        Digest of the file as it was read; None if there is none.
    shots
        Names of the shots that a row can be of.
    sheet
        The file as it stands.
    """

    path: Path
    rows: tuple[ShotLogRow, ...]
    sha256: str | None
    shots: frozenset[str]
    sheet: Spreadsheet

    @classmethod
    def read(cls, path: str | Path, shots: Iterable[str] | None = None) -> ShotLog:
        """Read a log, when nobody has been saving it for a moment; where there is no file it has no rows.

        Parameters
        ----------
        shots
            Names of the shots that a row can be of; those with a shot file beside the log if left out. A row ``1`` is
            that of the shot ``0001`` if no other of them is meant by it.

        Raises
        ------
        ReadError
            If the file cannot be read, is saved again and again, lacks what was there when a command last looked, has
            no column ``shot``, two rows of one shot, or a number that is none; with line and column.
        """
        path = Path(path)
        log = cls._with_content(read_settled(path, _KIND), path, shots)
        joined, of_these = log._joined(late_writing(path, _KIND))
        return replace(joined, sha256=digest(joined.sheet.content())) if of_these else log

    @classmethod
    def beside(cls, shot_file: str | Path) -> ShotLog:
        """Read the log in the folder of a shot file; errors as of `read`."""
        return cls.read(Path(shot_file).parent / SHOT_LOG)

    @classmethod
    def changed(
        cls,
        path: str | Path,
        change: Callable[[ShotLog], ShotLog],
        shots: Iterable[str] | None = None,
        *,
        as_it_is: bool = False,
        earlier: ShotLog | None = None,
    ) -> ShotLog:
        """Change a log, one command after another, in one step, and return it as it is then.

        Nobody else's writing is lost: a save that is under way is waited for, and one that falls between, or goes on
        later, is joined with the change. A log that is as it should be is left alone.

        Parameters
        ----------
        change
            Function that is given the log as it stands and returns it as it is to be; called again where somebody saved
            it meanwhile.
        shots
            Names of the shots, as for `read`.
        as_it_is
            Whether rows and columns that were there when a command last looked, and are not any more, were taken out.
        earlier
            Log whose rows and columns are put back first where they are missing.

        Raises
        ------
        StoreError
            If it cannot be written. It is as it was then.
        ReadError
            As `read`, and as `change`.
        """
        path = Path(path)
        with SharedFile.held(path, _KIND) as file:
            for _ in range(_ATTEMPTS):
                content, late = file.read(as_it_is=as_it_is), late_writing(path, _KIND)
                log = cls._with_content(content, path, shots)
                whole = log if earlier is None else earlier._changed_since(earlier, log)
                start, joined = whole._joined(late)
                wanted = change(start)
                by = wanted.sheet.content()
                if by == content:
                    file.seen(by)
                elif not file.replace(content, by, keep=not wanted._holds(log), base=whole.sheet.content()):
                    continue
                file.noted(joined)
                if {one.is_now for one in late_writing(path, _KIND)} <= {one.is_now for one in late}:
                    return replace(wanted, sha256=digest(by))
        raise StoreError("others save it again and again", path=path, remedy="close it in other programs")

    @classmethod
    def restored(cls, path: str | Path) -> ShotLog:
        """Put rows and columns back that were there when a command last looked; what stands in the log stays.

        Raises
        ------
        StoreError, ReadError
            As `changed`; also if no command has looked.
        """
        path = Path(path)
        seen = last_seen(path)
        if seen is None:
            raise StoreError("no command has looked at it before", path=path, remedy="take rows from a copy of it")
        earlier = cls._with_content(seen, path, None)
        return cls.changed(path, lambda log: log, as_it_is=True, earlier=earlier)

    @classmethod
    def _with_content(cls, content: bytes | None, path: Path, shots: Iterable[str] | None) -> ShotLog:
        names = shots_beside(path) if shots is None else frozenset(shots)
        if content is None:
            return cls._of(Spreadsheet.of(f"{','.join(COLUMNS)}\n".encode(), path, "shot"), None, names)
        return cls._of(Spreadsheet.of(content, path, "shot"), digest(content), names)

    def _joined(self, late: Iterable[LateWriting]) -> tuple[ShotLog, list[LateWriting]]:
        """Return the log with what somebody wrote into files that it came of, and what is known of that then.

        What is no log is left out: a copy of it is kept.
        """
        log, joined = self, list[LateWriting]()
        for one in late:
            with suppress(ReadError, StoreError, ValueError):
                theirs = self._with_content(one.is_now, self.path, self.shots)
                base = self._with_content(one.base, self.path, self.shots)
                try:
                    log = log._changed_since(base, theirs)
                except (StoreError, ValueError):  # in another encoding
                    log = log.with_missing(theirs)
                # they may have written a part only: what they have not yet is as it was
                joined.append(one._replace(base=base._changed_since(base, theirs).sheet.content()))
        return replace(log, sha256=self.sha256), joined

    def _changed_since(self, base: ShotLog, late: ShotLog) -> ShotLog:
        """Return a log that somebody wrote late with all rows and columns of this one, and what that changed since.

        In the last row of one that ends in it, a text that is the beginning of another is cut off.
        """
        last = "" if not late.rows or _is_ended(late.sheet.content()) else late.rows[-1].shot
        log = late
        for row in self.rows:
            now, was, theirs = (one.cells(row.shot) for one in (self, base, late))
            changed = {
                name: text
                for name in dict.fromkeys((*now, *was))
                if (text := now.get(name, "")) != was.get(name, "")
                or not theirs
                or name not in late.columns
                or (row.shot == last and text.startswith(theirs.get(name, "")))
            }
            changed.pop("shot", None)
            if changed or not theirs:
                log = log.with_cells(row.shot, changed)
        log.sheet.content()  # it may lack a character of these
        return log

    @classmethod
    def _of(cls, sheet: Spreadsheet, sha256: str | None, shots: frozenset[str]) -> ShotLog:
        rows = tuple(_rows(sheet, shots))
        lines: dict[str, int] = {}
        for row, line in zip(rows, sheet.lines, strict=True):
            if row.shot in lines:
                raise sheet.fault(
                    f"a second row of shot {row.shot}", line, _columns(sheet).index("shot"),
                    expected=f"one, as in line {lines[row.shot]}", remedy="take one of them away",
                )  # fmt: skip
            lines[row.shot] = line.number
        return cls(sheet.path, rows, sha256, shots, sheet)

    def __repr__(self) -> str:
        return f"ShotLog({len(self.rows)} rows, {self.path})"

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that have one."""
        return tuple(name for name in _columns(self.sheet) if name)

    def row(self, shot: str) -> ShotLogRow | None:
        """Return the row of a shot; None if no row can be known for it."""
        at = self._line(shot)
        return None if at is None else replace(self.rows[at], shot=shot)

    def cells(self, shot: str) -> dict[str, str]:
        """Return the cells of a shot's row that are not empty, by column, as they stand; none without a row."""
        at = self._line(shot)
        cells = () if at is None else self.sheet.lines[at].cells
        return {name: cell.text for name, cell in zip(_columns(self.sheet), cells, strict=False) if name and cell.text}

    def without_shot(self, names: Iterable[str] | None = None) -> tuple[str, ...]:
        """Return the shots of the rows that are of none of some shots, of those of the log if left out."""
        known = self.shots if names is None else frozenset(names)
        of_known = {self._line(name) for name in known}
        return tuple(row.shot for at, row in enumerate(self.rows) if at not in of_known)

    def with_row(self, row: ShotLogRow) -> ShotLog:
        """Add a row; nothing above it changes, unless the log has not all of its columns.

        Raises
        ------
        ValueError
            If the shot has a row.
        ReadError, StoreError
            If the row is none that could be read again.
        """
        if self._line(row.shot) is not None:
            raise ValueError(f"shot {row.shot!r} has a row in {self.path}")
        cells = {name: _text(value) for name, value in row.to_json().items()}
        return self.with_cells(row.shot, {name: text for name, text in cells.items() if name != "shot"})

    def with_missing(self, other: ShotLog) -> ShotLog:
        """Take from another log the rows and the cells that this one has not; what stands in both stays as it is."""
        log = self
        for row in other.rows:
            there, cells = log.cells(row.shot), other.cells(row.shot)
            missing = {name: text for name, text in cells.items() if name != "shot" and name not in there}
            if missing or log.row(row.shot) is None:
                log = log.with_cells(row.shot, missing)
        return log

    def with_cells(self, shot: str, cells: Mapping[str, str]) -> ShotLog:
        """Set cells of a shot's row, which is added if there is none.

        Parameters
        ----------
        cells
            Texts by column. One that the log does not have is added behind all others. A number is written with the
            decimal mark that the log has.

        Raises
        ------
        ValueError
            If the name of the shot, or of a column, cannot be written into a log.
        ReadError, StoreError
            If a number is none, or a column's name is nearly that of one with a meaning.
        """
        if fault := shot_name_fault(shot):
            raise ValueError(f"the shot's name {shot!r} {fault}")
        sheet = self.sheet
        for name in cells:
            if name == "shot" or not name or not name.isprintable() or name != name.strip():
                raise ValueError(f"{name!r} is no column whose cell can be set")
            if "\0" in cells[name]:
                raise ValueError(f"a zero byte in {name}")
            if name not in _columns(sheet):
                sheet = sheet.with_column(name)
        columns, mark = _columns(sheet), _mark(sheet)
        texts = {
            columns.index(name): self._written(shot, name, text.strip(), mark) if name in NUMBERS else text
            for name, text in cells.items()
        }
        at = self._line(shot)
        if at is None and (other := _meant(shot, self._shots_by_number, self.shots)) != shot:
            raise ValueError(f"a row of {shot!r} would be that of shot {other!r}")
        if at is None:
            texts[columns.index("shot")] = shot
            sheet = sheet.with_lines([[texts.get(column, "") for column in range(len(columns))]])
        else:
            sheet = sheet.with_cells(at, texts)
        return ShotLog._of(sheet, self.sha256, self.shots | {shot})

    def write(self) -> ShotLog:
        """Write the log in one step, and return it as it is then; a file that is as it should be is left alone.

        Raises
        ------
        StoreError
            If it cannot be written, or somebody else wrote the file since it was read. It is as it was then.
        """

        def as_it_is(found: ShotLog) -> ShotLog:
            if found.sha256 != self.sha256:
                raise StoreError("changed since it was read", path=self.path, remedy="run the command again")
            return self

        return ShotLog.changed(self.path, as_it_is, self.shots)

    def _written(self, shot: str, name: str, text: str, mark: str) -> str:
        """Return a number of a column as the log has it; StoreError if it is none, or none that is possible."""
        if not text:
            return text
        place = f"shot {shot}, column {name}"
        written, number = number_to_write(
            self.path, place, text, mark, NUMBERS[name], negative=not name.startswith("u_")
        )  # fmt: skip
        low, high = POSSIBLE.get(name, (-math.inf, math.inf))
        if not low <= number <= high:
            raise StoreError(
                "no such value is possible", path=self.path, place=place,
                expected=f"{low:g} and more" if high == math.inf else f"a number from {low:g} to {high:g}",
                found=repr(text), remedy=f"is it in {NUMBERS[name]}?",
            )  # fmt: skip
        return written

    def _holds(self, other: ShotLog) -> bool:
        """Return whether every cell of another log, of whose lines none was taken away, stands in this one."""
        lines = (other.sheet.header, *other.sheet.lines)
        of_these = zip(lines, (self.sheet.header, *self.sheet.lines), strict=False)
        same = all(
            not cell.text or cell.text == now.text
            for line, now_line in of_these
            for cell, now in zip(line.cells, now_line.cells, strict=False)
        )
        return same and len(lines) <= 1 + len(self.sheet.lines)

    @cached_property
    def _lines(self) -> Mapping[str, int]:
        return {row.shot: at for at, row in enumerate(self.rows)}

    @cached_property
    def _shots_by_number(self) -> Mapping[str, list[str]]:
        return _numbered(self.shots)

    def _line(self, shot: str) -> int | None:
        """Return which row is a shot's."""
        if shot in self._lines or shot in self.shots:
            return self._lines.get(shot)
        # a shot without a file in this folder
        bare = next(iter(_numbered([shot])), "")
        return None if bare in self._shots_by_number else self._lines.get(bare)


def meant_shot(name: str, shots: Iterable[str]) -> str:
    """Return the one shot that a name means, also without its zeros; the name itself where none is, or several are."""
    known = frozenset(shots)
    if name in known or not (name.isascii() and name.isdecimal()):
        return name
    meant = _numbered(known).get(name.lstrip("0") or "0", [])
    return meant[0] if len(meant) == 1 else name


def _lacks(content: bytes | None, earlier: bytes | None) -> str:
    """Say what a log lacks that is being saved: the end of its last line, columns, rows of an earlier one."""
    if earlier is None:
        return "" if content is None or _is_ended(content) else "the end of its last line"
    try:
        was = Spreadsheet.of(earlier, Path(SHOT_LOG), "shot")
        now = None if content is None else Spreadsheet.of(content, Path(SHOT_LOG), "shot")
    except ReadError:
        # whoever reads it says where; that it is too short tells that it is a part
        short = content is not None and (len(content) < len(earlier) or not _is_ended(content))
        return "the rest of it" if short else ""
    if now is not None and len(now.names()) < len(was.names()):
        gone = [name for name in was.names() if name not in now.names()]
        return f"{len(was.names()) - len(now.names())} of its {len(was.names())} columns, {_first(gone)}"
    rows = _named(was) - (Counter() if now is None else _named(now))
    if rows:
        return f"{rows.total()} of its {len(was.lines)} rows, {_first(sorted(rows))}"
    if content is not None and _is_ended(earlier) and not _is_ended(content):
        known = content.splitlines()[-1] in earlier.splitlines()
        return "" if known else "the end of its last line"
    return ""


def _named(sheet: Spreadsheet) -> Counter[str]:
    """Count the rows by the shots that they name, without the zeros that a spreadsheet takes away."""
    column = _columns(sheet).index("shot")
    texts = (line.cells[column].text for line in sheet.lines if column < len(line.cells))
    return Counter((text.lstrip("0") or "0") if text.isascii() and text.isdecimal() else text for text in texts)


def _first(names: Sequence[str]) -> str:
    return f"{', '.join(names[:8])}{' and more' if len(names) > 8 else ''}"


def _is_ended(content: bytes) -> bool:
    return content.rstrip(b"\0").endswith((b"\n", b"\r"))


_KIND = FileKind(
    "a shot log", LARGEST_BYTES, _lacks,
    "finish saving it, or put that back with `recoil-daq log --dir {folder} --restore`, or say by `--accept` that it "
    "was taken out",
)  # fmt: skip


def shots_beside(path: Path) -> frozenset[str]:
    """Return the names of the shots whose files stand beside a log, by the names of their files."""
    return frozenset(
        file.stem for file in path.parent.glob("*.h5") if file.is_file() and not shot_name_fault(file.stem)
    )


def _columns(sheet: Spreadsheet) -> list[str]:
    """Return the names of the columns; those with a meaning are known whatever the case."""
    return [name.casefold() if name.casefold() in KNOWN else name for name in sheet.names()]


def _check_columns(sheet: Spreadsheet) -> None:
    columns = _columns(sheet)
    for at, name in enumerate(columns):
        if name and name in columns[:at]:
            raise sheet.fault("a second column of this name", sheet.header, at, remedy="give it another name")
        if not name or name in KNOWN:
            continue
        for known in _DECIDING:
            likeness = SequenceMatcher(None, _letters(name), _letters(known)).ratio()
            if known not in columns and likeness >= _LEAST_LIKENESS:
                raise sheet.fault(
                    f"is this column `{known}`?", sheet.header, at, expected=repr(known), found=repr(name),
                    remedy=f"name it so, or add a column `{known}` beside it",
                )  # fmt: skip


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name[:80].casefold())


def _rows(sheet: Spreadsheet, shots: frozenset[str]) -> Iterable[ShotLogRow]:
    _check_columns(sheet)
    columns, mark, numbered = _columns(sheet), _mark(sheet), _numbered(shots)
    for line in sheet.lines:
        texts = {name: cell.text for name, cell in zip(columns, line.cells, strict=False) if name and cell.text}
        if "shot" not in texts:
            raise sheet.fault("names no shot", line, columns.index("shot"), remedy="name it, or empty the whole row")
        numbers = {
            name: number_in(sheet, line, columns.index(name), texts[name], mark, unit, negative=name[:2] != "u_")
            for name, unit in NUMBERS.items()
            if name in texts
        }
        known: dict[str, Any] = {name: texts[name] for name in KNOWN if name in texts} | numbers
        known["shot"] = _meant(texts["shot"], numbered, shots)
        own = {name: text for name, text in texts.items() if name not in KNOWN}
        yield ShotLogRow(**known, own=MappingProxyType(own), u_added_mass_stated="u_added_mass_kg" in numbers)


def _numbered(shots: Iterable[str]) -> Mapping[str, list[str]]:
    """Return the shots whose names are numbers, by what a spreadsheet makes of these."""
    found: dict[str, list[str]] = {}
    for shot in shots:
        if shot.isascii() and shot.isdecimal():
            found.setdefault(shot.lstrip("0") or "0", []).append(shot)
    return found


def _meant(name: str, numbered: Mapping[str, list[str]], shots: frozenset[str]) -> str:
    """Return the one shot whose name became this one in a spreadsheet; the name itself where none did, or several."""
    meant = numbered.get(name, [])
    return meant[0] if len(meant) == 1 and name not in shots else name


def _mark(sheet: Spreadsheet) -> str:
    return decimal_mark(sheet, [at for at, name in enumerate(_columns(sheet)) if name in NUMBERS])


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else repr(float(value)).removesuffix(".0")
