"""Quantities of shots that were fired alike: their mean, scatter and uncertainty, and what is charted of them."""

import math

import numpy as np
import pytest
from scipy import stats

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.charted import PEAK, charted_peaks
from recoil_identification.campaign.peaks import PeakOfShots, apart_percent, fired_alike, peaks_of_shots

QUANTITY = "recoil_velocity_m_s"


def shot(number: int, value: float, added_kg: float = 0.0, u: float | None = 0.03, charge: str = "") -> CampaignShot:
    known = {} if u is None else {QUANTITY: u}
    shared = {} if u is None else {QUANTITY: 0.02}
    return CampaignShot(
        f"{number:04d}", "mixed", None, 780.0, 3.0, None, log={"added_mass_kg": added_kg, "charge": charge},
        peaks={QUANTITY: value}, peaks_u=known, peaks_u_shared=shared,
    )  # fmt: skip


def test_the_mean_is_as_uncertain_as_its_scatter_and_what_the_shots_share_make_it():
    values = (8.1, 8.4, 8.2, 8.6)
    (one,) = peaks_of_shots([shot(k, value) for k, value in enumerate(values)])
    scatter = float(np.std(values, ddof=1))
    assert (one.mean, one.scatter) == (pytest.approx(np.mean(values)), pytest.approx(scatter))
    assert one.u == pytest.approx(math.hypot(scatter / 2.0, 0.02))
    freedom = one.u**4 / ((scatter / 2.0) ** 4 / 3)
    assert one.degrees_of_freedom == pytest.approx(freedom)
    assert one.expanded == pytest.approx(stats.t.ppf(0.975, freedom) * one.u)


def test_shots_that_lie_together_by_chance_are_as_uncertain_as_each_of_them():
    (one,) = peaks_of_shots([shot(k, 8.2 + 1e-6 * k) for k in range(2)])
    assert one.u == pytest.approx(math.hypot(0.02, math.sqrt(0.03**2 - 0.02**2) / math.sqrt(2.0)))
    assert math.isinf(one.degrees_of_freedom)
    assert one.expanded == pytest.approx(1.96 * one.u, rel=1e-4)


def test_one_shot_has_no_scatter_and_the_uncertainty_of_its_report():
    (one,) = peaks_of_shots([shot(1, 8.2)])
    assert one.scatter is None
    assert one.u == pytest.approx(0.03)


def test_where_a_report_states_no_uncertainty_the_mean_has_none():
    (one,) = peaks_of_shots([shot(1, 8.2), shot(2, 8.3, u=None)])
    assert (one.u, one.expanded) == (None, None)
    assert one.scatter == pytest.approx(0.1 / math.sqrt(2.0))


def test_shots_of_other_charges_and_masses_are_not_averaged():
    found = peaks_of_shots([shot(1, 8.2), shot(2, 6.2, added_kg=120.0), shot(3, 7.0, charge="3"), shot(4, 8.4)])
    assert [(one.kind, one.shots) for one in found] == [
        ("nothing added", ("0001", "0004")), ("120 kg added", ("0002",)), ("nothing added, charge 3", ("0003",)),
    ]  # fmt: skip
    assert fired_alike({"configuration": "ring", "added_mass_kg": 0.0}) == "configuration ring, nothing added"


def test_what_is_charted_of_shots_of_two_kinds_is_free_of_the_kind_and_in_the_order_of_firing():
    order = [f"{k:04d}" for k in range(6)]
    shots = [shot(k, (8.0, 6.0)[k % 2] * (1.0 + 0.01 * (k // 2 - 1)), added_kg=120.0 * (k % 2)) for k in range(6)]
    ((label, apart),) = apart_percent(peaks_of_shots(shots), order)
    assert label == "peak velocity"
    assert list(apart) == order
    stretched = math.sqrt(3.0 / 2.0)
    assert list(apart.values()) == pytest.approx([-stretched, -stretched, 0.0, 0.0, stretched, stretched])
    (chart,) = charted_peaks([(label, apart)])
    assert (chart.quantity, chart.unit, chart.shots) == (PEAK, "%", tuple(order))


def test_a_shot_that_no_other_was_fired_like_is_not_charted():
    alone = PeakOfShots(QUANTITY, "nothing added", ("0001",), (8.0,), (0.03,), (0.02,))
    assert list(apart_percent([alone], ["0001"])) == [("peak velocity", {})]
    assert charted_peaks(apart_percent([alone], ["0001"])) == ()
