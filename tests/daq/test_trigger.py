"""The trigger: what fires, what does not, and that blocks, rates and order of arrival change nothing."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import Fault
from recoil_acquisition.trigger import Decision, Trigger, TriggerDetector, find_triggers, state
from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window
from recoil_acquisition.trigger.decision import Suppression
from recoil_acquisition.trigger.shot_window import ShotCutter
from recoil_acquisition.trigger.table import declared_trigger

NAN = math.nan
ACCELEROMETER = {"acc": ""}


def trigger_faults(table: Any, channels: dict[str, str]) -> list[Fault]:
    faults: list[Fault] = []
    made = declared_trigger(table, channels, faults)
    assert (made is None) == bool(faults)
    return faults


def trigger_from_table(table: Any, channels: dict[str, str]) -> Trigger:
    faults: list[Fault] = []
    made = declared_trigger(table, channels, faults)
    assert made is not None, faults
    return made


def fired(decisions) -> list[float]:
    """Return the instants of the triggers."""
    return [d.time_s for d in decisions if d.outcome == "trigger"]


def suppressed(decisions) -> list[tuple[float, str]]:
    return [(d.time_s, d.reason) for d in decisions if d.outcome == "suppressed"]


def found(condition, values, times_s=None, *, post_s: float = 1e-9, **options) -> tuple[Decision, ...]:
    """Find a condition's triggers in samples one second apart, each with a post time of almost nothing."""
    times_s = np.arange(len(values)) if times_s is None else times_s
    return find_triggers(Trigger((condition,), post_s=post_s, **options), {"a": (times_s, np.array(values, float))})


# --- each condition by itself


def test_a_rising_edge_fires_at_the_first_sample_that_reaches_the_level():
    assert fired(found(Edge("a", 5.0), [0, 4, 5, 9, 5, 4, 5])) == [2, 6]


def test_a_falling_edge_fires_at_the_first_sample_that_reaches_the_level_from_above():
    assert fired(found(Edge("a", 5.0, slope="falling"), [9, 6, 5, 0, 5, 6, 5])) == [2, 6]
    assert fired(found(Edge("a", 5.0, 8.0, "falling"), [9, 6, 5, 0, 8, 3, 8.1, 5])) == [2, 7]


def test_a_decision_says_where_it_came_from():
    (decision,) = found(Edge("a", 5.0), [0, 1, 3, 7])
    assert decision == Decision(3.0, "trigger", "", "a", 0, 3, 7.0, 2.5)


def test_the_crossing_is_found_over_lost_samples_and_block_borders():
    detector = TriggerDetector(Trigger((Edge("a", 5.0, slope="falling"),)), ["a"])
    detector.arm(0.0)
    assert detector.feed("a", [0.0, 1.0], [9.0, 9.0]) == []
    assert detector.feed("a", [2.0], [NAN]) == []
    (decision,) = detector.feed("a", [3.0], [1.0])
    assert (decision.time_s, decision.crossing_s, decision.index, decision.value) == (3.0, 2.0, 3, 1.0)


def test_chatter_at_the_level_fires_often_without_a_rearm_level_and_once_with_it():
    rng = np.random.default_rng(3)
    pulse = np.concatenate((np.zeros(500), np.linspace(0, 10, 1000), np.full(500, 10.0), np.linspace(10, 0, 1000)))
    values = np.tile(pulse, 2) + rng.normal(0, 0.2, 2 * pulse.size)
    assert len(fired(found(Edge("a", 5.0), values))) > 20
    assert len(fired(found(Edge("a", 5.0, rearm=3.5), values))) == 2


def test_a_window_fires_when_the_signal_enters_it_from_either_side():
    condition = Window("a", 2.0, 4.0)
    decisions = found(condition, [0, 3, 3, 5, 3, 9, 0, 2, 1, 4, 4.1])
    assert fired(decisions) == [1, 4, 7, 9]
    assert [d.crossing_s for d in decisions] == [pytest.approx(2 / 3), 3.5, 7.0, pytest.approx(25 / 3)]


def test_a_window_fires_when_the_signal_leaves_it_to_either_side():
    decisions = found(Window("a", 2.0, 4.0, on="leave"), [3, 5, 3, 1, 3, 4, 3, 3.9])
    assert fired(decisions) == [1, 3, 5]
    assert [d.crossing_s for d in decisions] == [0.5, 2.5, 5.0]


def test_a_jump_over_a_window_does_not_enter_it():
    assert found(Window("a", 2.0, 4.0), [0, 9, 0, 9]) == ()


def test_hysteresis_of_a_window_keeps_chatter_at_its_border_out():
    values = [3, 4.1, 3.9, 4.1, 3.9, 4.1, 3.0, 4.1]
    assert fired(found(Window("a", 2.0, 4.0, on="leave"), values)) == [1, 3, 5, 7]
    assert fired(found(Window("a", 2.0, 4.0, on="leave", hysteresis=0.5), values)) == [1, 7]
    assert fired(found(Window("a", 2.0, 4.0, hysteresis=0.5), [9, 4, 4.1, 4, 4.5, 4, 4.6, 4])) == [1, 7]


def test_a_slope_fires_on_the_rate_of_change_whatever_the_sampling():
    times_s = [0.0, 1.0, 1.5, 2.0, 4.0, 5.0]
    decisions = found(RateOfChange("a", 4.0), [0, 1, 2, 5, 9, 20], times_s)
    assert [(d.time_s, d.value, d.crossing_s) for d in decisions] == [(2.0, 6.0, 2.0), (5.0, 11.0, 5.0)]
    assert fired(found(RateOfChange("a", -4.0, -1.0, "falling"), [0, -5, -10, -10, -15])) == [4]


def test_a_slope_over_a_time_does_not_take_noise_for_a_rise():
    noise = np.where(np.arange(200) % 2, 0.1, -0.1)
    values = np.where(np.arange(200) < 100, 0.0, np.arange(200) - 100.0) * 0.05 + noise
    times_s = np.arange(200) * 0.01
    assert len(fired(found(RateOfChange("a", 3.0), values, times_s))) > 50
    (at_s,) = fired(found(RateOfChange("a", 3.0, over_s=0.199), values, times_s))
    assert 1.0 < at_s < 1.25


def test_a_slope_over_a_time_takes_the_last_sample_that_is_old_enough():
    times_s, values = [0.0, 1.0, 1.5, 3.0, 3.5, 9.0], [0, 0, 10, 3, 8, 9]
    decisions = found(RateOfChange("a", 0.0, over_s=2.0, rearm=-100.0), values, times_s)
    assert [(d.time_s, d.value, d.reason) for d in decisions] == [(3.0, 1.5, Suppression.BEYOND_AT_ARM)]


def test_a_long_pulse_fires_as_soon_as_it_has_lasted_long_enough():
    values = [0, 9, 9, 0, 9, 9, 9, 9, 9, 0, 9, 9]
    decisions = found(PulseWidth("a", 5.0, longer_than_s=2.5), values)
    assert [(d.time_s, d.index, d.crossing_s) for d in decisions] == [(7.0, 7, 7.0)]
    assert fired(found(PulseWidth("a", 5.0, longer_than_s=2.0), values)) == [3, 6]


def test_a_short_pulse_fires_when_it_ends():
    values = [0, 9, 9, 0, 9, 9, 9, 9, 9, 0, 9, 0]
    assert fired(found(PulseWidth("a", 5.0, shorter_than_s=2.5), values)) == [3, 11]
    assert fired(found(PulseWidth("a", 5.0, shorter_than_s=2.0), values)) == [11]
    assert fired(found(PulseWidth("a", 5.0, longer_than_s=1.5, shorter_than_s=2.5), values)) == [3]
    assert fired(found(PulseWidth("a", -5.0, slope="falling", shorter_than_s=1.5), -np.array(values))) == [11]


def test_a_pulse_lasts_until_the_signal_is_below_the_rearm_level():
    assert fired(found(PulseWidth("a", 5.0, rearm=2.0, longer_than_s=3.0), [0, 9, 3, 3, 3, 0])) == [4]
    assert fired(found(PulseWidth("a", 5.0, longer_than_s=3.0), [0, 9, 3, 9, 3, 0])) == []


def test_a_pulse_that_was_there_when_arming_is_none():
    assert fired(found(PulseWidth("a", 5.0, longer_than_s=1.0), [9, 9, 9, 9, 0, 9, 9])) == [6]


# --- arming


def test_a_signal_already_beyond_the_level_when_arming_does_not_fire_and_that_is_told_once():
    decisions = found(Edge("a", 5.0, rearm=2.0), [9, 9, 4, 9, 3, 9, 1, 9])
    assert fired(decisions) == [7]
    assert suppressed(decisions) == [(0.0, Suppression.BEYOND_AT_ARM)]


def test_a_signal_between_the_levels_when_arming_must_be_below_the_rearm_level_first():
    decisions = found(Edge("a", 5.0, rearm=2.0), [3, 4, 6, 3, 6, 1, 6])
    assert fired(decisions) == [6]
    assert suppressed(decisions) == [(2.0, Suppression.BEYOND_AT_ARM)]


def test_samples_before_arming_do_not_count():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),)), ["a"])
    detector.arm(2.5)
    decisions = detector.feed("a", np.arange(6.0), [0, 9, 0, 9, 0, 9])
    assert [(d.time_s, d.reason, d.index) for d in decisions] == [(3.0, Suppression.BEYOND_AT_ARM, 3), (5.0, "", 5)]


def test_what_happens_while_it_is_not_armed_is_stored():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),)), ["a"])
    assert not detector.armed
    assert suppressed(detector.feed("a", [0.0, 1.0], [0, 9])) == [(1.0, Suppression.NOT_ARMED)]
    detector.arm(2.0)
    assert detector.armed
    assert fired(detector.feed("a", [2.0, 3.0], [0, 9])) == [3.0]
    assert detector.disarm() == []
    decisions = detector.feed("a", [8.0, 9.0], [0, 9])
    assert [(d.time_s, d.reason, d.index) for d in decisions] == [(9.0, Suppression.NOT_ARMED, 5)]


def test_arming_again_asks_for_a_new_crossing():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),)), ["a"])
    detector.arm(0.0)
    assert fired(detector.feed("a", [0.0, 1.0], [0, 9])) == [1.0]
    detector.arm(2.0)
    assert fired(detector.feed("a", [2.0, 3.0, 4.0, 5.0], [9, 9, 0, 9])) == [5.0]


# --- holdoff, post time, extension, manual


def test_holdoff_counts_from_the_last_trigger_and_not_from_what_it_suppressed():
    decisions = found(Edge("a", 5.0), [0, 9, 0, 9, 0, 9, 0, 9], holdoff_s=5.0)
    assert fired(decisions) == [1, 7]
    assert suppressed(decisions) == [(3, Suppression.HOLDOFF), (5, Suppression.HOLDOFF)]
    assert fired(found(Edge("a", 5.0), [0, 9, 0, 9, 0, 9], holdoff_s=2.0)) == [1, 3, 5]


def test_a_trigger_within_the_post_time_is_suppressed_or_extends_it():
    values = [0, 9, 0, 9, 0, 9, 0, 0, 0, 9]
    decisions = found(Edge("a", 5.0), values, post_s=3.0)
    assert fired(decisions) == [1, 5, 9]
    assert suppressed(decisions) == [(3, Suppression.WITHIN_POST)]
    extended = found(Edge("a", 5.0), values, post_s=3.0, extend=True)
    assert [(d.time_s, d.outcome) for d in extended] == [
        (1, "trigger"),
        (3, "extension"),
        (5, "extension"),
        (9, "trigger"),
    ]


def test_holdoff_keeps_a_shot_from_being_extended():
    decisions = found(Edge("a", 5.0), [0, 9, 0, 9, 0, 9], post_s=10.0, holdoff_s=3.0, extend=True)
    assert [(d.time_s, d.outcome, d.reason) for d in decisions] == [
        (1, "trigger", ""),
        (3, "suppressed", Suppression.HOLDOFF),
        (5, "extension", ""),
    ]


def test_a_manual_trigger_follows_the_same_rules():
    detector = TriggerDetector(Trigger((), post_s=2.0, holdoff_s=3.0), [])
    assert suppressed(detector.fire_manually(0.0)) == [(0.0, Suppression.NOT_ARMED)]
    detector.arm(0.0)
    assert detector.fire_manually(1.0) == [Decision(1.0, "trigger", "", "", -1, -1, None, 1.0)]
    assert suppressed(detector.fire_manually(2.0)) == [(2.0, Suppression.HOLDOFF)]
    assert fired(detector.fire_manually(4.0)) == [4.0]


@pytest.mark.parametrize("extend", [False, True])
def test_a_manual_trigger_does_not_swallow_a_crossing_that_follows_it(extend):
    trigger = Trigger((Edge("a", 5.0),), pre_s=0.5, post_s=2.0, holdoff_s=5.0, extend=extend)
    detector, cutter = TriggerDetector(trigger, ["a"]), ShotCutter(trigger, ["s"])
    detector.arm(-math.inf)
    decisions = [*detector.fire_manually(1.0), *detector.feed("a", [0.0, 1.9, 2.5, 3.5], [0, 9, 0, 9])]
    assert [(d.time_s, d.outcome) for d in decisions[:2]] == [(1.0, "trigger"), (1.9, "trigger")]
    assert (decisions[2].time_s, decisions[2].reason) == (3.5, Suppression.HOLDOFF)
    cutter.note(decisions)
    cutter.advance("s", 0.0, 10.0)
    assert [(w.start_s, w.stop_s) for w in cutter.ready(10.0)] == [(0.5, 3.0), (pytest.approx(1.4), 3.9)]


def test_a_manual_trigger_does_not_swallow_a_crossing_that_was_on_its_way():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),), holdoff_s=5.0), ["a"])
    detector.arm(-math.inf)
    detector.feed("a", [0.0], [0.0])
    assert fired(detector.fire_manually(1.0)) == [1.0]
    assert fired(detector.feed("a", [0.9], [9.0])) == [0.9]


def test_a_manual_trigger_right_after_a_shot_is_held_off_by_it():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),), holdoff_s=5.0), ["a"])
    detector.arm(-math.inf)
    assert fired(detector.feed("a", [0.0, 1.0], [0, 9])) == [1.0]
    assert suppressed(detector.fire_manually(2.0)) == [(2.0, Suppression.HOLDOFF)]


def test_a_manual_trigger_that_is_switched_off_is_stored():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),), manual=False), ["a"])
    detector.arm(0.0)
    assert suppressed(detector.fire_manually(1.0)) == [(1.0, Suppression.NO_MANUAL)]


def test_a_manual_trigger_comes_after_what_was_waiting():
    detector = TriggerDetector(Trigger((Edge("a", 5.0), Edge("b", 5.0)), post_s=9.0), ["a", "b"], max_lag_s=100.0)
    detector.arm(0.0)
    assert detector.feed("a", [0.0, 1.0, 2.0, 3.0], [0, 9, 0, 9]) == []
    decisions = detector.fire_manually(2.5)
    assert [(d.time_s, d.outcome, d.channel) for d in decisions] == [(1.0, "trigger", "a"), (2.5, "suppressed", "")]
    assert suppressed(detector.finish()) == [(3.0, Suppression.WITHIN_POST)]


# --- several channels


def test_any_takes_the_first_condition_in_time_over_channels_of_different_rates():
    fast, slow = np.arange(0, 10, 0.001), np.arange(0, 10, 0.5)
    trigger = Trigger((Edge("fast", 5.0), Edge("slow", 5.0)), post_s=1.0)
    channels = {"fast": (fast, (fast > 7.2) * 9.0), "slow": (slow, (slow > 3.1) * 9.0)}
    decisions = find_triggers(trigger, channels)
    assert [(d.time_s, d.channel, d.condition) for d in decisions] == [
        (3.5, "slow", 1),
        (pytest.approx(7.201), "fast", 0),
    ]


def test_all_fires_when_the_last_condition_is_met_while_the_others_still_are():
    fast, slow = np.arange(0, 10, 0.001), np.arange(0, 10, 0.5)
    up = ((fast > 1.0) & (fast < 2.0)) | (fast > 4.25)
    channels = {"fast": (fast, up * 9.0), "slow": (slow, ((slow > 2.2) & (slow < 6.0)) * 9.0)}
    trigger = Trigger((Edge("fast", 5.0), Edge("slow", 5.0)), "all")
    (decision,) = find_triggers(trigger, channels)
    assert (decision.time_s, decision.channel) == (pytest.approx(4.251), "fast")
    later = {**channels, "slow": (slow, ((slow > 5.2) & (slow < 6.0)) * 9.0)}
    (decision,) = find_triggers(trigger, later)
    assert (decision.time_s, decision.channel) == (5.5, "slow")


def test_all_counts_a_pulse_that_ended_only_for_its_instant():
    conditions = (PulseWidth("a", 5.0, shorter_than_s=1.5), Edge("b", 5.0))
    times_s = np.arange(8.0)
    pulse = [0, 0, 9, 0, 0, 0, 0, 0]
    before = find_triggers(
        Trigger(conditions, "all"), {"a": (times_s, pulse), "b": (times_s, [0, 9, 9, 9, 0, 0, 0, 0])}
    )
    assert fired(before) == [3]
    after = find_triggers(Trigger(conditions, "all"), {"a": (times_s, pulse), "b": (times_s, [0, 0, 0, 0, 9, 9, 9, 9])})
    assert after == ()


def test_a_condition_that_is_met_when_arming_does_not_count_for_all():
    times_s = np.arange(6.0)
    channels = {"a": (times_s, [9, 9, 9, 0, 9, 9]), "b": (times_s, [0, 9, 9, 9, 9, 9])}
    decisions = find_triggers(Trigger((Edge("a", 5.0), Edge("b", 5.0)), "all"), channels)
    assert fired(decisions) == [4]
    assert suppressed(decisions) == [(0.0, Suppression.BEYOND_AT_ARM)]


def test_two_conditions_on_one_channel_are_both_looked_at():
    trigger = Trigger((Edge("a", 5.0), Edge("a", -5.0, slope="falling")), post_s=0.5)
    decisions = find_triggers(trigger, {"a": (np.arange(5.0), [0, 9, 0, -9, 0])})
    assert [(d.time_s, d.condition) for d in decisions] == [(1, 0), (3, 1)]


def test_any_does_not_wait_for_a_channel_that_is_silent():
    trigger = Trigger((Edge("a", 5.0), Edge("dead", 5.0)))
    detector = TriggerDetector(trigger, ["a", "dead"], max_lag_s=0.5)
    detector.arm(0.0)
    assert detector.feed("a", [0.0, 1.0], [0, 9]) == []
    assert fired(detector.feed("a", [1.2, 1.4], [9, 9])) == []
    assert fired(detector.feed("a", [1.6], [9])) == [1.0]


def test_what_still_waits_for_a_slow_channel_is_decided_before_arming_or_disarming():
    detector = TriggerDetector(Trigger((Edge("a", 5.0), Edge("b", 5.0)), post_s=0.1), ["a", "b"], max_lag_s=9.0)
    assert detector.feed("a", [0.0, 1.0], [0, 9]) == []
    assert suppressed(detector.arm(2.0)) == [(1.0, Suppression.NOT_ARMED)]
    assert detector.feed("a", [2.0, 3.0], [0, 9]) == []
    assert fired(detector.disarm()) == [3.0]
    assert detector.finish() == []


def test_arming_forgets_what_was_met_for_all():
    detector = TriggerDetector(Trigger((Edge("a", 5.0), Edge("b", 5.0)), "all"), ["a", "b"])
    detector.arm(0.0)
    detector.feed("a", [0.0, 1.0], [0, 9])
    detector.feed("b", [0.0, 1.0], [0, 0])
    detector.arm(2.0)
    detector.feed("a", [2.0, 3.0, 4.0, 5.0], [9, 9, 0, 9])
    decisions = detector.feed("b", [2.0, 3.0, 4.0, 5.0], [0, 9, 9, 9])
    assert fired(decisions) == [5.0]


def test_any_decides_late_on_what_a_stalled_channel_brings():
    trigger = Trigger((Edge("a", 5.0), Edge("b", 5.0)), post_s=0.5)
    detector = TriggerDetector(trigger, ["a", "b"], max_lag_s=0.5)
    detector.arm(0.0)
    detector.feed("b", [0.0], [0])
    assert detector.feed("a", np.arange(0, 5, 0.1), np.zeros(50)) == []
    assert fired(detector.feed("b", [1.0, 2.0], [0, 9])) == [2.0]
    assert fired(detector.feed("a", [5.0, 6.0], [9, 9])) == [5.0]
    assert suppressed(detector.feed("b", [3.0, 4.0], [0, 9])) == [(4.0, Suppression.TOO_LATE)]


def test_all_waits_for_a_channel_that_stalls():
    trigger = Trigger((Edge("a", 5.0), Edge("b", 5.0)), "all")
    detector = TriggerDetector(trigger, ["a", "b"], max_lag_s=0.1)
    detector.arm(0.0)
    assert detector.feed("a", np.arange(10.0), [0, 0, 9, 9, 9, 0, 0, 0, 0, 0]) == []
    assert fired(detector.feed("b", np.arange(10.0), [0, 9, 9, 9, 9, 0, 0, 0, 0, 0])) == [2.0]


def test_channels_that_the_trigger_does_not_name_are_passed_over():
    detector = TriggerDetector(Trigger((Edge("a", 5.0),)), ["a", "other"])
    detector.arm(0.0)
    assert detector.feed("other", [5.0, 6.0], [0, 9]) == []
    assert fired(detector.feed("a", [0.0, 1.0], [0, 9])) == [1.0]


# --- lost samples and odd numbers


def test_lost_samples_neither_trigger_nor_rearm():
    assert fired(found(Edge("a", 5.0), [0, NAN, 9, NAN, 9, 0, NAN, 9])) == [2, 7]
    assert fired(found(RateOfChange("a", 4.0), [0, NAN, 6, NAN, 6, 20])) == [5]
    assert fired(found(PulseWidth("a", 5.0, longer_than_s=2.0), [0, 9, NAN, NAN, 9, 0])) == [4]
    assert found(Window("a", 2.0, 4.0), [NAN] * 5) == ()


def test_infinite_samples_are_beyond_every_level_and_have_no_rate():
    assert fired(found(Edge("a", 5.0), [0, math.inf, -math.inf, math.inf])) == [1, 3]
    assert fired(found(Window("a", 2.0, 4.0), [-math.inf, 3, math.inf, 3])) == [1, 3]
    assert found(RateOfChange("a", 4.0), [0, math.inf, 0, -math.inf, 0]) == ()


def test_repeated_stamps_have_no_rate_between_them():
    assert fired(found(RateOfChange("a", 4.0), [0, 9, 9, 18], [0.0, 0.0, 1.0, 2.0])) == [2.0]


@pytest.mark.parametrize("dtype", [np.float32, np.int16, np.uint8, bool])
def test_samples_of_any_kind_are_compared_as_they_are(dtype):
    samples = np.array([0, 1, 0, 1], dtype=dtype)
    decisions = find_triggers(Trigger((Edge("a", 1.0),), post_s=0.1), {"a": (np.arange(4.0), samples)})
    assert fired(decisions) == [1, 3]
    single = np.array([0.0, np.float32(0.1)], dtype=np.float32)
    assert find_triggers(Trigger((Edge("a", float(single[1]) + 1e-12),)), {"a": ([0.0, 1.0], single)}) == ()


# --- laws


def one_by_one(condition, times_s, values) -> list[tuple[float, str]]:
    """Walk through the samples with the definitions in hand: what the vectorised states must agree with."""
    level, rearm = condition.thresholds
    known = [(t, v) for t, v in zip(times_s, values, strict=True) if not math.isnan(v)]
    if isinstance(condition, RateOfChange):
        rated = []
        for i, (t, v) in enumerate(known):
            past = [j for j in range(i) if not condition.over_s or known[j][0] <= t - condition.over_s]
            if past:
                rated.append((t, (v - known[past[-1]][1]) / (t - known[past[-1]][0])))
        known = rated
    state, start_s, told, turns = "unknown", 0.0, False, []
    for t, v in known:
        quantity = float(condition.compared(np.array([v]))[0])
        longer, shorter = getattr(condition, "longer_than_s", None), getattr(condition, "shorter_than_s", None)
        early = longer is not None and shorter is None
        if state == "met" and early and not told and t >= start_s + longer:
            told = True
            turns.append((t, "MET"))
        if quantity >= level and state == "low":
            state, start_s, told = "met", t, False
            if not isinstance(condition, PulseWidth):
                turns.append((t, "MET"))
        elif quantity >= level and state == "unknown":
            state = "beyond"
            turns.append((t, "BEYOND"))
        elif quantity < rearm:
            width_s = t - start_s
            if state == "met" and shorter is not None and width_s < shorter and t >= start_s + (longer or 0.0):
                turns.append((t, "MET"))
            state = "low"
    return turns


numbers = st.sampled_from([-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, NAN])
slopes = st.sampled_from(["rising", "falling"])


@st.composite
def conditions(draw, channel: str):
    kind = draw(st.sampled_from(["edge", "window", "slope", "width"]))
    if kind == "window":
        on = draw(st.sampled_from(["enter", "leave"]))
        return Window(channel, -1.0, 2.0, on, draw(st.sampled_from([0.0, 1.0])))
    slope, level = draw(slopes), draw(st.sampled_from([-1.0, 0.0, 1.0]))
    margin = draw(st.sampled_from([None, 0.0, 1.0, 2.0]))
    rearm = None if margin is None else level - margin if slope == "rising" else level + margin
    if kind == "edge":
        return Edge(channel, level, rearm, slope)
    if kind == "slope":
        return RateOfChange(channel, level, rearm, slope, draw(st.sampled_from([0.0, 0.25, 1.0])))
    longer, shorter = draw(st.sampled_from([(0.5, None), (1.0, None), (None, 1.0), (0.5, 1.5)]))
    return PulseWidth(channel, level, rearm, slope, longer, shorter)


@st.composite
def recordings(draw):
    steps = st.sampled_from([0.125, 0.25, 0.5])
    values = draw(st.lists(numbers, min_size=1, max_size=60))
    return np.cumsum(draw(st.lists(steps, min_size=len(values), max_size=len(values)))), np.array(values)


@st.composite
def pieces(draw, recording):
    times_s, values = recording
    cuts = sorted(draw(st.lists(st.integers(0, len(values)), max_size=8)))
    return list(zip(np.split(times_s, cuts), np.split(values, cuts), strict=True))


@pytest.mark.exhaustive
@settings(max_examples=250, deadline=None)
@given(condition=conditions("a"), recording=recordings())
def test_the_conditions_are_met_where_their_definitions_say(condition, recording):
    decisions = find_triggers(Trigger((condition,), post_s=1e-9), {"a": recording})
    turns = [(d.time_s, "BEYOND" if d.reason == Suppression.BEYOND_AT_ARM else "MET") for d in decisions]
    assert turns == one_by_one(condition, *recording)
    for decision in decisions:
        assert decision.crossing_s <= decision.time_s == recording[0][decision.index]
        if not isinstance(condition, RateOfChange):
            assert decision.value == recording[1][decision.index]


@pytest.mark.exhaustive
@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_neither_blocks_nor_the_order_in_which_channels_arrive_change_a_decision(data):
    channels = {name: data.draw(recordings()) for name in ("a", "b")}
    trigger = Trigger(
        tuple(data.draw(st.lists(st.sampled_from(["a", "b"]).flatmap(conditions), min_size=1, max_size=3))),
        data.draw(st.sampled_from(["any", "all"])),
        post_s=data.draw(st.sampled_from([0.1, 1.0, 3.0])),
        holdoff_s=data.draw(st.sampled_from([0.0, 0.5, 2.0])),
        extend=data.draw(st.booleans()),
    )
    waiting = {name: data.draw(pieces(recording)) for name, recording in channels.items()}
    detector = TriggerDetector(trigger, ["a", "b"], max_lag_s=math.inf)
    decisions = detector.arm(-math.inf)
    while any(waiting.values()):
        name = data.draw(st.sampled_from([name for name in waiting if waiting[name]]))
        decisions += detector.feed(name, *waiting[name].pop(0))
    decisions += detector.finish()
    assert tuple(decisions) == find_triggers(trigger, channels)
    assert [d.time_s for d in decisions] == sorted(d.time_s for d in decisions)


@pytest.mark.exhaustive
@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_arming_in_the_middle_gives_what_the_rest_alone_gives(data):
    times_s, values = data.draw(recordings())
    condition = data.draw(conditions("a"))
    armed_s = data.draw(st.sampled_from(list(times_s)))
    detector = TriggerDetector(Trigger((condition,), post_s=0.1), ["a"])
    detector.arm(armed_s)
    rest = times_s >= armed_s
    expected = find_triggers(detector.trigger, {"a": (times_s[rest], values[rest])})
    decisions = [d for part in data.draw(pieces((times_s, values))) for d in detector.feed("a", *part)]
    assert [(d.time_s, d.outcome, d.value) for d in decisions] == [(d.time_s, d.outcome, d.value) for d in expected]
    assert [d.index - int((~rest).sum()) for d in decisions] == [d.index for d in expected]


# --- the span of a shot


def trigger_at(time_s: float, outcome: str = "trigger") -> Decision:
    return Decision(time_s, outcome, "" if outcome != "suppressed" else Suppression.WITHIN_POST, "a", 0, 0, 1.0, time_s)


def test_a_shot_is_complete_when_every_source_has_delivered_its_post_time():
    cutter = ShotCutter(Trigger((), pre_s=1.0, post_s=2.0), ["daq", "can"])
    cutter.note([trigger_at(10.0), trigger_at(10.5, "suppressed"), trigger_at(13.0, "suppressed")])
    cutter.advance("daq", 0.0, 12.5)
    cutter.advance("can", 0.0, 11.9)
    assert cutter.ready(12.5) == ()
    assert cutter.open_shots == 1
    cutter.advance("can", 0.0, 12.0)
    (shot,) = cutter.ready(12.5)
    assert (shot.start_s, shot.trigger_s, shot.stop_s, shot.pre_actual_s) == (9.0, 10.0, 12.0, 1.0)
    assert [d.time_s for d in shot.decisions] == [10.0, 10.5]
    assert shot.late_sources == ()
    assert cutter.ready(99.0) == ()


def test_a_ring_that_is_not_full_gives_less_pre_time_and_nothing_that_is_there_is_cut_away():
    cutter = ShotCutter(Trigger((), pre_s=5.0, post_s=1.0), ["daq", "can"])
    cutter.note([trigger_at(10.0)])
    cutter.advance("daq", 7.0, 20.0)
    cutter.advance("can", 9.5, 20.0)
    (shot,) = cutter.ready(20.0)
    assert (shot.start_s, shot.pre_actual_s) == (7.0, 0.5)
    assert shot.pre_by_source == {"daq": 3.0, "can": 0.5}


def test_a_source_that_is_gone_is_not_waited_for_for_ever_and_is_named():
    cutter = ShotCutter(Trigger((), pre_s=1.0, post_s=2.0), ["daq", "can", "imu"], patience_s=3.0)
    cutter.note([trigger_at(10.0)])
    cutter.advance("daq", 0.0, 15.0)
    cutter.advance("can", 0.0, 11.0)
    assert cutter.ready(14.9) == ()
    (shot,) = cutter.ready(15.0)
    assert shot.late_sources == ("can", "imu")
    assert shot.pre_by_source == {"daq": 1.0, "can": 1.0}


def test_an_extension_keeps_the_shot_open():
    cutter = ShotCutter(Trigger((), pre_s=1.0, post_s=2.0, extend=True), ["daq"])
    cutter.note([trigger_at(10.0), trigger_at(11.5, "extension")])
    cutter.advance("daq", 0.0, 13.0)
    assert cutter.ready(13.0) == ()
    cutter.advance("daq", 0.0, 13.5)
    (shot,) = cutter.ready(13.5)
    assert (shot.trigger_s, shot.stop_s, len(shot.decisions)) == (10.0, 13.5, 2)


def test_what_was_suppressed_within_the_pre_time_belongs_to_the_shot():
    cutter = ShotCutter(Trigger((), pre_s=3.0, post_s=1.0), ["daq"], lag_s=1.0)
    for i in range(1, 11):
        cutter.note([trigger_at(float(i), "suppressed")])
        cutter.advance("daq", 0.0, float(i))
        assert cutter.ready(float(i)) == ()
    cutter.note([trigger_at(10.5)])
    cutter.advance("daq", 0.0, 11.5)
    (shot,) = cutter.ready(11.5)
    assert [d.time_s for d in shot.decisions] == [8.0, 9.0, 10.0, 10.5]


def test_shots_that_follow_each_other_come_in_order():
    cutter = ShotCutter(Trigger((), pre_s=4.0, post_s=2.0), ["daq"])
    cutter.note([trigger_at(10.0), trigger_at(12.0)])
    cutter.advance("daq", 0.0, 13.0)
    (first,) = cutter.ready(13.0)
    cutter.advance("daq", 0.0, 14.0)
    (second,) = cutter.ready(14.0)
    assert (first.trigger_s, second.trigger_s) == (10.0, 12.0)
    assert [d.time_s for d in second.decisions] == [10.0, 12.0]


def test_an_interrupted_shot_is_closed_with_what_there_is():
    cutter = ShotCutter(Trigger((), pre_s=1.0, post_s=2.0), ["daq"])
    cutter.note([trigger_at(10.0)])
    cutter.advance("daq", 0.0, 10.5)
    (shot,) = cutter.ready(math.inf)
    assert shot.late_sources == ("daq",)


def test_what_is_needed_reaches_back_to_the_open_shots_start():
    cutter = ShotCutter(Trigger((), pre_s=3.0, post_s=20.0), ["daq", "dead"], lag_s=1.0)
    assert cutter.needed_from_s == -math.inf
    cutter.advance("daq", 0.0, 50.0)
    assert cutter.needed_from_s == 46.0
    cutter.note([trigger_at(48.0)])
    cutter.advance("daq", 0.0, 60.0)
    assert cutter.needed_from_s == 45.0


def test_the_cutter_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match="patience_s"):
        ShotCutter(Trigger(()), [], patience_s=-1.0)
    with pytest.raises(ValueError, match="lag_s"):
        ShotCutter(Trigger(()), [], lag_s=NAN)
    cutter = ShotCutter(Trigger(()), ["daq"])
    with pytest.raises(ValueError, match="unknown source 'x'"):
        cutter.advance("x", 0.0, 1.0)
    with pytest.raises(ValueError, match="must be numbers"):
        cutter.advance("daq", NAN, 1.0)


# --- the table of a rig file


def test_a_table_becomes_a_trigger():
    table = {
        "pre_s": 0.5,
        "post_s": 2,
        "holdoff_s": 5.0,
        "extend": True,
        "manual": False,
        "all": [
            {"channel": "acc", "level": 300, "rearm": 150.0},
            {"channel": "acc", "kind": "window", "low": -1.0, "high": 1.0, "on": "leave", "hysteresis": 0.1},
            {"channel": "acc", "kind": "slope", "level": -3.0, "slope": "falling", "over_s": 0.1},
            {"channel": "acc", "kind": "width", "level": 3.0, "longer_than_s": 0.1, "shorter_than_s": 0.2},
        ],
    }
    assert trigger_from_table(table, ACCELEROMETER) == Trigger(
        (
            Edge("acc", 300.0, 150.0),
            Window("acc", -1.0, 1.0, "leave", 0.1),
            RateOfChange("acc", -3.0, None, "falling", 0.1),
            PulseWidth("acc", 3.0, None, "rising", 0.1, 0.2),
        ),
        "all",
        pre_s=0.5,
        post_s=2.0,
        holdoff_s=5.0,
        extend=True,
        manual=False,
    )
    assert trigger_from_table({"pre_s": 0, "post_s": 1}, {}) == Trigger((), "any", 0.0, 1.0)


def test_what_a_table_leaves_out_is_as_its_description_says():
    rows = [
        {"channel": "acc", "level": 300},
        {"channel": "acc", "kind": "window", "low": -1.0, "high": 1.0},
        {"channel": "acc", "kind": "slope", "level": 3.0},
        {"channel": "acc", "kind": "width", "level": 3.0, "longer_than_s": 0.1},
    ]
    conditions = (
        Edge("acc", 300.0, None, "rising"),
        Window("acc", -1.0, 1.0, "enter", 0.0),
        RateOfChange("acc", 3.0, None, "rising", 0.0),
        PulseWidth("acc", 3.0, None, "rising", 0.1, None),
    )
    expected = Trigger(conditions, "any", pre_s=0.5, post_s=2.0, holdoff_s=0.0, extend=False, manual=True)
    assert trigger_from_table({"pre_s": 0.5, "post_s": 2, "any": rows}, ACCELEROMETER) == expected


def test_a_condition_whose_channel_is_unknown_says_what_else_is_wrong_with_it():
    row = {"channel": "ac", "level": 3.0, "rearm": 4.0}
    faults = trigger_faults({"pre_s": 0.5, "post_s": 2, "any": [row]}, ACCELEROMETER)
    assert [fault.key for fault in faults] == ["trigger.any[0].channel", "trigger.any[0]"]


def test_a_channel_that_is_no_name_is_one_fault():
    for channel in (["acc"], 7, None):
        faults = trigger_faults({"pre_s": 0.5, "post_s": 2, "any": [{"channel": channel, "level": 3.0}]}, ACCELEROMETER)
        assert [fault.key for fault in faults] == ["trigger.any[0].channel"]


def test_every_fault_of_a_table_is_told_at_once():
    table = {
        "pre_s": "1",
        "holdof_s": 3.0,
        "extend": 1,
        "any": [
            {"channel": "ac", "level": 300},
            {"kind": "egde", "channel": "acc"},
            {"level": True, "rearm": float("nan"), "slope": "up", "raerm": 1.0},
            {"channel": "acc", "level": 3.0, "rearm": 4.0},
            {"channel": "acc", "kind": "width", "level": 3.0},
            {"channel": "acc", "kind": "window", "low": 3.0, "high": 1.0},
        ],
        "all": [],
    }
    assert [(fault.key, fault.problem) for fault in trigger_faults(table, {"acc": "", "p": ""})] == [
        ("trigger.pre_s", "must be a time that is kept before the trigger, seconds, found '1'"),
        ("trigger.post_s", "is missing: a time that is kept behind the trigger, seconds"),
        ("trigger.extend", "must be true or false, found 1"),
        ("trigger.all", "has too few values, found []"),
        ("trigger.holdof_s", "unknown key; did you mean `holdoff_s`?"),
        ("trigger", "has both `any` and `all`; keep one"),
        ("trigger.any[0].channel", "no channel 'ac'; did you mean 'acc'?"),
        ("trigger.any[1].kind", "must be one of edge, window, slope, width, found 'egde'"),
        ("trigger.any[2].channel", "is missing: the name of a channel"),
        ("trigger.any[2].level", "must be a finite number, the level in the channel's SI unit, found True"),
        ("trigger.any[2].rearm", "must be a finite number, found nan"),
        ("trigger.any[2].slope", "must be 'rising' or 'falling', found 'up'"),
        ("trigger.any[2].raerm", "unknown key; did you mean `rearm`?"),
        ("trigger.any[3]", "rearm 4.0 must not be above the level 3.0 of a rising slope"),
        ("trigger.any[4]", "a pulse width needs longer_than_s, shorter_than_s, or both"),
        ("trigger.any[5]", "low must be below high, both finite, not 3.0 and 1.0"),
    ]


@pytest.mark.parametrize(
    "table",
    [
        {"any": 3},
        {"any": [3]},
        {"any": {"channel": "acc"}},
        {"any": [{"channel": ["acc"], "kind": ["edge"]}]},
        {"any": [{"channel": "acc", "slope": {}, "level": 10**400}]},
        {1: 2},
        {"manual": False},
        {"post_s": 0.0},
        {"pre_s": -1.0},
    ],
)
def test_nonsense_is_a_fault_and_no_other_error(table):
    stated = {"pre_s": 1.0, "post_s": 1.0, **table}
    assert trigger_faults(stated, ACCELEROMETER)
    assert trigger_faults(table, {})


@pytest.mark.parametrize("table", [3, "edge", [], [{"pre_s": 1.0}]])
def test_a_trigger_that_is_no_table_is_one_fault(table):
    (fault,) = trigger_faults(table, ACCELEROMETER)
    assert str(fault) == f"trigger: must be a table, found {table!r}"


# --- levels with a unit

QUANTITIES = {"acc": "acceleration", "p": "pressure", "x": "displacement", "t": "temperature", "new": ""}


def condition_of(**row: Any) -> Condition:
    table = {"pre_s": 0.5, "post_s": 2.0, "any": [row]}
    (condition,) = trigger_from_table(table, QUANTITIES).conditions
    return condition


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"channel": "p", "level": "1.5 MPa", "rearm": "10 bar"}, Edge("p", 1.5e6, 1e6)),
        ({"channel": "p", "level": 1.5e6, "rearm": "1MPa"}, Edge("p", 1.5e6, 1e6)),
        ({"channel": "acc", "level": "-30 g", "slope": "falling"}, Edge("acc", -30 * 9.80665, None, "falling")),
        (
            {"channel": "p", "kind": "window", "low": "-1 bar", "high": "0.2 MPa", "hysteresis": "5 kPa"},
            Window("p", -1e5, 2e5, "enter", 5e3),
        ),
        ({"channel": "p", "kind": "slope", "level": "2 MPa/ms", "rearm": "50 bar/s"}, RateOfChange("p", 2e9, 5e6)),
        ({"channel": "x", "kind": "slope", "level": "36 km/h"}, RateOfChange("x", 10.0)),
        ({"channel": "x", "kind": "slope", "level": "5 mm/ms"}, RateOfChange("x", 5.0)),
        (
            {"channel": "acc", "kind": "width", "level": "3 g", "longer_than_s": 0.1},
            PulseWidth("acc", 29.41995, None, "rising", 0.1),
        ),
        ({"channel": "t", "level": "40 degC"}, Edge("t", 313.15)),
        (
            {"channel": "t", "kind": "window", "low": "0 degC", "high": "50 degC", "hysteresis": "2 degC"},
            Window("t", 273.15, 323.15, "enter", 2.0),
        ),
    ],
)
def test_a_level_may_have_a_unit_and_is_si_without_one(stated: dict[str, Any], expected: Condition):
    found = condition_of(**stated)
    assert type(found) is type(expected)
    for key, value in asdict(expected).items():
        assert asdict(found)[key] == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value)


@pytest.mark.parametrize("key", ["level", "rearm", "low", "high", "hysteresis"])
@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1.5 g", "'g' is no unit of pressure; nearest: "),
        ("1.5 MPx", "'MPx' is no unit of pressure; nearest: MPa"),
        ("1.5 V", "'V' is no unit of pressure"),
        ("1.5", "has no unit: write one behind the number, or the number in SI without quotes"),
        ("1,500 MPa", "may be thousands or decimals, 1500 or 1.5: write 1500 or 1,5000"),
        ("MPa", "does not begin with a number"),
        ("nan MPa", "does not begin with a number"),
        ("1e999 MPa", "has a number that is too large"),
    ],
)
def test_each_level_that_is_no_level_of_its_channel_is_told_with_its_place(key: str, text: str, problem: str):
    sound = {"level": "2 MPa"} if key in ("level", "rearm") else {"kind": "window", "low": "1 MPa", "high": "2 MPa"}
    table = {"pre_s": 0.5, "post_s": 2.0, "any": [{"channel": "p", **sound, key: text}]}
    (fault,) = trigger_faults(table, QUANTITIES)
    assert fault.key == f"trigger.any[0].{key}"
    assert fault.problem.startswith(problem)
    assert fault.problem.endswith(f", found {text!r}")


def test_a_level_may_have_a_decimal_comma():
    assert condition_of(channel="p", level="1,5 MPa") == condition_of(channel="p", level="1.5 MPa")


def test_the_rate_of_a_pressure_is_in_a_pressure_by_time():
    row = {"channel": "p", "kind": "slope", "level": "2 MPa"}
    (fault,) = trigger_faults({"pre_s": 0.5, "post_s": 2.0, "any": [row]}, QUANTITIES)
    assert fault.problem.startswith("'MPa' is no unit of pressure per time; nearest: MPa/s")


def test_levels_of_channels_whose_quantity_is_not_known_are_taken_as_their_units_say():
    row = {"channel": "new", "level": "2 MPa"}
    assert condition_of(**row) == Edge("new", 2e6)
    assert condition_of(channel="new", kind="slope", level="2 MPa/s") == RateOfChange("new", 2e6)


# --- a caller's mistakes


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Trigger((), "none"), "combination"),
        (lambda: Trigger((), pre_s=-1.0), "pre_s"),
        (lambda: Trigger((), post_s=0.0), "post_s"),
        (lambda: Trigger((), post_s=NAN), "post_s"),
        (lambda: Trigger((), holdoff_s=math.inf), "holdoff_s"),
        (lambda: Trigger((), manual=False), "must allow manual"),
        (lambda: Edge("a", NAN), "level"),
        (lambda: Edge("a", 1.0, math.inf), "rearm"),
        (lambda: Edge("a", 1.0, 2.0), "above"),
        (lambda: Edge("a", 1.0, 0.0, "falling"), "below"),
        (lambda: Edge("a", 1.0, slope="up"), "slope"),
        (lambda: Window("a", 2.0, 2.0), "low"),
        (lambda: Window("a", 1.0, 2.0, "in"), "on"),
        (lambda: Window("a", 1.0, 2.0, hysteresis=-1.0), "hysteresis"),
        (lambda: Window("a", 1.0, 2.0, "leave", 0.5), "half the window"),
        (lambda: RateOfChange("a", 1.0, over_s=-1.0), "over_s"),
        (lambda: PulseWidth("a", 1.0), "longer_than_s"),
        (lambda: PulseWidth("a", 1.0, longer_than_s=0.0), "longer_than_s"),
        (lambda: PulseWidth("a", 1.0, longer_than_s=2.0, shorter_than_s=2.0), "below"),
        (lambda: TriggerDetector(Trigger((Edge("a", 1.0),)), ["b"]), "needs a"),
        (lambda: TriggerDetector(Trigger(()), [], max_lag_s=-1.0), "max_lag_s"),
    ],
)
def test_values_out_of_range_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("channel", "times_s", "values", "message"),
    [
        ("c", [1.0], [1.0], "unknown channel 'c'"),
        ("a", [1.0, 2.0], [1.0], "one length"),
        ("a", [[1.0]], [[1.0]], "one length"),
        ("a", [2.0, 1.0], [1.0, 1.0], "backwards"),
        ("a", [0.5], [1.0], "backwards"),
        ("a", [NAN], [1.0], "finite"),
        ("a", [2.0, NAN, 3.0], [1.0, 1.0, 1.0], "finite"),
        ("a", [2.0, math.inf], [1.0, 1.0], "finite"),
    ],
)
def test_blocks_that_cannot_be_are_refused_and_change_nothing(channel, times_s, values, message):
    detector = TriggerDetector(Trigger((Edge("a", 5.0),)), ["a"])
    detector.arm(0.0)
    detector.feed("a", [1.0], [0.0])
    with pytest.raises(ValueError, match=message):
        detector.feed(channel, times_s, values)
    assert detector.feed("a", [], []) == []
    (decision,) = detector.feed("a", [1.0, 2.0], [0.0, 9.0])
    assert (decision.time_s, decision.index) == (2.0, 2)


def test_a_manual_trigger_needs_a_time():
    with pytest.raises(ValueError, match="time_s"):
        TriggerDetector(Trigger(()), []).fire_manually(NAN)


@pytest.mark.exhaustive
@given(
    values=st.lists(st.one_of(st.floats(-20, 20), st.just(math.nan)), min_size=1, max_size=60),
    steps_s=st.lists(st.sampled_from([0.0, 0.05, 0.1, 0.3]), min_size=60, max_size=60),
    over_s=st.sampled_from([0.0, 0.1, 0.25]),
    falling=st.booleans(),
    size=st.integers(1, 20),
)
@settings(max_examples=150, deadline=None)
def test_the_quick_look_at_a_slope_changes_no_decision(values, steps_s, over_s, falling, size):
    level, rearm, slope = (-40.0, -10.0, "falling") if falling else (40.0, 10.0, "rising")
    condition = RateOfChange("a", level, rearm, slope, over_s=over_s)
    times_s = np.cumsum(steps_s)[: len(values)]

    def decisions() -> list[Decision]:
        detector = TriggerDetector(Trigger((condition,), post_s=0.01), ["a"])
        detector.arm(-math.inf)
        made = []
        for at in range(0, len(values), size):
            made += detector.feed("a", times_s[at : at + size], values[at : at + size])
        return made + detector.finish()

    quick = decisions()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(state._Rates, "bounds", lambda *_: (-math.inf, math.inf))
        assert quick == decisions()
