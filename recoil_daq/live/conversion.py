"""The conversion of a shot's files in a process of its own, so that it never keeps the reading threads waiting."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from recoil_acquisition.child_process import apart, own_command
from recoil_acquisition.new_file import remove_partials

_BELOW_NORMAL = 5
"""Nice value: it gives way to the acquisition, and is done before the next shot where other programs are busy too."""


class Conversion:
    """One run of ``recoil-daq ingest`` beside the acquisition.

    Parameters
    ----------
    replaces
        Why a shot file that is there is made anew; empty if none may be.
    """

    def __init__(self, rig: Path, files: Sequence[Path], shot: str, out: Path, *, replaces: str = "") -> None:
        self._shot, self._folder = shot, out
        # behind `--` nothing is an option, whatever a file is called
        arguments = [
            "ingest", "--shot", shot, "--out", str(out), "--json", *(["--replaces", replaces] if replaces else []),
            "--", str(rig), *map(str, files),
        ]  # fmt: skip
        # files, not pipes: nobody has to read along while it runs
        self._out: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed when it is read
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed when it is read
        # apart: Ctrl-C ends the acquisition in order, and lets the last shot be converted
        self._process = subprocess.Popen(  # noqa: S603 - this program itself, without a shell
            own_command("recoil_daq.cli", *arguments), stdin=subprocess.DEVNULL, stdout=self._out,
            stderr=self._errors, **apart(below_normal=True),
        )  # fmt: skip
        if os.name != "nt":
            os.setpriority(os.PRIO_PROCESS, self._process.pid, _BELOW_NORMAL)

    def result(self, timeout_s: float | None = 0.0) -> tuple[int, dict[str, Any]] | None:
        """Return its exit code and document, or None if it is not done in time.

        Parameters
        ----------
        timeout_s
            None to wait for its end.
        """
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None
        out, errors = self._text(self._out), self._text(self._errors)
        try:
            document = json.loads(out)
        except ValueError:
            said = errors.strip().splitlines()
            document = {"message": said[-1] if said else f"the conversion ended with code {code}"}
        answer = document if isinstance(document, dict) else {"message": str(document)}
        if code in (0, 1) and (answer.get("shot") != self._shot or type(answer.get("usable")) is not bool):
            return 3, {"message": f"the conversion was of another shot: {answer.get('shot')!r}"}
        return code, answer

    def end(self) -> None:
        """End it at once, and take away what it was writing."""
        self._process.kill()
        self._process.wait()
        remove_partials(self._folder / f"{self._shot}.h5")
        self._out.close()
        self._errors.close()

    @staticmethod
    def _text(stream: IO[bytes]) -> str:
        with stream:
            stream.seek(0)
            return stream.read().decode(errors="replace")
