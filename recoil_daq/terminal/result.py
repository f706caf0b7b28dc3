"""A result that shows itself as its command prints it: in a terminal, a script, a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[str], None]
"""Function that is called with each step towards a result, in words."""


class Printed(ABC):
    """A result: ``repr`` is one line, ``str`` what the command prints, and a notebook shows that in colour."""

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the document that the command prints with ``--json``."""

    @abstractmethod
    def show(self) -> None:
        """Print it on stdout as the command does."""

    def __str__(self) -> str:
        from recoil_daq.terminal.console import shown

        return shown(self.show).export_text().rstrip("\n")

    def _repr_html_(self) -> str:
        from recoil_daq.terminal.console import shown

        page = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'
        return shown(self.show).export_html(inline_styles=True, code_format=page)


@dataclass(frozen=True, repr=False)
class PagedDocument(Printed):
    """Results in a row, and the page of them.

    Attributes
    ----------
    document
        Rows and what is said of them, in JSON types.
    page
        Page; what else was written stands beside it.
    """

    document: dict[str, Any]
    page: Path

    @property
    def folder(self) -> Path:
        """Folder that holds the page."""
        return self.page.parent

    def to_json(self) -> dict[str, Any]:
        """Return the document that the command prints with ``--json``."""
        return {**self.document, "page": str(self.page)}


@dataclass(frozen=True, repr=False)
class MassDocument(Printed):
    """A mass and all that is said of it.

    Attributes
    ----------
    document
        Contents of the JSON file, in JSON's own types. What is asked for most has a property with a type of its own. A
        class with all keys would state a second time what the modules of `recoil_identification.report` that fill them
        state, and what the file has of an older version it could not hold.
    """

    document: dict[str, Any]

    @property
    def mass_kg(self) -> float:
        """The recoiling mass."""
        return float(self.document["mass"]["value"])

    @property
    def u_kg(self) -> float:
        """Its standard uncertainty."""
        return float(self.document["mass"]["u"])

    @property
    def interval_kg(self) -> tuple[float, float]:
        """Its 95 % interval."""
        low, high = self.document["mass"]["U95"]
        return float(low), float(high)

    @property
    def valid(self) -> bool:
        """Whether the mass is to be trusted."""
        return bool(self.document["valid"])

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons why it is not."""
        return tuple(self.document["reasons"])

    @property
    def findings(self) -> tuple[dict[str, Any], ...]:
        """Reasons, warnings and notes, each with ``code``, ``about``, ``severity`` and ``text``.

        Those of severity ``fatal`` are the reasons, in the same order. None in what an earlier version wrote.
        """
        return tuple(self.document.get("findings", ()))

    @property
    def specification_kg(self) -> float | None:
        """The specification mass; None where there is none."""
        value = self.document["mass"].get("specification")
        return None if value is None else float(value)

    @property
    def E_n(self) -> float | None:
        """Distance from the specification over the expanded uncertainty of both, k = 2; None where there is none."""
        value = self.document.get("E_n", self.document["mass"].get("E_n"))
        return None if value is None else float(value)

    @property
    def conformity(self) -> dict[str, Any] | None:
        """Conformity with the tolerance of the mass; None where none is stated."""
        return self.document.get("conformity")

    def to_json(self) -> dict[str, Any]:
        """Return the contents of the JSON file."""
        return self.document


class OfShot(MassDocument):
    """The mass of one shot and all that is said of it."""

    @property
    def shot(self) -> str:
        """The shot's name."""
        return str(self.document["shot"])

    @property
    def rpe_percent(self) -> float | None:
        """Equation (37) of the paper; None where no sample of the trace was identified."""
        value = self.document["rpe_percent"]["value"]
        return None if value is None else float(value)

    @property
    def peaks(self) -> pd.DataFrame:
        """Peaks, time and impulse: ``quantity``, ``value``, ``u``, ``low`` and ``high`` of 95 %, ``ruled_by``, SI."""
        import pandas as pd

        known, u, intervals, ruled = (
            self.document.get(key) or {} for key in ("peaks", "peaks_u", "peaks_U95", "peaks_ruled_by")
        )
        rows = [
            (name, value, u.get(name), *(intervals.get(name) or (None, None)), ruled.get(name))
            for name, value in known.items()
        ]
        return pd.DataFrame(rows, columns=["quantity", "value", "u", "low", "high", "ruled_by"])


@dataclass(frozen=True, repr=False)
class MassResult(MassDocument):
    """A mass, and where what was written of it stands.

    Attributes
    ----------
    folder
        Folder that holds the document's file and all else that was written.
    """

    folder: Path
