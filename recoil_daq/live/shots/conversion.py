"""Conversions of live shots: by the process that stays warm, or, where that ends again and again, by the command."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, WorkerError
from recoil_acquisition.files.new_file import remove_partials
from recoil_acquisition.processes.child_process import ChildProcess
from recoil_daq.recording.conversion import ConversionTask
from recoil_daq.warm_worker import WarmWork, WarmWorker
from recoil_rigs.rig import Rig, rig_text

_CONVERT = "recoil_daq.recording.conversion:convert"


def rig_changed(path: Path, text: str) -> bool:
    """Return whether a rig file is not there any more as it was."""
    try:
        return rig_text(path) != text
    except ReadError:
        return True


class Conversion:
    """One conversion of a shot beside the acquisition.

    A process that ends at it leaves nothing that counts: the shot file appears whole or not at all, and another process
    converts the shot again.

    Parameters
    ----------
    rig
        Rig that the shot was acquired with, whatever became of its file since.
    replaces
        Line on why a shot file that is there is made anew; empty if none may be.
    without
        Sources that are left out of it.
    worker
        Worker that converts; the command does where there is none, or where it ended twice at this shot.
    """

    def __init__(
        self,
        rig: Rig,
        files: Sequence[Path],
        shot: str,
        out: Path,
        *,
        replaces: str = "",
        without: Sequence[str] = (),
        worker: WarmWorker | None = None,
    ) -> None:
        self._task = ConversionTask.of(rig, files, shot, out, replaces, without)
        self._was_there = self._target.exists()
        self._worker = worker
        self._asked: WarmWork | None = None
        self._cold: _Command | None = None
        self._refused: tuple[int, dict[str, Any]] | None = None
        if worker is None:
            self._begin_cold(self._task)
        else:
            self._asked = worker.ask(_CONVERT, self._task, again=self._again)

    @property
    def _target(self) -> Path:
        return self._task.out / f"{self._task.shot}.h5"

    def result(self, timeout_s: float | None = 0.0) -> tuple[int, dict[str, Any]] | None:
        """Return its exit code and document, or None if it is not done.

        Parameters
        ----------
        timeout_s
            Time to wait for the end of the command, s; None to wait until it ends. For a worker nobody waits.
        """
        if self._refused is not None:
            return self._refused
        answer = self._of_command(timeout_s) if self._worker is None or self._cold is not None else self._of_worker()
        if answer is None:
            return None
        code, document = answer
        if code in (0, 1) and (document.get("shot") != self._task.shot or type(document.get("usable")) is not bool):
            return 3, {"message": f"the conversion was of another shot: {document.get('shot')!r}"}
        return answer

    def _of_command(self, timeout_s: float | None) -> tuple[int, dict[str, Any]] | None:
        return None if self._cold is None else self._cold.result(timeout_s)

    def _of_worker(self) -> tuple[int, dict[str, Any]] | None:
        """Take what the worker did; where it ended twice, the command begins."""
        if self._worker is None or self._asked is None:
            return None
        self._worker.look()
        if not self._asked.done:
            return None
        try:
            code, document = self._asked.result()
        except WorkerError:
            self._begin_cold(self._again(self._task))
            return None
        except Exception as error:  # whatever it is, it ends this shot and not the session
            return 3, {"message": f"cannot be converted: {type(error).__name__}: {error}"}
        return code, document

    def _begin_cold(self, task: ConversionTask) -> None:
        """Begin the command, which reads the rig file; one that was changed since is not that of the shot."""
        if rig_changed(task.rig, task.rig_text):
            message = f"{task.rig} was changed since it was armed, and the process that converts ended at it"
            self._refused = 3, {"message": message}
        else:
            self._cold = _Command(task)

    def _again(self, task: ConversionTask) -> ConversionTask:
        """Return the conversion that follows one whose process ended: it may have ended after all was written."""
        remove_partials(self._target)
        return task if self._was_there else replace(task, overwrite=True)

    def end(self) -> None:
        """End it at once, and take away what it was writing."""
        if self._cold is not None:
            self._cold.end()
        elif self._worker is not None and self._asked is not None:
            self._worker.give_up(self._asked)
        remove_partials(self._target)


class _Command:
    """One run of ``recoil-daq ingest`` in a process of its own."""

    def __init__(self, task: ConversionTask) -> None:
        # behind `--` nothing is an option, whatever a file is called
        arguments = [
            "ingest", "--shot", task.shot, "--out", str(task.out), "--json",
            *(["--replaces", task.replaces] if task.replaces else []), *(["--overwrite"] if task.overwrite else []),
            *(part for name in task.without for part in ("--without", name)),
            "--", str(task.rig), *map(str, task.files),
        ]  # fmt: skip
        # apart: Ctrl-C ends the acquisition in order, and lets the last shot be converted
        self._process = ChildProcess("recoil_daq.cli", *arguments, below_normal=True)

    def result(self, timeout_s: float | None) -> tuple[int, dict[str, Any]] | None:
        """Return its exit code and document, or None if it is not done in time."""
        ended = self._process.ended(timeout_s)
        if ended is None:
            return None
        try:
            document = json.loads(ended.out)
        except ValueError:
            document = {"message": ended.said or f"the conversion ended with code {ended.code}"}
        return ended.code, document if isinstance(document, dict) else {"message": str(document)}

    def end(self) -> None:
        """End it at once."""
        self._process.end()
