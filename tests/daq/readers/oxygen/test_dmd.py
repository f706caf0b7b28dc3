from __future__ import annotations

import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.oxygen.dmd import OxygenReader
from recoil_acquisition.readers.oxygen.samples import SampleLayout
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders.opened_files import open_bytes
from tests.builders.oxygen_dmd import Stored, block, oxygen_dmd, packed
from tests.builders.shared_data import shared_file

READER = OxygenReader()
PLAIN = "<Scaling/>"
RAMP = np.arange(100)
opened = partial(open_bytes, READER, "a.dmd")


def built(folder: Path, *channels: Stored, **options: object) -> Recording:
    usual = {"blocks": ((0, 40), (40, 40), (80, 20)), "windows": ((0, 100),)}
    return opened(folder, oxygen_dmd(channels, **{**usual, **options}))


def real(name: str) -> Recording:
    return READER.open(shared_file(f"dewetron/{name}"), Declarations("dewetron"))


def test_a_real_recording_of_ten_channels_has_the_counts_that_dewetron_states() -> None:
    recording = real("simple.dmd")
    assert [header.sample_count for header in recording.signals] == [6331] * 10
    assert recording.notes == ()
    assert recording.incomplete == ""
    total = recording.read("AI 1/I1 Sim") + recording.read("AI 1/I2 Sim")
    np.testing.assert_allclose(recording.read("sum I1 I2"), total, rtol=0, atol=1e-12)
    assert np.ptp(total) > 1


def test_a_second_start_of_the_acquisition_is_refused_and_the_same_one_again_is_not(tmp_path: Path) -> None:
    def setup(start: str) -> bytes:
        header = f'<Property name="AcquisitionStartTime"><DateTimeValue>{start}</DateTimeValue></Property>'
        text = f"<MeasurementConfig><MeasurementHeader>{header}</MeasurementHeader></MeasurementConfig>"
        return block(100, 9, text.encode())

    channel = Stored("a", RAMP.astype(float))
    again = built(tmp_path, channel, extra=setup("2026-08-05T10:21:17.978Z"))
    assert [signal.name for signal in again.signals] == ["a"]
    with pytest.raises(ReadError, match=r"a second recording begins at 2026-08-05T11:00:00\.000; expected one"):
        built(tmp_path, channel, extra=setup("2026-08-05T11:00:00.000Z"))


def test_a_real_recordings_first_sample_is_at_the_instant_that_dewetron_states() -> None:
    recording = real("simple.dmd")
    base = recording.time_base("AI 1/I1 Sim")
    start = base.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2021-08-05T10:21:17.978", "UTC")
    first = np.datetime64(start.text, "us") + np.timedelta64(round(base.start_s * 1e6), "us")
    assert str(first) == "2021-08-05T10:21:27.270800"
    assert base.step_s == 1e-4


def test_real_synchronous_and_asynchronous_channels_stand_side_by_side() -> None:
    recording = real("syncasync.dmd")
    assert {h.name: h.sample_count for h in recording.signals} == {"AI 1/I1 Sim": 29315, "AI 1/I1 Sim_AVG": 293}
    np.testing.assert_allclose(np.diff(recording.time_base("AI 1/I1 Sim_AVG").times_s), 0.01, rtol=1e-9)
    # each is the mean of the 100 samples around it, of a sine of 50 Hz: nothing is left of it
    assert np.abs(recording.read("AI 1/I1 Sim_AVG")).max() < 1e-12


def test_real_lz4_blocks_are_read() -> None:
    recording = real("oxy711.dmd")
    samples = recording.read("AI 1/1 Sim")
    assert samples.size == 11359
    assert 7.9 < np.abs(samples).max() < 8.0
    assert "CAN 0/1 Sim" in recording.metadata["not_stored"]


@pytest.mark.parametrize("compression", ["", "lz4"])
@pytest.mark.parametrize("is_packed", [False, True])
@pytest.mark.parametrize(
    ("sample_format", "extremes"),
    [
        ("sint24", (-(2**23), 2**23 - 1)),
        ("sint32", (-(2**31), 2**31 - 1)),
        ("uint32", (0, 2**32 - 1)),
        ("float", (-1.5e30, 2.0**-100)),
        ("double", (-1e300, 0.1)),
    ],
)
def test_every_sample_format_comes_back(
    sample_format: str, extremes: tuple[float, float], compression: str, is_packed: bool, tmp_path: Path
) -> None:
    stored = np.resize(np.array([*extremes, 0, 1, 77]), 100)
    if sample_format == "float":
        stored = stored.astype(np.float32)
    recording = built(
        tmp_path,
        Stored("before", RAMP, sample_format="sint24"),
        Stored("a", stored, "g", sample_format, PLAIN),
        Stored("loose", stored[:7], "g", sample_format, PLAIN, ticks=range(7)),
        compression=compression,
        is_packed=is_packed,
    )
    np.testing.assert_array_equal(recording.read("a"), stored.astype(float))
    np.testing.assert_array_equal(recording.read("loose"), stored[:7].astype(float))
    np.testing.assert_array_equal(recording.read("before"), RAMP * 0.5)
    raw = recording.raw("a")
    assert (raw is None) == (sample_format in ("float", "double"))
    if raw is not None:
        np.testing.assert_array_equal(raw.counts, stored.astype(np.int64))


def test_linear_scalings_are_applied_one_after_the_other(tmp_path: Path) -> None:
    chain = '<Scaling><Linear k="0.5" d="3"/><Linear k="-4" d="1"/></Scaling>'
    recording = built(tmp_path, Stored("a", RAMP, scaling=chain))
    np.testing.assert_array_equal(recording.read("a"), (RAMP * 0.5 + 3) * -4 + 1)
    raw = recording.raw("a")
    assert raw is not None
    assert (raw.gain, raw.offset, raw.unit) == (-2.0, -11.0, "V")


@pytest.mark.exhaustive
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cuts=st.lists(st.integers(0, 100), min_size=2, max_size=6, unique=True),
    lengths=st.lists(st.integers(1, 17), min_size=8, max_size=20),
    compression=st.sampled_from(["", "lz4"]),
    part=st.tuples(st.integers(0, 100), st.integers(0, 100)),
)
def test_what_was_stored_is_what_is_read_however_it_is_cut_into_blocks_and_windows(
    tmp_path: Path, cuts: list[int], lengths: list[int], compression: str, part: tuple[int, int]
) -> None:
    ends = np.minimum(np.cumsum(lengths), 100)
    blocks = [(int(a), int(b - a)) for a, b in zip([0, *ends], ends, strict=False) if b > a]
    edges = sorted(cuts)[: len(cuts) // 2 * 2]
    windows = list(zip(edges[::2], edges[1::2], strict=True))
    inside = np.concatenate([RAMP[a : min(b, ends[-1])] for a, b in windows])
    content = oxygen_dmd([Stored("a", RAMP)], windows=windows, blocks=blocks, per_block=17, compression=compression)
    if not inside.size:
        with pytest.raises(ReadError, match="no samples"):
            opened(tmp_path, content)
        return
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("a"), inside * 0.5)
    np.testing.assert_array_equal(recording.read("a", *part), inside[slice(*part)] * 0.5)
    np.testing.assert_allclose(recording.time_base("a").times_s, inside / 1000.0, rtol=1e-15, atol=1e-15)


def test_gaps_between_storing_windows_are_in_the_time_base_and_told(tmp_path: Path) -> None:
    recording = built(tmp_path, Stored("a", RAMP), windows=((10, 20), (50, 90)))
    base = recording.time_base("a")
    assert base.step_s is None
    assert base.times_s[9:11].tolist() == [0.019, 0.05]
    assert recording.notes == ("nothing was stored from 0.02 s to 0.05 s",)
    assert recording.metadata["storing_windows_s"] == [[0.01, 0.02], [0.05, 0.09]]


def test_a_block_that_is_missing_leaves_a_gap_and_is_told(tmp_path: Path) -> None:
    recording = built(tmp_path, Stored("a", RAMP), blocks=((0, 40), (80, 20)), windows=((0, 100),))
    assert recording.signals[0].sample_count == 60
    assert recording.time_base("a").times_s[39:41].tolist() == [0.039, 0.08]
    assert recording.notes == ("a: 40 samples of its storing windows are not in the file",)


def test_windows_of_the_statistics_do_not_cut_the_samples(tmp_path: Path) -> None:
    recording = built(tmp_path, Stored("a", RAMP), windows=((10, 20),), other_group=((0, 100),))
    assert recording.signals[0].sample_count == 10
    assert recording.notes == ("groups FAST, SLOW were stored at different times: the times of FAST hold",)


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    recording = built(tmp_path, Stored("XXX", RAMP), Stored("XXX", RAMP + 1))
    assert [header.name for header in recording.signals] == ["XXX", "XXX#2"]
    assert recording.read("XXX#2")[0] == 0.5
    assert "2 signals are named 'XXX'" in recording.notes[0]


def test_stamps_that_repeat_or_go_back_are_left_out_and_counted(tmp_path: Path) -> None:
    # blocks hold four: the last of a block and the first of the next are equal, too
    ticks = (1, 2, 2, 5, 5, 4, 8, 9, 9, 7)
    recording = built(tmp_path, Stored("a", np.arange(10.0), "V", "double", PLAIN, ticks=ticks))
    assert recording.time_base("a").times_s.tolist() == [0.001, 0.002, 0.005, 0.008, 0.009]
    assert recording.read("a").tolist() == [0, 2, 4, 6, 8]
    assert recording.read("a", 2, 4).tolist() == [4, 6]
    assert [note for note in recording.notes if note.startswith("a:")] == [
        "a: 3 of 10 samples share their stamp with a later one: the last is kept",
        "a: 2 of 10 samples are stamped out of order: left out",
    ]


@pytest.mark.parametrize(
    ("channel", "options", "reason"),
    [
        (Stored("x", RAMP, sample_format="can"), {}, "format 'can'"),
        (Stored("x", RAMP, dimension=2), {}, "2 numbers"),
        (Stored("x", RAMP, chain_step=1), {}, "step 1 of its chain"),
        (Stored("x", RAMP, scaling="<Scaling><Table/></Scaling>"), {}, "'Table', not linear"),
        (Stored("x", RAMP, scaling='<Scaling><Linear k="nan" d="0"/></Scaling>'), {}, "no number"),
        (Stored("x", RAMP, scaling="<Scaling>"), {}, "scaling is damaged"),
        (Stored("x", RAMP, scaling="<!DOCTYPE a><Scaling/>"), {}, "declares entities"),
        (
            Stored(
                "x",
                RAMP,
                properties='<Property name="Neon/PhysicalScaleFactor"><DoubleValue>3</DoubleValue></Property>',
            ),
            {},
            "own scaling (factor 3)",
        ),
    ],
)
def test_a_channel_that_is_not_covered_is_named_and_left_out(
    channel: Stored, options: dict[str, object], reason: str, tmp_path: Path
) -> None:
    recording = built(tmp_path, Stored("a", RAMP), channel, **options)
    assert [header.name for header in recording.signals] == ["a"]
    np.testing.assert_array_equal(recording.read("a"), RAMP * 0.5)
    assert len(recording.notes) == 1
    assert recording.notes[0].startswith("x: left out: ")
    assert reason in recording.notes[0]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"segment_frequency_hz": 500.0}, "its time base is 1000 Hz, that of its segment 500 Hz"),
        ({"compression": "zstd"}, "compressed by 'zstd'"),
        ({"blocks": ((0, 40), (30, 40))}, "its blocks overlap in time"),
    ],
)
def test_a_file_without_any_covered_channel_is_refused_with_the_reason(
    options: dict[str, object], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match=reason):
        built(tmp_path, Stored("a", RAMP), **options)


def test_a_scaling_of_the_users_own_that_shows_in_the_chain_is_applied(tmp_path: Path) -> None:
    channel = Stored(
        "a", RAMP, scaling='<Scaling><Linear k="0.5" d="0"/><Linear k="3" d="0"/></Scaling>',
        source_scaling='<Scaling><Linear k="0.5" d="0"/></Scaling>',
        properties='<Property name="Neon/PhysicalScaleFactor"><DoubleValue>3</DoubleValue></Property>',
    )  # fmt: skip
    np.testing.assert_array_equal(built(tmp_path, channel).read("a"), RAMP * 1.5)


def test_a_recording_that_was_not_finished_is_read_to_its_last_whole_block(tmp_path: Path) -> None:
    recording = built(tmp_path, Stored("a", RAMP), windows=((5, None),), is_finished=False)
    assert recording.read("a").tolist() == (RAMP[5:] * 0.5).tolist()
    assert "without its index" in recording.incomplete
    assert any("not complete" in note for note in recording.notes)
    assert any("the end of storing is not stated" in note for note in recording.notes)


def test_old_bytes_behind_the_index_are_not_read(tmp_path: Path) -> None:
    old = block(0, 2, b"\1" * 30)
    quiet = built(tmp_path, Stored("a", RAMP), stale=b"_value_pos_order" * 9)
    assert quiet.notes == ()
    assert quiet.incomplete == ""
    told = built(tmp_path, Stored("a", RAMP), stale=old)
    assert told.signals[0].sample_count == 100
    assert "blocks follow the index" in told.notes[0]


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (
            block(100, 9, b'<!DOCTYPE a [<!ENTITY b "c">]><MeasurementConfig>&b;</MeasurementConfig>'),
            "declares entities",
        ),
        (block(100, 9, b"\x99MZX\x7f\xff\xff\xff" + packed(b"a" * 99)[8:]), "more than"),
        (block(100, 9, b"\x99MZX\0\0\0\5" + packed(b"a" * 99999)[8:]), "promised"),
        (block(100, 9, b"<MeasurementConfig>"), "text is damaged"),
        (block(0, 2, b"", 0, b"\3" + b"\0" * 32), "not of the known layout"),
        (block(0, 2, b"\0" * 8, 0, b"\7" + b"\0" * 24 + b"\xff\xff\0\0\0\0\0\0"), "not as long as its head says"),
        (
            block(1, 2, b"", 0, b"\7" + b"\0" * 32) + block(1, 6, b"", 0, b"\7" + b"\0" * 32),
            "synchronous and asynchronous",
        ),
        (b"DMDH" + bytes(60), "head is damaged"),
    ],
)
def test_what_contradicts_the_format_is_refused_in_one_line(extra: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=message) as caught:
        built(tmp_path, Stored("a", RAMP), extra=extra, is_finished=False)
    assert "\n" not in str(caught.value)


def test_a_compressed_block_that_promises_too_much_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.dmd"
    content = bytearray(oxygen_dmd([Stored("a", RAMP)], blocks=((0, 100),), compression="lz4"))
    recording = opened(tmp_path, bytes(content))
    at = int(recording._channels["a"].samples.args[0].layout.blocks.offset[0])
    content[at : at + 4] = b"\0\0\0\3"
    path.write_bytes(content)
    with pytest.raises(CorruptFileError, match="promised"):
        recording.read("a")


def test_a_part_is_read_from_its_own_blocks_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = built(tmp_path, Stored("a", RAMP), compression="lz4")
    touched: list[int] = []
    payload = SampleLayout.payload
    monkeypatch.setattr(
        SampleLayout, "payload", lambda self, file, block: (touched.append(block), payload(self, file, block))[1]
    )
    recording.read("a", 45, 60)
    assert touched == [1]
    recording.time_base("a")
    assert touched == [1]


def test_opening_a_long_recording_takes_no_memory_for_its_samples(tmp_path: Path) -> None:
    blocks = [(i * 10_000, 10_000) for i in range(200)]
    content = oxygen_dmd([Stored("a", lambda low, high: np.arange(low, high), "V", "sint32")], blocks=blocks)
    path = tmp_path / "a.dmd"
    path.write_bytes(content)
    tracemalloc.start()
    recording = READER.open(path, Declarations("dewetron"))
    part = recording.read("a", 1_234_567, 1_234_569)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(content) > 8e6
    assert peak < 5e5
    assert part.tolist() == [1_234_567 * 0.5, 1_234_568 * 0.5]
