from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.tdms.reader import TdmsReader
from tests.builders.container_files import ramp, small_tdms, tdms_file
from tests.builders.shared_data import shared_file

WAVE = {"wf_increment": 1e-3, "wf_start_offset": 0.25, "unit_string": "V"}


def opened(folder: Path, content: bytes) -> Recording:
    path = folder / "a.tdms"
    path.write_bytes(content)
    return TdmsReader().open(path, Declarations("dewetron"))


def test_waveform_properties_give_time_and_their_sample_count_is_not_used(tmp_path: Path) -> None:
    recording = opened(tmp_path, small_tdms())
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [("AI/acc", "m/s2", 20), ("AI/n", "", 20)]
    np.testing.assert_array_equal(recording.read("AI/acc"), np.concatenate((ramp(12), ramp(8))))
    assert recording.time_base("AI/acc").step_s == 5e-5
    start = recording.absolute_start
    assert start is not None
    assert start.text.startswith("2026-08-03T12:23:05.123456")
    assert start.zone == "UTC"


@settings(max_examples=15, deadline=None)
@given(sizes=st.lists(st.integers(1, 9), min_size=1, max_size=4), start=st.integers(0, 30), stop=st.integers(0, 40))
def test_segments_do_not_show(
    sizes: list[int], start: int, stop: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    values = ramp(sum(sizes))
    cuts = np.split(values, np.cumsum(sizes)[:-1])
    recording = opened(tmp_path_factory.mktemp("t"), tdms_file(*[[("g", "a", part, WAVE)] for part in cuts]))
    np.testing.assert_array_equal(recording.read("g/a", start, stop), values[start:stop])


def test_different_starts_become_offsets_to_the_earliest(tmp_path: Path) -> None:
    first = np.datetime64("2026-08-03T12:00:00", "us")
    later = WAVE | {"wf_start_time": first + np.timedelta64(1500, "us")}
    content = tdms_file([("g", "a", ramp(), later), ("g", "b", ramp(), WAVE | {"wf_start_time": first})])
    recording = opened(tmp_path, content)
    assert recording.time_base("g/a").start_s == pytest.approx(0.2515, abs=1e-9)
    assert recording.time_base("g/b").start_s == 0.25
    assert any("different absolute times" in note for note in recording.notes)


def test_a_channel_without_start_among_different_ones_is_left_out(tmp_path: Path) -> None:
    first = np.datetime64("2026-08-03T12:00:00", "us")
    starts = [WAVE | {"wf_start_time": first + np.timedelta64(n, "s")} for n in range(2)]
    content = tdms_file([("g", "a", ramp(), starts[0]), ("g", "b", ramp(), starts[1]), ("g", "c", ramp(), WAVE)])
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a", "g/b"]
    assert any(note.startswith("g/c: states no start") for note in recording.notes)


def test_a_time_channel_serves_its_group(tmp_path: Path) -> None:
    times = np.array([0.0, 0.1, 0.1, 0.5])
    content = tdms_file([("g", "Time", times, {"unit_string": "ms"}), ("g", "a", ramp(4), {}), ("h", "b", ramp(4), {})])
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a"]
    np.testing.assert_allclose(recording.time_base("g/a").times_s, [0.0, 1e-4, 5e-4])
    np.testing.assert_array_equal(recording.read("g/a"), ramp(4)[[0, 1, 3]])
    np.testing.assert_array_equal(recording.read("g/a", 1, 2), ramp(4)[[1]])
    assert any(note.startswith("h/b: no waveform properties") for note in recording.notes)


def test_time_stamps_texts_and_unknown_scalings_are_named_and_left_out(tmp_path: Path) -> None:
    stamps = np.array(["2026-08-03T12:00:00", "2026-08-03T12:00:01"], "datetime64[us]")
    scaled = WAVE | {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Secret"}
    content = tdms_file(
        [("g", "when", stamps, {}), ("g", "text", ["a", "b"], {}), ("g", "s", ramp(), scaled), ("g", "a", ramp(), WAVE)]
    )
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["g/a"]
    for name in ("g/when: time stamps", "g/text: texts", "g/s: its scaling 'Secret'"):
        assert any(note.startswith(name) for note in recording.notes)


def test_linear_scaling_is_applied_and_its_counts_are_kept(tmp_path: Path) -> None:
    scale: dict[str, Any] = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0,
    }
    from nptdms.types import Uint32

    scale["NI_Scale[0]_Linear_Input_Source"] = Uint32(0xFFFFFFFF)
    recording = opened(tmp_path, tdms_file([("g", "a", np.arange(5, dtype=np.int16), WAVE | scale)]))
    np.testing.assert_array_equal(recording.read("g/a"), 0.5 * np.arange(5) + 2.0)
    raw = recording.raw("g/a")
    assert raw is not None
    assert (raw.gain, raw.offset, raw.unit) == (0.5, 2.0, "V")


def test_a_number_of_scales_that_no_channel_has_is_not_counted_up_to(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="NI_Number_Of_Scales"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), WAVE | {"NI_Number_Of_Scales": 2**31 - 1})]))


def test_a_segment_that_was_never_closed_is_read_and_told(tmp_path: Path) -> None:
    content = bytearray(tdms_file([("g", "a", ramp(), WAVE)]))
    struct.pack_into("<Q", content, 12, 0xFFFFFFFFFFFFFFFF)
    recording = opened(tmp_path, bytes(content))
    assert "never closed" in recording.incomplete
    np.testing.assert_array_equal(recording.read("g/a"), ramp())


def test_an_index_file_is_refused_and_one_beside_the_file_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "a.tdms_index").write_bytes(b"garbage")
    assert opened(tmp_path, small_tdms()).signals
    with pytest.raises(ReadError, match=r"take the .tdms file"):
        opened(tmp_path, b"TDSh" + small_tdms()[4:])


def test_a_file_without_time_says_what_to_write(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="write the channels as waveforms"):
        opened(tmp_path, tdms_file([("g", "a", ramp(), {})]))


def test_a_foreign_segment_is_told_with_its_byte(tmp_path: Path) -> None:
    content = small_tdms()
    second = 28 + struct.unpack_from("<Q", content, 12)[0]
    with pytest.raises(CorruptFileError, match=f"byte {second}"):
        opened(tmp_path, content[:second] + b"XXXX" + content[second + 4 :])


@pytest.mark.parametrize(
    ("name", "counts", "step_s"),
    [
        ("Digital_Input.tdms", [20000, 400, 8], 5e-4),
        ("raw1.tdms", [2000] * 7, 1.9999999999999998e-05),
        ("raw_timestamps.tdms", [128], 1e-3),
    ],
)
def test_real_files_are_read_whole(name: str, counts: list[int], step_s: float) -> None:
    recording = TdmsReader().open(shared_file(f"containers/{name}"), Declarations("dewetron"))
    assert [s.sample_count for s in recording.signals] == counts
    first = recording.time_base(recording.signals[0].name)
    assert (first.step_s, first.start_s) == (step_s, 0.0)
    for signal in recording.signals:
        samples, raw = recording.read(signal.name), recording.raw(signal.name)
        assert np.isfinite(samples).all()
        assert recording.time_base(signal.name).start_s == 0.0
        if raw is not None:
            np.testing.assert_allclose(raw.gain * raw.counts + raw.offset, samples, rtol=1e-12)
    assert recording.notes == ()
