"""Shots of the bundled rigs whose camera stands on the ground, hard or soft."""

from __future__ import annotations

import datetime as dt
import tempfile
from pathlib import Path

from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.shared_motions import made_once
from tests.builders.tracked_rigs import tracked_rig
from tests.builders.virtual_shots import SHORTER, VirtualShot, with_twin

SOFT = {"ground_stiffness_n_m": 3e6, "ground_damping_n_s_m": 6e4}
"""Ground on which the carriage moves by centimetres."""


def seeing(rig: Rig, sees: str | None) -> Rig:
    """Let a rig's file say what its camera sees; nothing where it is None."""
    if sees is None:
        return rig
    return parse_rig(rig.text.replace('kind = "camera"', f'kind = "camera"\nsees = "{sees}"', 1), rig.path)


@made_once
def ground_shot(
    name: str = "field-2013",
    seed: int = 3,
    *,
    soft: bool = True,
    sees: str | None = "ground",
    stands: str = "ground",
    accelerometer: bool = True,
) -> VirtualShot:
    """Simulate and ingest a shot, as the rig draws it, in a shorter record than the rig's own; a few seconds, once.

    Parameters
    ----------
    soft
        Whether the ground gives way.
    sees
        What the rig file says that its camera sees; None where it says nothing.
    stands
        What the camera sees.
    accelerometer
        Whether one rides on the recoiling part; the clock is found by the forces if not.
    """
    plain = with_twin(name, kind=False, **SHORTER) if accelerometer else tracked_rig(name, **SHORTER)
    rig = seeing(plain, sees)
    fired = with_settings(seeing(plain, stands), SOFT if soft else {})
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(fired, Path(folder) / "files", seed=seed, shot="s1")
        ingested = ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=dt.date(2026, 6, 1))
    return VirtualShot(rig, ingested.shot, simulated.truth)
