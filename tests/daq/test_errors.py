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
    ErrorCode,
    Fault,
    FaultCode,
    FileEnd,
    FramingError,
    IdentificationError,
    MissingChannelError,
    NoFrameRateError,
    NoSignalError,
    ReadError,
    RecoilDaqError,
    RigError,
    Row,
    ShortageError,
    StoreError,
    UnknownFormatError,
    WorkerError,
    nearest_first,
    visible,
)
from recoil_acquisition.remark import Severity

FAULTS = (
    Fault((Row("channel", "p_brake", 3), "unit"), "is missing", FaultCode.MISSING),
    Fault(("b",), "unknown key", FaultCode.UNKNOWN),
)

ONE_OF_EACH = (
    RecoilDaqError("wrong", path=Path("a.csv"), place="line 3", expected="7", found="8", remedy="mend it"),
    ReadError("wrong", path="a.csv"),
    CorruptFileError("wrong", place="byte 12"),
    UnknownFormatError(Path("a.csv"), ["x", "y"], ["x", "y", "z"]),
    UnknownFormatError(Path("a.csv"), [], ["x", "y", "z"]),
    MissingChannelError("acc", ["ACC", "p"], path=Path("a.csv")),
    MissingChannelError("acc", []),
    NoSignalError("wrong", {"S": "a structure"}, ["a remark"], path="a.mat"),
    NoFrameRateError("wrong"),
    FramingError("wrong"),
    StoreError("wrong", remedy="mend it"),
    ShortageError("wrong"),
    RigError("rig.toml", FAULTS),
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


def test_errors_of_each_class_have_a_code_of_their_own() -> None:
    usual = [kind.usual_code for kind in {type(error) for error in ONE_OF_EACH}]
    assert len(set(usual)) == len(usual)
    for error in ONE_OF_EACH:
        assert error.code is type(error).usual_code


def test_a_code_that_is_stated_comes_back_from_another_process() -> None:
    error = pickle.loads(pickle.dumps(ReadError("wrong", code=ErrorCode.NO_SOURCE)))  # noqa: S301  # our own bytes
    assert error.code is ErrorCode.NO_SOURCE
    faults = pickle.loads(pickle.dumps(RigError("rig.toml", FAULTS))).faults  # noqa: S301  # our own bytes
    assert [fault.code for fault in faults] == [FaultCode.MISSING, FaultCode.UNKNOWN]
    assert [fault.subject for fault in faults] == ["p_brake", None]


@pytest.mark.parametrize("kind", [ReadError, CorruptFileError])
def test_a_file_whose_end_is_missing_is_cut_off_whatever_is_said_of_it(kind: type[ReadError]) -> None:
    assert kind("half a row", file_end=FileEnd.MISSING).code is ErrorCode.CUT_OFF
    assert kind("cut off", file_end=FileEnd.UNCLEAR).code is kind.usual_code
    assert kind("half a row", file_end=FileEnd.MISSING, code=ErrorCode.NO_SOURCE).code is ErrorCode.NO_SOURCE


@pytest.mark.parametrize("error", ONE_OF_EACH, ids=lambda e: type(e).__name__)
def test_every_error_is_one_line(error: RecoilDaqError) -> None:
    assert str(error)
    assert "\n" not in str(error)


def test_a_message_says_file_place_expected_found_and_remedy() -> None:
    assert str(ONE_OF_EACH[0]) == "a.csv: line 3: wrong; expected 7, found 8; mend it"
    assert str(StoreError("wrong", found="x")) == "wrong; found x"
    assert str(StoreError("wrong", expected="x")) == "wrong; expected x"
    assert str(StoreError("wrong", place="byte 3")) == "byte 3: wrong"


def test_an_error_leaves_its_path_out_where_that_is_known() -> None:
    assert ONE_OF_EACH[0].without_path() == "line 3: wrong; expected 7, found 8; mend it"
    # a problem that names the path itself keeps it
    assert StoreError("a.csv: wrong", path="a.csv").without_path() == "a.csv: wrong"
    assert StoreError("wrong").without_path() == "wrong"


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
    one, two = (Fault((key,), "is missing", FaultCode.MISSING) for key in "ab")
    assert str(RigError("rig.toml", [one])) == "rig.toml: 1 fault: a: is missing"
    assert str(RigError("rig.toml", [one, two])) == "rig.toml: 2 faults: a: is missing | b: is missing"
    assert RigError("rig.toml", [one, two]).faults == (one, two)


@pytest.mark.parametrize(
    ("fault", "key", "subject"),
    [
        (FAULTS[0], "channel[3] 'p_brake'.unit", "p_brake"),
        (Fault((Row("source", "can"), "counters", 1), "", FaultCode.FILE), "source 'can'.counters[1]", "can"),
        (Fault((Row("source", None, 2), "name"), "", FaultCode.MISSING), "source[2].name", None),
        (Fault(("trigger", "any", 0, "level"), "", FaultCode.UNIT, "p"), "trigger.any[0].level", "p"),
        (Fault(("mechanism", "m3"), "", FaultCode.RANGE), "mechanism.m3", None),
        (Fault(("a.b.csv",), "", FaultCode.FILE, "a.b.csv"), "a.b.csv", "a.b.csv"),
    ],
)
def test_a_key_is_spelt_of_its_parts_and_names_what_the_fault_is_about(
    fault: Fault, key: str, subject: str | None
) -> None:
    assert (fault.key, fault.subject) == (key, subject)


def test_a_fault_in_a_table_is_put_below_its_key() -> None:
    below = Fault(("framing", "kind"), "is missing", FaultCode.MISSING).below((Row("source", "imu", 2),))
    assert str(below) == "source[2] 'imu'.framing.kind: is missing"
    assert (below.code, below.subject) == (FaultCode.MISSING, "imu")


def test_a_fault_is_a_finding_of_the_contract() -> None:
    assert FAULTS[0].finding(Severity.FATAL) == {
        "code": "missing", "about": "p_brake", "severity": "fatal", "text": "channel[3] 'p_brake'.unit: is missing",
    }  # fmt: skip


def test_the_nearest_name_comes_first_whatever_its_case() -> None:
    assert nearest_first("ACC_recoil", ["pressure", "acc_carriage", "acc_recoil"])[0] == "acc_recoil"
    assert nearest_first("x", []) == ()
    assert set(nearest_first("acc", ["ACC", "Acc", "acc"])) == {"ACC", "Acc", "acc"}


@given(st.text(max_size=6), st.lists(st.text(max_size=6), max_size=6, unique=True))
def test_sorting_names_by_likeness_loses_none(name: str, available: list[str]) -> None:
    assert sorted(nearest_first(name, available)) == sorted(available)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x07", r"\x1b[31mred\x07"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x9b31m", r"\x9b31m"),
        ("shot\u202e5h.1\u2066", r"shot\u202e5h.1\u2066"),
        ("bytes \udcff", r"bytes \udcff"),
        ("Prüfstand 5 µm², 試験", "Prüfstand 5 µm², 試験"),
    ],
)
def test_what_a_terminal_obeys_is_spelled(text: str, shown: str) -> None:
    assert visible(text) == shown


@given(st.text())
def test_it_is_one_printable_line_and_nothing_changes_twice(text: str) -> None:
    shown = visible(text)
    assert len(shown.splitlines()) <= 1
    assert visible(shown) == shown
    assert not any(ord(c) < 32 or 0x7F <= ord(c) < 0xA0 for c in shown)
