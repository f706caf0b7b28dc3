"""Load and deflection of one support behind one and the same band-pass.

The low-pass takes off stress waves, the high-pass the drift of a deflection that was integrated from
accelerometers or gyros; powers of the time since the shot, as columns, stand for the drift that is left. The
band-pass is a matrix that both sides are multiplied by.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.filters import LowPass

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class Band:
    """Pass band of load and deflection, and the drift that is allowed for.

    Attributes
    ----------
    high_pass_hz
        0 for none.
    drift_order
        Highest power of the time since the shot among the drift columns.
    """

    low_pass_hz: float
    high_pass_hz: float
    drift_order: int


@dataclass(frozen=True, eq=False)
class Support(ReadOnlyArrays):
    """Load and deflection of one support, as recorded.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Uniform.
    load : ndarray, shape (n,)
        Load beyond that at rest, in the sense in which it opposes the deflection; N or N m.
    columns : mapping of str to ndarray, shape (n,)
        Columns that the load is proportional to: deflection, its rate, and what else there is.
    contact : ndarray, shape (n,)
        1 where the support bears, 0 where it has lifted off.
    """

    name: str
    times_s: Array
    load: Array
    columns: Mapping[str, Array]
    contact: Array

    def filtered(self, band: Band, start_s: float, rows: Rows) -> FilteredSupport:
        """Pass both sides through one band-pass, with drift columns from an instant on.

        Parameters
        ----------
        start_s
            Start of the shot.
        rows : ndarray of int, shape (n_rows,)
            Samples that are wanted behind the band-pass.
        """
        since = np.maximum(self.times_s - start_s, 0.0)
        columns = [self.load, *self.columns.values(), *(since**k for k in range(1, band.drift_order + 1))]
        names = (*self.columns, *(f"drift {k}" for k in range(1, band.drift_order + 1)))
        both_sides = np.column_stack(columns) * self.contact[:, np.newaxis]
        passed = band_pass_rows(band, self.times_s, rows) @ both_sides
        step = float(self.times_s[1] - self.times_s[0]) * float(np.median(np.diff(rows))) if rows.size > 1 else np.nan
        return FilteredSupport(
            self.times_s[rows], step, passed[:, 0], passed[:, 1:], names, len(self.columns), self.contact[rows]
        )


@dataclass(frozen=True, eq=False)
class FilteredSupport(ReadOnlyArrays):
    """Both sides of ``load = sum_j parameter_j column_j`` behind one band-pass, at rows of the record.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    step_s
        Between neighbours.
    load : ndarray, shape (n,)
    columns : ndarray, shape (n, n_columns)
        Drift columns last.
    names
        Names of the columns.
    wanted
        Number of the columns' parameters that are wanted; the others are the drift's.
    contact : ndarray, shape (n,)
        1 where the support bears.
    """

    times_s: Array
    step_s: float
    load: Array
    columns: Array
    names: tuple[str, ...]
    wanted: int
    contact: Array


def band_pass_rows(band: Band, times_s: Array, rows: Rows) -> Array:
    """Return the band-pass as a matrix that gives some rows of what passes; shape (n_rows, n_samples).

    One matrix for both sides of an equation is one filter for both; and it is formed once, however often the
    record is varied.
    """
    step, chosen = float(times_s[1] - times_s[0]), tuple(int(row) for row in rows)
    matrix = _low_pass_rows(band.low_pass_hz, times_s.size, round(1.0 / step, 6), chosen)
    if band.high_pass_hz > 0:
        matrix = matrix - _low_pass_rows(band.high_pass_hz, times_s.size, round(1.0 / step, 6), chosen)
    return matrix


@lru_cache(maxsize=16)
def _low_pass_rows(cutoff_hz: float, count: int, rate_hz: float, rows: tuple[int, ...]) -> Array:
    """Return rows of the matrix of a zero-phase low-pass over a record that is continued oddly at both ends."""
    low_pass = LowPass(cutoff_hz)
    more = min(count - 1, math.ceil(low_pass.padding_periods * rate_hz / cutoff_hz))
    longest = count + more
    pulse = np.zeros(2 * longest + 1)
    pulse[longest] = 1.0
    kernel = low_pass.apply(pulse, rate_hz)
    at = np.array(rows)[:, np.newaxis] - np.arange(-more, count + more)[np.newaxis, :] + longest
    extended = kernel[at]
    # what little of the kernel lies farther out must not take anything off a constant
    extended /= extended.sum(axis=1, keepdims=True)
    matrix = extended[:, more : more + count].copy()
    # a sample beyond an end is twice the end less the sample as far within
    before, behind = extended[:, :more][:, ::-1], extended[:, more + count :]
    matrix[:, 0] += 2.0 * before.sum(axis=1)
    matrix[:, 1 : more + 1] -= before
    matrix[:, -1] += 2.0 * behind.sum(axis=1)
    matrix[:, count - 1 - more : count - 1] -= behind[:, ::-1]
    matrix.flags.writeable = False
    return matrix
