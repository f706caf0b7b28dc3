"""Bounds of a mechanism's values and of what its sensors read: a value in another unit shows by its size."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Bounds:
    """Bounds of a value.

    Attributes
    ----------
    possible
        Least and largest value that any such mechanism has; one beyond is a fault.
    usual
        Bounds beyond which a value is worth a second look.
    unit
        Unit of `possible` and `usual`.
    """

    possible: tuple[float, float]
    usual: tuple[float, float]
    unit: str

    def fault(self, value: float) -> str:
        """Say what is wrong with an impossible value; empty if it is possible."""
        least, largest = self.possible
        if least <= value <= largest:
            return ""
        return f"must lie between {least:.3g} and {largest:.3g} {self.unit}".rstrip() + f", found {value:g}"

    def warning(self, value: float) -> str:
        """Say what is unusual of a possible value; empty if nothing is."""
        least, largest = self.usual
        if self.fault(value) or least <= value <= largest:
            return ""
        return f"{value:g} {self.unit}".rstrip() + f" is unusual; most lie between {least:g} and {largest:g}"


MASS = Bounds((1e-2, 1e6), (1.0, 1e5), "kg")
INERTIA = Bounds((1e-6, 1e9), (1e-3, 1e7), "kg m2")
LENGTH = Bounds((-50.0, 50.0), (-20.0, 20.0), "m")
OFFSET = Bounds((-5.0, 5.0), (-1.0, 1.0), "m")
AREA = Bounds((1e-6, 1.0), (1e-5, 0.3), "m2")
QUARTER = math.pi / 2
UPRIGHT = QUARTER + 1e-3
"""Largest inclination, rad: a quarter as somebody rounds it."""

OF_SYMBOL: Mapping[str, Bounds] = MappingProxyType(
    {
        **dict.fromkeys(("m1", "m2", "m3"), MASS),
        **dict.fromkeys(("J1", "J2", "J3c"), INERTIA),
        **dict.fromkeys(("X1", "Y1", "XA", "YA", "s2", "b", "L"), LENGTH),
        **dict.fromkeys(("d2", "d", "e"), OFFSET),
        **dict.fromkeys(("bore_area", "brake_area", "recuperator_area"), AREA),
        # a carriage stands about level, a bore may point anywhere above it
        "phi10": Bounds((-QUARTER / 2, QUARTER / 2), (-0.3, 0.3), "rad"),
        "phi20": Bounds((-UPRIGHT, UPRIGHT), (-0.35, 1.4), "rad"),
        "f": Bounds((0.0, 10.0), (0.0, 2.0), ""),
        "g": Bounds((9.0, 10.5), (9.76, 9.84), "m/s2"),
        "friction": Bounds((0.0, 1e7), (0.0, 1e5), "N"),
        "bore_friction": Bounds((0.0, 0.5), (0.0, 0.05), "of the breech force (1 % is 0.01)"),
        "muzzle_brake": Bounds((0.0, 0.9), (0.0, 0.7), "of the breech force behind the exit (10 % is 0.1)"),
        "projectile_mass": Bounds((0.0, 1e4), (0.0, 200.0), "kg"),
        "bore_length": Bounds((0.0, 50.0), (0.0, 20.0), "m"),
        "tube_axial_hz": Bounds((0.0, 1e5), (0.0, 5000.0), "Hz"),
        "unread_share": Bounds((-0.5, 0.5), (-0.05, 0.05), "of the resistance that is read (1 % is 0.01)"),
        "unread_force": Bounds((0.0, 0.5), (0.0, 0.05), "of the peak resistance (1 % is 0.01)"),
        "slide_friction": Bounds((0.0, 1e6), (0.0, 1e3), "N s/m"),
        "carried_mass": Bounds((0.0, 1e5), (0.0, 100.0), "kg"),
    }
)
"""Symbol of the mechanism -> its bounds."""
_PRESSURE = Bounds((0.0, math.inf), (1e5, 2e9), "Pa")
OF_ROLE: Mapping[str, Bounds] = MappingProxyType(
    {
        **dict.fromkeys(("breech_pressure", "brake_pressure", "recuperator_pressure"), _PRESSURE),
        "recoil_acceleration": Bounds((0.0, math.inf), (10.0, 1e6), "m/s2"),
        "recoil_displacement": Bounds((0.0, math.inf), (1e-3, 10.0), "m"),
    }
)
"""Role -> how far its sensors reach, and its peak in a shot, SI."""
