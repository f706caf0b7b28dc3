"""Control charts against numbers computed by hand from their definitions, and laws that hold for every series."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from recoil_identification.campaign.charted import (
    NOISE,
    READING,
    RESIDUAL,
    ZERO,
    ChartSignal,
    charted_residuals,
    charted_sensors,
)
from recoil_identification.campaign.charts import ewma_chart, individuals_chart, trend
from recoil_identification.shot.baseline import Baseline

WHOLE_SERIES = st.lists(st.integers(-40, 40), min_size=3, max_size=40).map(lambda numbers: np.array(numbers, float))


def fired(values):
    return {name: np.flatnonzero(flags).tolist() for name, flags in individuals_chart(values).fired.items()}


def a_series_of(deviations, sigma=1.0):
    """A series whose tail has these deviations in sigma, far enough behind a quiet head that fixes centre and sigma."""
    # +d, -d, +d, .. has the mean moving range 2 d: for sigma 1 that is 1.128
    head = sigma * 0.564 * np.array([1.0, -1.0] * 1000)
    return np.concatenate([head, sigma * np.asarray(deviations, float)])


def test_centre_sigma_and_limits_are_those_of_the_definition():
    chart = individuals_chart([10.0, 12.0, 11.0, 14.0, 13.0])
    # moving ranges 2, 1, 3, 1 with the mean 1.75; sigma 1.75/1.128; mean of the values 12
    assert chart.moving_range.tolist() == [2.0, 1.0, 3.0, 1.0]
    assert chart.centre == pytest.approx(12.0)
    assert chart.sigma == pytest.approx(1.5514184)
    assert chart.limits == pytest.approx((7.3457447, 16.6542553))
    assert chart.moving_range_limit == pytest.approx(3.267 * 1.75)
    assert chart.provisional
    assert not chart.fired


def test_twenty_points_settle_the_limits():
    assert individuals_chart(np.arange(19.0)).provisional
    assert not individuals_chart(np.arange(20.0)).provisional


def test_rule_1_fires_beyond_three_sigma_and_the_moving_range_with_it():
    # nineteen ranges of 1, then 10 - 0 and 10 - 1: mean (19 + 10 + 9)/21; centre (10 + 11)/22 hardly matters
    values = [0.0, 1.0] * 10 + [10.0, 1.0]
    found = fired(values)
    assert found["rule 1"] == [20]
    assert found["moving range"] == [20, 21]
    # sigma 1.604, centre 0.955: 3 sigma end at 5.77
    assert fired([0.0, 1.0] * 10 + [2.0, 1.0]).get("rule 1") is None


def test_rule_2_fires_at_the_ninth_on_one_side_and_at_every_one_after_it():
    # the centre of ten zeros and ten ones is 0.5
    found = fired([0.0] * 10 + [1.0] * 10)
    assert found["rule 2"] == [8, 9, 18, 19]
    assert "rule 2" not in fired([0.0] * 8 + [1.0] * 8)


def test_rule_3_fires_at_the_sixth_that_rises():
    assert fired([5.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.0])["rule 3"] == [6]
    assert fired([0.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0, 5.0])["rule 3"] == [6]
    assert "rule 3" not in fired([5.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0])
    # two equal neighbours neither rise nor fall
    assert "rule 3" not in fired([5.0, 0.0, 1.0, 2.0, 2.0, 3.0, 4.0, 0.0])


@pytest.mark.parametrize(
    ("rule", "tail", "at"),
    [
        ("rule 5", [2.3, 0.0, 2.3], [2]),
        ("rule 5", [-2.3, -2.3], [1]),
        ("rule 5", [2.3, -2.3], None),
        ("rule 5", [2.3, 0.0, 0.0, 2.3], None),
        ("rule 5", [1.7, 1.7, 1.7], None),
        ("rule 6", [1.3, 1.3, 0.0, 1.3, 1.3], [4]),
        ("rule 6", [-1.3, -1.3, -1.3, -1.3], [3]),
        ("rule 6", [1.3, 1.3, -1.3, 1.3, 0.0], None),
        ("rule 6", [0.8, 0.8, 0.8, 0.8], None),
    ],
)
def test_zone_rules_fire_at_the_point_that_completes_them(rule, tail, at):
    flags = individuals_chart(a_series_of(tail)).fired.get(rule)
    found = None if flags is None else (np.flatnonzero(flags) - 2000).tolist()
    assert found == at


def test_the_weighted_average_and_its_limits_are_those_of_the_definition():
    chart = individuals_chart([1.0, 3.0, 2.0, 6.0])
    # centre 3, mean range (2 + 1 + 4)/3, sigma 2.0685579
    average = ewma_chart(chart)
    # deviations -2, 0, -1, 3: -.4, .8 (-.4) = -.32, .8 (-.32) - .2 = -.456, .8 (-.456) + .6 = .2352
    assert average.values == pytest.approx([2.6, 2.68, 2.544, 3.2352])
    # 3 sigma sqrt(.2/1.8 (1 - .8^2i)): roots of .04, .0656, .081984, .09246976
    assert average.half_width / chart.sigma == pytest.approx([0.6, 0.7683749, 0.8589854, 0.9122652], rel=1e-6)
    assert not average.fired.any()


def test_the_weighted_average_sees_a_small_shift_that_no_single_point_shows():
    # a noise of sigma 1, see above, about -1.2 and then about +1.2: no point is further off than 1.764
    values = 0.564 * np.array([1.0, -1.0] * 40) + 1.2 * np.sign(np.arange(80) - 39.5)
    assert "rule 1" not in fired(values)
    # the average tends to 1.2, its limit to sqrt(.2/1.8) 3 sigma = 1.02 (sigma has the one step in it)
    assert np.flatnonzero(ewma_chart(individuals_chart(values)).fired).max() == 79


def test_a_trend_is_the_median_of_all_slopes():
    # of the pairs of 0, 1, 2, 9 the slopes are 1, 1, 3, 1, 4, 7, with the median (1 + 3)/2; over three steps
    found = trend([0.0, 1.0, 2.0, 9.0])
    assert found.change == pytest.approx(6.0)
    # four of four in order: 2 of 24 permutations are as far from chance
    assert found.p_value == pytest.approx(2 / 24)
    assert not found.fired


def test_eight_shots_in_order_are_a_trend():
    found = trend([1.0, 2.3, 3.1, 4.5, 5.2, 6.1, 7.4, 8.0])
    # all and none of 8! orders
    assert found.p_value == pytest.approx(2 / math.factorial(8))
    assert found.fired
    assert found.change == pytest.approx(7.0, abs=2 * found.u)
    assert 0 < found.u < 1


def test_the_uncertainty_of_a_trend_is_how_far_it_scatters():
    rng = np.random.default_rng(7)
    found = [trend(rng.standard_normal(20) + 0.3 * np.arange(20)) for _ in range(200)]
    scatter = np.std([one.change for one in found])
    assert np.mean([one.u for one in found]) == pytest.approx(scatter, rel=0.2)
    assert np.mean([one.change for one in found]) == pytest.approx(0.3 * 19, abs=3 * scatter / math.sqrt(200))


@pytest.mark.whole_way
def test_a_trend_is_found_where_there_is_none_as_rarely_as_is_said():
    rng = np.random.default_rng(8)
    assert np.mean([trend(rng.standard_normal(12)).fired for _ in range(2000)]) == pytest.approx(0.005, abs=0.004)


@given(st.floats(-1e9, 1e9), st.integers(3, 60))
def test_nothing_fires_on_a_constant(value, count):
    chart = individuals_chart([value] * count)
    assert chart.centre == value
    assert chart.fired == {}
    assert not ewma_chart(chart).fired.any()
    assert not trend([value] * count).fired


@pytest.mark.whole_way
@settings(deadline=None)
@given(WHOLE_SERIES, st.integers(-1000, 1000), st.sampled_from([0.25, 2.0, 1024.0]))
def test_a_shift_and_another_unit_change_nothing_that_fires(values, shift, scale):
    before, after = individuals_chart(values), individuals_chart(scale * values + shift)
    # a point that stands on a limit to the last bit may fall to either side
    apart = (values - before.centre) / before.sigma if before.sigma else np.ones(values.size)
    assume(all(np.abs(np.abs(apart) - limit).min() > 1e-9 for limit in (0.0, 1.0, 2.0, 3.0)))
    assert after.centre == pytest.approx(scale * before.centre + shift, abs=1e-9 * scale * 1000)
    assert after.sigma == pytest.approx(scale * before.sigma)
    assert {name: flags.tolist() for name, flags in after.fired.items()} == {
        name: flags.tolist() for name, flags in before.fired.items()
    }
    assert trend(scale * values + shift).change == pytest.approx(scale * trend(values).change, abs=1e-6)


@settings(deadline=None)
@given(WHOLE_SERIES)
def test_upside_down_the_same_fires(values):
    assert fired(values) == fired(-values)
    assert trend(-values).change == pytest.approx(-trend(values).change)


@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, math.nan, 2.0], [[1.0, 2.0, 3.0]]])
def test_no_chart_of_less_than_three_numbers(values):
    with pytest.raises(ValueError, match="3 or more finite values"):
        individuals_chart(values)


def before(channel, offset, noise, sensor="4711", at_rest=0.0):
    return Baseline(channel, "breech_pressure", sensor, offset, noise, "Pa", at_rest)


def names(count):
    return [f"{k:04d}" for k in range(1, count + 1)]


def test_a_zero_that_creeps_is_a_trend_of_that_sensor_with_its_size():
    shots = [(name, [before("p", 100.0 * k + (-1) ** k, 50.0)]) for k, name in enumerate(names(12))]
    zero, noise = charted_sensors(shots)
    assert (zero.influence, zero.quantity, zero.unit) == ("p, sensor 4711", ZERO, "Pa")
    assert noise.quantity == NOISE
    assert noise.signals == ()
    (found,) = [signal for signal in zero.signals if signal.rule == "trend"]
    assert found.shots == ("0001", "0012")
    assert found.size == pytest.approx(1100.0, rel=0.01)
    assert found.unit == "Pa"
    assert str(found).startswith("p, sensor 4711, zero: a trend of +1.1e+03 Pa, u ")


def test_a_noise_that_doubles_is_a_share_of_it():
    shots = [(name, [before("p", 0.0, 50.0 * 2 ** (k / 11))]) for k, name in enumerate(names(12))]
    (found,) = [one for chart in charted_sensors(shots) for one in chart.signals if one.rule == "trend"]
    assert found.unit == "1"
    # of its logarithm
    assert found.size == pytest.approx(math.log(2.0))


def test_another_serial_number_is_another_sensor():
    shots = [(name, [before("p", 1e5 * (k > 4), 50.0, "old" if k < 5 else "new")]) for k, name in enumerate(names(10))]
    charts = charted_sensors(shots)
    assert {one.influence for one in charts} == {"p, sensor old", "p, sensor new"}
    assert not any(one.signals for one in charts)


def test_what_was_not_read_is_left_out_of_the_chart_and_too_little_is_no_chart():
    some = [(name, [before("p", None if k == 2 else float(k % 2), 0.0)]) for k, name in enumerate(names(5))]
    (zero,) = charted_sensors(some)
    assert zero.shots == ("0001", "0002", "0004", "0005")
    assert charted_sensors(some[:2]) == ()


def test_where_the_zero_is_not_known_the_reading_itself_is_charted():
    shots = [(name, [before("p", 1.6e6 + k % 2, 50.0, at_rest=None)]) for k, name in enumerate(names(5))]
    assert [one.quantity for one in charted_sensors(shots)] == [READING, NOISE]


def test_a_residual_that_stands_out_is_a_signal_of_the_mass():
    (chart,) = charted_residuals(names(22), [0.5, -0.5] * 10 + [6.0, 0.0])
    assert chart.quantity == RESIDUAL
    (found,) = [one for one in chart.signals if one.rule == "rule 1"]
    assert (found.influence, found.shots, found.size) == ("mass", ("0021",), None)
    assert str(found) == "mass, residual: beyond 3 sigma at shot 0021 (rule 1)"
    assert charted_residuals(names(2), [0.0, 1.0]) == ()


def test_a_sentence_names_eight_shots_and_counts_the_rest():
    told = str(ChartSignal("mass", RESIDUAL, "rule 2", tuple(names(11)), provisional=True))
    assert told.endswith("0007, 0008 and 3 more (rule 2, limits provisional)")


def test_a_baseline_comes_back_from_a_report():
    one = before("p", None, 3.5, at_rest=None)
    assert Baseline.of_json(one.to_json()) == one
