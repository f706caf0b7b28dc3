"""The cut of a shot in a process of its own.

To find a shot's records, whole segments of the journal are read record by record. Within the acquiring process that
would take the interpreter from the threads that read the devices.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.cut import Cut, write_captures
from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.child_process import apart, own_command
from recoil_acquisition.devices.device import DeviceEvent
from recoil_acquisition.errors import RecoilDaqError, StoreError
from recoil_acquisition.journal.folder import read_journal

_WITHIN_S = 600.0


def cut_apart(journal: Path, folder: Path, prefix: str, start_ns: int, stop_ns: int) -> dict[str, Cut]:
    """Write captures as `recoil_acquisition.capture.cut.write_captures` does, in another process, and wait for it.

    Parameters
    ----------
    journal : Path
    folder : Path
        To be made; what an earlier attempt left of it is removed. If the calling process dies, it is not made.
    prefix : str
    start_ns, stop_ns : int

    Returns
    -------
    dict of str to Cut

    Raises
    ------
    StoreError
        If they cannot be written; the journal still has it all.
    """
    shutil.rmtree(folder, ignore_errors=True)
    arguments = [str(journal), str(folder), prefix, str(start_ns), str(stop_ns), str(os.getpid())]
    try:
        done = subprocess.run(  # noqa: S603 - this program itself, without a shell
            own_command(__name__, *arguments),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_WITHIN_S,
            check=False,
            **apart(),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise StoreError(f"the cut of the shot did not end: {error}", path=folder) from error
    try:
        answer = json.loads(done.stdout)
    except ValueError as error:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise StoreError(
            f"the cut of the shot failed: {said[-1] if said else f'code {done.returncode}'}", path=folder
        ) from error
    if "error" in answer:
        raise StoreError(str(answer["error"]), path=folder, remedy="the journal still has it")
    return {name: _cut_of(value, folder) for name, value in answer.items()}


def _cut_of(value: dict[str, Any], folder: Path) -> Cut:
    return Cut(
        # the folder is ours, whatever the child says
        file=None if value["file"] is None else folder / Path(value["file"]).name,
        blocks=value["blocks"],
        bytes=value["bytes"],
        late_s=value["late_s"],
        events=[(host_ns, DeviceEvent(name, detail)) for host_ns, name, detail in value["events"]],
    )


def main(arguments: list[str]) -> None:
    """Write the captures, and print what each source has as JSON."""
    journal_folder, folder, prefix = Path(arguments[0]), Path(arguments[1]), arguments[2]
    start_ns, stop_ns, parent = map(int, arguments[3:])

    def still_wanted(into: Path, cuts: Mapping[str, Cut]) -> None:  # noqa: ARG001 - what is asked before the naming
        if os.name != "nt" and os.getppid() != parent:
            raise StoreError("the acquisition has ended meanwhile", path=folder)

    try:
        journal = read_journal(journal_folder, start_ns, stop_ns)
        cuts = write_captures(journal, live_record_of(journal), folder, prefix, start_ns, stop_ns, still_wanted)
    except RecoilDaqError as error:
        print(json.dumps({"error": str(error)}))
        return
    print(
        json.dumps(
            {
                name: {
                    "file": None if cut.file is None else str(cut.file),
                    "blocks": cut.blocks,
                    "bytes": cut.bytes,
                    "late_s": cut.late_s,
                    "events": [(host_ns, event.name, event.detail) for host_ns, event in cut.events],
                }
                for name, cut in cuts.items()
            }
        )
    )


if __name__ == "__main__":
    main(sys.argv[1:])
