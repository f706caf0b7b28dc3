"""The span in which a sensor may read at rest: its declared range, and the noise about an end at zero."""

from __future__ import annotations

AT_ZERO = 1e-3
"""Share of a range within which an end counts as zero: there a one-sided gauge rests."""
NOISE_ABOUT_ZERO = 0.01
"""Share of a range by which a sensor may read beyond an end at zero: its noise, and a zero that is a little off."""


def allowed(declared: tuple[float, float]) -> tuple[float, float]:
    """Return the declared range, widened where it ends at zero."""
    low, high = declared
    span = high - low
    return (
        low - NOISE_ABOUT_ZERO * span if abs(low) <= AT_ZERO * span else low,
        high + NOISE_ABOUT_ZERO * span if abs(high) <= AT_ZERO * span else high,
    )
