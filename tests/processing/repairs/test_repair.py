"""What was done to samples is told: which ones, in what order, and nothing else has changed."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from recoil_processing.repairs.repair import Repair, Repaired, RepairKind, changed

SAMPLES = np.arange(10.0)
FIRST_THREE = SAMPLES < 3


def test_a_repair_is_written_with_runs_and_counts_and_no_number_that_json_has_not():
    flags = np.array([False, True, True, False, True])
    repair = Repair(RepairKind.CLIPPED_MASKED, flags, "why", {"peak_m_s2": math.nan, "runs": 2.0, "tau_s": math.inf})
    assert repair.count == 3
    assert json.loads(json.dumps(repair.to_json(), allow_nan=False)) == {
        "what": "clipped masked",
        "count": 3,
        "of": 5,
        "runs": [[1, 2], [4, 1]],
        "figures": {"peak_m_s2": None, "runs": 2.0, "tau_s": None},
        "detail": "why",
    }


def test_flags_that_are_none_are_refused():
    with pytest.raises(ValueError, match="flags must be one series of bool, not float64"):
        Repair(RepairKind.CLIPPED_MASKED, SAMPLES, "")  # type: ignore[arg-type]  # the fault under test


def test_a_step_may_touch_flagged_samples_only():
    masked = np.where(FIRST_THREE, np.nan, SAMPLES)
    repair = Repair(RepairKind.DROP_OUTS_MASKED, FIRST_THREE, "")
    done = Repaired(SAMPLES).then(masked, repair)
    assert done.repairs == (repair,)
    with pytest.raises(ValueError, match="1 samples changed that no repair flags, first 7"):
        Repaired(SAMPLES).then(np.where(SAMPLES == 7, 0.0, masked), repair)
    with pytest.raises(ValueError, match="a repair keeps the number of samples"):
        Repaired(SAMPLES).then(SAMPLES[1:], repair)
    with pytest.raises(ValueError, match="flags 3 samples of 10"):
        Repaired(SAMPLES).then(SAMPLES, Repair(RepairKind.DROP_OUTS_MASKED, np.ones(3, dtype=bool), ""))


def test_steps_keep_their_order():
    droop = Repair(RepairKind.DROOP_CORRECTED, np.ones(10, dtype=bool), "")
    hum = Repair(RepairKind.HUM_SUBTRACTED, np.ones(10, dtype=bool), "")
    assert [r["what"] for r in Repaired(SAMPLES).then(SAMPLES + 1, hum).then(SAMPLES, droop).to_json()] == [
        "hum subtracted",
        "droop corrected",
    ]
    with pytest.raises(ValueError, match="'hum subtracted' comes before 'droop corrected', not after it"):
        Repaired(SAMPLES).then(SAMPLES + 1, droop).then(SAMPLES, hum)


def test_a_sample_that_stays_lost_has_not_changed():
    lost = np.array([np.nan, 1.0, np.nan, 2.0])
    found = np.array([np.nan, 1.0, 3.0, np.nan])
    assert changed(lost, found).tolist() == [False, False, True, True]
