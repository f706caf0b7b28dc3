"""The recipes of CONTRIBUTING.md do what they say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_identification.targets.target import Case
from recoil_processing.filters import filter_alike
from tests.builders.virtual_shots import virtual_shot

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def recipe(name: str) -> dict[str, Any]:
    """Execute the block of a recipe as a module, and return its names."""
    found = re.search(rf"<!-- recipe: {name} -->\n```python\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(found[1], f"CONTRIBUTING.md, {name}", "exec"), names)  # noqa: S102 - our own page
    return names


def test_the_filter_is_one_filter_for_all_columns() -> None:
    average = recipe("filter")["MovingAverage"](3)
    rng = np.random.default_rng(1)
    acceleration = rng.standard_normal(500)
    table = filter_alike(average, {"acceleration": acceleration, "force": 782.0 * acceleration}, 1e4)
    assert np.allclose(table["force"], 782.0 * table["acceleration"], rtol=1e-12)
    frequency_hz = 800.0
    wave = np.cos(2 * np.pi * frequency_hz / 1e4 * np.arange(500))
    seen = average.apply(wave, 1e4)[100:400]
    assert np.allclose(seen, average.gain(frequency_hz, 1e4) * wave[100:400], atol=1e-12)


def test_the_target_finds_its_number() -> None:
    virtual = virtual_shot(seed=3)
    (peak,) = recipe("target")["find"](Case(virtual.shot, virtual.rig)).quantities
    gauge = virtual.shot.by_role("breech_pressure")
    assert gauge is not None
    assert peak.value == pytest.approx(1e-6 * float(np.nanmax(gauge.samples)))
    assert 100.0 < peak.value < 160.0


@pytest.mark.parametrize("link", sorted(set(re.findall(r"\]\(([^)#]+)\)", TEXT))))
def test_what_the_page_names_is_there(link: str) -> None:
    assert (ROOT / link).exists()
