"""Target ``inertia-force``: inertia forces of the recoiling part along and across the bore, and at the trunnion."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.rounding import significant
from recoil_identification.report.figure.figure import TIME, Figure, Panel, Span, Trace
from recoil_identification.targets.parameters.base_parameters import BaseParameters
from recoil_identification.targets.parameters.inertia_forces import (
    FORCES,
    MOMENTS,
    OWN,
    UNITS,
    InertiaForces,
    Peak,
    forces_with_bands,
    mass_alone,
    peak,
)
from recoil_identification.targets.parameters.mechanism_fit import fit_mechanism
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_identification.targets.parameters.recorded_rows import mechanism_rows
from recoil_identification.targets.parameters.sensor_errors import RELEASED
from recoil_identification.targets.parameters.target import camera_observation, require_motion, without_lines
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, Series, Table, TargetResult
from recoil_processing.filters import ROWS_PER_CUTOFF
from recoil_rigs.shots.fired_shot import FiredShot

PURPOSE = "inertia forces"
TURNING_CUTOFF_HZ = 300.0
"""Cut-off of angular rates and the carriage's accelerations: stress waves on a gyro, differentiated, would hide its
motion."""
FIT_CUTOFF_HZ = 150.0
"""Cut-off of the mass and the comparison with the gauges: the pulse is in it, and no stress wave."""
OTHER_CUTOFF = 0.7
"""Factor on the cut-offs that a careful analyst might have taken instead."""
ROWS_PER_CUTOFF_OF_SERIES = 10.0
"""Rows per period of the cut-off of the series: its peaks are then between samples by less than 0.1 % of their
height."""
LEAST_AGREEMENT = 0.9
"""Share of the rows in which inertia and gauges must agree; errors of scale last, so that rows fail together."""
TITLES = {
    "bore": "inertia force and weight of the recoiling part along the bore, rearward (-m3 a')",
    "bore_inertia": "inertia force of the recoiling part along the bore, rearward",
    "transverse": "inertia force of the recoiling part across the bore, upward",
    "recoiling_x": "inertia force of the recoiling part at the trunnion, forward",
    "recoiling_y": "inertia force of the recoiling part at the trunnion, upward",
    "recoiling_moment": "moment of it about the trunnion, raising the muzzle",
    "mechanism_x": "inertia force of tipping and recoiling part at the trunnion, forward",
    "mechanism_y": "inertia force of tipping and recoiling part at the trunnion, upward",
    "mechanism_moment": "moment of it about the trunnion, raising the muzzle",
}
MECHANISM_SYMBOLS = ("m2", "s2", "d2", "J2")


def find(case: Case) -> TargetResult:
    """Evaluate the inertia forces of a shot.

    Raises
    ------
    IdentificationError
        If channels or the pre-trigger baseline are missing, or as of the mass.
    """
    require_motion(case, PURPOSE)
    rig, prepared = case.fired.rig, case.prepared
    m = rig.mechanism
    low_pass = case.identified.route.filter_choice.low_pass
    rows_hz = ROWS_PER_CUTOFF_OF_SERIES * low_pass.cutoff_hz

    def behind(cutoff_hz: float, turning_hz: float) -> MechanismRows:
        filters = (low_pass.at(min(low_pass.cutoff_hz, hz)) for hz in (cutoff_hz, turning_hz))
        first, turning = filters
        return mechanism_rows(
            FiredShot(case.fired.shot, without_lines(rig)),
            prepared,
            prepared.recorded,
            {},
            first,
            rows_hz=rows_hz,
            turning=turning,
        )

    rows = behind(low_pass.cutoff_hz, TURNING_CUTOFF_HZ)
    narrower = behind(OTHER_CUTOFF * low_pass.cutoff_hz, OTHER_CUTOFF * TURNING_CUTOFF_HZ)
    slow = behind(FIT_CUTOFF_HZ, FIT_CUTOFF_HZ)
    thin = slow.every(max(1, round(rows_hz / (ROWS_PER_CUTOFF * slow.cutoff_hz))))
    fit = fit_mechanism(
        thin, camera_observation(case, thin), m.m3, equations=(4,), unknowns=BaseParameters(*mass_alone(m))
    )
    mass, u_mass = float(fit.values[0]), math.sqrt(float(fit.covariance[0, 0]))
    found = forces_with_bands(rows, narrower, fit, m)
    inside = rows.trusted & (rows.times_s <= prepared.recorded.interval_s[1])
    peaks = {
        name: peak(found.times_s, np.where(inside, found.values[:, k], np.nan), found.u[:, k])
        for k, name in enumerate(FORCES)
    }
    missing = [s for s in (*MECHANISM_SYMBOLS, "J3c") if math.isnan(getattr(m, s))]
    difference, u_difference = _against_gauges(slow, mass, u_mass)
    ratio = np.abs(difference / u_difference)[slow.recoils]
    agreement = float(np.mean(ratio <= COVERAGE_FACTOR)) if ratio.size else math.nan
    plausible = float(np.mean(ratio <= CRITICAL_VALUE)) if ratio.size else math.nan
    reasons = case.doubts_of_the_mass()
    if not plausible >= LEAST_AGREEMENT:
        text = (
            f"inertia force and gauges differ by more than {CRITICAL_VALUE} standard uncertainties in "
            f"{100 * (1 - plausible):.0f} % of the recoil: a sensor, an area or the mass is off by more than declared."
        )
        reasons.append(Reason(ReasonCode.AGREEMENT, "gauges", text))
    same, apart = case.beside_the_shots_mass(mass, u_mass)
    reasons += apart
    undeclared = [s for s in OWN if s not in m.u and math.isfinite(getattr(m, s))]
    agreed = (
        f"inertia and gauges agree within their common 95 % band in {100 * agreement:.0f} % of the recoil; the mass is "
        "found from the same gauges, so that this checks shape and calibration, not the scale alone."
    )
    notes = [Note(NoteCode.COMPARISON, "gauges", agreed), *same]
    if missing:
        text = f"the rig's [mechanism] does not declare {', '.join(missing)}: what needs them is not evaluated."
        notes.append(Note(NoteCode.NOT_IDENTIFIED, None, text))
    if undeclared:
        text = f"taken as exactly known, because the rig declares no u_<name>: {', '.join(undeclared)}."
        notes.append(Note(NoteCode.ASSUMPTION, None, text))
    quantities = [
        Quantity(
            "recoiling mass", "m3", mass, u_mass, "kg",
            "equation of motion along the bore, sensors' errors as further unknowns", m.m3, m.u.get("m3"),
            of_recoiling_part=True,
        ),
        *(_quantity(name, UNITS[k], peaks[name]) for k, name in enumerate(FORCES)),
    ]  # fmt: skip
    return TargetResult(
        target="inertia-force",
        title="Inertia forces of the recoiling part and of the mechanism",
        summary=(
            "Inertia forces from the recoiling part's accelerometer, the carriage's accelerometers and the angular "
            f"rates, with the mass that equation (36) gives, behind one low-pass at {low_pass.cutoff_hz:.0f} Hz."
        ),
        quantities=tuple(quantities),
        figures=_figures(rows, slow, found, difference, u_difference, prepared.recorded.interval_s),
        series=_series(rows, slow, found, difference, u_difference),
        tables=(_budget(found, peaks),),
        reasons=tuple(reasons),
        notes=tuple(notes),
        parameters={
            "cutoff_hz": low_pass.cutoff_hz,
            "agreement_with_gauges": agreement,
            "cutoff_of_turning_hz": min(low_pass.cutoff_hz, TURNING_CUTOFF_HZ),
            "cutoff_of_mass_hz": slow.cutoff_hz,
        },
    )


def _against_gauges(rows: MechanismRows, mass: float, u_mass: float) -> tuple[Array, Array]:
    """Return inertia's side of equation (36) less the gauges', and its standard uncertainty by the calibrations."""
    Y, Q = rows.equations()
    lever = np.array([1.0, rows.place[0], rows.place[1]])
    # only the mass is unknown: the accelerometer's own place stands for the centre's, whose part is small
    inertia = mass * (Y[:, 4, 8] + Y[:, 4, 9] * lever[1] + Y[:, 4, 10] * lever[2])
    variance = (u_mass / mass * inertia) ** 2
    for error in rows.errors:
        moved = np.zeros_like(inertia)
        for name, direction in error.directions.items():
            if name in RELEASED:
                moved = moved + direction
            elif name == "acc":
                moved = moved - mass * direction
        variance = variance + (error.u * moved) ** 2
    noise = mass * rows.noise.get("acc", 0.0)
    return inertia - Q[:, 4], np.sqrt(variance + noise**2)


def _quantity(name: str, unit: str, one: Peak | None) -> Quantity:
    if one is None:
        return Quantity(
            f"peak {TITLES[name]}", f"peak_{name}", math.nan, math.nan, unit,
            "not evaluated: the rig's [mechanism] does not declare all that it needs",
        )  # fmt: skip
    basis = f"largest by magnitude up to the end of recoil, at {one.time_s:.4f} s"
    return Quantity(f"peak {TITLES[name]}", f"peak_{name}", one.value, one.u, unit, basis)


def _series(
    rows: MechanismRows, slow: MechanismRows, found: InertiaForces, difference: Array, u_difference: Array
) -> Series:
    columns = {"time_s": rows.times_s}
    for k, name in enumerate(FORCES):
        unit = "n_m" if name in MOMENTS else "n"
        columns[f"{name}_{unit}"] = np.where(rows.trusted, found.values[:, k], np.nan)
        columns[f"u_{name}_{unit}"] = np.where(rows.trusted, found.u[:, k], np.nan)
    columns["inertia_less_gauges_n"] = np.where(slow.recoils, difference, np.nan)
    columns["u_inertia_less_gauges_n"] = np.where(slow.recoils, u_difference, np.nan)
    return Series(columns)


def _budget(found: InertiaForces, peaks: dict[str, Peak | None]) -> Table:
    lines = []
    for k, name in enumerate(FORCES):
        one = peaks[name]
        if one is None:
            continue
        i = int(np.argmin(np.abs(found.times_s - one.time_s)))
        for source, change in found.sources.items():
            lines.append((TITLES[name], source, significant(abs(float(change[i, k])), 2), UNITS[k]))
    return Table(
        "Uncertainty of the peaks",
        "Standard uncertainty that each source leaves in the peak; their root sum of squares is the peak's.",
        ("peak", "source", "standard uncertainty", "unit"),
        tuple(lines),
    )


def _figures(
    rows: MechanismRows,
    slow: MechanismRows,
    found: InertiaForces,
    difference: Array,
    u_difference: Array,
    interval_s: tuple[float, float],
) -> tuple[Figure, ...]:
    times = rows.times_s
    length = interval_s[1] - interval_s[0]
    shown = (interval_s[0] - 0.1 * length, interval_s[1] + 0.3 * length)
    recoil = (Span("recoil", *interval_s),)

    def band(name: str, label: str) -> Trace:
        k = FORCES.index(name)
        value = 1e-3 * np.where(rows.trusted, found.values[:, k], np.nan)
        half = 1e-3 * COVERAGE_FACTOR * found.u[:, k]
        return Trace(f"{label}, 95 % band", times, value, "band", f"k{UNITS[k]}", value - half, value + half)

    gauges = np.where(rows.recoils, -1e-3 * rows.equations()[1][:, 4], np.nan)
    left = np.where(slow.recoils, 1e-3 * difference, np.nan)
    half = 1e-3 * COVERAGE_FACTOR * u_difference
    bore = Figure(
        "bore",
        "Inertia force along the bore",
        "Inertia force of the recoiling part with its weight's component, and the gauges' net force that it balances; "
        f"their difference is compared below {slow.cutoff_hz:.0f} Hz.",
        TIME,
        (
            Panel(
                "force, rearward, kN",
                (band("bore", "-m3 a'"), Trace("gauges, -(P - R_f)", times, gauges, "measured", "kN")),
                spans=recoil,
            ),
            Panel(
                "inertia less gauges, kN",
                (Trace("difference, 95 % band of zero about it", times, left, "band", "kN", left - half, left + half),),
            ),
            Panel("across the bore, kN", (band("transverse", "inertia across the bore"),), spans=recoil),
        ),
        shown=shown,
    )
    panels = [
        Panel(label, tuple(band(f"{body}_{part}", title) for body, title in bodies), spans=recoil)
        for part, label in (("x", "forward, kN"), ("y", "upward, kN"), ("moment", "moment, kN m"))
        if (
            bodies := [
                (body, title)
                for body, title in (("recoiling", "recoiling part"), ("mechanism", "with the tipping part"))
                if np.isfinite(found.values[:, FORCES.index(f"{body}_{part}")]).any()
            ]
        )
    ]
    if not panels:
        return (bore,)
    trunnion = Figure(
        "trunnion",
        "Inertia forces at the trunnion",
        "Resultant of the inertia forces of the bodies that hang on the trunnion, and their moment about it.",
        TIME,
        tuple(panels),
        shown=shown,
    )
    return bore, trunnion
