from __future__ import annotations

import contextlib
import struct
import sys
import zlib
from datetime import datetime, timedelta, timezone
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError, iter_groups
from recoil_acquisition.readers.mdf.file_header import is_bus_logging
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from tests.builders.container_files import mdf_file, ramp, small_mdf
from tests.builders.mdf_logs import Blocks, identification_block, measured_file
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

TIMES = np.arange(12) / 1000.0


def signal(name: str, samples: Any, times: Any = TIMES, **options: Any) -> Any:
    from asammdf import Signal

    return Signal(np.asarray(samples), np.asarray(times), name=name, **options)


def frames(count: int = 4) -> Any:
    """Frames of a bus, as ASAM's bus logging names them."""
    kinds = np.dtype([("CAN_DataFrame.BusChannel", "u1"), ("CAN_DataFrame.ID", "u4"), ("CAN_DataFrame.DLC", "u1")])
    return signal("CAN_DataFrame", np.zeros(count, kinds), np.arange(count) / 10)


opened = partial(open_bytes, MdfReader(), "a.mf4")


def claimed_by(content: bytes) -> list[str]:
    return [reader.name for reader in surest_claim(Head(content))[1]]


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_each_group_has_its_own_time_base(compression: int, tmp_path: Path) -> None:
    slow = signal("temperature", [20.0, 21.0, 22.0], [0.0, 0.1, 0.3], unit="C", comment="oil")
    content = mdf_file([signal("acc", ramp(), unit="m/s2"), signal("p", ramp() * 2)], [slow], compression=compression)
    recording = opened(tmp_path, content)
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [
        ("acc", "m/s2", 12),
        ("p", "", 12),
        ("temperature", "C", 3),
    ]
    assert recording.time_base("acc").step_s == 0.001
    np.testing.assert_array_equal(recording.time_base("temperature").times_s, [0.0, 0.1, 0.3])
    np.testing.assert_array_equal(recording.read("p", 2, 5), ramp()[2:5] * 2)
    assert recording.signals[2].metadata["comment"] == "oil"


def test_linear_conversions_are_applied_and_counts_are_kept(tmp_path: Path) -> None:
    acc = signal("acc", np.arange(12, dtype=np.int16), unit="g", conversion={"a": 0.5, "b": 1.0})
    recording = opened(tmp_path, mdf_file([acc]))
    np.testing.assert_array_equal(recording.read("acc"), 0.5 * np.arange(12) + 1.0)
    raw = recording.raw("acc")
    assert raw is not None
    assert (raw.gain, raw.offset, raw.unit) == (0.5, 1.0, "g")


def test_invalid_samples_are_lost(tmp_path: Path) -> None:
    invalid = np.arange(12) == 3
    recording = opened(tmp_path, mdf_file([signal("n", np.arange(12, dtype=np.int16), invalidation_bits=invalid)]))
    expected = np.where(invalid, np.nan, np.arange(12))
    np.testing.assert_array_equal(recording.read("n"), expected)
    np.testing.assert_array_equal(recording.read("n", 3, 5), expected[3:5])
    assert recording.raw("n") is None


def test_texts_enumerations_and_formulas_are_named_and_left_out(tmp_path: Path) -> None:
    counts = np.arange(12, dtype=np.uint8)
    states = {"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"}
    content = mdf_file(
        [
            signal("a", ramp()),
            signal("word", np.array([b"x"] * 12), encoding="utf-8"),
            signal("state", counts, conversion=states),
            signal("formula", counts, conversion={"formula": "X1*2"}),
            signal("matrix", np.zeros(12, np.dtype([("matrix", "f8", (3,))]))),
        ]
    )
    recording = opened(tmp_path, content)
    assert "a" in {s.name for s in recording.signals}
    assert not {"word", "state", "formula", "matrix"} & {s.name for s in recording.signals}
    for text in ("word of group 0: text", "state of group 0: an enumeration", "formula of group 0: a formula"):
        assert any(note.startswith(text) for note in recording.notes)
    assert any(note.startswith("matrix") for note in recording.notes)


@pytest.mark.parametrize(
    ("started", "text", "zone"),
    [
        (datetime(2026, 8, 3, 14, 23, 5, tzinfo=timezone(timedelta(hours=2))), "2026-08-03T12:23:05", "UTC"),
        (datetime(2026, 8, 3, 14, 23, 5), "2026-08-03T14:23:05", "unknown"),  # local, no zone
    ],
)
def test_the_start_has_a_zone_only_if_the_file_says_so(started: datetime, text: str, zone: str, tmp_path: Path) -> None:
    start = opened(tmp_path, mdf_file([signal("a", ramp())], started=started)).absolute_start
    assert start is not None
    assert start.text == f"{text}.000000000"
    assert start.zone == zone


def test_equal_names_in_several_groups_are_told_apart(tmp_path: Path) -> None:
    recording = opened(tmp_path, mdf_file([signal("a", ramp())], [signal("a", ramp(5), TIMES[:5])]))
    assert [(s.name, s.sample_count) for s in recording.signals] == [("a", 12), ("a#2", 5)]
    np.testing.assert_array_equal(recording.read("a#2"), ramp(5))


def test_times_that_repeat_are_left_out_and_times_that_step_back_are_refused(tmp_path: Path) -> None:
    recording = opened(tmp_path, mdf_file([signal("a", ramp(4), [0.0, 0.1, 0.1, 0.4])]))
    np.testing.assert_array_equal(recording.read("a"), ramp(4)[[0, 1, 3]])
    assert any("1 of 4 stamps repeat" in note for note in recording.notes)
    with pytest.raises(ReadError, match="time steps back"):
        opened(tmp_path, mdf_file([signal("a", ramp(3), [0.0, 0.5, 0.4])]))


def test_a_file_of_bus_frames_alone_is_not_claimed_and_refused(tmp_path: Path) -> None:
    content = mdf_file([frames()])
    assert is_bus_logging(content)
    assert claimed_by(content) == ["MDF4 bus logging"]
    with pytest.raises(ReadError, match="source as kind `can`"):
        opened(tmp_path, content)


def test_channels_beside_bus_frames_are_read_and_the_frames_named(tmp_path: Path) -> None:
    content = mdf_file([frames()], [signal("a", ramp())])
    assert not is_bus_logging(content)
    assert claimed_by(content) == ["MDF 4"]
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["a"]
    assert any(note.startswith("frames of a bus") for note in recording.notes)


def test_samples_beyond_the_end_of_the_file_are_refused(tmp_path: Path) -> None:
    content = bytearray(small_mdf())
    at = content.index(b"##CG")
    links = struct.unpack_from("<Q", content, at + 16)[0]
    struct.pack_into("<Q", content, at + 24 + 8 * links + 8, 2**40)
    with pytest.raises(CorruptFileError, match="samples are missing"):
        opened(tmp_path, bytes(content))


def last_channel(content: bytes) -> int:
    """Where the fields of the channel `p`, the last one, begin: it has a bit per sample that says it is invalid."""
    at = content.rindex(b"##CN")
    return at + 24 + 8 * int(struct.unpack_from("<Q", content, at + 16)[0])


def test_an_invalidation_bit_beyond_the_record_leaves_its_channel_out(tmp_path: Path) -> None:
    content = bytearray(small_mdf())
    struct.pack_into("<I", content, last_channel(content) + 16, 2**24)
    recording = opened(tmp_path, bytes(content))
    assert [s.name for s in recording.signals] == ["acc"]
    assert any("p of group 0: damaged: invalidation bit 16777216" in note for note in recording.notes)


def test_groups_of_a_bus_that_cannot_be_are_refused(tmp_path: Path) -> None:
    content = bytearray(mdf_file([frames()], [signal("a", ramp())]))
    at = content.index(b"##CG")
    links = struct.unpack_from("<Q", content, at + 16)[0]
    struct.pack_into("<Q", content, at + 24 + 8 * links + 8, 2**40)
    with pytest.raises(CorruptFileError, match="more than the file can hold"):
        opened(tmp_path, bytes(content))


def test_a_chain_that_comes_back_to_itself_is_refused(tmp_path: Path) -> None:
    content = bytearray(small_mdf())
    for name in (b"##CG", b"##DG", b"##CN"):
        looped = bytearray(content)
        at = looped.index(name)
        struct.pack_into("<Q", looped, at + 24, at)
        with pytest.raises(MdfDamageError, match=r"leads back|leads nowhere"):
            list(iter_groups(bytes(looped)))
        with pytest.raises(CorruptFileError, match="do not hang together"):
            opened(tmp_path, bytes(looped))


def test_a_real_file_of_every_conversion_is_read_as_asammdf_reads_it() -> None:
    from asammdf import MDF

    path = shared_file("containers/test_metadata.mf4")
    recording = MdfReader().open(path, Declarations("dewetron"))
    assert [s.sample_count for s in recording.signals] == [2] * 20
    assert sum("an enumeration" in note for note in recording.notes) == 4
    with MDF(path) as mdf:
        for header in recording.signals:
            expected = mdf.get(header.name, group=header.metadata["group"])
            np.testing.assert_array_equal(recording.read(header.name), expected.samples)
            np.testing.assert_allclose(recording.time_base(header.name).times_s, expected.timestamps)
            assert header.unit == expected.unit


def test_a_real_bus_log_is_left_to_the_readers_of_buses() -> None:
    head = shared_file("can/00000170.MF4").read_bytes()[:HEAD_BYTES]
    assert is_bus_logging(head)
    assert claimed_by(head) == ["MDF4 bus logging"]


def test_a_recording_that_was_never_finalised_is_refused(tmp_path: Path) -> None:
    content = b"UnFinMF " + small_mdf()[8:]
    assert claimed_by(content) == ["MDF 4"]
    with pytest.raises(ReadError, match="never finalised"):
        opened(tmp_path, content)


def ticks(step: int, count: int = 40, missing: int = 0) -> list[tuple[float, float]]:
    """Stamps a step apart with samples that count them, one of them missing."""
    return [(i * step, float(i)) for i in range(1, count) if i != missing]


@pytest.mark.parametrize("master", [(4, 64, 1e-3), (4, 32, 1e-3), (0, 32, 1e-3), (1, 32, 1e-3)])
def test_channels_whose_records_are_stored_together_are_told_apart(
    master: tuple[int, int, float], tmp_path: Path
) -> None:
    groups = [("p", "MPa", ticks(2)), ("acc", "m/s2", ticks(1, 60)), ("slow", "", ticks(7, 12, missing=5))]
    recording = opened(tmp_path, measured_file(groups, master=master))
    assert {s.name: (s.unit, s.sample_count) for s in recording.signals} == {
        "p": ("MPa", 39), "acc": ("m/s2", 59), "slow": ("", 10),
    }  # fmt: skip
    for name, _, rows in groups:
        np.testing.assert_array_equal(recording.read(name), [sample for _, sample in rows])
        np.testing.assert_allclose(recording.time_base(name).times_s, [t * 1e-3 for t, _ in rows], rtol=1e-7)
    assert recording.time_base("acc").step_s == pytest.approx(1e-3)
    assert recording.time_base("slow").step_s is None


def test_counts_of_samples_as_times_keep_their_start_and_the_gap_of_a_missing_sample(tmp_path: Path) -> None:
    whole = opened(tmp_path, measured_file([("a", "V", ticks(1))], master=(0, 32, 0.0031))).time_base("a")
    assert (whole.start_s, whole.step_s) == (pytest.approx(0.0031), pytest.approx(0.0031))
    gap = opened(tmp_path, measured_file([("a", "V", ticks(1, missing=9))], master=(0, 32, 0.0031))).time_base("a")
    assert gap.step_s is None
    np.testing.assert_allclose(gap.times_s, [0.0031 * i for i in range(1, 40) if i != 9])


def test_a_clock_whose_ticks_do_not_divide_the_rate_is_even_and_a_missing_sample_is_a_gap(tmp_path: Path) -> None:
    third = [(round(i * 1000 / 3), float(i)) for i in range(90)]
    even = opened(tmp_path, measured_file([("a", "V", third)], master=(0, 32, 1e-6))).time_base("a")
    assert even.step_s == pytest.approx(1 / 3000, rel=1e-5)
    uneven = opened(tmp_path, measured_file([("a", "V", third[:40] + third[41:])], master=(0, 32, 1e-6)))
    assert uneven.time_base("a").step_s is None


def test_a_real_file_whose_master_counts_starts_where_it_says() -> None:
    recording = MdfReader().open(shared_file("containers/integer_master.mf4"), Declarations("dewetron"))
    base = recording.time_base("Value")
    assert (base.count, base.start_s, base.end_s) == (100_000, pytest.approx(0.0031), pytest.approx(310.0))


NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False)


@st.composite
def conversions(draw: st.DrawFn) -> dict[str, Any]:
    kind = draw(st.sampled_from(["linear", "rational", "interpolated", "nearest"]))
    if kind == "linear":
        return {"a": draw(NUMBERS), "b": draw(NUMBERS)}
    if kind == "rational":
        return {f"P{i}": float(draw(st.integers(-5, 5))) for i in range(1, 6)} | {"P6": 1.5}
    keys = sorted(draw(st.sets(st.integers(-40, 240), min_size=2, max_size=6)))
    raw = {f"raw_{i}": float(key) for i, key in enumerate(keys)}
    return {**raw, **{f"phys_{i}": draw(NUMBERS) for i in range(len(keys))}, "interpolation": kind == "interpolated"}


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(conversion=conversions(), kind=st.sampled_from(["u1", "i2", "u4", "i8", "f8"]), seed=st.integers(0, 99))
def test_conversions_to_numbers_are_those_of_asammdf(
    conversion: dict[str, Any], kind: str, seed: int, tmp_path: Path
) -> None:
    from asammdf import MDF

    stored = np.random.default_rng(seed).integers(0, 200, 12).astype(kind)
    content = mdf_file([signal("a", stored, conversion=conversion)])
    recording = opened(tmp_path, content)
    with MDF(tmp_path / "a.mf4") as mdf, np.errstate(all="ignore"):
        expected = mdf.get("a").samples
    np.testing.assert_allclose(recording.read("a"), expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("kind", "at_ten"), [("u1", 1.5), ("f8", -7.0)])
def test_a_value_by_range_holds_between_the_keys_the_upper_one_included_where_numbers_are_whole(
    kind: str, at_ten: float, tmp_path: Path
) -> None:
    ranges = {"lower_0": 2.0, "upper_0": 10.0, "phys_0": 1.5, "lower_1": 20.0, "upper_1": 30.0, "phys_1": 2.5}
    stored = np.array([0, 2, 5, 10, 15, 20, 25, 40]).astype(kind)
    content = mdf_file([signal("a", stored, np.arange(8.0), conversion={**ranges, "default": -7.0})])
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("a"), [-7.0, 1.5, 1.5, at_ten, -7.0, 2.5, 2.5, -7.0])


@pytest.mark.parametrize(
    ("conversion", "before", "after"),
    [
        (
            {"raw_0": 1.0, "phys_0": 2.0, "raw_1": 3.0, "phys_1": 4.0, "interpolation": True},
            (1.0, 2.0, 3.0, 4.0),
            (3.0, 2.0, 3.0, 4.0),
        ),
        ({"a": 1.25, "b": 7.0}, (7.0, 1.25), (7.0, float("inf"))),
    ],
)
def test_a_conversion_that_cannot_be_is_damage_and_leaves_its_channel_out(
    conversion: dict[str, Any], before: tuple[float, ...], after: tuple[float, ...], tmp_path: Path
) -> None:
    content = mdf_file([signal("b", ramp()), signal("a", np.arange(12, dtype=np.uint8), conversion=conversion)])
    numbers = struct.pack(f"<{len(before)}d", *before)
    assert content.count(numbers) == 1
    recording = opened(tmp_path, content.replace(numbers, struct.pack(f"<{len(after)}d", *after)))
    assert [header.name for header in recording.signals] == ["b"]
    assert any("a of group 0: damaged: a conversion of type" in note for note in recording.notes)


@pytest.mark.parametrize("compression", [3, 4, 5, 6], ids=["zstd", "zstd-turned", "lz4", "lz4-turned"])
def test_blocks_packed_as_mdf_4_3_has_it_are_read_and_damaged_ones_refused(compression: int, tmp_path: Path) -> None:
    times = np.arange(5000) / 1000.0
    content = mdf_file([signal("a", ramp(5000), times), signal("n", np.arange(5000, dtype=np.int16), times)],
                       compression=compression, version="4.30")  # fmt: skip
    assert b"##DZ" in content
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("a"), ramp(5000))
    np.testing.assert_array_equal(recording.read("n"), np.arange(5000))
    at = content.index(b"##DZ") + 48
    for place in (*range(at - 16, at + 12), at + 60, at + 200):
        damaged = bytearray(content)
        damaged[place] ^= 0x5A
        with contextlib.suppress(ReadError):
            assert opened(tmp_path, bytes(damaged)).read("n").size == 5000


def test_without_zstd_a_file_that_is_packed_by_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = mdf_file([signal("a", np.zeros(5000), np.arange(5000.0))], compression=3, version="4.30")
    monkeypatch.setitem(sys.modules, "zstd", None)
    with pytest.raises(ReadError, match="packed by zstd, which is read where zstd is installed"):
        opened(tmp_path, content)


def test_channels_that_lie_over_one_another_in_packed_records_are_counted_by_what_the_records_unpack_to(
    tmp_path: Path,
) -> None:
    blocks, rows, columns = Blocks(identification_block(b"MDF     ")), 200_000, 60
    following = 0
    for number in range(columns - 1):
        following = blocks.column(f"n{number}", 0, 0, 0, 64, following)
    time = blocks.column("t", 2, 4, 0, 64, following)
    group = blocks.add("##CG", (0, time, 0, 0, 0, 0), struct.pack("<QQHHLLL", 0, rows, 0, 0, 0, 8, 0))
    packed = zlib.compress(bytes(8 * rows), 1)
    records = blocks.add("##DZ", (), struct.pack("<2sBxLQQ", b"DT", 0, 0, 8 * rows, len(packed)) + packed)
    content = blocks.closed(blocks.add("##DG", (0, group, records, 0), bytes(8)))
    with pytest.raises(ReadError, match="unpacks to more than 67 MB") as caught:
        opened(tmp_path, content)
    assert f"{8 * rows} bytes of records, {8 * rows * columns} of channels" in str(caught.value)


def commented(comment: str) -> bytearray:
    """A file whose header has a link, the last of six, to a text behind all blocks."""
    content = bytearray(measured_file([("a", "V", [(0.0, 1.0), (1.0, 2.0)])]))
    content += bytes(-len(content) % 8)
    struct.pack_into("<Q", content, 64 + 24 + 5 * 8, len(content))
    return content + struct.pack("<4s4xQQ", b"##TX", 24 + 16, 0) + comment.encode().ljust(16, b"\0")


def test_a_file_says_which_program_wrote_it_in_which_version_and_what_it_holds(tmp_path: Path) -> None:
    metadata = opened(tmp_path, bytes(commented("third shot"))).metadata
    assert (metadata["version"], metadata["program"], metadata["comment"]) == ("4.10", "tests", "third shot")


def test_a_header_without_a_link_to_a_comment_has_none(tmp_path: Path) -> None:
    content = commented("no comment")
    struct.pack_into("<Q", content, 64 + 16, 5)
    assert opened(tmp_path, bytes(content)).metadata["comment"] == ""
