"""Units by choice: figures and numbers of a page in the units that its reader knows.

Everything is reckoned in SI, and stands in SI in documents and tables for machines. What a rig's ``[report]`` or a
header file chooses is applied here, at the edge, to figures that are composed and to numbers that are written, those
within a sentence among them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from recoil_acquisition.quantity import Unit, find_unit
from recoil_identification.estimate.rounding import MINUS, significant
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Trace

_SPELLED = ("GPa", "MPa", "kPa", "Pa", "MN", "kN", "N", "m/s²", "m/s^2", "m/s2", "mm/s", "m/s", "rad/s", "mm", "m")
"""Units of what a reader may choose, as sentences and headings of documents spell them."""
_NUMBER = r"[+\-\u2212]?\d+(?:\.\d+)?(?:e[+\-\u2212]?\d+)?"
_MEASURED = re.compile(
    rf"(?<![\w.,/\-\u2212])({_NUMBER})((?:(?: to | and | … | ± |, ){_NUMBER})*) ({'|'.join(map(re.escape, _SPELLED))})"
    rf"(?![\w/²^]| (?:s|m|mm|m/s)\b)( \(u {_NUMBER}\))?"
)
"""A number, or several of one unit, with it behind them, and their uncertainty; products of units are others."""
_ONE_NUMBER = re.compile(_NUMBER)


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

    def text(self, text: str) -> str:
        """Return a text with its numbers in these units, each with as many digits as it has there."""
        return _MEASURED.sub(self._again, text) if self.by_quantity else text

    def _again(self, found: re.Match[str]) -> str:
        factor, name = self.factor(found[3])
        if name == found[3]:
            return found[0]
        one, others, u = (_ONE_NUMBER.sub(lambda number: scaled_text(number[0], factor), part or "")
                          for part in (found[1], found[2], found[4]))  # fmt: skip
        return f"{one}{others} {name}{u}"

    def figures(self, figures: Sequence[Figure]) -> list[Figure]:
        """Return figures with their panels in these units; a panel whose traces have several keeps them."""
        if not self.by_quantity:
            return list(figures)
        return [
            replace(one, panels=tuple(self._panel(panel) for panel in one.panels), caption=self.text(one.caption))
            for one in figures
        ]

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


def scaled_text(text: str, factor: float) -> str:
    """Multiply a number that is written, and write it with as many significant digits; what is no number stays.

    >>> scaled_text("-128.40", 10.0)
    '-1284.0'
    """
    if _ONE_NUMBER.fullmatch(text) is None:
        return text
    minus = MINUS if MINUS in text else "-"
    digits = len(re.sub(r"e.*|\D", "", text).lstrip("0"))
    again = significant(factor * float(text.replace(MINUS, "-")), max(digits, 1)).replace(MINUS, minus)
    return f"+{again}" if text.startswith("+") else again


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
