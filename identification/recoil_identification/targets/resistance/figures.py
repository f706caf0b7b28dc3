"""The figures of the recoil resistance: over travel, velocity and time, the throttle, and the energy by part."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import TIME, ZERO, Figure, Panel, Trace, with_interval
from recoil_identification.targets.resistance.resistance_comparison import ResistanceOverTime
from recoil_identification.targets.resistance.resistance_fit import FittedBrake
from recoil_identification.targets.resistance.resistance_record import ResistanceRecord
from recoil_identification.targets.resistance.shot_balance import Balance


def resistance_figures(
    drawn: ResistanceOverTime, brake: FittedBrake | str, energy: Balance, record: ResistanceRecord
) -> tuple[Figure, ...]:
    """Compose the figures, in reading order."""
    figures = [
        _over(drawn, record.travel_m, "travel", "travel, m"),
        _over(drawn, record.velocity_m_s, "velocity", "velocity of recoil, m/s"),
        _stacked(drawn, record.times_s),
    ]
    if not isinstance(brake, str):
        figures.append(_throttle(brake))
    return (*figures, _energy(energy, record.times_s))


def _over(drawn: ResistanceOverTime, x: Array, key: str, label: str) -> Figure:
    return Figure(
        f"resistance-{key}",
        f"Recoil resistance over {key}",
        "Gauges and friction together, the fitted law, and what breech gauge and motion show of it.",
        label,
        (
            Panel(
                "resistance, kN",
                (
                    Trace("by gauges and friction", x, 1e-3 * drawn.measured_n, "measured", "kN"),
                    Trace("fitted law", x, 1e-3 * drawn.law_n, "model", "kN"),
                    Trace("by breech force and motion", x, 1e-3 * drawn.motion_n, "reference", "kN", visible=False),
                ),
            ),
        ),
    )


def _stacked(drawn: ResistanceOverTime, t: Array) -> Figure:
    friction = drawn.friction_n
    gas = friction + drawn.recuperator_n
    whole = gas + drawn.brake_n
    nothing = np.zeros_like(t)
    layers = (
        ("friction", nothing, friction),
        ("recuperator", friction, gas),
        ("brake", gas, whole),
    )
    bands = tuple(Trace(name, t, 1e-3 * top, "band", "kN", 1e-3 * bottom, 1e-3 * top) for name, bottom, top in layers)
    name = "by breech force and motion, 95 % interval"
    motion = with_interval(name, t, drawn.motion_n, drawn.u_motion_n, "kN", scale=1e-3, visible=False)
    top = 1.2e-3 * float(np.nanmax(whole))
    return Figure(
        "resistance-parts",
        "Parts of the recoil resistance",
        "Stacked: friction, recuperator, brake; the fitted law runs along the top.",
        TIME,
        (
            Panel(
                "resistance, kN",
                (*bands, Trace("fitted law", t, 1e-3 * drawn.law_n, "model", "kN"), motion),
                y_shown=(0.0, top),
            ),
            Panel(
                "law less gauges, kN",
                (Trace("difference", t, 1e-3 * (drawn.law_n - whole), "measured", "kN"),),
                (ZERO,),
            ),
        ),
    )


def _throttle(brake: FittedBrake) -> Figure:
    there = np.isfinite(brake.logarithm)
    x, half = brake.travel_m[there], COVERAGE_FACTOR * brake.u_logarithm[there]
    c = brake.coefficient[there]
    return Figure(
        "throttle",
        "Throttle of the brake",
        "Brake force over squared velocity along the travel, with its 95 % band.",
        "travel, m",
        (
            Panel(
                "c(x), N s²/m²",
                (Trace("c(x), 95 % interval", x, c, "band", "N s²/m²", c * np.exp(-half), c * np.exp(half)),),
                y_scale="log",
            ),
        ),
    )


def _energy(energy: Balance, t: Array) -> Figure:
    traces = tuple(
        Trace(
            "kinetic energy" if name == "motion" else f"work of {name}" if name == "breech" else f"taken by {name}",
            t,
            1e-3 * (part if name == "breech" else -part),
            "filtered" if name in ("breech", "motion") else "model",
            "kJ",
        )
        for name, part in energy.parts.items()
    )
    left = with_interval("left", t, energy.left, energy.u, "J")
    return Figure(
        "energy",
        "Energy of the recoil by part",
        "What the breech force gave and where it went; below, what is left of the balance with its 95 % interval, "
        "which should hold zero.",
        TIME,
        (
            Panel("energy, kJ", traces),
            Panel("left, J", (left,), (ZERO,)),
        ),
    )
