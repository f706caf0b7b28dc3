"""A panel's axes on paper: which part of its quantities they show, and where on the drawing a value stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_identification.report.figure.appearance import Range, y_range
from recoil_identification.report.figure.figure import Figure, FloatArray, Panel, Scale, Trace

LEFT_PX, RIGHT_PX = 62.0, 706.0
"""Ends of every panel."""
FAR_PX = 1e6
"""A point farther away than this from a panel stands there instead."""
LARGEST, SMALLEST = 1e300, 1e-280
"""Limits of the numbers that an axis can have at its ends."""


@dataclass(frozen=True)
class Axes:
    """Where a panel stands on the drawing, in pixels, and the ranges that it shows."""

    top_px: float
    bottom_px: float
    x: Range
    y: Range
    x_scale: Scale
    y_scale: Scale

    def across(self, values: FloatArray) -> FloatArray:
        """Return where values of x stand; NaN for gaps and for what a logarithmic axis has no place for."""
        return LEFT_PX + (RIGHT_PX - LEFT_PX) * _share(values, self.x, self.x_scale)

    def up(self, values: FloatArray) -> FloatArray:
        """Return where values of y stand, as `across`."""
        return self.bottom_px - (self.bottom_px - self.top_px) * _share(values, self.y, self.y_scale)


def _share(values: FloatArray, shown: Range, scale: Scale) -> FloatArray:
    limits = np.array(shown)
    with np.errstate(all="ignore"):
        if scale == "log":
            values, limits = np.log10(np.where(values > 0.0, values, np.nan)), np.log10(limits)
        else:
            size = float(np.abs(limits).max())  # so that no difference of two floats overflows
            values, limits = values / size, limits / size
        share = (values - limits[0]) / (limits[1] - limits[0])
        return np.asarray(np.clip(np.where(np.isfinite(values), share, np.nan), -FAR_PX, FAR_PX), dtype=np.float64)


def axes_of(figure: Figure, panel: Panel, top_px: float, bottom_px: float) -> Axes:
    """Choose the ranges of a panel: those that its page shows first, or all that is drawn."""
    own = panel.x_label is not None
    scale: Scale = "linear" if own or figure.names else figure.x_scale
    shown = None if own else figure.shown
    if shown is None and figure.names and not own:
        shown = (-0.6, len(figure.names) - 0.4)
    if shown is None:
        shown = _x_extent([panel] if own else [one for one in figure.panels if one.x_label is None], scale)
    x = _usable(shown, scale)
    y = y_range(panel, x)
    if y is None:
        y = _one_level(panel.traces)
    if panel.y_scale == "linear" and any(trace.kind == "bars" and trace.visible for trace in panel.traces):
        y = (min(y[0], 0.0) if y[0] < -0.1 * y[1] else 0.0, y[1])
    return Axes(top_px, bottom_px, x, _usable(y, panel.y_scale), scale, panel.y_scale)


def _x_extent(panels: Sequence[Panel], scale: Scale) -> Range:
    drawn = [trace for panel in panels for trace in panel.traces if trace.visible]
    values = np.concatenate([np.empty(0), *(np.asarray(trace.x, dtype=np.float64) for trace in drawn)])
    values = values[values > 0.0] if scale == "log" else values
    margin = max((bar_width(np.asarray(trace.x)) / 2 for trace in drawn if trace.kind == "bars"), default=0.0)
    return (float(values.min()) - margin, float(values.max()) + margin) if values.size else (0.0, 1.0)


def _one_level(traces: Sequence[Trace]) -> Range:
    levels = np.concatenate([np.empty(0), *(np.asarray(one.y, dtype=np.float64) for one in traces if one.visible)])
    levels = levels[np.isfinite(levels)]
    return (float(levels[0]), float(levels[0])) if levels.size else (0.0, 1.0)


def bar_width(x: FloatArray) -> float:
    """Return how wide bars are at some places: as the least distance between two of them, in the unit of x."""
    return float(np.diff(np.sort(x)).min()) if x.size > 1 else 1.0


def _usable(shown: Range, scale: Scale) -> Range:
    """Make a range one that an axis can have: finite, of some width, and positive on a logarithmic one."""
    low, high = (0.0 if math.isnan(limit) else min(max(limit, -LARGEST), LARGEST) for limit in shown)
    if scale == "log":
        high = high if high > SMALLEST else 10.0
        low = max(low, high * 1e-15) if low > 0.0 else high * 1e-6
    size = max(abs(low), abs(high))
    if high - low > max(1e-9 * size, SMALLEST):
        return low, high
    if scale == "log":
        return low / 2, high * 2
    half = 0.05 * size if size > SMALLEST else 1.0
    return low - half, high + half
