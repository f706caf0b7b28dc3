"""A figure as one SVG text: vectors for paper and for other programs, with nothing that moves.

What a reader of the page may switch on is not drawn. Everything is cut to its panel before it is written, so that no
coordinate lies outside of the drawing. Equal figures give equal bytes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import unescape
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_beginning
from recoil_identification.report.figure.appearance import FIRED_COLOUR, LINE_COLOUR, Range, dash_of, hue_of
from recoil_identification.report.figure.figure import Figure, FloatArray, HorizontalLine, Panel, Scale, Span, Trace
from recoil_identification.report.figure.svg_axes import LEFT_PX, RIGHT_PX, Axes, axes_of
from recoil_identification.report.figure.svg_text import clean, fitted, label, number, text_width
from recoil_identification.report.figure.svg_trace import DOTTED, pen, trace_parts
from recoil_identification.report.figure.ticks import Ticks, linear_ticks, log_ticks

WIDTH_PX = 720
"""Width of every figure: 4 pixels in a millimetre of an A4 page between its margins."""
PANEL_PX = {1: 180.0, 2: 105.0}
"""Height of each panel of a figure with so many; `MANY_PX` of one with more."""
MANY_PX = 95.0
LEGEND_ROW_PX, AXIS_PX, GAP_PX = 16.0, 34.0, 8.0
TEXT_PX, SMALL_PX = 11.0, 10.0
SWATCH_PX = 24.0
FONTS = "Arial, 'Helvetica Neue', 'Liberation Sans', 'Libertinus Serif', sans-serif"
INK, SOFT, GRID, EDGE, SPAN = "#18212b", "#4b5764", "#e3e7ec", "#8a94a0", "#f1f3f6"

PANEL_POINTS, TRACE_POINTS = 20_000, 2_000
"""About so many points are drawn at most."""
MOST_NAMES, WIDEST_NAME_PX = 24, 110.0
LEVEL_DASH = {"specification": "", "limit": ' stroke-dasharray="8 3"', "mean": ' stroke-dasharray="2 3"'}
RAISED = str.maketrans("0123456789-\N{MINUS SIGN}", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")
STILL_POINTS = 400
"""The same of a drawing inside a page."""
XMLNS = ' xmlns="http://www.w3.org/2000/svg"'
HEAD = f'<svg{XMLNS} data-figure="'
"""Beginning of a drawing, before its figure's key."""
LONGEST_KEY_BYTES = 4096


def key_of(path: Path) -> str | None:
    """Return the key of the figure that a file is a drawing of; None if it is none of `figure_svg`."""
    try:
        beginning = read_beginning(path, len(HEAD) + LONGEST_KEY_BYTES).decode("utf-8", "replace")
    except ReadError:
        return None
    return unescape(beginning.removeprefix(HEAD).partition('"')[0]) if beginning.startswith(HEAD) else None


def still_svg(figure: Figure) -> str:
    """Draw a figure for the inside of a page, where it stands until a script draws it: with fewer points, as HTML."""
    return figure_svg(figure, STILL_POINTS).replace(XMLNS, "", 1).replace("<svg ", '<svg class="still" role="img" ', 1)


def figure_svg(figure: Figure, trace_points: int = TRACE_POINTS) -> str:
    """Draw a figure.

    Parameters
    ----------
    figure
        Any, also without samples, or of infinite values.
    trace_points
        Points that are drawn at most of a trace, or about so many.

    Returns
    -------
    str
        A complete SVG document, `WIDTH_PX` wide, with the figure's title and caption as its title and description,
        and its key, by which `key_of` knows it again.
    """
    parts: list[str] = []
    last_sharing = max((i for i, panel in enumerate(figure.panels) if panel.x_label is None), default=-1)
    top = 2.0
    for i, panel in enumerate(figure.panels):
        drawn, own = _drawn(panel), panel.x_label is not None
        for row in _legend_rows(drawn):
            top += LEGEND_ROW_PX
            parts += _legend(row, top - 5.0)
        axes = axes_of(figure, panel, top, top + PANEL_PX.get(len(figure.panels), MANY_PX))
        ticks = _places(figure.names, axes.x) if figure.names and not own else _ticks(axes.x, axes.x_scale, 9)
        parts += _panel(panel, drawn, axes, ticks, trace_points)
        top = axes.bottom_px + GAP_PX
        if own or i == last_sharing:
            parts += _x_axis(axes, figure.x_label if panel.x_label is None else panel.x_label, ticks, axes.x_scale)
            top += AXIS_PX
    size = f'width="{WIDTH_PX}" height="{number(top)}"'
    view = f'viewBox="0 0 {WIDTH_PX} {number(top)}" {size} font-family="{FONTS}" fill="{INK}"'
    head = [
        f'{HEAD}{clean(figure.key)}" {view}>',
        f"<title>{clean(figure.title)}</title>",
        f"<desc>{clean(figure.caption)}</desc>",
        f'<rect {size} fill="#ffffff"/>',
    ]
    return "\n".join([*head, *parts, "</svg>\n"])


@dataclass(frozen=True)
class _Drawn:
    """A trace that is drawn, with the look that it has beside those that are not."""

    trace: Trace
    hue: str
    dash: str


def _drawn(panel: Panel) -> list[_Drawn]:
    used: Counter[str] = Counter()
    found = []
    for trace in panel.traces:
        earlier = used[trace.kind]
        used[trace.kind] += trace.hue is None
        if trace.visible:
            found.append(_Drawn(trace, hue_of(trace, earlier), dash_of(trace, earlier)))
    return found


def _legend_rows(drawn: Sequence[_Drawn]) -> list[list[tuple[float, str, _Drawn]]]:
    """Put the names of traces and groups into rows, with the place of each."""
    named: dict[tuple[str, str], _Drawn] = {}
    for one in drawn:
        named.setdefault((one.trace.group, "" if one.trace.group else one.trace.name), one)
    rows: list[list[tuple[float, str, _Drawn]]] = []
    x = RIGHT_PX
    for (group, name), one in named.items():
        text = fitted(group or name, TEXT_PX, RIGHT_PX - LEFT_PX - SWATCH_PX - 5.0)
        width = SWATCH_PX + 5.0 + text_width(text, TEXT_PX)
        if x + width > RIGHT_PX:
            rows.append([])
            x = LEFT_PX
        rows[-1].append((x, text, one))
        x += width + 12.0
    return rows


def _legend(row: Sequence[tuple[float, str, _Drawn]], base_px: float) -> list[str]:
    parts = []
    for x, text, one in row:
        kind, y = one.trace.kind, base_px - 3.5
        place = f'cx="{number(x + SWATCH_PX / 2)}" cy="{number(y)}"'
        if kind in ("band", "bars"):
            fill = f'fill="rgb({one.hue})" fill-opacity="{0.22 if kind == "band" else 0.55}"'
            parts.append(_rectangle(x, y - 4.5, x + SWATCH_PX, y + 4.5, fill))
        if kind == "marks":
            parts.append(f'<circle {place} r="4" fill="none" stroke="{FIRED_COLOUR}" stroke-width="1.5"/>')
        elif kind in DOTTED:
            parts.append(f'<circle {place} r="2.2" fill="rgb({one.hue})"/>')
        if kind not in ("bars", "marks", "points", "whiskers"):
            line = f"M{number(x)} {number(y)}H{number(x + SWATCH_PX)}"
            parts.append(f'<path d="{line}" {pen(one.trace, one.hue, one.dash)}/>')
        parts.append(label(text, x + SWATCH_PX + 5.0, base_px, size_px=TEXT_PX))
    return parts


def _panel(panel: Panel, drawn: Sequence[_Drawn], axes: Axes, x: Ticks, trace_points: int) -> list[str]:
    spans = [(span, *_reach(span, axes)) for span in panel.spans]
    spans = [one for one in spans if one[1] <= one[2]]
    parts = [_rectangle(x0, axes.top_px, x1, axes.bottom_px, f'fill="{SPAN}"') for _, x0, x1 in spans if x1 > x0]
    parts += [part for line in panel.lines for part in _level_band(line, axes)]
    y = _ticks(axes.y, axes.y_scale, round((axes.bottom_px - axes.top_px) / 26.0))
    rules = [f"M{number(v)} {number(axes.top_px)}V{number(axes.bottom_px)}" for v in axes.across(_named(x)).tolist()]
    rules += [f"M{LEFT_PX:g} {number(v)}H{RIGHT_PX:g}" for v in axes.up(_named(y)).tolist()]
    parts.append(f'<path d="{"".join(rules)}" fill="none" stroke="{GRID}" stroke-width="0.7"/>')
    points = sum(min(np.size(one.trace.x), trace_points) for one in drawn)
    buckets = max(round(trace_points / 2 * min(1.0, PANEL_POINTS / max(points, 1))), 50)
    for one in drawn:
        parts += trace_parts(one.trace, one.hue, one.dash, axes, buckets)
    for line in panel.lines:
        parts += _level(line, axes)
    edge = f'fill="none" stroke="{EDGE}" stroke-width="0.8"'
    parts.append(_rectangle(LEFT_PX, axes.top_px, RIGHT_PX, axes.bottom_px, edge))
    return [*parts, *_span_marks(spans, axes), *_y_axis(axes, panel.y_label, y)]


def _rectangle(x0: float, y0: float, x1: float, y1: float, look: str) -> str:
    size = f'width="{number(x1 - x0)}" height="{number(y1 - y0)}"'
    return f'<rect x="{number(x0)}" y="{number(y0)}" {size} {look}/>'


def _ticks(shown: Range, scale: Scale, most: int) -> Ticks:
    return log_ticks(*shown, most) if scale == "log" else linear_ticks(*shown, most)


def _named(ticks: Ticks) -> FloatArray:
    """Return the places that have a label."""
    return np.array([value for value, text in zip(ticks.values, ticks.labels, strict=True) if text], dtype=np.float64)


def _reach(span: Span, axes: Axes) -> Range:
    """Return from where to where a span is seen; the wrong way round if it is not."""
    x0, x1 = axes.across(np.array([span.x0, span.x1])).tolist()
    return (max(x0, LEFT_PX), min(x1, RIGHT_PX)) if math.isfinite(x0 + x1) else (1.0, 0.0)


def _span_marks(spans: Sequence[tuple[Span, float, float]], axes: Axes) -> list[str]:
    """Write the names of stretches at the top, and of instants, which have a line, at the foot."""
    parts: list[str] = []
    for instants in (False, True):
        ends: list[float] = []  # of what stands in each row
        for span, x0, x1 in spans:
            if (x0 == x1) != instants:
                continue
            if instants:
                line = f"M{number(x0)} {number(axes.top_px)}V{number(axes.bottom_px)}"
                parts.append(
                    f'<path d="{line}" fill="none" stroke="{SOFT}" stroke-width="0.9" stroke-dasharray="4 3"/>'
                )
            text = fitted(span.label, SMALL_PX, RIGHT_PX - LEFT_PX - 10.0)
            left = min(x0 + 4.0, RIGHT_PX - 4.0 - text_width(text, SMALL_PX))
            row = next((k for k, end in enumerate(ends) if end < left), len(ends))
            ends[row : row + 1] = [left + text_width(text, SMALL_PX)]
            base = axes.bottom_px - 5.0 - 11.0 * row if instants else axes.top_px + 11.0 + 11.0 * row
            if axes.top_px < base - SMALL_PX and base < axes.bottom_px:
                parts.append(label(text, left, base, size_px=SMALL_PX, colour=SOFT, halo=True))
    return parts


def _level_band(line: HorizontalLine, axes: Axes) -> list[str]:
    if line.y_low is None or line.y_high is None:
        return []
    low, high = np.clip(axes.up(np.array([line.y_low, line.y_high])), axes.top_px, axes.bottom_px).tolist()
    if not low > high:
        return []
    return [_rectangle(LEFT_PX, high, RIGHT_PX, low, f'fill="{LINE_COLOUR[line.kind]}" fill-opacity="0.10"')]


def _level(line: HorizontalLine, axes: Axes) -> list[str]:
    y = float(axes.up(np.array([line.y]))[0])
    if not axes.top_px <= y <= axes.bottom_px:
        return []
    colour, dash = LINE_COLOUR[line.kind], LEVEL_DASH[line.kind]
    rule = f'fill="none" stroke="{colour}" stroke-width="1"{dash}'
    parts = [f'<path d="M{LEFT_PX:g} {number(y)}H{RIGHT_PX:g}" {rule}/>']
    if line.label:
        text = fitted(line.label, SMALL_PX, RIGHT_PX - LEFT_PX - 10.0)
        base = y - 3.0 if y - axes.top_px > SMALL_PX + 4.0 else y + SMALL_PX + 1.0
        parts.append(label(text, RIGHT_PX - 4.0, base, size_px=SMALL_PX, anchor="end", colour=colour, halo=True))
    return parts


def _y_axis(axes: Axes, title: str, ticks: Ticks) -> list[str]:
    marks, parts = [], []
    for y, text in zip(axes.up(np.array(ticks.values)).tolist(), ticks.labels, strict=True):
        marks.append(f"M{LEFT_PX:g} {number(y)}h{-4 if text else -2}")
        if text:
            parts.append(_tick_label(text, LEFT_PX - 6.0, y + 3.7, axes.y_scale, "end"))
    room, middle = axes.bottom_px - axes.top_px + 14.0, (axes.top_px + axes.bottom_px) / 2
    lines = _broken(_times(title, ticks), room)
    for line, x in zip(lines, (13.0,) if len(lines) == 1 else (9.0, 20.0), strict=True):
        parts.append(label(line, x, middle, size_px=TEXT_PX, anchor="middle", colour=SOFT, turned=True))
    return [_marks(marks), *parts]


def _x_axis(axes: Axes, title: str, ticks: Ticks, scale: Scale) -> list[str]:
    marks, parts = [], []
    for x, text in zip(axes.across(np.array(ticks.values)).tolist(), ticks.labels, strict=True):
        marks.append(f"M{number(x)} {number(axes.bottom_px)}v{4 if text else 2}")
        if text:
            parts.append(_tick_label(text, x, axes.bottom_px + 15.0, scale, "middle"))
    title, middle = fitted(_times(title, ticks), TEXT_PX, RIGHT_PX - LEFT_PX), (LEFT_PX + RIGHT_PX) / 2
    parts.append(label(title, middle, axes.bottom_px + 30.0, size_px=TEXT_PX, anchor="middle", colour=SOFT))
    return [_marks(marks), *parts]


def _times(title: str, ticks: Ticks) -> str:
    return f"{title}, times 10{str(ticks.exponent).translate(RAISED)}" if ticks.exponent else title


def _broken(title: str, room_px: float) -> list[str]:
    """Put a title into one line, or into two where it is wider than its axis is high."""
    if text_width(title, TEXT_PX) <= room_px:
        return [title]
    ends = [k for k, character in enumerate(title) if character == " " and text_width(title[:k], TEXT_PX) <= room_px]
    parts = (title[: ends[-1]], title[ends[-1] + 1 :]) if ends else (title,)
    return [fitted(part, TEXT_PX, room_px) for part in parts]


def _marks(marks: Sequence[str]) -> str:
    return f'<path d="{"".join(marks)}" fill="none" stroke="{EDGE}" stroke-width="0.8"/>'


def _tick_label(text: str, x: float, y: float, scale: Scale, anchor: str) -> str:
    """Write what stands beside a tick; only a power of ten of a logarithmic axis has something to raise."""
    written, _, power = text.partition("^") if scale == "log" else (text, "", "")
    return label(written + power.translate(RAISED), x, y, size_px=TEXT_PX, anchor=anchor)


def _places(names: Sequence[str], shown: Range) -> Ticks:
    """Label as many of the places that are shown as there is room for."""
    widest = max(min(text_width(name, TEXT_PX), WIDEST_NAME_PX) for name in names) + 8.0
    room = max(min(int((RIGHT_PX - LEFT_PX) / widest), MOST_NAMES), 1)
    places = [place for place in range(0, len(names), -(-len(names) // room)) if shown[0] <= place <= shown[1]]
    labels = tuple(fitted(names[place], TEXT_PX, WIDEST_NAME_PX) or " " for place in places)
    return Ticks(tuple(float(place) for place in places), labels)
