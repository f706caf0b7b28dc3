"""A stand with load cells: the bundled field rig with the ground's forces and the elevating gear's moment measured."""

from __future__ import annotations

import datetime as dt
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import draw_scene, simulate_shot
from recoil_rigs.twin.sources import Scene
from tests.builders.shared_motions import made_once
from tests.builders.virtual_shots import with_twin

CELLS = {
    "ground_force_x": ("force", "kN", 100.0),
    "ground_force_y": ("force", "kN", 60.0),
    "ground_force_d": ("force", "kN", 60.0),
    "ground_friction_d": ("force", "kN", 20.0),
    "elevating_moment": ("torque", "kN*m", 20.0),
}
"""Role -> quantity, unit of the file, full scale in it."""


def rig_with_load_cells(
    roles: Sequence[str] = tuple(CELLS), *, u_rel: float = 0.002, base: str = "field-2013", **settings: object
) -> Rig:
    """Add load cells on the recorder to a bundled rig.

    Parameters
    ----------
    roles : sequence of str
        Which of `CELLS` there are.
    u_rel : float
        Relative standard uncertainty of each cell.
    base : str
    **settings
        Of the virtual rig, in the place of those of the file.
    """
    kind = with_twin(base)
    # what ten combinations need of the breech gauge is a certificate of pulses
    dynamic = kind.text.replace('serial = "V301",', 'serial = "V301", calibration = "dynamic",')
    head, _, tail = dynamic.partition("[twin]\n")
    cells = [
        f'[[channel]]\nname = "{role}"\nsource = "dewetron"\nsignal = "AI {20 + i}/{role}"\n'
        f'quantity = "{CELLS[role][0]}"\nunit = "{CELLS[role][1]}"\nrole = "{role}"\n'
        f'sensor = {{ model = "virtual load cell", u_rel = {u_rel}, range = [{-CELLS[role][2]}, {CELLS[role][2]}] }}\n'
        for i, role in enumerate(roles)
    ]
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {key: f"{key} = {str(value).lower()}" for key, value in settings.items()}
    return parse_rig("\n".join([head, *cells, "[twin]", *lines.values(), ""]), kind.path)


@dataclass(frozen=True, eq=False)
class WeighedShot:
    """A simulated shot with load cells, its rig, and what truly happened."""

    rig: Rig
    shot: Shot
    scene: Scene


@made_once
def weighed_shot(seed: int = 5, base: str = "field-2013", **settings: float | bool) -> WeighedShot:
    """Simulate and ingest a shot with all load cells, in a shorter record than the rig's own; once in a run."""
    rig = rig_with_load_cells(base=base, **{"sample_rate_hz": 25e3, "duration_s": 0.35} | settings)
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=seed, shot="s1")
        ingested = ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=dt.date(2026, 6, 1))
    return WeighedShot(rig, ingested.shot, draw_scene(rig, seed, "s1"))
