"""Bundled rigs whose recoiling part carries no accelerometer: a camera tracks it, and gauges tell the forces."""

from __future__ import annotations

import datetime as dt
import re
import tempfile
from pathlib import Path

from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.shared_motions import made_once
from tests.builders.virtual_shots import SHORTER, VirtualShot, with_twin

RECOIL_ACCELEROMETERS = ("acc_recoil", "acc_recoil_can")


def without_channel(text: str, name: str) -> str:
    """Take the table of a channel out of a rig's text."""
    head, *tables = re.split(r"(?=^\[\[channel\]\]\n)", text, flags=re.MULTILINE)
    kept = []
    for table in tables:
        if f'name = "{name}"' not in table:
            kept.append(table)
        elif "\n# ----" in table:
            # what follows the last channel is no part of it
            kept.append(table[table.index("\n# ----") :])
    return "".join([head, *kept])


def tracked_rig(name: str, **settings: float | bool | str) -> Rig:
    """Load a bundled rig without its recoil accelerometer, its camera aligned by the forces.

    On the rig ``mixed`` the bus repeats the carriage's acceleration, in the signal that is free then.
    """
    kind = with_twin(name)
    text = kind.text
    text = without_channel(text, "acc_recoil")
    text = text.replace('method = "motion", against = "acc_recoil"', 'method = "motion", against = "p_breech"')
    text = text.replace(
        'channel = "acc_recoil_can", against = "acc_recoil"', 'channel = "acc_carriage_can", against = "acc_carriage_x"'
    )
    text = text.replace('name = "acc_recoil_can"', 'name = "acc_carriage_can"')
    text = text.replace("range = [-5000.0, 5000.0], filter_hz = 800.0", "range = [-200.0, 200.0], filter_hz = 800.0")
    text = text.replace("delay_s = 0.00042, position = [-0.30, 0.06]", "delay_s = 0.00042, position = [0.05, -0.10]")
    head, _, tail = text.partition("[twin]\n")
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {
        key: f"{key} = {value if isinstance(value, str) else str(value).lower()}" for key, value in settings.items()
    }
    return parse_rig("\n".join([f"{head}[twin]", *lines.values(), ""]), kind.path)


@made_once
def tracked_shot(name: str = "field-2013", seed: int = 3, **settings: float | bool | str) -> VirtualShot:
    """Simulate and ingest a shot of such a rig, in a shorter record than the rig's own; a few seconds, once."""
    rig = tracked_rig(name, **SHORTER | settings)
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=seed, shot="s1")
        ingested = ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=dt.date(2026, 6, 1))
    return VirtualShot(rig, ingested.shot, simulated.truth)
