from __future__ import annotations

import copy
import pickle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import recoil_acquisition.errors
from recoil_acquisition.errors import (
    AlignmentError,
    CorruptFileError,
    DeviceError,
    Fault,
    FramingError,
    IdentificationError,
    MissingChannelError,
    ReadError,
    RecoilDaqError,
    RigError,
    ShortageError,
    StoreError,
    UnknownFormatError,
    WorkerError,
    nearest_first,
)

ONE_OF_EACH = (
    RecoilDaqError("wrong", path=Path("a.csv"), place="line 3", expected="7", found="8", remedy="mend it"),
    ReadError("wrong", path="a.csv"),
    CorruptFileError("wrong", place="byte 12"),
    UnknownFormatError(Path("a.csv"), ["x", "y"], ["x", "y", "z"]),
    UnknownFormatError(Path("a.csv"), [], ["x", "y", "z"]),
    MissingChannelError("acc", ["ACC", "p"], path=Path("a.csv")),
    MissingChannelError("acc", []),
    FramingError("wrong"),
    StoreError("wrong", remedy="mend it"),
    ShortageError("wrong"),
    RigError("rig.toml", [Fault("a", "is missing"), Fault("b", "unknown")]),
    DeviceError("wrong"),
    AlignmentError("wrong"),
    IdentificationError("wrong"),
    WorkerError("wrong", found="killed"),
)


def test_every_error_is_drawn_in_the_tree_and_listed_here() -> None:
    defined = {
        name: kind
        for name, kind in vars(recoil_acquisition.errors).items()
        if isinstance(kind, type) and issubclass(kind, RecoilDaqError)
    }
    assert {type(error) for error in ONE_OF_EACH} == set(defined.values())
    for name in defined:
        assert name in str(recoil_acquisition.errors.__doc__)


@pytest.mark.parametrize("error", ONE_OF_EACH, ids=lambda e: type(e).__name__)
def test_every_error_comes_back_whole_from_another_process(error: RecoilDaqError) -> None:
    for copied in (pickle.loads(pickle.dumps(error)), copy.copy(error)):  # noqa: S301  # our own bytes
        assert type(copied) is type(error)
        assert str(copied) == str(error)
        assert vars(copied) == vars(error)


@pytest.mark.parametrize("error", ONE_OF_EACH, ids=lambda e: type(e).__name__)
def test_every_error_is_one_line(error: RecoilDaqError) -> None:
    assert str(error)
    assert "\n" not in str(error)


def test_a_message_says_file_place_expected_found_and_remedy() -> None:
    assert str(ONE_OF_EACH[0]) == "a.csv: line 3: wrong; expected 7, found 8; mend it"
    assert str(StoreError("wrong", found="x")) == "wrong; found x"
    assert str(StoreError("wrong", expected="x")) == "wrong; expected x"
    assert str(StoreError("wrong", place="byte 3")) == "byte 3: wrong"


def test_a_problem_of_several_lines_becomes_one() -> None:
    assert str(StoreError("first\nsecond")) == "first second"


def test_a_missing_signal_names_the_nearest_ones_and_how_many_more() -> None:
    error = MissingChannelError("acc_recoil", [f"p{i}" for i in range(11)] + ["acc_recoi"])
    assert error.nearest[0] == "acc_recoi"
    assert "found 'acc_recoi', " in str(error)
    assert "and 4 more" in str(error)
    assert "no signals at all" in str(MissingChannelError("acc", []))


def test_an_unknown_format_names_its_candidates() -> None:
    assert UnknownFormatError(Path("a"), ["x", "y"], ["x", "y", "z"]).candidates == ("x", "y")
    unknown = UnknownFormatError(Path("a"), [], ["x", "y", "z"])
    assert "one of the 3 formats that `recoil-daq formats` lists" in str(unknown)


def test_a_rig_error_lists_all_its_faults_and_counts_them() -> None:
    one, two = Fault("a", "is missing"), Fault("b", "unknown")
    assert str(RigError("rig.toml", [one])) == "rig.toml: 1 fault: a: is missing"
    assert str(RigError("rig.toml", [one, two])) == "rig.toml: 2 faults: a: is missing | b: unknown"
    assert RigError("rig.toml", [one, two]).faults == (one, two)


def test_the_nearest_name_comes_first_whatever_its_case() -> None:
    assert nearest_first("ACC_recoil", ["pressure", "acc_carriage", "acc_recoil"])[0] == "acc_recoil"
    assert nearest_first("x", []) == ()
    assert set(nearest_first("acc", ["ACC", "Acc", "acc"])) == {"ACC", "Acc", "acc"}


@given(st.text(max_size=6), st.lists(st.text(max_size=6), max_size=6, unique=True))
def test_sorting_names_by_likeness_loses_none(name: str, available: list[str]) -> None:
    assert sorted(nearest_first(name, available)) == sorted(available)
