"""Everything that recoil-daq raises on purpose.

::

    RecoilDaqError
    +-- ReadError               a file cannot be used (path, place)
    |   +-- UnknownFormatError  no reader, or more than one, claims the file (candidates)
    |   +-- CorruptFileError    the file contradicts its own format (file_end: whether its end is missing)
    |   +-- MissingChannelError a name that the file does not have (name, nearest)
    |   +-- NoSignalError       a sound file of which nothing is a time history (contents)
    |   +-- NoFrameRateError    a camera's table without time, whose source declares no frame rate
    +-- FramingError            a byte stream contradicts its declared framing
    +-- StoreError              a shot file cannot be written or is not one
    +-- RigError                a rig file is at fault (faults: all of them at once)
    +-- DeviceError             a live source cannot be opened or fails
    +-- AlignmentError          two clocks cannot be related at all
    +-- IdentificationError     no number can be given at all
    +-- WorkerError             a process or machine that a shot was given to does not answer
    +-- ShortageError           this computer, or a limit on this process, has too little memory

A caller's mistake stays ``ValueError`` or ``TypeError``. A poor fit or an unusable shot is a
result with reasons, not an error. Foreign exceptions are mapped at the edge, ``from`` the cause.

Decisions are made by an error's class, its `ErrorCode` and the `FaultCode` of its faults, never by its words.

Text that a file or a user wrote goes out through `visible`: what a terminal, a log or a spreadsheet would obey is
written as it is spelled.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher, get_close_matches
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

from recoil_acquisition.remark import Severity

_OBEYED = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u061c\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Controls (C0, DEL, C1), separators of lines, marks of direction (Unicode Annex 9), and bytes that are no text."""


def visible(text: str) -> str:
    r"""Return one line of text in which nothing is hidden: ``\x1b`` for an escape, ``\u202e`` for right to left."""
    return _OBEYED.sub(_spelled, text)


def quoted(place: object) -> str:
    """Return a path as a word of a command that can be pasted: in quotes where a shell would take it apart."""
    return shlex.quote(str(place))


def _spelled(match: re.Match[str]) -> str:
    code = ord(match.group())
    return {9: r"\t", 10: r"\n", 13: r"\r"}.get(code) or (f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}")


class ErrorCode(StrEnum):
    """Kind of an error: that of its class, or a narrower one that the place where it is raised states."""

    READ = "read"
    FORMAT = "format"
    CORRUPT = "corrupt"
    CHANNEL = "channel"
    NO_SIGNAL = "no signal"
    FRAME_RATE = "frame rate"
    FRAMING = "framing"
    STORE = "store"
    RIG = "rig"
    DEVICE = "device"
    ALIGNMENT = "alignment"
    IDENTIFICATION = "identification"
    WORKER = "worker"
    SHORTAGE = "shortage"
    OTHER = "other"
    CUT_OFF = "cut off"
    """A file ends before what it states, or begins, is there: a `ReadError` with `FileEnd.MISSING`."""
    NO_SOURCE = "no source"
    """A file is of no source of the rig."""
    NOT_INSTALLED = "not installed"
    """An optional library is needed, which the remedy installs."""
    EXISTS = "exists"
    """A file or folder to be written is there already, and nothing is overwritten unless that is asked for."""
    NOT_VALID = "not valid"
    """A result is not valid, and what was asked for is made of valid ones alone."""


class RecoilDaqError(Exception):
    """Root of all errors of this project: one line that says where, what, and what to do.

    Parameters
    ----------
    problem
        Sentence on what is wrong, without a final full stop.
    code
        Kind of the error where it is narrower than that of its class.
    path
        File or folder at fault.
    place
        Place in the file: a line, a byte offset, a key path.
    expected, found
        Content that should have been there, and the content that was.
    remedy
        Sentence on what the user can do about it.

    Attributes
    ----------
    usual_code
        Code of errors of the class that state none.
    """

    usual_code: ClassVar[ErrorCode] = ErrorCode.OTHER

    def __init__(
        self,
        problem: str,
        *,
        code: ErrorCode | None = None,
        path: Path | str | None = None,
        place: str | None = None,
        expected: str | None = None,
        found: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(problem)
        self.problem = problem
        self.code = self.usual_code if code is None else code
        self.path = None if path is None else Path(path)
        self.place = place
        self.expected = expected
        self.found = found
        self.remedy = remedy

    def __reduce__(self) -> tuple[Any, ...]:
        # The plain protocol calls the class with the message alone, which a subclass with other
        # parameters refuses; errors must come back from worker processes as they were raised
        return _restore, (type(self), self.args, self.__dict__)

    def __str__(self) -> str:
        text = self.without_path()
        return text if self.path is None else f"{_one_line(str(self.path))}: {text}"

    def finding(self) -> dict[str, str | None]:
        """Return it in JSON types, as an entry of ``findings`` about its file."""
        about = None if self.path is None else self.path.name
        return {"code": self.code.value, "about": about, "severity": Severity.FATAL.value, "text": str(self)}

    def without_path(self) -> str:
        """Return the error's line without the path of its file, for where that is known."""
        text = self.problem if self.place is None else f"{self.place}: {self.problem}"
        if self.expected is not None:
            text += f"; expected {self.expected}"
        if self.found is not None:
            text += f"{',' if self.expected is not None else ';'} found {self.found}"
        if self.remedy is not None:
            text += f"; {self.remedy}"
        return _one_line(text)


def _one_line(text: str) -> str:
    return text.replace("\n", " ")


def _restore(kind: type[RecoilDaqError], args: tuple[Any, ...], state: dict[str, Any]) -> RecoilDaqError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class FileEnd(StrEnum):
    """Whether the end of a file may be what is wrong with it, so that one that is still being written may be mended."""

    MISSING = "missing"
    """The file ends before what it states, or begins, is there."""
    UNCLEAR = "unclear"
    """The file is damaged, and a missing end may be why."""
    THERE = "there"
    """Something else is wrong with the file."""


class ReadError(RecoilDaqError):
    """A file cannot be used.

    Parameters
    ----------
    file_end
        End of the file as far as that is known; that of the class if left out. `FileEnd.MISSING` alone makes the code
        `ErrorCode.CUT_OFF`.

    Attributes
    ----------
    usual_file_end
        End of the file for errors of the class that do not state it.
    """

    usual_code = ErrorCode.READ
    usual_file_end: ClassVar[FileEnd] = FileEnd.THERE

    def __init__(
        self, problem: str, *, code: ErrorCode | None = None, file_end: FileEnd | None = None, **where: Any
    ) -> None:
        self.file_end = self.usual_file_end if file_end is None else file_end
        if code is None and self.file_end is FileEnd.MISSING:
            code = ErrorCode.CUT_OFF
        super().__init__(problem, code=code, **where)


class UnknownFormatError(ReadError):
    """No reader claims a file, or more than one does.

    Attributes
    ----------
    candidates
        Names of the readers that claim the file.
    known
        Names of all readers.
    foreign
        Name of the format that the file is of and that nothing reads; empty if it is not known.
    shapes
        Names of the readers that would take the file by its shape, where a rig says whose it is.
    """

    usual_code = ErrorCode.FORMAT
    usual_file_end = FileEnd.UNCLEAR

    def __init__(
        self,
        path: Path,
        candidates: Sequence[str],
        known: Sequence[str],
        *,
        found: str = "",
        remedy: str = "",
        foreign: str = "",
        shapes: Sequence[str] = (),
    ) -> None:
        self.candidates, self.known, self.foreign = tuple(candidates), tuple(known), foreign
        self.shapes = tuple(shapes)
        if candidates:
            super().__init__(
                "more than one reader claims this file",
                path=path,
                found=", ".join(candidates),
                remedy="this is a fault of the readers: please report it with the file's first lines",
            )
        elif foreign:
            super().__init__(f"this is {foreign}, which is not read", path=path, remedy=f"{remedy}; or leave it out")
        else:
            usual = "export it in one of these, or declare the `layout` of its source if it is a table of text"
            super().__init__(
                "no reader recognises this file's content",
                path=path,
                expected=f"one of the {len(known)} formats that `recoil-daq formats` lists",
                found=found or None,
                remedy=f"{remedy or usual}; or leave it out",
            )


class CorruptFileError(ReadError):
    """A file contradicts its own format."""

    usual_code = ErrorCode.CORRUPT
    usual_file_end = FileEnd.UNCLEAR


class MissingChannelError(ReadError):
    """A name that a file does not have.

    Attributes
    ----------
    name
        Name that was asked for.
    nearest
        Names that the file has, nearest first.
    """

    usual_code = ErrorCode.CHANNEL

    def __init__(self, name: str, available: Sequence[str], *, path: Path | None = None) -> None:
        self.name = name
        self.nearest = nearest_first(name, available)
        shown = ", ".join(repr(n) for n in self.nearest[:8])
        more = f" and {len(self.nearest) - 8} more" if len(self.nearest) > 8 else ""
        super().__init__(
            f"no signal {name!r} in this file",
            path=path,
            found=f"{shown}{more}" if self.nearest else "no signals at all",
            remedy="correct `signal` in the rig file, nearest names first",
        )


class NoSignalError(ReadError):
    """A file holds no time history that can be read.

    Attributes
    ----------
    contents
        Contents of the file by their names, each with the reason why it is none.
    remarks
        Sentences on the file beside these.
    incomplete
        Sign by which it shows that the file was cut off; empty if nothing shows that.
    """

    usual_code = ErrorCode.NO_SIGNAL
    usual_file_end = FileEnd.UNCLEAR

    def __init__(
        self, problem: str, contents: Mapping[str, str], remarks: Sequence[str] = (), incomplete: str = "", **where: Any
    ) -> None:
        self.contents, self.remarks, self.incomplete = dict(contents), tuple(remarks), incomplete
        super().__init__(problem, **where)


class NoFrameRateError(ReadError):
    """A camera's table has no time, and its source declares no frame rate."""

    usual_code = ErrorCode.FRAME_RATE


class FramingError(RecoilDaqError):
    """A byte stream contradicts its declared framing, or the framing contradicts itself.

    Attributes
    ----------
    faults
        Faults of a declared framing, all of them.
    """

    usual_code = ErrorCode.FRAMING

    def __init__(self, problem: str, faults: Sequence[Fault] = (), **where: Any) -> None:
        self.faults = tuple(faults)
        super().__init__(problem, **where)


class StoreError(RecoilDaqError):
    """A shot file or report cannot be written, or is not what it claims to be."""

    usual_code = ErrorCode.STORE

    @classmethod
    def exists(cls, path: Path, remedy: str, what: str = "") -> StoreError:
        """Return the error of a file that is there already and is not to be replaced."""
        return cls(f"{what} exists already".strip(), code=ErrorCode.EXISTS, path=path, remedy=remedy)


class FaultCode(StrEnum):
    """Kind of a fault of a rig file, of its sources' files against it, or of what a command was given beside it."""

    SYNTAX = "syntax"
    """The text is no TOML."""
    MISSING = "missing"
    UNKNOWN = "unknown"
    """A key is none, or the name that it refers to."""
    DUPLICATE = "duplicate"
    TYPE = "type"
    """The value is of another kind than the key takes: a text in place of a number."""
    VALUE = "value"
    """The value has the right type, and is none of those that the key takes."""
    RANGE = "range"
    """A number lies beyond its bounds."""
    UNIT = "unit"
    CONTRADICTION = "contradiction"
    """Keys are sound alone and do not go together, or with what a file states."""
    AMBIGUOUS = "ambiguous"
    """Several bear the name."""
    FILE = "file"
    """A file cannot be used."""
    CHANGED = "changed"
    """A rig file says what is no correction of the one that a shot was recorded with."""
    AT_REST = "at rest"
    """The trigger fires although nothing moves."""
    UNUSUAL = "unusual"
    """Few rigs have the value."""
    OVERDUE = "overdue"
    """The due date of a calibration has passed."""
    LATER = "later"
    """A calibration was made after the day for which it is to hold."""
    OPEN = "open"
    """Nobody has stated the value yet: a text that begins with TODO stands in its place."""


@dataclass(frozen=True)
class Row:
    """A part of a key that names one of several tables, such as ``channel[3] 'p_brake'``.

    Attributes
    ----------
    table
        Key of the tables.
    name
        Name that the table states; None if it states none.
    index
        Number of the table in the rig file, from 0; None where it does not matter.
    """

    table: str
    name: str | None = None
    index: int | None = None

    def __str__(self) -> str:
        number = "" if self.index is None else f"[{self.index}]"
        return f"{self.table}{number}" + ("" if self.name is None else f" '{self.name}'")


KeyPath: TypeAlias = tuple[str | int | Row, ...]
"""Parts of a key, outermost first: names of keys, rows of tables, and numbers of entries from 0."""


def spelled(key: KeyPath) -> str:
    """Spell a key as people read it, for example ``channel[3] 'p_brake'.unit``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f"{'.' if text else ''}{part}"
    return text


@dataclass(frozen=True)
class Fault:
    """One fault of a rig file.

    Attributes
    ----------
    parts
        Parts of the key at fault, outermost first; empty if no key is.
    problem
        Sentence on what is wrong and what would be right.
    code
        Kind of the fault.
    about
        Channel, source or file that the fault is about where no part of its key names it; else None.
    known
        Keys of the table, where the one at fault is none of them; None of another fault.
    meant
        Keys of the table that it is perhaps.
    undeclared
        Source or channel that is referred to, and declared nowhere; None of another fault.
    """

    parts: KeyPath
    problem: str
    code: FaultCode
    about: str | None = None
    known: tuple[str, ...] | None = field(default=None, compare=False)
    meant: tuple[str, ...] = field(default=(), compare=False)
    undeclared: str | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return f"{self.key}: {self.problem}" if self.parts else self.problem

    @property
    def key(self) -> str:
        """Key as people read it, see `spelled`."""
        return spelled(self.parts)

    @property
    def subject(self) -> str | None:
        """Name of the channel, source or file that the fault is about; None if it is about none."""
        if self.about is not None:
            return self.about
        return next((part.name for part in self.parts if isinstance(part, Row)), None)

    def below(self, where: KeyPath) -> Fault:
        """Return the fault of a table that stands below another key."""
        return replace(self, parts=(*where, *self.parts))

    def to_json(self) -> dict[str, str]:
        """Return it in JSON types, as an entry of ``faults`` or ``warnings``."""
        return {"key": self.key, "problem": self.problem, "code": self.code.value}

    def finding(self, severity: Severity) -> dict[str, str | None]:
        """Return it in JSON types, as an entry of ``findings``."""
        return {"code": self.code.value, "about": self.subject, "severity": severity.value, "text": str(self)}


class RigError(RecoilDaqError):
    """A rig file is at fault.

    Attributes
    ----------
    faults
        Faults of the file, every one that was found and not the first alone.
    stated
        Number of values that only a person knows and that the file states, where others of them are open.
    """

    usual_code = ErrorCode.RIG

    def __init__(self, path: Path | str, faults: Sequence[Fault], *, stated: int = 0) -> None:
        self.faults, self.stated = tuple(faults), stated
        super().__init__(f"{self.heading}: " + " | ".join(str(f) for f in faults), path=path)

    @property
    def open(self) -> int:
        """Number of values that are open."""
        return sum(fault.code is FaultCode.OPEN for fault in self.faults)

    @property
    def heading(self) -> str:
        """Number of its faults, and of the values that are stated where some are open, in words."""
        wrong = len(self.faults) - self.open
        parts = [f"{wrong} fault{'' if wrong == 1 else 's'}"] if wrong or not self.open else []
        parts += [f"{self.stated} of {self.stated + self.open} values stated"] if self.open else []
        return ", ".join(parts)


class DeviceError(RecoilDaqError):
    """A live source cannot be opened, or fails."""

    usual_code = ErrorCode.DEVICE


class AlignmentError(RecoilDaqError):
    """Two clocks cannot be related at all: there is nothing to align by."""

    usual_code = ErrorCode.ALIGNMENT


class IdentificationError(RecoilDaqError):
    """No number can be given at all."""

    usual_code = ErrorCode.IDENTIFICATION


class WorkerError(RecoilDaqError):
    """A process or a machine that a shot was given to cannot be reached, or ended before the shot was done."""

    usual_code = ErrorCode.WORKER


class ShortageError(RecoilDaqError):
    """Memory or threads are short: of this computer, or by a limit on this process."""

    usual_code = ErrorCode.SHORTAGE


@contextmanager
def system_errors_as(
    kind: type[ReadError | StoreError], path: Path, done: str, remedy: str | None = None
) -> Iterator[None]:
    """Turn an error of the system into one line: what cannot be done with a path, and why.

    Parameters
    ----------
    kind
        Class of the error: `ReadError` or `StoreError`.
    path
        File or folder.
    done
        Action that was to be done with the path: ``read``, ``written``, ``removed``.
    remedy
        Sentence on what the user can do.
    """
    try:
        yield
    except OSError as error:
        raise kind(f"cannot be {done}: {error.strerror or error}", path=path, remedy=remedy) from error


LEAST_LIKENESS = 0.5
"""Likeness of two names from which on one may have been meant by the other: ``mass`` is not like ``YA``."""


def nearest_first(name: str, available: Sequence[str]) -> tuple[str, ...]:
    """Sort names by their likeness to one, the most alike first.

    Returns
    -------
    tuple of str
        Names of ``available``, all of them; those without any likeness keep their order, last.
    """
    if not available:
        return ()
    # Names that differ by case alone are equally near, but for the one in the case of what was written
    folded: dict[str, list[str]] = {}
    for a in available:
        folded.setdefault(a.casefold(), []).append(a)
    alike = [folded[c] for c in get_close_matches(name.casefold(), folded, n=len(folded), cutoff=0.3)]
    close = [a for same in alike for a in sorted(same, key=lambda a: -SequenceMatcher(None, name, a).ratio())]
    return (*close, *(a for a in available if a not in close))


def did_you_mean(name: str, names: Sequence[str], *, quote: str = "'") -> str:
    """Ask for the nearest of some names, or list all where none is near."""
    if not names:
        return "none is declared"
    nearest = near(name, names)
    return f"there are {', '.join(names)}" if nearest is None else f"did you mean {quote}{nearest}{quote}?"


def near(name: str, names: Sequence[str]) -> str | None:
    """Return the nearest of some names; None where none is near."""
    nearest = next(iter(nearest_first(name, names)), "")
    return nearest if SequenceMatcher(None, name.casefold(), nearest.casefold()).ratio() >= LEAST_LIKENESS else None
