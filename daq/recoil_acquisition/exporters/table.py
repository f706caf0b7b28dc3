"""The table of exporters. Nothing of an exporter's module is imported before its format is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from recoil_acquisition.exporters.exporter import Exporter
from recoil_acquisition.packages.others import offered

GROUP = "recoil_daq.exporters"
"""Entry points by which other packages announce their exporters."""

EXPORTERS: Mapping[str, str] = {
    "mdf4": "mdf4:Mdf4Exporter",
    "mat": "mat_file:MatExporter",
    "uff58": "uff58:Uff58Exporter",
    "tdms": "tdms_file:TdmsExporter",
    "parquet": "parquet_file:ParquetExporter",
    "csv": "dewesoft_text:CsvExporter",
    "dewesoft-text": "dewesoft_text:DewesoftTextExporter",
}
"""Name of a format -> module, below `recoil_acquisition.exporters`, and class, in the order shown to users."""


def exporter_names() -> tuple[str, ...]:
    """Return the names of all formats: those of the table, and those that other packages announce under `GROUP`."""
    return (*EXPORTERS, *(exporter.name for exporter in _of_others()))


def exporter_of(name: str) -> Exporter:
    """Return the exporter of a format.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    if name in EXPORTERS:
        module, _, kind = EXPORTERS[name].partition(":")
        exporter: Exporter = getattr(import_module(f"recoil_acquisition.exporters.{module}"), kind)()
        return exporter
    for exporter in _of_others():
        if exporter.name == name:
            return exporter
    raise ValueError(f"{name!r} is none of {', '.join(exporter_names())}")


def _of_others() -> tuple[Exporter, ...]:
    return offered(GROUP, ("name", "suffix", "extra", "single_file", "carried", "write", "read_back"))
