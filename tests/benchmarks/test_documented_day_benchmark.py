"""The documented day, lived many times: how often its campaign is valid, and how often it holds the truth.

`RECOIL_DAQ_DAYS` sets how many days of eight shots are lived (12 by default; the published figures are of 60), each
with noise and sensors of its own, `RECOIL_DAQ_LONG_DAYS` how many of 32 (2; published 10). Two processes share them.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from functools import cache
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest, chi2

from recoil_acquisition.errors import IdentificationError
from recoil_daq.campaigns.prediction import predict
from recoil_identification.campaign.campaign import Campaign
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_rigs.rig import load_rig
from tests.builders.documented_days import KINDS, RIGS, SHOTS, Day, LivedDay, days, live
from tests.builders.planted_changes import CHANGES
from tests.builders.shares import share

DAYS = int(os.environ.get("RECOIL_DAQ_DAYS", "12"))
LONG_DAYS = int(os.environ.get("RECOIL_DAQ_LONG_DAYS", "2"))
NESTED = (2, 4, 6, SHOTS)
LONG = 32
LEAST_VALID, COVERAGE, RMS_Z = 0.95, (0.90, 0.99), (0.85, 1.15)
"""Share of days that are valid at least, that hold the truth, and the rms of error over u, of 60 days."""


def _live(day: Day) -> LivedDay:
    with tempfile.TemporaryDirectory() as folder:
        return live(day, Path(folder))


def lived(planned: Sequence[Day]) -> tuple[LivedDay, ...]:
    """Live days, two at a time."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return tuple(pool.map(_live, planned))


@cache
def documented() -> tuple[LivedDay, ...]:
    return lived(days(DAYS))


@cache
def long_days() -> tuple[LivedDay, ...]:
    return lived([Day(RIGS[k % 2], "plain", 301 + k, shots=LONG, shorter=True) for k in range(LONG_DAYS)])


def scores(of: Sequence[LivedDay]) -> tuple[int, int, float]:
    """Return how many are valid, how many hold the truth, and the rms of error over u."""
    mass, u, true = np.array([one.judged for one in of]).T
    z = (mass - true) / u
    return sum(bool(one.answer["valid"]) for one in of), int(np.sum(np.abs(z) <= 1.96)), float(np.sqrt(np.mean(z**2)))


def line(what: str, of: Sequence[LivedDay]) -> str:
    valid, held, rms = scores(of)
    u = np.mean([100 * one.judged[1] / one.judged[2] for one in of])
    return f"  {what}: {valid} of {len(of)} valid, {share(held, len(of))} hold, rms z {rms:.2f}, u {u:.3f} %"


def report(capsys: pytest.CaptureFixture[str], *lines: str) -> None:
    with capsys.disabled():
        print("", *lines, sep="\n")


def plausible(successes: int, count: int, low: float, high: float = 1.0) -> bool:
    """Return whether a share between these bounds is in what so many tries leave possible."""
    least, most = binomtest(successes, count).proportion_ci(0.95, "exact")
    return least <= high and most >= low


def test_the_documented_day_is_valid_and_holds_the_truth(capsys):
    lines = [f"{DAYS} days of {SHOTS} shots"]
    lines += [line(rig, of) for rig in RIGS if (of := [one for one in documented() if one.day.rig == rig])]
    lines += [line(kind, of) for kind in KINDS if (of := [one for one in documented() if one.day.kind == kind])]
    lines += [line("all", documented())]
    lines += [
        f"    {one.day.rig}, {one.day.kind}, seed {one.day.campaign_seed}: {reason}"
        for one in documented()
        for reason in one.answer["reasons"]
    ]
    report(capsys, *lines)
    valid, held, rms = scores(documented())
    if DAYS >= 60:
        assert valid >= LEAST_VALID * DAYS
        assert COVERAGE[0] <= held / DAYS <= COVERAGE[1]
        assert RMS_Z[0] <= rms <= RMS_Z[1]
    assert plausible(valid, DAYS, LEAST_VALID)
    assert plausible(held, DAYS, *COVERAGE)
    low, high = (np.sqrt(chi2.ppf(p, DAYS) / DAYS) for p in (0.025, 0.975))
    assert RMS_Z[0] / high <= rms <= RMS_Z[1] / low
    # the README's own
    assert all(one.answer["valid"] for one in documented() if one.day.campaign_seed < 101)


def first(shots: Sequence[CampaignShot], count: int) -> Campaign | None:
    """Combine the first shots of a day; None where fewer than two of them can be used."""
    with suppress(IdentificationError):
        return combine(shots[:count])
    return None


@cache
def nested() -> list[dict[int, Campaign | None]]:
    """Combine the first shots of each day, and of each long one."""
    found = [{n: first(one.shots, n) for n in NESTED} for one in documented()]
    return found + [{n: first(one.shots, n) for n in (*NESTED, 12, LONG)} for one in long_days()]


def test_a_day_does_not_become_less_valid_by_more_shots(capsys):
    for n in (*NESTED, 12, LONG):
        of = [one[n] for one in nested() if n in one]
        valid = sum(one is not None and one.valid for one in of)
        tried = [one.constancy for one in of if one is not None and one.constancy is not None]
        changing = sum(not one.constant for one in tried)
        report(capsys, f"  {n} shots: {valid} of {len(of)} valid, {changing} called changing")
        assert plausible(valid, len(of), LEAST_VALID)
        assert changing == 0 or n < LONG


def test_nested_answers_differ_by_no_more_than_the_shots_between_allow(capsys):
    z = []
    for answers in nested():
        for fewer, more in pairwise(NESTED):
            if (one := answers[fewer]) is None or (other := answers[more]) is None:
                continue
            before, after = one.mass, other.mass
            # a best estimate's change is independent of it (J. A. Hausman, Econometrica 46, 1978)
            apart = np.sqrt(max(before.u_kg**2 - after.u_kg**2, 0.0) + (0.02 * after.u_kg) ** 2)
            z.append((before.mass_kg - after.mass_kg) / apart)
    within = int(np.sum(np.abs(z) <= 2.0))
    report(
        capsys, f"  nested answers: {share(within, len(z))} within 2 sigma, rms {np.sqrt(np.mean(np.square(z))):.2f}"
    )
    assert plausible(within, len(z), 0.95)


@pytest.mark.parametrize("rig", RIGS)
def test_what_a_day_states_was_predicted(capsys, rig):
    ratios = []
    for kind in KINDS:
        of = [one for one in documented() if (one.day.rig, one.day.kind) == (rig, kind)]
        if not of:
            continue
        told = predict(load_rig(rig), shots=SHOTS, plan=of[0].day.plan).document
        added_kg = KINDS[kind][0] or 0.0
        (u_rel,) = (
            one["u_rel"] for one in told["campaign"] if (one["shots"], one["added_mass_kg"]) == (SHOTS, added_kg)
        )
        stated = [one.judged[1] / one.judged[0] for one in of]
        ratios += [u_rel / one for one in stated]
        report(capsys, f"  {rig}, {kind}: predicted u {100 * u_rel:.3f} %, stated {100 * np.mean(stated):.3f} %")
    report(capsys, f"  {rig}: predicted over stated {np.mean(ratios):.3f}")
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("what", CHANGES)
def test_what_goes_wrong_on_a_day_is_found(capsys, what):
    plant, told = CHANGES[what]
    of = [one for one in documented() if KINDS[one.day.kind][0] == 120.0]
    answers = [combine(plant(one.shots)) for one in of]
    named, spoken = sum(map(told, answers)), sum(bool(found.reasons or found.changes) for found in answers)
    report(capsys, f"  {what}: named in {named} of {len(of)} days, something said in {spoken}")
    assert plausible(named, len(of), 0.9)
