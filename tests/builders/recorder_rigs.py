"""The bundled rig with its recorder alone, live: its channels by the names of the recorder, in the units of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin.oxygen_packets import ValueForm
from tests.builders.ramp_recorder import RampRecorder, ramp_content

UNITS = {
    "AI 1/acc_recoil": "m/s2",
    "AI 2/acc_carriage_x": "m/s2",
    "AI 3/acc_carriage_y": "m/s2",
    "AI 4/p_breech": "MPa",
}


def recorder_rig(device: Mapping[str, Any], changes: Mapping[str, str] | None = None) -> Rig:
    """Return the rig; a device stands for the recorder's, and texts of the rig file are replaced by others."""
    whole = load_rig("mixed")
    text = whole.text
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new)
    rig = parse_rig(text, whole.path, whole.databases)
    sources = tuple(
        one.model_copy(update={"device": dict(device) if one.name == "dewetron" else None}) for one in rig.sources
    )
    return replace(rig, sources=sources, trigger=None)


def ramps(units: Mapping[str, str] = UNITS, *, rate_hz: float = 2000.0, form: ValueForm = "i24") -> RampRecorder:
    """Return a recorder of these channels, which sends packets of 10 ms."""
    return RampRecorder("dewetron", ramp_content(units, rate_hz, form, 0.01))
