"""Work and memory of a LabVIEW file grow as the file does, and one that asks for more is refused."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.text import lvm
from tests.builders.lvm_files import Column, Lvm
from tests.builders.opened_files import open_bytes

HEAD = Lvm([]).content()
TIMES, MOST_TIMES = 4, 10
"""Sizes of a file to one another, and what its work may grow by: 16 is that of a square."""


def special_blocks(count: int) -> bytes:
    return HEAD + b"***Start_Special***\n" * (20 * count) + b"***End_of_Header***\nX_Value\ta\n0\t1\n"


def columns(count: int, x_columns: str = "No", **stated: str) -> bytes:
    return Lvm([[Column(f"c{i}", "V", ["1", "2"], **stated) for i in range(count)]], x_columns, [["0", "1"]]).content()


def equal_names(count: int) -> bytes:
    names = [*("c" for _ in range(count // 2)), *(f"c#{i}" for i in range(2, count // 2))]
    return Lvm([[Column(name, "V", ["1", "2"]) for name in names]]).content()


def own_steps(count: int) -> bytes:
    return Lvm([[Column(f"c{i}", "V", ["1", "2"], delta_x=f"0.{i + 1:06d}") for i in range(count)]]).content()


def segments(count: int) -> bytes:
    rows = [[Column("a", "V", ["1"], time=f"12:{i // 60 % 60:02d}:{i % 60:02d}")] for i in range(count // 4)]
    return Lvm(rows).content()


def taken_s(content: bytes, folder: Path) -> float:
    """Processor time that a file takes to be opened, or refused: the least of three."""
    taken = []
    for _ in range(3):
        begin = time.process_time()
        with suppress(ReadError):
            open_bytes(lvm.LvmReader(), "a.lvm", folder, content)
        taken.append(time.process_time() - begin)
    return min(taken)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "write",
    [
        special_blocks, columns, lambda n: columns(n, "One"), lambda n: columns(n, "Multi"), equal_names, own_steps,
        segments,
    ],
    ids=["special blocks", "columns", "one X", "an X each", "equal names", "own steps", "segments"],
)  # fmt: skip
def test_a_file_four_times_as_long_takes_four_times_the_work(write: Callable[[int], bytes], tmp_path: Path) -> None:
    taken_s(write(20), tmp_path)
    assert taken_s(write(250 * TIMES), tmp_path) < MOST_TIMES * taken_s(write(250), tmp_path)


def test_rows_that_leave_nearly_all_cells_out_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lvm, "most_unpacked", lambda stored: 20 * stored)
    short = columns(500).rstrip() + b"\r\n" + b"1\r\n" * 5000
    with pytest.raises(ReadError, match="nearly all cells of its rows are left out") as caught:
        open_bytes(lvm.LvmReader(), "a.lvm", tmp_path, short)
    assert caught.value.expected == "rows of 501 cells"


def test_more_segments_than_are_read_are_refused_with_the_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lvm, "MOST_SEGMENTS", 20)
    assert open_bytes(lvm.LvmReader(), "a.lvm", tmp_path, segments(80)).metadata["segments"] == 20
    with pytest.raises(ReadError, match="line 264: more than 20 segments"):
        open_bytes(lvm.LvmReader(), "a.lvm", tmp_path, segments(84))


def test_a_special_block_is_passed_over_and_one_without_an_end_is_none(tmp_path: Path) -> None:
    content = columns(2).replace(
        b"Samples\t", b"***Start_Special***\r\nSamples\t9\t9\r\n***End_Special***\r\nSamples\t", 1
    )
    assert open_bytes(lvm.LvmReader(), "a.lvm", tmp_path, content).incomplete == ""
    endless = columns(2).replace(b"Samples\t", b"***Start_Special***\r\nSamples\t", 1)
    assert open_bytes(lvm.LvmReader(), "a.lvm", tmp_path, endless).read("c1").tolist() == [1.0, 2.0]
