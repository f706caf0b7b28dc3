"""ARX models: coverage of the target over shots of the virtual rig, and speed and drift of the estimators."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from recoil_daq.ingest import ingest_files
from recoil_identification.arx.estimation import arx_regressors, estimate_arx
from recoil_identification.arx.model import ArxOrders
from recoil_identification.arx.orders import compare_orders, order_grid
from recoil_identification.arx.recursive import finite_history_arx, forgetting_arx
from recoil_identification.targets.arx import find
from recoil_identification.targets.target import Case
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.arx_systems import SECOND_ORDER, arx_output, arx_record

SHOTS = 20
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""
ORDERS = ArxOrders(2, 1, 1)
TRUE = np.array([-1.5, 0.7, 1.0, 0.5])

# processor time: what else the machine does is no part of the figures
pytestmark = pytest.mark.benchmark(timer=process_time)


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark of minutes: ask for it with --benchmark-enable")


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_intervals_of_the_target_hold_the_true_mass(benchmark, capsys, tmp_path: Path, name):
    rig = load_rig(name)
    cases, truths = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shot = ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot
        cases.append(Case(shot, rig))
        truths.append(simulated.truth["m3"])
        for file in simulated.files:
            file.unlink()
    for case in cases:
        assert case.identified  # its time is not the target's

    findings = benchmark.pedantic(lambda: [find(case) for case in cases], rounds=1, warmup_rounds=0)

    true = np.array(truths)
    valid = sum(found.valid for found in findings)
    white, independent, fit = (
        np.array([found.parameters[key] for found in findings])
        for key in ("whiteness_p", "independence_p", "fit_percent")
    )
    covered = {}
    with capsys.disabled():
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.2f} s each beyond the mass")
        print(f"{'quantity':16} {'bias %':>8} {'sd %':>7} {'mean u %':>9} {'coverage':>9}")
        for symbol in ("m_dc", "m_dc_declared"):
            value, u = np.array([(q.value, q.u) for q in (found.quantity(symbol) for found in findings)]).T
            low, high = np.array([found.quantity(symbol).U95 for found in findings]).T
            error = 100 * (value / true - 1)
            covered[symbol] = float(np.mean((low <= true) & (true <= high)))
            print(
                f"{symbol:16} {error.mean():+8.3f} {error.std(ddof=1):7.3f} {np.mean(100 * u / value):9.3f}"
                f" {covered[symbol]:9.2f}"
            )
        orders = sorted({(f.parameters["na"], f.parameters["nb"], f.parameters["delay"]) for f in findings})
        print(
            f"residuals white in {np.sum(white >= 0.01)}, independent of the force in {np.sum(independent >= 0.01)};"
            f" fit {fit.min():.2f} to {fit.max():.2f} %; orders {orders}"
        )
    assert valid >= 0.9 * SHOTS
    assert min(covered.values()) >= 0.85
    assert fit.min() > 98.5


def test_a_grid_of_orders(benchmark, capsys):
    input_, output = arx_record(300, 1)
    grid = order_grid(range(7), range(7), range(3))
    table = benchmark.pedantic(compare_orders, (input_, output, grid), rounds=3)
    with capsys.disabled():
        print(f"\n{len(grid)} candidates on 300 samples: {1e3 * benchmark.stats.stats.min:.0f} ms, {table.best.orders}")
    assert table.best.orders == ORDERS


@pytest.mark.parametrize("memory", ["forgetting 0.99", "finite history of 100"])
def test_speed_of_the_recursive_estimators(benchmark, capsys, memory):
    input_, output = arx_record(20_000, 2)
    call = {
        "forgetting 0.99": lambda: forgetting_arx(input_, output, ORDERS, 0.99),
        "finite history of 100": lambda: finite_history_arx(input_, output, ORDERS, 100),
    }[memory]
    estimates = benchmark.pedantic(call, rounds=3)
    with capsys.disabled():
        print(f"\n4 parameters, {memory}: {20_000 / benchmark.stats.stats.min / 1e3:.0f} thousand samples a second")
    np.testing.assert_allclose(estimates.parameters[-1], TRUE, atol=0.1)


def textbook_recursion(rows: np.ndarray, output: np.ndarray, forgetting: float) -> np.ndarray:
    """Carry the covariance and subtract from it, as the textbooks print it."""
    size = rows.shape[1]
    theta, P = np.zeros(size), 1e6 * np.eye(size)
    history = np.zeros((output.size, size))
    for k, (phi, y) in enumerate(zip(rows, output, strict=True)):
        gain = P @ phi / (forgetting + phi @ P @ phi)
        theta = theta + gain * (y - phi @ theta)
        P = (P - np.outer(gain, phi @ P)) / forgetting
        history[k] = theta
    return history


def test_silence_behind_a_shot(capsys):
    rng = np.random.default_rng(3)
    # silent but for noise far below the shot's
    input_ = rng.standard_normal(21_000) * np.where(np.arange(21_000) < 1_000, 1.0, 1e-9)
    errors = rng.standard_normal(21_000) * np.where(np.arange(21_000) < 1_000, 1e-2, 1e-6)
    output = arx_output(*SECOND_ORDER, input_, errors)
    rows = np.nan_to_num(arx_regressors(input_, output, ORDERS))
    with np.errstate(all="ignore"):
        textbook = textbook_recursion(rows, output, 0.99)
    guarded = forgetting_arx(input_, output, ORDERS, 0.99, min_excitation=1.0)
    before = estimate_arx(input_[:1_000], output[:1_000], ORDERS)
    off = {
        name: float(np.nanmax(np.abs(values[1_100:] - before.parameters)))
        for name, values in (("textbook recursion", textbook), ("guarded", guarded.parameters))
    }
    broken = np.mean(~np.isfinite(textbook).all(axis=1))
    with capsys.disabled():
        print(f"\n20000 samples of silence behind 1000 of signal, largest departure of a parameter: {off}")
        print(f"share of samples at which the textbook recursion is not finite: {broken:.2f}")
    assert off["guarded"] < 0.05
    assert off["textbook recursion"] > 0.5 or broken > 0.0
