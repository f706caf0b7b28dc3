"""Peaks, time and impulse of a shot with their uncertainties, against what the virtual rig fired."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.shot.peaks import Peak, peaks_of
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.fired_quantities import fired_quantities
from tests.builders.virtual_shots import identified, virtual_shot, with_channels, without_channels

FURTHEST = 3.5
"""Standard uncertainties by which a quantity may be off in one shot."""
MOVING = 0.003
"""Share of its range by which a gauge's zero moves: far more than a gauge should."""


@pytest.mark.parametrize(
    ("seed", "settings"),
    [
        (3, {}),
        pytest.param(5, {"u_zero_rel": MOVING, "kind": False}, marks=pytest.mark.whole_way),
        pytest.param(6, {"u_zero_rel": MOVING, "kind": False}, marks=pytest.mark.whole_way),
    ],
)
def test_each_quantity_is_what_was_fired_within_its_uncertainty(
    seed: int, settings: Mapping[str, float | bool]
) -> None:
    found = identified(seed=seed, **settings)
    peaks, true = peaks_of(found), fired_quantities(found, virtual_shot(seed=seed, **settings).rig, seed, "s1")
    assert peaks.keys() == true.keys()
    off = {name: (peak.value - true[name]) / peak.u for name, peak in peaks.items()}
    assert all(abs(one) < FURTHEST for one in off.values()), off
    assert peaks["impulse_n_s"].value == pytest.approx(true["impulse_n_s"], rel=0.01)
    assert all(0 < peak.u < 0.02 * peak.value for peak in peaks.values())


def test_the_parts_add_up_and_the_largest_rules() -> None:
    peak = Peak(10.0, {"scale": 0.3, "zero": 0.4})
    assert peak.u == pytest.approx(0.5)
    assert peak.ruled_by == "zero"
    low, high = peak.interval
    assert (low + high, high - low) == pytest.approx((20.0, 2 * 1.96 * 0.5), rel=1e-4)
    assert math.isinf(Peak(10.0).u)


def test_a_part_that_is_guessed_widens_the_interval_as_students_t_does() -> None:
    peak = Peak(10.0, {"scale": 0.3, "zero": 0.4}, freedom={"zero": 8.0})
    freedom = 0.5**4 / (0.4**4 / 8.0)
    assert peak.degrees_of_freedom == pytest.approx(freedom)
    low, high = peak.interval
    assert high - low == pytest.approx(2 * stats.t.ppf(0.975, freedom) * 0.5)


@pytest.mark.whole_way
def test_each_part_is_what_the_quantity_moves_by_if_its_source_does() -> None:
    """A source moved by its uncertainty moves the unknowns by its contributions, as a refit finds."""
    found = identified(seed=5, u_zero_rel=MOVING, kind=False)
    route, inferred, peaks = found.route, found.route.calibration.inferred, peaks_of(found)
    for number, source in enumerate(inferred.sources):
        values = inferred.values + inferred.contributions[:, number]
        moved = replace(route.calibration, inferred=replace(inferred, values=values))
        for name, other in peaks_of(replace(found, route=replace(route, calibration=moved))).items():
            change, peak = abs(other.value - peaks[name].value), peaks[name]
            assert change == pytest.approx(peak.parts[source], rel=0.05, abs=0.02 * peak.u), (name, source)


@pytest.mark.whole_way
def test_without_a_camera_the_integrals_are_as_uncertain_as_they_are() -> None:
    settings = {"u_zero_rel": MOVING, "kind": False}
    virtual = virtual_shot(seed=5, **settings)
    alone = identify_shot(FiredShot(without_channels(virtual.shot, "x_camera"), virtual.rig), Options())
    peaks, both, true = (
        peaks_of(alone),
        peaks_of(identified(seed=5, **settings)),
        fired_quantities(alone, virtual.rig, 5, "s1"),
    )
    for name in ("recoil_velocity_m_s", "recoil_travel_m", "recoil_time_s"):
        assert abs(peaks[name].value - true[name]) < FURTHEST * peaks[name].u
        assert peaks[name].u > both[name].u


@pytest.mark.whole_way
def test_zeros_that_moved_are_taken_off_the_impulse() -> None:
    """A gauge whose zero moves by a whole per cent of its range reads as much more impulse; what is stated does not."""
    settings, moved_pa = {"u_zero_rel": 0.01}, 1e6
    virtual = virtual_shot(seed=4, **settings)
    breech = virtual.shot.channels["p_breech"]
    since_s = np.maximum(breech.time_base.times_s - virtual.truth["t_fire"], 0.0)
    samples = np.asarray(breech.samples) - moved_pa * np.expm1(-since_s / 20e-3)
    found = identify_shot(FiredShot(with_channels(virtual.shot, p_breech=samples), virtual.rig), Options())
    before, after = (peaks_of(one)["impulse_n_s"] for one in (identified(seed=4, **settings), found))
    t0, t1 = found.route.recorded.interval_s
    read_n_s = moved_pa * virtual.rig.mechanism.bore_area * (t1 - t0)
    assert read_n_s > 0.05 * before.value
    assert after.value == pytest.approx(before.value, rel=2e-3)


@pytest.mark.whole_way
def test_of_a_clipped_channel_no_peak_is_claimed():
    virtual = virtual_shot("field-2013")
    breech = virtual.shot.channels["p_breech"]
    range_pa = 1e6 * virtual.rig.channel("p_breech").sensor.range[1]
    samples = np.minimum(np.asarray(breech.samples) * 1.1 * range_pa / np.max(breech.samples), range_pa)
    found = identify_shot(FiredShot(with_channels(virtual.shot, p_breech=samples), virtual.rig), Options())
    assert any(one.repair.kind.clips for one in found.route.signals.repairs)
    whole = peaks_of(identified("field-2013"))
    assert whole.keys() - peaks_of(found).keys() == {"breech_pressure_pa", "impulse_n_s"}
