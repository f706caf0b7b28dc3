"""`check --explain` draws the mechanism with its symbols, also of a rig that is not whole yet."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from recoil_daq.terminal.mechanism import GUN, LINE
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS, Mechanism, MechanismModel
from recoil_rigs.mechanism.mechanisms import MECHANISMS
from recoil_rigs.rig import find_rig

FORCES = {"friction", "slide_friction"}


@pytest.mark.parametrize("drawing", [GUN, LINE], ids=["gun", "line"])
def test_a_drawing_fits_a_terminal_of_80_columns(drawing: str) -> None:
    assert max(map(len, drawing.split("\n"))) <= 80
    assert drawing.isascii()


def test_a_drawing_shows_every_symbol_of_a_length_an_angle_and_a_body() -> None:
    shown = set(re.findall(r"\w+", GUN))
    assert shown >= Mechanism.OF_GUN - {"f", "J1", "J2"} | {"m3", "phi20", "A", "B1", "B2", "B3", "C", "D", "P"}
    assert shown & set(MEANINGS) >= {"XA", "YA", "X1", "Y1", "L", "b", "d", "e", "s2", "d2", "phi10", "m1", "m2", "J1"}
    assert set(re.findall(r"\w+", LINE)) >= {"m3", "phi20", "driving_force", "resisting_force", *FORCES}


def test_a_sound_rig_is_explained_with_its_values(run) -> None:
    done = run("check", "mixed", "--explain")
    assert done.exit_code == 0
    assert GUN.strip("\n").split("\n")[4] in done.stdout
    assert re.search(r"\nXA +1\.95 +trunnion A ahead of C", done.stdout)
    assert re.search(r"\nfriction +1500 +150 +packing friction", done.stdout)
    assert "Rig mixed: no fault" in done.stdout
    assert "driving_force" in run("check", "sled", "--explain").stdout
    assert "e5, muzzle" not in run("check", "mixed").stdout


def test_the_document_has_the_symbols(run) -> None:
    document = json.loads(run("check", "mixed", "--explain", "--json").stdout)
    symbols = {one["symbol"]: one for one in document["mechanism"]["symbols"]}
    assert document["mechanism"]["model"] == "gun"
    assert tuple(symbols) == MECHANISMS[MechanismModel.GUN].symbols_of(())
    assert symbols["XA"] == {"symbol": "XA", "value": 1.95, "u": None, "needed": True, "meaning": MEANINGS["XA"]}
    assert "mechanism" not in json.loads(run("check", "mixed", "--json").stdout)
    line = json.loads(run("check", "sled", "--explain", "--json").stdout)["mechanism"]
    assert line["model"] == "line"
    assert "XA" not in {one["symbol"] for one in line["symbols"]}


def test_a_rig_that_is_not_whole_is_drawn_before_its_faults(run, tmp_path: Path) -> None:
    text = find_rig("field-2013").read_text("utf-8")
    text = re.sub(r"(?m)^XA = .*$", 'XA = "TODO from the drawing"', re.sub(r"(?m)^b = .*\n", "", text))
    rig = tmp_path / "rig.toml"
    rig.write_text(text, encoding="utf-8")
    done = run("check", rig, "--explain")
    assert done.exit_code == 3
    assert "e5, muzzle" in done.stdout
    assert re.search(r"\nXA +TODO from the drawing", done.stdout)
    assert re.search(r"\nb +missing", done.stdout)
    assert "still to be stated in [mechanism]: XA, b" in done.stdout
    assert "mechanism" in done.stderr
    rig.write_text("mechanism = 7\n", encoding="utf-8")
    assert "still to be stated in [mechanism]: m3, phi20" in run("check", rig, "--explain").stdout
    rig.write_text("mechanism = \n", encoding="utf-8")
    assert run("check", rig, "--explain").exit_code == 3
