"""Summaries of made-up shots, drawn from the model that a campaign is combined by, without any of its code.

Each shot is an accelerometer's record of a mass that three gauged forces and a friction drive, in another mixture
for each charge: a = alpha (P/g1 - K/g2 - R/g3 + (1 - phi) F) / m. Its derivatives, divided by the noise, are the
rows; their triangle is the summary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.shot.shot_summary import Parameter, ShotSummary

NAMES = (
    "ln mass",
    "ln breech_pressure",
    "ln brake_pressure",
    "ln recuperator_pressure",
    "friction share",
    "ln recoil_acceleration",
)
BREECH, BRAKE, RECUPERATOR = (
    f"sensor:{role}_pressure:{serial}" for role, serial in (("breech", 1), ("brake", 2), ("recuperator", 3))
)
ACCELEROMETER, FRICTION = "sensor:recoil_acceleration:4", "rig:made up:friction"
INFLUENCES = (BREECH, BRAKE, RECUPERATOR, FRICTION, ACCELEROMETER)
U = (0.005, 0.004, 0.004, 0.1, 0.005)
MASS_KG = 912.0


@dataclass(frozen=True)
class Drawn:
    """A campaign and what it truly is.

    Attributes
    ----------
    errors
        Of each influence, in its unit.
    """

    shots: tuple[CampaignShot, ...]
    mass_kg: float
    errors: dict[str, float] = field(default_factory=dict)


def rows_of_shot(charge: float, noise_m_s2: float = 1.0) -> NDArray[np.float64]:
    """Return derivatives by the parameters over the noise, shape (120, 6)."""
    t = np.linspace(0.0, 0.12, 120)
    breech = charge * 1.1e6 * (t / 4e-3) ** 2 * np.exp(2 * (1 - t / 4e-3))
    speed = np.cumsum(breech) * (t[1] - t[0]) / MASS_KG
    brake = 2.2e5 * charge * speed / speed.max() * (1 - t / 0.12) ** 0.3
    recuperator = 1.3e4 * (1 + 4 * t)
    friction = np.full(t.size, 1.5e3)
    forces = np.column_stack([breech, -brake, -recuperator, -friction]) / MASS_KG
    acceleration = forces.sum(axis=1)
    # a scale that reads high makes its force smaller
    columns = np.column_stack([-acceleration, -forces[:, :3], -forces[:, 3], acceleration])
    return columns / noise_m_s2


def summary_of(rows: NDArray[np.float64], truth: NDArray[np.float64], rng: np.random.Generator | None) -> ShotSummary:
    """Summarise rows whose parameters truly are `truth`, with noise of standard deviation one, or without."""
    noise = np.zeros(rows.shape[0]) if rng is None else rng.standard_normal(rows.shape[0])
    reduced = np.linalg.qr(np.column_stack([rows, noise]), mode="r")[: rows.shape[1]]
    influences = {NAMES[at + 1]: ((identity, u),) for at, (identity, u) in enumerate(zip(INFLUENCES, U, strict=True))}
    return ShotSummary(
        tuple(Parameter(name, influences.get(name, ())) for name in NAMES), truth, reduced[:, :-1], reduced[:, -1], {}
    )


def campaign_of(
    added_kg: Sequence[float],
    *,
    seed: int | None = 0,
    charges: Sequence[float] = (1.0, 0.8, 0.65, 0.9),
    gain_rel: float = 0.0,
    friction_rel: float = 0.0,
    step_kg: dict[int, float] | None = None,
    moved: dict[tuple[int, str], float] | None = None,
    configurations: Sequence[str] = (),
    u_added_kg: float = 0.05,
) -> Drawn:
    """Draw a campaign.

    Parameters
    ----------
    added_kg
        One for each shot.
    seed
        None for shots without any error.
    step_kg
        By which the mass rises from a shot on, counted from 0.
    moved
        By how much a parameter of a shot is off besides.
    """
    rng = None if seed is None else np.random.default_rng(seed)

    def normal(size: int | None = None) -> NDArray[np.float64]:
        return np.zeros(size or ()) if rng is None else np.asarray(rng.standard_normal(size))

    errors = normal(len(INFLUENCES)) * np.array(U)
    u_added = float(normal()) * u_added_kg
    shots = []
    for i, added in enumerate(added_kg):
        mass = MASS_KG + sum(kg for at, kg in (step_kg or {}).items() if i >= at)
        whole = mass + added + (u_added if added else 0.0)
        own = normal(5) * np.array([gain_rel, gain_rel, gain_rel, friction_rel, gain_rel])
        truth = np.concatenate([[np.log(whole)], errors + own])
        for (at, name), off in (moved or {}).items():
            truth[NAMES.index(name)] += off if at == i else 0.0
        summary = summary_of(rows_of_shot(charges[i // 2 % len(charges)]), truth, rng)
        name = configurations[i] if configurations else ""
        shots.append(
            CampaignShot(
                f"{i + 1:04d}", "made up", None, whole, 3.0, summary,
                configuration=name, added_mass_kg=added, u_added_mass_kg=u_added_kg if added else 0.0,
            )
        )  # fmt: skip
    return Drawn(tuple(shots), MASS_KG, dict(zip(INFLUENCES, errors.tolist(), strict=True)))
