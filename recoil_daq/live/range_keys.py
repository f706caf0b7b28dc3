"""Keys of the armed range: what each does, which asks first, and what is asked at present."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from recoil_acquisition.capture.live_session import LiveSession
from recoil_daq.live.added_mass import NOT_STATED, AddedMass, mass_entry
from recoil_daq.live.display import Display
from recoil_daq.live.line_entry import LineEntry
from recoil_daq.live.log_words import EXCLUDE, NOTES, LogWords
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
    asks_mass
        Whether the added mass is asked for until somebody answers.
    """

    def __init__(
        self, display: Display, files: DroppedFiles, work: ShotWork, heed: Callable[[bool], None], *,
        asks_mass: bool = False,
    ) -> None:  # fmt: skip
        self._display, self._files, self._work, self._heed = display, files, work, heed
        self._question: _Question | None = None
        self._entry: LineEntry | None = None
        self._take: Callable[[str], None] = lambda _: None  # what is done with what was typed
        self._asks_mass = asks_mass

    @property
    def asked(self) -> str:
        """The question that is to be answered; empty if there is none."""
        if self._entry is not None:
            return str(self._entry)
        return "" if self._question is None else self._question.text

    @property
    def asked_in_turn(self) -> str:
        """Question for what the next shot carries; empty where it was said, or nobody is to be asked."""
        carries = self._work.in_turn
        if carries is None and self._asks_mass:
            return "added mass of the next shots, kg, and u; Enter: not now"
        return "" if carries is None else f"does shot {self._work.next_name} carry {carries}? y yes, m another"

    def look(self, session: LiveSession) -> bool:
        """Do what a key says, if one was pressed; return whether the session is to end."""
        key = self._display.key(typed=self._entry is not None)
        if self._entry is not None:
            self._answer_entry(self._entry, key)
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
            self._enter(mass_entry(), self._answer_mass)
        elif key == " ":
            self._work.see()
            self._heed(False)
        elif key in ("x", "l"):
            self._write_on(self._work.last, EXCLUDE if key == "x" else NOTES)
        elif key == "c" and (waiting := self._work.dispensable):
            shot, names = next(iter(waiting.items()))
            text = f"shot {shot.name} waits for {', '.join(names)}: did not fire, go on without? y yes, n wait"
            self._ask(text, partial(self._go_on_without, shot, names))
        elif key == "y" and not self._files.asked and (carries := self._work.in_turn) is not None:
            self._state_mass(carries)
        elif self._asks_mass and key and not self._files.asked:
            self._begin_mass(key)
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

    def _enter(self, entry: LineEntry, take: Callable[[str], None]) -> None:
        self._entry, self._take = entry, take

    def _begin_mass(self, key: str) -> None:
        """Begin the answer to what was asked since it was armed, by its first character, or leave it by Enter."""
        entry = mass_entry()
        if entry.press(key):
            self._asks_mass = False
        elif entry.typed.strip():
            self._enter(entry, self._answer_mass)

    def _write_on(self, shot: LiveShot | None, column: str) -> None:
        """Ask for words on a shot, for its row of the shot log."""
        if shot is None:
            self._display.notice("no shot yet")
            return
        name, before = shot.name, f" (now: {shot.excluded}; - takes it back)" if shot.excluded else ""
        question = f"note on shot {name}" if column == NOTES else f"shot {name} is left out of the mass, why{before}"

        def take(text: str) -> None:
            words = "" if column == EXCLUDE and text == NOT_STATED else text
            self._work.write(LogWords(name, column, words))

        self._enter(LineEntry(f"{question} (Enter)"), take)

    def _answer_entry(self, entry: LineEntry, key: str) -> None:
        """Take a key of what is typed; an empty answer leaves everything as it is."""
        if entry.press(key):
            self._entry = None
            if text := entry.typed.strip():
                self._take(text)

    def _answer_mass(self, text: str) -> None:
        """Take what the shots to come carry, as it was typed."""
        try:
            added = None if text == NOT_STATED else AddedMass.of(text)
        except ValueError as error:
            self._display.notice(f"added mass as before: {error}")
            return
        self._state_mass(added)

    def _state_mass(self, added: AddedMass | None) -> None:
        """Take what the shots to come carry."""
        self._work.added_mass, self._asks_mass = added, False
        stated = "not stated" if added is None else "; ".join([str(added), *added.doubts])
        self._display.notice(f"added mass of the shots to come: {stated}")
