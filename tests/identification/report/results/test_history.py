"""Earlier campaigns beside a new one: what they share is read off their budgets, and only what is the same error."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.results.history import (
    HISTORY,
    THIS,
    history_again,
    history_document,
    history_figure,
    row_of,
    shared_kg2,
)
from tests.builders.campaign_summaries import MASS_KG, at_rest, campaign_of

PAIRS, SHOTS = 10, 4


def answer(shots: Sequence[CampaignShot]) -> dict[str, Any]:
    return campaign_document(combine(shots), version="1", inputs=[], parameters={})


def history_of(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    shared = shared_kg2(one, other)
    matrix = [[one["mass"]["u"] ** 2, shared], [shared, other["mass"]["u"] ** 2]]
    return history_document([row_of(one, "spring"), row_of(other, THIS)], matrix)


@pytest.fixture(scope="module")
def pairs() -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Answers of two campaigns each, whose sensors are off alike."""
    found = []
    for seed in range(PAIRS):
        shots = campaign_of((0.0, 120.0) * SHOTS, seed=seed).shots
        found.append((answer(shots[:SHOTS]), answer(shots[SHOTS:])))
    return found


@pytest.mark.whole_way
def test_the_difference_of_two_campaigns_is_as_uncertain_as_it_scatters(
    pairs: list[tuple[dict[str, Any], dict[str, Any]]],
) -> None:
    z, in_common = [], []
    for one, other in pairs:
        row = history_of(one, other)["campaigns"][0]
        z.append(row["difference_kg"] / row["u_difference_kg"])
        in_common.append(shared_kg2(one, other) / (one["mass"]["u"] * other["mass"]["u"]))
        assert row["difference_kg"] == one["mass"]["value"] - other["mass"]["value"]
        assert row["u_difference_kg"] < np.hypot(one["mass"]["u"], other["mass"]["u"])
    assert np.sum(np.square(z)) < 23.2  # chi square of ten, 1 %
    assert np.sum(np.square(z)) > 2.6
    assert all(0.05 < share < 1.0 for share in in_common)


@pytest.mark.whole_way
def test_a_campaign_shares_with_itself_all_but_what_is_random(
    pairs: list[tuple[dict[str, Any], dict[str, Any]]],
) -> None:
    one, _ = pairs[0]
    random = sum(row["u_kg"] ** 2 for row in one["budget"] if row["scope"] == "shot")
    assert shared_kg2(one, one) == pytest.approx(one["mass"]["u"] ** 2 - random, rel=1e-9)


@pytest.mark.whole_way
@pytest.mark.parametrize("key", ["certificate", "calibrated"])
def test_another_certificate_is_another_error(pairs: list[tuple[dict[str, Any], dict[str, Any]]], key: str) -> None:
    one, other = (copy.deepcopy(answer) for answer in pairs[0])
    (gauge,) = (row for row in one["budget"] if row["scope"] == "sensor 4")
    for document in (one, other):
        document["channels"] = [{"serial": "4", "certificate": "a", "calibrated": "2026-01-15"}]
    same = shared_kg2(one, other)
    assert same == shared_kg2(*pairs[0])
    other["channels"][0][key] = "another"
    (theirs,) = (row for row in other["budget"] if row["scope"] == "sensor 4")
    assert same - shared_kg2(one, other) == pytest.approx(gauge["u_kg"] * theirs["u_kg"])


def test_a_scale_in_pulses_is_one_error_whatever_certificate_was_found_at_rest() -> None:
    one, other = (answer(at_rest(campaign_of((0.0,) * 2, seed=seed).shots)) for seed in (1, 2))
    for document, day in ((one, "2026-01-15"), (other, "2027-01-15")):
        document["channels"] = [{"serial": "1", "certificate": "a", "calibrated": day}]
    with_dynamic = shared_kg2(one, other)
    rows = [next(row for row in of["budget"] if "dynamic scale" in row["source"]) for of in (one, other)]
    for document in (one, other):
        document["budget"] = [row for row in document["budget"] if "dynamic scale" not in row["source"]]
    assert with_dynamic - shared_kg2(one, other) == pytest.approx(rows[0]["u_kg"] * rows[1]["u_kg"])
    assert rows[0]["u_kg"] > 0.0


@pytest.mark.whole_way
def test_another_u_of_a_source_is_other_knowledge_and_opposite_signs_make_masses_differ_more(
    pairs: list[tuple[dict[str, Any], dict[str, Any]]],
) -> None:
    one, other = (copy.deepcopy(answer) for answer in pairs[0])
    (gauge,) = (row for row in other["budget"] if row["scope"] == "sensor 4")
    (own,) = (row for row in one["budget"] if row["scope"] == "sensor 4")
    whole, part = shared_kg2(one, other), own["u_kg"] * gauge["u_kg"]
    gauge["sensitivity_kg"] *= -1.0
    assert shared_kg2(one, other) == pytest.approx(whole - 2.0 * part)
    gauge["u_source"] *= 1.1
    assert shared_kg2(one, other) == pytest.approx(whole - part)


@pytest.mark.whole_way
def test_a_mass_that_changed_between_campaigns_is_told_in_a_sentence() -> None:
    before = answer(campaign_of((0.0, 120.0) * 2, seed=3).shots)
    after = copy.deepcopy(before)
    after["mass"]["value"] += 30.0
    history = history_of(before, after)
    assert history["agrees"] is False
    assert "differ by more than" in history["detail"]
    assert "spring" in history["detail"]
    assert history_of(before, before)["agrees"] is True
    document = {**after, "history": history}
    earlier, this = HISTORY.worded(document)
    assert (earlier["campaign"], this["campaign"]) == ("spring", THIS)
    assert history_again(history, after) == history
    figure = history_figure(document)
    assert figure is not None
    assert figure.names == ("spring", THIS)


@pytest.mark.whole_way
def test_one_that_is_not_compared_is_shown_and_counts_nothing() -> None:
    one = answer(campaign_of((0.0, 120.0) * 2, seed=3).shots)
    u = one["mass"]["u"]
    rows = [{**row_of(one, "spring"), "remark": "it is not valid"}, row_of(one, THIS)]
    history = history_document(rows, [[u**2]])
    assert history["p"] is None
    assert history["campaigns"][0]["E_n"] is None
    assert "No earlier campaign" in history["detail"]
    assert history_figure({**one, "history": history}) is not None
    assert HISTORY.worded({**one, "history": history})[0]["remark"] == "it is not valid"


@pytest.mark.whole_way
def test_a_campaign_that_is_not_valid_is_grey_in_its_own_history() -> None:
    one = answer(campaign_of((0.0, 120.0) * 2, seed=3).shots)
    rows, u = [row_of(one, "spring"), row_of(one, THIS)], one["mass"]["u"]
    history = history_document(rows, [[u**2, 0.0], [0.0, u**2]])
    for valid in (True, False):
        document = {**one, "valid": valid, "history": history}
        assert [row["aside"] for row in HISTORY.worded(document)] == [False, not valid]
        figure = history_figure(document)
        assert figure is not None
        names = [trace.name for trace in figure.panels[0].traces]
        assert ("not valid, or not compared" in names) is not valid


def test_without_a_history_there_is_neither_table_nor_figure() -> None:
    document = {"mass": {"value": MASS_KG}}
    assert HISTORY.worded(document) == []
    assert history_figure(document) is None
