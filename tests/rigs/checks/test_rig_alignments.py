from __future__ import annotations

from pathlib import Path

import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.checks.rig_alignments import second_way
from recoil_rigs.rig import ExposureAlignment, MotionAlignment, RedundantAlignment, Rig, parse_rig

HEAD = """\
schema = "recoil-daq/rig/1"
name = "bench"
reference_clock = "daq"
[mechanism]
m3 = 782
XA = 2.05
YA = 0.95
b = 0.85
d = 0.04
phi10 = 0.02
phi20 = 0.17
bore_area = 0.00883
brake_area = 0.0056
recuperator_area = 0.0078
friction = 1500.0
[[source]]
name = "daq"
kind = "dewetron"
"""


def channel(name: str, source: str, quantity: str, role: str = "", sensor: str = "") -> str:
    text = (
        f'[[channel]]\nname = "{name}"\nsource = "{source}"\nsignal = "s"\nquantity = "{quantity}"\nrole = "{role}"\n'
    )
    keys = ", ".join(filter(None, ("u_rel = 0.01" if role else "", sensor)))
    return text + (f"sensor = {{ {keys} }}\n" if keys else "")


ACC = channel("acc", "daq", "acceleration", "recoil_acceleration")
TURN = channel("turn", "daq", "angular_acceleration", "tipping_angular_acceleration")
SYNC = channel("sync", "daq", "voltage")


def source(align: str, kind: str = "dewetron", more: str = "") -> str:
    return f'[[source]]\nname = "other"\nkind = "{kind}"\nalign = {{ {align} }}\n{more}'


def rig(*tables: str) -> Rig:
    return parse_rig(HEAD + "".join(tables), Path("bench.toml"))


def fault(*tables: str) -> str:
    with pytest.raises(RigError) as caught:
        rig(*tables)
    assert len(caught.value.faults) == 1, caught.value.faults
    return str(caught.value.faults[0])


@pytest.mark.parametrize(
    ("quantity", "against"),
    [("velocity", "acc"), ("displacement", "acc"), ("angular_rate", "turn")],
)
def test_a_source_is_aligned_by_a_motion_in_another_quantity(quantity, against):
    sound = rig(source(f'method = "motion", against = "{against}"'), ACC, TURN, channel("own", "other", quantity))
    assert isinstance(sound.source("other").align, MotionAlignment)
    found = sound.motion_channel(sound.source("other"))
    assert found is not None
    assert found.name == "own"


def test_the_channel_of_a_motion_may_be_named():
    two = channel("one", "other", "velocity") + channel("two", "other", "velocity")
    named = rig(source('method = "motion", against = "acc", channel = "two"'), ACC, two)
    found = named.motion_channel(named.source("other"))
    assert found is not None
    assert found.name == "two"
    told = fault(source('method = "motion", against = "acc"'), ACC, two)
    assert "source[1] 'other'.align.channel: is needed: one, two may all be meant" in told


@pytest.mark.parametrize(
    ("own", "align", "told"),
    [
        (
            channel("own", "other", "acceleration"),
            'method = "motion", against = "acc", channel = "own"',
            "'own' repeats 'acc': the method for one and the same quantity is `redundant`",
        ),
        (
            channel("own", "other", "angular_rate"),
            'method = "motion", against = "acc", channel = "own"',
            "a channel of angular_rate is not the motion of one of acceleration",
        ),
        (
            channel("own", "other", "angular_rate", "carriage_rate"),
            'method = "motion", against = "turn"',
            "'own' is of the carriage part, 'turn' of the tipping part",
        ),
        (
            channel("own", "other", "temperature"),
            'method = "motion", against = "acc"',
            "motion needs a displacement or velocity channel of this source",
        ),
        (channel("own", "other", "velocity"), 'method = "motion", against = "sync"', "of a motion, found voltage"),
        (
            channel("own", "other", "velocity"),
            'method = "exposure", channel = "sync"',
            "a dewetron source has no exposures to be aligned by",
        ),
    ],
)  # fmt: skip
def test_a_motion_that_cannot_be_compared_is_refused_with_the_reason(own, align, told):
    assert told in fault(source(align), ACC, TURN, SYNC, own)


CAMERA = "frame_rate = 2000.0\n"
TRAVEL = channel("x", "other", "displacement", "recoil_displacement")


def test_a_camera_is_aligned_by_the_pulses_of_its_exposures():
    align = 'method = "exposure", channel = "sync", against = "acc"'
    sound = rig(source(align, "camera", CAMERA + 'exposure_s = 1e-4\nexposure_stamp = "start"\n'), ACC, SYNC, TRAVEL)
    camera = sound.source("other")
    assert isinstance(camera.align, ExposureAlignment)
    assert (camera.align.channel, camera.align.against) == ("sync", "acc")
    assert (camera.exposure_s, camera.exposure_stamp) == (1e-4, "start")
    found = sound.motion_channel(camera)
    assert found is not None
    assert found.name == "x"


@pytest.mark.parametrize(
    ("align", "more", "told"),
    [
        ('method = "exposure", channel = "acc"', "", "'acc' must be a voltage, found acceleration"),
        ('method = "exposure", channel = "x"', "", "'x' must be a channel of the reference clock 'daq'"),
        ('method = "exposure", channel = "sink"', "", "did you mean 'sync'?"),
        ('method = "exposure", channel = "sync", against = "sync"', "", "must be an acceleration, found voltage"),
        ('method = "exposure", channel = "sync"', 'exposure_stamp = "start"\n', "`exposure_stamp` needs `exposure_s`"),
        ('method = "exposure", channel = "sync"', "exposure_s = 6e-4\n", "longer than a frame, 0.0005 s"),
    ],
)  # fmt: skip
def test_what_a_train_of_exposures_cannot_be_is_refused(align, more, told):
    assert told in fault(source(align, "camera", CAMERA + more), ACC, SYNC, TRAVEL)


def test_an_exposure_is_a_cameras():
    told = fault(source('method = "fixed", offset_s = 0.0', "dewetron", "exposure_s = 1e-4\n"), ACC)
    assert "a dewetron source has no `exposure_s`, only a camera source has" in told


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        ('filter_type = "bessel"', "`filter_type` and `filter_order` need `filter_hz`"),
        ("filter_hz = 100.0, filter_order = 4", "`filter_order` needs `filter_type`"),
        ("resonance_hz = 900.0", "`resonance_hz` and `resonance_damping` go together"),
        ("u_delay_s = -1e-6", "must be greater than or equal to 0"),
        ('filter_hz = 100.0, filter_type = "elliptic"', "must be 'bessel' or 'butterworth'"),
    ],
)
def test_delays_that_contradict_themselves_are_refused(sensor, told):
    assert told in fault(channel("acc", "daq", "acceleration", "recoil_acceleration", sensor))


def test_delays_of_a_chain_are_declared_with_their_sensor():
    sound = rig(
        channel(
            "acc",
            "daq",
            "acceleration",
            "recoil_acceleration",
            'filter_hz = 1e4, filter_type = "bessel", filter_order = 8, u_delay_s = 1e-6, '
            "resonance_hz = 900.0, resonance_damping = 0.03",
        )
    )
    sensor = sound.channel("acc").sensor
    assert (sensor.filter_type, sensor.filter_order, sensor.u_delay_s) == ("bessel", 8, 1e-6)
    assert (sensor.resonance_hz, sensor.resonance_damping) == (900.0, 0.03)


def test_a_camera_is_aligned_by_the_forces_where_it_has_the_travel():
    breech = channel("p", "daq", "pressure", "breech_pressure")
    align = source('method = "motion", against = "p"', kind="camera", more="frame_rate = 1000.0\n")
    sound = rig(align, breech, channel("x", "other", "displacement", "recoil_displacement"))
    found = sound.motion_channel(sound.source("other"))
    assert found is not None
    assert found.name == "x"
    told = fault(align, breech, channel("x", "other", "displacement"))
    assert "motion against the forces needs a channel of role recoil_displacement" in told
    brake = channel("p", "daq", "pressure", "brake_pressure")
    assert "must be an acceleration" in fault(
        align, brake, channel("x", "other", "displacement", "recoil_displacement")
    )


_OF_A_GUN = ("XA", "YA", "b", "d", "phi10", "bore_area", "brake_area", "recuperator_area")
LINE = "".join(
    row
    for row in HEAD.replace("[mechanism]", '[mechanism]\nmodel = "line"').splitlines(keepends=True)
    if row.split(" =")[0] not in _OF_A_GUN
)


def line(*tables: str) -> Rig:
    return parse_rig(LINE + "".join(tables), Path("line.toml"))


@pytest.mark.parametrize(
    ("quantity", "role"),
    [
        ("displacement", "recoil_displacement"),
        ("velocity", "recoil_velocity"),
        ("acceleration", "recoil_acceleration"),
    ],
)
@pytest.mark.parametrize("force", ["driving_force", "resisting_force"])
def test_any_motion_of_a_line_is_aligned_by_any_of_its_forces(quantity: str, role: str, force: str) -> None:
    cells = channel("f", "daq", "force", force) + channel("g", "daq", "force", "driving_force")
    sound = line(source('method = "motion", against = "f"'), cells, channel("own", "other", quantity, role))
    found = sound.motion_channel(sound.source("other"))
    assert found is not None
    assert found.name == "own"


def test_what_the_forces_of_a_line_do_not_drive_is_refused() -> None:
    cell, align = channel("f", "daq", "force", "driving_force"), source('method = "motion", against = "f"')
    with pytest.raises(RigError) as caught:
        line(align, cell, channel("own", "other", "velocity"))
    told = str(caught.value.faults[0])
    assert "needs a channel of role recoil_acceleration or recoil_velocity or recoil_displacement" in told
    named = source('method = "motion", against = "f", channel = "other_force"')
    with pytest.raises(RigError) as caught:
        line(named, cell, channel("other_force", "other", "force", "driving_force"))
    assert "repeats 'f'" in str(caught.value.faults[0])


LOCKED = HEAD.replace('kind = "dewetron"\n', 'kind = "dewetron"\ntime = { by = "ptp" }\n')
PTP = 'time = { by = "ptp" }\n'


def absolute(more: str = "", kind: str = "dewetron", keys: str = PTP) -> str:
    return source(", ".join(filter(None, ('method = "absolute"', more))), kind, keys)


def test_absolute_time_is_compared_with_the_recoil_or_a_channel_of_the_same_role_or_what_the_rig_names() -> None:
    travel = channel("x", "other", "displacement", "recoil_displacement")
    gauges = [channel(f"p_{at}", at, "pressure", "breech_pressure") for at in ("daq", "other")]
    again = channel("acc_2", "other", "acceleration")
    cases = [
        (absolute(), [ACC, travel], MotionAlignment(method="motion", channel="x", against="acc")),
        (absolute(), gauges, RedundantAlignment(method="redundant", channel="p_other", against="p_daq")),
        (absolute(), [ACC, *gauges, travel], MotionAlignment(method="motion", channel="x", against="acc")),
        (absolute(), [ACC, again], None),
        (
            absolute('channel = "acc_2", against = "acc", drift_allowance = 1e-6'),
            [ACC, again],
            RedundantAlignment(method="redundant", channel="acc_2", against="acc", drift_allowance=1e-6),
        ),
        (
            absolute('against = "acc"'),
            [ACC, channel("v", "other", "velocity")],
            MotionAlignment(method="motion", channel="v", against="acc"),
        ),
    ]
    for table, channels, expected in cases:
        one = parse_rig(LOCKED + table + "".join(channels), Path("bench.toml"))
        assert second_way(one.source("other"), "daq", one.channels) == expected


@pytest.mark.parametrize(
    ("head", "tables", "says"),
    [
        (
            LOCKED,
            [absolute(keys='time = { by = "free" }\n'), ACC],
            "the clock of 'other' runs free: absolute time says",
        ),
        (LOCKED.replace("ptp", "free"), [absolute(), ACC], "the clock of 'daq' runs free"),
        (LOCKED, [absolute(kind="camera", keys=""), ACC], "needs what its clock is locked to"),
        (LOCKED, [absolute('channel = "y"'), ACC], "'y' is no channel"),
        (LOCKED, [absolute('against = "t"'), ACC, channel("t", "daq", "temperature")], "no other channel is there"),
        (LOCKED, [absolute("u_s = 0"), ACC], "u_s"),
    ],
)
def test_absolute_time_needs_two_clocks_that_are_locked(head: str, tables: list[str], says: str) -> None:
    with pytest.raises(RigError) as caught:
        parse_rig(head + "".join(tables), Path("bench.toml"))
    assert len(caught.value.faults) == 1
    assert says in str(caught.value)


def test_a_recorder_may_say_itself_what_it_is_locked_to() -> None:
    assert parse_rig(HEAD + absolute(keys="") + ACC, Path("bench.toml")).source("other").time is None
