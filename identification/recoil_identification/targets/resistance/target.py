"""Target ``resistance``: the law of the recoil resistance, the packing friction, energy and momentum of the shot.

``R(x, v) = A_r p0 (L / (L - x))^n + c(x) v^2 + friction``: gas of the recuperator and throttle of the brake by their
gauges against the motion, the friction by the equation of motion. Two balances tell whether breech force, resistance
and motion belong together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.rounding import in_unit, rounded, significant
from recoil_identification.rows.unread_resistance import together
from recoil_identification.shot.identified import Identification
from recoil_identification.targets.resistance.figures import resistance_figures
from recoil_identification.targets.resistance.packing_friction import Friction, packing_friction
from recoil_identification.targets.resistance.resistance_comparison import ResistanceOverTime, resistance_over_time
from recoil_identification.targets.resistance.resistance_fit import FittedBrake, FittedGas, fit_brake, fit_gas
from recoil_identification.targets.resistance.resistance_record import ResistanceRecord, resistance_record
from recoil_identification.targets.resistance.shot_balance import (
    Balance,
    BalancePoint,
    Until,
    energy_balance,
    momentum_balance,
)
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, Series, Table, TargetResult
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.mechanism.model import Mechanism

SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of the travel where the throttle's coefficient is stated."""
CURVE = 200
"""Points of the throttle's curve."""


@dataclass(frozen=True, eq=False)
class _Parts:
    record: ResistanceRecord
    gas: FittedGas | str
    brake: FittedBrake | str
    at_shares: FittedBrake | str
    friction: Friction
    energy: Balance
    momentum: Balance
    drawn: ResistanceOverTime


def find(case: Case) -> TargetResult:
    """Identify the law of the recoil resistance of one shot, and check its energy and momentum.

    Raises
    ------
    IdentificationError
        If the mass of the shot could not be identified, or its recoil is lost.
    """
    case.require_roles(
        "recoil_acceleration", "breech_pressure", "brake_pressure", "recuperator_pressure", purpose="resistance"
    )
    found, m = case.identified, case.fired.rig.mechanism
    motion = "integrated acceleration" if found.route.fused is None else "fused motion of camera and accelerometer"
    parts = _parts(case, found)
    points = _points(parts)
    quantities = _quantities(parts, points, m)
    return TargetResult(
        target="resistance",
        title="Law of the recoil resistance",
        summary=(
            "R(x, v) = A p0 (L / (L - x))^n + c(x) v^2 + friction, from the pressures of recuperator and brake against "
            f"the {motion}; "
            f"the friction {parts.friction.basis}."
        ),
        quantities=quantities,
        figures=resistance_figures(parts.drawn, parts.brake, parts.energy, parts.record),
        series=_series(parts),
        tables=(_balances(points), _budget(parts)),
        reasons=(*_reasons(parts, points), *found.reasons),
        notes=_notes(parts, m),
        parameters={
            "rows": int(parts.record.rows["time"].size),
            "release_s": float(parts.record.times_s[0]),
            "end_s": float(parts.record.times_s[-1]),
            "brake_smoothness": None if isinstance(parts.brake, str) else parts.brake.profile.weight,
            "information_gain_bits": _finite(parts.friction.gain_bits),
        },
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _parts(case: Case, found: Identification) -> _Parts:
    m, scales, prepared = case.fired.rig.mechanism, scale_uncertainty(case.fired.rig), case.prepared
    record = resistance_record(case.fired, prepared, found, scales)
    reach = float(record.rows["travel"].max())
    low, high = float(record.rows["travel"][1]), float(record.rows["travel"][-2])
    curve = fit_brake(record, m.brake_area, np.linspace(low, high, CURVE))
    friction = packing_friction(
        found.inertial.calibration,
        declared_n=m.friction,
        u_declared_n=scales.friction_n,
        u_further_n=record.u_zero_pa["recuperator_pressure"] * m.recuperator_area,
    )
    gas = fit_gas(record)
    return _Parts(
        record=record,
        gas=gas,
        brake=curve,
        at_shares=fit_brake(record, m.brake_area, reach * np.array(SHARES)),
        friction=friction,
        energy=energy_balance(record.terms),
        momentum=momentum_balance(record.terms),
        drawn=resistance_over_time(found, record, gas, curve, friction, m, scales),
    )


def _points(parts: _Parts) -> tuple[BalancePoint, ...]:
    # by the forces: the largest of a velocity that rings is too large
    momentum = sum(part for name, part in parts.momentum.parts.items() if name != "motion")
    fastest = int(np.argmax(momentum))
    last = parts.record.times_s.size - 1
    instants = {Until.FASTEST: fastest, Until.END: last}
    balances = (parts.energy, parts.momentum)
    return tuple(balance.at(index, until) for balance in balances for until, index in instants.items())


def _quantities(parts: _Parts, points: Sequence[BalancePoint], m: Mechanism) -> tuple[Quantity, ...]:
    nan = math.nan
    quantities = []
    if isinstance(parts.gas, str):
        quantities += [
            Quantity(name, symbol, nan, nan, unit, parts.gas)
            for name, symbol, unit in (
                ("pressure of the recuperator in battery", "p0", "Pa"),
                ("length of its gas column", "L_gas", "m"),
                ("polytropic exponent", "n_gas", "1"),
            )
        ]
    else:
        law, u = parts.gas.law, parts.gas.u
        u_area = m.u.get("recuperator_area", 0.0) / m.recuperator_area
        volume = m.recuperator_area * law.length_m
        basis = "recuperator pressure against travel"
        quantities += [
            Quantity("pressure of the recuperator in battery", "p0", law.pressure_pa, law.pressure_pa * float(u[0]),
                     "Pa", basis),
            Quantity("length of its gas column", "L_gas", law.length_m, law.length_m * float(u[1]), "m", basis),
            Quantity("volume of its gas in battery", "V0", volume, volume * math.hypot(float(u[1]), u_area), "m3",
                     f"{basis}, times the piston's area"),
            Quantity("polytropic exponent", "n_gas", law.exponent, float(u[2]), "1", basis),
        ]  # fmt: skip
    for i, share in enumerate(SHARES):
        name, symbol = f"throttle of the brake at {100 * share:.0f} % of the travel", f"c_{100 * share:.0f}"
        if isinstance(parts.at_shares, str) or not math.isfinite(float(parts.at_shares.logarithm[i])):
            why = parts.at_shares if isinstance(parts.at_shares, str) else "no row of the brake's force there"
            quantities.append(Quantity(name, symbol, nan, nan, "N s2/m2", why))
            continue
        at, u_at = float(parts.at_shares.coefficient[i]), float(parts.at_shares.u_logarithm[i])
        place = measured(float(parts.at_shares.travel_m[i]), "m", ".4f")
        basis = worded("brake force over squared velocity, smooth in the travel, at ", place)
        half = COVERAGE_FACTOR * u_at
        interval = (at * math.exp(-half), at * math.exp(half))
        quantities.append(Quantity(name, symbol, at, at * u_at, "N s2/m2", basis, interval=interval))
    f, travel = parts.friction, float(parts.record.travel_m[-1])
    u_travel = math.hypot(parts.record.u_scale * travel, parts.record.u_travel_m)
    quantities += [
        Quantity("packing friction", "friction", f.value_n, f.u_n, "N", f.basis, f.declared_n, f.u_declared_n),
        Quantity("packing friction by the shot alone", "friction_by_shot", f.by_shot_n, f.u_by_shot_n, "N",
                 "equation of motion without the declaration", f.declared_n, f.u_declared_n),
        Quantity("travel of recoil", "travel", travel, u_travel, "m", "motion"),
    ]  # fmt: skip
    for point in points:
        symbol = f"{point.quantity}_left_{'peak' if point.until is Until.FASTEST else 'end'}"
        quantities.append(
            Quantity(f"{point.name}: what is left of the balance", symbol, point.left, point.u, point.unit,
                     f"{point.verdict}; {point.ratio:.2f} of the tolerance", 0.0, 0.0)
        )  # fmt: skip
    return tuple(quantities)


def _balances(points: Sequence[BalancePoint]) -> Table:
    rows = []
    for p in points:
        left, u = rounded(p.left, p.u)
        given, tolerance = significant(p.given, 5), significant(p.tolerance, 2)
        rows.append((p.name, given, left, u, tolerance, significant(p.ratio, 2), p.verdict))
    return Table(
        "Balances",
        "What the breech force gave, less what motion, brake, recuperator, friction, gravity and carriage took.",
        (
            "balance, J and N s",
            "given",
            "left",
            "standard uncertainty",
            "tolerance, 95 %",
            "ratio to tolerance",
            "verdict",
        ),
        tuple(rows),
    )


def _budget(parts: _Parts) -> Table:
    last = parts.record.times_s.size - 1
    left: dict[str, tuple[float, float]] = {}
    for cause in parts.energy.errors:
        named = together(cause)
        energy, momentum = left.get(named, (0.0, 0.0))
        of_one = float(parts.energy.errors[cause][last]), float(parts.momentum.errors[cause][last])
        left[named] = math.hypot(energy, of_one[0]), math.hypot(momentum, of_one[1])
    rows = tuple(
        (cause, significant(energy, 2), significant(momentum, 2))
        for cause, (energy, momentum) in left.items()
        if energy or momentum
    )
    return Table(
        "What may be left of the balances",
        "Until the end of recoil, if each cause alone is off by its standard uncertainty.",
        ("cause", "energy, J", "momentum, N s"),
        rows,
    )


def _reasons(parts: _Parts, points: Sequence[BalancePoint]) -> tuple[Reason, ...]:
    laws = {"recuperator_pressure": parts.gas, "brake_pressure": parts.brake}
    reasons = [Reason(ReasonCode.NOT_IDENTIFIED, role, law) for role, law in laws.items() if isinstance(law, str)]
    for point in points:
        if point.violated:
            text = worded(
                f"the balance of {point.name} is violated: ",
                in_unit(point.left, 3, point.unit),
                " are left of ",
                in_unit(point.given, 4, point.unit),
                f", {point.ratio:.1f} times the tolerance; a mass, an area, a "
                "gauge or a clock is off by more than is stated of it",
            )
            reasons.append(Reason(ReasonCode.BALANCE, point.quantity, text))
    difference = parts.drawn.law_departure(parts.record.terms.force_errors_n)
    if difference is not None and abs(difference[0]) > CRITICAL_VALUE * difference[1]:
        text = worded(
            "behind the pulse the law differs from the resistance by the motion by ",
            measured(difference[0], "N", lambda number: significant(number, 3)),
            f" on the average, {abs(difference[0]) / difference[1]:.1f} of its standard uncertainties",
        )
        reasons.append(Reason(ReasonCode.MODEL, "resistance", text))
    return tuple(reasons)


def _notes(parts: _Parts, m: Mechanism) -> tuple[Note, ...]:
    f = parts.friction
    notes = []
    if f.u_declared_n > 0:
        share = 100.0 * (1.0 - (f.u_n / f.u_declared_n) ** 2)
        compared = worded(
            "friction: declared ", measured(f.declared_n, "N", "g"), " (u ", measured(f.u_declared_n, "N", "g"),
            "), by the shot alone ", measured(f.by_shot_n, "N", ".0f"), " (u ", measured(f.u_by_shot_n, "N", ".0f"),
            "), together ", measured(f.value_n, "N", ".0f"), " (u ", measured(f.u_n, "N", ".0f"),
            f"); the shot takes {share:.0f} % off the variance, {f.gain_bits:.2f} bits",
        )  # fmt: skip
        notes.append(Note(NoteCode.COMPARISON, "friction", compared))
    else:
        text = "the rig declares no u_friction: the friction is taken as exact where it enters a budget"
        notes.append(Note(NoteCode.ASSUMPTION, "friction", text))
    if parts.record.zero_assumed:
        text = (
            "the recuperator's gauge reads no zero in the shot and the rig states none: its zero is taken as uncertain "
            "by 0.05 % of its range"
        )
        notes.append(Note(NoteCode.ZERO, "recuperator_pressure", text))
    if "m3" not in m.u:
        text = "the rig declares no u_m3: the balances take the specification mass as exact"
        notes.append(Note(NoteCode.ASSUMPTION, "m3", text))
    return tuple(notes)


def _series(parts: _Parts) -> Series:
    record, drawn = parts.record, parts.drawn
    return Series(
        {
            "time_s": record.times_s,
            "travel_m": record.travel_m,
            "velocity_m_s": record.velocity_m_s,
            "u_velocity_m_s": record.u_velocity_m_s,
            "resistance_by_motion_n": drawn.motion_n,
            "u_resistance_by_motion_n": drawn.u_motion_n,
            "brake_n": drawn.brake_n,
            "recuperator_n": drawn.recuperator_n,
            "friction_n": drawn.friction_n,
            "law_n": drawn.law_n,
            "energy_left_j": parts.energy.left,
            "u_energy_left_j": parts.energy.u,
            "momentum_left_n_s": parts.momentum.left,
            "u_momentum_left_n_s": parts.momentum.u,
        }
    )
