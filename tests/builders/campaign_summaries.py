"""Summaries of made-up shots, drawn from the model that a campaign is combined by, without any of its code.

Each shot is an accelerometer's record of a mass that three gauged forces and a friction drive, in another mixture
for each charge: a = alpha (P/g1 - K/g2 - R/g3 + (1 - phi) F) / m. Its derivatives, divided by the noise, are the
rows; their triangle is the summary. Where a share of the resistance and a force over the travel are read by no gauge,
their columns are beside these, and those of a mass that changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lsim

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.shot.shot_summary import STEPS_AT, Parameter, ShotSummary, Suspected
from recoil_processing.shot.error_source import ErrorSource, SourceKind

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
DYNAMIC = "dynamic:breech_pressure:1"
ACCELEROMETER, FRICTION = "sensor:recoil_acceleration:4", "rig:made up:friction"
INFLUENCES = (BREECH, BRAKE, RECUPERATOR, FRICTION, ACCELEROMETER)
U = (0.005, 0.004, 0.004, 0.1, 0.005)
MASS_KG = 912.0
SHAPES = 5
UNREAD_FORCE = 0.002
"""Of the peak resistance."""
UNREAD_NAMES = (
    "unread share",
    *(f"unread force {number + 1}" for number in range(SHAPES)),
    "drift of ln mass",
    *(f"step of ln mass at {share:g}" for share in STEPS_AT),
)
SUSPECTS = tuple(
    Suspected(ErrorSource(kind, of), "", variant, u, positive)
    for kind, of, variant, u, positive in (
        (SourceKind.LINEARITY, "breech_pressure", "bent", 0.01, False),
        (SourceKind.HANGING_PART, "", "20 Hz, damping 0.2", 0.015, True),
    )
)
"""Shapes that the made-up rig does not state."""
SHARE, SHAPE = "rig:made up:unread_share", "rig:made up:unread_force-"
UNREAD_U = (0.01, *[1.0] * SHAPES)
OWN_SHARE = 0.002
"""By which the share does not repeat."""


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


def unread_rows_of_shot(charge: float) -> NDArray[np.float64]:
    """Return derivatives by share, shapes of the force and changes of the mass, shape (120, n_names)."""
    rows = rows_of_shot(charge)
    acceleration, resistance = rows[:, -1], -rows[:, 2:4].sum(axis=1)
    place = np.linspace(0.0, 1.0, acceleration.size)
    speed = np.maximum(np.cumsum(acceleration), 0.0)
    travel = np.cumsum(speed) / speed.sum()
    peak = np.abs(resistance + rows[:, 4]).max()
    shapes = [np.cos(np.pi * number * travel) / (1.0 + number) for number in range(SHAPES)]
    steps = [place >= share for share in STEPS_AT]
    return np.column_stack(
        [
            resistance,
            *(-UNREAD_FORCE * peak * shape for shape in shapes),
            -acceleration * place,
            *(-acceleration * step for step in steps),
        ]
    )


def suspected_rows_of_shot(charge: float) -> NDArray[np.float64]:
    """Return derivatives by a bent line of the breech gauge and by a part that hangs, shape (120, 2)."""
    rows = rows_of_shot(charge)
    breech, acceleration, t = -rows[:, 1], rows[:, -1], np.linspace(0.0, 0.12, 120)
    z = breech / (1.25 * 1.1e6 / MASS_KG)
    w = 2 * np.pi * 20.0
    _, follows, _ = lsim(([2 * 0.2 * w, w**2], [1.0, 2 * 0.2 * w, w**2]), acceleration, t)
    # a gauge that reads too much makes the true force smaller than its reading
    return np.column_stack([-2.0 * z * (1.0 - z) * 1.25 * 1.1e6 / MASS_KG, acceleration - follows])


def summary_of(rows: NDArray[np.float64], truth: NDArray[np.float64], rng: np.random.Generator | None) -> ShotSummary:
    """Summarise rows whose parameters truly are `truth`, with noise of standard deviation one, or without."""
    noise = np.zeros(rows.shape[0]) if rng is None else rng.standard_normal(rows.shape[0])
    reduced = np.linalg.qr(np.column_stack([rows, noise]), mode="r")[: rows.shape[1]]
    known = dict(zip(NAMES[1:], zip(INFLUENCES, U, strict=True), strict=True))
    of_force = (SHARE, *(f"{SHAPE}{number + 1}" for number in range(SHAPES)))
    known |= dict(zip(UNREAD_NAMES, zip(of_force, UNREAD_U, strict=True), strict=False))
    stated = tuple(Parameter(name, (known[name],) if name in known else ()) for name in (*NAMES, *UNREAD_NAMES))
    names = (*stated, *(Parameter(one.name, suspected=one) for one in SUSPECTS))[: rows.shape[1]]
    return ShotSummary(
        names,
        truth,
        reduced[:, :-1],
        reduced[:, -1],
        {"unread_force": UNREAD_FORCE} if len(names) > len(NAMES) else {},
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
    unread: float | None = None,
    changing: dict[str, float] | None = None,
    changing_in: Sequence[int] | None = None,
    told: Sequence[int] = (),
    suspected: dict[str, float] | None = None,
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
    unread
        Factor on the force that no gauge reads, which is drawn, and so is the share; None where all is read.
    changing
        Changes of the mass within every shot, by their names.
    changing_in
        Shots in which it changes, counted from 0; all if left out.
    told
        Shots whose own reports say so.
    suspected
        Sizes of shapes that the rig does not state, by their names: of `SUSPECTS`; none are asked for if left out.
    """
    rng = None if seed is None else np.random.default_rng(seed)

    def normal(size: int | None = None) -> NDArray[np.float64]:
        return np.zeros(size or ()) if rng is None else np.asarray(rng.standard_normal(size))

    errors = normal(len(INFLUENCES)) * np.array(U)
    u_added = float(normal()) * u_added_kg
    common = np.zeros(0)
    if unread is not None:
        common = np.zeros(len(UNREAD_NAMES))
        common[: 1 + SHAPES] = normal(1 + SHAPES) * np.array([UNREAD_U[0], *[unread] * SHAPES])
    shots = []
    for i, added in enumerate(added_kg):
        mass = MASS_KG + sum(kg for at, kg in (step_kg or {}).items() if i >= at)
        whole = mass + added + (u_added if added else 0.0)
        own = normal(5) * np.array([gain_rel, gain_rel, gain_rel, friction_rel, gain_rel])
        truth = np.concatenate([[np.log(whole)], errors + own, common])
        for (at, name), off in (moved or {}).items():
            truth[NAMES.index(name)] += off if at == i else 0.0
        charge = charges[i // 2 % len(charges)]
        rows = rows_of_shot(charge)
        if unread is not None:
            rows = np.hstack([rows, unread_rows_of_shot(charge)])
            truth[len(NAMES)] += OWN_SHARE * float(normal())
            for changed, size in (changing or {}).items():
                if changing_in is None or i in changing_in:
                    truth[len(NAMES) + UNREAD_NAMES.index(changed)] += size
        if suspected is not None:
            rows = np.hstack([rows, suspected_rows_of_shot(charge)])
            truth = np.concatenate([truth, [suspected.get(one.name, 0.0) for one in SUSPECTS]])
        summary = summary_of(rows, truth, rng)
        name = configurations[i] if configurations else ""
        shots.append(
            CampaignShot(
                f"{i + 1:04d}", "made up", None, whole, 3.0, summary,
                configuration=name, added_mass_kg=added, u_added_mass_kg=u_added_kg if added else 0.0,
                changes=i in told,
            )
        )  # fmt: skip
    return Drawn(
        tuple(shots), MASS_KG, dict(zip((*INFLUENCES, SHARE), [*errors.tolist(), *common[:1].tolist()], strict=False))
    )


def at_rest(shots: Sequence[CampaignShot], **more: float) -> list[CampaignShot]:
    """Let what is known of the breech gauge's scale be what a certificate at rest tells, with other influences."""
    found = []
    for shot in shots:
        assert shot.summary is not None
        parameters = tuple(
            replace(one, influences=(*one.influences, (DYNAMIC, 0.005), *more.items()))
            if one.name == "ln breech_pressure"
            else one
            for one in shot.summary.parameters
        )
        found.append(replace(shot, summary=replace(shot.summary, parameters=parameters)))
    return found
