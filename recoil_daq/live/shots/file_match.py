"""Match of a dropped file with its shot: what speaks for one must not speak for another; two matches are a question."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.shot.quality_check import Check
from recoil_daq.live.shot import LiveShot
from recoil_daq.live.shots.folder_watch import DroppedFile
from recoil_daq.recording.ingest import reader_of
from recoil_rigs.rig import Rig
from recoil_rigs.shots.assemble import match_files

CLOCKS_APART_S = 2.0
"""Time by which a file's time of writing may be off against the host's clock, s: a memory card's is in steps of two
seconds."""

LATE_S = 600.0
"""Time after a shot that waits no longer, s, for which a file may still be of it."""
_OF_THE_MOTION = (
    Check.ALIGNMENT, Check.CARRIAGE, Check.FORCE, Check.FORCE_SIGN, Check.VELOCITY, Check.SECOND_SENSOR, Check.SKEW,
)  # fmt: skip
"""Checks that fail where a file is of another shot."""

_ANOTHER_LENGTH = 0.2
"""Share by which files of one instrument differ in length at most, unless somebody changed its settings."""


@dataclass(frozen=True)
class Evidence:
    """Evidence for a file's shot.

    Attributes
    ----------
    shots
        Shots that the file may belong to; none, one, or several, of which nothing shows the right one.
    by_number
        Whether the number in the file's name tells the shot.
    why_none
        Sentence on what speaks against all shots, where none is left.
    """

    shots: tuple[LiveShot, ...]
    by_number: bool = False
    why_none: str = ""


def source_of(rig: Rig, file: DroppedFile) -> str:
    """Return the source of a file.

    Raises
    ------
    ReadError
        If no reader knows it, or it fits none or several sources.
    """
    reader = reader_of(file.path, rig)
    return next(iter(match_files(rig, [(file.path, reader.kind)])))


def sources_of_file(rig: Rig, source: str, path: Path) -> tuple[str, ...]:
    """Return all sources whose file it is that was matched with one: buses of one log share it."""
    if rig.source(source).bus is None:
        return (source,)
    fitting = rig.matching(path.name) or [one for one in rig.sources if one.match is None]
    others = [one.name for one in fitting if one.bus is not None and one.name != source]
    return (source, *others)


def shots_of(
    file: DroppedFile, source: str, shots: Sequence[LiveShot], pattern: re.Pattern[str] | None = None
) -> Evidence:
    """Say which shot a file of a source belongs to.

    Its number says so, where it bears one, and it alone for a shot that a session before recorded. Such a file may have
    been seen before the trigger, back to the shot's beginning: where what triggered was read late, the trigger is dated
    late. Without a number it is of a shot that was fired before the file was first seen and last written, and that has
    no such file; a shot that waited in vain, or that has a preview, is among them for `LATE_S`, until a later one has
    its file: what comes now may be its, late.

    Parameters
    ----------
    pattern
        Pattern of the source's file names, as `recoil_acquisition.files.shot_name.numbers_of` takes it.

    Raises
    ------
    ReadError
        If its number is that of a shot which has such a file already, waits no longer, or was fired after the file was
        last written.
    """
    fired = [
        s for s in shots if source in s.wanted | s.previewed and (s.window is None or s.window.start_s <= file.seen_s)
    ]
    waiting = [s for s in fired if s.takes(source)]
    numbers = numbers_of(file.path, pattern)
    named = [s for s in fired if s.name.isdecimal() and int(s.name) in numbers]
    if len(named) == 1:
        if named[0] in waiting and _written_after(file, named[0]):
            return Evidence((named[0],), by_number=True)
        if named[0] in waiting:
            raise ReadError(
                f"by its name it belongs to shot {named[0].name}, and it was last written before that was fired",
                path=file.path,
                remedy="give it the number of its own shot, or ingest by hand",
            )
        raise ReadError(
            f"by its name it belongs to shot {named[0].name}, which has a file of {source} or waits no longer",
            path=file.path,
            remedy="ingest that shot again with it, by hand",
        )
    if numbers and not named:
        words = " and ".join(str(number) for number in sorted(numbers))
        return Evidence((), why_none=f"the number {words} in its name is of no shot that was fired")
    with_file = [
        s.window.trigger_s for s in fired if source in s.files and source not in s.previews and s.window is not None
    ]
    last_s = max(with_file, default=float("-inf"))
    possible = [
        s
        for s in fired
        if source in {*s.missing, *s.previews}
        and s.window is not None
        and s.window.trigger_s <= file.seen_s
        and (not s.settled or (last_s < s.window.trigger_s and file.seen_s - s.window.trigger_s < LATE_S))
    ]
    written = [s for s in possible if _written_after(file, s)]
    if possible and not written:
        return Evidence((), why_none=f"it was last written before shot {possible[0].name} was fired")
    if not any(s.takes(source) for s in written):
        return Evidence((), why_none=f"no shot waits for a file of {source}")
    # named for several, or for none: whichever of them it is, nothing shows
    return Evidence(tuple(s for s in written if not named or s in named))


def _written_after(file: DroppedFile, shot: LiveShot) -> bool:
    """Return whether a file's time of writing allows it to be of a shot; unknown times allow everything."""
    if file.written_s is None or shot.window is None:
        return True
    return file.written_s >= shot.window.start_s - CLOCKS_APART_S


def doubt_of_files(shot: LiveShot, shots: Sequence[LiveShot]) -> str:
    """Say what speaks against the files that a converted shot was given by time alone; empty if nothing does.

    Their motion must fit the other sources', and their length those of the same source in the session's other shots.

    Parameters
    ----------
    shots
        All shots of the session.
    """
    if shot.document is None or not shot.by_time:
        return ""
    names = ", ".join(shot.files[source].name for source in sorted(shot.by_time))
    for check in shot.document["quality"]:
        if check["verdict"] == "fail" and check["check"] in _OF_THE_MOTION:
            return f"{names} was matched by time alone, and the motion does not fit ({check['check']})"
    own_s = _lengths_s(shot)
    for other in shots:
        for source, length_s in _lengths_s(other).items() if other is not shot else ():
            if source in other.previews:
                continue  # what is read live is as long as the shot, whatever its instrument records
            if source in shot.by_time and abs(own_s.get(source, length_s) - length_s) > _ANOTHER_LENGTH * length_s:
                return (
                    f"{shot.files[source].name} was matched by time alone, and is {own_s[source]:.3f} s long, "
                    f"{length_s:.3f} s that of shot {other.name}"
                )
    return ""


def _lengths_s(shot: LiveShot) -> dict[str, float]:
    """Return how long each source of a converted shot recorded."""
    channels = () if shot.document is None else shot.document.get("channels", ())
    return {c["clock"]: c["samples"] / c["rate_hz"] for c in channels if c["rate_hz"]}
