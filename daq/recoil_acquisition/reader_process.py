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
import struct
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, cast

from recoil_acquisition.child_process import apart, own_command
from recoil_acquisition.errors import StoreError

CPU_S, CPU_BYTES_PER_S = 20, 500_000
"""Processor time for one file: so much, and from 10 MB on a second for so many bytes; measured is a hundredth of it."""

WALL_FACTOR = 6
"""Factor from the reader's processor time to the time on the clock: the machine may have more to do."""

EXPANSION, SPARE_BYTES = 10, 64 << 20
"""Factor and bytes beside it that bound the content of a file, expanded, by its size."""

PIECE, ENDED = b"p", b"e"
HEAD = struct.Struct("<cq")
"""Head of each piece of an answer: its length, and at the end how the reading ended, as `os.waitstatus_to_exitcode`
says."""


def cpu_s(size: int) -> int:
    """Return how many seconds of processor time a file of a size may take."""
    return max(CPU_S, math.ceil(size / CPU_BYTES_PER_S))


def most_bytes(size: int) -> int:
    """Return how many bytes the content of a file of a size may have, and reading it may take."""
    return EXPANSION * size + SPARE_BYTES


class ReaderProcess:
    """The process that reads, started when it is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._of_another: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None
        self._pid = 0
        self._lock = threading.Lock()

    def start(self) -> subprocess.Popen[bytes]:
        """Start it, unless it runs: it loads its libraries while this process does other work."""
        if self._pid != os.getpid():
            # this process is a copy of another, whose reading process it must leave alone
            self._of_another, self._process = self._process, None
        if self._process is not None and self._process.poll() is None:
            return self._process
        self.stop()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed when it is stopped
        self._process = subprocess.Popen(  # noqa: S603 - this program itself, without a shell
            own_command("recoil_acquisition.store.reading"),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, **apart(),
        )  # fmt: skip
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
            requests, answers = cast("IO[bytes]", process.stdin), cast("IO[bytes]", process.stdout)
            timer = threading.Timer(WALL_FACTOR * limit_s, _kill, (process,))
            timer.daemon = True
            timer.start()
            answer = bytearray()
            try:
                with contextlib.suppress(BrokenPipeError):
                    request = {"path": str(path.absolute()), "what": what, "cpu_s": limit_s, "most": most}
                    requests.write(json.dumps(request).encode() + b"\n")
                    requests.flush()
                while len(head := answers.read(HEAD.size)) == HEAD.size:
                    kind, number = HEAD.unpack(head)
                    if kind == ENDED:
                        return answer, _fault(number, limit_s)
                    if number < 0 or len(answer) + number > most:
                        break
                    answer += answers.read(number)
                code = self._ended(process)
                if timer.finished.is_set():
                    return answer, f"the HDF5 library was not done after {WALL_FACTOR * limit_s} s"
            except BaseException:
                self.stop()  # in the midst of an answer
                raise
            finally:
                timer.cancel()
            return answer, _fault(code, limit_s)

    def _ended(self, process: subprocess.Popen[bytes]) -> int:
        """Return how what does not answer any more ended; StoreError if it never could begin."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(1.0)
        code, said = process.poll(), []
        if self._said is not None:
            self._said.seek(0)
            said = self._said.read().decode(errors="replace").strip().splitlines()
        self.stop()
        if code == 1 and said:
            raise StoreError(f"the process that reads shot files failed: {said[-1]}", remedy="install it again")
        return -signal.SIGTERM if code is None else code

    def stop(self) -> None:
        """End it."""
        process, self._process = self._process, None
        if process is not None and self._pid == os.getpid():
            _kill(process)
            process.wait()
            for stream in (process.stdin, process.stdout, self._said):
                if stream is not None:
                    with contextlib.suppress(OSError):
                        stream.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End it and the copy that it made of itself, which is in its group."""
    if sys.platform == "win32":
        process.kill()
    elif process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _fault(code: int, limit_s: int) -> str:
    if code == 0:
        return ""
    if sys.platform != "win32" and code == -signal.SIGXCPU:
        return f"the HDF5 library was not done after {limit_s} s"
    return "the HDF5 library ended while reading it"


READER = ReaderProcess()
"""That of this process."""

atexit.register(READER.stop)
