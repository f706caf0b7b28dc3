"""Resistance that no gauge reads: what is known of it beforehand, as shapes of known form and unknown size.

The equation of motion takes the resistance for what brake and recuperator gauge read and one constant friction. A
recoiling part is also held by packings that grip with the pressure, by slides, by the other side of the brake's piston,
by a rod that changes the piston's area, by a line between gas and gauge. Two unknowns stand for all of them: the share
by which the resistance that is read falls short of the whole, which carries what they do to the mass, and a weak force
of unknown shape along the travel, which takes what is left of theirs.

The force of unknown shape is a Gaussian process over the travel x of the stroke L with the covariance
``(1 + d) e^-d, d = sqrt(3) |x - x'| / (l L)`` (Matern's of order 3/2: C. E. Rasmussen, C. K. I. Williams, Gaussian
Processes for Machine Learning, 2006, equation 4.17), by its Karhunen-Loeve expansion: each eigenvector of the
covariance times the root of its eigenvalue has a size of variance one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.rows.causes import Cause, filtered_columns
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression
from recoil_rigs.mechanism.mechanism_parameters import Mechanism

SHARE = ErrorSource(SourceKind.UNREAD_SHARE)
SLIDE = ErrorSource(SourceKind.SLIDE_FRICTION)
FORCE = ErrorSource(SourceKind.UNREAD_FORCE)
"""Sources of the budget rows; that of the force of unknown shape is of all its shapes together."""
LENGTH = 0.35
"""Correlation length of the force of unknown shape, share of the stroke."""
POINTS = 60
"""Points of the travel at which its covariance is written down."""
LEAST_EIGENVALUE = 1e-3
"""Eigenvalue over the largest one, below which a shape is left out."""


def shape_of_force(number: int) -> ErrorSource:
    """Return the source that is the size of one of the shapes, counted from 0."""
    return ErrorSource(SourceKind.UNREAD_SHAPE, detail=f"{number + 1}")


def together(cause: str) -> str:
    """Return the name of the row of a cause: shapes of one force that no gauge reads, or of one zero, have one."""
    if not isinstance(cause, ErrorSource):
        return cause
    if cause.kind is SourceKind.UNREAD_SHAPE:
        return FORCE
    return f"{cause.of} zero that moves" if cause.kind is SourceKind.MOVING_ZERO else cause


def unread_causes(
    regression: Regression, recorded: Regression, mechanism: Mechanism, acceleration_m_s2: Array
) -> tuple[Cause, ...]:
    """List what is known beforehand of the resistance that no gauge reads, none of what the rig states as exact.

    Parameters
    ----------
    regression, recorded
        Regressions behind the filter and before it.
    mechanism
        Mechanism, which states how large each may be.
    acceleration_m_s2 : ndarray, shape (n,)
        Acceleration of the recoil, which tells travel and velocity; NaN where lost.
    """
    moving = recorded.inside.astype(np.float64)
    velocity, travel = recorded.moved(acceleration_m_s2)
    stroke = max(float(travel.max(initial=0.0)), 1e-9)
    forces = np.column_stack([bridge(column, otherwise=0.0) for column in recorded.forces_n.T])
    resist = [column for column, sign in enumerate(recorded.signs) if sign < 0]
    unread = recorded.unread_column
    beside = unread < 0
    columns: dict[ErrorSource, tuple[str, float, Array]] = {}

    def in_column(column: int, force_n: Array) -> Array:
        found = np.zeros(forces.shape)
        found[:, column] = moving * force_n
        return found

    u_share = mechanism.u.get("unread_share", 0.0)
    if u_share > 0:
        read = 1.0 + mechanism.unread_share
        whole = sum(in_column(at, forces[:, at] / read) for at in sorted({*resist, unread}))
        columns[SHARE] = "1", u_share, np.asarray(whole)
    u_slide = mechanism.u.get("slide_friction", 0.0)
    if u_slide > 0:
        columns[SLIDE] = "N s/m", u_slide, in_column(unread, -velocity)
    if mechanism.unread_force > 0:
        resistance_n = regression.forces_n[regression.inside][:, [*resist, len(recorded.signs)]].sum(axis=1)
        peak_n = float(np.max(np.abs(resistance_n), initial=0.0))
        shapes = [(one, shape) for one in recorded.unread_shapes(travel, stroke) for shape in force_shapes().T]
        for number, (one, shape) in enumerate(shapes):
            over_travel = np.interp(travel / stroke, np.linspace(0.0, 1.0, POINTS), shape)
            force_n = mechanism.unread_force * peak_n * one * over_travel
            columns[shape_of_force(number)] = "1", 1.0, in_column(unread, force_n)
    if beside:  # where nothing resists nothing is missing
        columns = {source: one for source, one in columns.items() if np.any(one[2])}
    unmoved = np.zeros(moving.size)
    behind = _behind(regression, [forces_n for _, _, forces_n in columns.values()])
    # a share of what gauges read has none of their noise
    behind = [
        np.column_stack([regression.smooth(one) if np.any(one) else one for one in forces_n.T])
        if source == SHARE
        else forces_n
        for source, forces_n in zip(columns, behind, strict=True)
    ]
    return tuple(
        Cause(
            source,
            unit,
            u,
            "B",
            forces_n[:, :-1],
            unmoved,
            scope="rig",
            beside_n=forces_n[:, -1] if beside else None,
        )
        for (source, (unit, u, _)), forces_n in zip(columns.items(), behind, strict=True)
    )


@lru_cache(maxsize=1)
def force_shapes() -> Array:
    """Return the shapes of the force of unknown shape over the travel, of variance one together; (POINTS, n_shapes)."""
    places = np.linspace(0.0, 1.0, POINTS)
    apart = math.sqrt(3.0) * np.abs(places[:, np.newaxis] - places) / LENGTH
    values, vectors = np.linalg.eigh((1.0 + apart) * np.exp(-apart))
    kept = np.flatnonzero(values > LEAST_EIGENVALUE * values[-1])[::-1]
    # an eigenvector has no sign: every machine takes the same
    signs = np.sign(vectors[np.abs(vectors[:, kept]).argmax(axis=0), kept])
    shapes = np.asarray(vectors[:, kept] * signs * np.sqrt(values[kept]))
    shapes.setflags(write=False)
    return shapes


def _behind(regression: Regression, listed: Sequence[Array]) -> list[Array]:
    """Pass forces through the regression's filter, shape (n, n_gauges + 1) each; what is zero throughout stays so."""
    if not listed:
        return []
    found = np.stack(listed)
    used = np.any(found != 0.0, axis=1)
    found.swapaxes(1, 2)[used] = filtered_columns(regression, found.swapaxes(1, 2)[used].T).T
    return list(found)
