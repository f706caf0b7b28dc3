"""A file is held once, however many of its groups have been read."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.mdf3_files import DATA, TIME, UNSIGNED, OldFile
from tests.builders.mdf_logs import Blocks, identification_block

GROUPS, RECORDS = 20, 20_000


def old_file() -> bytes:
    file, following = OldFile(), 0
    for number in range(GROUPS):
        time = file.channel("t", TIME, 0, 0, UNSIGNED, rate=0.001)
        group = file.group(file.channel(f"n{number}", DATA, 0, 8, UNSIGNED, time), 1, RECORDS)
        following = file.data_group(group, file.records(bytes(RECORDS)), following)
    return file.closed(following)


def new_file() -> bytes:
    blocks, following = Blocks(identification_block(b"MDF     ")), 0
    for number in range(GROUPS):
        value = blocks.column(f"n{number}", 0, 0, 0, 8, 0)
        time = blocks.column("t", 3, 0, 0, 0, value, conversion=blocks.linear(0.0, 0.001))
        sizes = struct.pack("<QQHHLLL", 0, RECORDS, 0, 0, 0, 1, 0)
        group = blocks.add("##CG", (0, time, 0, 0, 0, 0), sizes)
        following = blocks.add("##DG", (following, group, blocks.add("##DT", (), bytes(RECORDS)), 0), bytes(8))
    return blocks.closed(following)


def test_all_groups_share_one_copy_of_their_file(tmp_path: Path) -> None:
    for content in (old_file(), new_file()):
        (tmp_path / "a").write_bytes(content)
        recording = recognise(tmp_path / "a").open(tmp_path / "a", Declarations("c"))
        tracemalloc.start()
        assert [recording.read(signal.name).size for signal in recording.signals] == [RECORDS] * GROUPS
        held = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        assert held < 2 * len(content)
