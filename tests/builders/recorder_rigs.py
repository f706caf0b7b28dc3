"""The bundled rig `mixed` with its recorder live as well, and the trigger on its breech pressure."""

from __future__ import annotations

from typing import Any

from recoil_rigs.rig import Rig, parse_rig
from tests.builders.live_rigs import inline

LEVEL_PA = 5e6
FILES = 'match = "*_dewetron.csv"'


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
