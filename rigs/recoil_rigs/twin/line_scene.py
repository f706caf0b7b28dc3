"""A shot of a virtual body on a line: what is drawn of it, how it moves, and what its files hide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from recoil_acquisition.errors import RigError
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import RedundantAlignment, Rig
from recoil_rigs.tables.rig_tables import FORCE_ROLES
from recoil_rigs.twin.campaign import PlannedShot
from recoil_rigs.twin.draws import U_FROM_SHOT_TO_SHOT, draw_noise
from recoil_rigs.twin.instruments import generator, stress_waves
from recoil_rigs.twin.line_motion import LineMotion, simulate_line
from recoil_rigs.twin.line_settings import LineSettings, devices_of, faults_of_line, read_line_settings
from recoil_rigs.twin.recorder_settings import measured_roles
from recoil_rigs.twin.sources import Scene
from recoil_rigs.twin.unread_forces import UnreadForces

DRIVING_ROLES = ("driving_force", "breech_pressure")
"""Roles of what drives on a line."""
FORMS = ("packings", "slides")
"""Forms of a resistance that is not read, which share its impulse."""


@dataclass(frozen=True)
class DrawnLine:
    """Values of a body on a line as drawn for one shot.

    Attributes
    ----------
    carried_kg
        Mass that moves along.
    friction_n
        Friction of the packing while it slides.
    forces
        Forces that no sensor reads, their sizes those of the nominal motion.
    reach_m
        Travel over which forces by place are drawn.
    truth
        Values of these forces for ``truth.json``, JSON types; empty if nothing acts.
    """

    carried_kg: float
    friction_n: float
    forces: UnreadForces
    reach_m: float
    truth: Mapping[str, Any]


def draw_line(
    mechanism: Mechanism, settings: LineSettings, seed: int, campaign_seed: int | None, friction_factor: float
) -> DrawnLine:
    """Draw frictions, what is carried along and the forces that no sensor reads from what the rig file states.

    Parameters
    ----------
    mechanism
        Mechanism with the true mass.
    campaign_seed
        Seed of what the shots of a campaign share; None where `seed` draws it.
    friction_factor
        Factor on the friction in this shot.
    """
    m, errors, asked = mechanism, settings.unread_errors, settings.unread
    of_rig = seed if campaign_seed is None else campaign_seed

    def drawn(symbol: str, *, whether: bool) -> float:
        off = float(generator(of_rig, symbol).normal()) if whether else 0.0
        return float(getattr(m, symbol)) + off * m.u.get(symbol, 0.0)

    friction_n = max(friction_factor * drawn("friction", whether=settings.friction_error), 0.0)
    slide = max(drawn("slide_friction", whether=errors), 0.0) + asked.slide_n_s_m
    carried_kg = max(drawn("carried_mass", whether=errors), 0.0) + asked.carried_oil_kg
    share = drawn("unread_share", whether=errors)
    if errors and campaign_seed is not None and m.u.get("unread_share", 0.0):
        share += U_FROM_SHOT_TO_SHOT * float(generator(seed, "unread_share").normal())
    latent = float(np.hypot(asked.latent_share, m.unread_force if errors else 0.0))
    forces = asked.model_copy(update={"slide_n_s_m": slide, "carried_oil_kg": carried_kg, "latent_share": latent})
    nominal = simulate_line(
        m, settings.model_copy(update={"unread": UnreadForces(slide_n_s_m=slide)}),
        moved_kg=m.m3 + carried_kg, friction_n=friction_n, reach_m=1.0, rough=True,
    )  # fmt: skip
    resisting_n = np.abs(nominal.resisting_n + nominal.friction_n + nominal.unread_n)
    truth: dict[str, Any] = {}
    if share:
        both = errors and share > 0
        parts = generator(of_rig, "unread form").dirichlet(np.ones(len(FORMS))) if both else np.array([1.0, 0.0])
        speed = float(np.abs(nominal.speed_m_s).sum())
        sliding = share * float(parts[1]) * float(resisting_n.sum()) / speed if speed else 0.0
        more = {"packing_share": forces.packing_share + share * float(parts[0]), "slide_n_s_m": slide + sliding}
        forces = forces.model_copy(update=more)
        truth |= {"share": share, "form": dict(zip(FORMS, parts.tolist(), strict=True))}
    if forces.has_curves:
        largest_n = forces.largest_force_n or float(resisting_n.max()) or None
        own_seed = of_rig if forces.curves_seed is None else forces.curves_seed
        forces = forces.model_copy(update={"largest_force_n": largest_n, "curves_seed": own_seed})
    if changed := forces.model_dump(exclude_defaults=True):
        truth["forces"] = changed
    reach_m = max(float(np.ptp(nominal.travel_m)), 1e-9)
    return DrawnLine(carried_kg, friction_n, forces, reach_m, truth)


def draw_line_scene(
    rig: Rig, seed: int, shot: str, campaign_seed: int | None = None, planned: PlannedShot | None = None
) -> Scene:
    """Draw what this shot's body truly is, and let it move; parameters as of `recoil_rigs.twin.simulate_shot`.

    Raises
    ------
    RigError
        If it cannot be simulated.
    """
    settings = read_line_settings(rig)
    m3_kg, charge, friction_factor = settings.m3_true or rig.mechanism.m3, 1.0, 1.0
    noise = draw_noise(settings, seed, campaign_seed)
    settings = settings.model_copy(update={"readings": noise.readings})
    if planned is not None:
        m3_kg, charge, friction_factor = planned.m3_kg(m3_kg), planned.charge, planned.friction_factor
    mechanism = replace(rig.mechanism, m3=m3_kg)
    if faults := faults_of_line(mechanism, settings):
        raise RigError(rig.path, faults)
    charge *= 1.0 + settings.shot_to_shot * float(generator(seed, "shot").normal())
    settings = settings.model_copy(update=settings.with_charge(charge))
    drawn = draw_line(mechanism, settings, seed, campaign_seed, friction_factor)
    settings = settings.model_copy(update={"unread": drawn.forces})
    motion = simulate_line(
        mechanism, settings, moved_kg=m3_kg + drawn.carried_kg, friction_n=drawn.friction_n, reach_m=drawn.reach_m
    )
    modes = np.zeros((1, motion.times_s.size))
    if settings.ringing:
        modes = stress_waves(motion.times_s, motion.t_fire_s, motion.t_end_s, generator(seed, "stress waves"))
    roles = measured_roles(rig, settings)
    return Scene(
        rig, settings, mechanism, motion, modes, roles, seed, shot, campaign_seed, planned, drawn.truth, noise.truth,
        shares=_shares(rig, settings, roles),
    )  # fmt: skip


def _shares(rig: Rig, settings: LineSettings, roles: Mapping[str, str]) -> dict[str, float]:
    """Return which part of the driving or of the resisting force passes each sensor of one, by channel."""
    devices = devices_of(rig)
    parts = {name: settings.shares.get(name, 1.0) for name in devices}
    whole = {
        drives: sum(part for name, part in parts.items() if (devices[name] in DRIVING_ROLES) is drives)
        for drives in (True, False)
    }
    of_device = {name: part / whole[devices[name] in DRIVING_ROLES] for name, part in parts.items()}
    repeated = {s.align.channel: s.align.against for s in rig.sources if isinstance(s.align, RedundantAlignment)}
    found = {}
    for name, role in roles.items():
        device = (repeated.get(name, name) if role in FORCE_ROLES else role) if role else ""
        if device not in of_device:
            device = next((one for one, of in devices.items() if of == role), "")
        if device:
            found[name] = of_device[device]
    return found


def line_truth_of(scene: Scene, motion: LineMotion) -> dict[str, Any]:
    """Return what ``truth.json`` says of a body on a line alone."""
    forces = scene.settings.unread
    return {
        "carried_mass": forces.carried_oil_kg,
        "friction": float(np.abs(motion.friction_n).max()),
        "slide_friction": forces.slide_n_s_m,
        "t_fire": motion.t_fire_s,
        "t_end": motion.t_end_s,
        "stroke_m": float(np.ptp(motion.travel_m)),
        "peak_speed_m_s": float(np.abs(motion.speed_m_s).max()),
        "peak_driving_force_n": float(np.abs(motion.driving_n).max()),
        "peak_resisting_force_n": float(np.abs(motion.resisting_n).max()),
    }


def line_impulses(scene: Scene, motion: LineMotion) -> dict[str, float]:  # noqa: ARG001 - as of a gun
    """Return the impulse that is not read, N s, against the motion, and its share of what resists it all."""
    step_s = float(motion.times_s[1])
    along = np.sign(motion.speed_m_s)
    unread = float(np.trapezoid(along * motion.unread_n, dx=step_s))
    read = float(np.trapezoid(along * (motion.resisting_n + motion.friction_n), dx=step_s))
    return {"impulse_n_s": unread, **({"impulse_share": unread / read} if read else {})}
