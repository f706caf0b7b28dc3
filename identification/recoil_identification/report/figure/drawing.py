"""Figures as the plain dictionaries that plotly's script draws; plotly's Python package is not used.

The keys are those of plotly.js' figure reference. Samples are arrays, with NaN for a gap, until
`recoil_identification.report.page.packing` puts them into a page.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from recoil_acquisition.errors import visible
from recoil_identification.report.figure.appearance import (
    FIRED_COLOUR,
    LINE_COLOUR,
    MARK_COLOUR,
    SPAN_COLOUR,
    Range,
    band_outline,
    dash_of,
    hue_of,
    y_range,
)
from recoil_identification.report.figure.figure import (
    Figure,
    FloatArray,
    HorizontalLine,
    Scale,
    Span,
    Trace,
    bucket_starts,
    envelope_indices,
    without_straight,
)

PAGE_POINTS = 96_000  # times two coordinates, 4 bytes and base64: about 1 MB
TRACE_POINTS = 8_000


class Sizes(NamedTuple):
    """Heights in pixels: of a panel alone and of one among several, of a legend, between panels, below the last one."""

    single: int
    stacked: int
    legend: int
    axis: int
    gap: int
    bottom: int


SCREEN = Sizes(360, 235, 34, 52, 4, 46)
SHEET = Sizes(165, 90, 24, 38, 2, 38)
MEASURED_OPACITY = 0.42
STRAIGHT = 2.0**-13
"""Distance from the line between its neighbours, as a share of the panel's height, below which the second sample of a
bucket is left out: a twentieth of a pixel."""
LABEL_PLACES = ("top left", "bottom left", "middle left")
"""Places of the names of a panel's stretches, so that they do not lie on each other: the first has room above what is
drawn."""
LETTER = 0.012
"""Width of a letter of such a name, share of the width of a figure on a narrow screen."""
MOST_TICKS = 24
"""Names along an axis."""


def drawings(figures: Sequence[Figure]) -> list[dict[str, Any]]:
    """Turn figures into plotly dictionaries that stay small together.

    Returns
    -------
    list of dict
        ``key``, ``data``, ``layout`` and ``height`` (pixels) of each, ``axis``, the name of the axis that its panels
        share, ``link``, which figures with equal ones zoom and are read together by, ``switched``, and ``sheet``, the
        height on paper and the changes to the layout for it.
    """
    sizes = [np.size(t.x) for f in figures for p in f.panels for t in p.traces]
    buckets = max(_points_per_trace(sizes) // 2, 100)
    return [drawing(figure, buckets) for figure in figures]


def _points_per_trace(sizes: Sequence[int]) -> int:
    """Share the page's points out equally; short traces leave what they do not need to the long ones."""
    left, ration = PAGE_POINTS, TRACE_POINTS
    for done, size in enumerate(sorted(sizes)):
        ration = min(TRACE_POINTS, left // (len(sizes) - done))
        left -= min(size, ration)
    return ration


def drawing(figure: Figure, buckets: int = TRACE_POINTS // 2) -> dict[str, Any]:
    """Turn one figure into the dictionary that plotly draws.

    Parameters
    ----------
    buckets
        Stretches of the envelope of each trace.

    Returns
    -------
    dict
        Drawing as `drawings` has it.
    """
    data: list[dict[str, Any]] = []
    single = figure.single or bool(figure.names)
    layout: dict[str, Any] = {
        **({"hovermode": "closest"} if single else {"hovermode": "x unified", "hoversubplots": "axis"}),
        "dragmode": "zoom",
        "showlegend": True,
        "shapes": [],
    }
    tops, bottoms, height = _stack(figure, SCREEN)
    sharing = [i for i, panel in enumerate(figure.panels) if panel.x_label is None]
    for i, panel in enumerate(figure.panels):
        own = panel.x_label is not None
        number = "" if i == 0 else str(i + 1)
        # every sharing panel hangs on one and the same axis: that is what links zoom, spike and read-out
        x_number = number if own else ("" if sharing[0] == 0 else str(sharing[0] + 1))
        shown = None if own else figure.shown
        scale = "linear" if own else figure.x_scale
        if own or i == sharing[-1]:
            label = figure.x_label if panel.x_label is None else panel.x_label
            layout[f"xaxis{x_number}"] = _axis(label, scale, shown, anchor=f"y{number}") | {
                "showspikes": not single,
                "unifiedhovertitle": {"text": f"{_plain(label)}: %{{x:.6~g}}"},
            }
            if figure.names and not own:
                layout[f"xaxis{x_number}"] = _named_ticks(figure.names) | layout[f"xaxis{x_number}"]
        y_shown = y_range(panel, shown)
        layout[f"yaxis{number}"] = _axis(panel.y_label, panel.y_scale, y_shown, anchor=f"x{x_number}")
        height_y = _height(y_shown, panel.y_scale)
        layout[f"yaxis{number}"]["domain"] = [bottoms[i], tops[i]]
        layout[f"legend{number}"] = {
            "orientation": "h",
            "x": 0,
            "xanchor": "left",
            "y": tops[i],
            "yanchor": "bottom",
            "yref": "paper",
        }
        used: Counter[str] = Counter()
        for trace in panel.traces:
            hue, dash = hue_of(trace, used[trace.kind]), dash_of(trace, used[trace.kind])
            used[trace.kind] += trace.hue is None
            axes = {"xaxis": f"x{x_number}", "yaxis": f"y{number}", "legend": f"legend{number}"}
            names = figure.names if not own else ()
            parts = _trace(
                trace, hue, dash, buckets, log=scale == "log", shown=shown, names=names, straight=STRAIGHT * height_y
            )
            data += [part | axes | _grouped(trace, part, data) for part in parts]
        rows, places = _rows_of_instants(panel.spans, shown, scale), _places_of_stretches(panel.spans, shown)
        for span, row, place in zip(panel.spans, rows, places, strict=True):
            layout["shapes"].append(_span(span, f"x{x_number}", f"y{number}", place, row))
        for line in panel.lines:
            layout["shapes"] += _line(line, f"x{x_number}", f"y{number}")
    shared = "" if not sharing or sharing[0] == 0 else str(sharing[0] + 1)
    linked = bool(sharing) and figure.x_scale == "linear" and not figure.names
    return {
        "key": figure.key,
        "data": data,
        "layout": layout,
        "height": height,
        "axis": f"xaxis{shared}",
        "link": figure.x_label if linked else None,
        "switched": figure.switched,
        "sheet": _on_sheet(figure),
    }


def _on_sheet(figure: Figure) -> dict[str, Any]:
    """Return the height of a figure on paper, and where its panels and legends are then."""
    tops, bottoms, height = _stack(figure, SHEET)
    places: dict[str, Any] = {}
    for i, (top, bottom) in enumerate(zip(tops, bottoms, strict=True)):
        number = "" if i == 0 else str(i + 1)
        places |= {f"yaxis{number}.domain": [bottom, top], f"legend{number}.y": top}
    return {"height": height, "layout": places}


def _named_ticks(names: Sequence[str]) -> dict[str, Any]:
    """Label as many places as there is room for."""
    shown = range(0, len(names), -(-len(names) // MOST_TICKS))
    return {
        "tickmode": "array",
        "tickvals": list(shown),
        "ticktext": [_plain(names[i]) for i in shown],
        "range": [-0.6, len(names) - 0.4],
        "zeroline": False,
    }


def _names_of(x: FloatArray, names: Sequence[str]) -> list[str]:
    """Return the name of each point's place; empty beside the places."""
    places = np.round(x).astype(int)
    known = (np.abs(x - places) < 1e-6) & (places >= 0) & (places < len(names))
    return [_plain(names[place]) if at else "" for place, at in zip(places.tolist(), known.tolist(), strict=True)]


def _grouped(trace: Trace, drawn: dict[str, Any], earlier: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Hang a trace on its group's entry in the legend, which the group's first trace makes."""
    if not trace.group:
        return {}
    group = _plain(trace.group)
    first = not any(one.get("legendgroup") == group for one in earlier)
    said = f"{drawn['hovertemplate']}<extra>{drawn['name']}</extra>"
    return {"legendgroup": group, "name": group, "showlegend": first, "hovertemplate": said}


def _stack(figure: Figure, sizes: Sizes) -> tuple[list[float], list[float], int]:
    """Tops and bottoms of the panels as shares of the plotting area, and the height of the whole in pixels."""
    panel_px = sizes.single if len(figure.panels) == 1 else sizes.stacked
    last_sharing = max((i for i, p in enumerate(figure.panels) if p.x_label is None), default=-1)
    edges, y = [], 0.0
    for i, panel in enumerate(figure.panels):
        if i:
            y += sizes.legend
        edges.append((y, y + panel_px))
        has_axis = panel.x_label is not None or i == last_sharing
        y += panel_px + (0 if i == len(figure.panels) - 1 else sizes.axis if has_axis else sizes.gap)
    return [1 - a / y for a, _ in edges], [max(1 - b / y, 0.0) for _, b in edges], int(y) + sizes.legend + sizes.bottom


def _axis(label: str, scale: Scale, shown: Range | None, *, anchor: str) -> dict[str, Any]:
    axis: dict[str, Any] = {"title": {"text": _plain(label)}, "type": scale, "anchor": anchor, "exponentformat": "SI"}
    if scale == "log":
        decades = 1.0 if shown is None else float(np.log10(shown[1] / shown[0]))
        axis |= {"exponentformat": "power", "dtick": max(1, round(decades / 6))}
    if shown is not None:
        axis["range"] = [float(np.log10(v)) if scale == "log" else float(v) for v in shown]
    return axis


def _height(shown: Range | None, scale: Scale) -> float:
    """Return how much of y a panel shows; 0 where that is not known, or is in decades."""
    return 0.0 if shown is None or scale == "log" else shown[1] - shown[0]


def _trace(
    trace: Trace,
    hue: str,
    dash: str,
    buckets: int,
    *,
    log: bool,
    shown: Range | None,
    names: Sequence[str],
    straight: float,
) -> list[dict[str, Any]]:
    x, y = np.asarray(trace.x, dtype=np.float64), np.asarray(trace.y, dtype=np.float64)
    starts = bucket_starts(x, buckets, log=log, shown=shown)
    chosen = (
        np.arange(x.size)
        if x.size <= 2 * buckets
        else without_straight(x, y, envelope_indices(y, starts), starts, straight)
    )
    unit = _plain(trace.unit)
    drawn: dict[str, Any] = {
        "type": "scatter",
        "name": _plain(trace.name),
        "x": x[chosen],
        "y": y[chosen],
        "mode": "lines",
        "line": {"color": f"rgb({hue})", "width": 1.5, **({"dash": dash} if dash else {})},
        "meta": trace.kind,
        "hovertemplate": f"%{{y:.5~g}} {unit}",
    }
    if names:
        drawn |= {"text": _names_of(x[chosen], names), "hovertemplate": f"%{{text}}: {drawn['hovertemplate']}"}
    if not trace.visible:
        drawn["visible"] = "legendonly"
    if trace.kind == "measured":
        # the page's switch makes it opaque where it stands alone
        drawn |= {"line": {"color": f"rgb({hue})", "width": 1}, "opacity": MEASURED_OPACITY}
    elif trace.kind == "points":
        drawn |= {"mode": "markers", "marker": {"size": 4, "color": f"rgb({hue})"}}
        del drawn["line"]
    elif trace.kind == "series":
        drawn |= {"mode": "lines+markers", "marker": {"size": 5, "color": f"rgb({hue})"}}
    elif trace.kind == "marks":
        ring = {"size": 13, "symbol": "circle-open", "color": FIRED_COLOUR, "line": {"width": 2}}
        drawn |= {"mode": "markers", "marker": ring}
        del drawn["line"]
    elif trace.kind == "whiskers":
        half = ((np.asarray(trace.y_high) - np.asarray(trace.y_low)) / 2)[chosen]
        drawn |= {
            "mode": "markers",
            "marker": {"size": 6, "color": f"rgb({hue})"},
            "error_y": {"type": "data", "array": half, "color": f"rgb({hue})", "thickness": 1.4, "width": 3},
            "customdata": half,
            "hovertemplate": f"{'%{text}: ' if names else ''}%{{y:.5~g}} ± %{{customdata:.2~g}} {unit}",
        }
        del drawn["line"]
    elif trace.kind == "bars":
        drawn |= {"type": "bar", "marker": {"color": f"rgba({hue},0.55)"}}
        del drawn["line"], drawn["mode"]
    elif trace.kind == "band":
        low, high = (np.asarray(v, dtype=np.float64) for v in (trace.y_low, trace.y_high))
        group = {"legendgroup": drawn["name"]}
        drawn |= group | {
            "customdata": ((high - low) / 2)[chosen],
            "hovertemplate": f"%{{y:.5~g}} ± %{{customdata:.2~g}} {unit}",
        }
        edge_x, edge_y = band_outline(x, low, high, starts)
        filled = {
            "type": "scatter",
            "name": drawn["name"],
            "x": edge_x,
            "y": edge_y,
            "mode": "lines",
            "line": {"width": 0},
            "fill": "toself",
            "fillcolor": f"rgba({hue},0.20)",
            "hoverinfo": "skip",
            "showlegend": False,
        }
        return [filled | group | {k: v for k, v in drawn.items() if k == "visible"}, drawn]
    return [drawn]


def _rows_of_instants(spans: Sequence[Span], shown: tuple[float, float] | None, scale: str) -> list[int]:
    """Return how many rows the name of each instant lies above the foot, so that those of neighbours do not touch."""
    rows, ends = [0] * len(spans), list[float]()
    low, high = (math.log10(x) if scale == "log" and x > 0 else x for x in shown or (0.0, 0.0))
    for number in sorted(range(len(spans)), key=lambda one: spans[one].x0):
        span = spans[number]
        at = math.log10(span.x0) if scale == "log" and span.x0 > 0 else span.x0
        if span.x0 != span.x1 or not low <= at <= high or low == high:
            continue
        left = (at - low) / (high - low)
        rows[number] = next((row for row, end in enumerate(ends) if end < left), len(ends))
        ends[rows[number] : rows[number] + 1] = [left + LETTER * len(span.label)]
    return rows


def _places_of_stretches(spans: Sequence[Span], shown: tuple[float, float] | None) -> list[str]:
    """Return where the name of each stretch stands: at the top, unless that of one before it would lie under it."""
    low, high = shown or (0.0, 0.0)
    ends, places = [-math.inf] * len(LABEL_PLACES), [LABEL_PLACES[0]] * len(spans)
    for number in sorted(range(len(spans)), key=lambda one: spans[one].x0):
        span = spans[number]
        if span.x0 == span.x1:
            continue
        left = (max(span.x0, low) - low) / (high - low) if high > low else 0.0
        place = next((k for k, end in enumerate(ends) if end < left), len(ends) - 1)
        ends[place], places[number] = left + LETTER * len(span.label), LABEL_PLACES[place]
    return places


def _span(span: Span, x_axis: str, y_axis: str, label_place: str, row: int = 0) -> dict[str, Any]:
    shape: dict[str, Any] = {"xref": x_axis, "yref": f"{y_axis} domain", "x0": span.x0, "x1": span.x1, "y0": 0, "y1": 1}
    lifted = "<br>\u00a0" * row
    label = {"text": _plain(span.label) + lifted, "font": {"size": 11, "color": MARK_COLOUR}, "padding": 4}
    if span.x0 == span.x1:
        line = {"color": MARK_COLOUR, "width": 1, "dash": "4px,3px"}
        # at the foot, where the first stretch has not its label
        place = {"textposition": "start", "textangle": 0, "xanchor": "left", "yanchor": "bottom"}
        return shape | {"type": "line", "line": line, "label": label | place}
    fill = {"type": "rect", "layer": "below", "fillcolor": SPAN_COLOUR, "line": {"width": 0}}
    return shape | fill | {"label": label | {"textposition": label_place}}


def _line(line: HorizontalLine, x_axis: str, y_axis: str) -> list[dict[str, Any]]:
    if not np.isfinite(line.y):
        return []
    colour = LINE_COLOUR[line.kind]
    place = {"xref": f"{x_axis} domain", "yref": y_axis, "x0": 0, "x1": 1}
    label = {
        "text": _plain(line.label),
        "textposition": "end",
        "yanchor": "bottom",
        "font": {"size": 11, "color": colour},
    }
    shapes: list[dict[str, Any]] = [
        place | {"type": "line", "y0": line.y, "y1": line.y, "line": {"color": colour, "width": 1.3}, "label": label}
    ]
    if line.y_low is not None and line.y_high is not None:
        band = {"type": "rect", "y0": line.y_low, "y1": line.y_high, "layer": "below", "line": {"width": 0}}
        shapes.insert(0, place | band | {"fillcolor": colour.replace("rgb(", "rgba(").replace(")", ",0.10)")})
    return shapes


def _plain(text: str) -> str:
    """Text that plotly neither reads as markup nor as a template."""
    escaped = visible(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return escaped.replace("%{", "% {")
