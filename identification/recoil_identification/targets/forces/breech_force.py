"""Target ``breech-force``: the propellant's force from the motion, without the breech gauge.

``P = m3 a' + R_f``: the specification mass, the accelerometer and the camera, and the resistance by the gauges of brake
and recuperator. Two methods that share the measurements and the model of what rings, but not what they suppose of the
force: Kalman input estimation (`recoil_identification.targets.forces.input_estimate`), and regularised inversion with
cross-validation (`recoil_identification.targets.forces.force_inversion`). Where there is a breech gauge, both are
compared with the peak and the impulse that the shot's report states by it (`recoil_identification.shot.peaks`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.rounding import in_unit, rounded, significant
from recoil_identification.rows.unread_resistance import together
from recoil_identification.shot.peaks import peaks_of
from recoil_identification.targets.forces.figures import force_figures
from recoil_identification.targets.forces.force_peak import ForcePeak, find_peak
from recoil_identification.targets.forces.force_record import force_record
from recoil_identification.targets.forces.motion_force import MotionForce, estimate_motion_force
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, Series, Table, TargetResult
from recoil_processing.shot.verdict.mass_reasons import doubts_of
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.tables.rig_tables import CARRIAGE_ROLES

NEEDED = ("recoil_acceleration", "brake_pressure", "recuperator_pressure")
"""Roles without which there is no force."""
ROLES = (*NEEDED, *CARRIAGE_ROLES)
"""Roles that the force hangs on."""
STATISTIC = (0.5, 2.0)
"""Mean squared normalised innovation of a model that fits."""
KALMAN, INVERSION = "Kalman input estimation", "regularised inversion, cross-validated"


class _Stated(NamedTuple):
    """A value and its standard uncertainty."""

    value: float
    u: float


class _Compared(NamedTuple):
    """Peak, impulse, time, and where it was measured the pressure, of one method, with all of their uncertainties."""

    peak: _Stated
    impulse: _Stated
    time: _Stated
    pressure: _Stated | None = None


def find(case: Case) -> TargetResult:
    """Identify the breech force over time, its peak and its impulse, without the breech gauge.

    Raises
    ------
    IdentificationError
        If the accelerometer, or a gauge of the resistance, is missing or cannot be used.
    """
    case.require_roles(*NEEDED, purpose="breech-force")
    found = estimate_motion_force(force_record(case.fired))
    m, record = case.fired.rig.mechanism, found.record
    peak = find_peak(found.kalman, record.onset_s)
    kalman, inverted, gauge = _by_kalman(found, peak), _by_inversion(found, peak), _by_gauge(found, case)
    quantities, differences = _quantities(kalman, inverted, gauge, m), _differences(found, peak, kalman, gauge)
    end_s = float(found.times_s[-1])
    return TargetResult(
        target="breech-force",
        title="Breech force from the motion",
        summary=worded(
            f"P = m3 a' + R_f with the specification mass of {case.fired.rig.specification.mass_kg:g} kg"
            f"{'' if record.tracked is None else ', camera and accelerometer'}, and the pressures of brake and "
            f"recuperator; the breech gauge has no part in it. By Kalman input estimation the force peaks at ",
            measured(1e-3 * peak.force_n, "kN", lambda number: significant(number, 5)),
            ".",
        ),
        quantities=(*quantities, *differences),
        figures=force_figures(found, peak, m.force_areas[0]),
        series=_series(found, m),
        tables=(_budget(found, peak), _table(differences)),
        reasons=(*doubts_of(case.fired.rig), *case.failed_checks(*ROLES), *_reasons(found, differences)),
        notes=_notes(found, m, end_s),
        parameters={
            "thinned_by": found.kalman.factor,
            "modes_hz": [mode.frequency_hz for mode in record.modes],
            "cutoff_hz": record.low_pass.cutoff_hz,
            "release_s": record.onset_s,
            "end_s": end_s,
            "held_n": record.held_n,
            "innovation_statistic": found.kalman.innovation_statistic,
            "accelerometer_reads_high": found.kalman.gain_error,
            "u_accelerometer_reads_high": found.kalman.u_gain_error,
            "regularisation": found.inverted.inversion.weight,
            "residual_variance": found.inverted.inversion.variance,
        },
    )


def _by_kalman(found: MotionForce, peak: ForcePeak) -> _Compared:
    since = peak.time_s - found.record.onset_s
    return _Compared(
        _Stated(peak.force_n, float(found.u_kalman_n[peak.index])),
        _Stated(peak.impulse_n_s, found.u_impulse_n_s(peak.u_impulse_n_s)),
        _Stated(since, math.hypot(peak.u_time_s, found.record.measured.step_s)),
    )


def _by_inversion(found: MotionForce, peak: ForcePeak) -> _Compared:
    force, random, time_s = found.inverted.peak
    impulse = found.u_impulse_n_s(found.inverted.u_impulse_n_s)
    step = float(found.times_s[1] - found.times_s[0])
    return _Compared(
        _Stated(force, math.hypot(random, float(found.u_systematic_n[peak.index]))),
        _Stated(found.inverted.impulse_n_s, impulse),
        _Stated(time_s - found.record.onset_s, math.hypot(peak.u_time_s, step)),
    )


def _by_gauge(found: MotionForce, case: Case) -> _Compared | None:
    """Return what the report states by the breech gauge; None where there is none, or its tips are lost."""
    told = None if found.gauge is None else peaks_of(case.identified)
    if found.gauge is None or told is None or not {"breech_pressure_pa", "impulse_n_s"} <= told.keys():
        return None
    m, pressure, impulse = case.fired.rig.mechanism, told["breech_pressure_pa"], told["impulse_n_s"]
    peak = find_peak(found.gauge, found.record.onset_s)
    u_force_rel = math.hypot(pressure.u / pressure.value, m.u_force_areas_rel[0])
    force_n = m.force_areas[0] * pressure.value
    return _Compared(
        _Stated(force_n, u_force_rel * force_n),
        _Stated(impulse.value, impulse.u),
        _Stated(peak.time_s - found.record.onset_s, math.hypot(peak.u_time_s, found.record.measured.step_s)),
        _Stated(pressure.value, pressure.u),
    )


def _quantities(kalman: _Compared, inverted: _Compared, gauge: _Compared | None, m: Mechanism) -> tuple[Quantity, ...]:
    def against(value: _Stated, expected: _Stated | None, *words: str) -> Quantity:
        name, symbol, unit, basis = words
        declared = (None, None) if expected is None else expected
        return Quantity(name, symbol, *value, unit, basis, *declared)

    area, u_area = m.force_areas[0], m.u_force_areas_rel[0]
    pressure = _Stated(kalman.peak.value / area, math.hypot(kalman.peak.u, kalman.peak.value * u_area) / area)
    peaks, impulses, times, by_gauge = (None, None, None, None) if gauge is None else gauge
    since, behind = "time of the peak since the release", "impulse from the release on"
    return (
        against(kalman.peak, peaks, "peak force", "peak_force", "N", KALMAN),
        against(pressure, by_gauge, "equivalent peak pressure", "peak_pressure", "Pa", "peak force over bore area"),
        against(kalman.time, times, since, "time_of_peak", "s", KALMAN),
        against(kalman.impulse, impulses, behind, "impulse", "N s", KALMAN),
        against(inverted.peak, peaks, "peak force", "peak_force_inversion", "N", INVERSION),
        against(inverted.time, times, since, "time_of_peak_inversion", "s", INVERSION),
        against(inverted.impulse, impulses, behind, "impulse_inversion", "N s", INVERSION),
    )


def _differences(
    found: MotionForce, peak: ForcePeak, kalman: _Compared, gauge: _Compared | None
) -> tuple[Quantity, ...]:
    """Return what should be zero: between the methods by their own errors alone, from the gauge by all."""
    force, random, _ = found.inverted.peak
    impulse, u_impulse = found.inverted.impulse_n_s, found.inverted.u_impulse_n_s
    pairs = [
        ("peak force, inversion less Kalman", "peak_difference", "N",
         force - peak.force_n, math.hypot(random, peak.u_force_n)),
        ("impulse, inversion less Kalman", "impulse_difference", "N s",
         impulse - peak.impulse_n_s, math.hypot(u_impulse, peak.u_impulse_n_s)),
    ]  # fmt: skip
    if gauge is not None:
        pairs += [
            (f"{name}, motion less gauge", symbol, unit, own.value - other.value, math.hypot(own.u, other.u))
            for name, symbol, unit, own, other in (
                ("peak force", "gauge_peak_difference", "N", kalman.peak, gauge.peak),
                ("impulse", "gauge_impulse_difference", "N s", kalman.impulse, gauge.impulse),
                ("time of the peak", "gauge_time_difference", "s", kalman.time, gauge.time),
            )
        ]
    check = "check: nought is expected"
    return tuple(Quantity(name, symbol, value, u, unit, check, 0.0, 0.0) for name, symbol, unit, value, u in pairs)


def _table(differences: tuple[Quantity, ...]) -> Table:
    rows = tuple(
        (q.name, *rounded(q.value, q.u), q.unit, significant(abs(q.value) / q.u if q.u > 0 else math.nan, 2))
        for q in differences
    )
    return Table(
        "Differences",
        f"Between the methods, and from the breech gauge; beyond {CRITICAL_VALUE} standard uncertainties one is off.",
        ("difference", "value", "standard uncertainty", "unit", "in standard uncertainties"),
        rows,
    )


def _budget(found: MotionForce, peak: ForcePeak) -> Table:
    i, step = peak.index, float(found.times_s[1] - found.times_s[0])
    rows = {"noise, stress waves, scales of accelerometer and camera": (peak.u_force_n, peak.u_impulse_n_s)}
    for cause, error in found.systematic_n.items():
        at_peak, impulse = rows.get(named := together(cause), (0.0, 0.0))
        rows[named] = math.hypot(at_peak, error[i]), math.hypot(impulse, step * float(error[found.free].sum()))
    return Table(
        "What the uncertainty is made of",
        "Standard uncertainties of peak and impulse by Kalman input estimation, by cause.",
        ("cause", "peak, N", "impulse, N s"),
        tuple((cause, significant(a, 2), significant(b, 2)) for cause, (a, b) in rows.items()),
    )


def _reasons(found: MotionForce, differences: tuple[Quantity, ...]) -> tuple[Reason, ...]:
    reasons = []
    low, high = STATISTIC
    if not low <= found.kalman.innovation_statistic <= high:
        text = (
            f"the model of force and stress waves does not fit: the mean squared normalised innovation is "
            f"{found.kalman.innovation_statistic:.2g}, between {low:g} and {high:g} expected"
        )
        reasons.append(Reason(ReasonCode.MODEL, "innovation", text))
    reasons += [
        Reason(
            ReasonCode.AGREEMENT,
            q.symbol,
            worded(
                f"{q.name}: ",
                in_unit(q.value, 3, q.unit),
                f", {abs(q.value) / q.u:.1f} of its standard uncertainties",
            ),
        )
        for q in differences
        if q.u > 0 and abs(q.value) > CRITICAL_VALUE * q.u
    ]
    if found.inverted.inversion.at_bound:
        text = "cross-validation found no weight of the regularisation within the range that was tried"
        reasons.append(Reason(ReasonCode.MODEL, "regularisation", text))
    return tuple(reasons)


def _notes(found: MotionForce, m: Mechanism, end_s: float) -> tuple[Note, ...]:
    held = worded(
        f"before the release at {found.record.onset_s:.5f} s the battery stop carries the force: what is less than ",
        measured(found.record.held_n / 1e3, "kN", ".3g"),
        " is not seen by the motion, and the force is left blank",
    )
    compared = (
        "there is no breech gauge to compare with"
        if found.gauge is None
        else "the values expected are those that the report states by the breech gauge"
    )
    until = f"the force is estimated until {end_s:.4f} s, twice as long as it exceeds 1 % of its peak"
    notes = [
        Note(NoteCode.NOT_IDENTIFIED, None, held),
        Note(NoteCode.RECORD_END, None, until),
        Note(NoteCode.COMPARISON, "breech_pressure", compared),
    ]
    if "m3" not in m.u:
        peak = 1e-5 * float(np.nanmax(found.kalman.force_n))
        text = worded(
            "the rig declares no u_m3: the specification mass is taken as exact; each per cent that it is off is "
            "nearly a per cent of the force, ",
            measured(peak, "kN", ".3g"),
            " of the peak",
        )
        notes.append(Note(NoteCode.ASSUMPTION, "m3", text))
    return (*notes, *found.record.notes)


def _series(found: MotionForce, m: Mechanism) -> Series:
    grid = found.record.measured.times_s
    area, u_area = m.force_areas[0], m.u_force_areas_rel[0]
    u_pressure = np.hypot(found.u_kalman_n, found.kalman.force_n * u_area) / area
    columns = {
        "time_s": found.times_s,
        "force_n": found.blank(found.kalman.force_n),
        "u_force_n": found.blank(found.u_kalman_n),
        "pressure_pa": found.blank(found.kalman.force_n / area),
        "u_pressure_pa": found.blank(u_pressure),
        "force_inversion_n": found.blank(found.inverted.force_n),
        "u_force_inversion_n": found.blank(found.u_inverted_n),
        "resistance_n": np.interp(found.times_s, grid, found.record.measured.resistance_n),
        "stress_waves_n": found.kalman.stress_waves_n,
        "travel_m": found.kalman.travel_m,
        "velocity_m_s": found.kalman.velocity_m_s,
    }
    if found.gauge is not None:
        columns["gauge_force_n"] = found.gauge.force_n
        columns["u_gauge_force_n"] = found.u_gauge_n
    return Series(columns)
