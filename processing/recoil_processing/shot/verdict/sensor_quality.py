"""Checks of whether each channel has its own sensor, and each source the file of this shot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.quality.limits import LIMITS
from recoil_rigs.rig import RedundantAlignment
from recoil_rigs.shots.assemble import shown_unit
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.channel_table import range_si

LEAST_USED, MOST_USED = 0.02, 1.02
"""Shares of a sensor's range between which lies the peak of a shot that was measured with the right one."""
FAR_BEYOND = 2.0
"""Share of the range of a sensor of another quantity: one that is chosen too small is so by less."""


def check_sensors(fired: FiredShot, alignments: Sequence[ClockAlignment]) -> Iterator[QualityCheck]:
    """Ask about ``sensor`` tables that may be another channel's, and about files that may be another shot's.

    Yields
    ------
    QualityCheck
        Warnings only: the numbers may be right all the same, and who mounted the sensors knows.
    """
    yield from _exchanged(fired)
    for fault in fired.rig.foreign_keys:
        row, key = fault.parts[0], fault.parts[-1]
        name = str(getattr(row, "name", row))
        if name in fired.shot.channels:
            yield QualityCheck(name, Check.SENSOR, "warn", f"`{key}` {fault.problem}")
    for alignment in alignments:
        yield from _of_another_shot(fired, alignment)


def _exchanged(fired: FiredShot) -> Iterator[QualityCheck]:
    """Two channels whose peaks fit each other's range, and one of which is beyond its own."""
    used: dict[str, tuple[float, float]] = {}
    for name, fired_channel in fired.channels.items():
        limits, (_, unit) = range_si(fired_channel.spec), shown_unit(fired_channel.spec)
        present = fired_channel.recorded.measured[np.isfinite(fired_channel.recorded.measured)]
        if limits is None or not present.size or fired_channel.source.kind == "camera":
            continue
        reach, peak = (max(abs(unit.from_si(end)) for end in ends) for ends in (limits, _ends(present)))
        if peak > 0 and math.isfinite(peak) and reach > 0:
            used[name] = reach, peak

    def fits(peak_of: str, range_of: str) -> bool:
        return LEAST_USED < used[peak_of][1] / used[range_of][0] < MOST_USED

    def alike(pair: tuple[str, ...]) -> bool:
        return len({fired.channels[name].spec.quantity for name in pair}) == 1

    def misfits(*pair: str) -> list[str]:
        return [name for name in pair if not fits(name, name)]

    def exchanges(*pair: str) -> bool:
        # a range that is hardly used is no evidence alone: inertial sensors are bought with generous ones
        most = MOST_USED if alike(pair) else FAR_BEYOND
        beyond = any(used[name][1] >= most * used[name][0] for name in pair)
        return beyond and fits(*pair) and fits(*reversed(pair))

    # the likeliest first: that explains two peaks, then of sensors of one quantity, which are exchanged more easily
    fitting = sorted(
        (pair for pair in combinations(used, 2) if exchanges(*pair)),
        key=lambda pair: (-len(misfits(*pair)), not alike(pair)),
    )
    explained: set[str] = set()
    for one, other in fitting:
        if explained.intersection(misfits(one, other)):
            continue
        explained.update(misfits(one, other))
        for name, that in ((one, other), (other, one)):
            share = used[name][1] / used[name][0]
            yield QualityCheck(
                name,
                Check.SENSOR,
                "warn",
                f"its peak is {share:.2g} of its range, and {used[name][1] / used[that][0]:.2g} of that of {that}, "
                f"whose own fits here: are the `sensor` tables of {name} and {that} exchanged? Compare both serial "
                "numbers with the certificates",
            )


def _ends(present: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, float]:
    return float(present.min()), float(present.max())


def _of_another_shot(fired: FiredShot, alignment: ClockAlignment) -> Iterator[QualityCheck]:
    """Say that a channel that repeats another reads another motion, by more than both certificates allow."""
    align = next((source.align for source in fired.rig.sources if source.name == alignment.clock), None)
    details = alignment.details or {}
    if not isinstance(align, RedundantAlignment) or alignment.status == "failed" or "gain" not in details:
        return
    own, other = (fired.channels.get(name) for name in (align.channel, align.against))
    if own is None or other is None or own.spec.sensor.position != other.spec.sensor.position:
        return
    u = math.hypot(_u_rel(own.recorded), _u_rel(other.recorded), float(details["u_gain"]))
    gain, limit = float(details["gain"]), LIMITS["redundant_gain"]
    off = abs(gain - 1.0) / u if u > 0 else 0.0
    if limit.verdict(off) != "ok":
        yield QualityCheck(
            align.channel,
            Check.SECOND_SENSOR,
            "warn",
            f"it reads {gain:.3f} of {align.against}, which it repeats, {off:.1f} standard uncertainties off 1 (limit "
            f"{limit.warn:g}): is the file of {alignment.clock} that of another shot, or one of the two sensors not "
            "the one that the rig states?",
        )


def _u_rel(channel: Channel) -> float:
    return channel.u_rel if math.isfinite(channel.u_rel) else 0.0
