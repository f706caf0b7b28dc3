"""In what two shots differ."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot import ClockAlignment, Shot
from recoil_acquisition.store.table import json_text


def first_difference(one: Shot, other: Shot) -> str | None:
    """Name the first value in which two shots differ, samples compared bit for bit; None if there is none."""
    for name in (
        "name",
        "rig_name",
        "rig_text",
        "reference_clock",
        "inputs",
        "quality",
        "started",
        "started_source",
        "acquisition",
    ):
        if getattr(one, name) != getattr(other, name):
            return name
    if (one.databases is None) != (other.databases is None) or dict(one.databases or {}) != dict(other.databases or {}):
        return "databases"
    if [reason.to_json() for reason in one.against_mass] != [reason.to_json() for reason in other.against_mass]:
        return "against_mass"
    if _clock_fits(one) != _clock_fits(other):
        return "clock_fits"
    if _history(one) != _history(other):
        return "history"
    if [_alignment(a) for a in one.alignments] != [_alignment(a) for a in other.alignments]:
        return "alignments"
    if list(one.channels) != list(other.channels):
        return "names of the channels"
    for name, channel in one.channels.items():
        difference = _difference_of_channels(channel, other.channels[name])
        if difference is not None:
            return f"{difference} of channel {name!r}"
    return None


def _difference_of_channels(one: Channel, other: Channel) -> str | None:
    if not _same_bits(one.samples, other.samples):
        return "samples"
    if not one.time_base.is_identical(other.time_base):
        return "time base"
    if (one.raw is None) != (other.raw is None):
        return "raw counts"
    if one.raw is not None and other.raw is not None:
        same_scale = (one.raw.gain, one.raw.offset, one.raw.unit) == (other.raw.gain, other.raw.offset, other.raw.unit)
        if not same_scale or not _same_bits(one.raw.counts, other.raw.counts):
            return "raw counts"
    for name in ("quantity", "signal", "role", "u_rel", "resolution"):
        if getattr(one, name) != getattr(other, name):
            return name
    return None if _history(one) == _history(other) else "history"


def _same_bits(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Compare arrays bit for bit: NaN equals itself, and 0.0 does not equal -0.0."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    bits = f"u{one.dtype.itemsize}"
    return bool(np.array_equal(np.ascontiguousarray(one).view(bits), np.ascontiguousarray(other).view(bits)))


def _history(value: Shot | Channel) -> list[tuple[str, str, str]]:
    return [(step.what, step.version, json_text(step.parameters)) for step in value.history]


def _clock_fits(shot: Shot) -> list[tuple[str, str]]:
    return [(clock, json_text(fit)) for clock, fit in shot.clock_fits.items()]


def _alignment(alignment: ClockAlignment) -> tuple[Any, ...]:
    # Numbers as text, because an uncertainty that is NaN must equal itself
    numbers = json_text(
        [float(number) for number in (alignment.offset_s, alignment.u_offset_s, alignment.drift, alignment.u_drift)]
    )
    details = None if alignment.details is None else json_text(alignment.details)
    return alignment.clock, numbers, alignment.status, alignment.method, alignment.reasons, details
