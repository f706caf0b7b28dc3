"""The table of exporters."""

from __future__ import annotations

from daq.exporters.csv_text import CsvExporter
from daq.exporters.dewesoft_text import DewesoftTextExporter
from daq.exporters.exporter import Exporter
from daq.exporters.mat_file import MatExporter
from daq.exporters.mdf4 import Mdf4Exporter
from daq.exporters.parquet_file import ParquetExporter
from daq.exporters.tdms_file import TdmsExporter
from daq.exporters.uff58 import Uff58Exporter

EXPORTERS: tuple[Exporter, ...] = (
    Mdf4Exporter(),
    MatExporter(),
    Uff58Exporter(),
    TdmsExporter(),
    ParquetExporter(),
    CsvExporter(),
    DewesoftTextExporter(),
)
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
