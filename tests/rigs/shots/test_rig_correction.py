"""What a corrected rig file may say anew of shots that are recorded, and what becomes of their samples."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import RigError
from recoil_rigs.rig import Rig, find_rig, parse_rig
from recoil_rigs.shots.assemble import assemble_channels
from recoil_rigs.shots.rig_correction import Correction, corrected_channels, corrections
from tests.builders.bench_shots import ArrayRecording
from tests.rigs.shots.test_assemble import HEAD

CAMERA = (
    '[[source]]\nname = "camera"\nkind = "camera"\nscale_mm_per_px = {scale}\n'
    'align = {{ method = "fixed", offset_s = 0.0 }}\n'
)


@cache
def mixed() -> Rig:
    path = find_rig("mixed")
    return parse_rig(path.read_text(encoding="utf-8"), path)


def changed(*pairs: tuple[str, str]) -> Rig:
    """Return the rig `mixed` with pieces of its text replaced, each where it stands first."""
    text = mixed().text
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return parse_rig(text, mixed().path)


def bench(sensor: str = "", *, unit: str = "MPa", polarity: int = 1, scale: float = 0.5, camera: bool = False) -> Rig:
    """Make a rig of one channel ``p``: a gauge of a recorder, or a marker of a camera."""
    source, quantity = ("camera", "displacement") if camera else ("recorder", "pressure")
    table = (
        f'[[channel]]\nname = "p"\nsource = "{source}"\nsignal = "AI 1/p"\nquantity = "{quantity}"\nunit = "{unit}"\n'
        f"polarity = {polarity}\nsensor = {{ {sensor} }}\n"
    )
    return parse_rig(HEAD + (CAMERA.format(scale=scale) if camera else "") + table, Path("stand.toml"))


def read(rig: Rig, numbers: tuple[float, ...] = (1.0, -2.0, np.nan, np.inf)) -> Channel:
    spec = rig.channel("p")
    recording = ArrayRecording({"AI 1/p": np.array(numbers)}, {"AI 1/p": spec.unit}, clock=spec.source)
    return assemble_channels(rig, {spec.source: recording}, "0.1.0")["p"]


# ---- what is a correction


@pytest.mark.parametrize(
    ("old", "new", "key", "was", "now"),
    [
        ("u_rel = 0.01,", "u_rel = 0.02,", "channel 'acc_carriage_x'.sensor.u_rel", 0.01, 0.02),
        ("u_zero_rel = 0.001, r", "u_zero_rel = 0, r", "channel 'p_breech'.sensor.u_zero_rel", 0.001, 0.0),
        ("u_zero_rel = 0.001, r", "r", "channel 'p_breech'.sensor.u_zero_rel", 0.001, None),
        ("u_zero_rel = 0.001, r", "u_zero_rel = 0.001, gain = 1.01, r", "channel 'p_breech'.sensor.gain", 1.0, 1.01),
        ("u_rel = 0.005, u_z", "u_rel = 0.005, offset = -2.0, u_z", "channel 'p_breech'.sensor.offset", 0.0, -2.0),
        ("u_rel = 0.005, u_z", "u_rel = 0.005, u_gain = 0.002, u_z", "channel 'p_breech'.sensor.u_gain", 0.0, 0.002),
        ("= 2026-01-15", "= 2026-12-01", "channel 'acc_recoil'.sensor.calibrated", "2026-01-15", "2026-12-01"),
        ("= 2099-12-31", "= 2027-12-01", "channel 'acc_recoil'.sensor.due", "2099-12-31", "2027-12-01"),
        ("u_distortion_m = 1e-4", "u_distortion_m = 2e-4", "channel 'x_camera'.sensor.u_distortion_m", 1e-4, 2e-4),
        ("virtual pressure gauge", "a gauge", "channel 'p_breech'.sensor.model", "virtual pressure gauge", "a gauge"),
        ("m3 = 782.0", "m3 = 783.5", "mechanism.m3", 782.0, 783.5),
        ("friction = 1500.0", "friction = 1400.0", "mechanism.friction", 1500.0, 1400.0),
        ("u_friction = 150.0", "u_friction = 90.0", "mechanism.u_friction", 150.0, 90.0),
        ("bore_area = 0.00883", "bore_area = 0.00884", "mechanism.bore_area", 0.00883, 0.00884),
        ("[mechanism]", "[mechanism]\nu_bore_area = 1e-5", "mechanism.u_bore_area", None, 1e-5),
        ("[mechanism]", "[mechanism]\nu_bore_friction = 0.002", "mechanism.u_bore_friction", 0.006, 0.002),
        ("[mechanism]", "[mechanism]\nunread_force = 0.001", "mechanism.unread_force", 0.002, 0.001),
        ("m1 = 1450.0", "", "mechanism.m1", 1450.0, None),
        (
            "frame_rate = 6000.0",
            "frame_rate = 6000.0\nscale_mm_per_px = 0.3",
            "source 'camera'.scale_mm_per_px",
            None,
            0.3,
        ),
    ],
)  # fmt: skip
def test_a_correction_is_listed_with_what_was_and_what_is(old, new, key, was, now):
    assert corrections(mixed(), changed((old, new))) == (Correction(key, was, now),)


def test_a_standard_that_is_named_is_two_corrections():
    new = changed(("u_zero_rel = 0.001, r", 'u_zero_rel = 0.001, reference = "weights", u_reference_rel = 0.001, r'))
    found = [str(one) for one in corrections(mixed(), new)]
    assert found == [
        "channel 'p_breech'.sensor.reference not stated -> weights",
        "channel 'p_breech'.sensor.u_reference_rel 0 -> 0.001",
    ]


def test_words_and_order_within_a_table_are_no_correction():
    assert corrections(mixed(), changed(("polarity = 1\n", ""), ("# Masses", "# All masses"))) == ()


# ---- what is none


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('name = "mixed"', 'name = "other"', "name"),
        ('"V301"', '"V901"', "channel 'p_breech'.sensor.serial"),
        ('"AI 4/p_breech"', '"AI 5/p_breech"', "channel 'p_breech'.signal"),
        ('role = "breech_pressure"\n', "", "channel 'p_breech'.role"),
        ("polarity = 1", "polarity = -1", "channel 'acc_recoil'.polarity"),
        ('unit = "MPa"', 'unit = "bar"', "channel 'p_breech'.unit"),
        ("position = [-0.30, 0.06]", "position = [-0.31, 0.06]", "channel 'acc_recoil'.sensor.position"),
        ("range = [-25.0, 250.0]", "range = [-25.0, 200.0]", "channel 'p_breech'.sensor.range"),
        ("delay_s = 0.00042", "delay_s = 0.00043", "channel 'p_brake'.sensor.delay_s"),
        (", delay_s = 0.00042", ", u_delay_s = 1e-5, delay_s = 0.00042", "channel 'p_brake'.sensor.u_delay_s"),
        ("filter_hz = 800.0", "filter_hz = 700.0", "channel 'p_brake'.sensor.filter_hz"),
        ('filter_type = "bessel"', 'filter_type = "butterworth"', "channel 'p_brake'.sensor.filter_type"),
        ("filter_order = 4", "filter_order = 2", "channel 'p_brake'.sensor.filter_order"),
        (
            "delay_s = 0.00042",
            "delay_s = 0.00042, resonance_hz = 9e3, resonance_damping = 0.02",
            "channel 'p_brake'.sensor.resonance_hz",
        ),
        ("frame_rate = 6000.0", "frame_rate = 5000.0", "source 'camera'.frame_rate"),
        ("frame_rate = 6000.0", "frame_rate = 6000.0\nexposure_s = 1e-5", "source 'camera'.exposure_s"),
        ('"*_camera.csv"', '"*.csv"', "source 'camera'.match"),
        ('method = "motion", against', 'method = "motion", drift_allowance = 1e-5, against', "source 'camera'.align"),
        ('counters = ["RecoilNode.counter"]', "counters = []", "source 'can'.counters"),
        ("modulo = 65536", "modulo = 32768", "source 'imu'.framing"),
        ("level = 1.5e6", "level = 1.6e6", "trigger"),
        ("ringing = 0.5", "ringing = 0.4", "twin"),
    ],
)  # fmt: skip
def test_what_no_certificate_says_is_refused(old, new, key):
    with pytest.raises(RigError) as raised:
        corrections(mixed(), changed((old, new)))
    # a mount's resonance is two keys, of which one alone is a fault of its own
    assert raised.value.faults[0].key == key
    assert "put" in raised.value.faults[0].problem or "correct the number" in raised.value.faults[0].problem


def test_another_quantity_source_or_reference_clock_is_refused():
    text = bench().text
    second = '[[source]]\nname = "second"\nkind = "dewetron"\nalign = {method = "fixed", offset_s = 0}\n'
    two = text.replace("[[channel]]", second + "[[channel]]")
    other = two.replace('source = "recorder"', 'source = "second"').replace('"pressure"', '"force"').replace("MPa", "N")
    with pytest.raises(RigError) as raised:
        corrections(parse_rig(two, Path("old.toml")), parse_rig(other, Path("new.toml")))
    keys = [fault.key for fault in raised.value.faults]
    assert keys == ["channel 'p'.source", "channel 'p'.quantity", "channel 'p'.unit"]
    with pytest.raises(RigError, match=r"source 'second': did not record this shot; leave it out"):
        corrections(bench(), parse_rig(two, Path("new.toml")))
    with pytest.raises(RigError, match=r"source 'second': is missing: this shot was recorded with it; put it back"):
        corrections(parse_rig(two, Path("old.toml")), bench())
    turned = two.replace('reference_clock = "recorder"', 'reference_clock = "second"')
    turned = turned.replace("\nalign = {method", "\n# {method").replace(
        'name = "recorder"\nkind = "dewetron"',
        'name = "recorder"\nkind = "dewetron"\nalign = {method = "fixed", offset_s = 0}',
    )
    with pytest.raises(RigError, match="reference_clock: was recorder when this shot was recorded, is second; put"):
        corrections(parse_rig(two, Path("old.toml")), parse_rig(turned, Path("new.toml")))


def test_gauges_in_another_order_are_refused():
    text = mixed().text
    first, second = (text.index(f'[[channel]]\nname = "{name}"') for name in ("p_brake", "p_recuperator"))
    stop = text.index("# Repeats acc_recoil")
    other = text[:first] + text[second:stop] + text[first:second] + text[stop:]
    with pytest.raises(RigError, match=r"channel: in another order: .*p_recuperator, p_brake"):
        corrections(mixed(), parse_rig(other, mixed().path))


def test_another_database_is_refused():
    databases = dict(mixed().databases)
    ((name, dbc),) = databases.items()
    other = parse_rig(mixed().text, mixed().path, {name: dbc.replace("(0.0005,0)", "(0.0006,0)")})
    assert other.databases != databases
    with pytest.raises(RigError, match=r"database 'mixed.dbc': is another text than the one that the frames"):
        corrections(mixed(), other)


def test_all_faults_are_named_at_once_each_with_old_and_new():
    new = changed(
        ('"V301"', '"V901"'), ("frame_rate = 6000.0", "frame_rate = 5000.0"), ("u_rel = 0.01,", "u_rel = 0.02,")
    )
    with pytest.raises(RigError) as raised:
        corrections(mixed(), new)
    assert str(raised.value).endswith(
        "2 faults: source 'camera'.frame_rate: was 6000 when this shot was recorded, is 5000; put it back, or ingest "
        "the recorded files again if it was wrong | channel 'p_breech'.sensor.serial: was V301 when this shot was "
        "recorded, is V901; another number is another sensor, which did not record this shot; correct the number"
    )


# ---- samples

CALIBRATIONS = st.tuples(st.floats(0.5, 2.0), st.floats(-5.0, 5.0)).map("gain = {0[0]!r}, offset = {0[1]!r}".format)


@given(old=CALIBRATIONS, new=CALIBRATIONS, polarity=st.sampled_from([1, -1]), unit=st.sampled_from(["MPa", "psi"]))
def test_corrected_samples_are_those_that_ingest_would_have_made(old, new, polarity, unit):
    before, after = (bench(sensor, unit=unit, polarity=polarity) for sensor in (old, new))
    found = corrected_channels({"p": read(before)}, before, after, "2")["p"]
    np.testing.assert_allclose(found.samples, read(after).samples, rtol=1e-12, atol=1e-12 * 1e7)
    back = corrected_channels({"p": found}, after, before, "2")["p"]
    np.testing.assert_allclose(back.samples, read(before).samples, rtol=1e-12, atol=1e-12 * 1e7)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('sensitivity = 20.0, sensitivity_unit = "mV"', 'sensitivity = 20.2, sensitivity_unit = "mV"'),
        ('sensitivity = 20.0, sensitivity_unit = "mV"', 'sensitivity = "20.2 mV/MPa", range = [0, 250]'),
        ('sensitivity = 20.0, sensitivity_unit = "mV"', 'sensitivity = 0.02, sensitivity_unit = "V", amplifier = 1.1'),
        ('sensitivity = 2.0, sensitivity_unit = "pC", amplifier = 0.01', 'sensitivity = 2.0, sensitivity_unit = "pC"'),
        ('sensitivity = 20.0, sensitivity_unit = "mV"', 'sensitivity = 20, sensitivity_unit = "mV", offset = 3e3'),
    ],
)
def test_a_corrected_chain_of_volts_is_undone_and_drawn_anew(old, new):
    before, after = bench(old, unit="V"), bench(new, unit="V")
    found = corrected_channels({"p": read(before)}, before, after, "2")["p"]
    np.testing.assert_allclose(found.samples, read(after).samples, rtol=1e-12)


def test_a_range_may_be_written_in_the_unit_that_a_certificate_brings():
    before = bench('sensitivity = 4e-5, sensitivity_unit = "mV", range = [0.0, 250e6]', unit="V")
    after = bench('sensitivity = "40 mV/MPa", range = [0, 250]', unit="V")
    assert "range" not in " ".join(str(one) for one in corrections(before, after))
    with pytest.raises(RigError, match=r"sensor\.range: was \[0\.0, 250000000\.0\] when .*, is \[0\.0, 250"):
        corrections(before, bench('sensitivity = "40 mV/MPa", range = [0.0, 250e6]', unit="V"))


def test_a_corrected_scale_of_a_camera_is_undone_and_drawn_anew():
    before, after = bench(unit="px", scale=0.5, camera=True), bench(unit="px", scale=0.51, camera=True)
    assert [str(one) for one in corrections(before, after)] == ["source 'camera'.scale_mm_per_px 0.5 -> 0.51"]
    found = corrected_channels({"p": read(before)}, before, after, "2")["p"]
    np.testing.assert_allclose(found.samples, read(after).samples, rtol=1e-14)
    in_mm = bench(unit="mm", scale=0.5, camera=True), bench(unit="mm", scale=0.51, camera=True)
    np.testing.assert_array_equal(corrected_channels({"p": read(in_mm[0])}, *in_mm, "2")["p"].samples[:1], [1e-3])


def test_a_correction_keeps_what_was_recorded_and_says_what_it_did():
    before, after = bench("u_rel = 0.01"), bench("u_rel = 0.004, gain = 1.5, u_gain = 0.0045, offset = 1.0")
    recorded = read(before)
    found = corrected_channels({"p": recorded}, before, after, "2")["p"]
    assert found.u_rel == pytest.approx(0.005)
    assert found.history[:-1] == recorded.history
    assert found.history[-1].what == "correct calibration"
    assert found.history[-1].parameters == pytest.approx({"factor": 1.5, "offset": 1e6, "rig": "stand.toml"})
    assert recorded.samples[0] == 1e6


def test_a_channel_whose_unit_nobody_knows_is_refused_only_where_its_samples_change():
    unknown = {"p": Channel("p", "pressure", np.ones(2), TimeBase.uniform("recorder", 0.0, 1.0, 2))}
    same = corrected_channels(unknown, bench("u_rel = 0.01"), bench("u_rel = 0.02"), "2")["p"]
    assert same.u_rel == 0.02
    assert same.samples.tolist() == [1.0, 1.0]
    assert same.history == ()
    with pytest.raises(RigError, match=r"channel 'p': the shot file does not say in which unit it was read"):
        corrected_channels(unknown, bench(), bench("gain = 1.1"), "2")
