"""Overviews of a session's shots for its page: each is written soon after its verdict, by the process that stays warm.

A shot without one is what it is: the page shows no curves of it, and `recoil-daq serve` writes what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveShot
from recoil_daq.warm_worker import WarmWork, WarmWorker

OVERVIEW, EARLIER = 1, 4
"""Ranks of the work: as a mass, which is asked for behind it; what concerns earlier shots gives way to all else."""
_OVERVIEW = "recoil_daq.recording.overview:overview_of"
_EARLIER = "recoil_daq.recording.overview:refresh"


class OverviewWork:
    """Has the overviews of shots written.

    Parameters
    ----------
    out
        Folder of the shot files; what is missing of its earlier shots is written when nothing else is to be done.
    shots
        Shots of the session, as it stands.
    """

    def __init__(self, worker: WarmWorker, out: Path, display: Display, shots: Sequence[LiveShot] = ()) -> None:
        self._worker, self._display, self._shots = worker, display, shots
        self._earlier: Sequence[LiveShot] = ()
        self._digests: dict[str, str] = {}
        self._asked: dict[LiveShot | None, WarmWork] = {}
        self._asked[None] = worker.ask(_EARLIER, out, rank=EARLIER, puts_off=True)

    def begin(self, shot: LiveShot) -> None:
        """Write the overview of a shot that has its shot file."""
        if shot.document is None:
            return
        before = self._asked.get(shot)
        if before is not None:
            self._worker.drop(before)
        shot.overview = ""
        self._asked[shot] = self._worker.ask(_OVERVIEW, Path(shot.document["file"]), rank=OVERVIEW)

    def look(self) -> None:
        """Take what was written."""
        self._worker.look()
        for shot, work in tuple(self._asked.items()):
            if not work.done:
                continue
            del self._asked[shot]
            try:
                found = work.result()
            except Exception as error:  # whatever it is, it ends these curves and not the session
                name = "earlier shots" if shot is None else f"shot {shot.name}"
                self._display.notice(f"the page has no curves of {name}: {type(error).__name__}: {error}")
                continue
            if shot is not None:
                shot.overview = found
                continue
            problems, self._digests = found
            for problem in problems:
                self._display.notice(problem)
            for one in (*self._shots, *self._earlier):
                if one.document is not None and one not in self._asked:
                    one.overview = self._digests.get(one.name, one.overview)

    def know(self, shots: Sequence[LiveShot]) -> None:
        """Take shots of before, which have their overviews already, or soon."""
        self._earlier = shots
        for one in shots:
            one.overview = self._digests.get(one.name, one.overview)

    @property
    def pending(self) -> bool:
        """Whether the overview of a shot of the session is still to come."""
        return any(shot is not None for shot in self._asked)

    def close(self) -> None:
        """Wait for nothing more."""
        for work in self._asked.values():
            self._worker.drop(work)
        self._asked.clear()
