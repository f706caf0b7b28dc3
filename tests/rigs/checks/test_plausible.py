"""Values in another unit are seen by their size, before a shot is fired."""

from __future__ import annotations

import re

import pytest

from recoil_acquisition.errors import FaultCode, RigError
from recoil_rigs.rig import Rig, load_rig, parse_rig


def rig_with(old: str, new: str) -> Rig:
    rig = load_rig("mixed")
    assert old in rig.text
    return parse_rig(rig.text.replace(old, new, 1), rig.path)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("phi10 = 0.02", "phi10 = 1.0", "mechanism.phi10: must lie between -0.785 and 0.785 rad, found 1"),
        ("phi20 = 0.17", "phi20 = 9.7", "mechanism.phi20: must lie between -1.57 and 1.57 rad, found 9.7"),
        ("bore_area = 0.00883", "bore_area = 88.3", "mechanism.bore_area: must lie between 1e-06 and 1 m2, found 88.3"),
        ("m3 = 782.0", "m3 = 7.82e6", "mechanism.m3: must lie between 0.01 and 1e+06 kg, found 7.82e+06"),
        ("b = 0.80", "b = 800", "mechanism.b: must lie between -50 and 50 m, found 800"),
        ("d = 0.04", "d = 40", "mechanism.d: must lie between -5 and 5 m, found 40"),
        ("g = 9.80665", "g = 980.665", "mechanism.g: must lie between 9 and 10.5 m/s2, found 980.665"),
        (
            "\nfriction = 1500.0",
            "\nfriction = -1500.0",
            "mechanism.friction: must lie between 0 and 1e+07 N, found -1500",
        ),
        (
            "m3 = 782.0",
            "m3 = 782.0\nu_bore_area = 0.3",
            "mechanism.u_bore_area: must be in m2 and smaller than bore_area",
        ),
        ("frame_rate = 6000.0", "frame_rate = 6.0", "'camera'.frame_rate: must lie between 10 and 1e+07 Hz, found 6"),
        ("u_rel = 0.005", "u_rel = 1.5", "'acc_recoil'.sensor.u_rel: must lie between 0 and 1 of the reading"),
        ("position = [-0.30, 0.06]", "position = [-300.0, 0.06]", "'acc_recoil'.sensor.position[0]: must lie between"),
    ],
)
def test_what_no_such_rig_has_is_a_fault_with_its_bounds(old: str, new: str, fault: str) -> None:
    with pytest.raises(RigError) as caught:
        rig_with(old, new)
    (one,) = caught.value.faults
    assert fault in str(one)


@pytest.mark.parametrize(
    ("old", "new", "warning"),
    [
        ("phi10 = 0.02", "phi10 = 0.5", "mechanism.phi10: 0.5 rad is unusual; most lie between -0.3 and 0.3"),
        ("frame_rate = 6000.0", "frame_rate = 60.0", "source 'camera'.frame_rate: 60 Hz is unusual"),
        (
            "u_rel = 0.005",
            "u_rel = 0.5",
            "channel 'acc_recoil'.sensor.u_rel: 0.5 of the reading (1 % is 0.01) is unusual",
        ),
    ],
)
def test_what_few_rigs_have_is_a_warning(old: str, new: str, warning: str) -> None:
    (one,) = rig_with(old, new).warnings
    assert str(one).startswith(warning)


@pytest.mark.parametrize("symbol", ["friction", "bore_friction", "unread_share", "unread_force"])
def test_what_no_gun_is_without_is_doubted_where_it_is_stated_to_be_exactly_nothing(symbol: str) -> None:
    key = symbol if symbol == "unread_force" else f"u_{symbol}"
    rig = load_rig("mixed")
    text = re.sub(rf"(?m)^(u_)?{symbol} = .*\n", "", rig.text)
    stated = f"[mechanism]\n{symbol} = 0.0\n" + (f"{key} = 0.0\n" if key != symbol else "")
    (one,) = parse_rig(text.replace("[mechanism]\n", stated), rig.path, rig.databases).warnings
    assert (one.key, one.code) == (f"mechanism.{symbol}", FaultCode.UNUSUAL)
    assert f"by `{key}`, for example " in one.problem


def test_a_body_on_a_line_may_be_without_friction() -> None:
    assert not load_rig("sled").mechanism.never_none


def test_usual_rigs_have_no_warning() -> None:
    assert [load_rig(name).warnings for name in ("mixed", "field-2013")] == [(), ()]


@pytest.mark.parametrize(
    ("old", "new", "warning"),
    [
        ("u_distortion_m = 1e-4", "u_zero_rel = 0.1", "u_zero_rel: says nothing of a sensor of displacement"),
        ("u_distortion_m = 1e-4", "time_constant_s = 3.0", "time_constant_s: says nothing of a sensor of displacement"),
        ('serial = "V104",', 'serial = "V104", u_gain = 0.1,', "u_gain: changes nothing: no estimate reads a channel"),
        (
            'align = { method = "motion", against = "acc_recoil" }',
            'align = { method = "motion", against = "p_breech" }',
            "x_camera'.sensor.u_delay_s: changes nothing: the clock is aligned by the forces",
        ),
    ],
)
def test_an_uncertainty_on_which_nothing_hangs_is_said_to_change_nothing(old: str, new: str, warning: str) -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('serial = "V401",', 'serial = "V401", u_delay_s = 1e-3,').replace(old, new)
    assert any(warning in str(fault) for fault in parse_rig(text, rig.path, rig.databases).warnings)


def test_the_delay_of_what_aligns_a_clock_is_no_idle_key() -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('serial = "V104",', 'serial = "V104", u_delay_s = 1e-3,')
    assert parse_rig(text, rig.path, rig.databases).warnings == ()


def test_a_shot_that_was_recorded_with_such_a_value_is_read_in_doubt() -> None:
    rig = load_rig("mixed")
    text = rig.text.replace("phi10 = 0.02", "phi10 = 1.0")
    (doubt,) = parse_rig(text, rig.path, rig.databases, refuse_doubts=False).doubts
    assert doubt.key == "mechanism.phi10"
