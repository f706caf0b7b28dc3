"""Parquet that this project exports: the time and the channels as columns, JSON in the schema's metadata.

The layout is described in `recoil_acquisition.exporters.parquet_file`, which writes it. Format: Apache Parquet,
https://parquet.apache.org/docs/file-format/ (magic ``PAR1`` at both ends, the metadata at the end).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError, system_errors_as
from recoil_acquisition.readers.exported.header import ExportedHeader, exported_header, parse_json
from recoil_acquisition.readers.exported.recording import Columns, exported_recording
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording

MAGIC = b"PAR1"
KEY = b"recoil-daq"
"""Key of the header among the schema's key-value metadata."""

GROWTH = 10
"""Ratio of the bytes of its numbers to those of a file, at most."""

SLACK_BYTES = 1 << 16
"""Bytes by which small files may grow beyond that."""


class RecoilParquetReader:
    """Reader of this project's Parquet files."""

    name = "recoil-daq Parquet"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If the file is Parquet of another program.
        CorruptFileError
            If it is damaged.
        """
        with system_errors_as(ReadError, path, "read", "check its name and permissions"):
            content = path.read_bytes()
        import pyarrow as pa
        import pyarrow.parquet as pq

        if len(content) < 12 or not content.endswith(MAGIC):
            raise CorruptFileError(
                "the file is cut: its end is missing",
                file_end=FileEnd.MISSING,
                path=path,
                expected=f"{MAGIC!r} at the end",
                remedy="copy it again",
            )
        try:
            file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True)
            schema, rows = file.schema_arrow, int(file.metadata.num_rows)
            packed = _compressions(file.metadata) - {"UNCOMPRESSED"}
        except (pa.ArrowException, OSError, ValueError, TypeError, KeyError, OverflowError) as error:
            raise _damaged(path, error) from error
        text = (schema.metadata or {}).get(KEY)
        if text is None:
            raise ReadError(
                "this Parquet file was not exported by recoil-daq", path=path,
                remedy="export it as CSV or in the recorder's own format",
            )  # fmt: skip
        if packed:
            # the size of the file bounds what is allocated only where nothing is packed
            raise ReadError(
                "was written anew by another program", path=path, expected="columns that are not compressed",
                found=", ".join(sorted(packed)), remedy="take the file as it was exported",
            )  # fmt: skip
        document = parse_json(text.decode("utf-8", errors="replace"), path, "metadata")
        widths = [8 if kind == pa.float64() else 4 if kind == pa.float32() else 0 for kind in schema.types]
        row_bytes = sum(widths)
        most = (GROWTH * len(content) + SLACK_BYTES) // max(row_bytes, 1)
        header = exported_header(document, path, most=most)
        if 0 in widths or len(widths) != len(header.signals) + 1 or rows != header.count or widths[0] != 8:
            raise CorruptFileError(
                "the columns are not what the metadata says", path=path,
                expected=f"{len(header.signals) + 1} columns of numbers, {header.count} rows",
                found=f"{len(widths)} columns, {rows} rows", remedy="export the shot again",
            )  # fmt: skip
        return exported_recording(self.name, header, declared.clock, header.count, partial(_columns, header, file))


def _columns(header: ExportedHeader, file: Any) -> Columns:
    """Read the columns of an open `pyarrow.parquet.ParquetFile`."""
    import pyarrow as pa

    try:
        table = file.read(use_threads=False)
        columns = [column.combine_chunks() for column in table.columns]
        if any(column.null_count or len(column) != header.count for column in columns):
            raise ValueError("a column has rows without a number, or another number of rows")
        return tuple(column.to_numpy(zero_copy_only=False).astype(np.float64) for column in columns)
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError, OverflowError) as error:
        raise _damaged(header.path, error) from error


def _compressions(metadata: Any) -> set[str]:
    groups = (metadata.row_group(i) for i in range(metadata.num_row_groups))
    return {str(group.column(j).compression) for group in groups for j in range(group.num_columns)}


def _damaged(path: Path, error: Exception) -> CorruptFileError:
    reason = " ".join(str(error).split())[:200]
    return CorruptFileError(f"is damaged: {reason}", path=path, remedy="copy it again, or export the shot again")
