"""Draws of a virtual rig's forces that no gauge reads, and of the noise that its motion brings.

The resistance that is not read is a share of that which is, drawn once for all shots of a campaign with a small
scatter from shot to shot. Where it is positive it is a mixture of packings that grip with the pressure, of slides and
of an area that grows over the stroke, each with its part of the impulse; where it is negative, a pressure on the other
side of the brake's piston takes that much impulse off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.instruments import generator
from recoil_rigs.twin.motion import nominal_recoil_of
from recoil_rigs.twin.nominal_recoil import NominalRecoil
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.recorder_settings import RecorderSettings
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import UnreadForces

U_FROM_SHOT_TO_SHOT = 0.002
"""Standard deviation from shot to shot of the share of the resistance that is not read."""
NOISE_OF_MOTION = (1e-3, 6e-3)
"""Bounds between which lies the noise that the motion brings, share of acceleration and of readings."""
REST_NOISE = (0.25, 1.0)
"""Bounds between which lies the noise at rest, share of that in the motion."""
NOISES = {"noise_of_acceleration": NOISE_OF_MOTION, "noise_of_reading": NOISE_OF_MOTION, "rest_noise": REST_NOISE}
"""Settings of ``[twin.readings]`` that are drawn evenly in their logarithm, between bounds."""
FORMS = ("packings", "slides", "rod")
"""Forms of a resistance that is not read, which share its impulse."""


@dataclass(frozen=True)
class DrawnForces:
    """Forces that no gauge reads, as drawn for one shot.

    Attributes
    ----------
    truth
        Values that were drawn, JSON types; empty if nothing acts.
    """

    forces: UnreadForces
    truth: dict[str, Any]


@dataclass(frozen=True)
class DrawnReadings:
    """Readings of a virtual rig, as drawn for one shot.

    Attributes
    ----------
    truth
        Values that were drawn, JSON types; empty if nothing was.
    """

    readings: Readings
    truth: dict[str, float]


def draw_noise(settings: RecorderSettings, seed: int, campaign_seed: int | None) -> DrawnReadings:
    """Draw the noise that the motion brings, and how quiet the rest is, unless ``[twin.readings]`` says so.

    A campaign's cables and structure are the same in all its shots.

    Parameters
    ----------
    campaign_seed
        Seed of what the shots of a campaign share; None where `seed` draws it.
    """
    rng = generator(seed if campaign_seed is None else campaign_seed, "motion noise")
    drawn = {key: float(np.exp(rng.uniform(*np.log(limits)))) for key, limits in NOISES.items()}
    asked = settings.readings.model_fields_set
    taken = {key: value for key, value in drawn.items() if key not in asked} if settings.unread_errors else {}
    readings = settings.readings.model_copy(update=taken)
    told = {key: float(getattr(readings, key)) for key in NOISES if key in taken or key in asked}
    return DrawnReadings(readings, told)


def usual_noise(settings: RecorderSettings) -> dict[str, float]:
    """Return the middle noise of those that are drawn for motion and rest, by the keys of ``[twin.readings]``.

    Empty where none is drawn.
    """
    return {key: math.sqrt(math.prod(limits)) for key, limits in NOISES.items()} if settings.unread_errors else {}


def draw_forces(mechanism: Mechanism, settings: TwinSettings, seed: int, campaign_seed: int | None) -> DrawnForces:
    """Draw the forces that no gauge reads from what the rig file states, beside those of ``[twin.unread]``.

    Parameters
    ----------
    mechanism
        Mechanism with the true recoiling mass, before anything is added to it.
    campaign_seed
        Seed of what the shots of a campaign share; None where `seed` draws it.
    """
    of_rig = seed if campaign_seed is None else campaign_seed
    m, asked, errors = mechanism, settings.unread, settings.unread_errors

    def drawn(symbol: str) -> float:
        off = float(generator(of_rig, symbol).normal()) if errors else 0.0
        return float(getattr(m, symbol)) + off * m.u.get(symbol, 0.0)

    slide, oil, share = max(drawn("slide_friction"), 0.0), max(drawn("carried_mass"), 0.0), drawn("unread_share")
    if errors and campaign_seed is not None and m.u.get("unread_share", 0.0):
        share += U_FROM_SHOT_TO_SHOT * float(generator(seed, "unread_share").normal())
    latent = m.unread_force if errors else 0.0
    forces = asked.model_copy(
        update={
            "slide_n_s_m": asked.slide_n_s_m + slide,
            "carried_oil_kg": asked.carried_oil_kg + oil,
            "latent_share": float(np.hypot(asked.latent_share, latent)),
        }
    )
    truth: dict[str, Any] = {}
    if not (share or forces.has_curves):
        changed = forces.model_dump(exclude_defaults=True)
        return DrawnForces(forces, {"forces": changed} if changed else {})
    recoil = nominal_recoil_of(m, settings)
    if share:
        parts = generator(of_rig, "unread form").dirichlet(np.ones(len(FORMS))) if errors else np.array([1.0, 0.0, 0.0])
        forces = _with_share(forces, share, parts, m, recoil, settings.stroke_m)
        form = dict(zip(FORMS, parts.tolist(), strict=True)) if share > 0 else {"back pressure": 1.0}
        truth |= {"share": share, "form": form}
    if forces.has_curves:
        largest_n = forces.largest_force_n or recoil.largest_force_n
        own_seed = of_rig if forces.curves_seed is None else forces.curves_seed
        forces = forces.model_copy(update={"largest_force_n": largest_n, "curves_seed": own_seed})
    return DrawnForces(forces, truth | {"forces": forces.model_dump(exclude_defaults=True)})


def _with_share(
    forces: UnreadForces,
    share: float,
    parts: NDArray[np.float64],
    mechanism: Mechanism,
    recoil: NominalRecoil,
    stroke_m: float,
) -> UnreadForces:
    """Add a share of the resistance that is read, by its impulse in the nominal recoil.

    Parameters
    ----------
    parts : ndarray, shape (3,)
        Parts of `FORMS` in a share that is positive, which add up to 1.
    """
    read_n = recoil.brake_n + recoil.recuperator_n
    impulse = share * recoil.impulse_n_s(read_n)
    if share < 0:
        built_up = -np.expm1(-recoil.travel_m / forces.back_pressure_reach_m)
        per_pa = mechanism.brake_area * recoil.impulse_n_s(built_up)
        return forces.model_copy(update={"back_pressure_pa": forces.back_pressure_pa - impulse / per_pa})
    packings, slides, rod = (impulse * parts).tolist()
    grown = recoil.brake_n * recoil.travel_m / stroke_m
    return forces.model_copy(
        update={
            "packing_share": forces.packing_share + packings / recoil.impulse_n_s(read_n),
            "slide_n_s_m": forces.slide_n_s_m + slides / recoil.impulse_n_s(recoil.speed_m_s),
            "rod_share": forces.rod_share + rod / recoil.impulse_n_s(grown),
        }
    )
