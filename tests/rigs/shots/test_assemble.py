from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.channel import RawCounts, Step
from recoil_acquisition.errors import MissingChannelError, ReadError, RigError
from recoil_acquisition.quantities.quantity import UNITS
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_rigs.rig import ChannelSpec, Rig, Sensor, parse_rig
from recoil_rigs.shots.assemble import assemble_channels, match_files, sensor_factor
from recoil_rigs.tables.channel_table import range_si
from tests.builders.bench_shots import ArrayRecording

HEAD = """
schema = "recoil-daq/rig/1"
name = "stand"
reference_clock = "recorder"
[mechanism]
m3 = 782.0
XA = 1.95
YA = 0.90
b = 0.80
d = 0.04
phi10 = 0.0
phi20 = 0.17
bore_area = 0.00883
brake_area = 0.0056
recuperator_area = 0.0078
friction = 1500.0
[[source]]
name = "recorder"
kind = "dewetron"
"""


def rig_of(channel: str, *, quantity: str = "pressure", sources: str = "", source: str = "recorder") -> Rig:
    """Make a rig of one channel ``p`` with further keys."""
    table = f'[[channel]]\nname = "p"\nsource = "{source}"\nsignal = "AI 1/p"\nquantity = "{quantity}"\n{channel}\n'
    return parse_rig(HEAD + sources + table, Path("stand.toml"))


def camera(scale: str = "") -> str:
    return f'[[source]]\nname = "camera"\nkind = "camera"\n{scale}\nalign = {{ method = "fixed", offset_s = 0.0 }}\n'


def read(rig: Rig, unit: str, numbers: tuple[float, ...] = (1.0, -2.0, np.nan), source: str = "recorder", **more):
    recording = ArrayRecording({"AI 1/p": np.array(numbers)}, {"AI 1/p": unit}, clock=source, **more)
    return assemble_channels(rig, {source: recording}, "0.1.0")["p"]


def test_samples_that_the_file_marks_as_an_overload_are_counted_in_the_channel(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time (s);AI 1/p (bar)\n0.0;1.5\n0.1;OVLD\n0.2;9.9E+37\n0.3;\n0.4;2.5\n")
    recording = recognise(path).open(path, Declarations("recorder"))
    channel = assemble_channels(rig_of(""), {"recorder": recording}, "0.1.0")["p"]
    np.testing.assert_allclose(channel.samples, [1.5e5, np.nan, np.nan, np.nan, 2.5e5])
    assert channel.overloads == 2
    assert channel.with_samples(channel.samples, Step("look", "0.1.0")).overloads == 2
    assert read(rig_of(""), "bar").overloads == 0


def test_a_channel_that_stands_in_every_so_many_rows_has_its_own_rate():
    rows = np.full(100, np.nan)
    rows[3::10] = np.arange(10.0)
    rows[53] = np.nan
    recording = ArrayRecording({"AI 1/p": rows}, {"AI 1/p": "bar"})
    before = recording.time_base("AI 1/p")
    channel = assemble_channels(rig_of(""), {"recorder": recording}, "0.1.0")["p"]
    np.testing.assert_allclose(channel.samples, 1e5 * np.array([0, 1, 2, 3, 4, np.nan, 6, 7, 8, 9]))
    np.testing.assert_allclose(channel.time_base.times_s, before.times_s[3::10])
    assert channel.time_base.step_s == pytest.approx(10 * before.step_s)
    assert "take its own rows" in [step.what for step in channel.history]


# ---- units


@pytest.mark.parametrize(
    ("stated", "declared", "factor"),
    [("MPa", "", 1e6), ("", "bar", 1e5), ("MPa", "MPa", 1e6), ("N/mm2", "MPa", 1e6), ("kgf/cm²", "", 98066.5)],
)
def test_the_unit_is_the_files_or_else_the_rigs(stated, declared, factor):
    channel = read(rig_of(f'unit = "{declared}"' if declared else ""), stated)
    np.testing.assert_allclose(channel.samples, [factor, -2 * factor, np.nan])
    assert channel.unit == "Pa"


def test_a_temperature_has_an_offset():
    channel = read(rig_of("", quantity="temperature"), "°C", (20.0,))
    assert channel.samples[0] == pytest.approx(293.15)


@pytest.mark.parametrize(
    ("declared", "stated", "problem"),
    [
        ("MPa", "bar", "the rig says 'MPa', file.csv says 'bar' for 'AI 1/p'"),
        (None, "furlong", "in 'furlong', which is no known unit: declare `unit`, or the source's `layout`"),
        (None, "", "is needed: file.csv states no unit for 'AI 1/p'"),
        (None, "m/s2", "in 'm/s2', which is no unit of pressure"),
        (None, "V", "in 'V', which is no unit of pressure"),
        ("MPa", "px", "the rig says 'MPa', file.csv says 'px' for 'AI 1/p'"),
        (None, "px", "in pixels, which is no unit of pressure"),
    ],
)
def test_a_unit_that_contradicts_or_is_not_known_is_a_fault_of_the_rig(declared, stated, problem):
    with pytest.raises(RigError) as caught:
        read(rig_of(f'unit = "{declared}"' if declared else ""), stated)
    (fault,) = caught.value.faults
    assert fault.key == "channel 'p'.unit"
    assert problem in fault.problem


def test_a_unit_that_is_none_leaves_it_to_the_rig():
    channel = read(rig_of('unit = "MPa"'), "Analog 1", (2.0,))
    assert channel.samples[0] == pytest.approx(2e6)


def test_all_contradictions_are_reported_at_once():
    second = (
        '[[channel]]\nname = "q"\nsource = "recorder"\nsignal = "AI 2/q"\nquantity = "acceleration"\nunit = "m/s2"\n'
    )
    rig = rig_of('unit = "MPa"\n' + second)
    numbers = {"AI 1/p": np.ones(2), "AI 2/q": np.ones(2)}
    with pytest.raises(RigError) as caught:
        assemble_channels(rig, {"recorder": ArrayRecording(numbers, {"AI 1/p": "bar", "AI 2/q": "g"})}, "0")
    assert [f.key for f in caught.value.faults] == ["channel 'p'.unit", "channel 'q'.unit"]


# ---- pixels


@pytest.mark.parametrize(("stated", "declared"), [("px", ""), ("Pixels", ""), ("", "px"), ("px", "px")])
def test_pixels_are_converted_by_the_cameras_scale(stated, declared):
    unit = f'unit = "{declared}"' if declared else ""
    rig = rig_of(unit, quantity="displacement", sources=camera("scale_mm_per_px = 0.5"), source="camera")
    np.testing.assert_allclose(read(rig, stated, source="camera").samples, [5e-4, -1e-3, np.nan])


def test_pixels_without_a_scale_are_a_fault():
    rig = rig_of("", quantity="displacement", sources=camera(), source="camera")
    with pytest.raises(RigError) as caught:
        read(rig, "px", source="camera")
    assert caught.value.faults[0].key == "source 'camera'.scale_mm_per_px"
    assert "is needed: file.csv is in pixels" in caught.value.faults[0].problem


@pytest.mark.parametrize(("declared", "stated"), [("px", "mm"), ("mm", "px")])
def test_pixels_and_a_length_contradict_one_another(declared, stated):
    rig = rig_of(
        f'unit = "{declared}"', quantity="displacement", sources=camera("scale_mm_per_px = 0.5"), source="camera"
    )
    with pytest.raises(RigError, match=f"the rig says '{declared}', file.csv says '{stated}'"):
        read(rig, stated, source="camera")


# ---- chains


def accelerometer(sensor: Sensor) -> ChannelSpec:
    return ChannelSpec(name="a", source="recorder", signal="a", quantity="acceleration", sensor=sensor)


def test_a_charge_chain_in_volts_becomes_the_quantity():
    # 2 pC per m/s2 behind 5 mV/pC: 10 mV per m/s2
    sensor = 'sensor = { sensitivity = 2.0, sensitivity_unit = "pC", amplifier = 0.005 }'
    channel = read(rig_of(f'unit = "V"\n{sensor}', quantity="acceleration"), "V", (1.0, -0.5))
    np.testing.assert_allclose(channel.samples, [100.0, -50.0])
    assert [step.what for step in channel.history] == ["read", "convert to SI", "apply sensitivity"]


@pytest.mark.parametrize(("unit", "volts"), [("mV", 1e-3), ("V", 1.0)])
@pytest.mark.parametrize("file_unit", ["V", "mV"])
def test_a_voltage_chain_becomes_the_quantity(unit, volts, file_unit):
    sensor = f'sensor = {{ sensitivity = 4.0, sensitivity_unit = "{unit}", amplifier = 10.0 }}'
    channel = read(rig_of(f'unit = "{file_unit}"\n{sensor}', quantity="acceleration"), file_unit, (8.0,))
    in_volts = 8.0 * (1e-3 if file_unit == "mV" else 1.0)
    assert channel.samples[0] == pytest.approx(in_volts / (4.0 * volts * 10.0))


def test_a_file_that_is_in_the_quantitys_unit_already_needs_no_chain():
    sensor = 'sensor = { sensitivity = 2.0, sensitivity_unit = "pC", amplifier = 0.005 }'
    channel = read(rig_of(sensor, quantity="acceleration"), "m/s2", (3.0,))
    assert channel.samples[0] == 3.0
    assert sensor_factor(accelerometer(Sensor(sensitivity=2.0, sensitivity_unit="V")), UNITS["g"]) == 1.0
    assert sensor_factor(accelerometer(Sensor()), UNITS["V"]) == 1.0


@given(value=st.floats(-1e3, 1e3), sensitivity=st.floats(1e-3, 1e3), gain=st.floats(1e-2, 1e2))
@settings(max_examples=40, deadline=None)
def test_the_chains_factor_is_the_inverse_of_the_chain(value, sensitivity, gain):
    volts = value * sensitivity * 1e-3 * gain
    sensor = Sensor(sensitivity=sensitivity, sensitivity_unit="mV", amplifier=gain)
    assert volts * sensor_factor(accelerometer(sensor), UNITS["V"]) == pytest.approx(value, rel=1e-12, abs=1e-12)


def test_a_sensor_the_other_way_round_is_turned_and_says_so():
    channel = read(rig_of('unit = "MPa"\npolarity = -1'), "MPa")
    np.testing.assert_allclose(channel.samples, [-1e6, 2e6, np.nan])
    assert channel.history[-1].what == "turn polarity"


def test_a_channel_keeps_its_counts_its_clock_and_where_it_came_from():
    counts = RawCounts(np.array([1, 2, 3], dtype=np.int16), 0.5, 0.0, "MPa")
    rig = rig_of('unit = "MPa"\nrole = "breech_pressure"\nsensor = { u_rel = 0.004 }')
    channel = read(rig, "MPa", counts={"AI 1/p": counts})
    assert channel.raw is not None
    np.testing.assert_array_equal(channel.raw.counts, counts.counts)
    assert (channel.raw.gain, channel.raw.offset, channel.raw.unit) == (0.5, 0.0, "MPa")
    assert channel.resolution == 5e5
    assert (channel.time_base.clock, channel.time_base.count) == ("recorder", 3)
    assert (channel.signal, channel.role, channel.u_rel) == ("AI 1/p", "breech_pressure", math.hypot(0.004, 0.005))
    assert channel.history[0].parameters == {"file": "file.csv", "reader": "arrays", "signal": "AI 1/p", "unit": "MPa"}
    assert channel.history[1].parameters == {"factor": 1e6, "offset": 0.0}


def test_a_range_is_in_the_channels_unit_and_in_si_where_that_is_not_the_quantitys():
    assert range_si(rig_of('unit = "bar"\nsensor = { range = [-1.0, 20.0] }').channel("p")) == (-1e5, 2e6)
    volts = 'unit = "V"\nsensor = { range = [-1e5, 2e6], sensitivity = 1.0, sensitivity_unit = "mV" }'
    assert range_si(rig_of(volts).channel("p")) == (-1e5, 2e6)
    assert range_si(rig_of("sensor = { range = [-3.0, 4.0] }").channel("p")) == (-3.0, 4.0)
    assert range_si(rig_of("").channel("p")) is None


def test_a_record_that_is_clipped_at_its_range_is_so_when_its_values_are_corrected():
    keys = 'unit = "bar"\npolarity = {}\nsensor = {{ range = [-1.0, 20.0], gain = 0.98, offset = -0.5 }}'
    for polarity, recorded in ((1, (-1.0, 20.0)), (-1, (1.0, -20.0))):
        rig = rig_of(keys.format(polarity))
        np.testing.assert_allclose(read(rig, "bar", recorded).samples, range_si(rig.channel("p")), rtol=1e-14)


# ---- signals


def test_a_missing_signal_lists_the_names_that_are_there_nearest_first():
    recording = ArrayRecording({"time": np.ones(1), "AI 2/p": np.ones(1), "gyro": np.ones(1)})
    with pytest.raises(MissingChannelError) as caught:
        assemble_channels(rig_of(""), {"recorder": recording}, "0")
    assert caught.value.name == "AI 1/p"
    assert caught.value.nearest[0] == "AI 2/p"
    assert "correct `signal` in the rig file" in str(caught.value)


def test_a_recording_that_reads_what_it_does_not_list_is_refused():
    class Liar(ArrayRecording):
        signals = ()

    with pytest.raises(ReadError, match="'AI 1/p' is not listed"):
        assemble_channels(rig_of(""), {"recorder": Liar({"AI 1/p": np.ones(1)})}, "0")


def test_channels_of_sources_without_a_file_are_left_out():
    assert assemble_channels(rig_of(""), {}, "0") == {}


# ---- files


SOURCES = """
[[source]]
name = "left"
kind = "camera"
match = "*_left.*"
align = { method = "fixed", offset_s = 0.0 }
[[source]]
name = "right"
kind = "camera"
align = { method = "fixed", offset_s = 0.0 }
"""


def matched(*files: tuple[str, str], sources: str = SOURCES) -> dict[str, str]:
    found = match_files(rig_of('unit = "Pa"', sources=sources), [(Path(n), kind) for n, kind in files])
    return {source: path.name for source, path in found.items()}


def test_a_pattern_comes_before_the_kind_and_the_kind_before_nothing():
    files = [("s1.csv", "dewetron"), ("track.csv", "camera"), ("s1_LEFT.csv", "camera")]
    assert matched(*files) == {"recorder": "s1.csv", "right": "track.csv", "left": "s1_LEFT.csv"}


def test_a_pattern_decides_for_a_file_that_no_reader_recognises():
    assert matched(("s1_left.bin", "")) == {"left": "s1_left.bin"}


def test_a_pattern_of_another_kind_does_not_decide():
    assert matched(("s1_left.csv", "dewetron")) == {"recorder": "s1_left.csv"}


def test_the_only_source_of_a_kind_takes_a_file_that_its_pattern_does_not_fit():
    left_alone = SOURCES[: SOURCES.rindex("[[source]]")]
    assert matched(("track.csv", "camera"), sources=left_alone) == {"left": "track.csv"}


BOTH_FIT = SOURCES.replace('"right"\nkind = "camera"', '"right"\nkind = "camera"\nmatch = "a*"')
NONE_TOLD_APART = SOURCES.replace('match = "*_left.*"\n', "")


@pytest.mark.parametrize(
    ("files", "sources", "message"),
    [
        ([("log.blf", "can")], SOURCES, r"log\.blf: a can file fits no source of rig 'stand'; expected recorder \("),
        ([("x.bin", "")], SOURCES, r"x\.bin: a file that no reader recognises fits no source"),
        ([("track.csv", "camera")], NONE_TOLD_APART, "fits several sources: left, right"),
        ([("a_left.csv", "camera")], BOTH_FIT, "fits several sources: left, right; assign each with"),
        ([("a.csv", "dewetron"), ("b.csv", "dewetron")], SOURCES, "source 'recorder' already has a.csv; give one file"),
    ],
)
def test_a_file_that_cannot_be_matched_is_refused_with_what_to_do(files, sources, message):
    with pytest.raises(ReadError, match=message):
        matched(*files, sources=sources)


# ---- a sensor with a bias, a channel in counts


@pytest.mark.parametrize("calibration", ["offset = -25.0", "gain = 3.1e-6", "gain = 35.15, offset = 3.0"])
def test_a_range_is_the_certificates_whatever_a_bias_and_a_scale_make_of_the_numbers(calibration):
    keys = f'unit = "g"\nsensor = {{ range = [-20.0, 20.0], {calibration} }}'
    limits = range_si(rig_of(keys, quantity="acceleration").channel("p"))
    assert limits == pytest.approx((-196.133, 196.133), rel=1e-12)


BIASED = 'unit = "V"\nsensor = {{ sensitivity = "100 mV/g", zero = "{}", range = [-20.0, 20.0]{} }}'


@pytest.mark.parametrize(
    ("zero", "more", "volts", "g"),
    [
        ("2.5 V", "", 2.5, 0.0),
        ("2,5 V", "", 3.5, 10.0),
        ("2500 mV", ", gain = 1.02", 3.5, 10.2),
        ("5 V", ", amplifier = 2", 7, 10),
    ],
)
def test_an_output_at_zero_is_taken_off_and_moves_no_range(zero, more, volts, g):
    rig = rig_of(BIASED.format(zero, more), quantity="acceleration")
    channel = read(rig, "V", (volts,))
    assert channel.samples[0] == pytest.approx(9.80665 * g, rel=1e-12, abs=1e-9)
    if "gain" not in more:
        assert range_si(rig.channel("p")) == pytest.approx((-196.133, 196.133), rel=1e-12)


def test_an_output_at_zero_counts_in_whatever_volts_the_file_has():
    rig = rig_of(BIASED.format("2.5 V", "").replace('unit = "V"', 'unit = "mV"'), quantity="acceleration")
    assert read(rig, "mV", (3500.0,)).samples[0] == pytest.approx(98.0665)


@pytest.mark.parametrize(
    ("keys", "key", "problem"),
    [
        ('sensor = { zero = "2.5 V" }', "sensor", "`zero` needs `sensitivity`"),
        ('sensor = { zero = "2.5", sensitivity = "100 mV/g" }', "sensor.zero", "must be an output with its unit"),
        ('sensor = { zero = "2.5 MPa", sensitivity = "100 mV/g" }', "sensor.zero", "must be an output with its unit"),
        ('sensor = { zero = "4 mA", sensitivity = "100 mV/g" }', "sensor.zero", "is nothing that a chain of mV"),
    ],
)
def test_an_output_at_zero_that_is_none_is_one_fault(keys, key, problem):
    with pytest.raises(RigError) as caught:
        rig_of(f'unit = "V"\n{keys}', quantity="acceleration")
    (fault,) = caught.value.faults
    assert fault.key == f"channel[0] 'p'.{key}"
    assert problem in fault.problem
