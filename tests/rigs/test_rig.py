from __future__ import annotations

import datetime as dt
import math
import os
import re
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import Fault, ReadError, RigError
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import (
    ROLES,
    FixedAlignment,
    MotionAlignment,
    RedundantAlignment,
    Rig,
    TriggerAlignment,
    bundled_rigs,
    find_rig,
    load_rig,
    parse_rig,
)
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf

FRAMING = (
    'framing = { kind = "sync", sync = "AA 55", length = { fixed = 24 }, '
    'fields = [{ name = "w", at = 2, type = "u16" }] }'
)

PATH = Path("bench.toml")
DATABASE = 'VERSION ""\n'

RIG = """\
schema = "recoil-daq/rig/1"
name = "bench"
reference_clock = "dewetron"

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
u_friction = 150.0

[[source]]
name = "dewetron"
kind = "dewetron"
match = "*DAQ*.csv"

[[source]]
name = "camera"
kind = "camera"
match = "*cam*.txt"
frame_rate = 5000
align = { method = "motion", against = "acc_recoil" }

[[source]]
name = "can"
kind = "can"
database = "rig.dbc"
align = { method = "redundant", channel = "rate_can", against = "rate_daq" }

[[source]]
name = "imu"
kind = "serial"
framing = { kind = "sync", sync = "AA 55", length = { fixed = 24 }, fields = [{ name = "w", at = 2, type = "u16" }] }
align = { method = "trigger", channel = "sync_imu" }

[[channel]]
name = "acc_recoil"
source = "dewetron"
signal = "AI 1/acc_recoil"
quantity = "acceleration"
unit = "g"
role = "recoil_acceleration"
polarity = -1
sensor = { serial = "17", calibrated = 2026-03-01, due = 2027-03-01, u_rel = 0.005, range = [-5e3, 5e3] }

[[channel]]
name = "p_breech"
source = "dewetron"
signal = "AI 2/p_breech"
quantity = "pressure"
unit = "V"
role = "breech_pressure"
sensor = { sensitivity = 4.4e-8, sensitivity_unit = "pC", amplifier = 2e-3, due = 2026-12-31, u_rel = 0.004 }

[[channel]]
name = "trigger"
source = "dewetron"
signal = "AI 3/trigger"
quantity = "voltage"
role = "trigger"

[[channel]]
name = "rate_daq"
source = "dewetron"
signal = "AI 4/rate"
quantity = "angular_rate"
unit = "°/s"
role = "tipping_rate"
sensor = { u_rel = 0.01 }

[[channel]]
name = "x_recoil"
source = "camera"
signal = "Feature #1 - X"
quantity = "displacement"
unit = "mm"
role = "recoil_displacement"
sensor = { u_rel = 0 }

[[channel]]
name = "rate_can"
source = "can"
signal = "Gyro.Rate"
quantity = "angular_rate"

[[channel]]
name = "sync_imu"
source = "imu"
signal = "sync"
quantity = "count"
"""


def rig_of(text: str = RIG) -> Rig:
    return parse_rig(text, PATH, {"rig.dbc": DATABASE})


def changed(*changes: tuple[str, str]) -> str:
    """Change the sound rig's text, each piece exactly once."""
    text = RIG
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def faults_of(*changes: tuple[str, str]) -> tuple[Fault, ...]:
    with pytest.raises(RigError) as caught:
        rig_of(changed(*changes))
    assert "\n" not in str(caught.value)
    return caught.value.faults


def only_fault_of(*changes: tuple[str, str]) -> str:
    faults = faults_of(*changes)
    assert len(faults) == 1, [str(f) for f in faults]
    return str(faults[0])


# A sound rig


def test_recorder_is_the_kind_of_any_recorder() -> None:
    assert rig_of(changed(('kind = "dewetron"', 'kind = "recorder"'))).sources == rig_of().sources


def test_a_sound_rig_is_read_with_all_its_parts() -> None:
    rig = rig_of()
    assert (rig.name, rig.reference_clock, rig.path, rig.text) == ("bench", "dewetron", PATH, RIG)
    assert [s.name for s in rig.sources] == ["dewetron", "camera", "can", "imu"]
    assert [c.name for c in rig.channels_of("dewetron")] == ["acc_recoil", "p_breech", "trigger", "rate_daq"]
    assert isinstance(rig.source("camera").align, MotionAlignment)
    assert isinstance(rig.source("can").align, RedundantAlignment)
    assert isinstance(rig.source("imu").align, TriggerAlignment)
    sensor = rig.channel("acc_recoil").sensor
    assert (sensor.u_rel, sensor.range, sensor.due) == (0.005, (-5000.0, 5000.0), dt.date(2027, 3, 1))
    assert rig.channel("acc_recoil").polarity == -1
    assert (rig.mechanism.m3, rig.mechanism.u["friction"]) == (782.0, 150.0)
    assert rig.databases == {"rig.dbc": DATABASE}


def test_a_rig_is_asked_by_name_and_role() -> None:
    rig = rig_of()
    channel = rig.by_role("breech_pressure")
    assert channel is rig.channel("p_breech")
    assert rig.by_role("brake_pressure") is None
    with pytest.raises(KeyError):
        rig.source("radar")
    with pytest.raises(KeyError):
        rig.channel("radar")


def test_a_camera_sees_the_motion_from_a_carriage_or_the_ground_where_there_is_a_carriage() -> None:
    gun, line = load_rig("mixed"), load_rig("sled")
    roles = "recoil_acceleration", "recoil_velocity", "recoil_displacement", None
    assert [gun.mechanism.needs_carriage(role) for role in roles] == [False, False, True, False]
    assert not any(map(line.mechanism.needs_carriage, roles))
    assert not gun.with_camera_on_ground(False).camera_on_ground
    assert gun.with_camera_on_ground(True).camera_on_ground
    assert not line.with_camera_on_ground(True).camera_on_ground


def test_declarations_are_what_the_files_do_not_carry() -> None:
    rig = rig_of()
    assert rig.declarations(rig.source("can")).database == DATABASE
    declared = rig.declarations(rig.source("imu")).framing
    assert declared is not None
    assert declared["length"] == {"fixed": 24}
    camera = rig.declarations(rig.source("camera"))
    assert (camera.clock, camera.frame_rate_hz, camera.scale_mm_per_px, camera.database) == (
        "camera",
        5000.0,
        None,
        None,
    )


def test_files_match_their_sources_without_regard_to_case() -> None:
    rig = rig_of()
    assert [s.name for s in rig.matching("Shot_7_daq_1.CSV")] == ["dewetron"]
    assert rig.matching("shot_7_imu.bin") == ()


def test_an_offset_that_is_known_may_be_declared() -> None:
    rig = rig_of(changed(('{ method = "motion", against = "acc_recoil" }', '{ method = "fixed", offset_s = -0.5 }')))
    align = rig.source("camera").align
    assert isinstance(align, FixedAlignment)
    assert (align.offset_s, align.u_offset_s, align.drift) == (-0.5, 0.0, 0.0)


def test_a_camera_with_a_scale_may_be_in_pixels() -> None:
    rig = rig_of(changed(('unit = "mm"', 'unit = "px"'), ("frame_rate = 5000", "scale_mm_per_px = 0.4")))
    assert rig.channel("x_recoil").unit == "px"


@pytest.mark.parametrize("role", ROLES)
def test_every_role_has_a_quantity_that_exists(role: str) -> None:
    assert ROLES[role] in SI_UNITS


# One fault at a time: the change, the key path, what is said


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        # keys
        (
            'name = "bench"',
            'name = "bench"\nmass = 3',
            r"mass: unknown key; there are channel, knowledge, mechanism, name, ",
        ),
        ("m3 = 782", "m3 = 782\nm33 = 1.0", r"mechanism\.m33: unknown key; did you mean `m3`\?"),
        (
            "m3 = 782",
            "m3 = 782\nmass = 1.0",
            r"mechanism\.mass: .* did you mean m3 \(specification mass .*, kg\), m1 .*, m2 ",
        ),
        ("m3 = 782", "m3 = 782\nu_inertia = 1.0", r"mechanism\.u_inertia: .* mean u_J1 \(.*, kg m2\), u_J2 .*, u_J3c "),
        ("m3 = 782", "m3 = 782\nbore_aera = 1.0", r"mechanism\.bore_aera: unknown key; did you mean `bore_area`\?"),
        ("m3 = 782", "m3 = 782\narea_brake = 1.0", r"mechanism\.area_brake: .* did you mean brake_area \([^)]*, m2\)$"),
        ("m3 = 782", "m3 = 782\nzz = 1.0", r"mechanism\.zz: unknown key; there are J1, "),
        ("u_friction", "u_frction", r"mechanism\.u_frction: unknown key; did you mean `u_friction`\?"),
        ("frame_rate = 5000", "framerate = 5000", r"source\[1\] 'camera'\.framerate: .* did you mean `frame_rate`\?"),
        ('unit = "g"', 'units = "g"', r"channel\[0\] 'acc_recoil'\.units: .* did you mean `unit`\?"),
        ("range = [", "rnge = [", r"channel\[0\] 'acc_recoil'\.sensor\.rnge: .* did you mean `range`\?"),
        (
            'channel = "sync_imu"',
            'channel = "sync_imu", drift_alowance = 0.0',
            r"source\[3\] 'imu'\.align\.drift_alowance: .* did you mean `drift_allowance`\?",
        ),
        # the head
        ("recoil-daq/rig/1", "recoil-daq/rig/2", r"schema: must be 'recoil-daq/rig/1', found 'recoil-daq/rig/2'"),
        ('schema = "recoil-daq/rig/1"\n', "", r"schema: must be .* found None"),
        ('name = "bench"\n', "", r"name: is missing: a name for the rig$"),
        ('name = "bench"', "name = 3", r"name: must be a text"),
        (
            'reference_clock = "dewetron"',
            'reference_clock = "dewtron"',
            r"reference_clock: 'dewtron' is no source; did you mean 'dewetron'\?",
        ),
        ('reference_clock = "dewetron"', 'reference_clock = "dewetron"\ntwin = 3', r"twin: must be a table"),
        # the mechanism
        ("XA = 2.05\n", "", r"mechanism\.XA: is missing: trunnion A ahead of C, carriage axes, m"),
        ("m3 = 782", "m3 = -1", r"mechanism\.m3: must be positive, found -1"),
        ("m3 = 782", "m3 = 0", r"mechanism\.m3: must be positive, found 0"),
        ("m3 = 782", 'm3 = "782"', r"mechanism\.m3: must be a finite number, found '782'"),
        ("m3 = 782", "m3 = true", r"mechanism\.m3: must be a finite number, found True"),
        ("m3 = 782", "m3 = nan", r"mechanism\.m3: must be a finite number, found nan"),
        ("m3 = 782", "m3 = [782]", r"mechanism\.m3: must be a finite number, found \[782\]"),
        ("m3 = 782", f"m3 = 1{'0' * 400}", r"mechanism\.m3: must be a finite number"),
        ("u_friction = 150.0", "u_friction = -1.0", r"mechanism\.u_friction: a standard uncertainty is not negative"),
        (
            "u_friction = 150.0",
            "bore_friction = 1.0",
            r"mechanism\.bore_friction: must be a share of at least 0 and below 1",
        ),
        (
            "u_friction = 150.0",
            "unread_force = -0.1",
            r"mechanism\.unread_force: must be a share of at least 0 and below",
        ),
        ("u_friction = 150.0", "unread_share = 1.0", r"mechanism\.unread_share: must be a share between -1 and 1"),
        (
            "u_friction = 150.0",
            "unread_share = 0.6",
            r"mechanism\.unread_share: must lie between -0\.5 and 0\.5",
        ),
        (
            "u_friction = 150.0",
            "u_unread_share = 1.0",
            r"mechanism\.u_unread_share: must lie between 0 and 0\.5",
        ),
        ("u_friction = 150.0", "slide_friction = -1.0", r"mechanism\.slide_friction: must not be negative"),
        ("u_friction = 150.0", "carried_mass = -1.0", r"mechanism\.carried_mass: must not be negative"),
        ("u_friction = 150.0", "tube_axial_hz = -1.0", r"mechanism\.tube_axial_hz: must not be negative"),
        (
            "u_friction = 150.0",
            "muzzle_brake = 1.0\nprojectile_mass = 15.0\nbore_length = 2.0",
            r"mechanism\.muzzle_brake: must be a share of at least 0 and below",
        ),
        (
            "u_friction = 150.0",
            "u_muzzle_brake = 0.1\nprojectile_mass = 15.0",
            r"mechanism\.bore_length: is missing: travel of the projectile to its exit",
        ),
        (
            "u_friction = 150.0",
            "muzzle_brake = 0.1\nu_muzzle_brake = 0.6\nprojectile_mass = 15.0\nbore_length = 2.0",
            r"mechanism\.u_muzzle_brake: must lie between 0 and 0\.5",
        ),
        (
            "u_friction = 150.0",
            "u_unread_force = 0.001",
            r"mechanism\.u_unread_force: unknown key; unread_force is itself a standard uncertainty",
        ),
        ("phi20 = 0.17", "phi20 = 9.7", r"mechanism\.phi20: must lie between -1\.57 and 1\.57 rad, found 9\.7"),
        (
            "bore_area = 0.00883",
            "bore_area = 8830.0",
            r"mechanism\.bore_area: must lie between 1e-06 and 1 m2, found 8830",
        ),
        (
            "range = [-5e3, 5e3] }",
            "range = [-5e3, 5e3], u_linearity_rel = 0.005 }",
            r"channel\[0\] 'acc_recoil'\.sensor\.u_linearity_rel: is of a channel with the role breech_pressure or",
        ),
        (
            "range = [-5e3, 5e3] }",
            "range = [-5e3, 5e3], gauge_ahead = { chamber_length_m = 1.0, projectile_mass_kg = 9.0, u_share = 0.01 } }",
            r"channel\[0\] 'acc_recoil'\.sensor\.gauge_ahead: is of a channel with the role breech_pressure alone",
        ),
        (
            "due = 2026-12-31, u_rel = 0.004 }",
            "due = 2026-12-31, u_rel = 0.004, u_linearity_rel = 0.5 }",
            r".*u_linearity_rel: must lie between 0 and 0\.1",
        ),
        # sources
        (
            'kind = "camera"',
            'kind = "video"',
            r"source\[1\] 'camera'\.kind: must be 'recorder', 'can', 'serial' or 'camera', found 'video'",
        ),
        (
            "frame_rate = 5000",
            'frame_rate = "5000"',
            r"source\[1\] 'camera'\.frame_rate: must be a finite number, found '5000'",
        ),
        (
            "frame_rate = 5000",
            "frame_rate = true",
            r"source\[1\] 'camera'\.frame_rate: must be a finite number, found True",
        ),
        ("frame_rate = 5000", "frame_rate = 0", r"source\[1\] 'camera'\.frame_rate: must be greater than 0, found 0"),
        (
            "frame_rate = 5000",
            "frame_rate = inf",
            r"source\[1\] 'camera'\.frame_rate: must be a finite number, found inf",
        ),
        ('database = "rig.dbc"\n', "", r"source\[2\] 'can': a can source needs `database"),
        (f"{FRAMING}\n", "", r"source\[3\] 'imu': a serial source needs `framing"),
        (
            FRAMING,
            'framing = "aa55"',
            r"source\[3\] 'imu'\.framing: must be a table, found 'aa55'",
        ),
        (
            "frame_rate = 5000",
            'database = "rig.dbc"',
            r"source\[1\] 'camera': a camera source has no `database`, only a can source has",
        ),
        (
            'match = "*DAQ*.csv"',
            "scale_mm_per_px = 0.4",
            r"source\[0\] 'dewetron': a dewetron source has no `scale_mm_per_px`",
        ),
        ('match = "*DAQ*.csv"', "match = 5", r"source\[0\] 'dewetron'\.match: must be a text, found 5"),
        # alignment
        (
            'match = "*DAQ*.csv"',
            'align = { method = "fixed", offset_s = 0.0 }',
            r"source\[0\] 'dewetron'\.align: the reference clock is not aligned",
        ),
        (
            'align = { method = "trigger", channel = "sync_imu" }\n',
            "",
            r"source\[3\] 'imu'\.align: is missing; declare",
        ),
        (
            'method = "motion"',
            'method = "moton"',
            r"source\[1\] 'camera'\.align\.method: unknown method 'moton'; did you mean 'motion'\?",
        ),
        (
            'method = "motion", ',
            "",
            r"source\[1\] 'camera'\.align\.method: is missing; one of motion, .*, exposure, absolute, fixed",
        ),
        (
            'align = { method = "motion", against = "acc_recoil" }',
            'align = "motion"',
            r"source\[1\] 'camera'\.align: must be a table, found 'motion'",
        ),
        (', against = "acc_recoil"', "", r"source\[1\] 'camera'\.align\.against: is missing"),
        (
            'against = "acc_recoil"',
            'against = "acc_recol"',
            r"source\[1\] 'camera'\.align\.against: 'acc_recol' is no channel; did you mean 'acc_recoil'\?",
        ),
        (
            'against = "acc_recoil"',
            'against = "trigger"',
            r"source\[1\] 'camera'\.align\.against: 'trigger' must be an acceleration, found voltage",
        ),
        (
            'against = "rate_daq"',
            'against = "rate_can"',
            r"source\[2\] 'can'\.align\.against: 'rate_can' must be a channel of the reference clock 'dewetron'",
        ),
        (
            'channel = "rate_can"',
            'channel = "rate_daq"',
            r"source\[2\] 'can'\.align\.channel: 'rate_daq' must be a channel of this source",
        ),
        (
            'against = "rate_daq"',
            'against = "acc_recoil"',
            r"source\[2\] 'can'\.align: a channel of angular_rate does not repeat one of acceleration",
        ),
        (
            'role = "trigger"\n',
            "",
            r"source\[3\] 'imu'\.align: no channel of the reference clock 'dewetron' has the role `trigger`",
        ),
        (
            '{ method = "motion", against = "acc_recoil" }',
            '{ method = "fixed" }',
            r"source\[1\] 'camera'\.align\.offset_s: is missing: the reference clock's time at the source's zero, s$",
        ),
        (
            '{ method = "motion", against = "acc_recoil" }',
            '{ method = "fixed", offset_s = 0.0, u_offset_s = -1.0 }',
            r"source\[1\] 'camera'\.align\.u_offset_s: must be greater than or equal to 0, found -1\.0",
        ),
        # channels
        ('signal = "sync"\n', "", r"channel\[6\] 'sync_imu'\.signal: is missing: the signal's name in the "),
        ('signal = "sync"', 'signal = ""', r"channel\[6\] 'sync_imu'\.signal: must be the signal's name .*, found ''$"),
        (
            'quantity = "pressure"',
            'quantity = "presure"',
            r"channel\[1\] 'p_breech'\.quantity: unknown quantity 'presure'; did you mean `pressure`\?",
        ),
        (
            'quantity = "count"',
            'quantity = "Count"',
            r"channel\[6\] 'sync_imu'\.quantity: unknown quantity 'Count'; did you mean `count`\?",
        ),
        (
            'unit = "mm"',
            'unit = "milimeter"',
            r"channel\[4\] 'x_recoil'\.unit: unknown unit 'milimeter'; nearest known: ",
        ),
        (
            'unit = "°/s"',
            'unit = "deg/sek"',
            r"channel\[3\] 'rate_daq'\.unit: unknown unit 'deg/sek'; nearest known: deg/s",
        ),
        (
            'unit = "g"',
            'unit = "mm"',
            r"channel\[0\] 'acc_recoil'\.unit: 'mm' is no unit of acceleration; one of m/s\^2, ",
        ),
        (
            'unit = "g"',
            'unit = "V"',
            r"channel\[0\] 'acc_recoil'\.unit: 'V' is no unit of acceleration; .*; volts need `sensitivity`",
        ),
        ('unit = "g"', 'unit = "px"', r"channel\[0\] 'acc_recoil'\.unit: 'px' is no unit of acceleration"),
        (
            'unit = "mm"',
            'unit = "px"',
            r"channel\[4\] 'x_recoil'\.unit: 'px' needs `scale_mm_per_px` of the camera source 'camera'",
        ),
        (
            'role = "tipping_rate"',
            'role = "tiping_rate"',
            r"channel\[3\] 'rate_daq'\.role: unknown role 'tiping_rate'; did you mean `tipping_rate`\?",
        ),
        (
            'role = "tipping_rate"',
            'role = "brake_pressure"',
            r"channel\[3\] 'rate_daq'\.quantity: role 'brake_pressure' needs quantity 'pressure', found 'angular_rate'",
        ),
        (
            'source = "dewetron"\nsignal = "AI 4/rate"',
            'source = "dewetorn"\nsignal = "AI 4/rate"',
            r"channel\[3\] 'rate_daq'\.source: role 'tipping_rate' has no source: 'dewetorn' is not declared; did you",
        ),
        ("polarity = -1", "polarity = 0", r"channel\[0\] 'acc_recoil'\.polarity: must be 1 or -1, found 0"),
        # sensors
        (
            "u_rel = 0.005",
            "u_rel = true",
            r"channel\[0\] 'acc_recoil'\.sensor\.u_rel: must be a finite number, found True",
        ),
        (
            "u_rel = 0.005",
            "u_rel = -0.1",
            r"channel\[0\] 'acc_recoil'\.sensor\.u_rel: must be greater than or equal to 0",
        ),
        (
            "range = [-5e3, 5e3]",
            "range = [5e3, -5e3]",
            r"channel\[0\] 'acc_recoil'\.sensor: `range` must be \[lowest, highest\]",
        ),
        ("range = [-5e3, 5e3]", "range = [5e3]", r"channel\[0\] 'acc_recoil'\.sensor\.range\[1\]: is missing"),
        (
            "range = [-5e3, 5e3]",
            "range = [1, 2, 3]",
            r"channel\[0\] 'acc_recoil'\.sensor\.range: must be an array \[lowest, highest\] .*, found \[1, 2, 3\]",
        ),
        (
            "range = [-5e3, 5e3]",
            'range = [1, "2"]',
            r"channel\[0\] 'acc_recoil'\.sensor\.range\[1\]: must be an array \[lowest, highest\] .*, found '2'",
        ),
        (
            "range = [-5e3, 5e3]",
            "range = 5e3",
            r"channel\[0\] 'acc_recoil'\.sensor\.range: must be an array \[lowest, highest\] .*, found 5000\.0",
        ),
        (
            "calibrated = 2026-03-01",
            'calibrated = "2026-03-01"',
            r"channel\[0\] 'acc_recoil'\.sensor\.calibrated: must be a date such as 2026-03-01, without quotes",
        ),
        (
            "calibrated = 2026-03-01",
            "calibrated = 2026",
            r"channel\[0\] 'acc_recoil'\.sensor\.calibrated: must be a date .*, found 2026",
        ),
        (
            "calibrated = 2026-03-01",
            "calibrated = 2028-03-01",
            r"channel\[0\] 'acc_recoil'\.sensor: `due` lies before `calibrated`",
        ),
        (
            ', sensitivity_unit = "pC"',
            "",
            r"channel\[1\] 'p_breech'\.sensor: `sensitivity` and `sensitivity_unit` go together",
        ),
        (
            'sensitivity_unit = "pC"',
            'sensitivity_unit = "nC"',
            r"channel\[1\] 'p_breech'\.sensor\.sensitivity_unit: must be 'pC', 'mV' or 'V', found 'nC'",
        ),
    ],
)
def test_one_fault_is_told_with_its_key_path_and_what_would_be_right(old: str, new: str, fault: str) -> None:
    assert re.match(fault, only_fault_of((old, new)))


def test_a_misspelt_key_of_a_sensor_hides_no_other_fault_of_its_channel() -> None:
    faults = faults_of(("range = [", "rnge = ["), ('role = "recoil_acceleration"', 'role = "recoil_acceleraton"'))
    assert [fault.key for fault in faults] == ["channel[0] 'acc_recoil'.sensor.rnge", "channel[0] 'acc_recoil'.role"]


def test_every_channel_that_enters_the_estimate_without_an_uncertainty_is_named_at_once() -> None:
    faults = faults_of((", u_rel = 0.005", ""), (", u_rel = 0.004", ""), ("sensor = { u_rel = 0 }\n", ""))
    assert [fault.key for fault in faults] == [
        "channel[0] 'acc_recoil'.sensor.u_rel",
        "channel[1] 'p_breech'.sensor.u_rel",
        "channel[4] 'x_recoil'.sensor.u_rel",
    ]
    assert "is missing: role 'breech_pressure' enters the estimate" in faults[1].problem


def test_zero_uncertainty_counts_where_it_is_written() -> None:
    assert rig_of(changed(("u_rel = 0.005", "u_rel = 0"))).channel("acc_recoil").sensor.states_u_rel
    assert not rig_of().channel("trigger").sensor.states_u_rel


def test_sensors_name_the_standard_that_they_share() -> None:
    shared = ', reference = "deadweight-7", u_reference_rel = 0.003'
    rig = rig_of(changed(("u_rel = 0.005", "u_rel = 0.005" + shared), ("u_rel = 0.004", "u_rel = 0.004" + shared)))
    assert [rig.channel(n).sensor.reference for n in ("acc_recoil", "p_breech")] == ["deadweight-7"] * 2
    assert rig.channel("p_breech").sensor.u_reference_rel == 0.003


@pytest.mark.parametrize(
    ("added", "fault"),
    [
        (", u_reference_rel = 0.003", "`u_reference_rel` needs `reference`, the standard's name"),
        (', reference = "s", u_reference_rel = 0.006', "`u_reference_rel` is a part of `u_rel` and cannot be larger"),
    ],
)
def test_what_a_standard_brings_is_a_part_of_the_sensors_uncertainty(added: str, fault: str) -> None:
    assert only_fault_of(("u_rel = 0.005", "u_rel = 0.005" + added)).endswith(fault)


def test_one_standard_has_one_uncertainty() -> None:
    faults = faults_of(
        ("u_rel = 0.005", 'u_rel = 0.005, reference = "s", u_reference_rel = 0.003'),
        ("u_rel = 0.004", 'u_rel = 0.004, reference = "s", u_reference_rel = 0.002'),
    )
    assert [str(fault) for fault in faults] == [
        "channel[0] 'acc_recoil'.sensor.u_reference_rel: 0.003 of 's', of which p_breech 0.002 is stated; state one",
    ]


def test_a_recorded_shots_rig_is_read_with_its_doubts() -> None:
    text = changed((", u_rel = 0.004", ""))
    rig = parse_rig(text, PATH, {"rig.dbc": DATABASE}, refuse_doubts=False)
    assert [doubt.key for doubt in rig.doubts] == ["channel[1] 'p_breech'.sensor.u_rel"]
    assert rig_of().doubts == ()
    with pytest.raises(RigError, match="unknown key") as caught:
        parse_rig(text.replace("m3 = 782", "m3 = 782\nm33 = 1"), PATH, {"rig.dbc": DATABASE}, refuse_doubts=False)
    assert [fault.key for fault in caught.value.faults] == ["mechanism.m33", "channel[1] 'p_breech'.sensor.u_rel"]


def test_two_channels_of_one_role_are_both_named() -> None:
    only = "only pressures may have several gauges: breech_pressure, brake_pressure, recuperator_pressure"
    role = 'role = "recoil_displacement"'
    faults = faults_of(
        (
            'quantity = "angular_rate"\n\n',
            'quantity = "angular_rate"\nrole = "tipping_rate"\nsensor = { u_rel = 0.02 }\n\n',
        )
    )
    assert [str(f) for f in faults] == [
        f"channel[3] 'rate_daq'.role: 'tipping_rate' is also the role of rate_can; {only}",
        f"channel[5] 'rate_can'.role: 'tipping_rate' is also the role of rate_daq; {only}",
    ]
    assert RIG.count(role) == 1


def test_several_gauges_may_measure_one_pressure() -> None:
    first = '[[channel]]\nname = "p_breech"'
    second = first.replace("p_breech", "p_breech_2") + '\nsource = "dewetron"\nsignal = "p2"\nquantity = "pressure"\n'
    second += 'unit = "MPa"\nrole = "breech_pressure"\nsensor = { u_rel = 0.004 }\n\n'
    rig = rig_of(changed((first, second + first)))
    assert [channel.name for channel in rig.with_role("breech_pressure")] == ["p_breech_2", "p_breech"]
    assert rig.without_channel("p_breech_2").by_role("breech_pressure") == rig.channel("p_breech")


def test_names_are_given_once() -> None:
    faults = faults_of(('name = "trigger"', 'name = "p_breech"'))
    assert [f.key for f in faults] == ["channel[1] 'p_breech'.name", "channel[2] 'p_breech'.name"]
    assert faults[0].problem == "two channels have this name"
    sources = faults_of(('name = "imu"', 'name = "can"'), ('source = "imu"', 'source = "can"'))
    assert [f.key for f in sources] == ["source[2] 'can'.name", "source[3] 'can'.name"]


def test_a_rig_without_tables_says_which_are_needed() -> None:
    with pytest.raises(RigError) as caught:
        parse_rig("", PATH)
    assert [f.key for f in caught.value.faults] == [
        "schema",
        "name",
        "reference_clock",
        "mechanism",
        "source",
        "channel",
    ]


@pytest.mark.parametrize("tables", ["source = 3", "channel = [1]", "source = []", 'channel = "x"', "[channel]\na = 1"])
def test_tables_of_the_wrong_kind_are_faults(tables: str) -> None:
    head = RIG[: RIG.index("[[source]]")].replace(
        "[mechanism]", f"{tables}\n[mechanism]" if "[c" not in tables else "[mechanism]"
    )
    with pytest.raises(RigError) as caught:
        parse_rig(head + (f"\n{tables}" if "[c" in tables else ""), PATH)
    assert {"source", "channel"} <= {f.key for f in caught.value.faults}


def test_a_toml_error_says_its_line() -> None:
    line = RIG.splitlines().index("YA = 0.95") + 1
    fault = only_fault_of(("YA = 0.95", "YA = 0,95"))
    assert fault.startswith("TOML: ")
    assert f"line {line}" in fault
    assert fault.endswith(": 'YA = 0,95'; a number has a decimal point: YA = 0.95")


@pytest.mark.parametrize("value", ["0.95 m", "about 1", "95 cm", "01.03.2026"])
def test_a_value_without_quotes_is_named_with_its_quotes(value: str) -> None:
    fault = only_fault_of(("YA = 0.95", f"YA = {value}   # of the drawing"))
    assert fault.endswith(f'; what is no plain number stands in quotes: YA = "{value}"')


@pytest.mark.parametrize("lines", ["YA = 0.95\nYA = 1.0", "YA = [0.95", 'YA = "0.95', "YA 0.95"])
def test_another_toml_error_shows_its_line_and_proposes_nothing(lines: str) -> None:
    fault = only_fault_of(("YA = 0.95", lines))
    assert "line " in fault
    assert "decimal point" not in fault
    assert "quotes" not in fault


def test_a_table_nested_without_end_is_a_toml_error() -> None:
    with pytest.raises(RigError) as caught:
        parse_rig("a = " + "[" * 100_000, PATH)
    assert caught.value.faults[0].key == "TOML"


def test_all_faults_are_told_at_once() -> None:
    faults = faults_of(
        ("recoil-daq/rig/1", "recoil-daq/rig/0"),
        ("XA = 2.05\n", ""),
        ("m3 = 782", 'm3 = "782"'),
        ("frame_rate = 5000", "framerate = 5000"),
        ('against = "rate_daq"', 'against = "rate_dac"'),
        ('unit = "g"', 'unit = "gees"'),
        ("u_rel = 0.005", "u_rel = -1"),
        ('quantity = "voltage"', 'quantity = "volts"'),
        ('role = "tipping_rate"', 'role = "breech_pressure"'),
        ('source = "imu"', 'source = "radar"'),
        ('signal = "Gyro.Rate"\n', ""),
    )
    assert [f.key for f in faults] == [
        "schema",
        "mechanism.m3",
        "mechanism.XA",
        "source[1] 'camera'.framerate",
        "channel[0] 'acc_recoil'.sensor.u_rel",
        "channel[2] 'trigger'.quantity",
        "channel[3] 'rate_daq'.quantity",
        "channel[5] 'rate_can'.signal",
        "source[2] 'can'.align.against",
        "channel[6] 'sync_imu'.source",
    ]


def test_a_faulty_channel_causes_no_further_faults() -> None:
    fault = only_fault_of(("polarity = -1", "polarity = 2"))
    assert fault.startswith("channel[0] 'acc_recoil'.polarity")


# Calibrations


def test_a_calibration_is_overdue_from_the_day_after_it_was_due() -> None:
    rig = rig_of()

    def judged(*day: int) -> tuple[Fault, ...]:
        return rig.not_calibrated(CalibrationDay(dt.date(*day), DayOf.START))

    assert judged(2026, 12, 31) == ()
    (fault,) = judged(2027, 1, 10)
    assert str(fault).startswith("channel 'p_breech'.sensor.due: ")
    assert "2026-12-31" in str(fault)
    assert len(judged(2030, 1, 1)) == 2


def test_a_certificate_is_stated_as_it_is_written() -> None:
    sensor = rig_of(changed(("u_rel = 0.01 }", "U_rel = 0.03, k = 2.5, nu = 12 }"))).channel("rate_daq").sensor
    assert (sensor.u_rel, sensor.U_rel, sensor.k, sensor.nu) == (0.012, 0.03, 2.5, 12.0)
    assert sensor.states_u_rel
    two = rig_of(changed(("u_rel = 0.01 }", "U_rel = 0.03 }"))).channel("rate_daq").sensor
    assert (two.u_rel, two.k, two.nu) == (0.015, None, math.inf)


@pytest.mark.parametrize(
    ("sensor", "fault"),
    [
        ("u_rel = 0.01, U_rel = 0.03 }", "`u_rel` is not `U_rel` / `k`: state one of them"),
        ("u_rel = 0.01, k = 2 }", "`k` needs `U_rel`"),
        ("U_rel = 0.03, k = 0 }", "the coverage factor of `U_rel`"),
        ("U_rel = true }", "the expanded uncertainty of its scale"),
        ("u_rel = 0.01, nu = 0.5 }", "the degrees of freedom of `u_rel`, 1 or more"),
        ("u_rel = 0, nu = 5 }", "`nu` needs `u_rel`"),
    ],
)
def test_a_certificate_that_contradicts_itself_is_refused(sensor: str, fault: str) -> None:
    assert any(fault in str(one) for one in faults_of(("u_rel = 0.01 }", sensor)))


# Files


def test_a_rig_file_is_read_with_its_database_beside_it(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(RIG, encoding="utf-8")
    (tmp_path / "rig.dbc").write_text('VERSION "µ°²"', encoding="cp1252")
    rig = load_rig(tmp_path / "bench.toml")
    assert rig.path == tmp_path / "bench.toml"
    assert rig.databases == {"rig.dbc": 'VERSION "µ°²"'}
    (tmp_path / "rig.dbc").write_text('VERSION "µ°²"', encoding="utf-8")
    assert load_rig(tmp_path / "bench.toml").databases == {"rig.dbc": 'VERSION "µ°²"'}


def test_a_missing_database_is_one_of_the_faults(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(changed(("m3 = 782", "m3 = -1")), encoding="utf-8")
    with pytest.raises(RigError) as caught:
        load_rig(tmp_path / "bench.toml")
    assert [f.key for f in caught.value.faults] == ["mechanism.m3", "source 'can'.database"]
    assert str(tmp_path / "rig.dbc") in caught.value.faults[1].problem


SECOND_BUS = """
[[source]]
name = "spare"
kind = "can"
database = "other.dbc"
align = { method = "fixed", offset_s = 0.0 }
"""


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"root:x:0:0:root:/root:/bin/bash\n" * 20, "this is no CAN database; expected the text of a DBC"),
        (b"\0" * 5_000_000, "too large; expected a CAN database of at most 4 MB"),
        (b'VERSION ""\nBO_ x', "cannot be read: Invalid syntax at line 2"),
        (b'VERSION ""\nBO_ 1 M: 64000000 A\n SG_ s : 0|8@1+ (1,0) [0|1] "" A', "as long as 64000000 bytes"),
    ],
)
def test_a_database_that_no_channel_uses_must_be_one_too(tmp_path: Path, content: bytes, problem: str) -> None:
    (tmp_path / "bench.toml").write_text(RIG + SECOND_BUS, encoding="utf-8")
    (tmp_path / "rig.dbc").write_text(DATABASE, encoding="utf-8")
    (tmp_path / "other.dbc").write_bytes(content)
    with pytest.raises(RigError) as caught:
        load_rig(tmp_path / "bench.toml")
    (fault,) = caught.value.faults
    assert fault.key == "source 'spare'.database"
    assert str(tmp_path / "other.dbc") in fault.problem
    assert problem in fault.problem


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipes among files")
def test_a_database_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(RIG, encoding="utf-8")
    os.mkfifo(tmp_path / "rig.dbc")
    with pytest.raises(RigError, match="this is a pipe"):
        load_rig(tmp_path / "bench.toml")


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    (tmp_path / "rig.dbc").write_text(DATABASE)
    (tmp_path / "bench.toml").write_bytes(b"\xef\xbb\xbf" + RIG.replace("\n", "\r\n").encode())
    assert load_rig(tmp_path / "bench.toml").name == "bench"


def test_text_in_another_encoding_is_told_with_its_byte(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(RIG.encode("cp1252"))
    with pytest.raises(ReadError, match=rf"byte {RIG.index('°')}: is not UTF-8 text"):
        load_rig(path)


def test_a_missing_rig_file_is_told_with_the_bundled_ones(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no such rig file; expected a TOML file or one of the bundled rigs"):
        find_rig(str(tmp_path / "none.toml"))
    with pytest.raises(ReadError, match="this is a directory"):
        find_rig(str(tmp_path))


def test_every_bundled_rig_is_found_by_name_and_sound() -> None:
    for name in bundled_rigs():
        assert find_rig(name).suffix == ".toml"
        load_rig(name)


# No text, however wrong, gives anything but a rig or a RigError

LINES = RIG.splitlines()
VALUES = ("true", "-1", "nan", '""', '"x"', "[]", "{}", "[[1]]", "2026-03-01", "1e400", '{ method = "fixed" }', "=")


def rig_or_error(text: str) -> Rig | RigError:
    try:
        return rig_of(text)
    except RigError as error:
        return error


@pytest.mark.exhaustive
@given(
    drop=st.sets(st.integers(0, len(LINES) - 1), max_size=6),
    put=st.dictionaries(st.integers(0, len(LINES) - 1), st.sampled_from(VALUES), max_size=4),
)
@settings(max_examples=150, deadline=None)
def test_a_mutilated_rig_is_a_rig_or_a_rig_error(drop: set[int], put: dict[int, str]) -> None:
    lines = [
        f"{line.split('=')[0]}= {put[i]}" if i in put and "=" in line else line
        for i, line in enumerate(LINES)
        if i not in drop
    ]
    outcome = rig_or_error("\n".join(lines))
    if isinstance(outcome, RigError):
        assert outcome.faults
        assert "\n" not in str(outcome)
    else:
        assert outcome.mechanism.m3 > 0


@given(st.text(max_size=80))
@settings(max_examples=100, deadline=None)
def test_any_text_is_a_rig_error(text: str) -> None:
    with pytest.raises(RigError):
        rig_of(text)


def test_the_required_symbols_are_symbols() -> None:
    assert set(Gun.required()) | Mechanism.POSITIVE <= set(Mechanism.symbols())


def test_a_fault_of_a_framing_is_a_fault_of_the_rig() -> None:
    text = load_rig("mixed").text
    assert 'algo = "crc16-ccitt-false"' in text
    with pytest.raises(RigError, match=r"imu.*framing.*crc17"):
        parse_rig(text.replace("crc16-ccitt-false", "crc17"), load_rig("mixed").path)


def test_every_fault_of_a_layout_is_a_fault_of_the_rig_by_its_key() -> None:
    layout = 'layout = { seperator = ";", first_row = 0, header_row = 1, time_column = "t" }'
    text = RIG.replace('match = "*DAQ*.csv"\n', f'match = "*DAQ*.csv"\n{layout}\n')
    with pytest.raises(RigError) as caught:
        rig_of(text)
    problems = {fault.parts[-1]: fault.problem for fault in caught.value.faults}
    assert set(problems) == {"seperator", "first_row"}
    assert "did you mean `separator`" in problems["seperator"]
    sound = layout.replace("seperator", "separator").replace("first_row = 0", "first_row = 2")
    assert rig_of(text.replace(layout, sound)).source("dewetron").layout is not None


def test_every_fault_of_a_cameras_layout_is_a_fault_of_the_rig_by_its_key() -> None:
    layout = 'layout = { decimal = ";", feature = [], first_row = 3 }'
    text = RIG.replace('kind = "camera"\n', f'kind = "camera"\n{layout}\n')
    assert text != RIG
    with pytest.raises(RigError) as caught:
        rig_of(text)
    said = str(caught.value)
    assert "layout.decimal" in said
    assert "layout.feature" in said
    assert "features" in said
    sound = 'layout = { separator = ";", header_row = 1, first_row = 2, features = [{ name = "A", x = "X", y = "Y" }] }'
    assert any(s.layout for s in rig_of(text.replace(layout, sound)).sources)


@pytest.mark.parametrize(
    ("key", "meaning"), [("u_zero_rel", "a share of the range"), ("u_distortion_m", "a length in m")]
)
def test_what_may_move_in_a_shot_is_not_negative(key: str, meaning: str) -> None:
    text = find_rig("field-2013").read_text(encoding="utf-8")
    wrong = re.sub(rf"{key} = [0-9e.-]+", f"{key} = -1", text)
    with pytest.raises(RigError) as caught:
        parse_rig(wrong, Path("rig.toml"))
    assert f"sensor.{key}: must be {meaning}" in str(caught.value)


def test_what_a_rig_does_not_state_is_what_good_sensors_do() -> None:
    text = find_rig("field-2013").read_text(encoding="utf-8")
    rig = parse_rig(re.sub(r"u_zero_rel = 0.001, |, u_distortion_m = 1e-4", "", text), Path("rig.toml"))
    assert rig.channel("p_breech").sensor.u_moving_zero_rel == 1e-3
    assert rig.channel("x_camera").sensor.u_bent_m == 1e-4
    # 0 where it is written
    exact = text.replace("u_zero_rel = 0.001", "u_zero_rel = 0")
    assert parse_rig(exact, Path("rig.toml")).channel("p_breech").sensor.u_moving_zero_rel == 0.0


@given(
    added_kg=st.floats(min_value=-700.0, max_value=1e5),
    u_added_kg=st.none() | st.floats(min_value=0.0, max_value=100.0),
    u_m3=st.none() | st.floats(min_value=0.0, max_value=100.0),
)
def test_an_added_mass_and_its_uncertainty_are_in_the_specification(
    added_kg: float, u_added_kg: float | None, u_m3: float | None
) -> None:
    text = RIG if u_m3 is None else RIG.replace("m3 = 782\n", f"m3 = 782\nu_m3 = {u_m3!r}\n")
    bare = rig_of(text)
    rig = bare.with_added_mass(added_kg, u_added_kg)
    assert rig.mechanism.m3 == pytest.approx(bare.mechanism.m3 + added_kg)
    variance = (u_m3 or 0.0) ** 2 + (u_added_kg or 0.0) ** 2
    assert rig.mechanism.u.get("m3", 0.0) ** 2 == pytest.approx(variance)
    assert (rig.added_mass_kg, rig.u_added_mass_kg) == (added_kg, u_added_kg)
    others = {name for name in rig.mechanism.symbols() if name != "m3"}
    assert {name: getattr(rig.mechanism, name) for name in others} == pytest.approx(
        {name: getattr(bare.mechanism, name) for name in others}, nan_ok=True
    )


@pytest.mark.parametrize("added_kg", [-1e4, float("inf")])
def test_an_added_mass_that_leaves_no_recoiling_part_is_refused(added_kg: float) -> None:
    with pytest.raises(RigError, match="as the shot log has it, are no mass"):
        rig_of(RIG).with_added_mass(added_kg, 0.0)


PROJECTILE = "[knowledge.projectile]\nmass_kg = 15.0\nmuzzle_velocity_m_s = 650.0\nu_muzzle_velocity_m_s = 3.0\n"


@pytest.mark.parametrize(("u_m_s", "stands_m_s"), [(0.5, 0.5), (None, 3.0)])
def test_a_measured_muzzle_velocity_takes_the_place_of_the_rigs(u_m_s: float | None, stands_m_s: float) -> None:
    rig = rig_of(RIG + PROJECTILE).with_muzzle_velocity(660.0, u_m_s)
    projectile = rig.knowledge.projectile
    assert projectile is not None
    assert (projectile.muzzle_velocity_m_s, projectile.u_muzzle_velocity_m_s) == (660.0, stands_m_s)
    assert projectile.impulse_n_s == 15.0 * 660.0
    assert (projectile.u_common_rel, projectile.u_own_rel) == (0.0, stands_m_s / 660.0)


def test_a_mass_at_hand_is_stated_with_how_well_it_is_weighed() -> None:
    text, path = load_rig("field-2013").text, find_rig("field-2013")
    rig = parse_rig(f"{text}\n[knowledge]\nweighed_mass_kg = 310.0\nu_weighed_mass_kg = 0.05\n", path)
    assert (rig.knowledge.weighed_mass_kg, rig.knowledge.u_weighed_mass_kg) == (310.0, 0.05)
    for stated, lacks in (("weighed_mass_kg = 310.0", "u_weighed"), ("u_weighed_mass_kg = 0.05", "weighed")):
        with pytest.raises(RigError, match=rf"knowledge\.{lacks}_mass_kg: is missing: `\w+` needs it"):
            parse_rig(f"{text}\n[knowledge]\n{stated}\n", path)


def test_a_rig_that_states_no_projectile_takes_no_muzzle_velocity() -> None:
    rig = rig_of(RIG)
    assert rig.with_muzzle_velocity(660.0, 0.5) is rig


def test_a_muzzle_velocity_that_is_none_is_refused() -> None:
    with pytest.raises(RigError, match=r"0 m/s, as the shot log has it, is no muzzle velocity"):
        rig_of(RIG + PROJECTILE).with_muzzle_velocity(0.0, 0.5)


def test_a_rigs_own_files_are_known_and_no_instruments(tmp_path: Path) -> None:
    rig = load_rig("mixed")
    for name, content, own in (
        ("mixed.toml", "", True),
        ("mixed.dbc", "", True),
        ("copy.toml", rig.text, True),
        ("other.toml", "[tool]", False),
        ("rig.csv", rig.text, False),
        ("other.dbc", "", False),
    ):
        (tmp_path / name).write_text(content, encoding="utf-8")
        assert rig.is_own_file(tmp_path / name) is own, name
    assert not rig.is_own_file(tmp_path / "gone.toml")


TRIGGER = '\n[trigger]\npre_s = 0.5\npost_s = 2.0\n\n[[trigger.any]]\nchannel = "acc_recoil"\nlevel = 300.0\n'


@pytest.mark.parametrize("value", ["{ a = 1 }", "[ 3 ]", "true"])
@pytest.mark.parametrize("key", ["name", "source", "quantity", "role", "unit"])
def test_a_value_of_any_type_is_one_fault_of_its_key_beside_a_trigger(key: str, value: str) -> None:
    channel = 'name = "sync_imu"\nsource = "imu"\nsignal = "sync"\nquantity = "count"\n'
    assert channel in RIG
    lines = [line for line in channel.splitlines() if not line.startswith(f"{key} ")]
    written = "\n".join([*lines, f"{key} = {value}", ""])
    with pytest.raises(RigError) as caught:
        rig_of(RIG.replace(channel, written) + TRIGGER)
    row = "channel[6]" if key == "name" else "channel[6] 'sync_imu'"
    assert f"{row}.{key}" in {fault.key for fault in caught.value.faults}


@pytest.mark.parametrize("value", ["3", "true", "[ 3 ]", '"edge"'])
@pytest.mark.parametrize("table", ["trigger", "knowledge", "report"])
def test_what_is_no_table_is_told_with_what_was_found(table: str, value: str) -> None:
    with pytest.raises(RigError) as caught:
        rig_of(f"{table} = {value}\n{RIG}")
    (fault,) = caught.value.faults
    assert str(fault).startswith(f"{table}: must be a table, found ")


@pytest.mark.parametrize(
    ("load", "fault"),
    [
        ("known = 0.0\nread = 0.1", "known: a load of 0 tells nothing of a scale"),
        ("known = 2e6\nread = -1.9e6", "read: has another sign than known, 2e+06"),
    ],
)
def test_a_known_load_that_tells_nothing_is_refused(load: str, fault: str) -> None:
    text = f'[[knowledge.load]]\nchannel = "p_breech"\nu_known = 1e4\n{load}\n'
    with pytest.raises(RigError, match=rf"knowledge\.load\[0\]\.{re.escape(fault)}"):
        rig_of(f"{RIG}\n{text}")


def test_a_misspelt_key_of_a_row_hides_no_fault_within_it() -> None:
    text = RIG.replace('kind = "sync"', 'kind = "snyc"').replace('signal = "sync"', 'signal = "sync"\nsignl = "a"')
    text = text.replace('name = "imu"', 'name = "imu"\nmatsch = "a"').replace(
        'unit = "mm"', 'unit = "milimeter"\nunits = "mm"'
    )
    with pytest.raises(RigError) as caught:
        rig_of(text)
    assert {fault.key for fault in caught.value.faults} == {
        "source[3] 'imu'.matsch", "source[3] 'imu'.framing.kind", "channel[6] 'sync_imu'.signl",
        "channel[4] 'x_recoil'.units", "channel[4] 'x_recoil'.unit",
    }  # fmt: skip


@pytest.mark.parametrize("match", ["Schuss_{shot}_Prüfung.csv", "Schuss_{shot}_Pru\u0308fung.csv"])
@pytest.mark.parametrize("name", ["Schuss_0017_Prüfung.csv", "Schuss_0017_Pru\u0308fung.csv"])
def test_a_name_is_matched_however_its_signs_over_letters_are_spelled(match: str, name: str) -> None:
    old = re.search(r'match = "[^"]*"', RIG)[0]
    rig = parse_rig(RIG.replace(old, f'match = "{match}"', 1), PATH, {"rig.dbc": DATABASE})
    (source,) = rig.matching(name)
    assert numbers_of(Path(name), source.pattern) == {17}
