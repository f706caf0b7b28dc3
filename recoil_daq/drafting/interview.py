"""Questions of a draft, asked in an order in which answers help each other: what opens files first, clocks last."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import replace
from typing import Any

from recoil_acquisition.errors import KeyPath, RecoilDaqError, Row
from recoil_daq.drafting.answer import Answer
from recoil_daq.drafting.init import NOTHING, DraftedRig
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.rig_draft import OpenEntry

Look = Callable[[Mapping[str, Any]], DraftedRig]
"""Drafts the rig by what was answered before, see `DraftedRig.answered_tables`."""
Ask = Callable[[Sequence[OpenEntry], MutableMapping[KeyPath, Answer]], bool]
"""Asks questions, puts each answer into a mapping, and returns whether more may be asked."""
_FIRST = ("quantity", "unit")
"""Keys that are asked for before a sensor's values, which are typed in that unit."""
_LAST = ("align",)
"""Keys that are asked for at the end: what is answered before may find them."""


class Interview:
    """Questions of a draft, and the draft with what was answered of them.

    Attributes
    ----------
    answers
        Answers by their keys, as they were given.
    """

    def __init__(self, look: Look) -> None:
        self._look = look
        self._drafted = look(NOTHING)
        self._answered: Mapping[str, Any] = NOTHING
        self._refused: tuple[str, ...] = ()
        self.answers: dict[KeyPath, Answer] = {}

    @property
    def drafted(self) -> DraftedRig:
        """Draft with the answers so far."""
        answered = self._drafted.with_answers(_by_place(self._drafted, self.answers))
        return replace(answered, lacks=(*answered.lacks, *self._refused))

    def hold(self, ask: Ask) -> None:
        """Ask what opens files and draft again by the answers, as long as that brings new questions; then the rest.

        Raises
        ------
        KeyboardInterrupt
            If whoever is asked ends it; `drafted` has the answers so far.
        """
        asked: set[KeyPath] = set()
        while questions := [one for one in self._questions(asked) if one.question.opens or one.parts[-1] in _FIRST]:
            asked |= {_known(one.parts) for one in questions}
            before = len(self.answers)
            if not ask(questions, self.answers):
                return
            if len(self.answers) == before:
                break
            new = self._drafted.answered_tables(_by_place(self._drafted, self.answers))
            self._answered = OtherRig(self._drafted.path, self._answered, {}).with_answers(new).tables
            if not self._looked_again():
                break
        ask(sorted(self._questions(asked), key=lambda one: one.parts[-1] in _LAST), self.answers)

    def _looked_again(self) -> bool:
        """Draft again by the answers; where files are not read by them, the draft before is kept, and that is said."""
        try:
            again = self._look(self._answered)
        except RecoilDaqError as error:
            self._refused = (f"by the answers the files are not read: {error}",)
            return False
        lost = [path for path in again.left_out if path not in self._drafted.left_out]
        if lost:
            why = again.left_out[lost[0]].without_path()
            self._refused = (f"by the answers {lost[0].name} is not read: {why}",)
            return False
        self._drafted = again
        return True

    def _questions(self, asked: set[KeyPath]) -> list[OpenEntry]:
        return [one for one in self._drafted.draft.questions() if _known(one.parts) not in asked]


def _by_place(drafted: DraftedRig, answers: Mapping[KeyPath, Answer]) -> dict[KeyPath, Answer]:
    """Return answers by the keys of a draft, in which the number of a row may be another."""
    known = {_known(key): answer for key, answer in answers.items()}
    return {one.parts: known[_known(one.parts)] for one in drafted.draft.questions() if _known(one.parts) in known}


def _known(parts: KeyPath) -> KeyPath:
    """Return a key without the number of its row."""
    return tuple(Row(one.table, one.name) if isinstance(one, Row) else one for one in parts)
