"""How a figure looks, whoever draws it: its colours, the range that it shows, the outline of a band."""

from __future__ import annotations

import numpy as np

from recoil_identification.report.figure.figure import FloatArray, IndexArray, Panel, Trace

Range = tuple[float, float]

HUES = ("0,114,178", "213,94,0", "0,158,115", "204,121,167", "86,180,233", "185,35,85", "230,159,0", "110,120,135")
"""Six of them are those of Okabe and Ito, *Color Universal Design* (2008): whoever is colour-blind tells them apart."""
REFERENCE_HUE = "139,147,160"
DASHES = ("", "8px,3px", "2px,2px", "9px,3px,2px,3px", "15px,4px", "5px,2px,1px,2px,1px,2px")
"""Dashes of the lines of one panel, so that grey paper tells them apart; the first is drawn through."""
LINE_COLOUR = {"specification": "rgb(185,35,85)", "limit": "rgb(213,94,0)", "mean": "rgb(0,114,178)"}
SPAN_COLOUR = "rgba(110,130,160,0.11)"
FIRED_COLOUR = "rgb(185,35,85)"
MARK_COLOUR = "rgb(139,147,160)"

METHODS = ("calibrated", "reverse", "kinematic", "paper", "camera", "forward", "tls")
"""Their places are their hues: a method has one look in every report."""

LOG_DECADES = 10  # below the largest value; what lies deeper is the arithmetic's, not the recorder's


def hue_of(trace: Trace, earlier: int) -> str:
    """Choose the colour of a trace from the number of earlier ones of its kind in the panel."""
    if trace.hue is None and trace.kind == "reference" and earlier == 0:
        return REFERENCE_HUE
    # a model and points are there to be compared with a filtered trace, and so begin with another hue
    first = 1 if trace.kind in ("model", "points", "reference") else 0
    return HUES[(first + earlier if trace.hue is None else trace.hue) % len(HUES)]


def dash_of(trace: Trace, earlier: int) -> str:
    """Choose the dashes of a line as `hue_of` chooses its colour; empty for one that is drawn through.

    The curve of a band is, unless it is given dashes.
    """
    if trace.kind == "band" and trace.dash is not None:
        return DASHES[trace.dash % len(DASHES)]
    if trace.kind not in ("filtered", "model", "reference", "series"):
        return ""
    first = 1 if trace.kind == "model" else 2 if trace.kind == "reference" else 0
    numbers = (number for number in (trace.dash, trace.hue, first + earlier) if number is not None)
    return DASHES[next(numbers) % len(DASHES)]


def y_range(panel: Panel, shown: Range | None) -> Range | None:
    """Find the range of y that holds the lines and all that is visible within the x range shown first."""
    if panel.y_shown is not None:
        return panel.y_shown
    log = panel.y_scale == "log"
    if shown is None and not log and not panel.spans and not panel.lines:
        return None
    within = (-np.inf, np.inf) if shown is None else shown
    levels = [np.array([v for n in panel.lines for v in (n.y, n.y_low, n.y_high) if v is not None], dtype=np.float64)]
    for trace in panel.traces:
        x = np.asarray(trace.x, dtype=np.float64)
        inside = (x >= within[0]) & (x <= within[1])
        levels += [
            np.asarray(v)[inside] for v in (trace.y, trace.y_low, trace.y_high) if v is not None and trace.visible
        ]
    values = np.concatenate(levels)
    values = values[np.isfinite(values) & ((values > 0.0) | (not log))]
    if values.size == 0:
        return None
    low, high = float(values.min()), float(values.max())
    if log:
        return max(low, high * 10.0**-LOG_DECADES) / 2.0, high * 3.0
    # a span's label stands at the top of the panel, and needs room there
    stretches = [span for span in panel.spans if span.x0 < span.x1]
    # and that of one which stands over another at the foot
    below, above = (0.13 if room else 0.06 for room in (len(stretches) > 1, panel.spans))
    below, above = below * (high - low), above * (high - low)
    return (low - below, high + above) if low < high else None


def band_outline(x: FloatArray, low: FloatArray, high: FloatArray, starts: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Draw round a band: one closed outline for each stretch without a gap, parted by NaN."""
    if x.size == 0:
        return x, x
    # a band is at least as wide on the drawing as at any sample of the bucket
    lower, upper, at = np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts), x[starts]
    lower, upper, at = np.append(lower, low[-1]), np.append(upper, high[-1]), np.append(at, x[-1])
    present = np.isfinite(lower) & np.isfinite(upper)
    cuts = np.flatnonzero(np.diff(present.astype(np.int8), prepend=0, append=0))
    edge_x: list[FloatArray] = []
    edge_y: list[FloatArray] = []
    gap = np.array([np.nan])
    for first, last in zip(cuts[::2], cuts[1::2], strict=True):
        edge_x += [at[first:last], at[first:last][::-1], gap]
        edge_y += [upper[first:last], lower[first:last][::-1], gap]
    if not edge_x:
        return np.empty(0), np.empty(0)
    return np.concatenate(edge_x), np.concatenate(edge_y)
