"""Numbers with blanks between them, as numpy's `savetxt` and MATLAB's `save -ascii` write them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.proposed_layout import propose_layout
from tests.builders.opened_files import open_table

TABLE = np.column_stack([0.001 * np.arange(60), np.sin(np.arange(60.0)), -np.arange(60.0)])
LAYOUT = {
    "separator": " ", "names": ["t", "a", "b"], "units": ["s", "g", "bar"], "first_row": 1, "time_column": 1,
    "time_unit": "s",
}  # fmt: skip


def saved(**options: Any) -> bytes:
    file = io.BytesIO()
    np.savetxt(file, TABLE, **options)
    return file.getvalue()


def matlab() -> bytes:
    return b"".join(b"".join(b"%16.7e" % number for number in row) + b"\r\n" for row in TABLE)


def opened(content: bytes, folder: Path, **layout: Any) -> Recording:
    return open_table(folder, content, layout={**LAYOUT, **layout})  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    "content", [saved(), matlab(), saved(fmt="%9.4f"), saved(delimiter=" \t ").replace(b"\n", b"  \r\n"), saved()[:-1]]
)
def test_any_number_of_blanks_is_one_separator(content: bytes, tmp_path: Path) -> None:
    recording = opened(content, tmp_path)
    count = len(TABLE) - (content[-1:] != b"\n")
    np.testing.assert_allclose(recording.read("a"), TABLE[:count, 1], atol=1e-4)
    np.testing.assert_allclose(recording.read("b"), TABLE[:count, 2])
    np.testing.assert_allclose(recording.time_base("a").times_s, TABLE[:count, 0], atol=1e-9)


def test_a_heading_behind_the_sign_of_a_comment_names_the_columns(tmp_path: Path) -> None:
    layout = {"separator": " ", "header_row": 1, "first_row": 2, "comment": "#", "time_column": "t", "time_unit": "s"}
    recording = open_table(tmp_path, saved(header="t a b"), layout=layout)
    assert [header.name for header in recording.signals] == ["a", "b"]


def test_a_row_with_too_few_cells_is_refused_with_its_line(tmp_path: Path) -> None:
    rows = saved().splitlines(keepends=True)
    rows[20] = b"1 2\n"
    with pytest.raises(CorruptFileError, match="a row does not fit the header") as refused:
        opened(b"".join(rows), tmp_path).read("a")
    assert refused.value.place == "line 21"


def test_a_blank_does_not_set_thousands_apart_beside_blanks(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="a blank cannot both separate cells and set thousands apart"):
        opened(saved(), tmp_path, thousands=" ")


@pytest.mark.parametrize("content", [saved(), matlab()])
def test_a_table_with_blanks_has_a_layout_proposed(content: bytes) -> None:
    proposed = propose_layout(content.decode().splitlines())
    assert proposed is not None
    assert proposed.table["separator"] == " "
    assert len(proposed.table["names"]) == 3
