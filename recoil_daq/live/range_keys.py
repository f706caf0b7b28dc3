"""Keys of the armed range: what each does, which asks first, and what is asked at present."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from recoil_acquisition.capture.live_session import LiveSession
from recoil_daq.live.added_mass import NOT_STATED, AddedMass, AddedMassEntry
from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveShot
from recoil_daq.live.shots.dropped_files import DroppedFiles
from recoil_daq.live.shots.shot_work import ShotWork

ASKED_FOR_S = 60.0
"""Time after which a question that nobody answers is taken back, s."""


@dataclass(frozen=True)
class _Question:
    """Question to somebody at the keys, and what follows from y: whether the session is to end."""

    text: str
    yes: Callable[[], bool]
    asked_s: float


class RangeKeys:
    """Does what somebody at the keys wants, while a session goes on.

    Parameters
    ----------
    heed
        Function called when somebody at the keys has seen an alarm, with whether he armed.
    """

    def __init__(self, display: Display, files: DroppedFiles, work: ShotWork, heed: Callable[[bool], None]) -> None:
        self._display, self._files, self._work, self._heed = display, files, work, heed
        self._question: _Question | None = None
        self._entry: AddedMassEntry | None = None

    @property
    def asked(self) -> str:
        """The question that is to be answered; empty if there is none."""
        if self._entry is not None:
            return str(self._entry)
        return "" if self._question is None else self._question.text

    @property
    def asked_in_turn(self) -> str:
        """Whether the next shot carries what it is to; empty where no weight is at hand, or it was said."""
        carries = self._work.in_turn
        return "" if carries is None else f"does shot {self._work.next_name} carry {carries}? y yes, m another"

    def look(self, session: LiveSession) -> bool:
        """Do what a key says, if one was pressed; return whether the session is to end."""
        key = self._display.key()
        if self._entry is not None:
            self._answer_mass(self._entry, key)
            return False
        if self._question is not None:
            return self._answer(self._question, key)
        state = session.status.state
        if key == "a":
            self._arm(session)
        elif key == "d":
            session.disarm()
            self._heed(False)
            self._display.notice("disarmed: nothing will trigger")
        elif key == "t" and state == "disarmed":
            self._ask("DISARMED: arm, and trigger a shot now? y yes, n no", partial(self._arm_and_fire, session))
        elif key == "t":
            session.fire()
        elif key == "q" and state in ("armed", "recording"):
            self._ask(f"{state.upper()}: end the session? y yes, n go on", lambda: True)
            return False
        elif key == "m":
            self._entry = AddedMassEntry()
        elif key == "c" and (waiting := self._work.dispensable):
            shot, names = next(iter(waiting.items()))
            text = f"shot {shot.name} waits for {', '.join(names)}: did not fire, go on without? y yes, n wait"
            self._ask(text, partial(self._go_on_without, shot, names))
        elif key == "y" and not self._files.asked and (carries := self._work.in_turn) is not None:
            self._state_mass(carries)
        else:
            self._files.answered(key)
        return key == "q"

    def _arm(self, session: LiveSession) -> None:
        """Arm, whatever was met at rest."""
        session.arm()
        self._heed(True)
        self._display.notice("armed")

    def _arm_and_fire(self, session: LiveSession) -> bool:
        """Arm, and trigger by hand; return that the session goes on."""
        self._arm(session)
        session.fire()
        return False

    def _go_on_without(self, shot: LiveShot, names: Sequence[str]) -> bool:
        """Wait no longer for files of a shot; return that the session goes on."""
        self._work.go_on_without(shot, names)
        return False

    def _ask(self, text: str, yes: Callable[[], bool]) -> None:
        self._question = _Question(text, yes, time.monotonic())

    def _answer(self, question: _Question, key: str) -> bool:
        """Take the answer to a question; return whether the session is to end. Any key but y goes on as before."""
        if key or time.monotonic() - question.asked_s > ASKED_FOR_S:
            self._question = None
        return key == "y" and question.yes()

    def _answer_mass(self, entry: AddedMassEntry, key: str) -> None:
        """Take a key of the answer to what the shots to come carry; an empty answer leaves it as it is."""
        if not entry.press(key):
            return
        self._entry, text = None, entry.typed.strip()
        if not text:
            return
        try:
            added = None if text == NOT_STATED else AddedMass.of(text)
        except ValueError as error:
            self._display.notice(f"added mass as before: {error}")
            return
        self._state_mass(added)

    def _state_mass(self, added: AddedMass | None) -> None:
        """Take what the shots to come carry."""
        self._work.added_mass = added
        stated = "not stated" if added is None else "; ".join([str(added), *added.doubts])
        self._display.notice(f"added mass of the shots to come: {stated}")
