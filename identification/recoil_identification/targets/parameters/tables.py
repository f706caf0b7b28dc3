"""Tables and figures of the mechanism's parameters, and what the rig declares of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.rounding import rounded, significant
from recoil_identification.report.figure.figure import TIME, Figure, HorizontalLine, Panel, Trace
from recoil_identification.targets.parameters.base_parameters import BaseParameters
from recoil_identification.targets.parameters.mechanism_fit import LARGEST_U, MechanismFit, natural_scales
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_identification.targets.target_result import Table
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.mechanism.mechanism_regressor import EQUATIONS, PARAMETER_UNITS, PARAMETERS, standard_parameters
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import Rig

SMALLEST_PRINTED = 1e-3
"""Smallest share of a combination, each parameter by its natural scale, that is printed."""


def expressions(base: BaseParameters, names: Sequence[str], scales: Array) -> tuple[str, ...]:
    """Write every combination out, without terms below `SMALLEST_PRINTED` of its leading one.

    Parameters
    ----------
    names
        Names of the p standard parameters.
    scales : ndarray, shape (p,)
        Natural size of each.
    """
    lines = []
    for first, row in zip(base.leading, base.combinations, strict=True):
        share = np.abs(row) * scales / scales[first]
        terms = [names[first]]
        for j in sorted(int(i) for i in np.flatnonzero(share >= SMALLEST_PRINTED) if i != first):
            size = significant(abs(float(row[j])), 4)
            factor = "" if abs(abs(row[j]) - 1.0) < 1e-9 else f"{size} "
            terms.append(f"{'+' if row[j] > 0 else '-'} {factor}({names[j]})")
        lines.append(" ".join(terms))
    return tuple(lines)


def declared(mechanism: Mechanism, combination: Array) -> tuple[float | None, float | None]:
    """Return a combination of the parameters as the rig declares it, and its standard uncertainty if that has one.

    Parameters
    ----------
    combination : ndarray, shape (12,)
    """

    def value(m: Mechanism) -> float:
        theta = standard_parameters(m)
        return float(combination[combination != 0] @ theta[combination != 0])

    nominal = value(mechanism)
    if not math.isfinite(nominal):
        return None, None
    own = ("m1", "m2", "m3", "J1", "J2", "J3c", "X1", "Y1", "s2", "d2", "b", "d")
    changes = [
        value(replace(mechanism, **{name: getattr(mechanism, name) + mechanism.u[name]})) - nominal
        for name in own
        if name in mechanism.u
    ]
    return nominal, math.hypot(*changes) if changes else None


def table_of_combinations(rig: Rig, rows: MechanismRows, fit: MechanismFit) -> Table:
    """List the combinations that the shot tells, with what the rig declares of them."""
    names = expressions(fit.structural, PARAMETERS, natural_scales(rows.geometry, rig.mechanism.m3))
    scales = natural_scales(rows.geometry, rig.mechanism.m3)[list(fit.structural.leading)]
    lines = []
    for text, j, value, u, row in zip(
        expressions(fit.identifiable.base, names, scales),
        fit.identifiable.base.leading,
        fit.identifiable.values,
        fit.identifiable.u,
        fit.identifiable.base.combinations,
        strict=True,
    ):
        expected, _ = declared(rig.mechanism, row @ fit.structural.combinations)
        number, own = rounded(float(value), float(u))
        lines.append((text, number, own, PARAMETER_UNITS[fit.structural.leading[j]], significant(expected, 5)))
    return Table(
        "Combinations that this shot tells",
        "By column-pivoted QR of the whitened regressor, the best determined first; numbers within a combination "
        f"below 0.1 % of its size are not printed. Directions with more than {100 * LARGEST_U:.0f} % of the natural "
        f"scale are left out: {len(fit.structural.leading) - len(lines)} of {len(fit.structural.leading)}.",
        ("combination", "value", "standard uncertainty", "unit", "declared"),
        tuple(lines),
    )


def table_of_errors(rows: MechanismRows, fit: MechanismFit) -> Table:
    """List every error that was an unknown of the solution."""
    lines = []
    for error, size, u in zip(rows.errors, fit.errors, fit.u_errors, strict=True):
        if error.source.kind is SourceKind.UNREAD_SHAPE:
            continue
        number, own = rounded(float(size), float(u))
        lines.append((error.source, significant(error.u, 2), number, own, error.unit))
    return Table(
        "Errors of sensors, clocks and lengths",
        "Each is an unknown of the solution, restricted by its standard uncertainty before the shot; so are the "
        "shapes of the force that no gauge reads.",
        ("error", "standard uncertainty before", "found", "standard uncertainty after", "unit"),
        tuple(lines),
    )


def figure_of_equations(rows: MechanismRows, fit: MechanismFit) -> Figure:
    """Draw both sides of the usable equations."""
    _, Q = rows.corrected(fit.errors).equations()
    panels = []
    for i in fit.usable:
        unit = "kN m" if i in (2, 3) else "kN"
        left = 1e-3 * fit.residuals[:, i]
        measured = np.where(np.isfinite(left), 1e-3 * Q[:, i], np.nan)
        panels.append(
            Panel(
                f"{EQUATIONS[i]}, {unit}",
                (
                    Trace("loads, measured", rows.times_s, measured, "measured", unit),
                    Trace("inertia, identified", rows.times_s, measured + left, "model", unit),
                    Trace("difference", rows.times_s, left, "reference", unit),
                ),
            )
        )
    return Figure(
        "equations",
        "Equations of motion with the identified parameters",
        "Change of the loads since rest, of the inertia's side with the identified parameters, and their difference.",
        TIME,
        tuple(panels),
    )


def figure_of_pivots(fit: MechanismFit) -> Figure:
    """Draw how fast the combinations get worse."""
    shown = np.where(np.isfinite(fit.identifiable.pivots), fit.identifiable.pivots, np.nan)
    count = np.arange(1.0, shown.size + 1.0)
    bars = Trace("standard uncertainty over natural scale", count, shown, "points", "1")
    limit = HorizontalLine(f"limit {LARGEST_U:g}", LARGEST_U, "limit")
    return Figure(
        "pivots",
        "How many combinations the shot tells",
        "Standard uncertainty that each further combination has at the least, relative to its natural scale.",
        "number of the combination, by column-pivoted QR",
        (Panel("relative to natural scale", (bars,), (limit,), y_scale="log"),),
    )
