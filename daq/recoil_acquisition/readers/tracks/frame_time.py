"""The frame numbers, the frame rate and the time zero of a tracking export."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, NoFrameRateError, ReadError
from recoil_acquisition.readers.row_counter import whole
from recoil_acquisition.readers.text.text_table import TextBlock, printed_decimals
from recoil_acquisition.readers.time.printed_time import SLACK_S, start_agreeing, uniform_from_printed
from recoil_acquisition.readers.time.time_units import MOST_S, TIME_UNITS_S
from recoil_acquisition.readers.tracks.columns import Column, increasing_whole
from recoil_acquisition.remark import Note, NoteCode, Remark

MOST_FRAMES = 1e12
"""Frames that no camera counts; from here on instants by number and rate lose their digits."""
CONTRADICTION = 0.001
"""Relative difference of declared and recorded frame rate above which they contradict each other."""

NO_NUMBERS = (
    "the file has neither frame numbers nor time: rows are counted as frames, and a missing frame cannot be seen; if a"
    " column holds them, name it by `frame_column` or `time_column` in the source's `layout`"
)


@dataclass(frozen=True, eq=False)
class FrameClock:
    """Instants of the frames of a tracking export: ``start_s + numbers / rate_hz``.

    Attributes
    ----------
    numbers : ndarray of int64, shape (n_frames,)
        Numbers of the frames, strictly increasing.
    start_s
        Time of frame number 0 as the file's time column has it; 0 without one.
    """

    numbers: NDArray[np.int64]
    rate_hz: float
    start_s: float
    notes: tuple[Remark, ...]

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Instants of the frames, shape (n_frames,)."""
        return self.start_s + self.numbers / self.rate_hz


def frame_clock(
    block: TextBlock, values: NDArray[np.float64], columns: Sequence[Column], declared_hz: float | None
) -> FrameClock:
    """Find when the frames of a tracking export were.

    Parameters
    ----------
    block
        Block of the numbers as printed.
    values : ndarray of float64, shape (n_frames, n_columns)
    declared_hz
        Frame rate that the rig declares, Hz; None if it declares none.

    Raises
    ------
    ReadError
        If there is neither a time column in a known unit nor a declared rate.
    CorruptFileError
        If frame numbers or times are missing or do not increase.
    """
    at = {column.kind: i for i, column in reversed(list(enumerate(columns)))}
    _refuse_other_times(block, values, columns)
    numbers = _frame_numbers(block, values[:, at["frame"]], columns[at["frame"]]) if "frame" in at else None
    if "time" in at:
        clock = _clock_from_time(block, values[:, at["time"]], columns, at["time"], numbers, declared_hz)
        return replace(clock, notes=(*clock.notes, *_missing(clock.numbers)))
    if numbers is None:
        clock = counted_clock(np.arange(len(values), dtype=np.int64), declared_hz, block.file.path)
        return replace(clock, notes=(Note(NoteCode.UNSEEN, None, NO_NUMBERS),))
    return counted_clock(numbers, declared_hz, block.file.path)


def _refuse_other_times(block: TextBlock, values: NDArray[np.float64], columns: Sequence[Column]) -> None:
    """Refuse several columns of time that differ: which of them the positions were seen at is not stated."""
    first, *others = [i for i, column in enumerate(columns) if column.kind == "time"] or [0]
    for i in others:
        units = [TIME_UNITS_S.get(columns[k].unit.casefold() or "s", np.nan) for k in (first, i)]
        resolution_s = max(
            unit * 10.0 ** -printed_decimals(block, k) for unit, k in zip(units, (first, i), strict=True)
        )
        off = np.abs(values[:, i] * units[1] - values[:, first] * units[0])
        if not (off <= resolution_s + SLACK_S).all():
            row = int(np.argmax(~(off <= resolution_s + SLACK_S)))
            raise ReadError(
                "several columns of time differ, and which one the positions were seen at is not stated",
                path=block.file.path, place=block.place(row, columns[i].name),
                expected=f"{values[row, first]:g} {columns[first].unit}".strip(),
                found=f"{values[row, i]:g} {columns[i].unit}".strip(), remedy="export one column of time",
            )  # fmt: skip


def counted_clock(numbers: NDArray[np.int64], declared_hz: float | None, path: Path) -> FrameClock:
    """Return when frames were whose file has their numbers and no time.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n_frames,)
        Numbers of the frames, strictly increasing.
    declared_hz
        Frame rate that the rig declares, Hz; None if it declares none.
    path
        File, for the message.

    Raises
    ------
    NoFrameRateError
        If no frame rate is declared.
    """
    if declared_hz is None:
        raise NoFrameRateError(
            "the frame rate is unknown: the file has no column of times in a unit of time",
            path=path,
            remedy="declare `frame_rate` (Hz) of this source in the rig file, or `time_column` in its `layout`",
        )
    return FrameClock(numbers, declared_hz, 0.0, _missing(numbers))


def _missing(numbers: NDArray[np.int64]) -> tuple[Remark, ...]:
    """Return a note if numbers between the first and the last frame are missing."""
    if not numbers.size:
        return ()
    first, last = int(numbers[0]), int(numbers[-1])
    missing = last - first + 1 - numbers.size
    text = f"missing frames (numbers between {first} and {last} that are not in the file): {missing}"
    return (Note(NoteCode.LOST, None, text),) if missing else ()


def _frame_numbers(block: TextBlock, numbers: NDArray[np.float64], column: Column) -> NDArray[np.int64]:
    if increasing_whole(numbers):
        if not np.abs(numbers).max(initial=0.0) < MOST_FRAMES:
            row = int(np.argmax(np.abs(numbers)))
            raise CorruptFileError(
                "the frame number is larger than any camera counts", path=block.file.path,
                place=block.place(row, column.name), expected=f"less than {MOST_FRAMES:g}", found=f"{numbers[row]:g}",
                remedy="name the column of frames in `[source.layout]`, or leave it out of the export",
            )  # fmt: skip
        return numbers.astype(np.int64)
    row = int(np.flatnonzero(~(whole(numbers) & np.r_[True, np.diff(numbers) > 0]))[0])
    raise CorruptFileError(
        "the frame number is not a whole number larger than the one before",
        path=block.file.path,
        place=block.place(row, column.name),
        found=f"{numbers[row]:g}",
        remedy="export one clip per file",
    )


def _clock_from_time(
    block: TextBlock,
    printed: NDArray[np.float64],
    columns: Sequence[Column],
    at: int,
    numbers: NDArray[np.int64] | None,
    declared_hz: float | None,
) -> FrameClock:
    """Find the frame rate from the time column, and compare it with the declared one."""
    heading, path = columns[at], block.file.path
    if np.isnan(printed).any():
        row = int(np.flatnonzero(np.isnan(printed))[0])
        raise CorruptFileError("the time is missing", path=path, place=block.place(row, heading.name))
    unit = heading.unit.casefold()
    if unit not in (*TIME_UNITS_S, ""):
        known = ", ".join(TIME_UNITS_S)
        raise ReadError("the unit of the time column is unknown", path=path, expected=known, found=repr(heading.unit))
    factor = TIME_UNITS_S[unit or "s"]
    notes: tuple[Remark, ...] = ()
    if not unit:
        notes = (Note(NoteCode.TIME, None, "the time column states no unit: it was read in seconds"),)
    if not unit and declared_hz is not None:
        unit = _unit_by_rate(printed, numbers, declared_hz)
        if unit:
            factor = TIME_UNITS_S[unit]
            text = f"the time column states no unit: it was read in {unit}, as the declared {declared_hz:g} Hz has it"
            notes = (Note(NoteCode.TIME, None, text),)
    times_s = printed * factor
    if not np.abs(times_s).max(initial=0.0) < MOST_S:
        row = int(np.argmax(np.abs(times_s)))
        raise CorruptFileError(
            "the time is longer than any recording", path=path, place=block.place(row, heading.name),
            expected=f"less than {MOST_S:g} s", found=f"{times_s[row]:g} s", remedy="export it again",
        )  # fmt: skip
    backwards = np.flatnonzero(np.diff(times_s) < 0)
    if backwards.size or times_s.size < 2 or times_s[-1] == times_s[0]:
        row = int(backwards[0]) + 1 if backwards.size else 0
        place = block.place(row, heading.name)
        raise CorruptFileError("time does not increase", path=path, place=place, remedy="export one clip per file")
    if numbers is None:
        numbers = _numbers_from(times_s)
    resolution_s = factor * 10.0 ** -printed_decimals(block, at)
    if declared_hz is not None:
        start_s = start_agreeing(times_s, 1.0 / declared_hz, resolution_s, numbers)
        if start_s is not None:
            return FrameClock(numbers, declared_hz, start_s, notes)
    uniform = uniform_from_printed(times_s, resolution_s, numbers)
    if uniform is None:
        uniform, note = _robust_line(times_s, numbers, resolution_s)
        notes += (note,)
    rate_hz = 1.0 / uniform[1]
    if declared_hz is not None:
        notes += (_contradiction(rate_hz, declared_hz),)
    return FrameClock(numbers, rate_hz, uniform[0], notes)


def _unit_by_rate(printed: NDArray[np.float64], numbers: NDArray[np.int64] | None, declared_hz: float) -> str:
    """Return the unit other than seconds in which times have the declared frame rate; empty if there is none."""
    between = 1.0 if numbers is None else float(np.median(np.diff(numbers))) if numbers.size > 1 else np.nan
    steps = np.diff(printed)
    step = float(np.median(steps)) / between if steps.size else np.nan
    return next(
        (unit for unit in ("ms", "us") if abs(step * TIME_UNITS_S[unit] * declared_hz - 1.0) < CONTRADICTION), ""
    )


def _numbers_from(times_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return frame numbers by time where the file has none: a long step is a gap."""
    steps = np.diff(times_s)
    typical = float(np.median(steps))
    if not typical > 0 or steps.max() / typical > 1e9:
        return np.arange(times_s.size, dtype=np.int64)
    numbers = np.r_[0, np.round(steps / typical).cumsum()].astype(np.int64)
    return numbers if (np.diff(numbers) > 0).all() else np.arange(times_s.size, dtype=np.int64)


def _robust_line(
    times_s: NDArray[np.float64], numbers: NDArray[np.int64], resolution_s: float
) -> tuple[tuple[float, float], Remark]:
    """Fit start and step to the rows that agree with the median slope; say how many rows disagree."""
    half = times_s.size // 2
    slopes = (times_s[-half:] - times_s[:half]) / (numbers[-half:] - numbers[:half])
    step_s = float(np.median(slopes[slopes > 0]))
    residuals = times_s - step_s * numbers
    sound = np.abs(residuals - np.median(residuals)) <= resolution_s + SLACK_S
    start_s, step_s = uniform_from_printed(times_s[sound], resolution_s, numbers[sound]) or (
        float(np.median(residuals)),
        step_s,
    )
    residuals = times_s - step_s * numbers
    off = int((np.abs(residuals - start_s) > 0.5 * resolution_s + SLACK_S).sum())
    disagree = f"the printed time of {off} frames disagrees with their numbers at {1 / step_s:.6g} Hz"
    return (start_s, step_s), Note(NoteCode.CONTRADICTION, None, f"{disagree}: time is from the numbers")


def _contradiction(rate_hz: float, declared_hz: float) -> Remark:
    contradicts = abs(declared_hz / rate_hz - 1) > CONTRADICTION
    verb, hint = ("contradicts", " (a playback rate?)") if contradicts else ("differs from", "")
    own = f"the file's own frame rate of {rate_hz:.8g} Hz"
    text = f"{own} {verb} the declared {declared_hz:g} Hz{hint}: the file's was taken"
    return Note(NoteCode.CONTRADICTION, None, text)
