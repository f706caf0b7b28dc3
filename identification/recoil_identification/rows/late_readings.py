"""Readings of the breech gauge once the bore is empty: its zero alone, before the shot and as the shot moved it.

The rows of the motion see only the sum of all forces, so that they cannot tell which gauge's zero moved; this gauge
tells of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.causes import Cause, moving_zero
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, U_GAS_PA, empty_bore_s, zero_moves
from recoil_processing.shot.signals import Signals

ROLE = "breech_pressure"
ZERO = ErrorSource(SourceKind.ZERO, ROLE)
GAS_LEFT = ErrorSource(SourceKind.GAS)
GAS = Unknown(GAS_LEFT, "Pa")
MEAN_S = 5e-3
"""Over which readings are averaged: their noise is white, and the zero moves more slowly."""
LEAST_LEFT = 4
"""Rows beyond what their columns span, from which on what these leave of them tells their noise."""
LEAST_PIVOT = 1e-6
"""Singular value over the largest one, of columns of length one, below which the others say the same."""


@dataclass(frozen=True)
class LateReadings:
    """Rows of the gauge's zero, and what is known of the gas beside it.

    Attributes
    ----------
    drooped_pa_s : ndarray, shape (n_rows,)
        Integral of the reading up to each row: what an amplifier has lost by then, times its time constant.
    """

    rows: LinearBlock
    prior: Prior
    drooped_pa_s: Array


def late_readings(signals: Signals, interval_s: tuple[float, float], causes: Sequence[Cause]) -> LateReadings | None:
    """Average what the breech gauge reads once the bore is empty; None where the recoil ends before.

    Parameters
    ----------
    interval_s
        Interval from the onset to the end of travel.
    causes
        Causes, of which the moving zero and the zero before the shot are unknowns of the rows.
    """
    sources = [one.source for one in causes]
    moving = [moving_zero(ROLE, tau) for tau in MOVES_S]
    reading, offset = signals.series.get(ROLE), signals.offsets.get(ROLE)
    if reading is None or offset is None or not (offset.noise > 0 and all(one in sources for one in moving)):
        return None
    times, onset_s = signals.times_s, interval_s[0]
    empty_s = empty_bore_s(times, reading, interval_s)
    count = int((interval_s[1] - empty_s) / MEAN_S) if math.isfinite(empty_s) else 0
    zero = [ZERO] if ZERO in sources else []
    drooped = integrate(bridge(reading, otherwise=0.0), signals.step_s)
    shapes = np.column_stack(
        [zero_moves(times, onset_s), *(np.ones_like(times) for _ in zero), np.ones_like(times), drooped]
    )
    columns, recorded, least = [], [], times.size
    for number in range(count):
        at = (times >= empty_s + number * MEAN_S) & (times < empty_s + (number + 1) * MEAN_S) & np.isfinite(reading)
        if np.count_nonzero(at) >= 2:
            columns.append(shapes[at].mean(axis=0))
            recorded.append(float(reading[at].mean()))
            least = min(least, int(np.count_nonzero(at)))
    if not columns:
        return None
    means, last = np.array(columns)[:, :-1], np.array(columns)[:, -1]
    # the rest may be quieter than the motion
    sigma = max(offset.noise / math.sqrt(least), _left(means, np.array(recorded)))
    rows = LinearBlock((*moving, *zero, GAS.name), means, np.array(recorded), sigma)
    return LateReadings(rows, Prior.of(GAS_LEFT, GAS.name, U_GAS_PA), last)


def _left(columns: Array, recorded: Array) -> float:
    """Return the standard deviation of what columns leave of rows; 0 where these are too few to tell."""
    spanned, sizes, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    spanned = spanned[:, sizes > LEAST_PIVOT * sizes[0]]
    freedom = recorded.size - spanned.shape[1]
    if freedom < LEAST_LEFT:
        return 0.0
    left = recorded - spanned @ (spanned.T @ recorded)
    return math.sqrt(float(left @ left) / freedom)


def settled_by_late_readings(
    causes: Sequence[Cause], signals: Signals, interval_s: tuple[float, float]
) -> tuple[tuple[Cause, ...], Array]:
    """Let the gauge's zero be what it reads once the bore is empty, for whoever does not solve for it.

    Returns
    -------
    causes : tuple of Cause
        The same, but for the gauge's zero: of what the readings leave of it, which hangs together, independent parts
        with sizes of one. The parts that move come first, so that that of the zero is what they do not explain.
    lacking_n : ndarray, shape (n, n_gauges)
        Amount that the measured forces read too little by what was found; zero where the readings tell nothing.
    """
    late = late_readings(signals, interval_s, causes)
    if late is None:
        return tuple(causes), np.zeros_like(causes[0].forces_n if causes else signals.times_s[:, np.newaxis])
    by_source = {str(cause.source): cause for cause in causes}
    of = [by_source[one] for one in late.rows.unknowns if one in by_source]
    found = solve([*(one.unknown for one in of), GAS], [late.rows], [*(one.prior for one in of), late.prior])
    parts = np.linalg.cholesky(found.covariance[: len(of), : len(of)])
    acting = np.stack([one.forces_n for one in of])
    lacking_n = np.tensordot(found.values[: len(of)], acting, axes=1)
    settled = {
        one.source: replace(one, unit="1", u=1.0, forces_n=np.tensordot(part, acting, axes=1))
        for one, part in zip(of, parts.T, strict=True)
    }
    return tuple(settled.get(one.source, one) for one in causes), lacking_n
