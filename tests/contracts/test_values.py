"""A value that is handed out cannot be changed by whoever has it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.indispensable("law")

GROWING = {
    "recoil_acquisition": {"Cells", "Cut", "FrameCounters", "Tally"},
    "recoil_processing": set(),
    "recoil_identification": set(),
    "recoil_rigs": {"Played", "PlayedRecorder", "Scene", "Ticks"},
    "recoil_daq": {"LiveOutcome", "LiveShot", "Unmatched", "WarmWork"},
}
"""By package, what counts or gathers while something runs."""


def changeable(package: str) -> Iterator[str]:
    """Yield the public dataclasses of a package that are not frozen, by their text."""
    spec = find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    for path in Path(spec.origin).parent.rglob("*.py"):
        for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(one, ast.ClassDef) and not one.name.startswith("_"):
                made = [ast.unparse(decorator) for decorator in one.decorator_list]
                if any(text.startswith("dataclass") and "frozen=True" not in text for text in made):
                    yield one.name


@pytest.mark.parametrize("package", GROWING)
def test_what_a_package_hands_out_cannot_be_changed(package: str) -> None:
    assert set(changeable(package)) == GROWING[package]
