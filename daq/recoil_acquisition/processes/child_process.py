"""Processes of this program's own: started by the modules that are installed, whatever the user's folder holds.

Each stands in a group of its own, which Ctrl-C does not reach, and is ended with what it started. `isolated` runs one
to its end; one that stays, or is looked at beside other work, is a `ChildProcess`, and says why.
"""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import subprocess
import sys
import threading
from dataclasses import dataclass
from typing import IO, Any, Self, cast

from recoil_acquisition.numerics.linear_algebra import LIMITS

BELOW_NORMAL = 5
"""Nice value of what gives way to an acquisition, and is done before the next shot where other programs are busy too.
What works on live shots shares one queue, so that nothing in it may be lower: a verdict would wait behind a mass that
no other program lets go on."""
_HEAD = struct.Struct("<cq")
"""Head of a message: its kind, and how many bytes follow."""


@dataclass(frozen=True)
class Ended:
    """How a child process ended.

    Attributes
    ----------
    code
        Exit code; the negative number of the signal that ended it.
    out
        Bytes that it printed.
    said
        Last line of its errors; empty if there is none.
    """

    code: int
    out: bytes
    said: str

    @property
    def why(self) -> str:
        """The one line on it."""
        return self.said or f"code {self.code}"


def isolated(module: str, *arguments: str, limit_s: float, given: bytes = b"") -> Ended:
    """Run one of our modules in a process of its own and wait for its end; whatever ends the wait ends the process.

    Parameters
    ----------
    limit_s
        Time that it may take, s.
    given
        Bytes that it reads.

    Raises
    ------
    TimeoutError
        If it takes longer.
    OSError
        If it cannot be started.
    """
    with ChildProcess(module, *arguments) as child:
        ended = child.ended(limit_s, given)
    if ended is None:
        raise TimeoutError(f"not done after {limit_s:.0f} s")
    return ended


class ChildProcess:
    """One of our modules in a process of its own, with one thread for its linear algebra.

    It runs to its end, or serves: it takes requests, and gives answers, until nobody asks any more.

    Parameters
    ----------
    errors
        File for its errors, which goes with the process: one that serves needs it, for nobody reads a pipe meanwhile.
    below_normal
        Whether it gives way to other programs.

    Raises
    ------
    OSError
        If it cannot be started.
    """

    def __init__(
        self,
        module: str,
        *arguments: str,
        errors: IO[bytes] | None = None,
        below_normal: bool = False,
    ) -> None:
        apart: dict[str, Any] = {"process_group": 0}
        if sys.platform == "win32":
            lower = subprocess.BELOW_NORMAL_PRIORITY_CLASS if below_normal else 0
            apart = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | lower}
        self._process = subprocess.Popen(  # noqa: S603 - this program itself, without a shell
            # with -P Python does not look for modules in the working folder: a user's file that happens to be named
            # `numpy.py` or `daq.py` is not run; PYTHONPATH, which is the user's will, holds
            [sys.executable, "-P", "-m", module, *arguments],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE if errors is None else errors,
            env=os.environ | dict.fromkeys(LIMITS, "1"), **apart,
        )  # fmt: skip
        if below_normal and sys.platform != "win32":
            os.setpriority(os.PRIO_PROCESS, self._process.pid, BELOW_NORMAL)
        self._errors = errors
        self._reading: threading.Event | None = None
        self._ended: Ended | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def ended(self, timeout_s: float | None, given: bytes = b"") -> Ended | None:
        """Wait for its end, reading along; None if it is not there in time.

        Parameters
        ----------
        timeout_s
            Time to wait at most, s; None to wait for good.
        given
            Bytes that it reads, with the first look.
        """
        if self._reading is None:
            self._reading = threading.Event()
            # by a thread: what nobody reads would hold it up, and a look in passing reads nothing
            threading.Thread(target=self._read_to_the_end, args=(given, self._reading), daemon=True).start()
        self._reading.wait(timeout_s)
        return self._ended

    def _read_to_the_end(self, given: bytes, done: threading.Event) -> None:
        try:
            out, errors = self._process.communicate(given)
            if self._errors is not None:
                self._errors.seek(0)
                errors = self._errors.read()
            lines = (errors or b"").decode(errors="replace").strip().splitlines()
            self._ended = Ended(self._process.returncode, out, lines[-1] if lines else "")
        finally:
            done.set()

    def ask(self, kind: bytes, content: bytes = b"") -> None:
        """Send a request.

        Raises
        ------
        OSError
            If it has ended.
        """
        requests = cast("IO[bytes]", self._process.stdin)
        put(requests, kind, content)
        requests.flush()

    def answer(self, most: int = sys.maxsize) -> tuple[bytes, bytes]:
        """Wait for the next answer, and return it as `take` does."""
        return take(cast("IO[bytes]", self._process.stdout), most)

    def some(self, most: int) -> bytes:
        """Wait for bytes that it prints and return them, as many as are there; none where it has ended."""
        return cast("IO[bytes]", self._process.stdout).read1(most)  # type: ignore[attr-defined,no-any-return]

    def kill(self) -> None:
        """End it at once, and what it started, unless it has ended."""
        if sys.platform == "win32":
            self._process.kill()
        elif self.runs:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)

    def end(self) -> None:
        """End it at once, unless it has ended, and let nothing of it be left."""
        self.kill()
        if self._reading is not None:
            self._reading.wait()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr, self._errors):
            if stream is not None:
                with contextlib.suppress(OSError):  # what it was asked and did not read
                    stream.close()


def put(stream: IO[bytes], kind: bytes, content: bytes = b"") -> None:
    """Write a message; the kind is one byte."""
    stream.write(_HEAD.pack(kind, len(content)))
    stream.write(content)


def take(stream: IO[bytes], most: int = sys.maxsize) -> tuple[bytes, bytes]:
    """Read the kind and the content of a message.

    Raises
    ------
    EOFError
        If there is none, it is cut short, or has more bytes than so many.
    """
    head = stream.read(_HEAD.size)
    if len(head) == _HEAD.size:
        kind, count = _HEAD.unpack(head)
        if 0 <= count <= most and len(content := stream.read(count)) == count:
            return kind, content
    raise EOFError
