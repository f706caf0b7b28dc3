"""Values that a rig file leaves open: each is refused by its key and its question, and nothing else for its sake."""

import tomllib

import pytest

from recoil_acquisition.errors import FaultCode, RigError
from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.tables.open_values import without_open_values

MIXED = find_rig("mixed")


def faults_of(*changes: tuple[str, str]) -> RigError:
    text = MIXED.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(RigError) as refused:
        parse_rig(text, MIXED, refuse_doubts=False)
    return refused.value


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("m3 = 782.0", 'm3 = "TODO, specification mass, kg"', "mechanism.m3"),
        ("u_rel = 0.005", 'u_rel = "TODO"', "channel[0] 'acc_recoil'.sensor.u_rel"),
        ("range = [-5000.0, 5000.0]", 'range = ["TODO", 5000.0]', "channel[0] 'acc_recoil'.sensor.range"),
        ('role = "tipping_rate"', 'role = "TODO tipping_rate?"', "channel[8] 'gyro_tipping'.role"),
        ("frame_rate = 6000.0", 'frame_rate = "TODO"', "source[3] 'camera'.frame_rate"),
        ("level = 1.5e6", 'level = "TODO"', "trigger.any[0].level"),
        ('quantity = "pressure"', 'quantity = "TODO"', "channel[3] 'p_breech'.quantity"),
        ('framing.fields]]                # `at` counts from the first sync byte\nname = "counter"\nat = 2',
         'framing.fields]]\nname = "counter"\nat = "TODO"', "source[2] 'imu'.framing.fields[0].at"),
    ],
)  # fmt: skip
def test_an_open_value_is_the_one_fault_of_its_key(old: str, new: str, key: str) -> None:
    error = faults_of((old, new))
    assert [fault.key for fault in error.faults if fault.code is FaultCode.OPEN] == [key]
    assert error.open == 1
    assert f"{error.stated} of {error.stated + 1} values stated" in str(error)


def test_what_else_is_wrong_is_told_beside_it() -> None:
    error = faults_of(("m3 = 782.0", 'm3 = "TODO"'), ("phi10 = 0.02", "phi10 = 1.0"), ("phi20 = 0.17", "phi20 = true"))
    assert [fault.code for fault in error.faults] == [FaultCode.TYPE, FaultCode.OPEN]
    assert error.heading.startswith("1 fault, ")


def test_a_text_that_only_holds_the_word_is_no_open_value() -> None:
    tables = tomllib.loads('name = "not TODO"\nother = "TODOS"\nlist = ["a", "TODO b"]\n')
    found = without_open_values(tables)
    assert found.tables == {"name": "not TODO", "other": "TODOS"}
    assert [(one.parts, one.question) for one in found.open] == [(("list",), "b")]


def test_what_only_a_person_knows_is_counted_value_by_value() -> None:
    text = """
        name = "a"
        [mechanism]
        m3 = 1.0
        u_m3 = 0.1
        [knowledge.projectile]
        mass_kg = 3.0
        [[knowledge.load]]
        channel = "p"
        known = 1.0
        [[channel]]
        name = "p"
        signal = "AI 1"
        role = "breech_pressure"
        sensor = { range = [0, 1], u_rel = 0.1 }
    """
    assert without_open_values(tomllib.loads(text)).stated == 2 + 1 + 2 + 1 + 2
