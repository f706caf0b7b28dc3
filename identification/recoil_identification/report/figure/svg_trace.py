"""One trace of a panel as SVG paths: thinned by its envelope, and cut to the panel."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from recoil_identification.report.figure.appearance import FIRED_COLOUR, band_outline
from recoil_identification.report.figure.figure import FloatArray, Trace, bucket_starts, envelope_indices
from recoil_identification.report.figure.svg_axes import LEFT_PX, RIGHT_PX, Axes, bar_width
from recoil_identification.report.figure.svg_text import number

STRAIGHT_PX, MOST_PASSES = 0.1, 5
"""Distance from the line between its neighbours below which a point is left out, each pass every other one at most."""
DOTTED = ("points", "whiskers", "series")
"""Kinds of traces that have a dot at each sample."""


def pen(trace: Trace, hue: str, dash: str) -> str:
    """Return how the line of a trace is drawn: attributes of a path.

    Parameters
    ----------
    hue
        Red, green and blue with commas between them.
    dash
        Lengths with commas between them; empty for a line that is drawn through.
    """
    widths = {"measured": '0.7" stroke-opacity="0.6', "series": "0.8"}
    ends = f'stroke-dasharray="{dash.replace("px", "")}"' if dash else 'stroke-linecap="round"'
    return f'fill="none" stroke="rgb({hue})" stroke-width="{widths.get(trace.kind, "1.3")}" {ends}'


def trace_parts(trace: Trace, hue: str, dash: str, axes: Axes, buckets: int) -> list[str]:
    """Draw a trace.

    Parameters
    ----------
    hue, dash
        Colour and dash, as `pen` takes them.
    buckets
        Stretches of its envelope.

    Returns
    -------
    list of str
        SVG elements.
    """
    x, y = np.asarray(trace.x, dtype=np.float64), np.asarray(trace.y, dtype=np.float64)
    limits = [np.asarray(v, dtype=np.float64) for v in (trace.y_low, trace.y_high) if v is not None]
    if np.all(x[1:] >= x[:-1]):
        # with a neighbour on either side, to which a line leads that leaves the drawing
        part = slice(max(int(np.searchsorted(x, axes.x[0])) - 1, 0), int(np.searchsorted(x, axes.x[1], "right")) + 1)
        x, y, limits = x[part], y[part], [v[part] for v in limits]
    starts = bucket_starts(x, buckets, log=axes.x_scale == "log")
    chosen = np.arange(x.size) if x.size <= 2 * buckets else envelope_indices(y, starts)
    across, up = axes.across(x[chosen]), axes.up(y[chosen])
    if trace.kind == "bars":
        return _bars(across, up, axes, bar_width(x), hue)
    if trace.kind == "marks":
        ring = f'r="5" fill="none" stroke="{FIRED_COLOUR}" stroke-width="1.5"'
        return [f'<circle cx="{number(a)}" cy="{number(b)}" {ring}/>' for a, b in _inside(across, up, axes)]
    parts, line = [], pen(trace, hue, dash)
    if trace.kind == "band":
        edge_x, edge_y = band_outline(x, limits[0], limits[1], starts)
        outline = _outline(axes.across(edge_x), axes.up(edge_y), axes)
        parts.append(f'<path d="{outline}" fill="rgb({hue})" fill-opacity="0.22"/>')
    if trace.kind == "whiskers":
        low, high = (axes.up(v[chosen]) for v in limits)
        parts.append(f'<path d="{_whiskers(across, low, high, axes)}" {line}/>')
    if trace.kind in DOTTED:
        dots = "".join(f"M{number(a)} {number(b)}h.1" for a, b in _inside(across, up, axes))
        size = 2.4 if trace.kind == "points" else 4.2
        ends = f'stroke-width="{size}" stroke-linecap="round"'
        parts.append(f'<path d="{dots}" fill="none" stroke="rgb({hue})" {ends}/>')
    if trace.kind not in ("points", "whiskers"):
        parts.append(f'<path d="{_curve(across, up, axes)}" {line} stroke-linejoin="round"/>')
    return parts


def _inside(across: FloatArray, up: FloatArray, axes: Axes) -> list[tuple[float, float]]:
    """Return the points that lie in the panel."""
    seen = (across >= LEFT_PX) & (across <= RIGHT_PX) & (up >= axes.top_px) & (up <= axes.bottom_px)
    return list(zip(across[seen].tolist(), up[seen].tolist(), strict=True))


def _with_crossings(limited: FloatArray, other: FloatArray, low: float, high: float) -> tuple[FloatArray, FloatArray]:
    """Insert the points at which a curve crosses two levels of one of its coordinates."""
    places = [np.arange(limited.size, dtype=np.float64)]
    for level in (low, high):
        before, after = limited[:-1] - level, limited[1:] - level
        at = np.flatnonzero(before * after < 0.0)
        places.append(at + before[at] / (before[at] - after[at]))
    order = np.unique(np.concatenate(places))
    base = np.minimum(order.astype(np.intp), max(limited.size - 1, 0))
    share, following = order - base, np.minimum(base + 1, max(limited.size - 1, 0))
    cut = [np.where(share > 0.0, v[base] + share * (v[following] - v[base]), v[base]) for v in (limited, other)]
    return cut[0], cut[1]


def _curve(across: FloatArray, up: FloatArray, axes: Axes) -> str:
    """Draw a line through points; what lies outside the panel, or is a gap, parts it."""
    across, up = _with_crossings(across, up, LEFT_PX, RIGHT_PX)
    up, across = _with_crossings(up, across, axes.top_px, axes.bottom_px)
    near = 1e-3  # of a pixel: a crossing is not on the level to the last digit
    seen = (across >= LEFT_PX - near) & (across <= RIGHT_PX + near)
    seen &= (up >= axes.top_px - near) & (up <= axes.bottom_px + near)
    cuts = np.flatnonzero(np.diff(seen.astype(np.int8), prepend=0, append=0))
    return "".join(
        _line(*_without_straight(across[first:last], up[first:last]))
        for first, last in zip(cuts[::2].tolist(), cuts[1::2].tolist(), strict=True)
    )


def _line(across: FloatArray, up: FloatArray) -> str:
    """Write a line through at least one point by its steps, in tenths of a pixel; one that stays in place is a dot."""
    places = np.rint(10.0 * np.column_stack([across, up])).astype(np.int64)
    steps = np.diff(places, axis=0)
    steps = steps[np.any(steps != 0, axis=1)]
    begin = "M" + " ".join(number(place / 10) for place in places[0].tolist())
    return f"{begin}l{''.join(map(_tenths, steps.ravel().tolist()))}" if steps.size else f"{begin}h.1"


@cache
def _tenths(count: int) -> str:
    """Write so many tenths as a path does: what stands before is parted from it by a blank or by its sign."""
    text = f"{abs(count) / 10:g}"
    return ("-" if count < 0 else " ") + (text.removeprefix("0") if abs(count) < 10 and count else text)


def _without_straight(across: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out points that lie on the line between their neighbours, as far as a drawing shows."""
    for _ in range(MOST_PASSES):
        if across.size < 3:
            break
        ends, middles = slice(None, None, 2), slice(1, across.size - 1, 2)
        before = np.column_stack([across[ends], up[ends]])
        chords, off = np.diff(before, axis=0), np.column_stack([across[middles], up[middles]])
        count = min(len(chords), len(off))
        chords, off = chords[:count], off[:count] - before[:count]
        length = np.maximum(np.hypot(*chords.T), 1e-9)
        beside = np.abs(chords[:, 0] * off[:, 1] - chords[:, 1] * off[:, 0]) / length
        along = np.sum(chords * off, axis=1) / length
        # a point that turns back is a peak
        straight = (beside < STRAIGHT_PX) & (along >= 0.0) & (along <= length)
        if not straight.any():
            break
        kept = np.ones(across.size, dtype=bool)
        kept[1 : 2 * count : 2] = ~straight
        across, up = across[kept], up[kept]
    return across, up


def _outline(across: FloatArray, up: FloatArray, axes: Axes) -> str:
    """Draw the closed outlines of a band, parted by gaps; they run along the panel's edge where the band leaves it."""
    pieces = []
    cuts = np.flatnonzero(np.diff(np.isfinite(across + up).astype(np.int8), prepend=0, append=0))
    for first, last in zip(cuts[::2], cuts[1::2], strict=True):
        a, b = _with_crossings(across[first:last], up[first:last], LEFT_PX, RIGHT_PX)
        seen = (a >= LEFT_PX - 1e-3) & (a <= RIGHT_PX + 1e-3)
        b, a = _with_crossings(b[seen], a[seen], axes.top_px, axes.bottom_px)
        b = np.clip(b, axes.top_px, axes.bottom_px)
        pieces.append(f"{_line(*_without_straight(a, b))}Z" if a.size else "")
    return "".join(pieces)


def _whiskers(across: FloatArray, low: FloatArray, high: FloatArray, axes: Axes) -> str:
    pieces = []
    low, high = (np.clip(v, axes.top_px, axes.bottom_px) for v in (low, high))
    for x, bottom, top in zip(across.tolist(), low.tolist(), high.tolist(), strict=True):
        if LEFT_PX <= x <= RIGHT_PX and bottom - top >= 0.0:
            left, right = number(max(x - 3, LEFT_PX)), number(min(x + 3, RIGHT_PX))
            pieces.append(f"M{left} {number(bottom)}H{right}M{left} {number(top)}H{right}")
            pieces.append(f"M{number(x)} {number(bottom)}V{number(top)}")
    return "".join(pieces)


def _bars(across: FloatArray, up: FloatArray, axes: Axes, width: float, hue: str) -> list[str]:
    half = 0.46 * width * (RIGHT_PX - LEFT_PX) / (axes.x[1] - axes.x[0]) if axes.x_scale == "linear" else 3.0
    zero = axes.bottom_px if axes.y_scale == "log" else float(axes.up(np.zeros(1))[0])
    foot, up = min(max(zero, axes.top_px), axes.bottom_px), np.clip(up, axes.top_px, axes.bottom_px)
    pieces = []
    for x, y in zip(across.tolist(), up.tolist(), strict=True):
        left, right = max(x - half, LEFT_PX), min(x + half, RIGHT_PX)
        if left < right and math.isfinite(y):
            pieces.append(f"M{number(left)} {number(foot)}V{number(y)}H{number(right)}V{number(foot)}Z")
    return [f'<path d="{"".join(pieces)}" fill="rgb({hue})" fill-opacity="0.55"/>']
