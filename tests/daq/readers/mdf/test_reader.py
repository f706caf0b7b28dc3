from __future__ import annotations

import struct
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError, iter_groups
from recoil_acquisition.readers.mdf.kind import is_bus_logging
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import surest_claim
from tests.builders.container_files import mdf_file, ramp, small_mdf
from tests.builders.shared_data import shared_file

TIMES = np.arange(12) / 1000.0


def signal(name: str, samples: Any, times: Any = TIMES, **options: Any) -> Any:
    from asammdf import Signal

    return Signal(np.asarray(samples), np.asarray(times), name=name, **options)


def frames(count: int = 4) -> Any:
    """Frames of a bus, as ASAM's bus logging names them."""
    kinds = np.dtype([("CAN_DataFrame.BusChannel", "u1"), ("CAN_DataFrame.ID", "u4"), ("CAN_DataFrame.DLC", "u1")])
    return signal("CAN_DataFrame", np.zeros(count, kinds), np.arange(count) / 10)


def opened(folder: Path, content: bytes) -> Recording:
    path = folder / "a.mf4"
    path.write_bytes(content)
    return MdfReader().open(path, Declarations("dewetron"))


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


def test_what_asammdf_prints_of_a_group_that_it_cannot_read_is_not_shown(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    content = bytearray(small_mdf())
    (name_at,) = struct.unpack_from("<Q", content, content.rindex(b"##CN") + 24 + 16)
    content[name_at + 1] = 0  # its name is no block of a text
    with pytest.raises(ReadError):
        opened(tmp_path, bytes(content)).read("")
    assert capfd.readouterr() == ("", "")


def test_groups_of_a_bus_that_cannot_be_are_refused_before_asammdf_follows_them(tmp_path: Path) -> None:
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
