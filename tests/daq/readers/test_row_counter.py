"""A column that counts the rows says where some are missing, whatever it is called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.row_counter import counted_rows
from recoil_acquisition.remark import NoteCode
from tests.builders.opened_files import open_bytes

SEEN = np.r_[0:50, 80:200]
DECLARED = Declarations(
    "dewetron", layout={"separator": ";", "header_row": 1, "first_row": 2, "rate_hz": 100.0}
)  # fmt: skip


def table(counts: np.ndarray, folder: Path, heading: str = "Nr") -> Recording:
    rows = "".join(f"{count};{0.5 * k}\n" for k, count in enumerate(counts))
    return open_bytes(None, "a.txt", folder, f"{heading};p (bar)\n{rows}".encode(), DECLARED)


@pytest.mark.parametrize("heading", ["Counter", "Zähler", "序号", "", "Packet number"])
@pytest.mark.parametrize("counts", [SEEN + 2552, (SEEN + 65500) % 65536, (SEEN + 250) % 256, 10 * SEEN])
def test_rows_that_a_counter_misses_are_a_gap(counts: np.ndarray, heading: str, tmp_path: Path) -> None:
    recording = table(counts, tmp_path, heading)
    np.testing.assert_allclose(recording.time_base("p").times_s, SEEN / 100.0, atol=1e-12)
    (lost,) = (note for note in recording.notes if note.code == NoteCode.LOST)
    assert "jumps in 1 place, first behind line 51: 30 rows are missing" in lost


@pytest.mark.parametrize("counts", [np.arange(170), np.arange(170) % 100, np.arange(170) % 60 + 1, SEEN * 0 + 7])
def test_a_whole_count_leaves_no_gap(counts: np.ndarray, tmp_path: Path) -> None:
    recording = table(counts, tmp_path)
    assert recording.time_base("p").stamps_s is None
    assert not any(note.code == NoteCode.LOST for note in recording.notes)


def test_a_counter_that_was_set_back_dates_nothing(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="begins anew: a second recording begins") as refused:
        table(np.r_[0:500, 0:100], tmp_path).time_base("p")
    assert refused.value.place == "line 502"


def test_what_is_measured_counts_no_rows(tmp_path: Path) -> None:
    assert table(SEEN, tmp_path, "s (um)").time_base("p").stamps_s is None


@pytest.mark.parametrize(
    "numbers",
    [
        np.arange(10.0),
        SEEN + 0.5,
        np.repeat(np.arange(50.0), 2),
        np.r_[SEEN, np.nan],
        np.cumsum(np.arange(40.0) % 7 + 1),
    ],
)
def test_numbers_that_do_not_count_are_no_counter(numbers: np.ndarray) -> None:
    assert counted_rows(np.asarray(numbers, dtype=np.float64)) is None
