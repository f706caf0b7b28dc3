"""Campaigns: how often the joint interval holds the truth, and what is found of what was planted.

`RECOIL_DAQ_CAMPAIGNS` sets how many whole campaigns go through simulation, ingest and identification (8 by default; the
published figures are of 40), half of them with 120 kg on every second shot. Their shots are then fired again many
times over (`RECOIL_DAQ_REPLAYS`, 60 by default; published 300): a campaign is put together of shots of all campaigns of
its rig, each at its own place, the errors that the virtual rig had drawn for what shots share are taken out of their
summaries, and others, drawn here, are put in. What is a shot's own is not drawn anew: its mean over the few shots that
were fired is in all replays of a rig, and is luck, as `own_part` says; so replays are judged about their mean as well.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binomtest, chi2

from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.fired import read_fired
from recoil_identification.analysis import Options, identify_shot
from recoil_identification.camera_rows import OTHER
from recoil_identification.campaign.campaign import Campaign, combine
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.inference.solve import solve
from recoil_identification.sensor_priors import DISTORTIONS
from recoil_rigs.rig import Rig
from recoil_rigs.twin import CampaignPlan
from tests.builders.campaigns import CHARGES, fire_campaign

Array = NDArray[np.float64]

CAMPAIGNS = int(os.environ.get("RECOIL_DAQ_CAMPAIGNS", "8"))
REPLAYS = int(os.environ.get("RECOIL_DAQ_REPLAYS", "60"))
SHOTS, ADDED_KG, CUTOFF_HZ = 8, 120.0, 250.0
RIGS = ("mixed", "field-2013")
SCATTER = 0.03
"""Of the friction from shot to shot."""
FIRST_SEED = 7101
LEAST_OWN = 8
"""Shots of a kind, for their scatter to mean anything."""
ROLES = ("breech_pressure", "brake_pressure", "recuperator_pressure", "recoil_acceleration")


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark of minutes: ask for it with --benchmark-enable")


@dataclass(frozen=True)
class Fired:
    """A campaign that went through the whole pipeline; `errors` are the true ones of each shot's shared parameters.

    The mass is that without anything added, `added_kg` what was truly added.
    """

    rig: str
    ringed: bool
    shots: tuple[CampaignShot, ...]
    errors: tuple[Mapping[str, float], ...]
    mass_kg: float
    added_kg: tuple[float, ...]


def fired(number: int, shots: int = SHOTS) -> Fired:
    """Simulate, ingest and identify one campaign."""
    name, ringed = RIGS[number % 2], number // 2 % 2 == 1
    plan = CampaignPlan(
        added_mass_kg=ADDED_KG if ringed else None,
        charges=CHARGES if ringed else (1.0, 0.8, 0.65, 0.9),
        friction_scatter=SCATTER,
    )
    with tempfile.TemporaryDirectory() as folder:
        campaign = fire_campaign(Path(folder), plan, name=name, shots=shots, campaign_seed=FIRST_SEED + number)
        log, taken, errors = ShotLog.read(campaign.log), [], []
        for file, truth in zip(campaign.files, campaign.truths, strict=True):
            shot = read_fired(file)
            found = identify_shot(shot.shot, shot.rig, Options(mass_cutoff_hz=CUTOFF_HZ))
            row = log.row(shot.shot.name)
            assert row is not None
            taken.append(
                CampaignShot(
                    shot.shot.name, shot.shot.rig_name, None, found.chosen.estimate.mass_kg,
                    found.chosen.estimate.u_kg, found.summary, cutoff_hz=CUTOFF_HZ,
                    added_mass_kg=row.added_mass_kg, u_added_mass_kg=row.u_added_mass_kg,
                )
            )  # fmt: skip
            errors.append(true_errors(campaign.rig, truth))
    added = tuple(float(truth["added_mass_kg"]) for truth in campaign.truths)
    return Fired(name, ringed, tuple(taken), tuple(errors), campaign.truths[0]["m3"] - added[0], added)


def true_errors(rig: Rig, truth: Mapping[str, object]) -> dict[str, float]:
    """Return what the shared parameters of a shot truly were."""
    gains, friction, moves = truth["gains"], truth["friction"], truth["moves"]
    assert isinstance(gains, dict)
    assert isinstance(moves, dict)
    assert isinstance(friction, float)
    camera, carriage = (rig.with_role(role)[0].name for role in ("recoil_displacement", "carriage_acceleration_x"))
    found = {f"ln {role}": math.log(gains[rig.with_role(role)[0].name]) for role in ROLES}
    found["ln camera"] = math.log(gains[camera])
    found["friction share"] = 1.0 - friction / rig.mechanism.friction
    found[OTHER.name] = gains[carriage] - 1.0
    return found | dict(zip(DISTORTIONS, (moves[camera]["bow_m"], moves[camera]["s_m"]), strict=True))


@cache
def campaigns() -> tuple[Fired, ...]:
    """Fire them all, two at a time."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return tuple(pool.map(fired, range(CAMPAIGNS)))


def naive(shots: Sequence[CampaignShot]) -> tuple[float, float]:
    """Return the weighted mean of the single masses, as if they were independent, and what it states."""
    weights = np.array([1.0 / shot.u_kg**2 for shot in shots])
    masses = np.array([shot.mass_kg - shot.added_mass_kg for shot in shots])
    return float(masses @ weights / weights.sum()), float(weights.sum() ** -0.5)


def replayed(
    number: int,
    *,
    ringed: bool,
    gain_rel: float = 0.0,
    step_kg: float = 0.0,
    moved: Callable[[int], Mapping[str, float]] = lambda _: {},
) -> tuple[tuple[CampaignShot, ...], float]:
    """Fire the shots of one of the campaigns again with calibrations drawn anew; return them and the true mass.

    Parameters
    ----------
    step_kg
        By which the mass rises at the fifth shot.
    moved
        By how much parameters of a shot, counted from 0, are off besides.
    """
    rng = np.random.default_rng([91, number])
    bases = [one for one in campaigns() if one.ringed == ringed and one.rig == RIGS[number % 2]]
    errors = {name: u * rng.standard_normal() for name, u in stated(bases[0].shots[0]).items()}
    off_kg = bases[0].shots[-1].u_added_mass_kg * rng.standard_normal()
    mass_kg, shots = bases[0].mass_kg, []
    for i, name in enumerate(shot.name for shot in bases[0].shots):
        base = bases[rng.integers(len(bases))]
        shot, summary = base.shots[i], base.shots[i].summary
        assert summary is not None
        reference = np.array(summary.reference)
        places = {one.name: at for at, one in enumerate(summary.parameters)}
        for parameter, was in base.errors[i].items():
            if parameter not in places:
                continue
            own = gain_rel * rng.standard_normal() if parameter[3:] in ROLES else 0.0
            own += SCATTER * rng.standard_normal() if parameter == "friction share" else 0.0
            reference[places[parameter]] += errors[parameter] + own - was + moved(i).get(parameter, 0.0)
        whole_kg = mass_kg + (shot.added_mass_kg + off_kg if shot.added_mass_kg else 0.0)
        whole_kg += step_kg if i >= SHOTS // 2 else 0.0
        reference[0] += math.log(whole_kg / (base.mass_kg + base.added_kg[i]))
        shots.append(replace(shot, name=name, summary=replace(summary, reference=reference)))
    return tuple(shots), mass_kg


def stated(shot: CampaignShot) -> dict[str, float]:
    """Return what certificates say that the shared parameters of a shot may be off by."""
    assert shot.summary is not None
    return {one.name: math.hypot(*(u for _, u in one.influences)) for one in shot.summary.parameters}


def own_errors(one: Fired) -> list[tuple[float, float]]:
    """Return by how much each shot's mass is off where all that shots share is as it truly was, and its u; relative.

    Only the release is not known: the virtual rig draws none.
    """
    found = []
    for shot, errors, added_kg in zip(one.shots, one.errors, one.added_kg, strict=True):
        summary = shot.summary
        assert summary is not None
        names = [parameter.name for parameter in summary.parameters]
        true = np.array([errors.get(name, 0.0) for name in names])
        true[0] = math.log(one.mass_kg + added_kg)
        free = [0, names.index("release")]
        rows = np.vstack([summary.triangle[:, free], [0.0, 1.0]])
        left = np.append(summary.seen - summary.triangle @ (true - summary.reference), 0.0)
        covariance = np.linalg.inv(rows.T @ rows)
        found.append((float((covariance @ rows.T @ left)[0]), math.sqrt(covariance[0, 0])))
    return found


def single(shot: CampaignShot) -> CampaignShot:
    """Return a replayed shot with the mass that it gives by itself."""
    rows = JointRows.of([shot], {shot.configuration: "m"}).whitened(Scatter())
    found, name = solve(rows.rows.all_unknowns, [rows], rows.rows.priors), rows.rows.masses[0]
    mass_kg = rows.rows.reference_kg * math.exp(found.value(name))
    return replace(shot, mass_kg=mass_kg + shot.added_mass_kg, u_kg=mass_kg * found.u(name))


def own_part() -> list[str]:
    """Say how the shots' own errors agree with what is stated of them, each kind of shot about its own mean."""
    squares, freedom, lines = 0.0, 0, []
    for rig in RIGS:
        for heavy in (False, True):
            own = [
                error
                for one in campaigns()
                if one.rig == rig
                for error, shot in zip(own_errors(one), one.shots, strict=True)
                if (shot.added_mass_kg > 0) == heavy
            ]
            if len(own) < LEAST_OWN:
                continue
            error, u = np.array(own).T
            squares += float(np.sum((error / u - np.mean(error / u)) ** 2))
            freedom += error.size - 1
            mean, scatter = 100 * error.mean(), 100 * error.std(ddof=1)
            lines.append(
                f"    {rig}, {ADDED_KG if heavy else 0:g} kg added: {error.size} shots, mean {mean:+.4f} % (u "
                f"{scatter / math.sqrt(error.size):.4f} %), scatter {scatter:.4f} %, stated {100 * u.mean():.4f} %"
            )
    low, high = (math.sqrt(squares / chi2.ppf(p, freedom)) for p in (0.975, 0.025))
    ratio = math.sqrt(squares / freedom)
    head = f"  own part of a shot, what is shared known: scatters by {ratio:.2f} of u (95 %: {low:.2f} to {high:.2f})"
    return [head, *lines]


def report(capsys: pytest.CaptureFixture[str], *lines: str) -> None:
    with capsys.disabled():
        print("", *lines, sep="\n")


def share(hits: int, count: int) -> str:
    low, high = binomtest(hits, count).proportion_ci(0.95, "exact")
    return f"{hits} of {count} ({hits / count:.3f}, 95 %: {low:.3f} to {high:.3f})"


def judged(found: Sequence[tuple[float, float, float]]) -> tuple[str, int, float, float]:
    """Say how masses, their u and the truth agree; return hits, rms z, and the rms error in percent."""
    mass, u, true = np.array(found).T
    z, error = (mass - true) / u, 100 * (mass / true - 1)
    hits, rms = int(np.sum(np.abs(z) <= 1.96)), float(np.sqrt(np.mean(z**2)))
    text = (
        f"u {np.mean(100 * u / mass):.3f} %, bias {error.mean():+.3f} %, rms error {np.sqrt(np.mean(error**2)):.3f} %, "
        f"rms z {rms:.2f}, holds {share(hits, z.size)}"
    )
    return text, hits, rms, float(np.sqrt(np.mean(error**2)))


def centred(found: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Take the mean error of the replays of each rig off their masses."""
    mass, u, true = np.array(found).T
    for rig in range(len(RIGS)):
        of_rig = slice(rig, None, len(RIGS))
        mass[of_rig] -= np.mean(mass[of_rig] - true[of_rig])
    return list(zip(mass.tolist(), u.tolist(), true.tolist(), strict=True))


def test_whole_campaigns_hold_the_truth(capsys):
    lines = [f"{CAMPAIGNS} whole campaigns of {SHOTS} shots"]
    hits = count = 0
    for ringed, text in ((False, "plain"), (True, f"{ADDED_KG:g} kg on every second shot")):
        of_kind = [one for one in campaigns() if one.ringed == ringed]
        answers = [(combine(one.shots), one) for one in of_kind]
        joint = [(found.mass.mass_kg, found.mass.u_kg, one.mass_kg) for found, one in answers]
        said, right, _, _ = judged(joint)
        lines += [f"  {text}: joint {said}"]
        lines += [f"  {text}: weighted mean {judged([(*naive(one.shots), one.mass_kg) for one in of_kind])[0]}"]
        alarms = [str(change) for found, _ in answers for change in found.changes]
        lines += [f"  {text}: {len(alarms)} false alarms {alarms}, {sum(not f.valid for f, _ in answers)} not valid"]
        lines += [f"    {reason}" for found, _ in answers for reason in found.reasons]
        hits, count = hits + right, count + len(of_kind)
    single = [(shot.mass_kg - shot.added_mass_kg, shot.u_kg, one.mass_kg) for one in campaigns() for shot in one.shots]
    lines += [f"  single shots: {judged(single)[0]}", f"  joint, both kinds: {share(hits, count)}"]
    lines += own_part()
    report(capsys, *lines)
    low, high = binomtest(hits, count).proportion_ci(0.95, "exact")
    assert low <= 0.95 <= high


@dataclass(frozen=True)
class Replays:
    """Masses, their u and the truth, of campaigns and of weighted means; the scatter found, and false alarms."""

    joint: list[tuple[float, float, float]]
    mean: list[tuple[float, float, float]]
    scatter: list[float]
    alarms: int


def combined(count: int, *, ringed: bool, gain_rel: float = 0.0) -> Replays:
    """Fire that many campaigns again, and combine each."""
    joint, mean, scatter, alarms = [], [], [], 0
    for number in range(count):
        shots, true = replayed(number, ringed=ringed, gain_rel=gain_rel)
        found = combine(shots)
        joint.append((found.mass.mass_kg, found.mass.u_kg, true))
        mean.append((*naive([single(shot) for shot in shots]), true))
        scatter.append(found.gain_scatter[0])
        alarms += bool(found.changes)
    return Replays(joint, mean, scatter, alarms)


@pytest.mark.parametrize("ringed", [False, True])
@pytest.mark.parametrize("gain_rel", [0.0, 5e-4, 1e-3])
def test_replayed_campaigns_hold_the_truth(capsys, ringed, gain_rel):
    replays = combined(REPLAYS, ringed=ringed, gain_rel=gain_rel)
    joint, mean, scatter, alarms = replays.joint, replays.mean, replays.scatter, replays.alarms
    said = judged(joint)[0]
    about_mean, hits, _, rms_error = judged(centred(joint))
    report(
        capsys,
        f"{REPLAYS} replays, {'with' if ringed else 'without'} {ADDED_KG:g} kg, gains repeat to {100 * gain_rel:g} %: ",
        f"  joint {said}",
        f"  about the mean of a rig's replays: {about_mean}",
        f"  weighted mean {judged(mean)[0]}",
        f"  scatter of gains found {100 * np.mean(scatter):.3f} %, false alarms {share(alarms, REPLAYS)}",
    )
    high = binomtest(hits, REPLAYS).proportion_ci(0.95, "exact")[1]
    # a scatter that eight shots must tell as well is not as sure
    assert high >= 0.95 if gain_rel == 0 else hits >= 0.9 * REPLAYS
    assert binomtest(alarms, REPLAYS).proportion_ci(0.95, "exact")[0] <= 0.05
    if ringed and not gain_rel:
        assert rms_error <= 0.25


def drifting(name: str, size: float) -> Callable[[int], Mapping[str, float]]:
    return lambda i: {name: size * i / (SHOTS - 1)}


def apart(name: str, size: float) -> Callable[[int], Mapping[str, float]]:
    return lambda i: {name: size} if i == 3 else {}


PLANTED: tuple[tuple[str, str, float, Callable[[int], Mapping[str, float]], str, float], ...] = (
    ("-4 kg at shot 5", "mass step", -4.0, lambda _: {}, "mass", 0.95),
    ("-2 kg at shot 5, or a shot beside", "mass step", -2.0, lambda _: {}, "mass", 0.85),
    ("breech drifts by 1 %", "sensor drift", 0.0, drifting("ln breech_pressure", 0.01), "breech_pressure", 0.9),
    # what eight shots tell of the brake's drift is uncertain by 0.3 %: such a one is at the limit
    ("brake drifts by 1 %", "sensor drift", 0.0, drifting("ln brake_pressure", 0.01), "brake_pressure", 0.0),
    ("brake drifts by 2 %", "sensor drift", 0.0, drifting("ln brake_pressure", 0.02), "brake_pressure", 0.9),
    ("breech of shot 4 off by 1 %", "outlier", 0.0, apart("ln breech_pressure", 0.01), "breech_pressure", 0.9),
)


@pytest.mark.parametrize("ringed", [False, True])
@pytest.mark.parametrize(("what", "kind", "step_kg", "moved", "influence", "least"), PLANTED)
def test_what_was_planted_is_found(capsys, ringed, what, kind, step_kg, moved, influence, least):
    found = named = 0
    sizes = []
    for number in range(REPLAYS):
        shots, _ = replayed(number, ringed=ringed, step_kg=step_kg, moved=moved)
        changes = combine(shots).changes
        found += bool(changes)
        right = [one for one in changes[:1] if one.kind == kind and one.influence.startswith(influence)]
        # the shot at which a step of three of a shot's own u begins is told to one
        near = 1 if "beside" in what else 0
        at = {shot.name: abs(i - SHOTS // 2) for i, shot in enumerate(shots)}
        placed = [one for one in right if kind != "mass step" or at[one.shots[0]] <= near]
        named += bool(placed)
        sizes += [(one.size, one.u) for one in placed]
    true = step_kg or float(what.split()[-2]) / 100
    size, u = np.array(sizes).T if sizes else (np.zeros(1), np.ones(1))
    report(
        capsys,
        f"{what}, {'with' if ringed else 'without'} {ADDED_KG:g} kg: found {share(found, REPLAYS)}, named first and "
        f"rightly {share(named, REPLAYS)}",
        f"  size {size.mean():.4g}, u {u.mean():.2g}, rms z {np.sqrt(np.mean(((size - true) / u) ** 2)):.2f}",
    )
    assert binomtest(named, REPLAYS).proportion_ci(0.95, "exact")[1] >= least


def test_a_declared_exchange_is_no_alarm_and_the_difference_is_sure(capsys):
    found, alarms = [], 0
    for number in range(REPLAYS):
        shots, _ = replayed(number, ringed=False, step_kg=-6.0)
        told = tuple(
            replace(shot, configuration="before" if i < SHOTS // 2 else "after") for i, shot in enumerate(shots)
        )
        answer: Campaign = combine(told)
        difference = answer.mechanisms[1].difference
        assert difference is not None
        found.append((difference.mass_kg, difference.u_kg))
        alarms += bool(answer.changes)
    size, u = np.array(found).T
    report(
        capsys,
        f"an exchange of -6 kg that was declared: {size.mean():.2f} kg, u {u.mean():.2f} kg, rms z "
        f"{np.sqrt(np.mean(((size + 6.0) / u) ** 2)):.2f}, alarms {share(alarms, REPLAYS)}",
    )
    assert u.mean() <= 0.4
    assert binomtest(alarms, REPLAYS).proportion_ci(0.95, "exact")[0] <= 0.05
