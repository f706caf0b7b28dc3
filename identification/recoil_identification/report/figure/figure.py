"""The description of a drawing, before it is drawn: traces in panels, panels in a figure, all plain arrays.

::

    Figure  one question and its answer: title, caption, panels one below the other
    +-- Panel           one pair of axes; panels without an x axis of their own share the figure's
        +-- Trace           one curve, band, set of points or of bars
        +-- HorizontalLine  a level to compare with, for example the specification mass
        +-- Span            a stretch of the x axis, for example the identification interval

A long trace is thinned by its envelope (`envelope_indices`): each stretch of samples gives its smallest and its
largest one, at their own instants, so that no peak is lost however far the drawing is zoomed out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from recoil_identification.estimate.budget import COVERAGE_FACTOR

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.intp]
TraceKind = Literal[
    "measured", "filtered", "model", "reference", "band", "points", "bars", "series", "whiskers", "marks"
]
Scale = Literal["linear", "log"]
LineKind = Literal["specification", "limit", "mean"]

TIME = "time on the reference clock, s"
"""The x axis of most figures."""
FOCUS_SHARE = 0.75
"""Share of the buckets that falls on the part of the x axis that is shown first."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One curve.

    Parameters
    ----------
    name
        Name as the legend and the cursor's read-out show it.
    x, y : array-like, shape (n_samples,)
        ``x`` is finite; ``y`` may have gaps (NaN), which stay gaps.
    kind : {"measured", "filtered", "model", "reference", "band", "points", "bars", "series", "whiskers", "marks"}
        Kind of the curve, which decides how it is drawn. The k-th measured and the k-th filtered trace of a panel share
        a hue, and the k-th model and the k-th set of points the next one. The first reference is grey. A band is the
        curve ``y`` between ``y_low`` and ``y_high``; whiskers are points with a bar from the one to the other; a series
        is points on a line; marks are rings round points of another trace.
    unit
        Unit of ``y``, shown in the cursor's read-out.
    y_low, y_high : array-like, shape (n_samples,), or None
        Limits of a band or of whiskers; needed for them, refused elsewhere.
    visible
        False: the trace is drawn once its name in the legend is clicked.
    hue
        Number of its colour; None takes the next one of its kind.
    dash
        Number of its dashes; None takes that of the hue, if one is given, or the next one of its kind.
    group
        Traces of one group have one entry in the figure's legend, under the group's name, and are hidden together.

    Raises
    ------
    ValueError
        Lengths that differ, an ``x`` that is not finite, an unknown kind, or limits that do not fit the kind.
    """

    name: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    kind: TraceKind
    unit: str = ""
    y_low: npt.ArrayLike | None = None
    y_high: npt.ArrayLike | None = None
    visible: bool = True
    hue: int | None = None
    group: str = ""
    dash: int | None = None

    def __post_init__(self) -> None:
        if self.kind not in get_args(TraceKind):
            raise ValueError(
                f"trace {self.name!r}: kind {self.kind!r}; expected one of {', '.join(get_args(TraceKind))}"
            )
        if (self.kind in ("band", "whiskers")) != (self.y_low is not None and self.y_high is not None):
            raise ValueError(
                f"trace {self.name!r}: a band and whiskers have y_low and y_high, a trace of kind {self.kind!r} has not"
            )
        for field in ("x", "y", "y_low", "y_high"):
            values = getattr(self, field)
            if values is None:
                continue
            array = np.array(values, dtype=np.float64)
            if array.ndim != 1 or (field != "x" and array.size != np.size(self.x)):
                raise ValueError(
                    f"trace {self.name!r}: {field} has shape {array.shape}; expected one axis, as long as x"
                )
            array.flags.writeable = False
            object.__setattr__(self, field, array)
        if not np.all(np.isfinite(np.asarray(self.x))):
            raise ValueError(f"trace {self.name!r}: x has values that are not finite; gaps belong into y")


def with_interval(
    name: str,
    x: FloatArray,
    y: FloatArray,
    u: FloatArray,
    unit: str,
    *,
    scale: float = 1.0,
    visible: bool = True,
    hue: int | None = None,
) -> Trace:
    """Return a curve as the band of its 95 % interval, from its standard uncertainty; `scale` is for the drawing."""
    half = COVERAGE_FACTOR * u
    low, high = scale * (y - half), scale * (y + half)
    return Trace(name, x, scale * y, "band", unit, low, high, visible=visible, hue=hue)


@dataclass(frozen=True)
class HorizontalLine:
    """A level to compare with: its value on the y axis, and optionally its standard or tolerance band."""

    label: str
    y: float
    kind: LineKind = "specification"
    y_low: float | None = None
    y_high: float | None = None


ZERO = HorizontalLine("zero", 0.0, "mean")
"""Level that a difference should have."""


@dataclass(frozen=True)
class Span:
    """A stretch of the x axis from ``x0`` to ``x1``; a vertical line where they are equal."""

    label: str
    x0: float
    x1: float


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    y_label
        Quantity and unit.
    y_scale : {"linear", "log"}
    y_shown
        The range that is shown first; None shows everything within the x range that is shown first.
    x_label
        Title of an x axis of its own; None shares the figure's, and zooms with it.
    """

    y_label: str
    traces: tuple[Trace, ...]
    lines: tuple[HorizontalLine, ...] = ()
    spans: tuple[Span, ...] = ()
    y_scale: Scale = "linear"
    y_shown: tuple[float, float] | None = None
    x_label: str | None = None


@dataclass(frozen=True, eq=False)
class Figure:
    """One question and its answer.

    Parameters
    ----------
    key
        Short and unique in a report; names the image that a reader saves.
    title, caption
        The caption is one sentence that says what to see.
    x_label
        Quantity and unit of the x axis that the panels share.
    panels
        Panels from top to bottom.
    shown
        The range of the shared x axis that is shown first, and drawn finest; None shows all.
    x_scale : {"linear", "log"}
        Scale of the shared x axis.
    names
        Names of the places 0, 1, .. of the shared x axis, where these are no numbers; the read-out is that of one
        trace.
    single
        Whether the read-out is that of the nearest trace, where there are many.
    folded
        Whether it is shown only when it is asked for.
    switched
        Whether the page's switch between what was recorded and what is filtered acts on it.

    Raises
    ------
    ValueError
        No panel, or a range that does not ascend.
    """

    key: str
    title: str
    caption: str
    x_label: str
    panels: tuple[Panel, ...]
    shown: tuple[float, float] | None = None
    x_scale: Scale = "linear"
    names: tuple[str, ...] = ()
    single: bool = False
    folded: bool = False
    switched: bool = False

    def __post_init__(self) -> None:
        if not self.panels:
            raise ValueError(f"figure {self.key!r} has no panel")
        ranges = [self.shown, *(panel.y_shown for panel in self.panels)]
        for low, high in (r for r in ranges if r is not None):
            if not low < high:
                raise ValueError(f"figure {self.key!r}: the range {low} to {high} does not ascend")


def bucket_starts(
    x: FloatArray, buckets: int, *, log: bool = False, shown: tuple[float, float] | None = None
) -> IndexArray:
    """Cut the samples of a trace into stretches of equal width on the drawing.

    Parameters
    ----------
    x : ndarray, shape (n_samples,)
    buckets
        Largest number of buckets.
    log
        Equal width on a logarithmic x axis; needs an ascending ``x``, and is ignored where none is positive.
    shown
        A part of an ascending ``x`` to cut finer: three quarters of the buckets fall on it.

    Returns
    -------
    ndarray of int, shape (about ``buckets``,)
        The first index of each stretch, ascending, the first one 0; two more at most than ``buckets``.

    Raises
    ------
    ValueError
        ``buckets`` below 4.
    """
    if buckets < 4:
        raise ValueError(f"{buckets} buckets; expected 4 or more")
    n = x.size
    if n <= buckets:
        return np.arange(n)
    ascending = bool(np.all(x[1:] >= x[:-1]))
    if log and ascending and x[-1] > 0.0:
        smallest = x[np.searchsorted(x, 0.0, side="right")]
        edges = np.geomspace(smallest, x[-1], buckets)[:-1]
        return _each_once(np.concatenate([[0], np.searchsorted(x, edges)]))
    if shown is None or not ascending:
        return np.linspace(0, n, buckets, endpoint=False).astype(np.intp)
    first, last = (int(i) for i in np.searchsorted(x, shown))
    inside = min(last - first, max(int(FOCUS_SHARE * buckets), buckets * (last - first) // n))
    before = (buckets - inside) * first // max(n - (last - first), 1)
    parts = ((0, first, before), (first, last, inside), (last, n, buckets - inside - before))
    starts = [np.linspace(a, b, max(min(k, b - a), 1), endpoint=False) for a, b, k in parts if b > a]
    return _each_once(np.concatenate([[0.0], *starts]).astype(np.intp))


def envelope_indices(y: FloatArray, starts: IndexArray) -> IndexArray:
    """Choose the samples that carry a trace's envelope.

    Parameters
    ----------
    y : ndarray, shape (n_samples,)
        NaN and infinity are gaps.
    starts
        Starts of the buckets, as `bucket_starts` gives them.

    Returns
    -------
    ndarray of int
        Ascending. Of each bucket the smallest and the largest finite sample; of one with a gap also its first
        missing and its first and last finite sample, so that the gap stays a gap and what surrounds it stays a
        line. Always the first and the last sample of all.
    """
    if y.size == 0:
        return np.arange(0)
    bucket = np.repeat(np.arange(starts.size), np.diff(starts, append=y.size))
    finite = np.isfinite(y)
    below, above = np.where(finite, y, np.inf), np.where(finite, y, -np.inf)
    lowest = np.flatnonzero(finite & (below == np.minimum.reduceat(below, starts)[bucket]))
    highest = np.flatnonzero(finite & (above == np.maximum.reduceat(above, starts)[bucket]))
    chosen = [_first_of_each(lowest, bucket), _first_of_each(highest, bucket), np.array([0, y.size - 1])]
    missing = np.flatnonzero(~finite)
    if missing.size:
        broken = np.zeros(starts.size, dtype=bool)
        broken[bucket[missing]] = True
        present = np.flatnonzero(finite & broken[bucket])
        chosen += [_first_of_each(missing, bucket), _first_of_each(present, bucket)]
        chosen.append(_first_of_each(present[::-1], bucket))
    return _each_once(np.concatenate(chosen))


def without_straight(
    x: FloatArray, y: FloatArray, chosen: IndexArray, starts: IndexArray, tolerance: float
) -> IndexArray:
    """Leave out samples that lie on the line between their neighbours; each bucket keeps one that a cursor can read.

    Parameters
    ----------
    x, y : ndarray, shape (n_samples,)
    chosen : ndarray of int
        Indices of the samples that carry the envelope, ascending.
    starts
        Starts of the buckets.
    tolerance
        Distance in y from that line; nothing is left out at 0.

    Returns
    -------
    ndarray of int
        Some of `chosen`; what stands beside a gap, and the first and the last, are among them.
    """
    if tolerance <= 0.0 or chosen.size < 3:
        return chosen
    bucket = np.searchsorted(starts, chosen, side="right")
    # the second of two in one bucket
    at = np.flatnonzero(bucket[1:-1] == bucket[:-2]) + 1
    left, right = chosen[at - 1], chosen[at + 1]
    span = x[right] - x[left]
    with np.errstate(invalid="ignore", divide="ignore"):
        on_line = y[left] + (y[right] - y[left]) * (x[chosen[at]] - x[left]) / span
        # of what is no number nothing is less
        straight = (np.abs(y[chosen[at]] - on_line) <= tolerance) & (span > 0.0)
    at = at[straight]
    # of neighbours in a row every other one stays
    at = at[np.append(True, np.diff(at) > 1)] if at.size else at
    return np.delete(chosen, at)


def _each_once(indices: IndexArray) -> IndexArray:
    """Sort indices, of which there is at least one, each once: ``numpy.unique`` hashes them, ten times as long."""
    ascending = np.sort(indices)
    return np.asarray(ascending[np.append(True, ascending[1:] != ascending[:-1])], dtype=np.intp)


def _first_of_each(indices: IndexArray, bucket: IndexArray) -> IndexArray:
    """Keep the first of the indices in each bucket; equal buckets are neighbours."""
    owner = bucket[indices]
    return indices[np.concatenate([[True], owner[1:] != owner[:-1]])] if indices.size else indices
