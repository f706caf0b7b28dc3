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

_DEWESOFT_TIME = re.compile(r"(?P<data>.+?)_time(?:_(?P<channel>.+))?", re.IGNORECASE)
_PLAIN_TIMES = frozenset(
    {"t", "time", "times", "time_s", "t_s", "timestamp", "timestamps", "zeit", "tid", "time_vector"}
)
RATES_HZ = ("sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "fs", "fs_hz", "sample_rate_hz")
STEPS_S = ("dt", "dt_s", "delta_t", "ts", "sample_interval", "sampling_interval")


def is_time(name: str, others: Collection[str]) -> bool:
    """Return whether a variable's name is that of a time; `others` are all names of the file."""
    folded = name.casefold()
    stem = folded.removesuffix("_t").removesuffix("_time")
    own = stem != folded and stem in {other.casefold() for other in others}
    return folded in _PLAIN_TIMES or own or _DEWESOFT_TIME.fullmatch(folded) is not None


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
        return 2 if time in _PLAIN_TIMES else 0
    data, own = match["data"], match["channel"]
    if not channel.startswith(f"{data}_"):
        return 0
    rest = channel[len(data) + 1 :]
    if own is None:
        return 3
    # The longest name wins, so that AI_1 is not taken for AI_10; a group's time serves all in it
    return 10 + len(own) if rest == own or rest.startswith(f"{own}_") else 1


def stated_step(scalars: Mapping[str, float]) -> tuple[str, float] | None:
    """Find a scalar that states the one rate of a file: its name and the step in seconds."""
    by_name = {name.casefold(): (name, value) for name, value in scalars.items()}
    for names, is_rate in ((RATES_HZ, True), (STEPS_S, False)):
        for folded in names:
            name, value = by_name.get(folded, ("", 0.0))
            if value > 0:
                return name, 1.0 / value if is_rate else value
    return None
