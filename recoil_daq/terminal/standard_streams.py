"""The streams of a command: what is done is done, also where nobody can be told of it."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from typing import Any, TextIO, cast

UNPRINTED = 4
"""Exit code of a command that is done, whose output could not be printed."""
_PIPE_CLOSED = frozenset({errno.EPIPE, errno.ESHUTDOWN} | ({errno.EINVAL} if os.name == "nt" else set()))
"""Error numbers where nobody reads any more; Windows has another one."""


class _Kept(io.RawIOBase):
    """A stream that takes what its file does not take, and remembers why; nothing that is written to it fails.

    Attributes
    ----------
    fault
        Words on why something could not be written; empty if everything was. A pipe that its reader closed is no fault.
    """

    def __init__(self, raw: io.RawIOBase | None, said: str) -> None:
        self._raw, self._said, self.fault = raw, said, "" if raw is not None else "it is closed"

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return self._raw is not None and self._raw.isatty()

    def fileno(self) -> int:
        if self._raw is None:
            raise io.UnsupportedOperation("fileno")
        return self._raw.fileno()

    def write(self, content: Any) -> int:
        if self._raw is not None:
            try:
                return self._raw.write(content) or 0
            except OSError as error:
                self._raw = None
                if error.errno not in _PIPE_CLOSED:
                    self.fault = error.strerror or str(error)
                    self.say_why("the work goes on")
        return len(content)

    def say_why(self, outcome: str) -> None:
        """Say on stderr, once, why something could not be written: at once, for a session goes on for hours."""
        if self._said:
            with contextlib.suppress(OSError, ValueError):
                print(f"{self._said}: {self.fault}; {outcome}", file=sys.stderr)
        self._said = ""


class StandardStreams:
    """Stdin, stdout and stderr of a command, each there, and neither of the latter ever failing."""

    def __init__(self) -> None:
        _fill_closed()
        self._out: _Kept | None = None
        if sys.stderr is None or isinstance(sys.stderr, io.TextIOWrapper):
            sys.stderr, _ = _kept(sys.stderr, "")
        if sys.stdout is None or isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout, self._out = _kept(sys.stdout, "the output cannot be printed")

    def exit_code(self, code: int) -> int:
        """Return the exit code of a command that ended with one, when all that it printed is out."""
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
        if self._out is None or not self._out.fault or code not in (0, 1):
            return code
        self._out.say_why("what was asked for is done")
        return UNPRINTED


def _fill_closed() -> None:
    """Open what is closed of the first three files: the next file that is opened would be taken for it."""
    while True:
        descriptor = os.open(os.devnull, os.O_RDWR)
        if descriptor > 2:
            os.close(descriptor)
            break
        # what this program starts has them, too
        os.set_inheritable(descriptor, True)
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115, PTH123 - open until the program ends


def _kept(stream: TextIO | None, said: str) -> tuple[TextIO, _Kept]:
    """Return a stream that never fails in the place of another, which may be missing, and what it writes to."""
    if stream is None:
        kept = _Kept(None, said)
        return io.TextIOWrapper(
            io.BufferedWriter(cast("io.RawIOBase", kept)), encoding="utf-8", errors="backslashreplace"
        ), kept
    stream.flush()
    raw: Any = stream.buffer
    kept = _Kept(getattr(raw, "raw", raw), said)
    return _text(kept, stream.encoding, line_buffering=getattr(stream, "line_buffering", False) or not said), kept


def _text(kept: _Kept, encoding: str, *, line_buffering: bool) -> TextIO:
    buffer = io.BufferedWriter(cast("io.RawIOBase", kept))
    # a pipe on Windows takes code page 1252 only: what it has no sign for is spelled, as stderr does
    return io.TextIOWrapper(buffer, encoding=encoding, errors="backslashreplace", line_buffering=line_buffering)
