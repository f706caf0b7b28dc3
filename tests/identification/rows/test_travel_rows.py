"""The rows of frames that forces drive, against their equation and its double integral written out."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.noise_in_motion import travel_with_noise
from recoil_identification.calibration.solution import all_unknowns, calibration_of
from recoil_identification.inference.block import JointBlock
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows.equation_of_motion import CAMERA, EquationOfMotion
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.rows.sensor_priors import RELEASE, ZERO, certificates
from recoil_identification.rows.travel_rows import ForcedTravel, TravelRows
from recoil_processing.shot.clocks.camera_track import CameraTrack
from recoil_processing.shot.clocks.forced_recoil import ForcedRecoil
from recoil_processing.shot.kinematics import AngularMotion
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.rig import Rig, find_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_rig, bench_shot, bench_signals
from tests.builders.correlations import lower_factor
from tests.builders.written_out_integral import integrated_twice
from tests.builders.written_out_motion import acceleration_m_s2, drawn_motion, drawn_values

START, LATE, RATE = "place before the shot", "camera late", "camera's seconds too long"
DISTORTIONS = ("bow of the camera's picture", "S of the camera's picture")
MARKER_M = 4e-5
SCALES = ScaleUncertainty(0.0, (0.005, 0.004, 0.004), 150.0)

# ------------------------------------------------------------------------------------------ means of a track


@cache
def forced() -> ForcedRecoil:
    """A body on a rail that the forces drive downhill against gravity's part; nothing else moves."""
    recorded, motion = bench_regression(), bench_motion()
    nothing = np.zeros(recorded.times_s.size)
    still = AngularMotion(*(7 * [nothing]), 0.0, 0.0)
    acceleration = motion.acceleration_m_s2 * recorded.released
    return ForcedRecoil(
        FiredShot(bench_shot(), bench_rig()),
        bench_signals(),
        still,
        recorded,
        MASS_KG,
        acceleration + 1.5 * recorded.released,
    )


def track(rest_frames: int) -> CameraTrack:
    r = forced().recorded
    release_s = float(r.times_s[bench_motion().release])
    frames_s = release_s + np.arange(1.3e-4, 0.06, 3.1e-4)
    # a picture begins anywhere
    positions_m = 0.02 + integrated_twice(r.times_s, forced().acceleration_m_s2, frames_s)[0]
    return CameraTrack(frames_s, positions_m, release_s, 0.0195 if rest_frames else math.nan, rest_frames, 0)


def travel_of(rest_frames: int, rig: Rig | None = None) -> ForcedTravel:
    driven = forced() if rig is None else replace(forced(), fired=replace(forced().fired, rig=rig))
    levels = MARKER_M, 3e-3
    return ForcedTravel.of(driven, track(rest_frames), levels, clock="camera", u_shift_s=1e-4, u_rate=1e-5)


@pytest.mark.parametrize("rest_frames", [0, 1, 400])
def test_each_row_is_the_mean_of_a_milliseconds_frames_and_the_first_that_of_all_at_rest(rest_frames):
    seen, found = track(rest_frames), travel_of(rest_frames)
    numbers = np.array([math.floor((at_s - seen.release_s) / 1e-3) for at_s in seen.times_s])
    groups = [np.flatnonzero(numbers == number) for number in sorted(set(numbers.tolist()))]
    times_s = [seen.times_s[group].mean() for group in groups]
    recorded_m = [seen.positions_m[group].mean() for group in groups]
    sigma_m = [MARKER_M / math.sqrt(group.size) for group in groups]
    velocity = integrated_twice(forced().recorded.times_s, forced().acceleration_m_s2, seen.times_s)[1]
    velocity_m_s = [velocity[group].mean() for group in groups]
    first_m = float(seen.positions_m[0])
    if rest_frames:
        times_s, recorded_m = [seen.release_s, *times_s], [0.0195, *recorded_m]
        sigma_m, velocity_m_s = [MARKER_M / math.sqrt(rest_frames), *sigma_m], [0.0, *velocity_m_s]
        first_m = 0.0195
    np.testing.assert_allclose(found.times_s, times_s, rtol=1e-12)
    np.testing.assert_allclose(found.recorded_m, recorded_m, rtol=1e-12)
    np.testing.assert_allclose(found.sigma_m, sigma_m)
    np.testing.assert_allclose(found.velocity_m_s, velocity_m_s, rtol=1e-4, atol=2e-3)
    # a bow is nothing at both ends of the travel, which begins where the part rested, and one at half of it
    shares = (seen.positions_m - first_m) / (seen.positions_m.max() - first_m)
    bows = [(4.0 * shares[group] * (1.0 - shares[group])).mean() for group in groups]
    np.testing.assert_allclose(found.bends[:, 0], [0.0, *bows] if rest_frames else bows, atol=1e-12)
    assert found.bends.shape == (len(times_s), 2)
    for row, at_s in enumerate(found.times_s):
        assert at_s == pytest.approx(found.frames_s[found.places == row].mean())
    assert (found.release_s, found.density, found.clock) == (seen.release_s, 3e-3, "camera")
    np.testing.assert_array_equal(found.other_m_s2, forced().other_m_s2)


def test_how_far_a_picture_may_be_bent_is_what_its_camera_states():
    path = find_rig("field-2013")
    assert travel_of(0).u_distortion_m == 0.0  # a rig without a camera
    assert travel_of(0, parse_rig(path.read_text(encoding="utf-8"), path)).u_distortion_m == 1e-4


def test_beforehand_is_known_what_clock_and_picture_state_and_of_the_place_less_than_frames_tell():
    found = replace(travel_of(400), u_distortion_m=2e-4)
    u = {(*prior.sources, *prior.unknowns): math.sqrt(prior.covariance[0, 0]) for prior in found.priors}
    assert all(prior.values.tolist() == [0.0] for prior in found.priors)
    assert u == {
        (START, START): pytest.approx(0.01),
        ("alignment of clock camera", LATE): pytest.approx(1e-4),
        ("rate of clock camera", RATE): pytest.approx(1e-5),
        (DISTORTIONS[0], DISTORTIONS[0]): pytest.approx(2e-4),
        # the next smaller distortion
        (DISTORTIONS[1], DISTORTIONS[1]): pytest.approx(1e-4),
    }
    by_force = replace(found, u_shift_s=math.inf)
    assert {prior.unknowns for prior in found.priors} - {prior.unknowns for prior in by_force.priors} == {(LATE,)}


def test_frames_are_correlated_by_the_walk_that_the_forces_noise_integrates_to():
    found = travel_of(400)
    # white noise in steps of 10 us, integrated twice
    since_s = (np.arange(7000) + 0.5) * 1e-5
    reached = np.maximum((found.times_s - found.release_s)[:, np.newaxis] - since_s, 0.0)
    covariance = found.density * 1e-5 * reached @ reached.T + np.diag(found.sigma_m**2)
    factor = found.sigma_m[:, np.newaxis] * lower_factor(found.correlation)
    np.testing.assert_allclose(factor @ factor.T, covariance, rtol=1e-3, atol=1e-3 * found.sigma_m.min() ** 2)


# ------------------------------------------------------------------------------------------ noise of the motion

FINE_S = 1e-4
SHARES = (0.03, 0.1)
KINDS = ["white", "with the acceleration", "with the velocity", "short", "long"]


def equation() -> EquationOfMotion:
    """Return that of every sample, by forces alone."""
    size = forced().recorded.times_s.size
    recorded = replace(forced().recorded, acceleration_m_s2=np.zeros(size))
    return EquationOfMotion(recorded, np.arange(size), MASS_KG, np.ones(size), (), CAMERA)


def walks_m(kind: str, count: int, seed: int, at_s: np.ndarray) -> np.ndarray:
    """Draw how far accelerations of variance one have walked, 100 Hz wide where they are white."""
    r, rng = equation().regression, np.random.default_rng(seed)
    release_s = float(r.times_s[bench_motion().release])
    since_s = (np.arange(round((r.interval_s[1] - release_s) / FINE_S)) + 0.5) * FINE_S
    drawn = rng.standard_normal((since_s.size, count))
    if kind in ("short", "long"):
        duration_s = r.interval_s[1] - r.interval_s[0]
        kept = math.exp(-FINE_S / (SHARES[KINDS.index(kind) - 3] * duration_s))
        for at in range(1, since_s.size):
            drawn[at] = kept * drawn[at - 1] + math.sqrt(1.0 - kept**2) * drawn[at]
    else:
        a = np.interp(release_s + since_s, r.times_s, r.force_n / MASS_KG)
        grown = {"white": np.ones(a.size), "with the acceleration": np.abs(a)}.get(kind, np.cumsum(a).clip(0.0))
        drawn *= (grown / grown.max() / math.sqrt(2.0 * 100.0 * FINE_S))[:, np.newaxis]
    reached_s = np.maximum((at_s - release_s)[:, np.newaxis] - since_s, 0.0)
    return FINE_S * reached_s @ drawn


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_the_motion_walks_in_the_frames_as_its_double_integrals_do(kind: str) -> None:
    found = travel_of(400)
    parts, acceleration_m_s2 = found.motion_parts(equation())
    r = equation().regression
    later = found.times_s > found.release_s + 5e-3
    walked = walks_m(kind, 8000, 1, found.times_s[later])
    covariance = walked @ walked.T / walked.shape[1]
    of_kind = parts[KINDS.index(kind)]
    size = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(of_kind[np.ix_(later, later)] / np.outer(size, size), covariance / np.outer(size, size),
                               atol=0.06)  # fmt: skip
    # nothing has moved the frame at rest yet
    assert not of_kind[0].any()
    moving = r.inside & (r.times_s >= found.release_s)
    assert acceleration_m_s2 == pytest.approx(np.sqrt(np.mean((r.force_n[moving] / MASS_KG) ** 2)), rel=0.02)


def by_frames(noise_m: np.ndarray | float) -> Calibration:
    """Estimate the mass by frames with the marker's noise and more of it, of sensors as good as certificates say."""
    block, clean = equation(), travel_of(400)
    r = block.regression
    driven = (r.force_n / MASS_KG + clean.other_m_s2) * (r.released > 0)
    travelled_m = integrated_twice(r.times_s, driven, clean.frames_s)[0]
    exact = np.bincount(clean.places, travelled_m) / np.bincount(clean.places)
    marker = clean.sigma_m * np.random.default_rng(77).standard_normal(exact.size)
    travel = replace(clean, recorded_m=exact + marker + noise_m, density=1e-6)
    common = certificates(SCALES, Prior.of(RELEASE, "velocity at the release", 1e-4), 1e-3, accelerometer=False)
    own = [Prior.of(ZERO, "zero of recoil_acceleration", 0.0), *travel.priors]
    noise = RowNoise(np.full(r.times_s.size, math.sqrt(travel.density / r.step_s)), 1.0, math.inf)
    listed = all_unknowns(block, JointBlock((TravelRows(block, travel),)), [*common, *own], ())
    travel, noise = travel_with_noise(block, travel, noise, (), [*common, *own], listed)
    return calibration_of("camera", block, noise, common, own, travel, travel.correlation, ())


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_the_motion_is_found_in_the_frames_and_is_in_the_uncertainty(kind: str) -> None:
    sound = by_frames(0.0)
    assert sound.noise.unexplained_share < 0.01
    size = 8.0
    each = [by_frames(size * walks_m(kind, 1, 20 + seed, travel_of(400).times_s)[:, 0]) for seed in range(6)]
    assert max(abs(one.estimate.mass_kg - MASS_KG) / one.estimate.u_kg for one in each) < 3.0
    if kind == "with the acceleration":  # which is over before frames tell much of it
        return
    assert np.median([one.estimate.u_kg for one in each]) > 1.5 * sound.estimate.u_kg
    sizes = np.array([one.noise.sizes_m_s2 for one in each])
    if kind == "white":
        assert np.median(sizes[:, 0]) == pytest.approx(size, rel=0.25)
        assert not sizes[:, 3:].any()
    elif kind in ("short", "long"):
        # few periods of it lie in a travel: it passes for white noise now and then, but never for none
        assert np.all(np.linalg.norm(sizes, axis=1) > 0.25 * size)
        assert np.count_nonzero(sizes[:, 3:].any(axis=1)) >= 3
        _, acceleration_m_s2 = travel_of(400).motion_parts(equation())
        shares = [one.noise.unexplained_share for one in each]
        np.testing.assert_allclose(shares, np.linalg.norm(sizes[:, 3:], axis=1) / acceleration_m_s2, rtol=1e-9)


# ------------------------------------------------------------------------------------------ the equation


def drawn_rows(seed: int, shifts: int, causes: int, changes: int) -> TravelRows:
    """Draw forces, a carriage that moves, and frames, in two of which out of each three there is one more mean."""
    rng, size = np.random.default_rng(seed), 30
    block = drawn_motion(rng, shifts, causes, changes, CAMERA, size)
    released = np.where(np.arange(size) < 4, 0.0, rng.uniform(0.1, 1.0, size))
    regression = replace(
        block.regression, acceleration_m_s2=np.zeros(size), released=released, interval_s=(4e-3, 27e-3)
    )
    block = replace(block, regression=regression, rows=np.arange(size), sigma_m_s2=np.ones(size))
    frames_s = np.sort(rng.uniform(regression.times_s[2], regression.times_s[-2], 24))
    places = np.arange(24) * 2 // 3
    counts = np.bincount(places)
    return TravelRows(
        block,
        ForcedTravel(
            frames_s=frames_s,
            places=places,
            times_s=np.bincount(places, frames_s) / counts,
            recorded_m=rng.normal(0.1, 0.1, counts.size),
            sigma_m=rng.uniform(1e-3, 2e-3, counts.size),
            release_s=float(regression.times_s[4]),
            density=1e-3,
            other_m_s2=rng.normal(0.0, 20.0, size),
            velocity_m_s=rng.uniform(0.0, 10.0, counts.size),
            bends=rng.normal(size=(counts.size, 2)),
            clock="camera",
            u_shift_s=1e-4,
            u_rate=1e-5,
            u_distortion_m=1e-4,
        ),
    )


def seen_m(rows: TravelRows, values: dict[str, float]) -> np.ndarray:
    """``II[e^ka (a' + o) + b r + v d + S z + sum c h] + x0 + tau v + theta v (t - t_m) + D d`` of all rows."""
    block, travel = rows.equation, rows.travel
    r = block.regression
    acceleration = np.array([
        acceleration_m_s2(block, values, at) + math.exp(values["ln camera"]) * travel.other_m_s2[at]
        if r.released[at] > 0
        else 0.0
        for at in range(r.times_s.size)
    ])  # fmt: skip
    of_frames, _ = integrated_twice(r.times_s, acceleration, travel.frames_s)
    x = np.array([of_frames[travel.places == row].mean() for row in range(travel.times_s.size)])
    since_middle_s = travel.times_s - 0.5 * (r.interval_s[0] + r.interval_s[1])
    x += values[START] + (values[LATE] + values[RATE] * since_middle_s) * travel.velocity_m_s
    return x + travel.bends @ [values[name] for name in DISTORTIONS]


@pytest.mark.parametrize(
    ("seed", "shifts", "causes", "changes"), [(1, 0, 0, 0), (2, 0, 2, 0), (3, 1, 1, 0), (4, 0, 0, 2), (5, 2, 1, 1)]
)
def test_a_row_is_what_the_equation_leaves_of_it_and_a_derivative_what_a_small_step_does(seed, shifts, causes, changes):
    rows = drawn_rows(seed, shifts, causes, changes)
    values = drawn_values(np.random.default_rng(seed), rows.unknowns)
    left, derivatives = rows.linearised(values)
    travel = rows.travel
    np.testing.assert_allclose(left * travel.sigma_m, travel.recorded_m - seen_m(rows, values), atol=2e-6)
    assert derivatives.shape == (travel.times_s.size, len(rows.unknowns))
    for column, name in enumerate(rows.unknowns):
        step = 1.0 if name.startswith("friction") else 1e-4
        up, down = (seen_m(rows, values | {name: values[name] + by}) for by in (step, -step))
        expected = (up - down) / (2 * step)
        np.testing.assert_allclose(
            derivatives[:, column] * travel.sigma_m,
            expected,
            rtol=1e-4,
            atol=1e-5 * np.abs(expected).max(),
            err_msg=name,
        )


def test_every_error_that_the_rows_hang_on_is_an_unknown_of_its_own():
    rows = drawn_rows(1, 1, 1, 1)
    assert len(set(rows.unknowns)) == len(rows.unknowns)
    assert rows.unknowns == (*rows.equation.unknowns, START, LATE, RATE, *DISTORTIONS)
