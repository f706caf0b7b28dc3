"""Targets of `recoil-daq identify --target` beside the mass, by name; each room is entered when asked for.

Other packages announce theirs by entry points, under the name by which it is asked for; each leads to a function from a
`recoil_identification.targets.target.Case` to a `recoil_identification.targets.target_result.TargetResult` of that
name::

    [project.entry-points."recoil_daq.targets"]
    peak-pressure = "recoil_peaks:find"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from recoil_acquisition.packages.others import announced, at_work, named

if TYPE_CHECKING:
    from recoil_identification.targets.target import Case
    from recoil_identification.targets.target_result import TargetResult

GROUP = "recoil_daq.targets"
"""Entry points by which other packages announce their targets."""

TARGETS: Mapping[str, str] = MappingProxyType(
    {
        "parameters": "parameters.target:find",
        "stiffness": "stiffness.target:find",
        "breech-force": "forces.breech_force:find",
        "inertia-force": "forces.inertia_force:find",
        "resistance": "resistance.target:find",
        "arx": "arx.target:find",
    }
)
"""Name on the command line -> module, below this package, and function, in the order shown to users."""

_OF_FILES = re.compile(r"(?!(?:mass|report|curves|beside)$)[a-z0-9]+(?:-[a-z0-9]+)*")
"""Names after which a target's files can be called, beside those of the report."""


def target_names() -> tuple[str, ...]:
    """Return the names of all targets: those of the table, and those that other packages announce under `GROUP`."""
    others = dict.fromkeys(point.name for point in announced(GROUP) if _OF_FILES.fullmatch(point.name))
    return (*TARGETS, *(name for name in others if name not in TARGETS))


def target_function(name: str) -> Callable[[Case], TargetResult]:
    """Load the function of a target.

    Raises
    ------
    ValueError
        If there is none of that name.
    IdentificationError
        If it is of another package, which cannot be loaded.
    """
    if name in TARGETS:
        module, _, function = TARGETS[name].partition(":")
        home = import_module(f"recoil_identification.targets.{module}")
        found: Callable[[Case], TargetResult] = getattr(home, function)
        return found
    if name not in target_names():
        raise ValueError(f"target must be one of {', '.join(target_names())}, not {name!r}")
    others = named(GROUP, name)

    def find(case: Case) -> TargetResult:
        from recoil_identification.targets.target_result import TargetResult

        with at_work(f"the target {name!r} of another package"):
            result = others(case)
            if not isinstance(result, TargetResult) or result.target != name:
                raise TypeError(f"it returns no TargetResult of the target {name!r}")
        return result

    return find
