"""Masses of a live session's shots: each is identified soon after its verdict, by a process that stays warm.

The range itself loads nothing of the identification. A worker that ends is started anew and does its shot once more; a
shot without a mass stays what it is, and `recoil-daq identify` takes its file later.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from concurrent.futures import BrokenExecutor, Future
from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveShot
from recoil_daq.workers import WarmWorker
from recoil_rigs.specification import mass_decimals

_MASS = "recoil_daq.reports.shot_mass:shot_mass"
_WARM = "recoil_daq.reports.shot_mass:warm"


class MassWork:
    """Identifies the shots of one session, one after the other.

    Parameters
    ----------
    out
        Folder of the shot files; the reports stand in ``reports`` in it.
    """

    def __init__(self, out: Path, display: Display) -> None:
        self._out, self._display = out, display
        self._worker = WarmWorker()
        self._asked: dict[str, tuple[LiveShot, Future[Any]]] = {}
        self._repeated: set[str] = set()

    @property
    def pending(self) -> bool:
        """Whether a mass is still to come."""
        return bool(self._asked)

    @property
    def awaited(self) -> frozenset[str]:
        """Names of the shots whose mass is still to come."""
        return frozenset(self._asked)

    def prewarm(self) -> None:
        """Let the worker load what it needs, and identify the last shot that is there, into nowhere."""
        there = sorted(self._out.glob("*.h5"), key=lambda path: path.stat().st_mtime)
        with suppress(RecoilDaqError, OSError):  # the first shot says what is wrong
            self._worker.submit(_WARM, there[-1] if there else None)

    def begin(self, shot: LiveShot) -> None:
        """Identify a shot that has its shot file; the mass of one that was made of less counts no longer."""
        if shot.document is None:
            return
        shot.mass = None
        try:
            future = self._worker.submit(_MASS, (Path(shot.document["file"]), self._out / "reports"))
        except (RecoilDaqError, OSError) as error:
            self._display.notice(f"shot {shot.name} has no mass: {error}")
        else:
            self._asked[shot.name] = shot, future

    def look(self) -> None:
        """Take the masses that were found, and say each in one line."""
        for name, (shot, future) in tuple(self._asked.items()):
            if not future.done():
                continue
            del self._asked[name]
            try:
                shot.mass = future.result()
            except BrokenExecutor:
                self._again(shot)
            except RecoilDaqError as error:
                self._display.notice(f"shot {name} has no mass: {error}")
            else:
                self._display.notice(mass_line(name, future.result(), preview=shot.previews))

    def _again(self, shot: LiveShot) -> None:
        if shot.name in self._repeated:
            file = "" if shot.document is None else shot.document["file"]
            text = f"shot {shot.name} has no mass: its worker ended twice; `recoil-daq identify {file}` by hand"
            self._display.notice(text)
            return
        self._repeated.add(shot.name)
        self.begin(shot)

    def close(self) -> None:
        """End the worker, whatever it is at."""
        self._worker.close(at_once=True)
        for name in self._asked:
            self._display.notice(f"shot {name} has no mass yet: `recoil-daq identify` takes its shot file")
        self._asked.clear()


def mass_line(shot: str, mass: Mapping[str, Any], *, preview: Collection[str] = ()) -> str:
    """Write a mass in one line, with its interval, its deviation and the first reason against it.

    Parameters
    ----------
    preview
        Sources whose own files are to come: it is provisional.
    """
    low, high = mass["U95"]
    normalised = "" if mass["E_n"] is None else f", E_n {mass['E_n']:.1f}"
    places = mass_decimals(mass["u"], 1)
    text = f"{shot} mass {mass['value']:.{places}f} kg, 95 % {low:.{places}f} to {high:.{places}f}{normalised}"
    if preview:
        text += f", provisional: preview of {', '.join(sorted(preview))}"
    return f"{text}, VALID" if mass["valid"] else f"{text}, NOT VALID: {mass['reason']}"
