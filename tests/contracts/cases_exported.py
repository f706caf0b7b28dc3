"""Our own CSV and Parquet exports, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders import exported_files as build

BY_NAME = {reader.name: reader for reader in READERS}
MAGNITUDES = {"p_breech": (-1.0, 3e8), "acc, recoil": (-10.0, float("inf"))}
DECLARED = Declarations("dewetron")

CASES = (
    Case("recoil-csv", BY_NAME["recoil-daq CSV"], build.csv_file(), DECLARED, MAGNITUDES),
    Case(
        "recoil-csv-stamped",
        BY_NAME["recoil-daq CSV"],
        build.csv_file(build.document(None), build.STAMPS).replace(b"\n", b"\r\n"),
        DECLARED,
        MAGNITUDES,
    ),
    Case("recoil-parquet", BY_NAME["recoil-daq Parquet"], build.parquet_file(), DECLARED, MAGNITUDES),
    Case(
        "recoil-parquet-stamped",
        BY_NAME["recoil-daq Parquet"],
        build.parquet_file(build.document(None), build.STAMPS),
        DECLARED,
        MAGNITUDES,
    ),
)
