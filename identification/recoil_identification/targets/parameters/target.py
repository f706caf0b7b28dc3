"""Target ``parameters``: masses, first moments and inertias from all five equations of motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.rounding import significant
from recoil_identification.inference.unknown import Prior
from recoil_identification.targets.parameters.load_cells import LOAD_CELLS, lost_equations, measured_loads
from recoil_identification.targets.parameters.mechanism_fit import (
    LARGEST_U,
    MechanismFit,
    fit_mechanism,
    natural_scales,
)
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_identification.targets.parameters.recorded_rows import mechanism_rows
from recoil_identification.targets.parameters.sensor_errors import scale_of
from recoil_identification.targets.parameters.tables import (
    declared,
    expressions,
    figure_of_equations,
    figure_of_pivots,
    table_of_combinations,
    table_of_errors,
)
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, TargetResult
from recoil_processing.shot.camera_motion import motion_fit
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.mechanism.mechanism_regressor import EQUATIONS, LOADS, PARAMETER_UNITS, PARAMETERS
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot

LARGEST_CUTOFF_HZ = 80.0
"""The carriage moves below 30 Hz; the noise of a gyro's derivative grows with the 1.5th power of the cut-off."""
LARGEST_RESIDUAL = 0.02
"""Share of an equation's largest load that its residual may have; beyond it the three bodies are not the mechanism."""
ONE_BY_CHANCE = 0.01
"""Probability that in a sound shot any of the errors is beyond what is taken for chance (Bonferroni's bound)."""
ROLES = (
    "recoil_acceleration", "carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate",
    "breech_pressure", "brake_pressure", "recuperator_pressure",
)  # fmt: skip
PURPOSE = "masses and inertias from the equations of motion"


def find(case: Case) -> TargetResult:
    """Identify what the equations of motion tell of the three bodies.

    Raises
    ------
    IdentificationError
        If channels, lengths or the pre-trigger baseline are missing, or as of the mass.
    """
    rows, fit = fitted(case)
    rig = case.fired.rig
    quantities = _quantities(rig, rows, fit)
    missing = lost_equations(fit.usable, rows.measured)
    count = len(fit.identifiable.values)
    summary = (
        f"{count} combinations of the {len(PARAMETERS)} masses, first moments and inertias of the three bodies from "
        f"the equations {', '.join(EQUATIONS[i] for i in fit.usable)}, by least squares with every sensor's error as a "
        f"further unknown, behind one low-pass at {rows.cutoff_hz:.0f} Hz."
    )
    notes = [Note(NoteCode.NOT_USED, None, f"{missing}.")] if missing else []
    mass = next(one for one in quantities if one.symbol == symbol_of(PARAMETERS.index("m3")))
    same, apart = case.beside_the_shots_mass(mass.value, mass.u) if mass.identified else ([], [])
    notes += same
    silent = [one.name for one in quantities if not one.identified]
    if silent:
        text = f"not identified: {', '.join(silent)}; each with its reason in the table."
        notes.append(Note(NoteCode.NOT_IDENTIFIED, None, text))
    return TargetResult(
        target="parameters",
        title="Masses, first moments and inertias",
        summary=summary,
        quantities=quantities,
        figures=(figure_of_equations(rows, fit), figure_of_pivots(fit)),
        tables=(table_of_combinations(rig, rows, fit), table_of_errors(rows, fit)),
        reasons=(*_reasons(case, rows, fit), *apart),
        notes=tuple(notes),
        parameters={
            "cutoff_hz": rows.cutoff_hz,
            "equations": [EQUATIONS[i] for i in fit.usable],
            "rows": fit.rows,
            "structural_rank": len(fit.structural.leading),
            "numerical_rank": count,
            "largest_u_in_natural_scales": LARGEST_U,
        },
    )


def fitted(case: Case) -> tuple[MechanismRows, MechanismFit]:
    """Return the rows of the equations of motion, and what they say.

    Raises
    ------
    IdentificationError
        As of `find`.
    """
    require_motion(case, PURPOSE)
    prepared, rig = case.prepared, case.fired.rig
    loads = measured_loads(FiredShot(case.fired.shot, rig), prepared)
    if loads:
        case.require_symbols("e", "L", purpose=PURPOSE)
    chosen = case.identified.route.filter_choice.low_pass
    low_pass = chosen.at(min(chosen.cutoff_hz, LARGEST_CUTOFF_HZ))
    rows = mechanism_rows(FiredShot(case.fired.shot, without_lines(rig)), prepared, prepared.recorded, loads, low_pass)
    return rows, fit_mechanism(rows, camera_observation(case, rows), rig.mechanism.m3)


def require_motion(case: Case, purpose: str) -> None:
    """Refuse a shot in which the motion of all three bodies was not measured.

    Raises
    ------
    IdentificationError
        If channels, their clocks or the pre-trigger baseline are missing.
    """
    case.require_roles(*ROLES, purpose=purpose)
    signals = case.prepared.signals
    gone = [role for role in ROLES if role not in signals.series or not np.isfinite(signals.series[role]).any()]
    if gone:
        raise IdentificationError(
            f"{purpose}: no sample of {', '.join(gone)} can be used",
            expected=", ".join(ROLES),
            remedy="mend the alignment of their clocks, or check their files and ranges",
        )
    if not signals.baseline_s[0] < signals.baseline_s[1]:
        raise IdentificationError(
            f"{purpose}: the record has no pre-trigger baseline",
            expected="5 ms or more, to take the sensors' zeros and the loads at rest from",
            remedy="keep more of the record before the trigger",
        )


def without_lines(rig: Rig) -> Rig:
    """Put numbers where lines of load are not declared: the equation along the bore has none of them."""
    m = rig.mechanism
    e, L = (0.0 if math.isnan(m.e) else m.e), (1.0 if math.isnan(m.L) else m.L)
    return replace(rig, mechanism=replace(m, e=e, L=L))


def camera_observation(case: Case, rows: MechanismRows) -> tuple[Prior, ...]:
    """Return what the camera says of the accelerometer: its gain is ``(1 + dc) / (1 + da)``."""
    found = motion_fit(case.prepared.camera_clock)
    accelerometer, camera = scale_of("recoil_acceleration"), scale_of("recoil_displacement")
    signs = {accelerometer: 1.0, camera: -1.0}
    names = tuple(error.source for error in rows.errors if error.source in signs)
    if found is None or accelerometer not in names:
        return ()
    gain, u_gain = float(found["gain"]), float(found["u_gain"])
    variance = max(u_gain / gain**2, 1e-9) ** 2
    weights = np.array([[signs[name] for name in names]])
    return (
        Prior(
            (ErrorSource(SourceKind.CAMERA_GAIN),), names, weights, np.array([1.0 / gain - 1.0]), np.array([[variance]])
        ),
    )


def symbol_of(parameter: int) -> str:
    """Return the report's key of the combination that a standard parameter leads."""
    return f"base_{PARAMETERS[parameter].replace(' ', '_')}"


def _quantities(rig: Rig, rows: MechanismRows, fit: MechanismFit) -> tuple[Quantity, ...]:
    scales = natural_scales(rows.geometry, rig.mechanism.m3)
    written = expressions(fit.structural, PARAMETERS, scales)
    u = np.sqrt(np.diag(fit.covariance))
    found = []
    for expression, j, value, own, row in zip(
        written, fit.structural.leading, fit.values, u, fit.structural.combinations, strict=True
    ):
        expected, u_expected = declared(rig.mechanism, row)
        share = own / scales[j]
        # a direction in which the shot says nothing at all has no uncertainty to state
        known = share <= LARGEST_U and own > 0
        basis = (
            f"least squares of {fit.rows} rows of {len(fit.usable)} equations of motion"
            if known
            else f"not identified: this shot leaves a standard uncertainty of {significant(100 * share, 2)} % of its "
            "natural scale; see the combinations that it tells"
        )
        found.append(
            Quantity(
                expression, symbol_of(j), value if known else math.nan, own if known else math.nan, PARAMETER_UNITS[j],
                basis, expected, u_expected,
                of_recoiling_part=PARAMETERS[j] == "m3" and np.count_nonzero(row) == 1,
            )
        )  # fmt: skip
    for j, name in enumerate(PARAMETERS):
        if j in fit.structural.leading:
            continue
        expected, u_expected = declared(rig.mechanism, np.eye(len(PARAMETERS))[j])
        owners = [
            expression for expression, row in zip(written, fit.structural.combinations, strict=True) if abs(row[j]) > 0
        ]
        basis = (
            f"not identifiable alone: it moves with others as one, in {'; '.join(owners)}"
            if owners
            else f"not identifiable: it is in none of the usable equations ({_what_lacks(rows)})"
        )
        found.append(Quantity(name, symbol_of(j), math.nan, math.nan, PARAMETER_UNITS[j], basis, expected, u_expected))
    return tuple(found)


def _what_lacks(rows: MechanismRows) -> str:
    lacking = [LOAD_CELLS[name] for name, there in zip(LOADS, rows.measured, strict=True) if not there]
    return f"without {', '.join(lacking)}" if lacking else "with all loads measured"


def _reasons(case: Case, rows: MechanismRows, fit: MechanismFit) -> tuple[Reason, ...]:
    reasons = case.doubts_of_the_mass()
    _, Q = rows.equations()
    for i in fit.usable:
        left = fit.residuals[:, i]
        seen = np.isfinite(left)
        share = float(np.sqrt(np.mean(left[seen] ** 2)) / np.max(np.abs(Q[seen, i])))
        if share > LARGEST_RESIDUAL:
            text = (
                f"the equation of motion {EQUATIONS[i]} does not hold: its residual is {100 * share:.1f} % of its "
                f"largest load, more than {100 * LARGEST_RESIDUAL:.0f} %."
            )
            reasons.append(Reason(ReasonCode.MODEL, EQUATIONS[i], text))
    # of many errors one is far off by chance more often than one of them is
    critical = -float(ndtri(0.5 * ONE_BY_CHANCE / max(len(rows.errors), 1)))
    for error, size in zip(rows.errors, fit.errors, strict=True):
        if abs(fit.told.normalised_residual(error.source)) > critical and abs(size) > error.u:
            text = (
                f"{error.source}: the shot wants an error of {significant(size, 2)}, {abs(size) / error.u:.1f} of its "
                "standard uncertainties."
            )
            reasons.append(Reason(ReasonCode.SENSOR, error.source, text))
    for j, value, row in zip(fit.structural.leading, fit.values, fit.structural.combinations, strict=True):
        u = math.sqrt(float(fit.covariance[fit.structural.leading.index(j)][fit.structural.leading.index(j)]))
        positive = PARAMETERS[j] in ("m1", "J1", "m3", "J3A") and np.all(row >= 0)
        if positive and value < -2.0 * u:
            text = f"{PARAMETERS[j]} comes out negative, {significant(value, 3)} {PARAMETER_UNITS[j]}."
            reasons.append(Reason(ReasonCode.IMPLAUSIBLE, PARAMETERS[j], text))
    return tuple(reasons)
