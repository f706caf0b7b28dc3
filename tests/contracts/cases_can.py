"""Files of the readers of CAN logs, for the rules that every reader keeps."""

from __future__ import annotations

import gzip
from collections.abc import Callable

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders import can_logs, mdf_logs
from tests.builders import vendor_files as build

BY_NAME = {reader.name: reader for reader in READERS}
CAN = Declarations("can", database=build.DBC)
MAGNITUDES = {"ACC.ax": (-10, 10), "ACC.p": (0, 20), "GYR.gx": (-1, 10), "EXT.low": (0, 100), "EXT.high": (0, 100)}
ENTRIES = build.can_entries()


def at_line_end(cut: bytes) -> bool:
    return cut.endswith((b"\n", b"\r"))


def at_entry_end(content: bytes) -> Callable[[bytes], bool]:
    """An entry states its length, so that nothing shows that more followed it."""
    whole = {line.strip() for line in content.splitlines() if not line.startswith(b";")}
    return lambda cut: at_line_end(cut) or cut.splitlines()[-1].strip() in whole


TRACES = tuple(
    Case(f"trc-{version}", BY_NAME["PEAK TRC trace"], content, CAN, MAGNITUDES, at_entry_end(content))
    for version, content in (
        (version, can_logs.trc_log(ENTRIES, version=version)) for version in ("1.0", "1.1", "1.3", "2.0", "2.1")
    )
)
PACKED = tuple(
    Case(f"{name}-gz", BY_NAME[reader], gzip.compress(content, mtime=0), CAN, MAGNITUDES)
    for name, reader, content in (
        ("asc", "Vector ASC log", build.asc_log(ENTRIES)),
        ("candump", "candump log", build.candump_log(ENTRIES)),
        ("trc", "PEAK TRC trace", can_logs.trc_log(ENTRIES)),
        ("can-csv", "python-can CSV log", can_logs.can_csv(ENTRIES)),
    )
)
CASES = (
    *TRACES,
    Case("can-csv", BY_NAME["python-can CSV log"], can_logs.can_csv(ENTRIES), CAN, MAGNITUDES, at_line_end),
    Case("canedge-csv", BY_NAME["CANedge CSV log"], can_logs.canedge_csv(ENTRIES), CAN, MAGNITUDES, at_line_end),
    Case("can-sqlite", BY_NAME["python-can SQLite log"], can_logs.can_sqlite(ENTRIES), CAN, MAGNITUDES),
    Case("mdf-bus-logging", BY_NAME["MDF4 bus logging"], mdf_logs.bus_log(ENTRIES), CAN, MAGNITUDES),
    Case("mdf-logger", BY_NAME["MDF4 bus logging"], mdf_logs.logger_file(ENTRIES), CAN, MAGNITUDES),
    Case("mdf-listed", BY_NAME["MDF4 bus logging"], mdf_logs.listed_log(ENTRIES), CAN, MAGNITUDES),
    *PACKED,
)
