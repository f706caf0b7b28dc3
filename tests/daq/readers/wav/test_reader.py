from __future__ import annotations

import struct
import wave
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError, UnknownFormatError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.readers.wav.reader import WavReader
from tests.builders import container_files as build
from tests.builders.opened_files import open_bytes

opened = partial(open_bytes, WavReader(), "a.wav")


@pytest.mark.parametrize(("bits", "lowest"), [(16, -(2**15)), (24, -(2**23)), (32, -(2**31))])
def test_integers_are_shares_of_full_scale_and_kept_as_counts(bits: int, lowest: int, tmp_path: Path) -> None:
    counts = np.array([lowest, -1, 0, 1, -lowest - 1], np.int64)
    path = tmp_path / "a.wav"
    with wave.open(str(path), "wb") as writer:
        writer.setnchannels(1)
        writer.setsampwidth(bits // 8)
        writer.setframerate(200000)
        writer.writeframes(b"".join(int(c).to_bytes(bits // 8, "little", signed=True) for c in counts))
    recording = WavReader().open(path, Declarations("dewetron"))
    np.testing.assert_array_equal(recording.read("channel 1"), counts / 2.0 ** (bits - 1))
    raw = recording.raw("channel 1")
    assert raw is not None
    np.testing.assert_array_equal(raw.counts, counts)
    assert recording.time_base("channel 1").step_s == 1 / 200000
    assert recording.signals[0].unit == ""
    assert "no unit" in recording.notes[0]


def test_eight_bits_are_unsigned(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.wave_file(build.wave_format(1, 1, 100, 8), bytes([0, 128, 255])))
    np.testing.assert_array_equal(recording.read("channel 1"), [-1.0, 0.0, 127 / 128])


@settings(max_examples=30, deadline=None)
@given(values=st.lists(st.floats(-10, 10, width=32), min_size=1, max_size=20))
def test_floats_come_back_as_they_are(values: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    data = np.repeat(np.array(values, "<f4"), 2).tobytes()
    recording = opened(tmp_path_factory.mktemp("w"), build.wave_file(build.wave_format(3, 2, 44100, 32), data))
    np.testing.assert_array_equal(recording.read("channel 2"), values)
    assert recording.raw("channel 2") is None


def test_a_file_of_64_bit_sizes_is_read(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.rf64_file(build.wave_format(1, 1, 100, 16), b"\1\0\2\0\3\0"))
    assert recording.signals[0].sample_count == 3
    assert recording.incomplete == ""


def test_a_broadcast_chunk_tells_the_start_without_a_zone(tmp_path: Path) -> None:
    content = build.wave_file(build.wave_format(1, 1, 100, 16), b"\1\0", build.broadcast())
    recording = opened(tmp_path, content)
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone, start.origin) == ("2026-08-03T12:23:05", "unknown", "bext chunk")
    assert recording.metadata["bext"]["time_reference_samples"] == 7


def test_a_cut_file_gives_its_complete_samples_and_says_so(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.small_wave()[:-3])
    assert recording.signals[0].sample_count == 19
    assert recording.incomplete in recording.notes


def test_compressed_sound_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"A-law .format 6. of 8 bits; export it as PCM"):
        opened(tmp_path, build.wave_file(build.wave_format(6, 1, 8000, 8), b"\0" * 8))


@pytest.mark.parametrize(("bits", "width"), [(12, 2), (20, 3), (18, 3)])
def test_samples_of_fewer_bits_stand_at_the_upper_end_of_their_bytes(bits: int, width: int, tmp_path: Path) -> None:
    counts = [-(2 ** (bits - 1)), -1, 0, 1, 2 ** (bits - 1) - 1]
    data = b"".join((c << 8 * width - bits).to_bytes(width, "little", signed=True) for c in counts)
    form = struct.pack("<HHIIHH", 1, 1, 8000, 8000 * width, width, bits)
    recording = opened(tmp_path, build.wave_file(form, data))
    np.testing.assert_array_equal(recording.read("channel 1"), np.array(counts) / 2.0 ** (bits - 1))
    assert recording.metadata["bits"] == bits


def test_the_big_endian_form_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(b"RIFX" + build.small_wave()[4:])
    with pytest.raises(UnknownFormatError, match=r"this is a RIFX file.*export it as WAV"):
        recognise(path)


def test_a_format_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    form = bytearray(build.wave_format(1, 2, 8000, 16))
    form[12] = 3
    with pytest.raises(CorruptFileError, match="frames of 3 bytes"):
        opened(tmp_path, build.wave_file(bytes(form), b"\0" * 8))


def test_a_second_recording_behind_the_first_is_refused_with_its_byte(tmp_path: Path) -> None:
    first = build.small_wave()
    with pytest.raises(ReadError, match=f"a second recording begins at byte {len(first)}"):
        opened(tmp_path, first + first)
    data = build.riff_chunk(b"data", b"\1\2\3\4")
    with pytest.raises(ReadError, match=f"a second recording begins at byte {len(first)}.* a further data chunk"):
        opened(tmp_path, first + data)


@pytest.mark.parametrize(("code", "named"), [(2, "Microsoft ADPCM"), (17, "IMA ADPCM"), (7, "mu-law")])
def test_a_compressed_coding_is_named_and_not_called_damaged(code: int, named: str, tmp_path: Path) -> None:
    form = struct.pack("<HHIIHHHH", code, 2, 48000, 48000, 1024, 4, 2, 1017)
    chunks = b"".join(
        name + struct.pack("<I", len(body)) + body for name, body in ((b"fmt ", form), (b"data", b"\1" * 1024))
    )
    content = b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks
    (path := tmp_path / "a.wav").write_bytes(content)
    with pytest.raises(ReadError, match=f"not read.*{named}") as refused:
        WavReader().open(path, Declarations("recorder"))
    assert "damaged" not in str(refused.value)
