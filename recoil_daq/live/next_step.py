"""The next step at the range: the one thing that is to be done now, in one sentence, the weightiest first.

The screen, the page and ``live.json`` have the same one: it is made of the state of the range, and of nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from recoil_daq.live.range_state import RangeShot, RangeState, SourceState
from recoil_daq.live.shot import ShotState


class StepKind(StrEnum):
    """Kind of a step, the weightiest first."""

    MEND = "mend"
    """Something is wrong, by which a shot that is fired now would suffer."""
    DO = "do"
    """Somebody is to do or to answer something."""
    WAIT = "wait"
    """What is under way ends by itself."""
    FIRE = "fire"
    """Nothing stands against the next shot."""
    END = "end"
    """The session has ended."""


@dataclass(frozen=True)
class NextStep:
    """Step that is next.

    Attributes
    ----------
    text
        One sentence, without a full stop.
    about
        Name of the shot or the sources that it is about; empty if it is about none.
    """

    kind: StepKind
    text: str
    about: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        return asdict(self)


_SOURCE_STEPS: Mapping[SourceState, str] = {
    "stopped": "end the session, mend {names} and arm again: {error}",
    "lost": "plug {names} in again: it is opened by itself as soon as it is back",
    "not understood": "check baud or bit rate, framing and database of {names}: bytes come, none of them good",
    "silent": "check supply and cable of {names}: nothing comes",
}
"""State of a source with which something is wrong -> what to do, the worst first."""
LITTLE_DISK_BYTES = 1e9
_BAD = (ShotState.FAILED, ShotState.NOT_USABLE, ShotState.NOT_WHOLE, ShotState.RECORD_ONLY, ShotState.INCOMPLETE)
_UNDER_WAY = (ShotState.CUTTING, ShotState.WAITING, ShotState.CONVERTING)


def next_step(state: RangeState) -> NextStep:
    """Return what is to be done next: what is wrong now, what is asked, what the last shot says, and only then fire."""
    return next(_steps(state))


def state_document(state: RangeState) -> dict[str, Any]:
    """Return the document of ``live.json``: the state with its next step."""
    return {**state.to_json(), "next_step": next_step(state).to_json()}


def _steps(state: RangeState) -> Iterator[NextStep]:
    """Yield what there is to do, the weightiest first; the last of it is always there."""
    ended = state.state == "stopped"
    if not ended:
        yield from _wrong_now(state)
    elif state.alert:
        yield NextStep(StepKind.MEND, state.alert)
    if state.asked:
        yield NextStep(StepKind.DO, f"answer at the keys: {state.asked}")
    if ended:
        yield from _ended(state)
    if state.state == "disarmed":
        yield NextStep(StepKind.DO, "arm with key a: it is disarmed, and no shot would be made")
    if state.state == "recording":
        yield NextStep(StepKind.WAIT, f"wait: shot {state.next_shot} is being recorded", state.next_shot)
    yield from _of_shots(state)
    if state.cautions:
        yield NextStep(StepKind.DO, f"look at this before shot {state.next_shot}: {state.cautions[0]}")
    yield NextStep(StepKind.FIRE, f"fire shot {state.next_shot}: everything is ready", state.next_shot)


def _wrong_now(state: RangeState) -> Iterator[NextStep]:
    """Yield what is wrong with the session, its sources and its disk."""
    alert = [NextStep(StepKind.MEND, state.alert)] if state.alert else []
    if state.alarms or state.state == "disarmed":  # it says why no shot is made, and not which source is away
        yield from alert
    for kind, text in _SOURCE_STEPS.items():
        found = [source for source in state.sources if source.state == kind]
        if found:
            names = ", ".join(source.name for source in found)
            error = next(
                (s.live.error for s in found if s.live is not None and s.live.error), "it is not read any more"
            )
            yield NextStep(StepKind.MEND, text.format(names=names, error=error), names)
    yield from alert
    if state.disk_free_bytes < LITTLE_DISK_BYTES:
        yield NextStep(StepKind.MEND, f"make room on the disk: {state.disk_free_bytes / 1e9:.1f} GB are free")


def _of_shots(state: RangeState) -> Iterator[NextStep]:
    """Yield what the shots ask for: files that do not come by themselves, and what the newest says for the next one."""
    for shot in state.shots:
        if shot.state is ShotState.WAITING and (shot.missing or shot.growing):
            yield _files(state, shot)
    newest = next(reversed(state.shots), None)
    if newest is None:
        return
    if newest.state in _BAD:
        why = newest.why or "no reason is known"
        yield NextStep(StepKind.DO, f"shot {newest.name} is {newest.state}: {why}", newest.name)
    if newest.mass is not None and not newest.mass["valid"]:
        yield NextStep(
            StepKind.DO, f"the mass of shot {newest.name} is not valid: {newest.mass['reason']}", newest.name
        )
    if newest.state in _UNDER_WAY:
        yield NextStep(StepKind.WAIT, f"wait for the verdict on shot {newest.name}", newest.name)


def _files(state: RangeState, shot: RangeShot) -> NextStep:
    """Say which files are to be brought where, or are on their way."""
    left = "" if shot.left_s is None else f", {shot.left_s:.0f} s left"
    if shot.growing:
        return NextStep(StepKind.WAIT, f"wait for the rest of {', '.join(shot.growing)} of shot {shot.name}", shot.name)
    names = ", ".join(shot.missing)
    if state.watched is None:
        return NextStep(StepKind.WAIT, f"wait: shot {shot.name} goes on without {names}", shot.name)
    where = f"save the file of {names} of shot {shot.name} into {state.watched}"
    return NextStep(StepKind.DO, f"{where}{left}, or go on without by key c", shot.name)


def _ended(state: RangeState) -> Iterator[NextStep]:
    """Yield what is left to do when nothing is read any more."""
    on_the_way = [s.name for s in state.shots if not s.settled or s.mass_to_come]
    if on_the_way:
        yield NextStep(StepKind.WAIT, f"wait: {', '.join(on_the_way)} is being completed", on_the_way[0])
    yield NextStep(StepKind.END, f"the session has ended: copy the folder {state.out}")
