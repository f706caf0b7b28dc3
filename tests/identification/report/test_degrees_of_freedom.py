"""Degrees of freedom: of each zero the samples of its rest less one, in budget and page, and what follows of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.joint_fit import joint_fit_under
from recoil_identification.report.content.tables import budget
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.formulas import formula_of
from recoil_identification.report.figure.campaign_figures import campaign_figures
from recoil_identification.report.page.html import render_campaign_page
from recoil_processing.noise import welch_satterthwaite
from tests.builders.campaign_summaries import campaign_of
from tests.builders.page_elements import PageElements
from tests.builders.virtual_shots import identified, virtual_shot

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
ZEROS = {
    "recoil_acceleration zero": "recoil_acceleration",
    "breech_pressure zero": "breech_pressure",
    "brake_pressure zero": "brake_pressure",
}


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    return report_document(virtual_shot("mixed").shot, identified("mixed"), version="1", shot_file=SHOT_FILE)


def test_a_zero_has_the_samples_of_the_rest_less_one(report: dict[str, Any]) -> None:
    signals = identified("mixed").route.signals
    times_s = signals.start_s + signals.step_s * np.arange(signals.series["breech_pressure"].size)
    first, last = signals.baseline_s
    rows = {row["source"]: row for row in report["budget"]}
    for source, role in ZEROS.items():
        resting = np.isfinite(signals.series[role][(times_s >= first) & (times_s <= last)])
        assert rows[source]["degrees_of_freedom"] == pytest.approx(np.count_nonzero(resting) - 1, abs=2)
        assert rows[source]["type"] == "A"


def test_what_a_certificate_states_is_taken_as_known_and_what_is_guessed_is_not(report: dict[str, Any]) -> None:
    known = [row for row in report["budget"] if row["type"] == "B"]
    # nobody stated how a pulse is read: the half per cent is a guess, to a quarter of itself (JCGM 100, G.4.2)
    assert {row["source"]: row["degrees_of_freedom"] for row in known if row["degrees_of_freedom"] is not None} == {
        "breech_pressure dynamic scale": pytest.approx(8.0)
    }
    assert len(known) > 5
    assert all(row["degrees_of_freedom"] is not None for row in report["budget"] if row["type"] == "A")


def test_the_effective_ones_follow_from_the_rows_that_are_stated(report: dict[str, Any]) -> None:
    rows = report["budget"]
    fourth = sum(row["u_kg"] ** 4 / row["degrees_of_freedom"] for row in rows if row["degrees_of_freedom"])
    expected = sum(row["u_kg"] ** 2 for row in rows) ** 2 / fourth
    assert report["uncertainty"]["degrees_of_freedom"] == pytest.approx(expected, rel=1e-12)


def test_the_page_has_them_in_the_table(report: dict[str, Any]) -> None:
    written = {row["source"]: row["freedom"] for row in budget(report)}
    of_zero = next(row for row in report["budget"] if row["source"] == "breech_pressure zero")
    assert written["breech_pressure zero"].replace("\N{NARROW NO-BREAK SPACE}", "") == str(
        int(of_zero["degrees_of_freedom"])
    )
    assert written["packing friction"] == "∞"


def test_a_zero_explains_where_they_come_from(report: dict[str, Any]) -> None:
    formula = formula_of("budget.breech_pressure zero.degrees_of_freedom", report)
    assert formula is not None
    assert "n - 1" in formula.text


def test_two_equal_means_of_ten_have_eighteen_together() -> None:
    """JCGM 100:2008, H.3 and G.4.1: equal contributions add up their degrees of freedom."""
    assert welch_satterthwaite([(0.3, 9.0), (0.3, 9.0)]) == pytest.approx(18.0)
    # G.4.1, note 1: what is known adds to u alone
    assert welch_satterthwaite([(1.0, 9.0), (1.0, math.inf)]) == pytest.approx(36.0)
    assert math.isinf(welch_satterthwaite([(1.0, math.inf)]))
    assert math.isinf(welch_satterthwaite([(0.0, 3.0), (math.inf, 5.0)]))


@pytest.mark.whole_way
@pytest.mark.parametrize("shots", [3, 24])
def test_what_is_random_among_shots_has_as_many_as_its_variance_is_known(shots: int) -> None:
    campaign = combine(campaign_of((0.0, 120.0, 0.0) * (shots // 3), seed=4).shots)
    fit, mass_kg = campaign.fit, campaign.mass.mass_kg
    alone = [joint_fit_under(fit.rows, trial.scatter).budget(fit.rows.mechanisms[0])[0].u_kg for trial in fit.trials]
    masses_kg = [fit.rows.reference_kg * math.exp(float(one.estimate.values[0])) for one in fit.trials]
    variances = mass_kg**2 * np.square(np.array(alone) / masses_kg)
    spread = float(np.cov(variances, aweights=fit.weights, ddof=0))
    document = campaign_document(campaign, version="1", inputs=[], parameters={})
    rows = document["budget"]
    (random,) = (row for row in rows if row["type"] == "A")
    assert random["degrees_of_freedom"] == pytest.approx(2.0 * random["u_kg"] ** 4 / spread, rel=1e-6)
    assert all(row["degrees_of_freedom"] is None for row in rows if row["type"] == "B")
    # u is averaged over the scatters: what they leave open is in it, and counts once
    assert document["uncertainty"]["degrees_of_freedom"] is None
    of = ("coverage_factor", "degrees_of_freedom")
    for key in (*(f"uncertainty.{one}" for one in of), "budget.random errors of the shots.degrees_of_freedom"):
        assert formula_of(key, document) is not None


@pytest.mark.parametrize("shots", [2, 3, 6])
def test_the_interval_of_few_shots_covers_what_their_scatter_leaves_open(shots: int) -> None:
    """It is 1.96 u of all scatters: as wide as the quantiles of the mixture of normal distributions that these are."""
    campaign = combine(campaign_of((0.0, 120.0, 0.0)[: min(shots, 3)] * max(shots // 3, 1), seed=4).shots)
    fit = campaign.fit
    at = fit.names.index(fit.rows.masses[0])
    rng, drawn = np.random.default_rng(1), []
    for number, trial in zip(rng.multinomial(400_000, fit.weights).tolist(), fit.trials, strict=True):
        u = math.sqrt(float(trial.estimate.covariance[at, at]))
        drawn.append(rng.normal(float(trial.estimate.values[at]), u, number))
    low, high = np.quantile(np.concatenate(drawn), [0.025, 0.975])
    half_kg = campaign.mass.mass_kg * (high - low) / 2.0
    assert campaign.mass.expanded_kg == pytest.approx(half_kg, rel=0.02)


@pytest.mark.whole_way
def test_the_page_of_a_campaign_says_why_what_is_random_widens_no_factor() -> None:
    campaign = combine(campaign_of((0.0, 120.0) * 3, seed=4).shots)
    document = campaign_document(campaign, version="1", inputs=[], parameters={})
    text = PageElements(render_campaign_page(document, campaign_figures(campaign, None))).text
    assert "They do not widen k" in text
    del document["uncertainty"]  # an earlier answer
    assert "They do not widen k" not in PageElements(render_campaign_page(document, ())).text
