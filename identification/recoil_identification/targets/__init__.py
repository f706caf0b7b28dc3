"""Targets of `recoil-daq identify --target` beside the mass, by name; each room is entered when asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from recoil_identification.targets.finding import Finding
    from recoil_identification.targets.target import Case

TARGETS: Mapping[str, str] = MappingProxyType(
    {
        "parameters": "masses, first moments and inertias from all five equations of motion",
        "stiffness": "stiffness and damping of elevating gear and ground, over time",
        "breech-force": "the propellant's force from the motion, without the breech gauge",
        "inertia-force": "inertia forces of the recoiling part, and of the mechanism at the trunnion",
        "resistance": "law of the recoil resistance, packing friction, balance of energy and momentum",
        "arx": "transfer function from force to acceleration, with its order",
    }
)
"""Name on the command line -> what it identifies."""

_HOMES = {
    "parameters": "parameters.target",
    "stiffness": "stiffness.target",
    "breech-force": "forces.breech_force",
    "inertia-force": "forces.inertia_force",
    "resistance": "resistance.target",
    "arx": "arx.target",
}
"""Name on the command line -> module with its function ``find``."""


def target_function(name: str) -> Callable[[Case], Finding]:
    """Load the function of a target.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if name not in TARGETS:
        raise ValueError(f"target must be one of {', '.join(TARGETS)}, not {name!r}")
    module = import_module(f"recoil_identification.targets.{_HOMES[name]}")
    return cast("Callable[[Case], Finding]", module.find)
