"""Masses of a live session's shots: each is identified soon after its verdict, by the process that stays warm.

The range itself loads nothing of the identification. A worker that ends is started anew and does its shot once more; a
shot without a mass stays what it is, and `recoil-daq identify` takes its file later.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError, WorkerError, quoted
from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.preview import LARGE_DIFFERENCE, mass_by_file, preview_of
from recoil_daq.warm_worker import WarmWork, WarmWorker
from recoil_processing.shot.thinned import THINNED_ABOVE_HZ
from recoil_rigs.tables.specification import mass_decimals

MASS, WHOLE, CAMPAIGN = 1, 2, 3
"""Ranks of the work on a mass: a conversion, whose rank is lower, goes first, and the mass of the next shot goes before
the full rate of this one and what the shots say together."""
MOST_ATTEMPTS = 5
"""Times that a mass is asked for whose worker ended at it twice each time."""
_MASS = "recoil_daq.reports.shot_mass:shot_mass"
_CAMPAIGN = "recoil_daq.campaigns.running:running_campaign"


@dataclass(frozen=True, eq=False)
class _Asked:
    """Mass that was asked for, of a shot file as it was then."""

    shot: LiveShot
    file: Path
    thin: bool
    after: bool
    work: WarmWork
    attempt: int


class MassWork:
    """Identifies the shots of one session, one after the other.

    Parameters
    ----------
    out
        Folder of the shot files; the reports stand in ``reports`` in it.

    Attributes
    ----------
    campaign
        Mass of the shots together, as `recoil_daq.campaigns.running.running_campaign` returns it; None until two have
        one.
    """

    def __init__(self, worker: WarmWorker, out: Path, display: Display) -> None:
        self._worker, self._out, self._display = worker, out, display
        self._asked: dict[str, _Asked] = {}
        self._identified: dict[str, LiveShot] = {}
        self._by_preview: dict[str, Mapping[str, Any]] = {}
        self._combining: WarmWork | None = None
        self.campaign: Mapping[str, Any] | None = None

    @property
    def pending(self) -> bool:
        """Whether something is still to come."""
        return bool(self._asked) or self._combining is not None

    @property
    def awaited(self) -> frozenset[str]:
        """Names of the shots whose mass is still to come."""
        return frozenset(self._asked)

    def begin(self, shot: LiveShot) -> None:
        """Identify a shot that has its shot file; the mass of one that was made of less counts no longer."""
        if shot.document is None:
            return
        if shot.mass is not None and shot.previewed - shot.previews:
            self._by_preview.setdefault(shot.name, shot.mass)
        self.forget(shot)
        rates_hz = [one.get("rate_hz") or 0.0 for one in shot.document.get("channels", ())]
        self._ask(shot, thin=max(rates_hz, default=0.0) > THINNED_ABOVE_HZ)

    def know(self, shots: Sequence[LiveShot]) -> None:
        """Take shots of before, which have their mass: usable ones count in what the shots say together."""
        known = {shot.name: shot for shot in shots if shot.state is ShotState.USABLE and shot.mass is not None}
        self._identified = {**known, **self._identified}
        if len(self._identified) > 1:
            self.combine()

    def forget(self, shot: LiveShot) -> None:
        """Take back what is known of a shot's mass, and what is not begun."""
        shot.mass = None
        self._identified.pop(shot.name, None)
        before = self._asked.pop(shot.name, None)
        if before is not None:
            self._worker.drop(before.work)

    def _ask(self, shot: LiveShot, *, thin: bool, after: bool = False, attempt: int = 1) -> None:
        if shot.document is None:
            return
        path = Path(shot.document["file"])
        rank = WHOLE if after else MASS
        work = self._worker.ask(_MASS, (path, self._out / "reports", thin), rank=rank, puts_off=after)
        self._asked[shot.name] = _Asked(shot, path, thin, after, work, attempt)

    def look(self) -> None:
        """Take what was found, and say each in one line."""
        self._worker.look()
        for name, asked in tuple(self._asked.items()):
            if not asked.work.done:
                continue
            del self._asked[name]
            try:
                mass = asked.work.result()
            except WorkerError:
                if asked.attempt < MOST_ATTEMPTS:
                    self._ask(asked.shot, thin=asked.thin, after=asked.after, attempt=asked.attempt + 1)
                    continue
                by_hand = f"`recoil-daq identify {quoted(asked.file)}` by hand"
                self._display.notice(f"shot {name} has no mass: its worker ended again and again; {by_hand}")
            except Exception as error:  # whatever it is, it ends this mass and not the session
                known = isinstance(error, RecoilDaqError)
                if known and asked.shot.state is not ShotState.USABLE:
                    continue  # its verdict says why
                self._display.notice(
                    f"shot {name} has no mass: {error if known else f'{type(error).__name__}: {error}'}"
                )
            else:
                self._take(asked, mass)
        self._take_campaign()

    def _take(self, asked: _Asked, mass: dict[str, Any]) -> None:
        """Take a mass; one of thinned channels is followed by that of the full rate."""
        shot, before = asked.shot, asked.shot.mass
        shot.mass = {**mass, "provisional": list(provisional(mass, shot.previews))}
        if shot.state is not ShotState.USABLE:  # for comparison: its verdict was said
            shot.mass = {**shot.mass, "valid": False, "reason": mass["reason"] or shot.why}
            return
        if before is None or before["thinned_hz"] is None:
            self._display.notice(mass_line(shot.name, shot.mass))
        else:
            self._display.notice(whole_line(shot.name, before, shot.mass))
        by_preview = self._by_preview.get(shot.name)
        if by_preview is not None and (mass["thinned_hz"] is None or by_preview["thinned_hz"] is not None):
            del self._by_preview[shot.name]
            self._display.notice(f"shot {shot.name}: {mass_by_file(by_preview, shot.mass)}")
        if mass["thinned_hz"] is not None:
            self._ask(shot, thin=False, after=True)
            return
        self._identified[shot.name] = shot
        self.combine()

    def combine(self) -> None:
        """Ask what the shots say together; what was asked before is not waited for."""
        if not self._identified:
            return
        if self._combining is not None:
            self._worker.drop(self._combining)
        task = self._out, tuple(self._identified)
        self._combining = self._worker.ask(_CAMPAIGN, task, rank=CAMPAIGN, puts_off=True)

    def _take_campaign(self) -> None:
        work = self._combining
        if work is None or not work.done:
            return
        self._combining = None
        try:
            found = work.result()
        except Exception as error:  # whatever it is, each shot has its own mass
            known = isinstance(error, RecoilDaqError)
            why = str(error) if known else f"{type(error).__name__}: {error}"
            self._display.notice(f"the shots have no mass together: {why}")
            return
        if found is not None:
            self.campaign = found
            self._display.notice(campaign_line(found))

    def close(self) -> None:
        """Wait for nothing more, and say which masses are missing."""
        for name, asked in self._asked.items():
            self._worker.drop(asked.work)
            missing = "no mass yet" if asked.shot.mass is None else "a provisional mass only"
            self._display.notice(f"shot {name} has {missing}: `recoil-daq identify` takes its shot file")
        self._asked.clear()
        self._combining = None


def provisional(mass: Mapping[str, Any], preview: Collection[str] = ()) -> tuple[str, ...]:
    """Say for which reasons a mass is not the last word on its shot.

    Parameters
    ----------
    preview
        Sources whose own files are to come.
    """
    found = [] if mass["thinned_hz"] is None else [f"thinned to {mass['thinned_hz'] / 1e3:g} kHz"]
    return (*found, *preview_of(preview))


def mass_line(shot: str, mass: Mapping[str, Any]) -> str:
    """Write a mass in one line, with its interval, its deviation, the first reason against it, and what is provisional.

    Parameters
    ----------
    mass
        Mass of `LiveShot`.
    """
    low, high = mass["U95"]
    normalised = "" if mass["E_n"] is None else f", E_n {mass['E_n']:.1f}"
    places = mass_decimals(mass["u"], 1)
    text = f"{shot} mass {mass['value']:.{places}f} kg, 95 % {low:.{places}f} to {high:.{places}f}{normalised}"
    text += ", VALID" if mass["valid"] else f", NOT VALID: {mass['reason']}"
    said = [f"provisional: {', '.join(mass['provisional'])}"] if mass["provisional"] else []
    said += ["specification as bare rig"] if mass["bare"] else []
    return f"{text} ({'; '.join(said)})" if said else text


def whole_line(shot: str, thinned: Mapping[str, Any], mass: Mapping[str, Any]) -> str:
    """Write a mass by the full rate beside the one that was said before it, by thinned channels."""
    difference_kg = mass["value"] - thinned["value"]
    large = abs(difference_kg) > LARGE_DIFFERENCE * mass["u"]
    places = mass_decimals(mass["u"], 1)
    text = f"{mass_line(shot, mass)}; by the full rate, "
    if not large:
        return f"{text}{thinned['thinned_hz'] / 1e3:g} kHz gave the same"
    changed = f"{difference_kg:+.{places + 1}f} kg, {abs(difference_kg) / mass['u']:.2f} u"
    return f"{text}which CHANGES IT by {changed} from what {thinned['thinned_hz'] / 1e3:g} kHz gave"


def campaign_line(campaign: Mapping[str, Any], *, brief: bool = False) -> str:
    """Write what the shots say together in one line: mass, what changed, and what more of them would give.

    Parameters
    ----------
    brief
        Whether the last of these is left out.
    """
    places = mass_decimals(campaign["u"], 1)
    low, high = campaign["U95"]
    text = f"campaign of {len(campaign['shots'])}: {campaign['value']:.{places}f} +- {(high - low) / 2:.{places}f} kg, "
    text += "; ".join(campaign["changes"]) or "nothing changed"
    if not campaign["valid"]:
        text += f"; NOT VALID: {campaign['reason']}"
    if brief:
        return text
    expected = campaign["expected"]
    return f"{text}; {expected['shots']} shots are expected to give u {expected['u']:.{places + 1}f} kg"
