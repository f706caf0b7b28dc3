"""Differences between an instrument's own file and what was read of it live."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_daq.terminal.engineering import engineering

ALIKE = 0.01
"""Share of a channel's largest sample by which its extremes in the file and in the preview may differ."""


def differences(preview: Mapping[str, Any], whole: Mapping[str, Any], units: UnitChoice = SI) -> tuple[str, ...]:
    """Compare the channels of two documents of ``ingest --json``; return a sentence for each that differs.

    Parameters
    ----------
    preview
        Document of the shot as it was read live.
    whole
        Document of the same shot with the instrument's own file.
    units
        Units in which people read them.
    """
    before = {one["name"]: one for one in preview.get("channels", ())}
    found = []
    for channel in whole.get("channels", ()):
        name, unit = channel["name"], channel.get("unit", "")
        old, new = ([one.get("low"), one.get("high")] for one in (before.get(name, {}), channel))
        if None in (*old, *new):
            continue
        largest = max(map(abs, new))
        if max(abs(a - b) for a, b in zip(old, new, strict=True)) > ALIKE * largest:
            factor, shown = units.factor(unit)
            ranges = [" .. ".join(engineering(factor * end, shown) for end in ends) for ends in (new, old)]
            found.append(f"{name} is {ranges[0]}, not {ranges[1]}")
    return tuple(found)
