"""A result that shows itself as its command prints it: in a terminal, a script, a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any


class Printed(ABC):
    """A result: ``repr`` is one line, ``str`` what the command prints, and a notebook shows that in colour."""

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the document that the command prints with ``--json``."""

    @abstractmethod
    def show(self) -> None:
        """Print it on stdout as the command does."""

    def __str__(self) -> str:
        from recoil_daq.console import shown

        return shown(self.show).export_text().rstrip("\n")

    def _repr_html_(self) -> str:
        from recoil_daq.console import shown

        page = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'
        return shown(self.show).export_html(inline_styles=True, code_format=page)
