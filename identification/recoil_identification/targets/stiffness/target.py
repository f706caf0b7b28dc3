"""Target ``stiffness``: stiffness and damping of elevating gear and ground, for the whole shot and over time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.rounding import MINUS, in_unit, significant
from recoil_identification.targets.stiffness.carriage_record import MOTION_ROLES, CarriageRecord, carriage_record
from recoil_identification.targets.stiffness.figures import stiffness_figures
from recoil_identification.targets.stiffness.restoring_force import RestoringTrace
from recoil_identification.targets.stiffness.stiffness_budget import (
    SYMBOLS,
    SupportEstimates,
    estimate_supports,
    noisy_records,
)
from recoil_identification.targets.stiffness.support_modes import DERIVED, OF_BOTH_FEET, derived_with_u
from recoil_identification.targets.stiffness.support_traces import LARGEST_RELATIVE_U, noise_shares, trace_supports
from recoil_identification.targets.stiffness.supports import PARAMETERS, SUPPORT_NAMES, Assumptions, supports_of
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, Series, Table, TargetResult
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.signals import Signals
from recoil_processing.shot.verdict.mass_reasons import doubts_of
from recoil_rigs.mechanism.model import Mechanism

LARGEST_RESIDUAL_SHARE = 0.25
"""Share of the load that the fit may leave; beyond it the support is not a spring with a damper."""
LEAST_SHARE_IN_BUDGET = 0.1
"""Share of a parameter's standard uncertainty; smaller contributions are not printed."""
WINDOW_S = 0.06
"""Memory of the estimates over time: long enough to tell stiffness from damping."""
TRACE_DRAWS = 12
"""Draws of the sensors' errors, for the uncertainty over time."""
ROLES = (*MOTION_ROLES, *PRESSURE_ROLES, "recoil_acceleration")
KNOWN = ("m1", "m2", "J1", "J2", "J3c", "X1", "Y1", "s2", "d2", "e", "L", "f")
"""Symbols that the rig file must declare beside what every rig has."""

NAMES = {
    "k_elevating": ("stiffness of the elevating gear", "N m/rad"),
    "c_elevating": ("damping of the elevating gear", "N m s/rad"),
    "k_ground_x": ("stiffness of the ground at C, horizontal", "N/m"),
    "c_ground_x": ("damping of the ground at C, horizontal", "N s/m"),
    "friction_d": ("friction coefficient of the ground at D", "1"),
    "k_ground_c": ("stiffness of the ground at C, vertical", "N/m"),
    "c_ground_c": ("damping of the ground at C, vertical", "N s/m"),
    "k_ground_d": ("stiffness of the ground at D, vertical", "N/m"),
    "c_ground_d": ("damping of the ground at D, vertical", "N s/m"),
}
"""Symbol -> name and unit."""


def find(case: Case) -> TargetResult:
    """Identify stiffness and damping of the supports of one shot.

    Raises
    ------
    IdentificationError
        If a channel, or a value of the mechanism that is taken as known, is missing.
    """
    purpose = "stiffness of elevating gear and ground"
    case.require_roles(*ROLES, purpose=purpose)
    case.require_symbols(*KNOWN, purpose=purpose)
    prepared, mechanism = case.prepared, case.fired.rig.mechanism
    record = carriage_record(prepared, case.fired.rig)
    found = estimate_supports(record, prepared.signals, case.fired)
    judged, reasons = judge(found)
    reasons = (*doubts_of(case.fired.rig), *case.failed_checks(*ROLES), *reasons, *_unknown_zeros(prepared.signals))
    noisy = list(noisy_records(record, prepared.signals, case.fired.shot, TRACE_DRAWS, zeros=True))
    traces = trace_supports(record, noisy, mechanism, found, WINDOW_S)
    supports = supports_of(record, mechanism, Assumptions())
    names = ", ".join(SUPPORT_NAMES.values())
    return TargetResult(
        target="stiffness",
        title="Stiffness and damping of elevating gear and ground",
        summary=(
            f"Loads on {names} by inverse dynamics from pressures, angular rates and the carriage's accelerometers, "
            "regressed on the deflections that the same motion gives; masses, inertias and lengths are those of the "
            "rig file."
        ),
        quantities=_quantities(found, judged, mechanism),
        figures=stiffness_figures(record, supports, found, judged, traces),
        series=_series(traces, judged),
        tables=(_fits_table(found, noise_shares(record, noisy, mechanism, found)), _budget_table(found)),
        reasons=reasons,
        notes=_notes(record, found),
        parameters={
            "bands": {
                name: {"low_pass_hz": b.low_pass_hz, "high_pass_hz": b.high_pass_hz, "drift_order": b.drift_order}
                for name, b in found.bands.items()
            },
            "window_s": WINDOW_S,
            "interval_s": list(record.interval_s),
            "common_response_hz": None if record.narrowest is None else record.narrowest.cutoff_hz,
        },
    )


def judge(found: SupportEstimates) -> tuple[Array, tuple[Reason, ...]]:
    """Return which parameters are identified, and why the others are not.

    Returns
    -------
    values : ndarray, shape (9,)
        NaN where not identified.
    reasons : tuple of Reason
    """
    values, reasons = found.values.copy(), []
    for name, symbols in PARAMETERS.items():
        fit, places = found.fits[name], [SYMBOLS.index(symbol) for symbol in symbols]
        if not fit.identifiable:
            values[places] = np.nan
            text = (
                f"{SUPPORT_NAMES[name]}: the shot does not excite it enough to tell its parameters apart "
                f"({fit.rows} rows, smallest singular value {significant(float(fit.singular_values[-1]), 2)})"
            )
            reasons.append(Reason(ReasonCode.NOT_IDENTIFIED, name, text))
            continue
        if fit.residual_share > LARGEST_RESIDUAL_SHARE:
            text = (
                f"{SUPPORT_NAMES[name]}: spring and damper leave {100 * fit.residual_share:.0f} % of the load, "
                f"limit {100 * LARGEST_RESIDUAL_SHARE:.0f} %"
            )
            reasons.append(Reason(ReasonCode.MODEL, name, text))
        for symbol, place in zip(symbols, places, strict=True):
            u, value = found.u(symbol), float(values[place])
            if not u <= LARGEST_RELATIVE_U * abs(value):
                values[place] = np.nan
                text = worded(
                    f"{NAMES[symbol][0]} is not identified: its standard uncertainty of ",
                    in_unit(u, 2, NAMES[symbol][1]),
                    " exceeds half of the estimate",
                )
                reasons.append(Reason(ReasonCode.NOT_IDENTIFIED, symbol, text))
            elif value < 0:
                text = f"{NAMES[symbol][0]} came out negative: the model does not hold"
                reasons.append(Reason(ReasonCode.IMPLAUSIBLE, symbol, text))
    return values, tuple(reasons)


def _unknown_zeros(signals: Signals) -> tuple[Reason, ...]:
    return tuple(
        Reason(ReasonCode.BASELINE, role, f"the zero of {role} is not known: the record has no pre-trigger baseline")
        for role in MOTION_ROLES
        if role in signals.offsets and not math.isfinite(signals.offsets[role].u)
    )


def _quantities(found: SupportEstimates, judged: Array, mechanism: Mechanism) -> tuple[Quantity, ...]:
    quantities = []
    for name, symbols in PARAMETERS.items():
        band = found.bands[name]
        for symbol in symbols:
            value = float(judged[SYMBOLS.index(symbol)])
            friction = symbol == "friction_d"
            quantities.append(
                Quantity(
                    *NAMES[symbol][:1],
                    symbol,
                    value,
                    found.u(symbol) if math.isfinite(value) else math.nan,
                    NAMES[symbol][1],
                    f"load on deflection, {band.high_pass_hz:g} to {band.low_pass_hz:g} Hz"
                    if math.isfinite(value)
                    else "not identified, see the reasons",
                    expected=mechanism.f if friction else None,
                    u_expected=mechanism.u.get("f") if friction else None,
                )
            )
    values, u = derived_with_u(mechanism, judged, found.covariance)
    for (symbol, name, unit), value, u_value in zip(DERIVED, values, u, strict=True):
        basis = "from stiffness, damping and the declared inertia"
        if symbol in OF_BOTH_FEET:
            basis = "sum; it is better known than its parts where their errors are opposed"
        if not math.isfinite(value):
            basis = "no such oscillation, or a parameter it hangs on is not identified"
        quantities.append(Quantity(name, symbol, float(value), float(u_value), unit, basis))
    return tuple(quantities)


def _series(traces: dict[str, RestoringTrace], judged: Array) -> Series:
    first = next(iter(traces.values()))
    columns: dict[str, Array] = {"time_s": first.times_s}
    for name, symbols in PARAMETERS.items():
        for number, symbol in enumerate(symbols):
            unit = NAMES[symbol][1].replace(" ", "_").replace("/", "_per_")
            key = symbol if unit == "1" else f"{symbol}_{unit}"
            known = math.isfinite(judged[SYMBOLS.index(symbol)])
            blank = np.full(first.times_s.size, np.nan)
            columns[key] = traces[name].parameters[:, number] if known else blank
            columns[f"u_{key}"] = traces[name].u[:, number] if known else blank
    return Series(columns)


def _fits_table(found: SupportEstimates, noise: Mapping[str, tuple[float, float]]) -> Table:
    rows = []
    for name, fit in found.fits.items():
        band = found.bands[name]
        weakest = " ".join(f"{share:+.2f} {column}" for column, share in fit.weakest.items() if abs(share) >= 0.1)
        rows.append(
            (
                SUPPORT_NAMES[name],
                f"{band.high_pass_hz:g} to {band.low_pass_hz:g}",
                str(fit.rows),
                f"{100 * fit.residual_share:.1f}",
                " / ".join(significant(100 * share, 2) for share in noise[name]),
                ", ".join(significant(float(s), 2) for s in fit.singular_values),
                weakest.replace("-", MINUS),
            )
        )
    return Table(
        "What the shot tells of each support",
        "Singular values of the columns at unit length, drift included; the combination that belongs to the smallest "
        "is what the data tell least of. The load is regressed on the deflection; what noise of the deflection does to "
        "that is in the budget, found by adding the noise once more.",
        (
            "support",
            "band, Hz",
            "rows",
            "residual, % of load",
            "noise of load / deflection, %",
            "singular values",
            "weakest combination",
        ),
        tuple(rows),
    )


def _budget_table(found: SupportEstimates) -> Table:
    total = np.sqrt(np.diag(found.covariance))
    size = np.abs(found.values)
    rows = [("noise and residual", np.sqrt(np.diag(found.random)))]
    rows += [(source, np.abs(change)) for source, change in found.changes.items()]
    shown = [(s, c) for s, c in rows if np.any(np.nan_to_num(c) >= LEAST_SHARE_IN_BUDGET * np.nan_to_num(total))]
    shown.append(("together", total))
    return Table(
        "Uncertainty budget",
        "What one standard uncertainty of each source does, in per cent of the parameter.",
        ("source", *SYMBOLS),
        tuple(
            (s, *(significant(100 * float(v) / float(z), 2) if z > 0 else significant(None, 2)
                  for v, z in zip(c, size, strict=True)))
            for s, c in shown
        ),
    )  # fmt: skip


def _notes(record: CarriageRecord, found: SupportEstimates) -> tuple[Note, ...]:
    assumed = [
        "masses, moments of inertia and lengths count as exact where the rig file declares no u_<symbol>",
        worded(
            "friction at D is taken to be fully there from ",
            measured(1e3 * Assumptions().sliding_m_s, "mm/s", "g"),
            " on",
        ),
    ]
    notes = [Note(NoteCode.ASSUMPTION, None, text) for text in assumed]
    if record.narrowest is not None:
        text = (
            f"every channel was given the response of the narrowest sensor, {record.narrowest.kind} "
            f"{record.narrowest.cutoff_hz:g} Hz"
        )
        notes.append(Note(NoteCode.FILTER, None, text))
    lifted = found.lifted_s
    for name, share in lifted.items():
        if share > 0:
            text = f"{SUPPORT_NAMES[name]} lifted off for {1e3 * share:.0f} ms; those samples carry no load"
            notes.append(Note(NoteCode.NOT_USED, name, text))
    return tuple(notes)
