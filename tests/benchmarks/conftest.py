"""Benchmarks take minutes: none of them runs unless it is asked for."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True, scope="module")  # before anything is made for them
def _only_when_asked_for(request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark: ask for it with --benchmark-enable")
