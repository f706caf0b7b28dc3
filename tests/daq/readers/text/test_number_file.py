from __future__ import annotations

import errno
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.text.column_store import NumberFile


def test_numbers_written_by_several_threads_are_read_back_from_anywhere() -> None:
    numbers = np.random.default_rng(1).normal(size=4000)
    file = NumberFile(Path("x.csv"))
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda at: file.write(at, numbers[at : at + 100]), range(3900, -100, -100)))
    for start, count in ((0, 4000), (17, 300), (3999, 1), (5, 0)):
        found = np.empty(count)
        file.read(start, found)
        np.testing.assert_array_equal(found, numbers[start : start + count])


def test_numbers_that_are_not_there_are_an_error() -> None:
    file = NumberFile(Path("x.csv"))
    file.write(0, np.zeros(3))
    with pytest.raises(ReadError, match="became shorter"):
        file.read(2, np.empty(2))


class FullDisk:
    def seek(self, at: int) -> int:
        return at

    def write(self, _data: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        return None


def test_no_room_for_numbers_is_an_error_that_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: FullDisk())
    with pytest.raises(ReadError, match=r"No space left on device.*TMPDIR"):
        NumberFile(Path("x.csv")).write(0, np.zeros(3))
