"""A figure on paper: well formed, within its drawing, the same every time, and of what its traces hold."""

from __future__ import annotations

import math
import random
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Span, Trace
from recoil_identification.report.figure.svg import WIDTH_PX, figure_svg
from recoil_identification.report.figure.svg_text import fitted, text_width

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "</text><script>alert(1)</script>\x00\x1b[2J\ud800\ufffe\u202e\"'&amp;]]>"
NUMBERS = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf", re.IGNORECASE)


def parsed(figure: Figure) -> ET.Element:
    return ET.fromstring(figure_svg(figure))  # noqa: S314 - it is our own


def drawn(*traces: Trace, **panel) -> ET.Element:
    return parsed(Figure("k", "T", "C", "x, s", (Panel("y, m", traces, **panel),)))


def paths(root: ET.Element, **attributes: str) -> list[str]:
    return [
        one.get("d", "")
        for one in root.iter(f"{SVG}path")
        if all(one.get(name.replace("_", "-")) == value for name, value in attributes.items())
    ]


def curve(root: ET.Element) -> list[list[tuple[float, float]]]:
    """The pieces of the one curve that is drawn through."""
    (path,) = paths(root, stroke_width="1.3", stroke_linejoin="round")
    return [walked(piece) for piece in path.split("M")[1:]]


def walked(piece: str) -> list[tuple[float, float]]:
    """The points of one line: where it begins, and the steps that it takes."""
    begin, _, steps = piece.partition("l")
    places = np.array([float(v) for v in NUMBERS.findall(begin + " " + steps)]).reshape(-1, 2)
    return [(float(x), float(y)) for x, y in np.cumsum(places, axis=0)]


def points_of(root: ET.Element) -> list[tuple[float, float]]:
    """Every point that an element names, with relative steps taken."""
    found = []
    for one in root.iter():
        get = lambda name, at=one: float(at.get(name, "0"))  # noqa: E731
        if one.tag == f"{SVG}path":
            x = y = 0.0
            for command, rest in re.findall(r"([MlHVhvZ])([^MlHVhvZ]*)", one.get("d", "")):
                values = [float(v) for v in NUMBERS.findall(rest)]
                assert command == "l" or len(values) == {"M": 2, "Z": 0}.get(command, 1), (command, rest)
                if command == "M":
                    x, y = values
                elif command == "l":
                    assert values
                    steps = np.cumsum(np.array([x, y, *values]).reshape(-1, 2), axis=0)
                    found += [(float(a), float(b)) for a, b in steps[:-1]]
                    x, y = steps[-1].tolist()
                elif command in "Hh":
                    x = values[0] + (x if command == "h" else 0.0)
                elif command in "Vv":
                    y = values[0] + (y if command == "v" else 0.0)
                found.append((x, y))
        elif one.tag == f"{SVG}rect":
            assert get("width") >= 0.0
            assert get("height") >= 0.0
            found += [(get("x"), get("y")), (get("x") + get("width"), get("y") + get("height"))]
        elif one.tag == f"{SVG}circle":
            found.append((get("cx"), get("cy")))
        elif one.tag == f"{SVG}text":
            found.append((get("x"), get("y")))
    return found


SPECIAL = (0.0, 1.0, -1.0, 5e-324, 1e-300, 1e308, -1e308)
NAMES = ("", "a, m", "identification interval", "射撃", "m" * 300, HOSTILE)
KINDS = ("measured", "filtered", "model", "reference", "band", "points", "bars", "series", "whiskers", "marks")


def any_figure(seed: int) -> Figure:
    """A figure of whatever its parts allow; small ones are as likely as any."""
    chance = random.Random(seed)  # noqa: S311 - no secret

    def values(size: int, *more: float) -> list[float]:
        spread = 10.0 ** chance.uniform(-12, 12)
        usual = [chance.choice((0.0, 1e6)) + spread * chance.gauss(0, 1) for _ in range(size)]
        return [chance.choice((*SPECIAL, *more)) if chance.random() < 0.15 else value for value in usual]

    def anything(size: int) -> list[float]:
        return values(size, math.nan, math.inf, -math.inf)

    def extent() -> tuple[float, float] | None:
        low, high = sorted(values(2))
        return (low, high) if low < high and chance.random() < 0.4 else None

    def trace() -> Trace:
        kind, size, log = chance.choice(KINDS), chance.choice((0, 1, 2, 30)), chance.random() < 0.3
        x = [abs(value) for value in values(size)] if log else values(size)
        limits = (anything(size), anything(size)) if kind in ("band", "whiskers") else (None, None)
        ordered, group = sorted(x) if chance.random() < 0.7 else x, chance.choice(("", "g"))
        return Trace(
            chance.choice(NAMES),
            ordered,
            anything(size),
            kind,
            "m",
            *limits,
            visible=chance.random() < 0.8,
            group=group,
        )

    def panel() -> Panel:
        kinds, scales = ("specification", "limit", "mean"), ("linear", "log")
        lines = [
            HorizontalLine(chance.choice(NAMES), *anything(1), chance.choice(kinds), *chance.choice(((), anything(2))))
            for _ in range(chance.randrange(3))
        ]
        spans = [Span(chance.choice(NAMES), *anything(2)) for _ in range(chance.randrange(3))]
        own = {"x_label": chance.choice(NAMES)}
        return Panel(
            chance.choice(NAMES), tuple(trace() for _ in range(chance.randrange(4))), tuple(lines), tuple(spans),
            chance.choice(scales), extent(), **(own if chance.random() < 0.3 else {}),
        )  # fmt: skip

    names = chance.choice(((), (), ("1", HOSTILE), tuple(f"{k:04d}" for k in range(200))))
    said = [chance.choice(NAMES) for _ in range(3)]
    panels = tuple(panel() for _ in range(chance.randint(1, 3)))
    return Figure("key", *said, panels, extent(), chance.choice(("linear", "log")), names)


@pytest.mark.whole_way
@given(st.integers(0, 2**32))
@settings(max_examples=50)
def test_any_figure_is_well_formed_and_within_its_drawing(seed):
    figure = any_figure(seed)
    text = figure_svg(figure)
    root = parsed(figure)
    assert figure_svg(figure) == text
    left, top, width, height = map(float, root.get("viewBox", "").split())
    assert (left, top, width) == (0.0, 0.0, WIDTH_PX)
    for x, y in points_of(root):
        assert -0.1 <= x <= width + 0.1
        assert -0.1 <= y <= height + 0.1
    assert {one.tag.removeprefix(SVG) for one in root.iter()} <= {
        "svg", "title", "desc", "rect", "path", "circle", "text"
    }  # fmt: skip


def test_a_short_peak_of_a_long_trace_is_drawn():
    y = np.zeros(1_000_000)
    y[456_789] = 1.0
    (piece,) = curve(drawn(Trace("a", np.linspace(0.0, 1.0, y.size), y, "filtered")))
    assert len(piece) < 5000
    tops = [p for p in piece if p[1] == min(p[1] for p in piece)]
    assert len(tops) == 1
    assert min(p[1] for p in piece) < min(p[1] for p in piece if p[0] < 300.0) - 80
    assert tops[0][0] == pytest.approx(62 + 644 * 0.456789, abs=0.1)


def test_a_line_that_leaves_the_panel_is_cut_at_its_edge_and_keeps_its_slope():
    trace = Trace("a", [0.0, 1.0, 2.0], [0.0, 10.0, 0.0], "filtered")
    up, down = curve(drawn(trace, y_shown=(0.0, 5.0)))
    (x0, y0), (x1, y1) = up
    assert (x0, x1) == (62.0, pytest.approx(62 + 644 / 4, abs=0.1))
    assert y0 - y1 == pytest.approx(180.0, abs=0.1)
    assert [p[0] for p in down] == pytest.approx([62 + 644 * 3 / 4, 706.0], abs=0.1)


def test_a_line_runs_to_the_ends_of_what_is_shown_of_it():
    trace = Trace("a", [0.0, 1.0], [0.0, 8.0], "filtered")
    panel = Panel("y, m", (trace,), y_shown=(0.0, 8.0))
    (piece,) = curve(parsed(Figure("k", "T", "C", "x, s", (panel,), shown=(0.25, 0.75))))
    (x0, y0), (x1, y1) = piece
    assert (x0, x1) == (62.0, 706.0)
    assert y0 - y1 == pytest.approx(90.0, abs=0.1)


def test_a_gap_parts_a_line_and_a_lonely_sample_is_a_dot():
    y = [1.0, 2.0, math.nan, 3.0, math.nan, 4.0, 5.0]
    (path,) = paths(drawn(Trace("a", range(7), y, "filtered")), stroke_width="1.3", stroke_linejoin="round")
    assert path.count("M") == 3
    assert path.count("h.1") == 1


def test_what_is_switched_off_is_not_drawn_and_leaves_the_others_their_colours():
    on = Trace("shown", [0.0, 1.0], [0.0, 1.0], "filtered")
    off = Trace("hidden", [0.0, 1.0], [5.0, 6.0], "filtered", visible=False)
    root = drawn(off, on)
    texts = [one.text for one in root.iter(f"{SVG}text")]
    assert "shown" in texts
    assert "hidden" not in texts
    colour = {one.get("stroke") for one in drawn(on).iter(f"{SVG}path")}
    assert not {one.get("stroke") for one in root.iter(f"{SVG}path")} <= colour


def test_a_group_stands_once_in_the_legend():
    traces = [Trace(f"shot {k}", [0.0, 1.0], [k, k + 1.0], "filtered", hue=0, group="as built") for k in range(5)]
    texts = [one.text for one in drawn(*traces).iter(f"{SVG}text")]
    assert texts.count("as built") == 1
    assert not any(text.startswith("shot") for text in texts)


def test_lines_of_a_panel_differ_without_their_colours():
    traces = [Trace(str(k), [0.0, 1.0], [k, k + 1.0], "filtered") for k in range(3)]
    dashes = [one.get("stroke-dasharray") for one in drawn(*traces).iter(f"{SVG}path") if one.get("stroke-linejoin")]
    assert len(set(dashes)) == 3


def test_levels_stretches_and_instants_are_named():
    root = drawn(
        Trace("a", [0.0, 1.0], [0.0, 1.0], "filtered"),
        lines=(HorizontalLine("specification 782 kg", 0.5),),
        spans=(Span("interval", 0.2, 0.8), Span("cut-off", 0.5, 0.5), Span("elsewhere", 5.0, 6.0)),
    )
    texts = {one.text: one for one in root.iter(f"{SVG}text")}
    assert {"specification 782 kg", "interval", "cut-off"} <= set(texts)
    assert "elsewhere" not in texts
    assert paths(root, stroke_dasharray="4 3")


def test_names_from_files_stay_text_and_titles_that_are_too_long_are_cut_or_broken():
    long = "pressure of the recuperator at the gauge near the bottom, MPa"
    figure = Figure("k", HOSTILE, HOSTILE, HOSTILE, (Panel(long, (Trace(HOSTILE, [0.0, 1.0], [0, 1], "filtered"),)),))
    root = parsed(figure)
    texts = [one.text for one in root.iter(f"{SVG}text")]
    assert any(text.startswith("</text><script>") for text in texts)
    assert " ".join(text for text in texts if text in long).startswith("pressure of the recuperator")


def test_a_cut_text_is_as_wide_as_there_is_room_for():
    assert fitted("short", 11, 100) == "short"
    cut = fitted("m" * 100_000, 11, 100)
    assert cut.endswith("…")
    assert text_width(cut, 11) <= 100 < text_width(cut, 11) + 11
