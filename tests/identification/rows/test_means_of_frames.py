"""The rows of a camera's frames against their equation and their integrals, both written out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_identification.rows.camera_rows import CameraRows, camera_rows
from recoil_identification.rows.causes import Cause
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.scale_and_zero import CameraMotion
from recoil_processing.shot.camera_motion import RecordedMotion
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Offset, Signals
from recoil_rigs.rig import Rig, find_rig, parse_rig
from tests.builders.written_out_integral import integrated_twice
from tests.builders.written_out_motion import drawn_regression

FEW = st.integers(0, 2)
DISTORTIONS = ("bow of the camera's picture", "S of the camera's picture")

# ------------------------------------------------------------------------------------------ the equation


def drawn_rows(rng: np.random.Generator, shifts: int, causes: int) -> CameraRows:
    n = 6
    return CameraRows(
        times_s=np.arange(n) * 1e-3,
        recorded_m=rng.normal(0.3, 0.2, n),
        sigma_m=rng.uniform(1e-5, 1e-4, n),
        onset_s=0.0,
        density=0.0,
        felt_m=rng.normal(0.3, 0.2, n),
        other_m=rng.normal(0.0, 0.02, n),
        certain_m=rng.normal(0.0, 0.02, n),
        free_m=rng.uniform(0.0, 0.01, n),
        velocity_m_s=rng.uniform(0.0, 10.0, n),
        zeros_m=rng.normal(0.0, 0.01, (n, shifts + causes)),
        sizes=(*(f"shift {i + 1} of the zero" for i in range(shifts)), *(f"cause {i}" for i in range(causes))),
        bends=rng.normal(size=(n, 2)),
        u_rel=0.001,
        u_other_rel=0.02,
        u_other_zero_m_s2=0.3,
        u_distortion_m=1e-4,
        clock="camera",
        drift=2e-5,
        u_rate=6e-5,
    )


def seen_m(rows: CameraRows, values: dict[str, float], at: int) -> float:
    """Return what one row has.

    ``e^ka { e^-al [II a - b II r - sum z II s] + (1 - e) II o + II g - q II r } + x0 + tau v + th v (t - t_m) + D d``
    """
    felt = rows.felt_m[at] - values["zero of recoil_acceleration"] * rows.free_m[at]
    felt -= sum(values[name] * rows.zeros_m[at, column] for column, name in enumerate(rows.sizes))
    other = (1.0 - values["the carriage's part of the travel too large"]) * rows.other_m[at]
    other -= values["zero of the carriage's part of the travel"] * rows.free_m[at]
    other += rows.certain_m[at]
    travel = math.exp(values["ln camera"]) * (math.exp(-values["ln recoil_acceleration"]) * felt + other)
    bent = sum(values[name] * rows.bends[at, column] for column, name in enumerate(DISTORTIONS))
    since_middle_s = rows.times_s[at] - 0.5 * (rows.onset_s + rows.times_s[-1])
    late_s = values["camera late"] + values["camera's seconds too long"] * since_middle_s
    return float(travel + values["place before the shot"] + late_s * rows.velocity_m_s[at] + bent)


@pytest.mark.exhaustive
@given(st.integers(0, 2**32 - 1), FEW, FEW)
def test_a_row_is_what_the_equation_leaves_of_it_and_a_derivative_what_a_small_step_does(seed, shifts, causes):
    rng = np.random.default_rng(seed)
    rows = drawn_rows(rng, shifts, causes)
    values = {name: float(rng.normal(0.0, 0.1)) for name in rows.unknowns}
    left, derivatives = rows.linearised(values)
    assert derivatives.shape == (rows.times_s.size, len(rows.unknowns))
    for at in range(rows.times_s.size):
        expected = (rows.recorded_m[at] - seen_m(rows, values, at)) / rows.sigma_m[at]
        assert left[at] == pytest.approx(expected, rel=1e-9, abs=1e-7)
        for column, name in enumerate(rows.unknowns):
            up, down = (seen_m(rows, values | {name: values[name] + by}, at) for by in (1e-4, -1e-4))
            assert derivatives[at, column] == pytest.approx((up - down) / 2e-4 / rows.sigma_m[at], rel=1e-5, abs=1e-3)


@given(st.integers(0, 2**32 - 1), st.integers(1, 3), FEW, st.data())
def test_rows_with_some_of_the_shapes_are_those_with_all_whose_others_have_no_size(seed, shifts, causes, data):
    rng = np.random.default_rng(seed)
    rows = drawn_rows(rng, shifts, causes)
    chosen = data.draw(st.lists(st.integers(0, shifts - 1), unique=True))
    some = rows.with_shifts(chosen)
    values = {name: float(rng.normal(0.0, 0.1)) for name in some.unknowns}
    of_all = {name: values[name] for name in rows.unknowns if not name.startswith("shift")}
    of_all |= {f"shift {i + 1} of the zero": 0.0 for i in range(shifts)}
    of_all |= {f"shift {at + 1} of the zero": values[f"shift {i + 1} of the zero"] for i, at in enumerate(chosen)}
    assert len(some.sizes) == len(chosen) + causes
    np.testing.assert_allclose(some.linearised(values)[0], rows.linearised(of_all)[0], rtol=1e-9, atol=1e-7)


def test_beforehand_is_known_what_sensors_state_and_of_place_and_clock_less_than_frames_tell():
    rows = drawn_rows(np.random.default_rng(1), 1, 1)
    u = {prior.sources: math.sqrt(prior.covariance[0, 0]) for prior in rows.priors}
    # frames that were aligned by a drift of theirs lie by that much off the clock of which none is expected
    expected = [[-2e-5] if prior.sources == ("rate of clock camera",) else [0.0] for prior in rows.priors]
    assert [prior.values.tolist() for prior in rows.priors] == expected
    assert u == {
        ("the carriage's part of the travel too large",): pytest.approx(0.02),
        ("zero of the carriage's part of the travel",): pytest.approx(0.3),
        ("place before the shot",): pytest.approx(0.01),
        ("camera late",): pytest.approx(1e-3),
        ("rate of clock camera",): pytest.approx(6e-5),
        ("bow of the camera's picture",): pytest.approx(1e-4),
        # the next smaller distortion
        ("S of the camera's picture",): pytest.approx(5e-5),
    }
    no_baseline = replace(rows, u_other_zero_m_s2=math.inf)
    assert {one.sources for one in rows.priors} - {one.sources for one in no_baseline.priors} == {
        ("zero of the carriage's part of the travel",)
    }


# ------------------------------------------------------------------------------------------ means and integrals

STEP_S = 2e-4
TIMES_S = -0.03 + STEP_S * np.arange(900)
ONSET_S, END_S = float(TIMES_S[250]), 0.12
"""The first is a sample, which counts as one of the motion."""
SIGMA_M = 3e-5
DENSITIES = (1e-4, 1.0, 1e4)


@cache
def rig() -> Rig:
    path = find_rig("field-2013")
    return parse_rig(path.read_text(encoding="utf-8"), path)


@dataclass(frozen=True, eq=False)
class Seen:
    """What goes into the rows; the travel's acceleration, and where no part of it was lost, a'."""

    regression: Regression
    recorded: Regression
    travelled: np.ndarray
    inertial: np.ndarray
    causes: tuple[Cause, ...]
    frames_s: np.ndarray
    positions_m: np.ndarray

    @property
    def times_s(self) -> np.ndarray:
        return self.recorded.times_s

    def rows(self, *, without: str = "", **changed: np.ndarray) -> CameraRows | None:
        frames_s, positions_m = changed.get("frames_s", self.frames_s), changed.get("positions_m", self.positions_m)
        integral = DoubleIntegral.of(self.travelled, float(self.times_s[0]), self.recorded.step_s)
        motion = CameraMotion(frames_s, positions_m, integral, SIGMA_M**2, 1e-6, math.inf)
        roles = ("carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate")
        offsets = {role: Offset(0.0, u, 1.0) for role, u in zip(roles, (0.03, 0.04, 7.0, 7.0), strict=True)}
        series = {role: np.zeros(self.times_s.size) for role in roles if role != without}
        start_s = float(self.times_s[0])
        signals = Signals(start_s, self.recorded.step_s, series, offsets, (start_s, ONSET_S), ONSET_S)
        return camera_rows(
            RecordedMotion(motion, DENSITIES, 0.002, "camera", 2e-5, 6e-5),
            self.regression, self.recorded, self.inertial, self.causes,
            signals, rig(),
        )  # fmt: skip


@cache
def seen() -> Seen:
    rng = np.random.default_rng(11)
    times_s, step_s = TIMES_S, STEP_S
    since_s = times_s - ONSET_S
    drawn = drawn_regression(rng, times_s.size)
    shapes = np.column_stack([since_s >= 0, np.maximum(since_s, 0.0) / 0.1, since_s > 0.03]).astype(np.float64)
    recorded = replace(
        drawn, times_s=times_s, step_s=step_s, released=(since_s >= 0).astype(np.float64), interval_s=(ONSET_S, END_S),
        shifts=shapes,
    )  # fmt: skip
    # behind a filter everything begins a little earlier
    regression = replace(recorded, released=rng.uniform(0.0, 1.0, times_s.size), shifts=np.roll(shapes, -3, axis=0))
    # before the onset the part is held, and what its sensors read there is no motion
    read = np.where(since_s >= 0, 1.0, 1e-4)
    inertial = read * (300.0 * np.cos(25.0 * since_s) + 5.0)
    travelled = inertial + read * (9.0 * np.sin(60.0 * since_s) + 2.0)
    inertial[400:403] = np.nan
    causes = (
        Cause("of the forces alone", "1", 1.0, "B", np.ones((times_s.size, 3)), np.zeros(times_s.size)),
        Cause("of the motion", "1", 1.0, "B", np.zeros((times_s.size, 3)), rng.normal(size=times_s.size)),
    )
    frames_s = np.arange(-0.02, 0.14, 3.7e-4)
    rising = np.where(since_s >= 0, travelled, 0.0)
    positions_m = integrated_twice(times_s, rising, frames_s)[0] + rng.normal(0.0, SIGMA_M, frames_s.size)
    return Seen(regression, recorded, travelled, inertial, causes, frames_s, positions_m)


def groups() -> list[np.ndarray]:
    """Numbers of the frames of each millisecond, from 20 ms before the onset to the end of travel."""
    by_number: dict[int, list[int]] = {}
    for frame, at_s in enumerate(seen().frames_s):
        number = math.floor((at_s - ONSET_S) / 1e-3)
        if number >= -20 and at_s <= END_S:
            by_number.setdefault(number, []).append(frame)
    return [np.array(by_number[number]) for number in sorted(by_number)]


def means(of_frames: np.ndarray) -> np.ndarray:
    return np.array([of_frames[group].mean() for group in groups()])


def test_each_row_is_the_mean_of_a_milliseconds_frames():
    rows = seen().rows()
    assert rows is not None
    np.testing.assert_allclose(rows.times_s, means(seen().frames_s), rtol=1e-12)
    np.testing.assert_allclose(rows.recorded_m, means(seen().positions_m), atol=1e-15)
    np.testing.assert_allclose(rows.sigma_m, [SIGMA_M / math.sqrt(group.size) for group in groups()])
    used_m = seen().positions_m[np.concatenate(groups())]
    shares = np.zeros(seen().frames_s.size)
    shares[np.concatenate(groups())] = used_m / used_m.max()
    np.testing.assert_allclose(rows.bends[:, 0], means(4.0 * shares * (1.0 - shares)), atol=1e-12)
    np.testing.assert_allclose(np.abs(rows.bends).max(axis=0), 1.0, atol=0.05)


def test_what_was_felt_and_what_may_be_wrong_are_integrated_twice_from_the_onset_on():
    rows, one = seen().rows(), seen()
    assert rows is not None
    known = np.isfinite(one.inertial)
    inertial = np.interp(one.times_s, one.times_s[known], one.inertial[known])
    moving = one.times_s >= ONSET_S

    def integral(samples: np.ndarray) -> np.ndarray:
        return means(integrated_twice(one.times_s, samples, one.frames_s)[0])

    travelled = np.where(moving, one.travelled, 0.0)
    for found, samples in (
        (rows.felt_m, np.where(moving, inertial, 0.0)),
        (rows.other_m, np.where(moving, one.travelled - inertial, 0.0)),
        (rows.free_m, one.recorded.released),
        # of the filtered ones, which begin before the onset
        *((rows.zeros_m[:, shape], one.regression.shifts[:, shape]) for shape in range(3)),
        (rows.zeros_m[:, 3], one.causes[1].acceleration_m_s2),
    ):
        np.testing.assert_allclose(found, integral(samples), rtol=2e-5, atol=1e-9)
    velocity = means(integrated_twice(one.times_s, travelled, one.frames_s)[1])
    np.testing.assert_allclose(rows.velocity_m_s, velocity, rtol=2e-5, atol=1e-9)
    assert rows.sizes == (*(f"shift {i} of the zero" for i in (1, 2, 3)), "of the motion")
    assert (rows.onset_s, rows.u_rel) == (ONSET_S, 0.002)


def test_what_is_uncertain_beside_is_what_the_sensors_of_carriage_and_camera_state():
    rows = seen().rows()
    assert rows is not None
    assert rows.u_other_zero_m_s2 == pytest.approx(0.05)
    stated = [
        channel.sensor.u_rel
        for channel in rig().channels
        if channel.role.startswith("carriage_") or channel.role == "tipping_rate"
    ]
    assert rows.u_other_rel == max(stated)
    assert rows.u_distortion_m == 1e-4


def test_a_shape_that_nothing_has_is_no_column():
    bare = replace(
        seen(),
        causes=(),
        recorded=replace(seen().recorded, shifts=None),
        regression=replace(seen().regression, shifts=None),
    )
    rows = bare.rows()
    assert rows is not None
    assert rows.sizes == ()
    assert rows.zeros_m.shape == (len(groups()), 0)


@pytest.mark.parametrize(("shape", "explained"), [(0, True), (1, True), (2, False)])
def test_a_zero_that_shifted_in_one_of_the_first_two_shapes_is_not_taken_for_noise(shape, explained):
    one = seen()
    shift = 5.0 * integrated_twice(one.times_s, one.recorded.shifts[:, shape], one.frames_s)[0]
    rows, sound = one.rows(positions_m=one.positions_m + shift), one.rows()
    assert rows is not None
    assert sound is not None
    assert sound.density == DENSITIES[0]
    assert (rows.density == sound.density) is explained


@pytest.mark.parametrize(("until_ms", "enough"), [(12, True), (11, False)])
def test_a_dozen_milliseconds_of_motion_are_needed(until_ms, enough):
    frames_s = np.arange(ONSET_S - 0.02, ONSET_S + 0.03, 2e-4) + 1e-5
    one = seen()
    rising = np.where(one.times_s >= ONSET_S, one.travelled, 0.0)
    positions_m = integrated_twice(one.times_s, rising, frames_s)[0]
    # frames after the end of travel do not count
    ends = replace(
        one,
        regression=replace(one.regression, interval_s=(ONSET_S, ONSET_S + 1e-3 * until_ms)),
    )
    assert (ends.rows(frames_s=frames_s, positions_m=positions_m) is not None) is enough


@pytest.mark.parametrize("role", ["carriage_acceleration_x", "carriage_acceleration_y"])
def test_frames_say_nothing_where_a_sensor_of_the_carriage_is_missing(role):
    assert seen().rows(without=role) is None


def test_one_rate_tells_how_the_carriage_turns():
    assert seen().rows(without="carriage_rate") is not None
