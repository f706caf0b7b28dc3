"""Shots of before this session that are in its folder: they stand in the day's table as they were found to be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.preview import preview_of, previewed_sources
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_daq.warm_worker import WarmWork

EARLIER = "recoil_daq.reports.shot_mass:earlier_shots"
"""Work of the process that stays warm: what reads shot files and reports is not loaded here."""


class EarlierShots:
    """Takes the shots of before when the worker has read them; none where nobody was asked to, or it failed.

    Attributes
    ----------
    shots
        Shots, in the order of their names.
    """

    def __init__(self, asked: WarmWork | None) -> None:
        self._asked = asked
        self.shots: tuple[LiveShot, ...] = ()

    def look(self, own: Sequence[LiveShot]) -> tuple[LiveShot, ...]:
        """Return those that were read since the last look, without those that are the session's own."""
        if self._asked is None or not self._asked.done:
            return ()
        asked, self._asked = self._asked, None
        try:
            found = asked.result()
        except Exception:  # whatever it is, the shots are in their files
            return ()
        names = {shot.name for shot in own}
        self.shots = tuple(
            LiveShot(
                one["shot"], state=ShotState(VerdictLine.of(one["document"]).state.value), document=one["document"],
                mass=None if one["mass"] is None else {**one["mass"], "provisional": _provisional(one["document"])},
                excluded=one["excluded"],
                seen=True,
            )
            for one in found if one["shot"] not in names
        )  # fmt: skip
        return self.shots


def _provisional(document: Mapping[str, Any]) -> list[str]:
    """Say why the mass of a shot file is not the last word on its shot."""
    return list(preview_of(previewed_sources(document)))
