"""Peaks, time and impulse that the virtual rig fired, by the names of a report's peaks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from recoil_identification.shot.identified import Identification
from recoil_rigs.rig import Rig
from recoil_rigs.twin import draw_scene
from recoil_rigs.twin.instruments import truth


def fired_quantities(found: Identification, rig: Rig, seed: int, shot: str) -> Mapping[str, float]:
    """Return what the virtual rig fired, by the names of the peaks, of the interval that was found."""
    scene = draw_scene(rig, seed, shot)
    mechanism, moved = scene.mechanism, scene.motion
    times_s, step_s = moved.times_s, float(moved.times_s[1] - moved.times_s[0])
    t0, t1 = found.route.recorded.interval_s
    inside = (times_s >= t0) & (times_s <= t1)
    felt = truth("recoil_acceleration", mechanism, moved, (0.0, 0.0)) - mechanism.at_rest["recoil_acceleration"]
    filtered = found.route.filtered.low_pass.apply(felt, 1.0 / step_s)
    let_go = times_s[np.flatnonzero(moved.qd[:, 4] > 1e-4)[0]]
    drives_n = mechanism.force_areas[0] * moved.breech_pressure_pa - (
        moved.breech_drag_n if moved.breech_drag_n.size else 0.0
    )
    return {
        "breech_pressure_pa": float(moved.breech_pressure_pa[inside].max()),
        "brake_pressure_pa": float(moved.brake_pressure_pa[inside].max()),
        "recuperator_pressure_pa": float(moved.recuperator_pressure_pa[inside].max()),
        "recoil_acceleration_m_s2": float(np.abs(filtered[inside]).max()),
        "recoil_velocity_m_s": float(moved.qd[inside, 4].max()),
        "recoil_travel_m": float(moved.q[:, 4].max() - moved.q[0, 4]),
        "recoil_time_s": moved.t_end_s - float(let_go),
        "impulse_n_s": float(drives_n[inside].sum()) * step_s,
    }
