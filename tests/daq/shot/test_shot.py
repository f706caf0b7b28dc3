from __future__ import annotations

import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import AlignmentError, StoreError
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_acquisition.shot.usability import Usability
from tests.builders.shots import make_shot


def test_a_channel_is_found_by_its_role() -> None:
    shot = make_shot()
    assert shot.by_role("recoil_acceleration") is shot.channels["acc_recoil"]
    assert shot.by_role("trigger") is None


def test_the_reference_clock_maps_to_itself() -> None:
    alignment = make_shot().alignment("dewetron")
    assert (alignment.to_reference(0.25), alignment.u_offset_s, alignment.status) == (0.25, 0.0, "ok")


def test_an_unknown_clock_has_no_alignment() -> None:
    shot = make_shot()
    assert shot.alignment("camera") is shot.alignments[0]
    with pytest.raises(KeyError, match="radar"):
        shot.alignment("radar")


@given(offset_s=st.floats(-10, 10), drift=st.floats(-1e-3, 1e-3), t=st.floats(-100, 100))
def test_mapping_to_the_reference_is_a_straight_line(offset_s: float, drift: float, t: float) -> None:
    alignment = ClockAlignment("camera", offset_s, 0.0, drift, 0.0, "ok", "fixed")
    assert alignment.to_reference(t) == pytest.approx((1 + drift) * t + offset_s, abs=1e-12)
    array = alignment.to_reference(np.array([t, t + 1.0]))
    assert array[0] == alignment.to_reference(t)
    assert array[1] - array[0] == pytest.approx(1 + drift, abs=1e-12)


def test_a_shot_with_a_failed_check_is_not_usable_and_says_why() -> None:
    shot = make_shot()
    assert not shot.usable
    assert shot.reasons == ("imu: no common motion; mount the sensor rigidly",)


def test_warnings_leave_a_shot_usable() -> None:
    shot = replace(
        make_shot(), quality=(QualityCheck("a", Check.HUM, "warn", "loud"), QualityCheck("a", Check.SKEW, "ok", ""))
    )
    assert shot.usable
    assert shot.reasons == ()


def test_a_sound_record_without_a_valid_mass_is_for_the_record_only() -> None:
    doubt = Reason(ReasonCode.CLOCK, "imu", "clock imu: alignment ambiguous; declare its `delay_s`")
    sound = replace(make_shot(), quality=(QualityCheck("a", Check.HUM, "warn", "loud"),), against_mass=(doubt,))
    assert (sound.state, sound.usable, sound.reasons) == (Usability.RECORD_ONLY, False, (str(doubt),))
    failed = replace(sound, quality=(QualityCheck("a", Check.HUM, "fail", "loud"),))
    assert (failed.state, failed.reasons) == (Usability.NOT_USABLE, (str(doubt), "a: loud"))
    assert "record only" in repr(sound)


def test_a_reason_keeps_its_code_where_it_is_given_to_another_process() -> None:
    doubt = Reason(ReasonCode.CLOCK, "imu", "hardly known")
    other = pickle.loads(pickle.dumps(doubt))  # noqa: S301 - it is our own
    assert (other, other.code, other.about) == ("hardly known", ReasonCode.CLOCK, "imu")
    assert doubt.to_json() == {"code": "clock", "about": "imu", "severity": "fatal", "text": "hardly known"}


def test_results_are_a_new_shot_with_one_more_line_of_history() -> None:
    old = make_shot()
    step = Step("align", "0.1.0")
    new = old.with_results((), (), step)
    assert (new.alignments, new.quality, new.history) == ((), (), (*old.history, step))
    assert old.alignments != ()
    assert new.channels is old.channels


def test_a_shot_is_recorded_unless_something_tells_that_it_was_acquired_live() -> None:
    plain = Shot("1", "rig", "", "daq", {})
    assert plain.acquisition is None
    assert plain.clock_fits == {}
    live = make_shot()
    assert live.acquisition is not None
    assert live.with_results((), (), Step("check", "0")).acquisition is live.acquisition
    assert live.with_results((), (), Step("check", "0")).clock_fits is live.clock_fits


def test_a_channel_under_another_name_is_refused() -> None:
    shot = make_shot()
    with pytest.raises(ValueError, match="'acc_recoil' stands under the name 'a'"):
        replace(shot, channels={"a": shot.channels["acc_recoil"]})


def test_a_clock_that_is_aligned_twice_is_refused() -> None:
    shot = make_shot()
    with pytest.raises(ValueError, match="aligned twice: camera, camera"):
        replace(shot, alignments=(shot.alignments[0], shot.alignments[0]))


def test_frames_hold_the_channels_of_one_time_base_each():
    slow = TimeBase.stamped("can", np.array([0.0, 0.5, 1.1]))
    fast = TimeBase.uniform("daq", 0.0, 0.25, 4)
    channels = {
        "a": Channel("a", "acceleration", np.array([1.0, 2.0, np.nan, 4.0]), fast),
        "b": Channel("b", "pressure", np.arange(3.0), slow),
        "c": Channel("c", "velocity", np.arange(4.0), fast),
        "d": Channel("d", "pressure", np.arange(2.0), TimeBase.stamped("can", np.array([0.2, 0.4]))),
    }
    frames = Shot("1", "rig", "", "daq", channels).frames()
    assert list(frames) == ["daq", "can", "can_2"]
    assert list(frames["daq"].columns) == ["a", "c"]
    assert frames["daq"].attrs["units"] == {"a": "m/s^2", "c": "m/s"}
    assert frames["daq"].index.tolist() == [0.0, 0.25, 0.5, 0.75]
    assert frames["daq"]["a"].isna().tolist() == [False, False, True, False]
    assert frames["can_2"]["d"].tolist() == [0.0, 1.0]


def test_a_channel_is_asked_for_by_its_name_and_the_nearest_are_told() -> None:
    shot = make_shot()
    assert shot["p_breech"] is shot.channels["p_breech"]
    with pytest.raises(KeyError, match="nearest: p_breech"):
        shot["p_breach"]


def test_a_channel_takes_the_place_of_its_namesake_or_the_last() -> None:
    shot = make_shot()
    louder = replace(shot["p_breech"], samples=2.0 * shot["p_breech"].samples, raw=None)
    changed = shot.with_channel(louder)
    assert list(changed.channels) == list(shot.channels)
    assert changed["p_breech"] is louder
    assert list(shot.with_channel(replace(louder, name="new")).channels)[-1] == "new"


def test_one_frame_has_every_instant_of_every_channel_on_the_reference_clock() -> None:
    shot = make_shot().without_channel("acc_imu")
    frame = shot.frame()
    assert frame.index.is_monotonic_increasing
    for name, channel in shot.channels.items():
        column = frame[name]
        there = column.loc[shot.reference_times_s(name)].to_numpy()
        np.testing.assert_array_equal(there, channel.samples.astype(np.float64))
        assert column.notna().sum() == np.isfinite(channel.samples).sum()
    assert frame.attrs["units"]["p_breech"] == "Pa"


def test_one_frame_on_a_grid_is_even_and_of_the_zero_of_the_reference_clock() -> None:
    shot = make_shot().without_channel("acc_imu")
    frame = shot.frame(rate_hz=500.0)
    np.testing.assert_allclose(500.0 * frame.index.to_numpy(), np.round(500.0 * frame.index.to_numpy()), atol=1e-9)
    np.testing.assert_allclose(np.diff(frame.index), 1 / 500.0)
    assert list(frame.columns) == list(shot.channels)


def test_a_clock_that_was_not_aligned_is_on_no_frame() -> None:
    with pytest.raises(AlignmentError, match="'imu' of channel 'acc_imu' was not aligned"):
        make_shot().frame()


def test_a_data_set_has_each_channel_on_its_own_clock() -> None:
    shot = make_shot()
    found = shot.to_xarray()
    assert list(found.data_vars) == list(shot.channels)
    for name, channel in shot.channels.items():
        (dimension,) = found[name].dims
        np.testing.assert_array_equal(found[name].to_numpy(), channel.samples)
        np.testing.assert_array_equal(found[dimension].to_numpy(), channel.time_base.times_s)
        assert found[name].attrs["units"] == channel.unit
    camera = found[found["x_recoil"].dims[0]].attrs
    assert camera["offset_s"] == shot.alignment("camera").offset_s


def test_a_data_set_needs_xarray_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(StoreError, match="pip install 'xarray"):
        make_shot().to_xarray()
