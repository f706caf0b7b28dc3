"""Files that are made to take memory and time take neither, and nothing but this project's errors comes of them."""

from __future__ import annotations

import os
import sys
import time
import tracemalloc
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers import bounded_file
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.hostile_files import HOSTILE
from tests.builders.vendor_files import DBC

BYTES = 150_000
LARGER = {"uff_other_datasets": 200_000, "mdf_shared_byte": 600_000, "old_mdf_shared_byte": 600_000}
LONGEST_S = 10.0
SPARE_BYTES = 1 << 24
"""In place of the bound's own, which the files must exceed: less has to be packed and unpacked."""
REFUSED = {
    "blf_frames": "the log unpacks to more than",
    "blf_events": "the log unpacks to more than",
    "blf_fd_frames": "the log unpacks to more than",
    "gzip_log": "the compressed file unpacks to more than",
    "sqlite_shared_pages": "more rows than the file has room for|interrupted",
    "uff_other_datasets": "more than 20000 datasets",
    "hdf5_zeros": "a: the file unpacks to more than",
    "hdf5_times": "the file unpacks to more than",
    "hdf5_deep": "groups within groups beyond 32",
    "hdf5_wide": "more than 5000 groups and datasets",
    "hdf5_attributes": "more than 20000 attributes",
    "hdf5_shapes": "never written|damaged",
    "mat_zeros": "the file unpacks to more than",
    "mdf_shared_byte": "the file unpacks to more than",
    "mdf_listed_again": "leads back to the data",
    "mdf_packed": "the file unpacks to more than",
    "mdf_ranges_over_one_another": "lie over one another",
    "old_mdf_shared_byte": "the file unpacks to more than",
    "old_mdf_shared_records": "samples are missing",
    "old_mdf_over_one_another": "lie over one another",
    "old_mdf_tables_over_one_another": "lie over one another",
}


def read_all(path: Path) -> None:
    recording = recognise(path).open(path, Declarations("c", database=DBC, frame_rate_hz=100.0, scale_mm_per_px=1.0))
    for signal in recording.signals:
        recording.read(signal.name)
        recording.time_base(signal.name)
    recording.tracks()


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_takes_little(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_file, "SPARE_BYTES", SPARE_BYTES)
    path = tmp_path / name
    path.write_bytes(HOSTILE[name](LARGER.get(name, BYTES)))
    tracemalloc.start()
    begin = time.process_time()
    try:
        read_all(path)
        problem = ""
    except ReadError as error:
        problem = str(error)
    taken_s, peak = time.process_time() - begin, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken_s < LONGEST_S
    assert peak < 2 * most_unpacked(path.stat().st_size)
    if name in REFUSED:
        assert any(words in problem for words in REFUSED[name].split("|")), problem


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell how much of a file is stored")
@pytest.mark.parametrize("name", ["text_zeros", "candump_line", "blf_plain_events", "uff_without_end", "wave_zeros"])
def test_a_file_of_holes_is_refused_at_once(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(HOSTILE[name](1000))
    os.truncate(path, 100 << 30)
    with pytest.raises(ReadError, match="most of the file was never written"):
        read_all(path)
