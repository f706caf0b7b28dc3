from __future__ import annotations

import struct
import time
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tdms.reader import TdmsReader
from tests.builders.container_files import ramp, small_tdms, tdms_file
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

WAVE = {"wf_increment": 1e-3, "wf_start_offset": 0.25, "unit_string": "V"}
opened = partial(open_bytes, TdmsReader(), "a.tdms")


def test_waveform_properties_give_time_and_their_sample_count_is_not_used(tmp_path: Path) -> None:
    recording = opened(tmp_path, small_tdms())
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [("AI/acc", "m/s2", 20), ("AI/n", "", 20)]
    np.testing.assert_array_equal(recording.read("AI/acc"), np.concatenate((ramp(12), ramp(8))))
    assert recording.time_base("AI/acc").step_s == 5e-5
    start = recording.absolute_start
    assert start is not None
    assert start.text.startswith("2026-08-03T12:23:05.123456")
    assert start.zone == "UTC"


@settings(max_examples=15, deadline=None)
@given(sizes=st.lists(st.integers(1, 9), min_size=1, max_size=4), start=st.integers(0, 30), stop=st.integers(0, 40))
def test_segments_do_not_show(
    sizes: list[int], start: int, stop: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    values = ramp(sum(sizes))
    cuts = np.split(values, np.cumsum(sizes)[:-1])
    recording = opened(tmp_path_factory.mktemp("t"), tdms_file(*[[("g", "a", part, WAVE)] for part in cuts]))
    np.testing.assert_array_equal(recording.read("g/a", start, stop), values[start:stop])


def test_different_starts_become_offsets_to_the_earliest(tmp_path: Path) -> None:
    first = np.datetime64("2026-08-03T12:00:00", "us")
    later = WAVE | {"wf_start_time": first + np.timedelta64(1500, "us")}
    content = tdms_file([("g", "a", ramp(), later), ("g", "b", ramp(), WAVE | {"wf_start_time": first})])
    recording = opened(tmp_path, content)
    assert recording.time_base("g/a").start_s == pytest.approx(0.2515, abs=1e-9)
    assert recording.time_base("g/b").start_s == 0.25
    assert any("different absolute times" in note for note in recording.notes)


def test_a_channel_without_start_among_different_ones_is_left_out(tmp_path: Path) -> None:
    first = np.datetime64("2026-08-03T12:00:00", "us")
    starts = [WAVE | {"wf_start_time": first + np.timedelta64(n, "s")} for n in range(2)]
    content = tdms_file([("g", "a", ramp(), starts[0]), ("g", "b", ramp(), starts[1]), ("g", "c", ramp(), WAVE)])
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a", "g/b"]
    assert any(note.startswith("g/c: states no start") for note in recording.notes)


def test_a_time_channel_serves_its_group(tmp_path: Path) -> None:
    times = np.array([0.0, 0.1, 0.1, 0.5])
    content = tdms_file([("g", "Time", times, {"unit_string": "ms"}), ("g", "a", ramp(4), {}), ("h", "b", ramp(4), {})])
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a"]
    np.testing.assert_allclose(recording.time_base("g/a").times_s, [0.0, 1e-4, 5e-4])
    np.testing.assert_array_equal(recording.read("g/a"), ramp(4)[[0, 1, 3]])
    np.testing.assert_array_equal(recording.read("g/a", 1, 2), ramp(4)[[1]])
    assert any(note.startswith("h/b: no waveform properties") for note in recording.notes)


def test_time_stamps_texts_and_unknown_scalings_are_named_and_left_out(tmp_path: Path) -> None:
    stamps = np.array(["2026-08-03T12:00:00", "2026-08-03T12:00:01"], "datetime64[us]")
    scaled = WAVE | {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Secret"}
    content = tdms_file(
        [("g", "when", stamps, {}), ("g", "text", ["a", "b"], {}), ("g", "s", ramp(), scaled), ("g", "a", ramp(), WAVE)]
    )
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a"]
    for name in ("g/when: time stamps", "g/text: texts", "g/s: its scaling 'Secret'"):
        assert any(note.startswith(name) for note in recording.notes)


def test_linear_scaling_is_applied_and_its_counts_are_kept(tmp_path: Path) -> None:
    scale: dict[str, Any] = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0,
    }
    from nptdms.types import Uint32

    scale["NI_Scale[0]_Linear_Input_Source"] = Uint32(0xFFFFFFFF)
    recording = opened(tmp_path, tdms_file([("g", "a", np.arange(5, dtype=np.int16), WAVE | scale)]))
    np.testing.assert_array_equal(recording.read("g/a"), 0.5 * np.arange(5) + 2.0)
    raw = recording.raw("g/a")
    assert raw is not None
    assert (raw.gain, raw.offset, raw.unit) == (0.5, 2.0, "V")


def test_a_number_of_scales_that_no_channel_has_is_not_counted_up_to(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="NI_Number_Of_Scales"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | {"NI_Number_Of_Scales": 2**31 - 1})]))


def test_a_segment_that_was_never_closed_is_read_and_told(tmp_path: Path) -> None:
    content = bytearray(tdms_file([("g", "a", ramp(), WAVE)]))
    struct.pack_into("<Q", content, 12, 0xFFFFFFFFFFFFFFFF)
    recording = opened(tmp_path, bytes(content))
    assert "never closed" in recording.incomplete
    np.testing.assert_array_equal(recording.read("g/a"), ramp())


def test_an_index_file_is_refused_and_one_beside_the_file_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "a.tdms_index").write_bytes(b"garbage")
    assert opened(tmp_path, small_tdms()).signals
    with pytest.raises(ReadError, match=r"take the .tdms file"):
        opened(tmp_path, b"TDSh" + small_tdms()[4:])


def test_a_file_without_time_says_what_to_write(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="write the channels as waveforms"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), {})]))


def test_a_foreign_segment_is_told_with_its_byte(tmp_path: Path) -> None:
    content = small_tdms()
    second = 28 + struct.unpack_from("<Q", content, 12)[0]
    with pytest.raises(CorruptFileError, match=f"byte {second}"):
        opened(tmp_path, content[:second] + b"XXXX" + content[second + 4 :])


@pytest.mark.parametrize(
    ("name", "counts", "step_s"),
    [
        ("Digital_Input.tdms", [20000, 400, 8], 5e-4),
        ("raw1.tdms", [2000] * 7, 1.9999999999999998e-05),
        ("raw_timestamps.tdms", [128], 1e-3),
    ],
)
def test_real_files_are_read_whole(name: str, counts: list[int], step_s: float) -> None:
    recording = TdmsReader().open(shared_file(f"containers/{name}"), Declarations("dewetron"))
    assert [s.sample_count for s in recording.signals] == counts
    first = recording.time_base(recording.signals[0].name)
    assert (first.step_s, first.start_s) == (step_s, 0.0)
    for signal in recording.signals:
        samples, raw = recording.read(signal.name), recording.raw(signal.name)
        assert np.isfinite(samples).all()
        assert recording.time_base(signal.name).start_s == 0.0
        if raw is not None:
            np.testing.assert_allclose(raw.gain * raw.counts + raw.offset, samples, rtol=1e-12)
    assert recording.notes == ()


STAMP = np.datetime64("2024-03-01T10:00:00", "us")


@pytest.mark.parametrize(
    ("unit", "step_s"),
    [("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("s", 1.0), ("min", 60.0), ("h", 3600.0), ("d", 86400.0), ("", 1.0)],
)
def test_steps_and_offsets_are_in_the_unit_that_is_stated(unit: str, step_s: float, tmp_path: Path) -> None:
    wave = {"wf_increment": 1.0, "wf_start_offset": 2.0, "wf_xname": "Time", "wf_xunit_string": unit}
    base = opened(tmp_path, tdms_file([("g", "a", ramp(), wave)])).time_base("g/a")
    assert (base.step_s, base.start_s) == (step_s, 2.0 * step_s)


@pytest.mark.parametrize(
    ("stated", "why"),
    [
        ({"wf_xunit_string": "turns"}, "'turns', which is no unit of time"),
        ({"wf_xname": "Frequency", "wf_xunit_string": "Hz"}, "'Frequency' in 'Hz', not time"),
        ({"wf_xname": "Winkel"}, "'Winkel', not time"),
        ({"wf_time_pref": "sidereal"}, "wf_time_pref"),
        ({"wf_increment": "1 ms"}, "waveform properties are wrong"),
    ],
)
def test_an_axis_that_is_no_time_is_refused_by_name(stated: dict[str, Any], why: str, tmp_path: Path) -> None:
    content = tdms_file([("g", "b", ramp(), WAVE | stated), ("g", "a", ramp(), WAVE)])
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a"]
    assert any(note.startswith("g/b: ") and why in note for note in recording.notes)
    with pytest.raises(ReadError, match=r"signal 'g/b' cannot be read") as refused:
        recording.read("g/b")
    assert why in str(refused.value)
    with pytest.raises(ReadError, match=r"g/b: .* write the channels as waveforms over time"):
        opened(tmp_path, tdms_file([("g", "b", ramp(), WAVE | stated)]))


@pytest.mark.parametrize("name", ["Time", "Time (ms)", "t [ms]", "Zeit_ms"])
def test_a_time_channel_has_its_unit_in_its_name_or_beside_it(name: str, tmp_path: Path) -> None:
    unit = {} if name != "Time" else {"unit_string": "ms"}
    content = tdms_file([("g", name, np.arange(12.0), unit), ("g", "a", ramp(), {})])
    assert opened(tmp_path, content).time_base("g/a").step_s == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("times", "unit", "why"),
    [
        (np.arange(12.0), "Hz", "the unit 'Hz' of the time channel g/Time is no unit of time"),
        ([f"10:00:{k:02d}" for k in range(12)], "", "the time channel g/Time holds texts"),
        (np.r_[np.arange(6.0), np.arange(6.0)], "s", "g/Time: time steps back"),
    ],
)
def test_a_time_channel_that_is_none_is_refused_by_name(times: Any, unit: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=why):
        opened(tmp_path, tdms_file([("g", "Time", times, {"unit_string": unit}), ("g", "a", ramp(), {})]))


def test_of_two_units_of_a_time_channel_the_foreign_one_is_quoted(tmp_path: Path) -> None:
    time = ("g", "Time [turns]", np.arange(12.0), {"unit_string": "s"})
    with pytest.raises(ReadError, match="the unit 'turns' of the time channel"):
        opened(tmp_path, tdms_file([time, ("g", "a", ramp(), {})]))


def test_a_channel_of_time_stamps_is_the_time_of_its_group(tmp_path: Path) -> None:
    stamps = STAMP + np.arange(12) * np.timedelta64(250, "us")
    content = tdms_file([("g", "when", stamps, {}), ("g", "a", ramp(), {})])
    recording = opened(tmp_path, content)
    assert recording.time_base("g/a").step_s == pytest.approx(250e-6, rel=1e-6)
    assert recording.absolute_start is not None
    assert recording.absolute_start.text.startswith("2024-03-01T10:00:00.000000")
    assert recording.notes == ()


def restarted(*seconds: float, count: int = 10, **stated: Any) -> bytes:
    segments = []
    for index, second in enumerate(seconds):
        wave = {"wf_increment": 1e-3, "wf_start_time": STAMP + np.timedelta64(round(second * 1e6), "us")}
        further = {name: value[index] for name, value in stated.items()}
        segments.append([("g", "a", 100.0 * index + np.arange(count), wave | further)])
    return tdms_file(*segments)


def test_a_second_recording_is_at_its_own_time(tmp_path: Path) -> None:
    recording = opened(tmp_path, restarted(0.0, 10.0))
    times = np.r_[np.arange(10) * 1e-3, 10.0 + np.arange(10) * 1e-3]
    np.testing.assert_allclose(recording.time_base("g/a").times_s, times, atol=1e-9)
    np.testing.assert_array_equal(recording.read("g/a"), np.r_[np.arange(10.0), 100.0 + np.arange(10)])
    assert recording.absolute_start is not None
    assert recording.absolute_start.text.startswith("2024-03-01T10:00:00.000")
    assert any("a second recording begins at 2024-03-01T10:00:10.000000" in note for note in recording.notes)


@pytest.mark.exhaustive
def test_a_start_that_is_stated_a_thousand_times_takes_no_time(tmp_path: Path) -> None:
    begin = time.process_time()
    recording = opened(tmp_path, restarted(*(n * 1e-3 for n in range(3000)), count=1))
    assert recording.time_base("g/a").step_s == 1e-3
    assert time.process_time() - begin < 8.0


def test_a_second_recording_of_another_step_is_at_its_own_time(tmp_path: Path) -> None:
    recording = opened(tmp_path, restarted(0.0, 1.0, wf_increment=(1e-3, 2e-3)))
    times = np.r_[np.arange(10) * 1e-3, 1.0 + np.arange(10) * 2e-3]
    np.testing.assert_allclose(recording.time_base("g/a").times_s, times, atol=1e-9)


def test_a_second_recording_before_the_end_of_the_first_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"recording begins at 2024-03-01T09:00:00\.000000.*, sample 10, before"):
        opened(tmp_path, restarted(0.0, -3600.0))
    with pytest.raises(ReadError, match="a second recording begins at"):
        opened(tmp_path, restarted(0.0, 0.0, wf_increment=(1e-3, 2e-3)))


@pytest.mark.parametrize("off_s", [0.0, 0.3e-3])
def test_segments_that_state_when_they_began_are_one_recording(off_s: float, tmp_path: Path) -> None:
    recording = opened(tmp_path, restarted(0.0, 0.01 + off_s, 0.02))
    base = recording.time_base("g/a")
    assert (base.step_s, base.start_s, base.count) == (1e-3, 0.0, 30)
    assert any("off those that follow" in note for note in recording.notes) == bool(off_s)


@pytest.mark.parametrize(
    ("stated", "why"),
    [
        ({"unit_string": ("g", "m/s2")}, "its unit_string changes from 'g' to 'm/s2' at sample 10"),
        (
            {
                "NI_Number_Of_Scales": (1, 1),
                "NI_Scale[0]_Scale_Type": ("Linear", "Linear"),
                "NI_Scale[0]_Linear_Slope": (1.0, 2.0),
                "NI_Scale[0]_Linear_Y_Intercept": (0.0, 0.0),
            },
            "Linear_Slope changes from 1.0 to 2.0 at sample 10",
        ),
    ],
)
def test_a_unit_or_scale_that_changes_within_the_samples_is_refused(
    stated: dict[str, Any], why: str, tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match="a second recording begins there") as refused:
        opened(tmp_path, restarted(0.0, 10.0, **stated))
    assert why in str(refused.value)


def test_a_scale_of_the_group_that_changes_within_the_samples_is_refused(tmp_path: Path) -> None:
    from nptdms import ChannelObject, GroupObject, TdmsWriter

    path = tmp_path / "a.tdms"
    with TdmsWriter(str(path)) as writer:
        for slope in (1.0, 2.0):
            scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": slope,
                     "NI_Scale[0]_Linear_Y_Intercept": 0.0}  # fmt: skip
            writer.write_segment([GroupObject("g", scale), ChannelObject("g", "a", np.arange(5), WAVE)])
    with pytest.raises(ReadError, match=r"Linear_Slope changes from 1\.0 to 2\.0 at sample 5"):
        TdmsReader().open(path, Declarations("dewetron"))


def test_properties_that_follow_the_samples_are_said_of_all(tmp_path: Path) -> None:
    recording = opened(tmp_path, tdms_file([("g", "a", ramp(), {})], [("g", "a", ramp(), WAVE)]))
    assert (recording.time_base("g/a").step_s, recording.time_base("g/a").count) == (1e-3, 24)
    corrected = [("g", "a", np.empty(0), {"wf_increment": 2e-3})]
    recording = opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE)], corrected))
    assert recording.time_base("g/a").step_s == 2e-3


def test_a_scale_without_effect_leaves_samples_as_they_are_stored(tmp_path: Path) -> None:
    nothing = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "AdvancedAPI"}
    recording = opened(tmp_path, tdms_file([("g", "a", np.arange(5, dtype=np.int16), WAVE | nothing)]))
    np.testing.assert_array_equal(recording.read("g/a"), np.arange(5))
    raw = recording.raw("g/a")
    assert raw is not None
    assert (raw.gain, raw.offset) == (1.0, 0.0)
    further = nothing | {"NI_Scale[0]_AdvancedAPI_Gain": 2.0}
    with pytest.raises(ReadError, match=r"'AdvancedAPI' with .*_Gain is not covered"):
        opened(tmp_path, tdms_file([("g", "a", np.arange(5), WAVE | further)]))


def test_samples_that_are_stored_scaled_need_no_scale_to_be_known(tmp_path: Path) -> None:
    done = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Secret", "NI_Scaling_Status": "scaled"}
    recording = opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | done)]))
    np.testing.assert_array_equal(recording.read("g/a"), ramp())


@pytest.mark.parametrize("slope", [0.0, float("nan")])
def test_a_scale_that_makes_nothing_of_the_samples_is_no_scale(slope: float, tmp_path: Path) -> None:
    scale = {
        "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": slope,
        "NI_Scale[0]_Linear_Y_Intercept": 0.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }  # fmt: skip
    with pytest.raises(ReadError, match="its scaling has the slope"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | scale)]))


def test_a_slope_that_is_a_text_spoils_its_own_channel_alone(tmp_path: Path) -> None:
    scale = {
        "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": "two",
        "NI_Scale[0]_Linear_Y_Intercept": 0.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }  # fmt: skip
    recording = opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | scale), ("g", "b", ramp(), WAVE)]))
    assert [signal.name for signal in recording.signals] == ["g/b"]
    assert any("g/a: damaged: its scaling cannot be carried out" in note for note in recording.notes)


def test_a_scale_that_lacks_its_numbers_is_told_before_samples_are_read(tmp_path: Path) -> None:
    lacking = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 2.0}
    with pytest.raises(ReadError, match="its scaling cannot be carried out"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | lacking)]))


@pytest.mark.parametrize(
    ("name", "values", "times_s"),
    [
        ("tdms_restart", np.r_[0:100, 1000:1100], np.r_[np.arange(100), 10_000 + np.arange(100)] * 1e-3),
        ("tdms_xunit", None, np.arange(100) * 1e-3),
        ("tdms_adv", np.arange(100), np.arange(100) * 1e-3),
    ],
)
def test_reported_files_give_their_values_at_their_times(name: str, values: Any, times_s: Any) -> None:
    recording = TdmsReader().open(shared_file(f"reports/{name}.tdms"), Declarations("dewetron"))
    np.testing.assert_allclose(recording.time_base("G/a").times_s, times_s, atol=1e-9)
    if values is not None:
        np.testing.assert_array_equal(recording.read("G/a"), values)


def test_what_the_library_warns_of_is_a_note_and_nothing_is_written(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    content = small_tdms()
    recording = opened(tmp_path, content[: len(content) - 300])
    assert recording.incomplete
    assert capfd.readouterr() == ("", "")


def scale(number: int, kind: str, **values: Any) -> dict[str, Any]:
    return {f"NI_Scale[{number}]_Scale_Type": kind} | {
        f"NI_Scale[{number}]_{kind}_{name}": value for name, value in values.items()
    }


LINEAR = scale(0, "Linear", Slope=0.5, Y_Intercept=2.0)
RTD = scale(0, "RTD", Current_Excitation=1e-3, R0_Nominal_Resistance=100.0, A=3.9083e-3, B=-5.775e-7, C=-4.183e-12,
            Lead_Wire_Resistance=0.0, Resistance_Configuration=2, Input_Source=0xFFFFFFFF)  # fmt: skip
THERMISTOR = scale(0, "Thermistor", Excitation_Type=10322, Excitation_Value=2.5, Resistance_Configuration=2,
                   R1_Reference_Resistance=5000.0, Lead_Wire_Resistance=0.0, A=1.295e-3, B=2.34e-4, C=1.0e-7,
                   Temperature_Offset=0.0, Input_Source=0xFFFFFFFF)  # fmt: skip
STRAIN = scale(0, "Strain", Configuration=10183, Poisson_Ratio=0.3, Gage_Resistance=350.0, Lead_Wire_Resistance=0.0,
               Initial_Bridge_Voltage=0.0, Gage_Factor=2.1, Bridge_Shunt_Calibration_Gain_Adjustment=1.0,
               Voltage_Excitation=3.3, Input_Source=0xFFFFFFFF)  # fmt: skip
COUPLE = scale(0, "Thermocouple", Thermocouple_Type=10073, Scaling_Direction=1, Input_Source=0xFFFFFFFF)
TABLE = scale(0, "Table", Pre_Scaled_Values_Size=2, Scaled_Values_Size=2, Input_Source=0xFFFFFFFF) | {
    f"NI_Scale[0]_Table_{name}Scaled_Values[{at}]": value
    for name, pair in (("Pre_", (0.0, 1.0)), ("", (10.0, 30.0)))
    for at, value in enumerate(pair)
}
POLYNOMIAL = scale(0, "Polynomial", Coefficients_Size=2, Input_Source=0xFFFFFFFF) | {
    f"NI_Scale[0]_Polynomial_Coefficients[{at}]": value for at, value in enumerate((1.0, 3.0))
}
SUM = LINEAR | scale(1, "Add", Left_Operand_Input_Source=0, Right_Operand_Input_Source=0xFFFFFFFF)
DIFFERENCE = LINEAR | scale(1, "Subtract", Left_Operand_Input_Source=0, Right_Operand_Input_Source=0xFFFFFFFF)


@pytest.mark.filterwarnings("ignore:'where' used without 'out'")  # npTDMS's own, where it is asked directly
@pytest.mark.parametrize(
    "scales",
    [LINEAR, RTD, THERMISTOR, STRAIN, COUPLE, TABLE, POLYNOMIAL, SUM, DIFFERENCE],
    ids=["linear", "rtd", "thermistor", "strain", "thermocouple", "table", "polynomial", "add", "subtract"],
)
def test_scales_are_carried_out_as_nptdms_does_and_are_no_counts(scales: dict[str, Any], tmp_path: Path) -> None:
    from nptdms import TdmsFile

    stored = np.array([0.11, 0.12, 0.15, 0.5, 1.0])
    count = 1 + max(int(name[9]) for name in scales)
    content = tdms_file([("g", "a", stored, WAVE | scales | {"NI_Number_Of_Scales": count})])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = opened(tmp_path, content)
        values = recording.read("g/a")
    with np.errstate(all="ignore"):
        expected = TdmsFile.read(tmp_path / "a.tdms")["g"]["a"][:]
    np.testing.assert_array_equal(values, expected)
    assert not (expected == stored).any()


@pytest.mark.parametrize(
    "kind", ["Reciprocal", "Multiply", "Divide", "Logarithm", "Polynomial2", "linear", "AdvancedAPI2", "None", ""]
)
def test_a_scale_that_is_not_carried_out_leaves_its_channel_out_by_name(kind: str, tmp_path: Path) -> None:
    for at in (0, 1):
        scales = LINEAR | scale(at, kind, A=1.0) | {"NI_Number_Of_Scales": at + 1}
        with pytest.raises(ReadError, match=f"its scaling '{kind}' is not covered"):
            opened(tmp_path, tdms_file([("g", "a", np.arange(5, dtype=np.int16), WAVE | scales)]))


@pytest.mark.parametrize(
    ("own", "root"),
    [
        (LINEAR | {"NI_Number_Of_Scales": 0}, {}),
        (LINEAR | scale(1, "Linear", Slope=3.0, Y_Intercept=0.0) | {"NI_Number_Of_Scales": 1}, {}),
        ({name: value for name, value in LINEAR.items() if "Type" not in name}, {}),
        ({}, LINEAR | {"NI_Number_Of_Scales": 0}),
        ({"NI_Scaling_Status": "scaled"}, LINEAR | {"NI_Number_Of_Scales": 1}),
    ],
    ids=["of none", "beyond the last", "of no type", "above", "scaled below a scale"],
)
def test_a_scale_that_is_stated_and_does_not_count_leaves_its_channel_out(
    own: dict[str, Any], root: dict[str, Any], tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match=r"NI_Scal\S+ (is stated of no scale|and a scale of its file)"):
        opened(tmp_path, tdms_file([("g", "a", np.arange(5, dtype=np.int16), WAVE | own)], root=root))
