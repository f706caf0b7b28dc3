"""Parquet: one file per time base, every number exact.

The first column is the time, named ``time_s`` (with underscores behind it where a channel bears that name), then one
column per channel, float64 or float32 as in the shot; a lost sample is NaN, not null. The schema's key-value metadata
holds under ``recoil-daq`` the same JSON as the comment lines of our CSV, and each field its unit and quantity.
One file per time base, because rows of several clocks side by side would say that they belong together.

Format: Apache Parquet, https://parquet.apache.org/docs/file-format/. Neither dictionaries nor compression: samples of
noise do not repeat, and the size of the file then bounds what a reader must allocate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table, free_name
from recoil_acquisition.readers.exported.recoil_parquet import KEY, RecoilParquetReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.store.table import json_text


class ParquetExporter:
    """Exporter of Parquet."""

    name = "parquet"
    suffix = ".parquet"
    extra = "parquet"
    single_file = False

    def carried(self, content: Content) -> Representation:
        """Return everything."""
        return Representation(tuple(exact_table(group) for group in content.groups))

    def write(self, content: Content, path: Path) -> None:
        """Write the file of the one group."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        (group,) = content.groups
        names = [c.name for c in group.channels]
        said = [{"unit": c.unit, "quantity": c.quantity, "role": c.role} for c in group.channels]
        fields = [pa.field(free_name("time_s", names), pa.float64(), nullable=False, metadata={"unit": "s"})]
        fields += [
            pa.field(c.name, pa.from_numpy_dtype(c.samples.dtype), nullable=False, metadata=m)
            for c, m in zip(group.channels, said, strict=True)
        ]
        schema = pa.schema(fields, metadata={KEY: json_text(content.group_document(group)).encode()})
        columns = [group.time_base.times_s, *(c.samples for c in group.channels)]
        arrays = [pa.array(np.ascontiguousarray(column), from_pandas=False) for column in columns]
        table = pa.Table.from_arrays(arrays, schema=schema)
        pq.write_table(table, path, compression="none", use_dictionary=False, write_page_checksum=True)

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the file by the reader of this format."""
        (group,) = content.groups
        recording = RecoilParquetReader().open(path, Declarations(group.time_base.clock))
        types = {c.name: c.samples.dtype for c in group.channels}
        samples = {s.name: recording.read(s.name).astype(types.get(s.name, np.float64)) for s in recording.signals}
        times_s = recording.time_base(recording.signals[0].name).times_s
        return (ExportedTable(group.name, times_s, samples),)
