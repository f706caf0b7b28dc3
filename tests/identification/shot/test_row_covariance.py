"""The covariance tested by itself: each kind of row leaves what it says, over sound shots of their own seeds."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.stored_shot import read_stored
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.twin import simulate_shot
from tests.builders.row_residuals import Residuals, joined, residuals_of
from tests.builders.virtual_shots import SHORTER, with_twin

SEEDS = (61_001, 61_002, 61_003)
LEAST, MOST = 0.7, 1.4
"""Mean squares between which every kind of row lies, as `tests/benchmarks/test_covariance_benchmark.py` measures."""
CHANCE = 1e-4
"""Probability with which one kind is farther off by chance."""


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Residuals]:
    rig = with_twin("field-2013", u_zero_rel=0.001, kind=False, **SHORTER)
    each = []
    for seed in SEEDS:
        folder: Path = tmp_path_factory.mktemp("sound")
        fired = simulate_shot(rig, folder / "0001", seed=seed, shot="0001")
        path = ingest_files(rig, fired.files, shot="0001", out=folder / "shots", on=dt.date(2026, 6, 1)).path
        each.append(residuals_of(identify_shot(read_stored(path), Options())))
    return {
        kind: joined([one[kind] for one in each if kind in one]) for kind in dict.fromkeys(k for e in each for k in e)
    }


@pytest.mark.whole_way
def test_every_kind_of_row_is_as_uncertain_as_it_says(left: Mapping[str, Residuals]):
    assert {"motion", "frames", "late readings", "summary, drift of ln mass", "summary, unread share"} <= left.keys()
    for kind, one in left.items():
        low, high = (float(chi2.ppf(p, one.freedom)) / one.freedom for p in (CHANCE, 1.0 - CHANCE))
        assert LEAST * low <= one.mean_square <= MOST * high, (kind, one.mean_square, one.freedom)


@pytest.mark.whole_way
def test_what_is_left_has_no_sign(left: Mapping[str, Residuals]):
    for kind, one in left.items():
        assert abs(one.mean) < 4.5 / np.sqrt(one.left.size), (kind, one.mean, one.left.size)
