"""Assignment of a MATLAB file's time vectors to its variables, by name and length.

Dewesoft names channels ``Data1_AI_1`` and times ``Data1_time_AI_1`` or ``Data1_time``: channels of
another rate have a time of their own. Other exports put ``_TIME`` behind the channel's name, and
scripts have one ``time`` or ``t``. A name decides first, then the length; where two time vectors
would do, none is taken.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from recoil_acquisition.readers.mat.variable import MatVariable
from recoil_acquisition.readers.time.time_axis import (
    STEPS,
    Stated,
    folded,
    stated_rate,
    stated_step,
    unit_in_time_name,
)
from recoil_acquisition.readers.time.time_units import time_unit_s

_DEWESOFT_TIME = re.compile(r"(?P<data>.+?)_time(?:_(?P<channel>.+))?", re.IGNORECASE)
_STEPS = STEPS | {"ts"}


def is_time(name: str, others: Collection[str]) -> bool:
    """Return whether a variable's name is that of a time; `others` are all names of the file."""
    folded = name.casefold()
    stem = folded.removesuffix("_t").removesuffix("_time")
    own = stem != folded and stem in {other.casefold() for other in others}
    return is_plain_time(folded) or own or _DEWESOFT_TIME.fullmatch(folded) is not None


def time_of(channel: MatVariable, times: Sequence[MatVariable]) -> MatVariable | str | None:
    """Find the time of a channel.

    Returns
    -------
    MatVariable, str or None
        The time; or why there is none; None if no time has the channel's length.
    """
    fitting = [time for time in times if time.count == channel.count]
    ranks = [(_rank(channel.name.casefold(), time.name.casefold()), time) for time in fitting]
    best = max((rank for rank, _ in ranks), default=0)
    chosen = [time for rank, time in ranks if rank == best > 0]
    if len(chosen) > 1:
        return f"{' and '.join(repr(time.name) for time in chosen)} could both be its time"
    return chosen[0] if chosen else None


def _rank(channel: str, time: str) -> int:
    """Return how much a time's name speaks for a channel: its own, that of its block, any."""
    if time in (f"{channel}_time", f"{channel}_t", f"{channel}_time_s"):
        return 1000
    match = _DEWESOFT_TIME.fullmatch(time)
    if match is None:
        return 2 if is_plain_time(time) else 0
    data, own = match["data"], match["channel"]
    if not channel.startswith(f"{data}_"):
        return 0
    rest = channel[len(data) + 1 :]
    if own is None:
        return 3
    # The longest name wins, so that AI_1 is not taken for AI_10; a group's time serves all in it
    return 10 + len(own) if rest == own or rest.startswith(f"{own}_") else 1


def is_plain_time(name: str) -> bool:
    """Return whether a name is that of a time alone, with a unit behind it or without."""
    return unit_in_time_name(name) is not None


def unit_of_time(time: str, texts: Mapping[str, str]) -> float | str | None:
    """Return the seconds of the unit of a time vector, by its name or a text beside it.

    Returns
    -------
    float, str or None
        Why it cannot be taken, where the unit is none of time, or stated twice; None if no unit is stated.
    """
    wanted = {folded(time) + ending for ending in ("unit", "units")} | {"timeunit", "timeunits", "xunit", "xunits"}
    beside = [text for name, text in texts.items() if folded(name) in wanted]
    units = [unit.strip() for unit in (unit_in_time_name(time) or "", *beside) if unit.strip()]
    factors = {time_unit_s(unit) for unit in units}
    if None in factors:
        unknown = next(unit for unit in units if time_unit_s(unit) is None)
        return f"{time} is in {unknown!r}, which is no unit of time that is known"
    if len(factors) > 1:
        return f"{time} states its unit as {' and as '.join(map(repr, units))}"
    return factors.pop() if factors else None


def one_step(scalars: Mapping[str, float], texts: Mapping[str, str]) -> tuple[str, float] | str | None:
    """Find a scalar that states the one rate of a file: its name and the step, s; or why it cannot be taken."""
    positive = {**texts, **{name: value for name, value in scalars.items() if value > 0}}
    found: Stated | str | None = stated_rate(positive)
    if isinstance(found, Stated):
        return found.name, 1.0 / found.value
    if found is None:
        found = stated_step(positive, _STEPS)
    return (found.name, found.value) if isinstance(found, Stated) else found
