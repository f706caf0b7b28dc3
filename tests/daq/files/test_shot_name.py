"""A shot's name is safe as a file's name on every system, or refused with a reason."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.files.shot_name import LONGEST_BYTES, shot_name_fault


@pytest.mark.parametrize(
    "name", ["0001", "a", "shot_3", "2026-01-22T10", "A+B.2", "Schuß-7", "console", "COM10", "nulls.x"]
)
def test_names_in_use_are_taken(name: str) -> None:
    assert shot_name_fault(name) is None


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "is empty"),
        ("-rf", "would be taken for an option"),
        (".hidden", "would be taken for a hidden file"),
        ("..", "would be taken for a hidden file"),
        ("a/b", "holds '/'"),
        ("a\\b", "holds"),
        ("../../x", "holds '/'"),
        ("a b", "holds ' '"),
        ("a ", "holds ' '"),
        ("a.", "ends with `.`"),
        ("a\n", "holds"),
        ("a\x1b[2J", "holds"),
        ("a:b", "holds ':'"),
        ("a\udc80", "holds"),
        ("a\u202eb", "holds"),
        ("Schu\u0308tz", "write it as 'Schütz'"),
        ("0001.h5", "ends with '.h5', as the files do"),
        ("0001.Partial", "ends with '.Partial'"),
        ("CON", "Windows reserves"),
        ("nul", "Windows reserves"),
        ("Com1", "Windows reserves"),
        ("LPT9.txt", "Windows reserves"),
        ("aux.tar.gz", "Windows reserves"),
        ("COM¹", "Windows reserves"),
        ("a" * 129, "longer than 128 bytes"),
        ("ß" * 65, "longer than 128 bytes"),
    ],
)
def test_a_name_that_would_do_harm_as_a_files_name_is_refused_with_its_reason(name: str, why: str) -> None:
    fault = shot_name_fault(name)
    assert fault is not None
    assert why in fault


@pytest.mark.exhaustive
@given(st.text(st.characters(codec="utf-8"), max_size=40))
def test_a_name_that_is_taken_makes_one_file_in_its_folder(name: str) -> None:
    if shot_name_fault(name) is None:
        made = Path("folder") / f"{name}.h5"
        assert (made.parent, made.name) == (Path("folder"), f"{name}.h5")
        assert name.isprintable()


def test_the_longest_name_leaves_room_for_what_is_put_round_it() -> None:
    name = "a" * LONGEST_BYTES
    assert shot_name_fault(name) is None
    assert len(f"..{name}.cut.partial") + len(f"{name}_acquisition.json") - len(name) < 255
