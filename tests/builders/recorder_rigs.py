"""The bundled rig with its recorder live: alone, or beside all else, with the trigger on its breech pressure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin.oxygen_packets import ValueForm
from tests.builders.live_rigs import inline
from tests.builders.ramp_recorder import RampRecorder, ramp_content

LEVEL_PA = 5e6
FILES = 'match = "*_dewetron.csv"'
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


def with_recorder(rig: Rig, *, file: bool = True, **device: Any) -> Rig:
    """Have a rig's recorder played.

    Parameters
    ----------
    file
        Whether it hands its own file over as well: without, its files match no source, and nobody drops them.
    **device
        Further keys of its ``device`` table.
    """
    table = inline({"virtual": "oxygen", **device})
    text = _replaced(rig.text, FILES, f"device = {table}" + (f"\n{FILES}" if file else ""))
    head, trigger, tail = text.partition("[[trigger.any]]")
    tail = _replaced(tail, 'channel = "p_brake"', 'channel = "p_breech"')
    tail = _replaced(tail, "level = 1.5e6", f"level = {LEVEL_PA}")
    tail = _replaced(tail, "rearm = 1.0e6", f"rearm = {LEVEL_PA / 2}")
    return parse_rig(head + trigger + tail, rig.path, rig.databases)


def _replaced(text: str, old: str, new: str) -> str:
    if text.count(old) != 1:
        raise ValueError(f"the bundled rig has {old!r} {text.count(old)} times")
    return text.replace(old, new)
