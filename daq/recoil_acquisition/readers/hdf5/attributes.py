"""Attributes of an HDF5 file's channels, in the spellings in use.

No standard fixes them. Names are compared without case and without signs, so that ``Sample rate``,
``sample_rate`` and ``SampleRate`` are one; which attribute was used is noted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.readers.hdf5.walk import LARGEST_ATTRIBUTE
from recoil_acquisition.readers.statements import folded
from recoil_acquisition.readers.time.wall_clock import DateOrder, parse_wall_clock

UNIT = frozenset({"unit", "units", "unitstring", "yunit", "physicalunit", "engineeringunit"})
START = frozenset(
    {"starttime", "startdatetime", "wfstarttime", "recordingstart", "absolutestart", "startstoretime"}
    | {"startmeasuretime", "datetime", "t0"}
)
SCALES = {"scalefactor": "addoffset", "conversion": "offset"}
"""Names of a factor and of what is added behind it: netCDF's and HDF5 dimension scales', and NWB's."""
LOST = frozenset({"fillvalue", "missingvalue"})


def plain_attributes(item: Any, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the attributes of a group or dataset as JSON types, long ones and references left out.

    Parameters
    ----------
    names
        Names of the attributes that are wanted; None for all.
    """
    plain: dict[str, Any] = {}
    for name in item.attrs if names is None else [name for name in names if name in item.attrs]:
        value = item.attrs.get_id(name)
        if value.get_storage_size() > LARGEST_ATTRIBUTE:
            continue
        value = item.attrs[name]
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.reshape(-1)[0]
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            plain[name] = value.tolist()
        elif isinstance(value, np.generic) and value.dtype.kind in "fiub":
            plain[name] = value.item()
        elif isinstance(value, bytes):
            plain[name] = value.decode("utf-8", "replace")
        elif isinstance(value, str):
            plain[name] = value
    return {name: value for name, value in plain.items() if not _is_unsound(value)}


def _is_unsound(value: Any) -> bool:
    # Surrogates cannot be written as JSON text in UTF-8
    return isinstance(value, str) and any("\ud800" <= c <= "\udfff" for c in value)


@dataclass(frozen=True)
class Found:
    """An attribute that was found: its own spelling, its value."""

    name: str
    value: Any


@dataclass(frozen=True)
class Scaling:
    """Line by which a dataset's attributes scale its numbers: ``gain * stored + zero``.

    Attributes
    ----------
    used
        Names of the attributes that state it.
    """

    gain: float
    zero: float
    used: frozenset[str]

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> Scaling:
        """Find what scales a dataset; a factor of 0 is none."""
        found = [(find_number(attributes, frozenset({name})), shift) for name, shift in SCALES.items()]
        scales = [
            (scale, find_number(attributes, frozenset({shift}))) for scale, shift in found if scale and scale.value
        ]
        shift = find_number(attributes, frozenset({"addoffset"})) if not scales else scales[0][1]
        used = frozenset(one.name for one in (scales[0][0] if scales else None, shift) if one is not None)
        return cls(float(scales[0][0].value) if scales else 1.0, float(shift.value) if shift else 0.0, used)


def find(attributes: Mapping[str, Any], names: frozenset[str]) -> Found | None:
    """Find the first attribute with one of the folded names."""
    return next((Found(n, v) for n, v in attributes.items() if folded(n) in names), None)


def find_number(attributes: Mapping[str, Any], names: frozenset[str]) -> Found | None:
    """Find the first attribute with one of the folded names that is a finite number, or a text of one."""
    for name, value in attributes.items():
        if folded(name) not in names or isinstance(value, (bool, list)):
            continue
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        if np.isfinite(number):
            return Found(name, number)
    return None


def lost_numbers(attributes: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return the numbers that stand for a lost sample, by the attributes that state them."""
    found = {}
    for name, value in attributes.items():
        if folded(name) not in LOST or isinstance(value, bool):
            continue
        numbers = value if isinstance(value, list) else [value]
        try:
            found[name] = [float(number) for number in numbers]
        except (TypeError, ValueError):
            continue
    return found


def find_start(attributes: Mapping[str, Any]) -> tuple[str, datetime] | None:
    """Find an absolute start, a text of a date and a time: its attribute and the instant, with a zone if it has one."""
    for name, value in attributes.items():
        if folded(name) in START and isinstance(value, str):
            try:
                return name, datetime.fromisoformat(value.strip())
            except ValueError:
                instant = _instant(value)
            if instant is not None:
                return name, instant
    return None


def _instant(text: str) -> datetime | None:
    try:
        stamp = parse_wall_clock(text)
    except ValueError:
        return None
    return None if stamp.order is DateOrder.OPEN else AbsoluteStart(stamp.text, stamp.zone, "").moment
