"""Figures of the target ``stiffness``: load against deflection, residual, parameters over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import TIME, Figure, HorizontalLine, Panel, Span, Trace, with_interval
from recoil_identification.targets.stiffness.carriage_record import CarriageRecord
from recoil_identification.targets.stiffness.restoring_force import RestoringTrace
from recoil_identification.targets.stiffness.stiffness_budget import SYMBOLS, SupportEstimates
from recoil_identification.targets.stiffness.support_filter import Band, FilteredSupport, Rows, Support
from recoil_identification.targets.stiffness.supports import PARAMETERS, SUPPORT_NAMES

FINE_STEP_S = 1e-3
"""Between the points of a drawn loop."""
UNITS = {"elevating": ("N m", "rad", "N m/rad", "N m s/rad")}
OTHER_UNITS = ("N", "m", "N/m", "N s/m")
"""Units of load, deflection, stiffness and damping."""


def stiffness_figures(
    record: CarriageRecord,
    supports: Mapping[str, Support],
    found: SupportEstimates,
    judged: Array,
    traces: Mapping[str, RestoringTrace],
) -> tuple[Figure, ...]:
    """Compose the figures, in reading order.

    Parameters
    ----------
    supports
        Supports as recorded.
    judged : ndarray, shape (9,)
        Parameters, NaN where not identified.
    """
    step = record.step_s
    inside = (record.times_s >= record.interval_s[0]) & (record.times_s <= record.interval_s[1])
    rows = np.flatnonzero(inside)[:: max(1, round(FINE_STEP_S / step))]
    ground = [name for name in supports if name != "elevating"]
    return (
        Figure(
            "elevating-loop",
            "Moment of the elevating gear against its angle",
            "The loop is measured; the line is the stiffness, the dashed loop stiffness and damping together.",
            "angle of the tipping part against the carriage, rad",
            (_loop_panel("elevating", supports, found, judged, rows, record),),
        ),
        Figure(
            "ground-loops",
            "Reactions of the ground against its displacement",
            "Loads beyond those at rest; where a foot has lifted off, its reaction is constant.",
            "displacement, m",
            tuple(_loop_panel(name, supports, found, judged, rows, record) for name in ground),
        ),
        _over_time(record, found, judged, traces, supports),
        _residuals(record, supports, found, rows),
    )


def _loop_panel(
    name: str,
    supports: Mapping[str, Support],
    found: SupportEstimates,
    judged: Array,
    rows: Rows,
    record: CarriageRecord,
) -> Panel:
    load_unit, unit, _, _ = UNITS.get(name, OTHER_UNITS)
    whole = replace(supports[name], contact=np.ones_like(record.times_s))
    plain = whole.filtered(Band(found.bands[name].low_pass_hz, 0.0, 0), record.interval_s[0], rows)
    deflection = plain.columns[:, 0]
    traces = [Trace("measured", deflection, plain.load, "measured", load_unit)]
    parameters = judged[[SYMBOLS.index(symbol) for symbol in PARAMETERS[name]]]
    ends = np.array([deflection.min(), deflection.max()])
    if np.isfinite(parameters[0]):
        traces.append(Trace("stiffness", ends, parameters[0] * ends, "model", load_unit))
    if np.isfinite(parameters).all():
        traces.append(Trace("stiffness and damping", deflection, plain.columns @ parameters, "reference", load_unit))
    return Panel(f"{SUPPORT_NAMES[name]}, {load_unit}", tuple(traces), x_label=f"deflection, {unit}")


def _over_time(
    record: CarriageRecord,
    found: SupportEstimates,
    judged: Array,
    traces: Mapping[str, RestoringTrace],
    supports: Mapping[str, Support],
) -> Figure:
    panels = []
    for name, trace in traces.items():
        for number in (0, 1):
            symbol = PARAMETERS[name][number]
            unit = UNITS.get(name, OTHER_UNITS)[2 + number]
            value = float(judged[SYMBOLS.index(symbol)])
            if not np.isfinite(value):
                continue
            y, u = trace.parameters[:, number], trace.u[:, number]
            half_whole = COVERAGE_FACTOR * found.u(symbol)
            panels.append(
                Panel(
                    f"{symbol}, {unit}",
                    (with_interval(f"{symbol}, 95 % interval", trace.times_s, y, u, unit),),
                    (HorizontalLine("whole shot", value, "mean", value - half_whole, value + half_whole),),
                    _lifted(supports[name], record),
                    y_shown=(min(0.0, 2 * value), max(0.0, 2 * value)),
                )
            )
    if not panels:
        empty = Trace("none was identified", record.times_s[:1], np.array([np.nan]), "measured")
        panels.append(Panel("parameter", (empty,)))
    window = 1e3 * next(iter(traces.values())).window_s
    return Figure(
        "stiffness-over-time",
        "Stiffness and damping over time",
        f"By the last {window:.0f} ms of data, with 95 % interval; "
        "blank where a window tells too little or a foot has lifted off.",
        TIME,
        tuple(panels),
        shown=record.interval_s,
    )


def _residuals(record: CarriageRecord, supports: Mapping[str, Support], found: SupportEstimates, rows: Rows) -> Figure:
    panels = []
    for name, support in supports.items():
        unit = UNITS.get(name, OTHER_UNITS)[0]
        passed: FilteredSupport = support.filtered(found.bands[name], record.interval_s[0], rows)
        panels.append(
            Panel(
                f"{SUPPORT_NAMES[name]}, {unit}",
                (
                    Trace("load", passed.times_s, passed.load, "filtered", unit),
                    Trace("residual", passed.times_s, found.fits[name].residual(passed), "points", unit),
                ),
                spans=_lifted(support, record),
            )
        )
    return Figure(
        "stiffness-residuals",
        "What stiffness and damping leave of the loads",
        "Load and residual within the band in which each support was identified.",
        TIME,
        tuple(panels),
        shown=record.interval_s,
    )


def _lifted(support: Support, record: CarriageRecord) -> tuple[Span, ...]:
    off = np.concatenate([[0], (support.contact < 0.5).astype(int), [0]])
    edges = np.flatnonzero(np.diff(off)).reshape(-1, 2)
    times, last = record.times_s, record.times_s.size - 1
    spans = ((float(times[a]), float(times[min(b, last)])) for a, b in edges)
    low, high = record.interval_s
    return tuple(Span("lifted off", max(a, low), min(b, high)) for a, b in spans if b > low and a < high)
