"""Parts of the rows' errors that come with the motion: their shapes, their likelihood written out, their sizes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from recoil_identification.rows.motion_noise import MotionParts, _Search, likeliest_sizes
from recoil_identification.rows.row_noise import by_filter
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from tests.builders.bench_shots import MASS_KG, bench_regression

LOW_PASS = LowPass(300.0)
REST_M_S2 = 1.5


@cache
def exact() -> Regression:
    """As recorded, with Newton's law in every sample."""
    recorded = bench_regression()
    return replace(recorded, acceleration_m_s2=recorded.force_n / MASS_KG)


@cache
def filtered() -> Regression:
    return exact().filtered(LOW_PASS)


@cache
def rows() -> np.ndarray:
    return spaced_rows(filtered())


@cache
def parts() -> MotionParts:
    return MotionParts.of(filtered(), rows(), MASS_KG, REST_M_S2)


@cache
def covariances() -> np.ndarray:
    times_s = filtered().times_s[rows()]
    return parts().covariances(times_s, rows(), by_filter(filtered(), times_s))


# ------------------------------------------------------------------------------------------ shapes


def test_white_noise_lasts_as_long_as_the_motion_and_goes_with_acceleration_and_velocity() -> None:
    r, shapes = filtered(), parts().shapes
    assert shapes.shape == (r.times_s.size, 5)
    moving = np.clip(np.abs(r.released), 0.0, 1.0)
    for flat in (0, 3, 4):
        np.testing.assert_allclose(shapes[:, flat], moving)
    slow = np.abs(LowPass(75.0, LOW_PASS.half_order).apply(r.acceleration_m_s2, r.rate_hz))
    np.testing.assert_allclose(shapes[:, 1], slow / slow[rows()].max(), rtol=1e-9)
    speed = np.maximum(np.cumsum(r.inside * r.acceleration_m_s2) * r.step_s, 0.0)
    np.testing.assert_allclose(shapes[:, 2], speed / speed[rows()].max(), atol=0.01)
    assert parts().duration_s == pytest.approx(r.interval_s[1] - r.interval_s[0])


def least_m_s2(regression: Regression, mass_kg: float = MASS_KG, rest_m_s2: float = 0.0) -> float:
    return MotionParts.of(regression, rows(), mass_kg, rest_m_s2).least_m_s2


def loud(seed: int) -> tuple[Regression, float]:
    """Add white noise to the accelerometer; the standard deviation behind the filter as well."""
    noise = np.random.default_rng(seed).normal(0.0, 40.0, exact().times_s.size)
    regression = replace(exact(), acceleration_m_s2=exact().acceleration_m_s2 + noise).filtered(LOW_PASS)
    return regression, float(np.std(LOW_PASS.apply(noise, regression.rate_hz)))


def test_the_white_part_is_read_from_what_the_upper_half_of_the_band_leaves() -> None:
    ratios = [least_m_s2(regression) / sigma for regression, sigma in map(loud, range(12))]
    # a median of some ninety rows is known to a tenth
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)
    # what was known before is no part of what the motion adds
    regression, sigma = loud(0)
    known = 0.6 * least_m_s2(regression)
    assert least_m_s2(regression, rest_m_s2=known) == pytest.approx(4 / 3 * known, rel=1e-9)
    assert least_m_s2(regression, rest_m_s2=10 * sigma) == 0.0


def test_no_model_is_needed_for_it() -> None:
    """A mass that is off, and a force that is off for a while, leave nothing of the band's upper half in most rows."""
    off = filtered().forces_n.copy()
    off[np.abs(filtered().times_s - 0.06) < 0.01, 1] *= 1.5
    for changed, mass_kg in ((filtered(), 1.05 * MASS_KG), (replace(filtered(), forces_n=off), MASS_KG)):
        assert least_m_s2(changed, mass_kg) < 1e-3


def test_without_a_filter_nothing_is_read_of_it() -> None:
    assert MotionParts.of(exact(), rows(), MASS_KG, 0.0).least_m_s2 == 0.0


# ------------------------------------------------------------------------------------------ likelihood, written out


def small(seed: int, count: int = 24) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows in which two unknowns are known to some uncertainty: what they leave, V at rest, X, priors' covariance."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 1.0, count)
    x = np.column_stack([np.sin(3.0 * times), np.exp(-times)])
    priors = np.diag([2.0, 0.5]) ** 2
    rest = 0.7**2 * np.exp(-np.abs(times[:, np.newaxis] - times) / 0.02)
    shapes = np.array([np.ones(count), times, times * (1.0 - times), np.ones(count), np.ones(count)])
    apart = np.abs(times[:, np.newaxis] - times)
    near = [np.eye(count)] * 3 + [np.exp(-apart / 0.03), np.exp(-apart / 0.1)]
    added = np.array([np.outer(one, one) * of for one, of in zip(shapes, near, strict=True)])
    return rng.normal(0.0, 1.6, count) + x @ rng.normal(0.0, [2.0, 0.5]), rest, x, priors, added


def restricted(sizes: np.ndarray, left: np.ndarray, rest: np.ndarray, x: np.ndarray, priors: np.ndarray,
               added: np.ndarray, scale: float) -> float:  # fmt: skip
    """Return -1/2 (r' P r + ln|V| + ln|X' V^-1 X|), the priors as rows of their own, and half-Cauchy's logarithms."""
    count, unknowns = x.shape
    v = np.zeros((count + unknowns, count + unknowns))
    v[:count, :count] = rest + sum(size**2 * part for size, part in zip(sizes, added, strict=True))
    v[count:, count:] = priors
    whole, seen = np.vstack([x, np.eye(unknowns)]), np.concatenate([left, np.zeros(unknowns)])
    inverse = np.linalg.inv(v)
    information = whole.T @ inverse @ whole
    projection = inverse - inverse @ whole @ np.linalg.inv(information) @ whole.T @ inverse
    logs = [np.linalg.slogdet(one)[1] for one in (v, information)]
    return float(-0.5 * (seen @ projection @ seen + sum(logs)) - np.sum(np.log(1.0 + (sizes / scale) ** 2)))


@pytest.mark.parametrize("seed", range(3))
def test_a_likelihood_is_the_restricted_one_of_the_textbook_times_half_cauchy_priors(seed: int) -> None:
    left, rest, x, priors, added = small(seed)
    search = _Search(left, rest + x @ priors @ x.T, added, 0.7, 0.0, 2.0)
    tried = [np.zeros(5), *np.random.default_rng(seed).uniform(0.0, 2.0, (6, 5))]
    ours = np.array([search.likelihoods(sizes, 0, sizes[:1])[0] for sizes in tried])
    written = np.array([restricted(sizes, left, rest, x, priors, added, 3 * 0.7) for sizes in tried])
    # but for a constant
    np.testing.assert_allclose(ours - ours[0], written - written[0], rtol=1e-9, atol=1e-9)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("seed", "pair"), [(0, (0, 4)), (1, (1, 3)), (2, (2, 4)), (3, (0, 3)), (7, (0, 4))])
def test_the_likeliest_sizes_are_those_of_a_grid_that_is_searched_whole(seed: int, pair: tuple[int, int]) -> None:
    left, rest, x, priors, added = small(seed)
    left = left + 1.5 * np.cumsum(np.random.default_rng(seed).normal(0.0, 0.6, left.size))
    added[[one for one in range(5) if one not in pair]] = 0.0
    found = likeliest_sizes(left, rest + x @ priors @ x.T, added, 0.7, 0.0, np.zeros(5), highest=3.0)
    assert not np.any(found[[one for one in range(5) if one not in pair]])
    grid = np.concatenate([[0.0], np.geomspace(0.2, 12.0, 60)])
    best = -np.inf
    for one, other in product(grid, grid):
        sizes = np.zeros(5)
        sizes[list(pair)] = one, other
        best = max(best, restricted(sizes, left, rest, x, priors, added, 3 * 0.7))
    # a size is moved by a fifth of a step at last, which is less than a half of its uncertainty
    assert restricted(found, left, rest, x, priors, added, 3 * 0.7) > best - 0.15


def test_the_first_part_is_at_least_what_was_read_without_a_model() -> None:
    left, rest, x, priors, added = small(0)
    given = 0.0 * left, rest + x @ priors @ x.T, added, 2.5, 2.5, np.array([2.5, 0.0, 0.0, 0.0, 0.0])
    for white_only in (False, True):
        assert likeliest_sizes(*given, highest=3.0, white_only=white_only).tolist() == [2.5, 0.0, 0.0, 0.0, 0.0]


# ------------------------------------------------------------------------------------------ sizes


def drawn(sizes: np.ndarray, seed: int, known: np.ndarray) -> np.ndarray:
    whole = known + np.tensordot(sizes**2, covariances(), 1)
    noise = np.random.default_rng(seed).standard_normal(rows().size)
    return np.linalg.cholesky(whole) @ noise


def at_rest() -> np.ndarray:
    """White noise behind the filter, and what mass, zero and friction may be off by."""
    r, times_s = filtered(), filtered().times_s[rows()]
    moved = np.column_stack([0.05 * r.acceleration_m_s2, 0.2 * r.released, 1.0 * r.friction_direction])[rows()]
    return REST_M_S2**2 * by_filter(r, times_s) + moved @ moved.T + 1e-6 * np.eye(rows().size)


def found(sizes: np.ndarray, seed: int) -> np.ndarray:
    left = drawn(sizes, seed, at_rest())
    highest = float(np.sqrt(np.mean(left**2)))
    start = np.zeros(5)
    return likeliest_sizes(left, at_rest(), covariances(), REST_M_S2, 0.0, start, highest=highest)


def deviation(sizes: np.ndarray, at: np.ndarray) -> float:
    """Return the root mean square of the rows' standard deviations."""
    return float(np.sqrt(np.mean(REST_M_S2**2 + (parts().shapes[rows()][at] ** 2) @ sizes**2)))


@pytest.mark.exhaustive
@pytest.mark.parametrize("part", range(5), ids=["white", "with the acceleration", "with the velocity", "short", "long"])
def test_noise_of_a_part_is_recovered_where_it_is_loud_and_where_it_is_not(part: int) -> None:
    true = np.zeros(5)
    true[part] = 5.0
    each = [found(true, seed) for seed in range(24)]
    shape = parts().shapes[rows(), part]
    is_loud, is_quiet = shape > 0.5, shape < 0.1
    # half-Cauchy priors share a size between two parts that explain the rows almost alike, the acceleration being large
    # in six rows only
    loudly = np.median([deviation(one, is_loud) for one in each])
    assert loudly == pytest.approx(deviation(true, is_loud), rel=0.25 if part in (1, 2) else 0.15)
    if part in (1, 2):
        assert np.median([deviation(one, is_quiet) for one in each]) < 0.75 * loudly
    else:
        # what is white and what is correlated are not taken for one another
        alike = (0, 1, 2) if part == 0 else (3, 4)
        others = [one for one in range(5) if one not in alike]
        assert np.median([np.linalg.norm(one[others]) for one in each]) < 2.0


def test_where_the_motion_adds_nothing_the_noise_is_that_of_the_rest() -> None:
    each = np.array([found(np.zeros(5), seed) for seed in range(20)])
    assert np.all(np.median(each, axis=0) == 0.0)
    added = [np.mean(np.diagonal(np.tensordot(one**2, covariances(), 1))) for one in each]
    # the rows' variance by a tenth at most, in most shots by nothing
    assert np.mean(added) < 0.1 * REST_M_S2**2


def test_white_and_long_noise_together_are_told_apart() -> None:
    each = np.array([found(np.array([6.0, 0.0, 0.0, 0.0, 9.0]), 100 + seed) for seed in range(12)])
    assert np.median(each[:, 0]) == pytest.approx(6.0, rel=0.25)
    assert np.median(np.linalg.norm(each[:, 3:], axis=1)) == pytest.approx(9.0, rel=0.35)
