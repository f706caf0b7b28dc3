"""Offset of two clocks by absolute time, and what becomes of it beside a second opinion.

Absolute time needs nothing of the record, so it is never ambiguous, and it is as right as the lock of both clocks. A
motion shows the offset itself: a lock that is not what it says it is shows beside it. Where both agree, absolute time
counts. Where they do not, and a lock may still be off by as much, the motion does, and that is said. What no lock
explains is two files that are not of one shot, or a clock that was set wrongly: then neither counts.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

from recoil_acquisition.clocks.time_lock import TimeLock
from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.measured import worded
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import MOST_U_OFFSET_S, failed_alignment, hardly_known

METHOD = "absolute"
MOST_EXPLAINED_S = 10e-3
"""Difference that a lock may still have: one element of IRIG-B's code takes 10 ms, a millisecond is one period of its
carrier, and a clock that lost its lock an hour ago is as far off. Beyond, the seconds themselves are others."""
COVERAGE = 2.0
"""Standard uncertainties of U95."""
WARNED = "warned"
"""Key of the sentence, in the details of an alignment that is used, on what is to be looked at."""


@dataclass(frozen=True)
class ClockTime:
    """Absolute time of one clock: its start, and what it was locked to.

    Attributes
    ----------
    start
        Instant of the clock's zero; None if nothing says it.
    declared
        Lock that the rig declares; None where it declares none.
    first_s, last_s
        First and last instant of its record, on its own clock.
    """

    clock: str
    start: AbsoluteStart | None
    declared: TimeLock | None
    first_s: float
    last_s: float

    @property
    def lock(self) -> TimeLock | None:
        """Its lock: what the instrument says itself, else what the rig declares; None where neither does."""
        said = "" if self.start is None else self.start.locked_to
        return TimeLock.of_words(said) or self.declared

    @property
    def zero_ns(self) -> tuple[int, int]:
        """Its zero in ns since 1970, and the ns to which that is given; both 0 where `fault` says that nothing is."""
        return (None if self.start is None else self.start.exact_ns) or (0, 0)

    @property
    def fault(self) -> str:
        """Sentence on why it has no absolute time; empty if it has."""
        if self.start is None or self.start.exact_ns is None:
            return f"nothing says when the clock of {self.clock} was zero"
        if self.start.is_doubtful:
            return f"the clock of {self.clock} was never set: it began at {self.start.text}"
        said = f", by what it says itself ({self.start.locked_to})" if self.start.locked_to else ""
        if self.lock is TimeLock.FREE:
            return f"the clock of {self.clock} runs free{said}"
        if self.lock is None:
            return f"nothing says what the clock of {self.clock} is locked to: declare `time` of its source"
        return ""

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, with its lock and whose word that is."""
        lock = self.lock
        by_itself = self.start is not None and TimeLock.of_words(self.start.locked_to) is not None
        return {
            "clock": self.clock,
            "start": None if self.start is None else asdict(self.start),
            "lock": None if lock is None else lock.value,
            "lock_by": None if lock is None else "instrument" if by_itself else "rig",
        }


def align_absolute(
    own: ClockTime,
    reference: ClockTime,
    *,
    u_s: float | None = None,
    u_stamps_s: float = 0.0,
    drift: float = 0.0,
    u_drift: float = 0.0,
) -> ClockAlignment:
    """Relate a clock to the reference clock by what both say of absolute time.

    Parameters
    ----------
    u_s
        Standard uncertainty of the offset; that of both locks where None. The digits of both starts count beside it.
    u_stamps_s
        Standard uncertainty of the stamps of a source that the host dated.
    drift, u_drift
        Drift of a clock that is not the one that is locked, as an interface's beside the host's.

    Returns
    -------
    ClockAlignment
        Alignment, ``failed`` where one of both has no absolute time, or no lock.
    """
    details: dict[str, Any] = {"source": own.to_json(), "reference": reference.to_json()}
    unknown = [one.clock for one in (own, reference) if one.start is not None and one.start.zone == "unknown"]
    fault = own.fault or reference.fault
    if not fault and len(unknown) == 1:
        fault = f"the zone of the start of {unknown[0]} is not known: it may be hours off the other's"
    if fault:
        return replace(failed_alignment(own.clock, METHOD, fault), details={METHOD: details})
    (own_ns, own_step_ns), (other_ns, other_step_ns) = own.zero_ns, reference.zero_ns
    locks_s = math.hypot(*(one.lock.u_s for one in (own, reference) if one.lock is not None))
    digits_s = 1e-9 * math.hypot(own_step_ns, other_step_ns) / math.sqrt(12.0)
    lasts_s = own.last_s - own.first_s
    u_offset_s = math.hypot(locks_s if u_s is None else u_s, digits_s, u_stamps_s, 0.5 * u_drift * lasts_s)
    offset_s = (own_ns - other_ns) / 1e9
    # what is locked goes at the rate of absolute time, within what its time may change over the record
    u_drift = math.hypot(u_drift, u_offset_s / lasts_s if lasts_s > 0 else 0.0)
    details |= {"offset_s": offset_s, "u_offset_s": u_offset_s, "u_digits_s": digits_s}
    reasons = (hardly_known(u_offset_s),) if u_offset_s > MOST_U_OFFSET_S else ()
    return ClockAlignment(
        own.clock, offset_s, u_offset_s, drift, u_drift, "ambiguous" if reasons else "ok", METHOD, reasons,
        {METHOD: details},
    )  # fmt: skip


def without_second(found: ClockAlignment, own: ClockTime, reference: ClockTime) -> ClockAlignment:
    """Return an alignment by absolute time that nothing is compared with: both records must overlap at least."""
    if found.status == "failed":
        return found
    first_s, last_s = (found.to_reference(at_s) for at_s in (own.first_s, own.last_s))
    apart_s = max(first_s - reference.last_s, reference.first_s - last_s)
    if apart_s <= 0:
        return found
    fault = f"by absolute time the record of {own.clock} is {apart_s:.3g} s away from that of {reference.clock}"
    fault += ": a clock is set wrongly, or the file is of another shot"
    return replace(failed_alignment(found.clock, METHOD, fault), details=found.details)


def beside_second(found: ClockAlignment, second: ClockAlignment, at_s: float) -> ClockAlignment:
    """Judge absolute time beside another method.

    Parameters
    ----------
    found
        Alignment by absolute time, whatever its status.
    second
        Alignment by the other method, which did not fail.
    at_s
        Instant of the source's clock at which they are compared.

    Returns
    -------
    ClockAlignment
        Absolute time where both agree within U95 of their difference. The other one where there is no absolute time,
        where it is hardly known, or where a lock explains the difference: its details say so in `WARNED`. ``failed``
        where no lock explains it.
    """
    both = {**(second.details or {}), **(found.details or {})}
    if found.status == "failed":
        why = f"there is no absolute time: {'; '.join(found.reasons)}; {second.method} is used in its place"
        return replace(second, details={**both, WARNED: why})
    apart_s = second.to_reference(at_s) - found.to_reference(at_s)
    u_apart_s = math.hypot(found.u_offset_s, second.u_offset_s)
    compared = {
        "second_method": second.method, "second_offset_s": second.offset_s, "second_apart_s": apart_s,
        "u_second_s": second.u_offset_s,
    }  # fmt: skip
    both |= compared
    found = replace(found, details={**(found.details or {}), **compared})
    said = (
        f"{second.method} gives an offset {_apart(apart_s)} from that by absolute time (u {_us(second.u_offset_s)} and "
        f"{_us(found.u_offset_s)})"
    )
    if abs(apart_s) <= COVERAGE * u_apart_s:
        if found.status == "ok":
            return found
        why = f"by absolute time {'; '.join(found.reasons)}; {second.method} agrees, and is used in its place"
        return replace(second, details={**both, WARNED: why})
    if second.status != "ok":
        doubts = tuple(worded(f"by {second.method}: ", reason) for reason in second.reasons)
        return replace(found, status="ambiguous", reasons=(*found.reasons, said, *doubts))
    if abs(apart_s) <= MOST_EXPLAINED_S:
        why = f"{said}, more than U95 of their difference: {second.method} is used"
        why += "; look at the locks of both clocks, and at the delays that the rig declares"
        return replace(second, details={**both, WARNED: why})
    fault = f"{said}, more than any lock explains: a clock is set wrongly, or the file is of another shot"
    return replace(failed_alignment(found.clock, METHOD, fault), details=found.details)


def _apart(apart_s: float) -> str:
    return f"{apart_s:+.3g} s away" if abs(apart_s) >= 0.1 else f"{1e6 * apart_s:+.1f} us away"


def _us(u_s: float) -> str:
    return f"{1e6 * u_s:.2g} us" if u_s < 0.1 else f"{u_s:.2g} s"
