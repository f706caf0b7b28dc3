"""A plot of one quantity against another on logarithmic axes, as SVG that loads nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

LEFT, TOP, WIDTH, HEIGHT = 70.0, 16.0, 380.0, 220.0
COLOURS, DASHES = ("#1f5fa8", "#b35900", "#2e7d32"), ("", "7 3", "2 3")


def decades(values: Sequence[float]) -> tuple[int, int]:
    """Return the powers of ten that enclose values."""
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return low, max(high, low + 1)


def log_log(curves: Mapping[str, Sequence[tuple[float, float]]], x_title: str, y_title: str) -> str:
    """Draw curves by name, each a sequence of points with positive coordinates."""
    points = [point for curve in curves.values() for point in curve]
    (x0, x1), (y0, y1) = decades([x for x, _ in points]), decades([y for _, y in points])

    def at(x: float, y: float) -> tuple[float, float]:
        return (
            LEFT + WIDTH * (math.log10(x) - x0) / (x1 - x0),
            TOP + HEIGHT * (y1 - math.log10(y)) / (y1 - y0),
        )

    parts = []
    for power in range(x0, x1 + 1):
        x, _ = at(10.0**power, 10.0**y0)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP} V{TOP + HEIGHT}"/>')
        parts.append(f'<text x="{x:.1f}" y="{TOP + HEIGHT + 18}" text-anchor="middle">{tick(power)}</text>')
    for power in range(y0, y1 + 1):
        _, y = at(10.0**x0, 10.0**power)
        parts.append(f'<path class="grid" d="M{LEFT} {y:.1f} H{LEFT + WIDTH}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{tick(power)}</text>')
    for i, (name, curve) in enumerate(curves.items()):
        places = [at(x, y) for x, y in curve]
        line = " L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        parts.append(
            f'<path d="M{line}" fill="none" stroke="{COLOURS[i]}" stroke-width="2" stroke-dasharray="{DASHES[i]}"/>'
        )
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{COLOURS[i]}"/>' for x, y in places]
        x, y = places[-1]
        parts.append(f'<text x="{x + 8:.1f}" y="{y + 4:.1f}" fill="{COLOURS[i]}">{escape(name)}</text>')
    parts.append(f'<text x="{LEFT + WIDTH / 2}" y="{TOP + HEIGHT + 38}" text-anchor="middle">{escape(x_title)}</text>')
    parts.append(
        f'<text transform="translate(18 {TOP + HEIGHT / 2}) rotate(-90)" text-anchor="middle">{escape(y_title)}</text>'
    )
    size = f"{LEFT + WIDTH + 90:.0f} {TOP + HEIGHT + 48:.0f}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" font-family="system-ui, sans-serif" '
        'font-size="13">\n'
        "<style>.grid { stroke: #d5dae0; fill: none } text { fill: #222 }</style>\n"
        f'<rect width="100%" height="100%" fill="#fff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def tick(power: int) -> str:
    """Write a power of ten."""
    return (
        f"{10**power:g}" if -3 <= power <= 3 else f'10<tspan dy="-5" font-size="10">{power}</tspan>'.replace("-", "−")
    )
