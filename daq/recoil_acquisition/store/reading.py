"""The process that reads HDF5 files of others: a request a line in, an answer in pieces out."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from recoil_acquisition.processes.child_process import put, take
from recoil_acquisition.processes.reader_process import ENDED, PIECE
from recoil_acquisition.readers.hdf5.rehearsal import REHEARSAL, rehearse
from recoil_acquisition.store.file_tree import write_tree

_PIECE_BYTES = 1 << 20


def main() -> None:
    """Serve until nobody asks any more."""
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    while True:
        try:
            request = json.loads(take(requests)[1])
        except EOFError:
            return
        if sys.platform == "win32":
            _read(request, lambda piece: put(answers, PIECE, piece))
            code = 0
        else:
            code = _in_a_copy(request, answers)
        put(answers, ENDED, str(code).encode())
        answers.flush()


def _read(request: dict[str, Any], write: Callable[[bytes], object]) -> None:
    """Do what is asked for: rehearse an instrument's file, or write a shot file's tree."""
    if request["what"] == REHEARSAL:
        rehearse(Path(request["path"]))
    else:
        write_tree(Path(request["path"]), request["what"], write)


if sys.platform != "win32":
    import resource

    def _in_a_copy(request: dict[str, Any], answers: BinaryIO) -> int:
        """Read in a copy of this process, hand on what it says, and return how it ended."""
        source, target = os.pipe()
        pid = os.fork()
        if pid == 0:
            try:
                os.close(source)
                _limit(request)
                with open(target, "wb", buffering=1 << 16) as stream:  # noqa: PTH123 - a pipe has no path
                    _read(request, stream.write)
            except BaseException:  # whatever it is, this copy must not go on as if it were the other
                os._exit(1)
            os._exit(0)
        os.close(target)
        while piece := os.read(source, _PIECE_BYTES):
            put(answers, PIECE, piece)
        os.close(source)
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])

    def _limit(request: dict[str, Any]) -> None:
        """Limit processor time, and memory where the system says how much is in use."""
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (request["cpu_s"], request["cpu_s"] + 1))
        try:
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        except OSError:
            return
        limit = pages * resource.getpagesize() + request["most"]
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard == resource.RLIM_INFINITY or limit < hard:
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


if __name__ == "__main__":
    main()
