"""One run of a command: what goes to stdout and stderr, and which exit code ends it."""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from recoil_acquisition.errors import RecoilDaqError

OK, NOT_VALID, FAULT, INTERRUPTED = 0, 1, 3, 130

Item = TypeVar("Item")


LONGEST_NAME = 120
"""Letters of a name that no file can have, of which more are not shown."""


class Session:
    """Catches the one root of the project's errors, a shortage of memory and paths that the system refuses.

    Stdout is kept for the result.

    Parameters
    ----------
    as_json
        Whether one JSON document is printed on stdout, and nothing else there.
    debug
        Whether the traceback of an error is shown on stderr.
    """

    def __init__(self, as_json: bool, debug: bool) -> None:
        self.as_json = as_json
        self.debug = debug

    def __enter__(self) -> Session:
        from recoil_acquisition.errors import ShortageError
        from recoil_acquisition.processes.shortage import check_address_space

        try:
            check_address_space()
        except ShortageError as error:
            self.refuse(error)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, KeyboardInterrupt):
            typer.echo("interrupted; nothing half-written was left behind", err=True)
            raise typer.Exit(INTERRUPTED) from None
        from recoil_acquisition.errors import RecoilDaqError
        from recoil_acquisition.processes.shortage import is_shortage, shortage_of

        refused = _refused_path(error)
        if error is None or not (isinstance(error, RecoilDaqError) or is_shortage(error) or refused is not None):
            return
        if self.debug:
            for line in "".join(traceback.format_exception(error)).rstrip("\n").split("\n"):
                typer.echo(_visible(line), err=True)
        self.refuse(error if isinstance(error, RecoilDaqError) else refused or shortage_of(error))

    def refuse(self, error: RecoilDaqError, code: int = FAULT) -> NoReturn:
        """Print an error, as a document too where one is asked for, and end."""
        if self.as_json:
            self._print(error_document(error))
        self.warn(error)
        raise typer.Exit(code) from None

    def warn(self, error: Exception) -> None:
        """Print the line of an error that does not keep the rest from its result."""
        for line in _lines(error):
            typer.echo(_visible(line), err=True)

    def finish(self, document: Mapping[str, Any], show: Callable[[], None], code: int) -> NoReturn:
        """Print the result, as a document or as people read it, and end with an exit code."""
        if self.as_json:
            self._print(document)
        else:
            show()
        raise typer.Exit(code)

    def each(self, title: str, start: Callable[[Callable[[str], None]], Iterator[Item]]) -> Iterator[Item]:
        """Show the steps towards each of several results; while one is printed nothing is shown beside it.

        Parameters
        ----------
        start
            Function that is given whom to tell of a step, and returns the results.
        """

        def tell(step: str) -> None:
            told(step)

        results = start(tell)
        while True:
            with self.steps(title) as told:
                try:
                    one = next(results)
                except StopIteration:
                    return
            yield one

    @property
    def asks(self) -> bool:
        """Whether somebody sits at a terminal who can be asked."""
        return not self.as_json and sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()

    def sure(self, doubts: Sequence[str]) -> bool:
        """Ask at a terminal whether to go on in spite of doubts; without one nobody can be asked, and it is told."""
        if not self.asks:
            return True
        for doubt in doubts:
            typer.echo(_visible(doubt), err=True)
        try:
            return typer.confirm("Set it all the same?", err=True)
        except typer.Abort:
            return False

    @contextmanager
    def steps(self, title: str) -> Iterator[Callable[[str], None]]:
        """Show on stderr which step is under way, with the time it takes; silent unless that is a terminal."""
        if not sys.stderr.isatty():
            yield lambda _: None
            return
        from rich.console import Console
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task(_visible(title), total=None)
            yield lambda step: progress.update(task, description=_visible(f"{title}: {step}"))

    @staticmethod
    def _print(document: Mapping[str, Any]) -> None:
        typer.echo(json.dumps(document, indent=2, allow_nan=False))


def _visible(text: str) -> str:
    """Return a text with what a terminal would obey made visible; the errors' module is not loaded for ``--help``."""
    from recoil_acquisition.errors import visible

    return visible(text)


def _refused_path(error: BaseException | None) -> RecoilDaqError | None:
    """Return the error of a path that the system refuses, such as one with a name too long; None for any other."""
    from recoil_acquisition.errors import ReadError

    if not isinstance(error, OSError) or not isinstance(error.filename, str | bytes):
        return None
    name = os.fsdecode(error.filename)
    shown = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}…"
    return ReadError(
        "this path cannot be used", path=Path(shown), found=error.strerror or str(error), remedy="check its name"
    )


def error_document(error: Exception) -> dict[str, Any]:
    """Return the document of an error, as every command with ``--json`` prints it."""
    return {"schema": "recoil-daq/error/1", "error": type(error).__name__, **_fields(error)}


_A_LOOK = 10
"""Lines that are seen at once."""


def _lines(error: Exception) -> list[str]:
    """One line for one fault; a rig with several gives each its own."""
    from recoil_acquisition.errors import RigError

    if isinstance(error, RigError) and len(error.faults) > 1:
        lines = [f"error: {error.path}: {error.heading}", *(f"  {fault}" for fault in error.faults)]
        # of a long list the first line is out of sight
        return [*lines, f"{error.path} is not sound yet: {error.heading}"] if len(lines) > _A_LOOK else lines
    return [f"error: {' '.join(str(error).split())}"]


def _fields(error: Exception) -> dict[str, Any]:
    from recoil_acquisition.errors import ReadError, RecoilDaqError, RigError
    from recoil_acquisition.remark import Severity

    fields: dict[str, Any] = {"message": str(error)}
    if isinstance(error, RecoilDaqError):
        fields["code"] = error.code.value
        for name in ("problem", "place", "expected", "found", "remedy"):
            fields[name] = getattr(error, name)
        fields["path"] = None if error.path is None else str(error.path)
    if isinstance(error, ReadError):
        fields["file_end"] = error.file_end.value
    if isinstance(error, RigError):
        fields["faults"] = [fault.to_json() for fault in error.faults]
        fields |= {"open": error.open, "stated": error.stated} if error.open else {}
        fields["findings"] = [fault.finding(Severity.FATAL) for fault in error.faults]
    return fields
