from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from recoil_acquisition.channel import Channel, RawCounts, Step
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.shot_name import shot_name_fault
from recoil_acquisition.measured import figures_of, measured, worded
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.acquisition import AcquiredEvent, AcquiredSource, Acquisition, TriggerDecision
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, InputFile, Shot
from recoil_acquisition.store import layout, read_shot, shot_file, shot_summary, write_shot
from recoil_acquisition.store.shot_file import first_difference, is_shot_file
from tests.builders.shots import CLOCK_FIT, make_acquisition, make_shot, recorder_channel

ENGINES = ("h5netcdf", "netcdf4")


@pytest.fixture(scope="module")
def once_written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("written") / "0007.h5"
    write_shot(make_shot(), path)
    return path


@pytest.fixture
def written(once_written: Path, tmp_path: Path) -> Path:
    """A shot file that a test may damage."""
    return Path(shutil.copy(once_written, tmp_path))


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def assert_same_shot(one: Shot, other: Shot) -> None:
    """Compare two shots value by value, without the code that the store verifies with."""
    for name in (
        "name",
        "rig_name",
        "rig_text",
        "reference_clock",
        "quality",
        "inputs",
        "started",
        "history",
        "started_source",
    ):
        assert getattr(one, name) == getattr(other, name), name
    assert one.databases == other.databases
    assert one.acquisition == other.acquisition
    assert list(one.clock_fits.items()) == list(other.clock_fits.items())
    assert repr(one.alignments) == repr(other.alignments)  # repr, because NaN does not equal itself
    assert list(one.channels) == list(other.channels)
    for a, b in zip(one.channels.values(), other.channels.values(), strict=True):
        for name in ("name", "quantity", "signal", "role", "u_rel", "resolution", "history"):
            assert getattr(a, name) == getattr(b, name), (a.name, name)
        assert a.samples.dtype == b.samples.dtype
        assert a.samples.tobytes() == b.samples.tobytes()
        s, t = a.time_base, b.time_base
        assert (s.clock, s.start_s, s.step_s, s.count) == (t.clock, t.start_s, t.step_s, t.count)
        assert s.absolute_start == t.absolute_start
        assert s.times_s.tobytes() == t.times_s.tobytes()
        assert (a.raw is None) == (b.raw is None)
        if a.raw is not None and b.raw is not None:
            assert (a.raw.gain, a.raw.offset, a.raw.unit) == (b.raw.gain, b.raw.offset, b.raw.unit)
            assert a.raw.counts.dtype == b.raw.counts.dtype
            assert a.raw.counts.tobytes() == b.raw.counts.tobytes()


# The round trip

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
names = st.one_of(texts, st.sampled_from(["time", "raw", "a/b", "..", "Time", "rig", "acc recoil", "ä"]))
shot_names = st.from_regex(r"[A-Za-z0-9_][\w+-]{0,11}", fullmatch=True).filter(lambda name: not shot_name_fault(name))
files = st.sampled_from(["", "0007.rdlog", "0007 IMU 2 ä.rdlog"])
finite = st.floats(-1e6, 1e6, allow_subnormal=False)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=6,
)
steps = st.builds(Step, texts, texts, st.dictionaries(texts, json_values, max_size=3))
histories = st.lists(steps, max_size=3).map(tuple)
starts = st.none() | st.builds(AbsoluteStart, texts, texts, texts)


@st.composite
def time_bases(draw: st.DrawFn) -> TimeBase:
    clock, start = draw(names), draw(starts)
    if draw(st.booleans()):
        return TimeBase.uniform(clock, draw(finite), draw(st.floats(1e-6, 10.0)), draw(st.integers(0, 40)), start)
    stamps = draw(st.lists(finite, max_size=40, unique=True))
    return TimeBase.stamped(clock, np.array(sorted(stamps), dtype=np.float64), start)


@st.composite
def channels(draw: st.DrawFn, name: str, time_base: TimeBase) -> Channel:
    dtype = draw(st.sampled_from([np.float64, np.float32]))
    raw = None
    if draw(st.booleans()):
        counts = draw(npst.arrays(draw(st.sampled_from([np.int16, np.int32, np.int64, np.uint8])), time_base.count))
        raw = RawCounts(counts, draw(finite), draw(finite), draw(texts))
    return Channel(
        name=name,
        quantity=draw(st.sampled_from(sorted(SI_UNITS))),
        samples=draw(npst.arrays(dtype, time_base.count)),
        time_base=time_base,
        signal=draw(texts),
        role=draw(st.sampled_from(["", "recoil_acceleration", "trigger"])),
        u_rel=draw(st.floats(0, 1)),
        resolution=draw(st.floats(0, 1)),
        raw=raw,
        history=draw(histories),
    )


numbers = st.integers(0, 2**60)
seconds = st.floats(-1e6, 1e6, allow_subnormal=False)
events = st.lists(st.builds(AcquiredEvent, seconds, texts, texts), max_size=2).map(tuple)
decisions = st.lists(st.builds(TriggerDecision, seconds, texts, texts, texts, st.none() | seconds), max_size=2)
acquired_sources = st.builds(
    AcquiredSource,
    *(texts, texts, files, numbers, numbers, st.none() | seconds, st.booleans(), seconds, numbers, numbers, numbers),
    *(st.none() | numbers, numbers, seconds, events),
)
acquisitions = st.builds(
    Acquisition,
    *(shot_names, texts, numbers, texts, seconds, seconds, seconds, seconds, decisions.map(tuple)),
    *(st.lists(acquired_sources, max_size=2).map(tuple), numbers, numbers, st.booleans()),
)


def fit(more: dict[str, Any]) -> dict[str, Any]:
    return {**more, **CLOCK_FIT}


@st.composite
def shots(draw: st.DrawFn) -> Shot:
    bases = draw(st.lists(time_bases(), min_size=1, max_size=3))
    own = draw(st.lists(names, max_size=5, unique=True))
    u = st.floats(0, 1) | st.just(float("inf")) | st.just(float("nan"))
    started = draw(texts)
    return Shot(
        name=draw(shot_names),
        rig_name=draw(texts),
        rig_text=draw(texts),
        reference_clock=draw(st.sampled_from(bases)).clock,
        channels={name: draw(channels(name, draw(st.sampled_from(bases)))) for name in own},
        alignments=tuple(
            draw(
                st.builds(
                    ClockAlignment,
                    st.just(clock),
                    finite,
                    u,
                    finite,
                    u,
                    st.sampled_from(["ok", "ambiguous", "failed"]),
                    texts,
                    st.lists(texts, max_size=2).map(tuple),
                    st.none() | st.dictionaries(texts, json_values, max_size=3),
                )
            )
            for clock in draw(st.lists(names, max_size=3, unique=True))
        ),
        quality=draw(
            st.lists(
                st.builds(
                    QualityCheck.named,
                    texts,
                    texts | st.sampled_from(Check),
                    st.sampled_from(["ok", "warn", "fail"]),
                    texts,
                ),
                max_size=3,
            ).map(tuple)
        ),
        inputs=draw(
            st.lists(st.builds(InputFile, texts, texts, st.integers(0, 2**40), texts, texts), max_size=3).map(tuple)
        ),
        started=started,
        started_source=draw(texts) if started else "",
        history=draw(histories),
        databases=draw(st.none() | st.dictionaries(texts, texts, max_size=2)),
        acquisition=draw(st.none() | acquisitions),
        clock_fits=draw(st.dictionaries(names, st.dictionaries(texts, json_values, max_size=3).map(fit), max_size=2)),
    )


@pytest.mark.exhaustive
@given(shot=shots())
@settings(max_examples=25, deadline=None)
def test_a_shot_comes_back_exactly_as_it_was_written(shot: Shot) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shot.h5"
        write_shot(shot, path)
        assert_same_shot(read_shot(path), shot)
        assert names_in(Path(folder)) == ["shot.h5"]
        json.dumps(shot_summary(path), allow_nan=False)


def test_every_part_of_a_full_shot_comes_back(written: Path) -> None:
    assert_same_shot(read_shot(written), make_shot())


def test_channels_of_one_time_base_share_it_after_reading(written: Path) -> None:
    shot = read_shot(written)
    assert shot.channels["p_breech"].time_base is shot.channels["acc_recoil"].time_base
    assert shot.channels["temperature"].time_base is not shot.channels["rate_tipping"].time_base


def test_channels_whose_time_bases_are_equal_stand_in_one_group(tmp_path: Path) -> None:
    bases = [TimeBase.uniform("daq", start_s, 1e-3, 5) for start_s in (0.0, 0.0, 1.0)]
    channels = {name: recorder_channel(name, "force", base) for name, base in zip("abc", bases, strict=True)}
    write_shot(Shot("1", "r", "", "daq", channels), tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        assert set(file["entry/daq"]) == {"time", "a", "b"}
        assert set(file["entry/daq_2"]) == {"time", "c"}


@pytest.mark.exhaustive
def test_the_same_shot_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "a.h5", tmp_path / "b.h5"
    write_shot(make_shot(), first)
    time.sleep(1.05 - time.time() % 1.0)  # HDF5 stamps objects with whole seconds unless told not to
    write_shot(make_shot(), second)
    assert first.read_bytes() == second.read_bytes()


def test_a_long_rig_file_and_a_long_history_fit(tmp_path: Path) -> None:
    shot = make_shot()
    long = replace(shot, rig_text="# " + "x" * 200_000, history=(Step("align", "0.1.0", {"trace": [0.5] * 40_000}),))
    write_shot(long, tmp_path / "long.h5")
    assert_same_shot(read_shot(tmp_path / "long.h5"), long)


def test_what_is_numbered_beyond_nine_comes_back_in_its_order(tmp_path: Path) -> None:
    steps = tuple(Step(f"step {k}", "0.1.0", {}) for k in range(12))
    databases = {f"{12 - k}.dbc": f"text {k}" for k in range(12)}
    shot = replace(make_shot(), history=steps, databases=databases)
    write_shot(shot, tmp_path / "s.h5")
    found = read_shot(tmp_path / "s.h5")
    assert found.history == steps
    assert list((found.databases or {}).items()) == list(databases.items())


def test_numpy_scalars_in_details_are_stored_as_json_numbers(tmp_path: Path) -> None:
    details = {"gain": np.float64(1.5), "lags": [np.int64(3)], "sure": np.bool_(True)}
    shot = replace(make_shot(), alignments=(ClockAlignment("can", 0, 0, 0, 0, "ok", "fixed", (), details),))
    write_shot(shot, tmp_path / "s.h5")
    assert read_shot(tmp_path / "s.h5").alignments[0].details == {"gain": 1.5, "lags": [3], "sure": True}


@pytest.mark.parametrize("of_before", [False, True])
def test_figures_of_checks_reasons_and_doubts_come_back_and_a_file_of_before_has_none(
    tmp_path: Path, of_before: bool
) -> None:
    text = worded("p 20 MPa reads ", measured(12.5, "MPa", ".3g"))
    shot = make_shot()
    doubted = replace(shot.alignments[0], status="ambiguous", reasons=("none", text))
    check, reason = QualityCheck("p", Check.BASELINE, "warn", text), Reason(ReasonCode.NOISE, "p", text)
    given = replace(shot, alignments=(doubted,), quality=(*shot.quality, check), against_mass=(reason,))
    path = tmp_path / "0007.h5"
    write_shot(given, path)
    if of_before:
        with h5py.File(path, "r+") as file:
            groups = ("quality", "against_mass", f"alignment/{doubted.clock}")
            for group in groups:
                del file["entry"][group]["figures"]
            del file.attrs["seal"]
    read = read_shot(path)
    told = (read.quality[-1].detail, read.against_mass[0], read.alignments[0].reasons[1])
    assert [figures_of(one) for one in told] == 3 * [() if of_before else text.figures]
    assert read.quality[-1].detail == text


def test_a_value_without_a_place_in_json_is_the_callers_mistake(tmp_path: Path) -> None:
    shot = replace(make_shot(), history=(Step("align", "0.1.0", {"file": Path("x")}),))
    with pytest.raises(TypeError, match="has no place in JSON"):
        write_shot(shot, tmp_path / "s.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_text_that_hdf5_cannot_hold_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="cannot store") as caught:
        write_shot(replace(make_shot(), rig_text="a\0b"), tmp_path / "s.h5")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_before_there_were_acquisitions_opens(tmp_path: Path) -> None:
    path = tmp_path / "old.h5"
    recorded = replace(make_shot(), acquisition=None, clock_fits={})
    write_shot(recorded, path)
    with h5py.File(path) as file:
        assert not {"acquisition", "clock_fits"} & set(file["entry"])
    assert_same_shot(read_shot(path), recorded)
    assert (shot_summary(path)["acquisition"], shot_summary(path)["clock_fits"]) == (None, {})


def test_the_ticks_of_an_instrument_that_counts_its_samples_come_back(tmp_path: Path) -> None:
    anchors = [{"tick": 70_000, "host_ns": 68_291_000_000_000, "u_ns": 900}]
    counted = replace(make_shot(), clock_fits={"daq": {"rate_hz": 5e4, TICK_ANCHORS: anchors}})
    write_shot(counted, tmp_path / "s.h5")
    assert_same_shot(read_shot(tmp_path / "s.h5"), counted)
    # what is no number is no anchor, and the file is refused when it is read back
    broken = replace(counted, clock_fits={"daq": {"rate_hz": 5e4, TICK_ANCHORS: [{**anchors[0], "u_ns": "900"}]}})
    with pytest.raises(StoreError, match="does not read back"):
        write_shot(broken, tmp_path / "t.h5")


DOUBT = Reason(ReasonCode.CLOCK, "imu", "clock imu: alignment ambiguous: two candidates; look at both records")


def sound_shot(*against: Reason) -> Shot:
    """A shot whose only doubt is its clock, and what speaks against its mass."""
    shot = make_shot()
    alignments = tuple(replace(a, status="ambiguous", reasons=("two candidates",)) for a in shot.alignments[:1])
    return replace(shot, quality=(QualityCheck("a", Check.HUM, "ok", ""),), alignments=alignments, against_mass=against)


@pytest.mark.parametrize(("against", "state"), [((), "usable"), ((DOUBT,), "record only")])
def test_the_state_of_the_verdict_and_its_reasons_come_back(
    tmp_path: Path, against: tuple[Reason, ...], state: str
) -> None:
    path, shot = tmp_path / "s.h5", sound_shot(*against)
    write_shot(shot, path)
    with h5py.File(path) as file:
        assert file["entry/quality"].attrs["state"] == state
    read, summary = read_shot(path), shot_summary(path)
    assert [one.to_json() for one in read.against_mass] == [one.to_json() for one in against]
    assert (read.state, summary["state"], summary["usable"]) == (state, state, state == "usable")
    assert list(read.reasons) == summary["reasons"] == [str(one) for one in against]
    assert first_difference(shot, replace(shot, against_mass=(DOUBT, DOUBT))) == "against_mass"


def test_a_file_of_before_there_were_three_states_says_what_its_clocks_say(tmp_path: Path) -> None:
    path = tmp_path / "old.h5"
    write_shot(sound_shot(DOUBT), path)
    with h5py.File(path, "a") as file:
        del file["entry/against_mass"]
        del file["entry/quality"].attrs["state"]
        del file.attrs["seal"]
    (doubt,) = read_shot(path).against_mass
    assert (doubt.code, doubt.about) == (ReasonCode.CLOCK, sound_shot().alignments[0].clock)
    assert shot_summary(path)["state"] == "record only"
    assert shot_summary(path)["reasons"] == [f"clock {doubt.about}: alignment ambiguous: two candidates"]


@pytest.mark.parametrize(("where", "value"), [("state", "usable"), ("code", "rumour")])
def test_a_state_that_its_checks_contradict_is_a_damaged_file(tmp_path: Path, where: str, value: str) -> None:
    path = tmp_path / "s.h5"
    write_shot(sound_shot(DOUBT), path)
    with h5py.File(path, "a") as file:
        if where == "state":
            file["entry/quality"].attrs["state"] = value
        else:
            file["entry/against_mass/code"][0] = value
    for read in (read_shot, shot_summary):
        with pytest.raises(StoreError, match="is damaged"):
            read(path)


@pytest.mark.parametrize("name", ["acquisition", "clock_fits", "against_mass"])
def test_a_file_of_before_may_have_a_clock_of_a_name_that_is_taken_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    base = TimeBase.uniform(name, 0.0, 1e-3, 5)
    old = Shot("1", "r", "", name, {"f": recorder_channel("f", "force", base)})
    with monkeypatch.context() as patch:
        patch.setattr(layout, "ENTRY_NAMES", layout.ENTRY_NAMES - {"acquisition", "clock_fits", "against_mass"})
        patch.setattr(layout, "_write_against_mass", lambda *_: None)
        write_shot(old, tmp_path / "old.h5")
    with h5py.File(tmp_path / "old.h5") as file:
        assert name in file["entry"]
    assert_same_shot(read_shot(tmp_path / "old.h5"), old)
    assert [c["name"] for c in shot_summary(tmp_path / "old.h5")["channels"]] == ["f"]
    new = replace(old, acquisition=make_acquisition(), clock_fits={name: CLOCK_FIT})
    write_shot(new, tmp_path / "new.h5")
    assert_same_shot(read_shot(tmp_path / "new.h5"), new)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"acquisition": None}, "acquisition"),
        ({"acquisition": make_acquisition(unseen_bytes=1)}, "acquisition"),
        ({"clock_fits": {"can": CLOCK_FIT}}, "clock_fits"),
        ({"clock_fits": {"imu": CLOCK_FIT, "can": CLOCK_FIT}}, "clock_fits"),
    ],
)
def test_shots_that_were_acquired_otherwise_differ(change: dict[str, Any], says: str) -> None:
    shot = replace(make_shot(), clock_fits={"can": CLOCK_FIT, "imu": CLOCK_FIT})
    assert first_difference(shot, shot) is None
    assert first_difference(shot, replace(shot, **change)) == says


def test_a_damaged_record_of_the_acquisition_is_a_damaged_file(written: Path) -> None:
    with h5py.File(written, "a") as file:
        note = file["entry/acquisition"]
        del note["data"]
        note.create_dataset("data", data='{"schema": "other"}', dtype=h5py.string_dtype())
    with pytest.raises(StoreError, match="is damaged: schema must be"):
        read_shot(written)


# What other readers see


@pytest.mark.exhaustive
@pytest.mark.parametrize("engine", ENGINES)
def test_xarray_opens_every_group_with_time_and_units(written: Path, engine: str) -> None:
    import xarray

    shot = make_shot()
    with xarray.open_datatree(written, engine=engine) as tree:
        tree.load()
        for clock, names in {"dewetron": ("p_breech", "acc_recoil"), "camera": ("x_recoil",)}.items():
            data = tree[f"/entry/{clock}"]
            for name in names:
                channel = shot.channels[name]
                assert data[name].attrs["units"] == channel.unit
                np.testing.assert_array_equal(data[name].values, channel.samples)
                np.testing.assert_array_equal(data[name].coords["time"].values, channel.time_base.times_s)
                assert data["time"].attrs["units"] == "s"
        raw = shot.channels["acc_recoil"].raw
        assert raw is not None
        np.testing.assert_array_equal(tree["/entry/raw/dewetron/acc_recoil"].values, raw.counts)
        assert tree["/entry/quality"].to_dataset()["verdict"].values.tolist() == ["ok", "warn", "fail"]


@pytest.mark.parametrize("engine", ENGINES)
def test_xarray_opens_one_time_base_as_a_dataset(written: Path, engine: str) -> None:
    import xarray

    with xarray.open_dataset(written, group="entry/can_2", engine=engine) as data:
        assert set(data.data_vars) == {"rate_tipping", "rate_carriage"}
        assert data["rate_tipping"].dims == ("time",)


def test_netcdf_c_opens_it(written: Path) -> None:
    import netCDF4

    with netCDF4.Dataset(written) as data:
        signal = data["/entry/dewetron/acc_recoil"]
        assert signal.dimensions == ("time",)
        assert signal.units == "m/s^2"
        np.testing.assert_array_equal(signal[:], make_shot().channels["acc_recoil"].samples)


def test_nexusformat_plots_the_recoil_acceleration_by_default(written: Path) -> None:
    from nexusformat.nexus import nxload  # type: ignore[import-untyped]  # it carries no types

    channel = make_shot().channels["acc_recoil"]
    plotted = nxload(str(written)).plottable_data
    assert plotted.nxpath == "/entry/dewetron"
    assert plotted.nxsignal.nxname == "acc_recoil"
    np.testing.assert_array_equal(plotted.nxsignal.nxdata, channel.samples)
    np.testing.assert_array_equal(plotted.nxaxes[0].nxdata, channel.time_base.times_s)


def test_without_a_recoil_acceleration_the_reference_clock_is_plotted(tmp_path: Path) -> None:
    shot = make_shot()
    others = {name: channel for name, channel in list(shot.channels.items())[::-1] if name != "acc_recoil"}
    write_shot(replace(shot, channels=others), tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["entry"].attrs["default"] == "dewetron"
        assert file["entry/dewetron"].attrs["signal"] == "p_breech"


def test_without_either_the_first_time_base_is_plotted_and_a_lone_channel_has_no_others_beside_it(
    tmp_path: Path,
) -> None:
    channels = {c: recorder_channel(c, "force", TimeBase.uniform(f"clock_{c}", 0.0, 1e-3, 5)) for c in "ab"}
    write_shot(Shot("1", "r", "", "elsewhere", channels), tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        entry = file["entry"]
        assert entry.attrs["default"] == "clock_a"
        assert entry["clock_a"].attrs["signal"] == "a"
        assert "auxiliary_signals" not in entry["clock_a"].attrs


@pytest.mark.exhaustive
def test_units_of_every_dataset_parse_with_pint(written: Path) -> None:
    registry: pint.UnitRegistry[Any] = pint.UnitRegistry()
    seen = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
            seen[name] = registry.parse_units(item.attrs["units"])

    with h5py.File(written) as file:
        file.visititems(visit)
    assert len(seen) > 20
    assert seen["entry/dewetron/acc_recoil"] == registry.Unit("m/s**2")
    assert seen["entry/dewetron/p_breech"] == registry.Unit("Pa")
    assert seen["entry/camera/time"] == registry.Unit("s")


def test_nothing_in_the_file_is_what_some_reader_cannot_read(written: Path) -> None:
    faults = []

    def visit(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            if key in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):  # the dimension scales' own
                continue
            dtype = np.asarray(value).dtype
            if dtype.kind not in "iufOU" or isinstance(value, h5py.Reference):
                faults.append(f"{name}@{key}: {dtype}")
        if isinstance(item, h5py.Dataset):
            if item.dtype.kind == "O" and h5py.check_string_dtype(item.dtype) is None:
                faults.append(f"{name}: {item.dtype}")
            if item.ndim and not item.is_scale and not len(item.dims[0]):
                faults.append(f"{name}: a dimension without a scale")
            if item.compression not in (None, "gzip"):
                faults.append(f"{name}: {item.compression}")
        elif any(isinstance(child, h5py.Dataset) and child.is_scale for child in item.values()) and any(
            isinstance(child, h5py.Group) for child in item.values()
        ):
            faults.append(f"{name}: a dimension above other groups")

    with h5py.File(written) as file:
        file.visititems(visit)
        assert file.attrs["complete"] == 1
        assert file["entry/dewetron/acc_recoil"].fletcher32
    assert faults == []


def test_names_that_readers_do_not_allow_are_replaced_and_the_true_ones_kept(tmp_path: Path) -> None:
    base = TimeBase.uniform("raw", 0.0, 1e-3, 5)
    names = ("time", "a/b", "a b", "Ä")
    shot = Shot("1", "r", "", "raw", {n: recorder_channel(n, "force", base, counts=True) for n in names})
    write_shot(shot, tmp_path / "s.h5")
    assert list(read_shot(tmp_path / "s.h5").channels) == list(names)
    with h5py.File(tmp_path / "s.h5") as file:
        assert set(file["entry/raw_2"]) == {"time", "time_2", "a_b", "a_b_2", "_"}


# The summary


def test_a_live_shot_whose_file_has_no_date_has_that_of_its_trigger(tmp_path: Path) -> None:
    shot = replace(make_shot(), started="", started_source="")
    write_shot(shot, tmp_path / "s.h5")
    summary = shot_summary(tmp_path / "s.h5")
    assert shot.acquisition is not None
    assert summary["started"] == shot.acquisition.trigger_utc
    assert summary["started_source"] == "host clock at the trigger"


def test_a_shot_of_no_known_date_has_none_in_its_file(tmp_path: Path) -> None:
    write_shot(replace(make_shot(), started="", started_source="", acquisition=None), tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        assert "start_time" not in file["entry"]
    assert shot_summary(tmp_path / "s.h5")["started"] is None


def test_the_summary_says_what_is_in_the_file_in_json_types(written: Path) -> None:
    shot = make_shot()
    summary = shot_summary(written)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert (summary["shot"], summary["rig"], summary["started"]) == ("0007", "bench", shot.started)
    assert summary["started_source"] == shot.started_source
    assert summary["usable"] is False
    assert summary["reasons"] == list(shot.reasons)
    assert [c["name"] for c in summary["channels"]] == list(shot.channels)
    camera = next(c for c in summary["channels"] if c["name"] == "x_recoil")
    assert camera == {
        "name": "x_recoil",
        "quantity": "displacement",
        "unit": "m",
        "role": "recoil_displacement",
        "clock": "camera",
        "signal": "muzzle/X",
        "count": 60,
        "lost": 1,
        "rate_hz": pytest.approx(5000.0),
        "start_s": 0.0,
        "end_s": 63 / 5000,
        "u_rel": 0.002,
    }
    assert [a["u_offset_s"] for a in summary["alignments"]] == [1.5e-5, 1e-4, None]
    assert summary["inputs"][1]["file"] == "Schuß 7.txt"
    assert summary["acquisition"] == json.loads(json.dumps(make_acquisition().to_json()))
    assert list(summary["clock_fits"]) == ["can", "imu"]
    assert summary["clock_fits"]["can"]["steps"][0]["step_s"] == 0.5


def test_the_summary_reads_no_samples(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = h5py.Dataset.__getitem__

    def refuse_signals(self: Any, *args: Any, **kwargs: Any) -> Any:
        assert "units" not in self.attrs or self.size < 10, self.name
        return read(self, *args, **kwargs)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", refuse_signals)
    assert shot_summary(written)["shot"] == "0007"


# Nothing is overwritten, nothing half-written


def test_an_existing_file_is_refused_and_left_alone(written: Path) -> None:
    before = written.read_bytes()
    with pytest.raises(StoreError, match=r"exists already.*--overwrite"):
        write_shot(replace(make_shot(), name="other"), written)
    assert written.read_bytes() == before
    assert names_in(written.parent) == [written.name]


@pytest.mark.skipif(os.name == "nt", reason="Windows lets only administrators make links")
def test_a_link_to_nowhere_is_a_name_that_is_taken(tmp_path: Path) -> None:
    (tmp_path / "s.h5").symlink_to(tmp_path / "nowhere")
    with pytest.raises(StoreError, match="exists already"):
        write_shot(make_shot(), tmp_path / "s.h5")
    assert names_in(tmp_path) == ["s.h5"]


def test_overwrite_replaces_the_file(written: Path) -> None:
    write_shot(replace(make_shot(), name="other"), written, overwrite=True)
    assert read_shot(written).name == "other"
    assert names_in(written.parent) == [written.name]


@pytest.mark.parametrize("hard_links", [True, False])
def test_a_file_that_appears_meanwhile_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hard_links: bool
) -> None:
    path = tmp_path / "s.h5"
    verify = shot_file._verify

    def verify_while_another_writes(*args: Any) -> None:
        verify(*args)
        path.write_text("someone else's")

    monkeypatch.setattr(shot_file, "_verify", verify_while_another_writes)
    if not hard_links:
        monkeypatch.setattr(Path, "hardlink_to", _refuse)
    with pytest.raises(StoreError, match="exists already"):
        write_shot(make_shot(), path)
    assert path.read_text() == "someone else's"
    assert names_in(tmp_path) == ["s.h5"]


def test_a_file_system_without_hard_links_will_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "hardlink_to", _refuse)
    write_shot(make_shot(), tmp_path / "s.h5")
    assert_same_shot(read_shot(tmp_path / "s.h5"), make_shot())
    assert names_in(tmp_path) == ["s.h5"]


def _refuse(*_args: Any, **_kwargs: Any) -> None:
    raise PermissionError(1, "Operation not permitted")


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("step", ["fsync", "rename"])
def test_a_failure_at_any_step_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, overwrite: bool
) -> None:
    if step == "fsync":
        monkeypatch.setattr(os, "fsync", _refuse)
    else:
        monkeypatch.setattr(Path, "replace", _refuse)
        monkeypatch.setattr(Path, "rename", _refuse)
        monkeypatch.setattr(Path, "hardlink_to", _refuse)
    with pytest.raises(StoreError, match="cannot be written: Operation not permitted") as caught:
        write_shot(make_shot(), tmp_path / "s.h5", overwrite=overwrite)
    assert isinstance(caught.value.__cause__, PermissionError)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_args: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(shot_file, "_verify", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_shot(make_shot(), tmp_path / "s.h5")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.exhaustive
def test_a_disk_that_changes_the_last_bit_of_a_sample_is_found_out_before_the_rename(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "s.h5"
    before = make_shot()
    write_shot(before, path)
    write = shot_file._write

    def write_badly(_image: bytes, target: Path) -> None:
        shot = make_shot()
        samples = shot.channels["p_breech"].samples.copy()
        samples[100] = np.nextafter(samples[100], np.inf)
        changed = replace(shot.channels["p_breech"], samples=samples)
        write(shot_file._image(replace(shot, channels={**shot.channels, "p_breech": changed}), target), target)

    monkeypatch.setattr(shot_file, "_write", write_badly)
    with pytest.raises(StoreError, match="samples of channel 'p_breech'"):
        write_shot(before, path, overwrite=True)
    assert_same_shot(read_shot(path), before)
    assert names_in(tmp_path) == ["s.h5"]


def test_a_disk_that_keeps_half_is_found_out_before_the_rename(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = shot_file._write
    monkeypatch.setattr(shot_file, "_write", lambda image, path: write(image[: len(image) // 2], path))
    with pytest.raises(StoreError, match="does not read back") as caught:
        write_shot(make_shot(), tmp_path / "s.h5")
    assert caught.value.path == tmp_path / "s.h5"
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
import sys
from pathlib import Path
from recoil_acquisition.errors import StoreError
from recoil_acquisition.store import write_shot
from tests.builders.shots import make_shot
path = Path(sys.argv[1])
{prepare}
try:
    write_shot(make_shot(), path)
except StoreError as error:
    print(error)
"""


def _run(prepare: str, path: Path) -> subprocess.CompletedProcess[str]:
    script = SCRIPT.format(prepare=textwrap.dedent(prepare))
    root = Path(__file__).resolve().parents[2]
    return subprocess.run(  # our own interpreter and our own script
        [sys.executable, "-c", script, str(path)], cwd=root, capture_output=True, text=True, check=False, timeout=60
    )


@pytest.mark.exhaustive
def test_a_killed_writer_leaves_no_file_of_the_final_name(tmp_path: Path) -> None:
    result = _run("import os\nos.fsync = lambda handle: os.kill(os.getpid(), 9)", tmp_path / "s.h5")
    assert result.returncode != 0
    assert not (tmp_path / "s.h5").exists()
    assert [re.sub(r"[0-9a-f]{8}", "*", p.name) for p in tmp_path.iterdir()] == [".s.h5.*.partial"]
    write_shot(make_shot(), tmp_path / "s.h5")


@pytest.mark.exhaustive
@pytest.mark.skipif(os.name == "nt", reason="a limit of the file size stands in for a full disk; Windows has none")
def test_a_full_disk_is_one_line_and_leaves_nothing_behind(tmp_path: Path) -> None:
    limit = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))"
    result = _run(limit, tmp_path / "s.h5")
    assert (result.returncode, result.stderr) == (0, "")
    assert re.fullmatch(rf"{re.escape(str(tmp_path / 's.h5'))}: cannot be written: File too large; .*\n", result.stdout)
    assert list(tmp_path.iterdir()) == []


def test_missing_folders_are_made(tmp_path: Path) -> None:
    write_shot(make_shot(), tmp_path / "a" / "b" / "s.h5")
    assert read_shot(tmp_path / "a" / "b" / "s.h5").name == "0007"


def test_nothing_is_written_where_the_program_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    write_shot(make_shot(), tmp_path / "s.h5")
    assert list(Path.cwd().iterdir()) == []
    assert sorted(names_in(tmp_path)) == ["here", "s.h5"]


def test_a_folder_below_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=r"cannot be written: .*; choose another folder"):
        write_shot(make_shot(), tmp_path / "file" / "s.h5")


def test_no_permission_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Path.open

    def deny(self: Path, *args: Any, **kwargs: Any) -> Any:
        if tmp_path not in self.parents:
            return opened(self, *args, **kwargs)
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", deny)
    with pytest.raises(StoreError, match=r"s\.h5: cannot be written: Permission denied; choose another folder"):
        write_shot(make_shot(), tmp_path / "s.h5")


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the system's administrator may write anywhere"
)
def test_a_folder_without_write_permission_is_one_line(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(StoreError, match="Permission denied"):
            write_shot(make_shot(), tmp_path / "s.h5")
    finally:
        tmp_path.chmod(0o700)


def test_a_folder_of_that_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="this is a folder"):
        write_shot(make_shot(), tmp_path, overwrite=True)


# What is not a shot file


def test_what_is_a_shot_file_is_told_by_its_schema_of_any_version_or_its_damage(written: Path, tmp_path: Path) -> None:
    assert is_shot_file(written)
    (tmp_path / "text.h5").write_text("recoil-daq/shot/1")
    assert not is_shot_file(tmp_path / "text.h5")
    assert not is_shot_file(tmp_path / "none.h5")
    for name, schema in (("later.h5", "recoil-daq/shot/9"), ("other.h5", "someone/else/1")):
        with h5py.File(tmp_path / name, "w") as file:
            file.attrs["schema"] = schema
    assert is_shot_file(tmp_path / "later.h5")
    assert not is_shot_file(tmp_path / "other.h5")
    (tmp_path / "cut.h5").write_bytes(written.read_bytes()[:1000])
    assert is_shot_file(tmp_path / "cut.h5")


def test_what_other_programs_are_told_of_the_tree(written: Path) -> None:
    with h5py.File(written) as file:
        assert file.attrs["default"] == "entry"
        assert file.attrs["creator"].startswith("recoil-daq ")
        entry = file["entry"]
        assert entry["title"].asstr()[()] == "shot 0007 on rig bench"
        recorder = entry["dewetron"]
        assert (list(recorder.attrs["axes"]), recorder.attrs["time_indices"]) == (["time"], 0)
        assert (recorder.attrs["signal"], list(recorder.attrs["auxiliary_signals"])) == ("acc_recoil", ["p_breech"])
        assert recorder["acc_recoil"].attrs["long_name"] == "acc_recoil: recoil acceleration"
        assert entry["can/temperature"].attrs["long_name"] == "temperature: temperature"
        assert entry["history/step_1/program"].asstr()[()] == "recoil-daq"
        assert entry["alignment/camera/drift"].attrs["units"] == "1"
        assert entry["rig/databases/database_1/type"].asstr()[()] == "text/plain"
        assert entry["acquisition/type"].asstr()[()] == "application/json"


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no such file; expected a shot file"):
        read_shot(tmp_path / "none.h5")


@pytest.mark.parametrize("content", [b"", b"time;acc\n0;1\n", b"\x89PNG\r\n\x1a\n"])
def test_a_file_that_is_not_hdf5_is_named_as_such(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.h5").write_bytes(content)
    for read in (read_shot, shot_summary):
        with pytest.raises(StoreError, match=r"not an HDF5 file; expected a shot file.*found") as caught:
            read(tmp_path / "x.h5")
        assert caught.value.path == tmp_path / "x.h5"


@pytest.mark.parametrize(
    ("schema", "found"), [(None, "HDF5 of something else"), ("recoil-daq/shot/9", "schema 'recoil-daq/shot/9'")]
)
def test_hdf5_of_something_else_is_named_as_such(tmp_path: Path, schema: str | None, found: str) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["data"] = np.arange(3)
        if schema is not None:
            file.attrs["schema"] = schema
    with pytest.raises(StoreError, match="not a shot file of this version") as caught:
        read_shot(tmp_path / "x.h5")
    assert caught.value.found == found


def test_a_file_without_its_completion_mark_is_refused(written: Path) -> None:
    with h5py.File(written, "r+") as file:
        del file.attrs["complete"]
    with pytest.raises(StoreError, match="never completed"):
        read_shot(written)


@pytest.mark.exhaustive
def test_a_file_cut_anywhere_is_refused_and_never_a_foreign_error(written: Path, tmp_path: Path) -> None:
    whole = written.read_bytes()
    cut = tmp_path / "cut.h5"
    for size in [*range(0, 4096, 97), *range(4096, len(whole), 1733), len(whole) - 1]:
        cut.write_bytes(whole[:size])
        with pytest.raises(StoreError):
            read_shot(cut)


@pytest.mark.parametrize(
    "path", ["entry/rig/text", "entry/dewetron/time", "entry/quality/detail", "entry/history/step_1/what", "entry/raw"]
)
def test_a_missing_part_is_damage(written: Path, path: str) -> None:
    with h5py.File(written, "r+") as file:
        del file[path]
    with pytest.raises(StoreError, match=r"is damaged: .*; restore it from a copy") as caught:
        read_shot(written)
    assert "\n" not in str(caught.value)


def test_a_flipped_bit_in_the_samples_is_damage(written: Path) -> None:
    with h5py.File(written) as file:
        chunk = file["entry/dewetron/acc_recoil"].id.get_chunk_info(0)
    content = bytearray(written.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0x10
    written.write_bytes(content)
    with pytest.raises(StoreError, match="is damaged"):
        read_shot(written)


@pytest.mark.parametrize("count", [10, pytest.param(120, marks=pytest.mark.exhaustive)])
def test_one_flipped_bit_anywhere_is_damage_or_changes_nothing(written: Path, tmp_path: Path, count: int) -> None:
    given, summary, content = read_shot(written), shot_summary(written), np.fromfile(written, dtype=np.uint8)
    rng, path, refused = np.random.default_rng(count), tmp_path / "flipped.h5", 0
    for at in rng.choice(np.flatnonzero(content), count, replace=False):
        flipped = content.copy()
        flipped[at] ^= 1 << rng.integers(8)
        flipped.tofile(path)
        try:
            assert first_difference(given, read_shot(path)) is None
        except StoreError:
            refused += 1
        with suppress(StoreError):
            assert shot_summary(path) == summary
    assert refused > count // 2


def test_a_data_set_that_lacks_some_of_its_samples_is_damage(written: Path) -> None:
    with h5py.File(written, "r+") as file:
        del file["entry/dewetron/acc_recoil"]
        file["entry/dewetron"].create_dataset("acc_recoil", (100_000,), "f8", chunks=(1000,))
    with pytest.raises(StoreError, match="acc_recoil lacks some of its samples"):
        read_shot(written)


@pytest.mark.parametrize("read", [read_shot, shot_summary])
def test_samples_and_what_stands_beside_them_are_under_the_seal(written: Path, read: Callable[[Path], object]) -> None:
    with h5py.File(written, "r+") as file:
        file["entry/dewetron/acc_recoil"][3] += 1.0
    if read is read_shot:
        with pytest.raises(StoreError, match="acc_recoil does not hold what was written"):
            read(written)
    with h5py.File(written, "r+") as file:
        file["entry/dewetron/acc_recoil"].attrs["u_rel"] = 0.5
    with pytest.raises(StoreError, match="is damaged"):
        read(written)


def test_a_file_of_before_there_were_seals_is_read(written: Path) -> None:
    given = read_shot(written)
    with h5py.File(written, "r+") as file:
        del file.attrs["seal"]
        for name in ("acc_recoil", "time"):
            del file[f"entry/dewetron/{name}"].attrs["sha256"]
    assert first_difference(given, read_shot(written)) is None


def test_a_time_that_contradicts_its_step_is_damage(written: Path) -> None:
    with h5py.File(written, "r+") as file:
        file["entry/dewetron/time"].attrs["step_s"] = 6e-5
    with pytest.raises(StoreError, match="start_s"):
        read_shot(written)


EVIL_NAMES = ["../../x", "/x", "a\\b", "x\ny", "\x1b[31mx", "x\u202egnp", "", ".", "CON", "-rf", "x" * 300]


@pytest.mark.parametrize("name", EVIL_NAMES)
def test_a_name_that_is_no_safe_file_name_is_refused_with_one_line(written: Path, name: str) -> None:
    with h5py.File(written, "r+") as file:
        file["entry/entry_identifier"][()] = name
    for read in (read_shot, shot_summary):
        with pytest.raises(StoreError, match="the shot's name") as caught:
            read(written)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [{"shot": "../../x"}, {"sources": 0}])
def test_a_record_of_the_acquisition_with_a_path_in_it_is_refused(written: Path, change: dict[str, Any]) -> None:
    with h5py.File(written, "r+") as file:
        record = json.loads(file["entry/acquisition/data"].asstr()[()])
        if "sources" in change:
            record["sources"][0]["file"] = "../../x.rdlog"
        else:
            record |= change
        file["entry/acquisition/data"][()] = json.dumps(record)
    with pytest.raises(StoreError, match=r"'../../x.*'"):
        read_shot(written)


# The comparison that the verification rests on


def _changed(shot: Shot) -> list[tuple[str, Shot]]:
    channel = shot.channels["acc_recoil"]
    raw = channel.raw
    assert raw is not None
    negated = channel.samples.copy()
    negated[3] = -0.0 if negated[3] == 0 else np.nan
    start = replace(channel.time_base, absolute_start=None)

    def with_channel(**changes: Any) -> Shot:
        return replace(shot, channels={**shot.channels, "acc_recoil": replace(channel, **changes)})

    return [
        ("name", replace(shot, name="x")),
        ("rig_text", replace(shot, rig_text="x")),
        ("rig_name", replace(shot, rig_name="x")),
        ("reference_clock", replace(shot, reference_clock="camera")),
        ("databases", replace(shot, databases={**(shot.databases or {}), "rig.dbc": "x"})),
        ("history", replace(shot, history=(replace(shot.history[0], parameters={}), *shot.history[1:]))),
        ("alignments", replace(shot, alignments=(replace(shot.alignments[0], offset_s=0.0), *shot.alignments[1:]))),
        ("alignments", replace(shot, alignments=(replace(shot.alignments[0], status="ok"), *shot.alignments[1:]))),
        ("quality", replace(shot, quality=shot.quality[:1])),
        ("inputs", replace(shot, inputs=())),
        ("started", replace(shot, started="")),
        ("started_source", replace(shot, started_source="another clock")),
        ("databases", replace(shot, databases=None)),
        ("history", replace(shot, history=shot.history[:1])),
        ("alignments", replace(shot, alignments=(replace(shot.alignments[0], details=None), *shot.alignments[1:]))),
        ("names of the channels", replace(shot, channels=dict(list(shot.channels.items())[::-1]))),
        ("samples of channel 'acc_recoil'", with_channel(samples=negated)),
        ("samples of channel 'acc_recoil'", with_channel(samples=channel.samples.astype(np.float32))),
        ("time base of channel 'acc_recoil'", with_channel(time_base=start)),
        ("raw counts of channel 'acc_recoil'", with_channel(raw=None)),
        ("raw counts of channel 'acc_recoil'", with_channel(raw=replace(raw, gain=2 * raw.gain))),
        ("raw counts of channel 'acc_recoil'", with_channel(raw=replace(raw, counts=raw.counts + 1))),
        ("raw counts of channel 'acc_recoil'", with_channel(raw=replace(raw, offset=raw.offset + 1))),
        ("raw counts of channel 'acc_recoil'", with_channel(raw=replace(raw, unit="mV"))),
        ("u_rel of channel 'acc_recoil'", with_channel(u_rel=0.1)),
        ("signal of channel 'acc_recoil'", with_channel(signal="x")),
        ("resolution of channel 'acc_recoil'", with_channel(resolution=1.0)),
        ("history of channel 'acc_recoil'", with_channel(history=())),
    ]


@pytest.mark.parametrize("i", range(28))
def test_the_verification_sees_a_change_of_any_value(i: int) -> None:
    what, changed = _changed(make_shot())[i]
    assert first_difference(make_shot(), changed) == what
    assert first_difference(changed, make_shot()) == what
    assert first_difference(make_shot(), make_shot()) is None


def test_positive_and_negative_zero_are_different_samples() -> None:
    base = TimeBase.uniform("c", 0.0, 1.0, 2)
    one, other = (Shot("1", "r", "", "c", {"a": Channel("a", "force", np.array([z, 1.0]), base)}) for z in (0.0, -0.0))
    assert first_difference(one, other) == "samples of channel 'a'"


@pytest.mark.exhaustive
def test_a_shot_of_eight_channels_and_a_camera_is_written_well_within_a_second(tmp_path: Path) -> None:
    shot = make_shot(21_000, 2_000)
    base = shot.channels["acc_recoil"].time_base
    more = {f"c{i}": recorder_channel(f"c{i}", "pressure", base, seed=i) for i in range(6)}
    full = replace(shot, channels={**shot.channels, **more})
    begin = time.perf_counter()
    write_shot(full, tmp_path / "s.h5")
    elapsed = time.perf_counter() - begin
    assert elapsed < 2.0  # measured 0.2 s; four times the 0.5 s that a user may wait, for a busy machine
    assert (tmp_path / "s.h5").stat().st_size < 3e6
