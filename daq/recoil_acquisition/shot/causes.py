"""Findings by their causes: each cause is said once, the weightiest first, with how much more it explains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from recoil_acquisition.measured import worded
from recoil_acquisition.remark import Caution, Note, Reason, ReasonCode, Remark, findings_of
from recoil_acquisition.shot.quality_check import Check, QualityCheck

OneRemark = TypeVar("OneRemark", bound=Remark)


class Subject(NamedTuple):
    """Subject of a finding, one channel: its own name, its role, the clock it is on, and its quantity."""

    channel: str
    role: str
    clock: str
    quantity: str


_FROM_LATE = frozenset({
    Check.TIME_STEPS, Check.CLOCK_STEPS, Check.CLOCK_STAMPS, Check.HELD_VALUES, Check.ALIGNMENT, ReasonCode.CLOCK,
    ReasonCode.ROLE,
})  # fmt: skip
_FROM_AWAY = _FROM_LATE | {Check.LATE_STAMPS, Check.MISSING_FRAMES, Check.STREAM, Check.LOSSES}
_CAUSES: Mapping[StrEnum, frozenset[StrEnum]] = MappingProxyType({
    Check.SET_ASIDE: _FROM_AWAY | {Check.DELIVERY, Check.CONNECTION, Check.LOST_FRAMES},
    Check.SENSOR: frozenset({Check.SENSOR, Check.RANGE, Check.FLAT_TOPS}),
    Check.FILE: frozenset({ReasonCode.ROLE}),
    Check.REFERENCE_GAP: frozenset({
        Check.REFERENCE_GAP, Check.ALIGNMENT, ReasonCode.CLOCK, ReasonCode.ROLE, Check.TIME_STEPS,
    }),
    Check.CODE: frozenset({Check.ONSET, Check.FORCE}),
    Check.OVERFLOW: frozenset({Check.ONSET, Check.FORCE}),
    Check.DELIVERY: _FROM_AWAY,
    Check.CONNECTION: _FROM_AWAY,
    Check.LATE_STAMPS: _FROM_LATE,
    # says what to do, too
    ReasonCode.CLOCK: frozenset({Check.ALIGNMENT, ReasonCode.ROLE, Check.TIME_STEPS}),
    Check.ALIGNMENT: frozenset({ReasonCode.ROLE, Check.TIME_STEPS}),
    Check.TIME_STEPS: frozenset({Check.TIME_STEPS}),
    Check.HELD_VALUES: frozenset({Check.HELD_VALUES}),
    Check.MISSING_FRAMES: frozenset({Check.STREAM, Check.DAMAGED_ENTRIES}),
})  # fmt: skip
"""Finding on a source -> what follows from it of the source, its channels and their roles; what explains more first.
From one on a channel follows what is said of that channel alone, from one on what measures a force what is said of the
force, from a gap of the reference what is said of the clocks that it leaves in doubt."""
_OF_CHANNELS = (Check.SENSOR,)
_OF_CLOCKS = (Check.ALIGNMENT, ReasonCode.CLOCK)
_OF_A_FORCE = (Check.CODE, Check.OVERFLOW)
_OF_FORCES = ("pressure", "force")
_FORCES = (ReasonCode.ROLE, Check.FILE, Check.DELIVERY)
_BROKEN = (Check.CONSTANT, *_OF_A_FORCE)
_MOTION = (Check.ONSET, Check.FORCE)
_CLOCKS = (
    Check.LATE_STAMPS,
    Check.REFERENCE_GAP,
    ReasonCode.CLOCK,
    *(one for one in _FROM_LATE if isinstance(one, Check)),
    Check.SET_ASIDE,
)


def by_cause(found: Sequence[OneRemark], subjects: Sequence[Subject]) -> tuple[list[OneRemark], list[OneRemark]]:
    """Say each cause once, the weightiest first: no forces, no motion, clocks, then the rest as they come.

    What follows from one cause (the source's stamps come in bursts, so that its clock cannot be aligned and its forces
    are missing) is one finding, as weighty as the weightiest of them, which says how many more it explains.

    Parameters
    ----------
    found
        Reasons and cautions.
    subjects
        Channels of the shot.

    Returns
    -------
    said, explained : list of Remark
        Those that are said, and the others, in the order in which they came.
    """
    doubted = {one.about for one in found if one.code is ReasonCode.CLOCK}
    # a doubt of a clock and the check of its alignment say the same
    found = [one for one in found if one.code is not Check.ALIGNMENT or one.about not in doubted]
    source_of = {subject.channel: subject.clock for subject in subjects}
    by_role: dict[str, set[str]] = {}
    for subject in subjects:
        by_role.setdefault(subject.role, set()).add(subject.clock)
    source_of |= {role: next(iter(clocks)) for role, clocks in by_role.items() if role and len(clocks) == 1}
    absent = {one.about for one in found if one.code is Check.FILE and isinstance(one, Reason)}

    def source(one: Remark) -> str | None:
        if one.code is ReasonCode.ROLE and one.about not in source_of:
            return next(iter(absent)) if len(absent) == 1 else None
        return None if one.about is None else source_of.get(one.about, one.about)

    quantities = {subject.channel: subject.quantity for subject in subjects if subject.role}

    doubtful = {source(one) for one in found if one.code in _OF_CLOCKS}

    def of_a_force(one: Remark) -> bool:
        return quantities.get(str(one.about)) in _OF_FORCES

    def related(code: StrEnum, one: Remark, that: Remark) -> bool:
        if code in _OF_A_FORCE:
            return of_a_force(one)
        if code is Check.REFERENCE_GAP and that.code in (*_OF_CLOCKS, ReasonCode.ROLE):
            return source(that) in doubtful
        return one.about == that.about if code in _OF_CHANNELS else source(that) == source(one)

    causes: dict[int, list[int]] = {}
    explained: set[int] = set()
    for code, follows in _CAUSES.items():
        for at, one in enumerate(found):
            if one.code is not code or at in explained:
                continue
            rest = [
                other
                for other, that in enumerate(found)
                if other != at and other not in explained and other not in causes
                and that.code in follows and related(code, one, that)
            ]  # fmt: skip
            if rest:
                causes[at] = rest
                explained.update(rest)

    def weight(one: Remark) -> int:
        if one.code in _FORCES or (one.code in _BROKEN and of_a_force(one)):
            return 0
        return 1 if one.code in _MOTION else 2 if one.code in _CLOCKS else 3

    said = []
    for at, one in enumerate(found):
        if at in explained:
            continue
        group = [one, *(found[other] for other in causes.get(at, ()))]
        worst = next((that for that in group if isinstance(that, Reason)), one)
        head = one
        if at in causes:
            head = type(worst)(one.code, one.about, worded(one, f"; this explains {len(group) - 1} more"))
        said.append((isinstance(worst, Caution), min(map(weight, group)), at, head))
    return [one for *_, one in sorted(said, key=lambda placed: placed[:3])], [found[at] for at in sorted(explained)]


def _said(
    quality: Sequence[QualityCheck], against_mass: Sequence[Reason], subjects: Sequence[Subject]
) -> tuple[list[Remark], list[Remark]]:
    """Return what fails, speaks against the mass and warns, each cause once, and what that explains."""
    failed = [check.remark() for check in quality if check.verdict == "fail"]
    return by_cause([*failed, *against_mass, *(c.remark() for c in quality if c.verdict == "warn")], subjects)


def reasons_of(
    quality: Sequence[QualityCheck], against_mass: Sequence[Reason], subjects: Sequence[Subject] = ()
) -> tuple[str, ...]:
    """Say why a shot is not usable: what failed, and what speaks against its mass although nothing failed."""
    said, _ = _said(quality, against_mass, subjects)
    return tuple(str(one) for one in said if isinstance(one, Reason))


def shot_findings(
    quality: Sequence[QualityCheck], against_mass: Sequence[Reason], subjects: Sequence[Subject] = ()
) -> list[dict[str, Any]]:
    """Return the ``findings`` of a shot: its reasons in order, what warns, what both explain, what readers noted."""
    said, explained = _said(quality, against_mass, subjects)
    notes = [check.remark() for check in quality if check.verdict == "ok" and check.check is Check.READER]
    return findings_of(said, as_notes(explained), notes)


def as_notes(explained: Iterable[Remark]) -> list[Note]:
    """Return findings whose cause is said as notes, with their codes and words."""
    return [Note(one.code, one.about, one) for one in explained]
