"""Header of an export of this project: the time base and the channels of one of its files.

The same JSON stands in the comment lines of the CSV and in the key-value metadata of the Parquet file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.readers.recording import SignalHeader

_REMEDY = "export the shot again"


@dataclass(frozen=True, eq=False)
class ExportedHeader:
    """Header of the file, before its samples.

    Attributes
    ----------
    signals
        Headers of the signals, with as many samples as the file promises.
    step_s
        Step of the time, s; None where instants are stamped.
    metadata
        All statements of the file.
    """

    path: Path
    signals: tuple[SignalHeader, ...]
    count: int
    start_s: float
    step_s: float | None
    absolute_start: AbsoluteStart | None
    metadata: Mapping[str, Any]

    def time_base(self, clock: str, times_s: NDArray[np.float64], place: str) -> TimeBase:
        """Return the time base of the rows that are there.

        Parameters
        ----------
        times_s : ndarray of float64, shape (n_rows,)
            Time column of the file, s.
        place
            Place of that column, for messages.

        Raises
        ------
        CorruptFileError
            If the column contradicts the declared spacing, or does not increase.
        """
        try:
            if self.step_s is None:
                return TimeBase.stamped(clock, times_s, self.absolute_start)
            base = TimeBase.uniform(clock, self.start_s, self.step_s, times_s.size, self.absolute_start)
        except ValueError as error:
            raise CorruptFileError(
                f"the time is not usable: {error}", path=self.path, place=place, remedy=_REMEDY
            ) from error
        wrong = np.flatnonzero(base.times_s != times_s)
        if wrong.size:
            row = int(wrong[0])
            raise CorruptFileError(
                "the time contradicts the declared spacing", path=self.path, place=f"{place}, sample {row}",
                expected=repr(float(base.times_s[row])), found=repr(float(times_s[row])), remedy=_REMEDY,
            )  # fmt: skip
        return base


def parse_json(text: str, path: Path, place: str) -> Any:
    """Read JSON; raises `CorruptFileError` if it is none."""
    try:
        return read_json(text)
    except (ValueError, RecursionError) as error:
        raise CorruptFileError("no JSON", path=path, place=place, found=repr(text[:40]), remedy=_REMEDY) from error


def exported_header(document: Any, path: Path, *, most: int) -> ExportedHeader:
    """Check what a file says about itself.

    Parameters
    ----------
    most
        Samples per channel that a file of this size can hold.

    Raises
    ------
    CorruptFileError
        If something is missing, of another type, or cannot be.
    """
    try:
        time, listed, said = document["time"], document["channels"], document.get("absolute_start")
        count, start_s, step_s = time["count"], time["start_s"], time["step_s"]
        start = None if said is None else AbsoluteStart(*(_text(said[key]) for key in ("text", "zone", "origin")))
        names = [_text(channel["name"]) for channel in listed]
        units = [_text(channel["unit"]) for channel in listed]
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise _wrong(path, f"{type(error).__name__}: {error}") from error
    if type(count) is not int or not 0 <= count <= most:
        raise _wrong(path, f"{count!r} samples in a file that can hold {most}")
    if not _number(start_s) or not (step_s is None or _number(step_s)):
        raise _wrong(path, f"a time of start {start_s!r} and step {step_s!r}")
    if not names or len(set(names)) < len(names):
        raise _wrong(path, "a channel that is listed twice" if names else "no channels")
    signals = tuple(
        SignalHeader(name, unit, count, "float64", dict(channel))
        for name, unit, channel in zip(names, units, listed, strict=True)
    )
    return ExportedHeader(path, signals, count, start_s, step_s, start, dict(document))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _number(value: Any) -> bool:
    # an integer may have more digits than float64 can hold
    return isinstance(value, float) and math.isfinite(value)


def _wrong(path: Path, found: str) -> CorruptFileError:
    return CorruptFileError(
        "what the file says about itself is damaged", path=path, place="metadata",
        expected="channels with names and units, and their time", found=found, remedy=_REMEDY,
    )  # fmt: skip
