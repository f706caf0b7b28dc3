"""How often the stated intervals hold the truth, over shots of the virtual rig: bias, scatter, coverage, RPE.

`RECOIL_DAQ_COVERAGE_SHOTS` sets how many shots of each rig are taken (40 by default; the published figures are
of 150). Two processes share them.
"""

from __future__ import annotations

import datetime as dt
import math
import os
import tempfile
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.monte_carlo import IntervalBy
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene, simulate_shot
from tests.builders.virtual_shots import with_twin

MOST_BIAS_OF_U = 0.2
"""Bias as a share of the stated u, once what the draws of these shots add up to is taken off."""
SHOTS = int(os.environ.get("RECOIL_DAQ_COVERAGE_SHOTS", "40"))
DRAWN = {"u_zero_rel": 0.001, "kind": False}
"""What is off besides scales, friction and the camera's picture: all that the bundled rigs draw, unread resistance, the
bore's friction, a line before the recuperator's gauge, zeros that move, a motion that is louder than the rest."""
STANDARD = {"u_standard_rel": 0.003}
"""In every third shot: all gauges were calibrated by one standard."""
FIRST_SEED = {"field-2013": 1001, "mixed": 5001}
PULSE_S = 0.012
"""From the onset: the breech drives."""


@dataclass(frozen=True)
class Outcome:
    """What one shot gave: mass, u, interval and RPE by method, and the share of the trace's band that holds.

    `drawn` are the sensors' true scale errors, the share of the resistance that is not read, by how much the bore takes
    off more than it is taken to, and the true friction.
    """

    valid: bool
    reasons: tuple[str, ...]
    truth_kg: float
    methods: Mapping[str, tuple[float, float, float, float, float]]
    in_pulse: tuple[int, int]
    in_brake: tuple[int, int]
    drawn: tuple[float, ...]
    bound_rel: float
    interval_by: IntervalBy


def outcome(name: str, seed: int, settings: Mapping[str, Any]) -> Outcome:
    """Simulate, ingest and identify one shot."""
    if settings == DRAWN and seed % 3 == 0:
        settings = {**settings, **STANDARD}
    rig = with_twin(name, **settings)
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=seed, shot="s")
        shot = ingest_files(rig, simulated.files, shot="s", out=Path(folder) / "shots", on=dt.date(2026, 6, 1)).shot
    found = identify_shot(FiredShot(shot, rig), Options())
    truth = float(simulated.truth["m3"])
    methods = {}
    for method, result in found.results.items():
        e = result.estimate
        interval = found.interval_kg if method == found.route.method else e.interval_kg
        methods[method] = (e.mass_kg, e.u_kg, *interval, result.rpe_percent)
    trace = found.chosen.trace
    holds = np.abs(trace.mass_kg - truth) <= COVERAGE_FACTOR * trace.u_kg
    since = trace.times_s - float(simulated.truth["t_fire"])
    pulse, brake = trace.identified & (since < PULSE_S), trace.identified & (since >= PULSE_S)
    return Outcome(
        found.valid,
        found.reasons,
        truth,
        methods,
        (int(holds[pulse].sum()), int(pulse.sum())),
        (int(holds[brake].sum()), int(brake.sum())),
        (
            *(gain - 1.0 for _, gain in sorted(simulated.truth["gains"].items())),
            float(simulated.truth.get("unread", {}).get("share", 0.0)),
            float(simulated.truth["bore_friction"]) - rig.mechanism.bore_friction,
            float(simulated.truth["friction"]),
        ),
        cramer_rao_bound(name, seed, settings),
        found.interval_by,
    )


def cramer_rao_bound(name: str, seed: int, settings: Mapping[str, Any]) -> float:
    """Least relative standard deviation of any unbiased mass, from the white noise of all sensors alone.

    With a' and F' seen in white noise at the same instants the information of the mass is that of
    ``a = F / m`` with both noises on one side: ``m^2 var = (s_a^2 + s_F^2 / m^2) / sum a'^2``, in units of m.
    """
    rig = with_twin(name, **settings)
    scene = draw_scene(rig, seed, "s")
    m, motion, noise = scene.mechanism, scene.motion, scene.settings.noise
    moving = (motion.times_s >= motion.t_fire_s) & (motion.times_s <= motion.t_end_s)
    acceleration = (m.bore_area * motion.breech_pressure_pa - motion.resistance_n(m))[moving] / m.m3
    rate_hz = 1.0 / float(motion.times_s[1] - motion.times_s[0])
    areas = {"breech_pressure": m.bore_area, "brake_pressure": m.brake_area, "recuperator_pressure": m.recuperator_area}
    density = 0.0
    for channel in rig.channels:
        if channel.role not in (*areas, "recoil_acceleration") or channel.sensor.range is None:
            continue
        factor = {"MPa": 1e6}.get(channel.unit, 1.0)
        sigma = (
            noise * factor * max(abs(limit) for limit in channel.sensor.range) * areas.get(channel.role, m.m3) / m.m3
        )
        kind = rig.source(channel.source).kind
        own_hz = {"can": scene.settings.can_rate_hz, "serial": scene.settings.serial_rate_hz}.get(kind, rate_hz)
        density += sigma**2 / own_hz
    return math.sqrt(density * rate_hz / float(acceleration @ acceleration))


def all_of(name: str, settings: Mapping[str, Any], count: int) -> list[Outcome]:
    first = FIRST_SEED[name]
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(
            pool.map(outcome, [name] * count, range(first, first + count), [dict(settings)] * count, chunksize=2)
        )


def without_luck(error: np.ndarray, drawn: np.ndarray) -> tuple[float, float]:
    """Mean error had the draws of the sensors a mean of zero, and its standard deviation: what is linear taken off."""
    moved = drawn[:, np.ptp(drawn, axis=0) > 0]
    table = np.column_stack([np.ones(error.size), moved / moved.std(axis=0)])
    if error.size < 2 * table.shape[1]:
        # too few shots to tell the draws' part from the rest
        return float(error.mean()), float(error.std(ddof=1)) / math.sqrt(error.size)
    coefficients, *_ = np.linalg.lstsq(table, error, rcond=None)
    residual = error - table @ coefficients
    variance = float(residual @ residual) / (error.size - table.shape[1])
    return float(coefficients[0]), math.sqrt(variance * float(np.linalg.inv(table.T @ table)[0, 0]))


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_stated_interval_holds_the_true_mass(benchmark, capsys, name):
    outcomes = benchmark.pedantic(lambda: all_of(name, DRAWN, SHOTS), rounds=1, warmup_rounds=0)
    table: dict[str, tuple] = {}
    friction_n = with_twin(name).mechanism.friction
    for method in outcomes[0].methods:
        present = [o for o in outcomes if method in o.methods]
        mass, u, low, high, rpe = np.array([o.methods[method] for o in present]).T
        true = np.array([o.truth_kg for o in present])
        error = 100 * (mass / true - 1)
        covered = np.mean((low <= true) & (true <= high))
        # the friction about its declaration: what was drawn is centred at what the sensors are taken for
        drawn = np.array([o.drawn for o in present]) - [*[0.0] * (len(present[0].drawn) - 1), friction_n]
        fair = without_luck(error, drawn)
        table[method] = (
            error.mean(),
            fair,
            error.std(ddof=1),
            np.mean(100 * u / mass),
            covered,
            rpe.mean(),
            len(present),
        )
    valid = sum(o.valid for o in outcomes)
    in_trace = [tuple(np.sum([getattr(o, f"in_{phase}") for o in outcomes], axis=0)) for phase in ("pulse", "brake")]
    with capsys.disabled():
        seconds = benchmark.stats.stats.min / SHOTS
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {seconds:.2f} s each to simulate, ingest and identify")
        print(
            f"{'method':12} {'bias %':>8} {'u(bias)':>8} {'fair %':>8} {'u(fair)':>8} {'sd %':>7} {'mean u %':>9} "
            f"{'coverage':>9} {'RPE %':>7} {'shots':>6}"
        )
        for method, (bias, (fair, u_fair), sd, u, covered, rpe, count) in table.items():
            spread = sd / math.sqrt(count)
            print(
                f"{method:12} {bias:+8.3f} {spread:8.3f} {fair:+8.3f} {u_fair:8.3f} {sd:7.3f} {u:9.3f} "
                f"{covered:9.3f} {rpe:7.3f} {count:6d}"
            )
        hits = round(table["calibrated"][4] * table["calibrated"][6])
        low, high = stats.binomtest(hits, table["calibrated"][6]).proportion_ci(method="exact")
        z = [(o.methods["calibrated"][0] - o.truth_kg) / o.methods["calibrated"][1] for o in outcomes]
        print(
            f"calibrated: {hits} of {table['calibrated'][6]} intervals hold the truth (exact 95 % interval of the "
            f"share {low:.3f} to {high:.3f}), root mean square of error over u {np.sqrt(np.mean(np.square(z))):.3f}"
        )
        by = Counter(o.interval_by for o in outcomes)
        print(f"intervals: {', '.join(f'{count} by {one}' for one, count in sorted(by.items()))}")
        far = np.mean([abs(o.methods["calibrated"][0] / o.truth_kg - 1) > 0.005 for o in outcomes])
        print(f"calibrated is off by more than 0.5 % in {100 * far:.0f} % of the shots")
        print("fair: the bias without what the sensors' draws of these very shots add up to")
        (pulse, n_pulse), (brake, n_brake) = in_trace
        print(
            f"trace's 95 % band holds in {pulse / n_pulse:.3f} of the pulse's samples, "
            f"{brake / n_brake:.3f} of the brake's"
        )
        for reason in sorted({reason[:110] for o in outcomes for reason in o.reasons}):
            print("not valid:", reason)
    bias, (fair, u_fair), _, u, covered, rpe, count = table["calibrated"]
    # linear in ln m: the draws of JCGM 101 seldom disagree with the GUM there
    assert np.mean([o.interval_by is IntervalBy.MONTE_CARLO for o in outcomes]) < 0.25
    assert count == SHOTS
    assert low <= 0.95 <= high
    assert abs(bias) < 0.25
    # a sixth of u was left of 150 shots of field-2013, and no cause of it was found
    assert abs(fair) < MOST_BIAS_OF_U * u + 2 * u_fair
    # of so many shots the mean square is known to some per cent: what it may be lies between 0.9 and 1.1 squared
    total = float(np.sum(np.square(z)))
    least, most = (total / stats.chi2.ppf(share, SHOTS) for share in (0.975, 0.025))
    assert least <= 1.1**2
    assert most >= 0.9**2
    assert rpe < 1.0
    assert valid >= 0.9 * SHOTS


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_random_error_is_near_its_bound(benchmark, capsys, name):
    exact = {"gain_errors": False, "friction_error": False}
    count = max(20, SHOTS // 3)
    with_waves, without = benchmark.pedantic(
        lambda: [all_of(name, exact | waves, count) for waves in ({}, {"ringing": 0.0})], rounds=1, warmup_rounds=0
    )
    with capsys.disabled():
        print(f"\n{name}, {count} shots with exact sensors, random errors only")
        print(f"{'method':12} {'waves':>6} {'bias %':>9} {'sd %':>8} {'bound %':>8} {'ratio':>6}")
        for label, outcomes in (("yes", with_waves), ("none", without)):
            bound = 100 * float(np.mean([o.bound_rel for o in outcomes]))
            for method in (
                "reverse",
                "calibrated",
                *(m for m in outcomes[0].methods if m not in ("reverse", "calibrated")),
            ):
                error = np.array(
                    [100 * (o.methods[method][0] / o.truth_kg - 1) for o in outcomes if method in o.methods]
                )
                sd = error.std(ddof=1)
                print(f"{method:12} {label:>6} {error.mean():+9.4f} {sd:8.4f} {bound:8.4f} {sd / bound:6.2f}")
    error = np.array([o.methods["reverse"][0] / o.truth_kg - 1 for o in without])
    assert error.std(ddof=1) < 2.0 * np.mean([o.bound_rel for o in without])
