"""The self-test of the covariance: every kind of row is as uncertain as it says, over sound shots of their own seeds.

`RECOIL_DAQ_SOUND_SHOTS` sets how many shots of each rig are taken, once as the rigs are and once with a rest that is as
loud as the motion (10 by default; the published figures are of 100). Two processes share them.
"""

from __future__ import annotations

import datetime as dt
import os
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from scipy.stats import chi2

from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.stored_shot import read_stored
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.twin import simulate_shot
from tests.builders.row_residuals import Residuals, joined, residuals_of
from tests.builders.virtual_shots import SHORTER, with_twin

SHOTS = int(os.environ.get("RECOIL_DAQ_SOUND_SHOTS", "10"))
RIGS = ("mixed", "field-2013")
LEAST, MOST = 0.7, 1.4
"""Mean squares between which every kind of row lies."""
SLOWER: Mapping[str, float] = {"summary, ln brake_pressure": 0.4}
"""Kinds of rows, by the least of their mean squares, that hang on how fast the breech gauge's zero moves where all
forces are read: the virtual one takes 4 or 20 ms, and the estimate, which cannot know that, lets it take 2 or 30."""
ALIKE = ("summary, unread force", "summary, step of ln mass")
"""Rows that are put together, too."""
FIRST_SEED = 51_001


def one_shot(asked: tuple[str, int, bool]) -> dict[str, Residuals]:
    """Simulate, ingest and identify a shot; return what is left of each kind of its rows."""
    name, seed, kind = asked
    rig = with_twin(name, u_zero_rel=0.001, kind=kind, **SHORTER)
    with tempfile.TemporaryDirectory() as folder:
        fired = simulate_shot(rig, Path(folder) / "0001", seed=seed, shot="0001")
        path = ingest_files(rig, fired.files, shot="0001", out=Path(folder) / "shots", on=dt.date(2026, 6, 1)).path
        return residuals_of(identify_shot(read_stored(path), Options()))


def table(asked: list[tuple[str, int, bool]]) -> dict[str, Residuals]:
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(one_shot, asked))
    kinds = dict.fromkeys(kind for one in found for kind in one)
    rows = {kind: joined([one[kind] for one in found if kind in one]) for kind in kinds}
    alike = {name: [one for kind, one in rows.items() if kind.startswith(name)] for name in ALIKE}
    return rows | {f"all of {name}": joined(several) for name, several in alike.items() if several}


@pytest.mark.parametrize("kind", [False, True])
def test_every_kind_of_row_is_as_uncertain_as_it_says(capsys, kind):
    asked = [(name, FIRST_SEED + 1000 * kind + k, kind) for k in range(SHOTS) for name in RIGS]
    rest = "as loud as the motion, all forces read" if kind else "as the rigs have it"
    lines, off = [f"{len(asked)} sound shots, rest {rest}: mean, mean square (95 % by chance), degrees of freedom"], []
    for name, one in table(asked).items():
        low, high = (chi2.ppf(p, one.freedom) / one.freedom for p in (0.025, 0.975))
        lines.append(
            f"  {name:32s} {one.mean:+.2f}  {one.mean_square:.2f} ({low:.2f} to {high:.2f})  {one.freedom:.0f}"
        )
        least = SLOWER.get(name, LEAST) if kind else LEAST
        # what so few shots leave possible beside the bounds
        if not (least * min(low, 1.0) <= one.mean_square <= MOST * max(high, 1.0)):
            off.append(name)
    with capsys.disabled():
        print("", *lines, sep="\n")
    assert not off
