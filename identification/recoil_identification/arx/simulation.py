"""Simulated and predicted output of an ARX model, and how much of the measured output it explains.

A simulation uses the measured input alone; a prediction k samples ahead uses the measured output up to k
samples before. Where the input was lost the simulation ends, and it begins anew from the measured output
behind the gap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.arx.estimation import checked_record
from recoil_identification.arx.model import ArxModel

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def simulate(model: ArxModel, input_: ArrayLike, output: ArrayLike | None = None, *, start: int | None = None) -> Array:
    """Simulate the output from the measured input alone.

    Parameters
    ----------
    input_ : array_like, shape (n_samples,)
        NaN for a lost sample.
    output : array_like, shape (n_samples,), optional
        Measured; it gives the state in which the simulation begins, and nothing else. At rest before the
        record if left out; behind a gap of the input nothing is then simulated.
    start
        First sample that is simulated, from the measured state before it; the first of the record,
        from rest, if left out. The samples before it are as measured, NaN without an output.

    Returns
    -------
    ndarray, shape (n_samples,)
        NaN where the input was lost, and until a state is known again behind that.

    Raises
    ------
    ValueError, TypeError
        As `recoil_identification.arx.estimation.checked_record`; a start outside the record, or one without an output.
    """
    measured = np.full(np.shape(input_), np.nan) if output is None else output
    u, y = checked_record(input_, measured)
    orders = model.orders
    if start is not None and (output is None or not 0 <= start <= u.size):
        raise ValueError(f"a simulation from sample {start} needs the measured output of a record that long")
    simulated = np.full(u.size, np.nan)
    if start is None:
        first, past_u, past_y = 0, np.zeros(orders.delay + orders.nb), np.zeros(orders.na)
        at_rest = True
    else:
        simulated[:start] = y[:start]
        first, at_rest = start, False
    lost = np.flatnonzero(~np.isfinite(u))
    while first < u.size:
        if not at_rest:
            found = _known_state(u, y, orders.delay + orders.nb, orders.na, first)
            if found is None:
                break
            first = found
            past_u = u[first - (orders.delay + orders.nb) : first]
            past_y = y[first - orders.na : first]
        behind = lost[np.searchsorted(lost, first) :]
        stop = int(behind[0]) if behind.size else u.size
        if stop > first:
            simulated[first:stop] = _driven(model, u[first:stop], past_u, past_y)
        first, at_rest = stop + 1, False
    return simulated


def predict(model: ArxModel, input_: ArrayLike, output: ArrayLike, horizon: int = 1) -> Array:
    """Predict the output k samples ahead: from outputs up to k samples before, and inputs up to the instant.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        NaN for a lost sample.
    horizon
        k, in samples.

    Returns
    -------
    ndarray, shape (n_samples,)
        NaN where a sample that is needed was lost or lies before the record.

    Raises
    ------
    ValueError
        If the horizon is below 1; as `recoil_identification.arx.estimation.checked_record`.
    TypeError
        As `recoil_identification.arx.estimation.checked_record`.
    """
    u, y = checked_record(input_, output)
    if horizon < 1:
        raise ValueError(f"horizon must be 1 or more, found {horizon}")
    driven = np.zeros(u.size)
    for j, coefficient in enumerate(model.b):
        driven += coefficient * _late(u, model.orders.delay + j)
    # ahead[j] holds the predictions j samples ahead at every instant; those of 0 are what was measured
    ahead = [y]
    for j in range(1, horizon + 1):
        following = driven.copy()
        for i, coefficient in enumerate(model.a, start=1):
            following -= coefficient * _late(ahead[max(j - i, 0)], i)
        ahead.append(following)
    return ahead[horizon]


def fit_percent(measured: ArrayLike, modelled: ArrayLike, rows: Flags | None = None) -> float:
    """Return ``100 (1 - ||y - y_model|| / ||y - mean(y)||)``, what MATLAB's ``compare`` prints as fit.

    Parameters
    ----------
    measured, modelled : array_like, shape (n_samples,)
        Instants at which either is NaN do not count.
    rows : ndarray of bool, shape (n_samples,), optional
        Instants that count.

    Returns
    -------
    float
        100 for a perfect model, 0 for one no better than the mean, negative below that, without limit for an
        unstable one; NaN where the output does not vary.

    Raises
    ------
    ValueError
        For shapes that differ.
    """
    y, model = np.asarray(measured, dtype=np.float64), np.asarray(modelled, dtype=np.float64)
    if y.shape != model.shape or (rows is not None and np.shape(rows) != y.shape):
        raise ValueError(f"measured and modelled output must be of one length, found {y.shape} and {model.shape}")
    present = np.isfinite(y) & np.isfinite(model)
    if rows is not None:
        present &= rows
    if not present.any():
        return float("nan")
    spread = float(np.linalg.norm(y[present] - y[present].mean()))
    with np.errstate(over="ignore"):  # an unstable model may leave float64: it explains nothing
        left = float(np.linalg.norm(y[present] - model[present]))
    return 100.0 * (1.0 - left / spread) if spread > 0 else float("nan")


def _driven(model: ArxModel, u: Array, past_u: Array, past_y: Array) -> Array:
    """Run the model over an input without gaps from a known past, oldest first."""
    from scipy.signal import lfilter, lfiltic

    numerator, denominator = model.numerator, model.denominator
    if numerator.size == denominator.size == 1:
        return np.asarray(numerator[0] * u)
    state = lfiltic(numerator, denominator, past_y[::-1], past_u[::-1])
    return np.asarray(lfilter(numerator, denominator, u, zi=state)[0])


def _known_state(u: Array, y: Array, inputs: int, outputs: int, first: int) -> int | None:
    """Return the first instant from `first` on whose past input and output are all known, and its input too."""
    first = max(first, inputs, outputs)
    for k in range(first, u.size):
        past_known = np.isfinite(u[k - inputs : k + 1]).all() and np.isfinite(y[k - outputs : k]).all()
        if past_known:
            return k
    return None


def _late(series: Array, lag: int) -> Array:
    """Return a series that is late by a lag, NaN where it had not begun."""
    moved = np.full(series.size, np.nan)
    moved[lag:] = series[: max(series.size - lag, 0)]
    return moved
