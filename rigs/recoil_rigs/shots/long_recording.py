"""The one shot in a recorder's long recording: found by the rig's trigger, or named by its time.

A recorder that was left running hands over an hour of which a second is the shot. Held whole it would take a
computer's memory many times over, so that part alone goes on: the trigger runs over the recording as it would have
run live, and what lies within its pre-time and post-time is the shot. The file itself stays what it is, and its
digest is that of all of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from recoil_acquisition.errors import Fault, ReadError, RigError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.readers.excerpt import excerpt
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.trigger import Trigger, TriggerDetector
from recoil_rigs.rig import Rig
from recoil_rigs.shots.assemble import find_signal, in_si, unit_of

LONG_SAMPLES = 1 << 24
"""Samples of the rig's channels in one file up to which all of them are the shot: 128 MB."""

BLOCK_SAMPLES = 1 << 18
"""Samples that the trigger is given at a time."""

MOST_SHOWN = 8
"""Shots of a recording that an error names."""


@dataclass(frozen=True)
class FoundShot:
    """A span of a recording that the trigger keeps, on the source's clock.

    Attributes
    ----------
    stop_s
        End of the post-time, of the last extension where there are some.
    """

    trigger_s: float
    stop_s: float


def cut_long_recordings(
    rig: Rig, recordings: Mapping[str, Recording], at_s: float | None = None
) -> dict[str, Recording]:
    """Take the part of a long recording that is the shot; leave the others as they are.

    Parameters
    ----------
    recordings
        Recordings by source.
    at_s
        Instant of the shot's trigger on the reference clock; the rig's trigger finds it if left out. Where it is
        given, the reference source's recording is cut however long it is.

    Returns
    -------
    dict of str to Recording
        Recordings by source, with an excerpt in the place of each that was cut.

    Raises
    ------
    ReadError
        If the shot cannot be found: no trigger, none found, several found, or a second long recording.
    RigError
        If the rig's unit of a channel contradicts the file's.
    """
    long = [source for source, recording in recordings.items() if _sample_count(rig, recording, source) > LONG_SAMPLES]
    if at_s is not None and rig.reference_clock not in long:
        long.append(rig.reference_clock)
    if not long:
        return dict(recordings)
    trigger = _trigger(rig, recordings[long[0]])
    cut_by = rig.reference_clock if at_s is not None else _triggering_source(rig, trigger, recordings[long[0]])
    for source in long:
        if source != cut_by:
            raise ReadError(
                f"is too long to be held whole ({_sample_count(rig, recordings[source], source)} samples), and what "
                f"part of it the shot is, {cut_by!r} cannot say: it is another clock",
                path=recordings[source].path, expected=f"at most {LONG_SAMPLES} samples of the rig's channels",
                remedy="say when the shot was with --at SECONDS"
                if source == rig.reference_clock
                else "export the seconds around the shot alone",
            )  # fmt: skip
    recording = recordings[cut_by]
    shot = _named(trigger, recording, at_s) if at_s is not None else _only_shot(rig, trigger, recording, cut_by)
    start_s = shot.trigger_s - trigger.pre_s
    first_s, last_s = _ends_s(rig, recording, cut_by)
    around = "its one trigger" if at_s is None else "the time that was given"
    why = (
        f"{max(start_s, first_s):.6g} s to {min(shot.stop_s, last_s):.6g} s of {first_s:.6g} s to {last_s:.6g} s "
        f"were taken, around {around} at {shot.trigger_s:.6f} s"
    )
    return {**recordings, cut_by: excerpt(recording, start_s, shot.stop_s, why)}


def find_shots(rig: Rig, trigger: Trigger, recording: Recording, source: str) -> tuple[FoundShot, ...]:
    """Run the trigger over a recording, some samples at a time.

    Parameters
    ----------
    trigger
        Trigger with conditions on channels of the source alone.

    Returns
    -------
    tuple of FoundShot
        Shots in the order of time.

    Raises
    ------
    MissingChannelError
        If the recording does not have a channel of the trigger.
    RigError
        If units contradict.
    """
    detector = TriggerDetector(trigger, trigger.channels, max_lag_s=math.inf)
    detector.arm(-math.inf)
    decisions = []
    for name in trigger.channels:
        for times_s, values in _blocks(rig, recording, source, name):
            decisions += detector.feed(name, times_s, values)
    found: list[FoundShot] = []
    for decision in (*decisions, *detector.finish()):
        if decision.outcome == "trigger":
            found.append(FoundShot(decision.time_s, decision.time_s + trigger.post_s))
        elif decision.outcome == "extension":
            found[-1] = FoundShot(found[-1].trigger_s, decision.time_s + trigger.post_s)
    return tuple(found)


def _blocks(rig: Rig, recording: Recording, source: str, name: str) -> Iterator[tuple[Array, Array]]:
    """Yield instants and SI samples of a channel, a block at a time."""
    spec = rig.channel(name)
    header = find_signal(recording, spec.signal)
    faults: list[Fault] = []
    unit = unit_of(spec, header, rig.source(source), recording.path, faults)
    if unit is None:
        raise RigError(rig.path, faults)
    base = recording.time_base(header.name)
    for first in range(0, base.count, BLOCK_SAMPLES):
        stop = min(first + BLOCK_SAMPLES, base.count)
        yield base.part(first, stop).times_s, in_si(spec, unit, recording.read(header.name, first, stop))


def _sample_count(rig: Rig, recording: Recording, source: str) -> int:
    wanted = {recording.aliases.get(spec.signal, spec.signal) for spec in rig.channels_of(source)}
    return sum(header.sample_count for header in recording.signals if header.name in wanted)


def _ends_s(rig: Rig, recording: Recording, source: str) -> tuple[float, float]:
    """Return the first and the last instant of the rig's channels in a recording."""
    bases = [recording.time_base(find_signal(recording, spec.signal).name) for spec in rig.channels_of(source)]
    held = [base for base in bases if base.count]
    if not held:
        raise ReadError("holds no sample of the rig's channels", path=recording.path, remedy="export it again")
    return min(base.start_s for base in held), max(base.end_s for base in held)


def _trigger(rig: Rig, recording: Recording) -> Trigger:
    if rig.trigger is None:
        raise ReadError(
            f"the shot is a part of this recording, and rig {rig.name!r} does not say how much of it",
            path=recording.path, expected="a table [trigger] in the rig file, with pre_s, post_s and [[trigger.any]]",
            remedy="declare it, or export the seconds around the shot alone",
        )  # fmt: skip
    return rig.trigger


def _triggering_source(rig: Rig, trigger: Trigger, recording: Recording) -> str:
    sources = list(dict.fromkeys(rig.channel(name).source for name in trigger.channels))
    if len(sources) != 1:
        looked = "no channel" if not sources else f"channels of several clocks ({', '.join(sources)})"
        raise ReadError(
            f"the shot is a part of this recording, and the rig's trigger looks at {looked}", path=recording.path,
            remedy="say when the shot was with --at SECONDS, on the reference clock",
        )  # fmt: skip
    return sources[0]


def _only_shot(rig: Rig, trigger: Trigger, recording: Recording, source: str) -> FoundShot:
    try:
        found = find_shots(rig, trigger, recording, source)
    except ValueError as error:
        raise ReadError(f"the trigger cannot run over it: {error}", path=recording.path) from error
    if len(found) == 1:
        return found[0]
    watched = ", ".join(trigger.channels)
    if not found:
        raise ReadError(
            f"the rig's trigger found no shot in this recording: {watched} never met it", path=recording.path,
            remedy="check its level, or say when the shot was with --at SECONDS",
        )  # fmt: skip
    shown = ", ".join(f"{shot.trigger_s:.6f}" for shot in found[:MOST_SHOWN])
    more = f" and {len(found) - MOST_SHOWN} more" if len(found) > MOST_SHOWN else ""
    raise ReadError(
        f"the rig's trigger found {len(found)} shots in this recording", path=recording.path, expected="one",
        found=f"at {shown}{more} s", remedy="choose one with --at SECONDS and name it with --shot",
    )  # fmt: skip


def _named(trigger: Trigger, recording: Recording, at_s: float) -> FoundShot:
    bases = [recording.time_base(header.name) for header in recording.signals]
    within = any(base.count and base.start_s <= at_s <= base.end_s for base in bases)
    if not within:
        held = [base for base in bases if base.count]
        ends = f"{min(b.start_s for b in held):.6g} to {max(b.end_s for b in held):.6g} s" if held else "nothing"
        raise ReadError(f"--at {at_s:g} s is not within this recording", path=recording.path, found=ends)
    return FoundShot(at_s, at_s + trigger.post_s)
