"""One mistake in a rig file is one fault: what only follows from it is not said."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import load_rig, parse_rig


def faults_of(rig_name: str, *changes: tuple[str, str]) -> list[str]:
    rig = load_rig(rig_name)
    text = rig.text
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(RigError) as caught:
        parse_rig(text, rig.path, dict(rig.databases))
    return [str(fault) for fault in caught.value.faults]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        # the trigger names that channel
        (('name = "p_brake"', "name = 5"), "channel[4].name: must be a name for the channel, found 5"),
        (('name = "acc_recoil"', 'nam = "acc_recoil"'), "channel[0].nam: unknown key; did you mean `name`?"),
        (('name = "dewetron"', 'name = ""'), "source[0] ''.name: must be a name for the source"),
        (("[[source]]", "[[sources]]"), "sources: unknown key; did you mean `source`?"),
        (("[[channel]]", "[[chanel]]"), "chanel: unknown key; did you mean `channel`?"),
        (("m3 = 782.0", "m_3 = 782.0"), "mechanism.m_3: unknown key; did you mean "),
        (('sync = "AA 55"', 'synk = "AA 55"'), "source[2] 'imu'.framing.synk: unknown key; did you mean `sync`?"),
        (('quantity = "acceleration"', 'quantity = "speed"'), "channel[0] 'acc_recoil'.quantity: unknown quantity"),
        (
            ("[source.framing.counter]", ""),
            "source[2] 'imu'.framing.checksum.field: unknown key, as is modulo; there are algo, format, from, mark, ",
        ),
    ],
)
def test_what_follows_from_a_fault_is_not_said(change: tuple[str, str], fault: str) -> None:
    (found,) = faults_of("mixed", change)
    assert found.startswith(fault)


def test_a_name_that_is_declared_nowhere_is_said_once_with_how_often_it_stands_there() -> None:
    (found,) = faults_of("mixed", ('name = "dewetron"', 'name = "dewetronx"'))
    assert found == "reference_clock: 'dewetron' is no source; did you mean 'dewetronx'? (this explains 4 more)"


def test_a_model_that_is_misspelt_is_no_gun() -> None:
    (found,) = faults_of("sled", ("model = ", "modell = "))
    assert found == "mechanism.modell: unknown key; did you mean `model`?"


def test_a_model_that_is_forgotten_is_asked_for_and_nothing_of_a_gun() -> None:
    (found,) = faults_of("sled", ('model = "line"', ""))
    assert found == (
        'mechanism.model: is missing: write model = "line", as driving_force, recoil_velocity, resisting_force '
        "are roles of a body on a line"
    )


def test_a_value_of_a_gun_makes_a_role_of_a_line_the_fault() -> None:
    found = faults_of("sled", ('model = "line"', "XA = 1.95"))
    assert "mechanism.YA" in {one.partition(":")[0] for one in found}
    assert not any(one.startswith("mechanism.model:") for one in found)


def test_two_mistakes_are_two_faults() -> None:
    found = faults_of("mixed", ('name = "p_brake"', "name = 5"), ("m3 = 782.0", 'm3 = "heavy"'))
    assert len(found) == 2
    found = faults_of("mixed", ('channel = "p_brake"', 'channel = "p_drake"'), ("XA = 1.95", ""))
    assert [one.partition(":")[0] for one in found] == ["mechanism.XA", "trigger.any[0].channel"]


def mistakes(text: str) -> Iterator[str]:
    """Misspell each key, each heading and each name in turn, and leave each heading out."""
    lines = text.split("\n")
    for k, line in enumerate(lines):
        code = line.split(" #")[0]
        if code.strip().startswith("#"):
            continue
        changed = [code[: m.end(1)] + "q" + code[m.end(1) :] for m in re.finditer(r"([A-Za-z_]\w*) *= ", code)]
        changed += [code[: m.end() - 1] + "q" + code[m.end() - 1 :] for m in re.finditer(r'"([^"]+)"', code)]
        heading = re.match(r"\[+([\w.]+)\]+", code)
        changed += ["", code.replace(heading[1], f"{heading[1]}q")] if heading else []
        yield from ("\n".join([*lines[:k], one, *lines[k + 1 :]]) for one in changed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["mixed", "field-2013", "sled"])
def test_a_mistake_at_any_place_of_a_rig_file_is_one_fault(name: str) -> None:
    rig, refused = load_rig(name), list[RigError]()
    for text in mistakes(rig.text):
        try:
            parse_rig(text, rig.path, dict(rig.databases))
        except RigError as error:
            refused.append(error)
    assert len(refused) > 50
    assert [str(error) for error in refused if len(error.faults) != 1] == []
