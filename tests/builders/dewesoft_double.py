"""A double of Dewesoft's library, which reads what it is told to say from the file itself.

The child process imports it in place of ``dwdatareader`` where its folder is on PYTHONPATH. It stands in
for what the real library was seen to do and no real file at hand shows: crashes, hangs, single values, gaps.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

SOURCE = """
import ctypes, datetime, enum, json, os, time
import numpy as np

class DWError(RuntimeError):
    def __init__(self, status, message):
        super().__init__(status)
        self.status, self.message = status, message

class DWDataType(enum.IntEnum):
    dtSingle = 5
    dtDouble = 7
    dtComplexDouble = 10
    dtText = 11

class Channel:
    def __init__(self, said):
        self.said, self.long_name = said, said.get("long_name", said["name"])
        self.unit, self.description = said.get("unit", "V"), said.get("description", "")
        self.channel_type, self.array_size = said.get("kind", 0), said.get("array_size", 1)
        self.data_type = DWDataType(said.get("data_type", 7))
        self.sample_rate = said.get("rate_hz", 0.0)
    @property
    def number_of_samples(self):
        if "status" in self.said:
            raise DWError(self.said["status"], "Feature or operation not supported on CAN channel")
        return self.said.get("count", len(self.said["values"]))
    def scaled(self):
        return np.array(self.said["times_s"], float), np.array(self.said["values"], float)

class Events:
    def itertuples(self):
        return [(0.0, 1, "storing started")]

class Info:
    sample_rate, duration = 100.0, 1.0
    start_measure_time = datetime.datetime(2026, 8, 5, 10, 0, tzinfo=datetime.timezone.utc)
    start_store_time = datetime.datetime(2026, 8, 5, 10, 20, tzinfo=datetime.timezone.utc)

class DWFile(dict):
    info, header = Info(), {"operator": "A. N."}
    def __init__(self, path):
        said = json.loads(open(path, "rb").read()[64:].decode().rstrip("\\0"))
        if said.get("crash"):
            ctypes.string_at(0)
        if said.get("exit"):
            os._exit(7)
        if said.get("hang"):
            time.sleep(600)
        if said.get("status"):
            raise DWError(said["status"], "File is corrupt")
        super().__init__((c["name"], Channel(c)) for c in said["channels"])
        self.storing_type, self.setup = said.get("storing_type", 0), said.get("setup", "<setup/>")
    def __enter__(self):
        return self
    def __exit__(self, *_):
        pass
    def events(self):
        return Events()
    def export_header(self, path):
        open(path, "w").write(self.setup)

def get_version():
    return "0.0.0"
"""


def write_double(folder: Path, source: str = SOURCE) -> None:
    """Write the double where the child finds it before the real library."""
    (folder / "dwdatareader.py").write_text(source, encoding="utf-8")


def told_file(path: Path, **said: Any) -> Path:
    """Write a file that makes the double say something."""
    content = b"MULTI_STREAM_FILE_VER02106-".ljust(64, b"\0") + json.dumps(said).encode()
    path.write_bytes(content.ljust(8192, b"\0"))
    return path
