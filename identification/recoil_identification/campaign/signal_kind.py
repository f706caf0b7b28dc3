"""Kinds of what the shots of a campaign show together."""

from __future__ import annotations

from enum import StrEnum


class SignalKind(StrEnum):
    """Kind of what shots show together."""

    STEP = "mass step"
    DRIFT = "sensor drift"
    OUTLIER = "outlier"
    ADDED = "added mass"
    """Mass that was declared as added is wrong."""
    OFF = "calibration"
    """A calibration is wrong in all shots."""
    CHART = "chart"
    """A rule of a control chart fired."""
