"""The virtual rig's shots, one folder each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from recoil_rigs.rig import Rig
from recoil_rigs.twin import TwinShot, simulate_shot

Progress = Callable[[str], None]


def simulate_shots(
    rig: Rig, out: Path, *, seed: int, shots: int, progress: Progress = lambda _: None
) -> tuple[TwinShot, ...]:
    """Fire the virtual rig.

    Parameters
    ----------
    rig : Rig
    out : Path
        Gets a folder ``0001``, ``0002``, ... per shot.
    seed : int
        Shot k is that of seed ``seed + k - 1``, so that one shot can be fired again alone.
    shots : int
    progress : callable
        Told the name of each step.

    Raises
    ------
    StoreError
        If a file exists already or cannot be written.
    RigError
        If the rig lacks what a simulation needs.
    """
    done = []
    for k in range(shots):
        name = f"{k + 1:04d}"
        progress(f"shot {k + 1} of {shots}")
        done.append(simulate_shot(rig, out / name, seed=seed + k, shot=name))
    return tuple(done)
