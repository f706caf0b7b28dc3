"""The table of exporters."""

from __future__ import annotations

from daq.exporters.csv_text import CsvExporter
from daq.exporters.exporter import Exporter

EXPORTERS: tuple[Exporter, ...] = (CsvExporter(),)
"""Every exporter, in the order in which they are listed to users."""


def exporter_of(name: str) -> Exporter:
    """Return the exporter of a format.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    for exporter in EXPORTERS:
        if exporter.name == name:
            return exporter
    raise ValueError(f"{name!r} is none of {', '.join(exporter.name for exporter in EXPORTERS)}")
