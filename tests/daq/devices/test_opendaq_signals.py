"""Signals of an openDAQ device as channels by ticks, of a library that is made by hand."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import pytest

from recoil_acquisition.devices.opendaq_signals import Changed, Run, SignalsChangedError, signals_of_device, time_source
from tests.builders.opendaq_library import GAP, Library, changed, device, domain, signal, value


def read_by(*signals, wanted=(), **scripts):
    library = Library(**scripts)
    found = signals_of_device(library, device(*signals), wanted)
    assert found is not None
    return library, found


def only(*signals, **scripts):
    _, found = read_by(*signals, **scripts)
    return found.readers[0]


def test_a_channel_is_what_its_descriptors_say():
    channel = only(signal("p", value(unit="MPa"), domain(step=5))).channel
    assert (channel.name, channel.unit, channel.tick_rate, channel.step) == ("p", "MPa", Fraction(1_000_000), 5)
    assert (channel.factor, channel.offset) == (1.0, 0.0)
    assert channel.said == {
        "id": "/dev/p", "values": "Float64", "Range": "-10 MPa to 10 MPa", "origin": "1970-01-01T00:00:00Z"
    }  # fmt: skip


def test_scaled_numbers_are_read_as_they_are_sent():
    library, found = read_by(signal("a", value(scaling=("Linear", "Int32", 0.25, -3.0))), signal("b", value("Int16")))
    assert library.asked == {"a": ("Int32", "unscaled"), "b": ("Int16", "scaled")}
    assert (found.readers[0].channel.factor, found.readers[0].channel.offset) == (0.25, -3.0)


@pytest.mark.parametrize(
    ("origin", "scale", "ahead", "start_ns"),
    [
        ("1970-01-01T00:00:00Z", None, None, 0),
        ("2026-11-28T12:00:00.500000+00:00", "Unknown", None, 1_795_867_200_500_000_000),
        ("1970-01-01T00:00:00Z", "Utc", 250, 250_000),
        ("1970-01-01T00:00:00Z", "Tai", None, None),
        ("1970-01-01T00:00:00Z", "Gps", 3, None),
        ("1970-01-01T00:00:00", None, None, None),
        ("", None, None, None),
        ("power-on", None, None, None),
    ],
)
def test_the_instant_of_tick_0_is_stated_or_unknown(origin, scale, ahead, start_ns):
    reader = only(signal("p", None, domain(origin=origin, scale=scale, ahead=ahead)))
    assert reader.start_utc_ns == start_ns
    if scale in ("Tai", "Gps"):
        assert reader.channel.said["time scale"] == scale


@pytest.mark.parametrize(
    ("described", "counted", "why"),
    [
        (value("Struct"), None, "its samples are Struct"),
        (value("ComplexFloat64"), None, "its samples are ComplexFloat64"),
        (value(dimensions=["bins"]), None, "each of its samples is a list"),
        (value(rule="Constant"), None, "its values follow the rule Constant"),
        (value(scaling=("Other", "Int32", 1.0, 0.0)), None, "its scaling is Other"),
        (None, domain(unit="Hz"), "its domain does not count seconds"),
        (None, domain(rule="Constant"), "its ticks follow the rule Constant"),
        (None, domain(step=0), "its ticks are 0 apart"),
    ],
)
def test_what_is_no_row_of_numbers_is_left_out_by_name(described, counted, why):
    _, found = read_by(signal("good"), signal("odd", described, counted))
    assert [one.channel.name for one in found.readers] == ["good"]
    assert found.left_out == (f"signal 'odd' is left out: {why}",)


def test_a_signal_that_is_wanted_is_read_alone_and_all_are_where_one_is_not_there():
    names = [one.channel.name for one in read_by(signal("a"), signal("b"), wanted=["b"])[1].readers]
    assert names == ["b"]
    names = [one.channel.name for one in read_by(signal("a"), signal("b"), wanted=["b", "c"])[1].readers]
    assert names == ["a", "b"]


def test_signals_that_come_and_go_count_where_they_are_read():
    a, b, c = signal("a"), signal("b"), signal("c")
    _, every = read_by(a, b)
    _, one = read_by(a, b, wanted=["b"])
    assert [every.are_in(device(*there)) for there in ((a, b), (b, a), (a,), (a, b, c))] == [True, True, False, False]
    assert [one.are_in(device(*there)) for there in ((a, b), (b,), (a,), (b, c))] == [True, True, False, True]


def test_names_that_two_signals_have_become_paths_and_paths_become_names():
    _, found = read_by(
        signal("AI", path="/dev/IO/1/AI"), signal("AI", path="/dev/IO/2/AI"), signal("#dev#IO#3#T"),
        signal("*dev*IO*4*U"), signal("P#1"), signal("time", counted="none"), signal("hidden", public=False),
    )  # fmt: skip
    assert [one.channel.name for one in found.readers] == ["/dev/IO/1/AI", "/dev/IO/2/AI", "T", "U", "P#1"]


def test_signals_that_are_not_described_yet_are_waited_for():
    late = signal("p")
    late.descriptor = None
    assert signals_of_device(Library(), device(late, signal("q")), ()) is None
    assert signals_of_device(Library(), device(), ()) is None


def test_channels_that_count_from_different_instants_are_not_one_stream():
    _, found = read_by(signal("a"), signal("b", None, domain(origin="2026-01-01T00:00:00Z")))
    with pytest.raises(ValueError, match="'a' and 'b' count from different instants"):
        found.described("")


def test_runs_are_cut_where_ticks_are_missing_and_tell_whether_the_grid_is_the_same():
    reader = only(signal("p"), p=[[0, 5, 10, 25, 30], [], [35, 42, 47], [30]])
    runs = [run for _ in range(4) for run in reader.read()]
    assert [(one.ticks.tolist(), one.is_apart, one.is_of_another_grid) for one in runs] == [
        ([0, 5, 10], False, False), ([25, 30], True, False), ([35], False, False), ([42, 47], True, True),
        ([30], True, True),
    ]  # fmt: skip
    assert all(one.values.tolist() == one.ticks.tolist() for one in runs)


def test_a_grid_that_is_forgotten_begins_anew():
    reader = only(signal("p"), p=[[0, 5], [12, 17, 23]])
    [*reader.read()]
    reader.forget_grid()
    first, second = reader.read()
    assert (first.is_apart, first.is_of_another_grid) == (False, False)
    assert (second.is_apart, second.is_of_another_grid) == (True, True)


def test_ticks_of_their_own_are_cut_where_they_run_backwards_alone():
    reader = only(signal("p", None, domain(rule="Explicit")), p=[[0, 1, 9, 4, 5]])
    assert reader.channel.step == 0
    assert [one.ticks.tolist() for one in reader.read()] == [[0, 1, 9], [4, 5]]


def test_an_event_in_between_says_what_follows():
    same, other = changed(value(), domain()), changed(None, domain(step=10))
    reader = only(signal("p"), p=[([], same), ([0, 5], GAP), ([20], other), [30, 40]])
    first, after_gap, new, last = reader.read()
    assert isinstance(first, Run)
    assert after_gap.ticks.tolist() == [20]
    assert isinstance(new, Changed)
    assert new.channel.step == reader.channel.step == 10
    assert (last.ticks.tolist(), last.is_apart) == ([30, 40], False)


@pytest.mark.parametrize(
    "given",
    [
        "fail",
        ([5], changed(value("Null"))),
        ([5], changed(value("Float32"))),
        ([5], changed(value(scaling=("Linear", "Int16", 2.0, 0.0)))),
        ([5], changed(value(dimensions=["bins"]))),
    ],
    ids=["fail", "null", "type", "scaling", "list"],
)
def test_what_cannot_be_read_on_is_connected_to_anew(given):
    reader = only(signal("p"), p=[given])
    with pytest.raises(SignalsChangedError):
        [*reader.read()]


@pytest.mark.parametrize(
    ("chosen", "locked", "says"),
    [(0, 1, "PtpSyncInterface"), (0, 0, "PtpSyncInterface, not locked"), (1, 1, "InterfaceClockSync"), (7, 1, "")],
)
def test_what_the_clock_follows_is_said_in_the_devices_words(chosen, locked, says):
    sync = SimpleNamespace(
        interfaces={"PtpSyncInterface": 1, "InterfaceClockSync": 2}, selected_source=chosen, sync_locked=locked
    )
    library = SimpleNamespace(ISyncComponent=SimpleNamespace(cast_from=lambda given: given))
    assert time_source(library, SimpleNamespace(sync_component=sync)) == says
    assert time_source(library, SimpleNamespace()) == ""
