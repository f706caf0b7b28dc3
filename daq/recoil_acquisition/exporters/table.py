"""The table of exporters."""

from __future__ import annotations

from recoil_acquisition.exporters.csv_text import CsvExporter
from recoil_acquisition.exporters.dewesoft_text import DewesoftTextExporter
from recoil_acquisition.exporters.exporter import Exporter
from recoil_acquisition.exporters.mat_file import MatExporter
from recoil_acquisition.exporters.mdf4 import Mdf4Exporter
from recoil_acquisition.exporters.parquet_file import ParquetExporter
from recoil_acquisition.exporters.tdms_file import TdmsExporter
from recoil_acquisition.exporters.uff58 import Uff58Exporter
from recoil_acquisition.others import offered

GROUP = "recoil_daq.exporters"
"""Entry points by which other packages announce their exporters."""

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


def exporters() -> tuple[Exporter, ...]:
    """Return every exporter: those of the table, and those that other packages announce under `GROUP`."""
    parts = ("name", "suffix", "extra", "single_file", "carried", "write", "read_back")
    return (*EXPORTERS, *offered(GROUP, parts))


def exporter_of(name: str) -> Exporter:
    """Return the exporter of a format.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    for exporter in exporters():
        if exporter.name == name:
            return exporter
    raise ValueError(f"{name!r} is none of {', '.join(exporter.name for exporter in exporters())}")
