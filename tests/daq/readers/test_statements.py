"""What becomes of what stands beside samples, whatever the format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import NoSignalError, ReadError
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import StatementKind, Statements, statement_of, statements_in
from recoil_acquisition.remark import NoteCode

VALUES = np.array([0.0, 1.0, 2.0, 9.0])


def recorded(*channels: Statements) -> Recording:
    base = TimeBase.uniform("recorder", 0.0, 1e-3, VALUES.size)
    stored = [
        StoredChannel(SignalHeader(f"p{i}", "bar", VALUES.size), base, lambda a, b: VALUES[a:b].copy(), beside=one)
        for i, one in enumerate(channels)
    ]
    return Recording(Path("a.dat"), "other", stored, metadata={})


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("scaling_factor", 0.5, StatementKind.SCALE), ("CoefA", 2.0, StatementKind.SCALE),
        ("Sensitivity", "40 mV/MPa", StatementKind.SCALE), ("volts_per_bit", 1e-4, StatementKind.SCALE),
        ("poly coefficients", [0.0, 2.0], StatementKind.SCALE), ("zero_offset", -3, StatementKind.SHIFT),
        ("k", 0.0305, StatementKind.COEFFICIENT), ("valid_range", [-5, 5], StatementKind.RANGE),
        ("Full Scale", "250 bar", StatementKind.RANGE), ("nodata_value", -999, StatementKind.LOST),
        ("y_units", "psi", StatementKind.UNIT), ("start_offset", 0.5, StatementKind.INSTANT),
        ("calibration_date", 20260301, None), ("serial_number", 4711, None), ("byte_offset", 4, None),
        ("filter_limit", 1e3, None), ("description", "left", None), ("gain", float("nan"), StatementKind.SCALE),
        ("gain", True, None), ("gain", [], None), ("x_unit", "", None), ("sample_rate", 1e4, None),
        ("Verstärkung", 0.5, StatementKind.SCALE), ("Maßstab", 0.5, StatementKind.SCALE),
        ("Gain", "0,001 g/digit", StatementKind.SCALE), ("tare", 5.0, StatementKind.SHIFT),
        ("baseline", 5.0, StatementKind.SHIFT), ("time_zero", 0.1, None), ("inverted", True, StatementKind.WORDS),
        ("polarity", -1, StatementKind.WORDS), ("polarity", "normal", None), ("invert", False, None),
        ("resolution", 0.001, StatementKind.NUMBER), ("channel_number", 3, None),
    ],
)  # fmt: skip
def test_a_name_and_a_value_say_what_they_may_do_to_numbers(name: str, value: Any, kind: StatementKind | None) -> None:
    found = statement_of(name, value)
    assert (None if found is None else found.kind) == kind


def test_what_was_used_and_what_changes_nothing_is_not_noted() -> None:
    said = {"gain": 2.0, "scale": 1.0, "offset": 0, "unit": "bar"}
    assert recorded(Statements(said, {"gain", "unit"})).notes == ()


def test_one_statement_on_several_signals_is_one_note() -> None:
    gain = Statements({"gain": 2.0})
    (note,) = recorded(*[gain] * 8).notes
    assert (note.code, note.about) == (NoteCode.UNITS, None)
    assert note == "p0, p1, p2, p3, p4, p5 and 2 more: the file states gain = 2: it is not applied"


def test_integers_that_a_statement_may_scale_are_left_out_with_the_reason() -> None:
    recording = recorded(Statements({"k": 0.5}, (), True), Statements({"k": 0.5}))
    assert [one.name for one in recording.signals] == ["p1"]
    assert recording.notes == ("p0: integers with the attribute k, whose meaning is open: left out",)
    with pytest.raises(ReadError, match="whose meaning is open; export it as numbers in its unit"):
        recording.read("p0")
    with pytest.raises(NoSignalError, match="no signal is known to be a measurement"):
        recorded(Statements({"lsb": 0.5}, (), True))


@pytest.mark.parametrize(
    ("said", "outside"),
    [
        ({"range": [0, 2]}, 1), ({"minimum": 0.5}, 1), ({"valid_max": 1.5}, 2), ({"full_scale": 10}, 0),
        ({"low_limit": 1, "high_limit": 2}, 2), ({"range": [5, 5]}, 0),
    ],
)  # fmt: skip
def test_samples_outside_of_a_stated_range_are_counted_as_they_are_read(said: dict[str, Any], outside: int) -> None:
    recording = recorded(Statements(said))
    assert recording.notes == ()
    np.testing.assert_array_equal(recording.read("p0"), VALUES)
    told = [str(note) for note in recording.notes]
    assert len(told) == bool(outside)
    assert all(f"{outside} of 4 samples lie outside of the range that the file states" in one for one in told)


def test_numbers_of_unknown_names_are_named_beside_integers_alone() -> None:
    said = {"resolution": 0.001, "pas": 2.0, "channel": 3, "level": 1, "phase": 0}
    assert recorded(Statements(said)).notes == ()
    (note,) = recorded(Statements(said, (), True), Statements(said, (), True)).notes
    assert recorded(Statements({"conversion": 0.5, **said}, ("conversion",), True)).notes == ()
    assert note == "p0, p1: stored integers, and the file states resolution = 0.001, pas = 2: none of it is applied"


def test_numbers_that_are_none_are_open_and_bound_nothing() -> None:
    nan = float("nan")
    assert Statements({"gain": nan}, (), True).refusal
    assert Statements({"fill_value": nan, "valid_max": nan, "range": [nan, 1.0]}).limits is None
    assert recorded(Statements({"fill_value": nan})).notes == ()
    assert recorded(Statements({"gain": nan})).notes == ("p0: the file states gain = nan: it is not applied",)


@pytest.mark.parametrize(
    ("code", "others", "is_named"),
    [
        (-9999.0, (0.0, 5.0), True), (-999.0, (980.0, 1039.0), True), (1e30, (-3.0, 2.0), True),
        (float(np.float32(9.96921e36)), (0.0, 1.0), True), (999.0, (0.0, 998.0), False), (-998.0, (0.0, 5.0), False),
    ],
)  # fmt: skip
def test_a_number_that_often_means_a_lost_sample_is_named_where_it_stands_apart(
    code: float, others: tuple[float, float], is_named: bool
) -> None:
    values = np.r_[np.linspace(*others, 20), code, code]
    base = TimeBase.uniform("recorder", 0.0, 1e-3, values.size)
    stored = StoredChannel(SignalHeader("p", "bar", values.size), base, lambda a, b: values[a:b].copy())
    recording = Recording(Path("a.dat"), "other", [stored], metadata={})
    np.testing.assert_array_equal(recording.read("p"), values)
    said = f"p: 2 of 22 samples are {code:.7g}, far from all others: they are taken as they are; if it means"
    assert [note.startswith(said) for note in recording.notes] == [True] * is_named


def test_lines_of_a_head_and_texts_are_statements_too() -> None:
    lines = ["Scale factor: 0.5 bar/V", "Date: 01.02.2026", "Time;12:30", '"Offset",12.5', "Unit: psi", "x" * 5000]
    assert statements_in(lines) == {"Scale factor": "0.5 bar/V", "Offset": "12.5", "Unit": "psi"}
    (one,) = Statements({"comment": "to be multiplied by the factor 0.5"}).open
    assert one.kind is StatementKind.WORDS
    assert Statements({"comment": "gain = 2"}).scaling == "gain"


@pytest.mark.parametrize(
    ("name", "value", "rate_hz"),
    [
        ("sampling_rate", 500.0, 500), ("Sample Rate", "2 kHz", 2000), ("NI_SampleRate", 2000, 2000),
        ("fs_hz", 900.0, 900), ("dt", 2e-3, 500), ("sample_interval", "4 ms", 250),
    ],
)  # fmt: skip
def test_a_rate_that_the_samples_have_not_is_named(name: str, value: Any, rate_hz: int) -> None:
    (note,) = recorded(*[Statements({name: value}, {name})] * 2).notes
    assert note == (
        f"p0, p1: the file states {name}, which makes {rate_hz} Hz, and dates the samples at 1000 Hz: they are taken "
        "as they are dated"
    )
    assert note.code == NoteCode.CONTRADICTION


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sample_rate", 1000.4), ("fs", "1 kHz"), ("dt", 1e-3), ("fs", 0), ("fs", float("nan")), ("fs", [500.0, 2.0]),
        ("fs", "3 turns"), ("rate", 5.0),
    ],
)  # fmt: skip
def test_the_rate_that_the_samples_have_and_what_is_none_are_not(name: str, value: Any) -> None:
    assert recorded(Statements({name: value})).notes == ()


@pytest.mark.parametrize("value", ["1,000", "1,000 V/g", "-12,500"])
def test_a_factor_whose_comma_may_part_thousands_or_decimals_is_named_as_it_stands(value: str) -> None:
    (note,) = recorded(Statements({"gain": value})).notes
    assert f"the file states gain = {value!r}: it is not applied" in note


def test_a_decimal_comma_that_can_be_nothing_else_is_one() -> None:
    assert recorded(Statements({"gain": "1,00"}), Statements({"gain": "1,0000"})).notes == ()
    (note,) = recorded(Statements({"gain": "0,001 g"})).notes
    assert "gain = 0.001 g" in note
