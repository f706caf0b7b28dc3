"""The page for MATLAB's users: the variables that it names are those of an export."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import scipy.io

from recoil_acquisition.store import write_shot
from recoil_daq import export
from tests.builders.virtual_shots import virtual_shot

PAGE = Path(__file__).parents[1] / "docs" / "matlab.md"


@pytest.mark.whole_way
def test_the_variables_of_the_page_are_those_of_an_export(tmp_path: Path) -> None:
    write_shot(virtual_shot("mixed").shot, tmp_path / "0001.h5")
    (written,) = export(tmp_path / "0001.h5", "mat", out=tmp_path, aligned=True).files
    named = set(re.findall(r"\bs\.(\w+)", PAGE.read_text(encoding="utf-8")))
    assert named
    assert named <= set(scipy.io.loadmat(written.path))
