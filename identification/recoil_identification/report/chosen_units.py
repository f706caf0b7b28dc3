"""Units by choice: figures and numbers of a page in the units that its reader knows.

Everything is reckoned in SI, and stands in SI in documents and tables for machines. What a rig's ``[report]`` or a
header file chooses is applied here, at the edge, to figures that are composed and to numbers that are written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from recoil_acquisition.quantity import Unit, find_unit
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Trace


@dataclass(frozen=True)
class ChosenUnits:
    """Units that were chosen.

    Attributes
    ----------
    by_quantity
        Quantity -> spelling of its unit; SI of those that are not there.
    """

    by_quantity: Mapping[str, str]

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> ChosenUnits:
        """Return those of a document, which states what it was issued with."""
        names = [str(name) for name in (document.get("issued") or {}).get("units") or ()]
        units = [(name, find_unit(name)) for name in names]
        return cls({quantity: name for name, unit in units if unit is not None for quantity in unit.quantities})

    def factor(self, unit: str) -> tuple[float, str]:
        """Return the factor from a unit to the one chosen, and that one's name; 1 and its own where none is."""
        written = find_unit(unit)
        if written is None or not written.factor or written.offset:
            return 1.0, unit
        name = next((self.by_quantity[one] for one in written.quantities if one in self.by_quantity), None)
        chosen = None if name is None else find_unit(name)
        return (1.0, unit) if chosen is None or name is None else (_ratio(written, chosen), name)

    def figures(self, figures: Sequence[Figure]) -> list[Figure]:
        """Return figures with their panels in these units; a panel whose traces have several keeps them."""
        if not self.by_quantity:
            return list(figures)
        return [replace(one, panels=tuple(self._panel(panel) for panel in one.panels)) for one in figures]

    def _panel(self, panel: Panel) -> Panel:
        units = {trace.unit for trace in panel.traces}
        unit = units.pop() if len(units) == 1 else ""
        factor, name = self.factor(unit) if unit else (1.0, unit)
        if name == unit or not panel.y_label.endswith(unit):
            return panel
        return replace(
            panel,
            y_label=panel.y_label.removesuffix(unit) + name,
            traces=tuple(_trace(one, factor, name) for one in panel.traces),
            lines=tuple(_line(one, factor) for one in panel.lines),
            y_shown=None if panel.y_shown is None else (factor * panel.y_shown[0], factor * panel.y_shown[1]),
        )


def _ratio(written: Unit, chosen: Unit) -> float:
    return written.factor / chosen.factor


def _trace(trace: Trace, factor: float, unit: str) -> Trace:
    def scaled(values: npt.ArrayLike | None) -> npt.ArrayLike | None:
        return None if values is None else factor * np.asarray(values, dtype=np.float64)

    y = factor * np.asarray(trace.y, dtype=np.float64)
    return replace(trace, y=y, unit=unit, y_low=scaled(trace.y_low), y_high=scaled(trace.y_high))


def _line(line: HorizontalLine, factor: float) -> HorizontalLine:
    low, high = (None if limit is None else factor * limit for limit in (line.y_low, line.y_high))
    return replace(line, y=factor * line.y, y_low=low, y_high=high)
