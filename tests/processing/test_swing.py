"""What a signal does in a shot, by signals of known swing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_processing.swing import (
    Swing,
    cell_means,
    farthest_cell,
    is_a_gun_shot,
    is_a_line_shot,
    roles_of_gun,
    roles_of_line,
    same_gauge,
    swing_of,
)

RATE_HZ = 20e3
T = np.arange(int(0.4 * RATE_HZ)) / RATE_HZ
RNG = np.random.default_rng(8)


def pulse(size: float, base: float = 0.0, noise: float = 0.0, at: float = 0.1, width: float = 0.01) -> np.ndarray:
    inside = (at < T) & (width + at > T)
    return base + size * inside * np.sin(np.pi * (T - at) / width) ** 2 + noise * RNG.standard_normal(T.size)


@pytest.mark.parametrize("size", [5.0, -5.0])
def test_a_pulse_is_found_with_its_sign(size: float) -> None:
    one = swing_of(pulse(size, base=3.0, noise=0.05), RATE_HZ)
    assert one is not None
    assert one.moves
    assert one.base == pytest.approx(3.0, abs=0.02)
    assert one.peak == pytest.approx(size, rel=0.02)
    assert one.first == np.sign(size)
    assert 0.1 < one.onset / RATE_HZ < 0.104
    assert one.noise == pytest.approx(0.05, rel=0.2)


def test_lost_samples_and_ringing_change_little() -> None:
    samples = pulse(5.0) + 3.0 * np.sin(2 * np.pi * 4e3 * T) * (T > 0.1)
    samples[::7] = np.nan
    one = swing_of(samples, RATE_HZ)
    assert one is not None
    assert one.peak == pytest.approx(5.0, rel=0.2)


def test_noise_and_a_constant_do_not_move() -> None:
    for samples in (RNG.standard_normal(T.size), np.full(T.size, 4.0)):
        one = swing_of(samples, RATE_HZ)
        assert one is not None
        assert (one.moves, one.first) == (False, 0)


def test_too_few_samples_tell_nothing() -> None:
    assert swing_of(np.ones(39), RATE_HZ) is None
    assert swing_of(np.full(500, np.nan), RATE_HZ) is None
    assert swing_of(np.ones(500), math.nan) is None


def test_the_first_swing_counts_and_not_the_largest() -> None:
    one = swing_of(pulse(-2.0) + pulse(6.0, at=0.2), RATE_HZ)
    assert one is not None
    assert (one.first, round(one.peak)) == (-1, 6)


def test_steepness_is_the_change_of_a_short_mean() -> None:
    ramp = np.clip((T - 0.1) / 0.01, 0, 1) * 2.0
    one = swing_of(ramp, RATE_HZ)
    assert one is not None
    assert one.steepest == pytest.approx(200.0, rel=1e-6)


def swing(peak: float, base: float = 0.0, steepest: float = 1.0, *, moves: bool = True) -> Swing:
    return Swing(base, peak, 1, 0, steepest, 0.0, moves)


GUN = {
    "a": ("pressure", swing(130e6)), "b": ("pressure", swing(6e6)), "c": ("pressure", swing(1.5e6, base=1.6e6)),
    "d": ("acceleration", swing(20.0)), "e": ("acceleration", swing(1500.0)),
    "f": ("acceleration", swing(-15.0, base=-9.8)), "g": ("angular_rate", swing(0.3, steepest=10.0)),
    "h": ("angular_rate", swing(0.2, steepest=40.0)), "i": ("displacement", swing(0.8)),
    "j": ("displacement", swing(0.001, moves=False)), "k": ("temperature", swing(5.0)),
}  # fmt: skip


def test_roles_of_a_gun_are_those_of_its_signals() -> None:
    roles = {name: one.role for name, one in roles_of_gun(GUN).items()}
    assert roles == {
        "a": "breech_pressure", "b": "brake_pressure", "c": "recuperator_pressure", "d": "carriage_acceleration_x",
        "e": "recoil_acceleration", "f": "carriage_acceleration_y", "g": "carriage_rate", "h": "tipping_rate",
        "i": "recoil_displacement",
    }  # fmt: skip
    assert roles_of_gun(GUN)["e"].lead == 75.0
    assert roles_of_gun(GUN)["i"].lead == math.inf


def test_where_one_of_several_lacks_the_others_are_not_named_for_it() -> None:
    two = {name: one for name, one in GUN.items() if name not in "cdgj"}
    roles = {name: one.role for name, one in roles_of_gun(two).items()}
    assert roles == {"a": "breech_pressure", "e": "recoil_acceleration", "i": "recoil_displacement"}


def test_what_moves_and_what_drives_make_a_shot() -> None:
    assert is_a_gun_shot(GUN)
    assert not is_a_line_shot(GUN)
    assert not is_a_gun_shot({name: GUN[name] for name in "ade"})
    assert is_a_gun_shot({name: GUN[name] for name in "ade"}, least_pressures=1)
    assert not is_a_gun_shot({name: GUN[name] for name in "abc"})
    line = {"f": ("force", swing(1e4)), "r": ("force", swing(-2e3)), "x": ("displacement", swing(0.3))}
    assert is_a_line_shot(line)
    assert {name: one.role for name, one in roles_of_line(line).items()} == {
        "f": "driving_force", "r": "resisting_force", "x": "recoil_displacement",
    }  # fmt: skip
    assert roles_of_line(line)["r"].lead == 5.0


def test_gauges_of_one_pressure_swing_alike() -> None:
    assert same_gauge(swing(100.0), swing(92.0))
    assert not same_gauge(swing(100.0), swing(85.0))


def test_the_farthest_cell_is_the_blow_and_not_the_noise() -> None:
    rng = np.random.default_rng(5)
    samples = rng.normal(3.0, 0.1, 100_000)
    assert farthest_cell(cell_means(samples, 50)) is None
    samples[70_000:70_200] += 9.0
    samples[10] = np.nan
    means = cell_means(samples, 50)
    assert means.shape == (2000,)
    assert means[0] == np.nanmean(samples[:50])
    assert farthest_cell(means) in range(1400, 1404)
    assert farthest_cell(cell_means(np.full(30, np.nan), 1)) is None
    assert farthest_cell(cell_means(np.zeros(5000), 7)) is None
    # what is left over is a cell of its own
    assert cell_means(np.arange(5.0), 2).tolist() == [0.5, 2.5, 4.0]


@pytest.mark.parametrize("numbers", [(1e308, -1e308), (1e200, 1e200), (1.7e308, 1.7e308, 1.7e308, 1.7e308)])
def test_numbers_that_are_no_measurement_move_nothing_and_overflow_in_silence(numbers: tuple[float, ...]) -> None:
    samples = pulse(5.0, noise=0.05)
    samples[3000 : 3000 + len(numbers)] = numbers
    one = swing_of(samples, RATE_HZ)
    assert one is None or math.isfinite(one.base)
