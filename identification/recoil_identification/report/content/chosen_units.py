"""Units by choice: figures and numbers of a page in the units that its reader knows.

Everything is reckoned in SI, and stands in SI in documents and tables for machines. What a rig's ``[report]`` or a
header file chooses is applied here, at the edge, to figures that are composed, to columns of one unit, and to those
figures of a text that it knows as values (`recoil_acquisition.measured`). No text is searched: what looks like a figure
in a name is none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from recoil_acquisition.measured import Worded, figures_of, with_figures
from recoil_acquisition.quantities.unit_choice import UnitChoice
from recoil_identification.estimate.rounding import MINUS, significant
from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Trace

_NUMBER = re.compile(r"[+\-\u2212]?\d+(?:\.\d+)?(?:e[+\-\u2212]?\d+)?")
TEXTS = (("findings", "text"), ("quality", "detail"), ("quantities", "basis"))
"""Lists of a document whose entries state figures, and the key of the text that these are of."""


@dataclass(frozen=True)
class ChosenUnits(UnitChoice):
    """Units that were chosen for a document.

    Attributes
    ----------
    stated
        Texts of the document -> the same with the figures that it states beside them.
    """

    stated: Mapping[str, Worded] = field(default_factory=dict)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> ChosenUnits:
        """Return those of a document, which states what it was issued with."""
        chosen = UnitChoice.named(str(name) for name in (document.get("issued") or {}).get("units") or ()).by_quantity
        beside = [(row, key) for rows, key in TEXTS for row in document.get(rows) or ()] + [(document, "summary")]
        said = [with_figures(str(row[key]), row) for row, key in beside if row.get("figures")] if chosen else []
        return cls(chosen, {str(one): one for one in said})

    def text(self, text: str) -> str:
        """Return a text with its figures in these units, each with as many digits as it has there.

        They are those that the text knows, or that the document states of it; all else stays as it is.
        """
        parts, at = list[str](), 0
        for one in figures_of(text) or figures_of(self.stated.get(text, "")):
            number, blank, _ = text[one.start : one.end].partition(" ")
            factor, name = self.factor(one.unit)
            if name != one.unit:
                parts += [text[at : one.start], _written_as(number, factor * one.value), blank, name if blank else ""]
                at = one.end
        return "".join([*parts, text[at:]])

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
    if _NUMBER.fullmatch(text) is None:
        return text
    return _written_as(text, factor * float(text.replace(MINUS, "-")))


def _written_as(number: str, value: float) -> str:
    """Write a value with as many significant digits as a number that is written, and with its signs."""
    digits = len(re.sub(r"e.*|\D", "", number).lstrip("0"))
    again = significant(value, max(digits, 1)).replace(MINUS, MINUS if MINUS in number else "-")
    return f"+{again}" if number.startswith("+") else again


def _trace(trace: Trace, factor: float, unit: str) -> Trace:
    def scaled(values: npt.ArrayLike | None) -> npt.ArrayLike | None:
        return None if values is None else factor * np.asarray(values, dtype=np.float64)

    y = factor * np.asarray(trace.y, dtype=np.float64)
    return replace(trace, y=y, unit=unit, y_low=scaled(trace.y_low), y_high=scaled(trace.y_high))


def _line(line: HorizontalLine, factor: float) -> HorizontalLine:
    low, high = (None if limit is None else factor * limit for limit in (line.y_low, line.y_high))
    return replace(line, y=factor * line.y, y_low=low, y_high=high)
