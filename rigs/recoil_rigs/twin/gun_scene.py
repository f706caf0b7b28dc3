"""A shot of a virtual gun: what is drawn of it, how it recoils, and what its files hide."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from recoil_acquisition.errors import Fault, FaultCode, RigError
from recoil_rigs.mechanism.beam import shapes
from recoil_rigs.rig import Rig
from recoil_rigs.twin.breech_chain import with_breech_chain
from recoil_rigs.twin.campaign import PlannedShot
from recoil_rigs.twin.draws import draw_forces, draw_noise
from recoil_rigs.twin.instruments import generator, stress_waves
from recoil_rigs.twin.loads import check_statics
from recoil_rigs.twin.motion import Motion, simulate_motion, tube_of
from recoil_rigs.twin.recorder_settings import measured_roles
from recoil_rigs.twin.settings import TwinSettings, read_settings
from recoil_rigs.twin.sources import Scene

LARGEST_BORE_FRICTION = 0.5
"""Largest bore friction that is drawn, share of the breech force."""


def draw_gun_scene(
    rig: Rig, seed: int, shot: str, campaign_seed: int | None = None, planned: PlannedShot | None = None
) -> Scene:
    """Draw what this shot's gun truly is, and let it recoil; parameters as of `recoil_rigs.twin.simulate_shot`.

    Raises
    ------
    RigError
        If it cannot be simulated.
    """
    settings = with_breech_chain(rig, read_settings(rig), seed if campaign_seed is None else campaign_seed)
    m3_kg, charge, friction_factor = settings.m3_true or rig.mechanism.m3, 1.0, 1.0
    unread = draw_forces(dataclasses.replace(rig.mechanism, m3=m3_kg), settings, seed, campaign_seed)
    noise = draw_noise(settings, seed, campaign_seed)
    settings = settings.model_copy(update={"unread": unread.forces, "readings": noise.readings})
    if planned is not None:
        m3_kg, charge, friction_factor = planned.m3_kg(m3_kg), planned.charge, planned.friction_factor
    mechanism = dataclasses.replace(rig.mechanism, m3=m3_kg)
    faults = check_statics(mechanism, settings)
    if faults:
        raise RigError(rig.path, faults)
    rng = generator(seed, "shot")
    peak_scatter, friction_error = rng.normal(0.0, 1.0, 2)
    if campaign_seed is not None:
        friction_error = generator(campaign_seed, "friction").normal()
    friction = mechanism.friction + settings.friction_error * mechanism.u.get("friction", 0.0) * float(friction_error)
    u_bore = settings.friction_error * mechanism.u.get("bore_friction", 0.0)
    if u_bore:
        drawn = generator(seed if campaign_seed is None else campaign_seed, "bore friction").normal()
        in_bore = min(max(mechanism.bore_friction + u_bore * float(drawn), 0.0), LARGEST_BORE_FRICTION)
        mechanism = dataclasses.replace(mechanism, bore_friction=in_bore)
    motion = simulate_motion(
        mechanism,
        settings,
        peak_pressure_pa=charge * settings.peak_pressure_pa * (1.0 + settings.shot_to_shot * float(peak_scatter)),
        friction_n=max(friction_factor * friction, 0.0),
    )
    if not motion.t_end_s <= settings.duration_s:
        problem = f"the recoil does not end within {settings.duration_s} s; it has come {motion.q[-1, 4]:.3f} m"
        raise RigError(rig.path, [Fault(("twin", "duration_s"), problem, FaultCode.CONTRADICTION)])
    if motion.released_kg and not motion.t_release_s < motion.t_end_s:
        ends = motion.t_end_s - motion.t_fire_s
        problem = f"the recoil ends {ends:.4f} s after it begins"
        raise RigError(rig.path, [Fault(("twin", "release_after_s"), problem, FaultCode.CONTRADICTION)])
    modes = stress_waves(motion.times_s, motion.t_fire_s, motion.t_end_s, generator(seed, "stress waves"))
    roles = measured_roles(rig, settings)
    return Scene(
        rig, settings, mechanism, motion, modes, roles, seed, shot, campaign_seed, planned, unread.truth, noise.truth
    )


def gun_truth(scene: Scene, motion: Motion) -> dict[str, Any]:
    """Return what the truth says of the forces and the recoil of a gun alone."""
    return {
        "friction": float(motion.friction_n.max()),
        "bore_friction": scene.mechanism.bore_friction,
        "t_fire": motion.t_fire_s,
        "t_end": motion.t_end_s,
        "stroke_m": float(motion.q[:, 4].max()),
        "peak_breech_force_n": float(scene.mechanism.force_areas[0] * motion.breech_pressure_pa.max()),
    }


def gun_parts(scene: Scene, motion: Motion) -> dict[str, Any]:
    """Return what the truth says of a part that lets go, and of a flexible tube."""
    truth: dict[str, Any] = {}
    if motion.released_kg:
        truth["m3_after"] = scene.mechanism.m3 - motion.released_kg
        truth["t_release"] = motion.t_release_s
    settings = scene.settings
    tube = tube_of(scene.mechanism, settings) if isinstance(settings, TwinSettings) else None
    if tube is not None and isinstance(settings, TwinSettings):
        ends = shapes(settings.tube_length_m, tube.modes, [settings.tube_length_m])[0][:, 0]
        end = motion.modal @ ends
        truth["tube"] = {
            "clamped_frequencies_hz": (np.sqrt(tube.stiffness_n_m / tube.mass_kg) / (2 * np.pi)).tolist(),
            "sag_m": float(-end[0]),
            "largest_deflection_m": float(np.max(np.abs(end - end[0]))),
        }
    return truth


def gun_impulses(scene: Scene, motion: Motion) -> dict[str, float]:
    """Return the impulse that is not read up to the end of the recoil, N s, and its share of that which is."""
    m = scene.mechanism
    recoils = motion.times_s <= motion.t_end_s
    read_n = m.brake_area * motion.brake_pressure_pa + m.recuperator_area * motion.recuperator_pressure_pa
    unread, read = (
        float(np.trapezoid(force[recoils & (motion.times_s >= motion.t_fire_s)], dx=float(motion.times_s[1])))
        for force in (motion.unread_n, read_n)
    )
    return {"impulse_n_s": unread, "impulse_share": unread / read}
