"""The cut of a shot in a process of its own.

A shot's records are read, checked and copied one by one. Within the acquiring process that would take the interpreter
from the threads that read the devices.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from recoil_acquisition.capture.cut import write_shot
from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.errors import RecoilDaqError, StoreError
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.processes.child_process import isolated
from recoil_acquisition.shot.acquisition import Acquisition

_WITHIN_S = 600.0


def cut_apart(log: Path, path: Path, acquisition: Acquisition, start_ns: int, stop_ns: int) -> Acquisition:
    """Write a capture as `recoil_acquisition.capture.cut.write_shot` does, in another process, and wait for it.

    Parameters
    ----------
    path
        File to be made. If the calling process dies, none is made.

    Raises
    ------
    StoreError
        If it cannot be written; the log still has it.
    """
    try:
        done = isolated(
            __name__, str(log), str(path), str(start_ns), str(stop_ns), str(os.getpid()),
            limit_s=_WITHIN_S, given=json.dumps(acquisition.to_json()).encode(),
        )  # fmt: skip
    except OSError as error:
        raise StoreError(f"the cut of the shot did not end: {error}", path=path) from error
    try:
        answer = json.loads(done.out)
        if "error" not in answer:
            return Acquisition.from_json(answer)
    except ValueError as error:
        raise StoreError(f"the cut of the shot failed: {done.why}", path=path) from error
    raise StoreError(str(answer["error"]))  # which names the file


def main(arguments: list[str]) -> None:
    """Write the capture, and print how its shot was acquired as JSON."""
    folder, path = Path(arguments[0]), Path(arguments[1])
    start_ns, stop_ns, parent = map(int, arguments[2:])
    try:
        acquisition = Acquisition.from_json(json.loads(sys.stdin.buffer.read()))
        log = open_log(folder)
        session = live_record_of(log.session, folder)
        if os.name != "nt" and os.getppid() != parent:
            raise StoreError("the acquisition has ended meanwhile", path=path)
        whole = write_shot(log, session, path, acquisition, start_ns, stop_ns)
    except RecoilDaqError as error:
        print(json.dumps({"error": str(error)}))
        return
    print(json.dumps(whole.to_json()))


if __name__ == "__main__":
    main(sys.argv[1:])
