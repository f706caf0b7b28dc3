"""The equation of motion written out sample by sample, with sensors and causes that are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from recoil_identification.inference.unknown import Unknown
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.equation_of_motion import ACCELERATION, EquationOfMotion
from recoil_processing.shot.regression import Regression

STEP_S = 1e-3


def drawn_regression(rng: np.random.Generator, size: int = 9, shifts: int = 0) -> Regression:
    """Draw columns of the right size; nothing in them is a shot."""
    return Regression(
        times_s=STEP_S * np.arange(size),
        step_s=STEP_S,
        acceleration_m_s2=rng.normal(0.0, 300.0, size),
        forces_n=rng.normal(0.0, 2e5, (size, 4)),
        released=rng.uniform(0.0, 1.0, size),
        friction_direction=rng.uniform(-1.0, 1.0, size),
        release_per_s=rng.normal(0.0, 100.0, size),
        trusted=np.ones(size, dtype=bool),
        interval_s=(0.0, STEP_S * (size - 1)),
        release_n_s=0.0,
        u_release_n_s=1.0,
        shifts=rng.normal(size=(size, shifts)) if shifts else None,
    )


def drawn_motion(
    rng: np.random.Generator,
    shifts: int = 0,
    causes: int = 0,
    changes: int = 0,
    scale: Unknown = ACCELERATION,
    size: int = 9,
) -> EquationOfMotion:
    """Draw rows of a motion with so many of each unknown that not every motion has."""
    regression = drawn_regression(rng, size, shifts)
    return EquationOfMotion(
        regression=regression,
        rows=np.array([1, 2, 5, 8]),
        m0_kg=700.0,
        sigma_m_s2=rng.uniform(0.5, 3.0, 4),
        causes=tuple(
            Cause(f"cause {i}", "1", 1.0, "B", rng.normal(0.0, 1e4, (size, 3)), rng.normal(0.0, 10.0, size))
            for i in range(causes)
        ),
        scale=scale,
        changes=rng.normal(size=(size, changes)) if changes else None,
    )


def drawn_values(rng: np.random.Generator, names: tuple[str, ...]) -> dict[str, float]:
    """Draw errors of some per cent, of newtons and of m/s^2, as the names have it."""
    sizes = {"friction declared too large": 500.0, "zero of recoil_acceleration": 5.0, "velocity at the release": 0.1}
    return {name: float(rng.normal(0.0, sizes.get(name, 0.05))) for name in names}


def acceleration_m_s2(block: EquationOfMotion, values: Mapping[str, float], at: int) -> float:
    """Return what the equation makes of one sample of the regression's grid.

    ``e^(al - mu) [sum_j (F_j + sum_c h_c f_cj) e^-g_j + R - df s + (e^-c - 1) F] / m0 + b + v d + S z + sum_c h_c a_c``
    with F the force behind a lower cut-off, which is the force itself where both sides have passed none.
    """
    r = block.regression
    ln_mass = values["ln mass"]
    force_n = float(r.forces_n[at, 3]) - values["friction declared too large"] * float(r.friction_direction[at])
    for column, role in enumerate(("breech_pressure", "brake_pressure", "recuperator_pressure")):
        reading_n = float(r.forces_n[at, column])
        reading_n += sum(values[one.source] * float(one.forces_n[at, column]) for one in block.causes)
        force_n += reading_n * math.exp(-values[f"ln {role}"])
    if block.changes is not None:
        change = sum(values[f"change {i + 1} of ln mass"] * block.changes[at, i] for i in range(len(block.changes[0])))
        force_n += (math.exp(-change) - 1.0) * float(sum(r.forces_n[at]))
    read = math.exp(values[block.scale.name] - ln_mass) * force_n / block.m0_kg
    read += values["zero of recoil_acceleration"] * float(r.released[at])
    read += values["velocity at the release"] * float(r.release_per_s[at])
    read += sum(values[one.source] * float(one.acceleration_m_s2[at]) for one in block.causes)
    if r.shifts is not None:
        read += sum(values[f"shift {i + 1} of the zero"] * float(r.shifts[at, i]) for i in range(len(r.shifts[0])))
    return read
