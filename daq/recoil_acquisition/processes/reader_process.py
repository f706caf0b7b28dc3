"""A process that reads shot files for this one, so that a damaged file ends that one at most.

It is started when the first file is read, serves one file after another, and goes with this process. Where the system
can, it makes a copy of itself for each file, with limits of memory and processor time; elsewhere it is started anew
after a file that ended it.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import os
import signal
import sys
import tempfile
import threading
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.processes.child_process import ChildProcess

CPU_S, CPU_BYTES_PER_S = 20, 500_000
"""Processor time for one file: so much, and from 10 MB on a second for so many bytes; measured is a hundredth of it."""

WALL_FACTOR = 6
"""Factor from the reader's processor time to the time on the clock: the machine may have more to do."""

EXPANSION, SPARE_BYTES = 10, 64 << 20
"""Factor and bytes beside it that bound the content of a file, expanded, by its size."""

READ, PIECE, ENDED = b"r", b"p", b"e"
"""Kinds of messages: a request; a piece of its answer; at the end how the reading ended, as `os.waitstatus_to_exitcode`
says."""

_END_BYTES = 32


def cpu_s(size: int) -> int:
    """Return how many seconds of processor time a file of a size may take."""
    return max(CPU_S, math.ceil(size / CPU_BYTES_PER_S))


def most_bytes(size: int) -> int:
    """Return how many bytes the content of a file of a size may have, and reading it may take."""
    return EXPANSION * size + SPARE_BYTES


class ReaderProcess:
    """The process that reads, started when it is needed; it stays, because its libraries take longer than a file."""

    def __init__(self) -> None:
        self._process: ChildProcess | None = None
        self._of_another: ChildProcess | None = None
        self._pid = 0
        self._lock = threading.Lock()

    def start(self) -> ChildProcess:
        """Start it, unless it runs: it loads its libraries while this process does other work."""
        if self._pid != os.getpid():
            # this process is a copy of another, whose reading process it must leave alone
            self._of_another, self._process = self._process, None
        if self._process is not None and self._process.runs:
            return self._process
        self.stop()
        self._process = ChildProcess("recoil_acquisition.store.reading", errors=tempfile.TemporaryFile())  # noqa: SIM115
        self._pid = os.getpid()
        return self._process

    def ask(self, path: Path, what: str, size: int) -> tuple[bytearray, str]:
        """Let it read a file.

        Parameters
        ----------
        what
            Part of the tree, as `recoil_acquisition.store.file_tree.write_tree` takes it.
        size
            Size of the file.

        Returns
        -------
        answer : bytearray
        fault : str
            Reason why the reading did not come to its end; empty if it did.
        """
        limit_s, most = cpu_s(size), most_bytes(size)
        with self._lock:
            process = self.start()
            timer = threading.Timer(WALL_FACTOR * limit_s, process.kill)
            timer.daemon = True
            timer.start()
            answer = bytearray()
            try:
                request = {"path": str(path.absolute()), "what": what, "cpu_s": limit_s, "most": most}
                with contextlib.suppress(BrokenPipeError):
                    process.ask(READ, json.dumps(request).encode())
                with contextlib.suppress(EOFError):
                    while True:
                        kind, content = process.answer(most + _END_BYTES - len(answer))
                        if kind == ENDED:
                            return answer, _fault(int(content), limit_s)
                        answer += content
                code = self._ended(process)
                if timer.finished.is_set():
                    return answer, f"the HDF5 library was not done after {WALL_FACTOR * limit_s} s"
            except BaseException:
                self.stop()  # in the midst of an answer
                raise
            finally:
                timer.cancel()
            return answer, _fault(code, limit_s)

    def _ended(self, process: ChildProcess) -> int:
        """Return how what does not answer any more ended; StoreError if it never could begin."""
        ended = process.ended(1.0)
        self.stop()
        if ended is None:
            return -signal.SIGTERM
        if ended.code == 1 and ended.said:
            raise StoreError(f"the process that reads shot files failed: {ended.said}", remedy="install it again")
        return ended.code

    def stop(self) -> None:
        """End it."""
        process, self._process = self._process, None
        if process is not None and self._pid == os.getpid():
            process.end()


def _fault(code: int, limit_s: int) -> str:
    if code == 0:
        return ""
    if sys.platform != "win32" and code == -signal.SIGXCPU:
        return f"the HDF5 library was not done after {limit_s} s"
    return "the HDF5 library ended while reading it"


READER = ReaderProcess()
"""That of this process."""

atexit.register(READER.stop)
