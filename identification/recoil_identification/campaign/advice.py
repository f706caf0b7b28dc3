"""Advice, worked out line by line: a line that cannot be worked out costs itself, and not the result beside it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.remark import Note, NoteCode

T = TypeVar("T")

FAILURES = (ArithmeticError, LookupError, ValueError, RecoilDaqError)
"""What imagined shots may fail by: no number, nothing of a name, nothing that can be solved or combined."""
U_WEIGHED_KG, U_WEIGHED_REL = 0.05, 2e-3
"""Standard uncertainty to which a mass can be weighed at a range, and as a share of a light one."""


class FailedAdviceWarning(RuntimeWarning):
    """A line of advice could not be worked out: a fault of this program, which no test lets pass."""


@dataclass(frozen=True)
class Advised(Generic[T]):
    """Lines of advice.

    Attributes
    ----------
    lines
        Lines that could be worked out.
    notes
        Note on each that could not.
    """

    lines: tuple[T, ...]
    notes: tuple[Note, ...] = ()


def worked_out(advice: dict[str, Callable[[], T]]) -> Advised[T]:
    """Work out each line by itself.

    Parameters
    ----------
    advice
        Words of each line, and the function that works it out.

    Warns
    -----
    FailedAdviceWarning
        If one could not be: an error where warnings are errors.
    """
    lines, notes = list[T](), list[Note]()
    for said, work in advice.items():
        try:
            lines.append(work())
        except FAILURES as error:
            told = f"left out of what could be done, since it could not be worked out: {said} ({error!r})"
            warnings.warn(told, FailedAdviceWarning, stacklevel=2)
            notes.append(Note(NoteCode.NO_ADVICE, None, f"{told}; the mass does not hang on it"))
    return Advised(tuple(lines), tuple(notes))


def weighed_to_kg(added_kg: float) -> float:
    """Return the standard uncertainty to which a mass that is advised is taken to be weighed.

    >>> weighed_to_kg(310.0), weighed_to_kg(5.0)
    (0.05, 0.01)
    """
    return min(U_WEIGHED_KG, U_WEIGHED_REL * added_kg)
