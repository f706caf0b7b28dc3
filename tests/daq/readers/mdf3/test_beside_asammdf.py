"""MDF 2 and 3 files as asammdf writes them, and what it reads of files from bytes."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.readers.mdf3.reader import OldMdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders.container_files import mdf_file
from tests.builders.mdf3_files import DOUBLE, FLOAT, INTEL, MOTOROLA, SIGNED, UNSIGNED, one_channel, stored_together

asammdf = pytest.importorskip("asammdf")

VERSIONS = ("2.14", "3.00", "3.10", "3.20", "3.30")
TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
STARTED = datetime(2026, 8, 3, 14, 23, 5, tzinfo=timezone(timedelta(hours=2)))


def opened(path: Path, content: bytes) -> Recording:
    path.write_bytes(content)
    return OldMdfReader().open(path, Declarations("c"))


def signal(name: str, samples: Any, times: Any, **options: Any) -> Any:
    return asammdf.Signal(np.asarray(samples), np.asarray(times), name=name, **options)


@pytest.mark.parametrize("version", VERSIONS)
def test_what_asammdf_writes_in_each_version_is_read(version: str, tmp_path: Path) -> None:
    times, slow = np.arange(40) / 1000.0, np.array([0.0, 0.5, 0.75])
    stored = {name: (np.arange(40) * 5 - 90 * (name[0] != "u")).astype(name) for name in TYPES}
    fast = [
        signal(f"a channel of type {name}, whose name is long", samples, times, unit="m/s²", comment=f"of {name}")
        for name, samples in stored.items()
    ]
    scaled = signal("scaled", np.arange(40, dtype=np.int16), times, conversion={"a": 0.5, "b": 1.0})
    last = [signal("slow", [1.0, 2.0, 3.0], slow), signal("word", np.array([b"x"] * 3), slow, encoding="latin-1")]
    recording = opened(tmp_path / "a.mdf", mdf_file([*fast, scaled], last, started=STARTED, version=version))
    assert [header.name for header in recording.signals] == [one.name for one in [*fast, scaled, last[0]]]
    for header, (name, samples) in zip(recording.signals, stored.items(), strict=False):
        np.testing.assert_array_equal(recording.read(header.name), samples.astype(float))
        assert (header.unit, header.metadata["comment"]) == ("m/s²", f"of {name}")
        assert recording.time_base(header.name).step_s == pytest.approx(1e-3)
    np.testing.assert_array_equal(recording.read("scaled"), 0.5 * np.arange(40) + 1.0)
    np.testing.assert_array_equal(recording.time_base("slow").times_s, slow)
    assert [note.split(" of ")[0] for note in recording.notes] == ["word"]
    assert recording.metadata["version"] == version
    start = recording.absolute_start
    assert start is not None
    zone = "+02:00" if version >= "3.20" else "unknown"
    assert (start.text, start.zone) == ("2026-08-03T14:23:05.000000000", zone)


NUMBERS = [(UNSIGNED, bits) for bits in (8, 16, 32, 64)] + [(SIGNED, bits) for bits in (8, 16, 32, 64)]


@pytest.mark.parametrize(("of_type", "bits"), [*NUMBERS, (FLOAT, 32), (DOUBLE, 64)])
@pytest.mark.parametrize("added", [0, INTEL, MOTOROLA])
def test_numbers_of_each_type_are_those_of_asammdf(of_type: int, bits: int, added: int, tmp_path: Path) -> None:
    stored = np.random.default_rng(bits).integers(1, 100, 5 * bits // 8).astype(np.uint8).tobytes()
    recording = opened(tmp_path / "a.mdf", one_channel(stored, bits // 8, of_type + added, bits))
    with asammdf.MDF(tmp_path / "a.mdf") as mdf:
        expected = mdf.get("a").samples
    np.testing.assert_array_equal(recording.read("a"), expected.astype(float))


@pytest.mark.parametrize(("start", "bits"), [(0, 7), (1, 7), (3, 9), (0, 12), (7, 1), (2, 14)])
@pytest.mark.parametrize("added", [INTEL, MOTOROLA])
def test_numbers_packed_by_bits_are_those_of_asammdf(start: int, bits: int, added: int, tmp_path: Path) -> None:
    stored = np.random.default_rng(start).integers(0, 256, 40).astype(np.uint8).tobytes()
    width = (start + bits + 7) // 8
    for of_type in (UNSIGNED, SIGNED):
        content = one_channel(stored, width, of_type + added, bits, start=start)
        recording = opened(tmp_path / "a.mdf", content)
        with asammdf.MDF(tmp_path / "a.mdf") as mdf:
            expected = mdf.get("a").samples
        np.testing.assert_array_equal(recording.read("a"), expected.astype(float))


@pytest.mark.parametrize("behind", [False, True])
def test_groups_that_are_stored_together_are_those_of_asammdf(behind: bool, tmp_path: Path) -> None:
    rows = [(1 + (n % 3 == 0), n / 8, n) for n in range(30)]
    recording = opened(tmp_path / "a.mdf", stored_together(rows, behind=behind))
    with asammdf.MDF(tmp_path / "a.mdf") as mdf:
        for name in ("a", "b"):
            expected = mdf.get(name)
            np.testing.assert_array_equal(recording.read(name), expected.samples)
            np.testing.assert_array_equal(recording.time_base(name).times_s, expected.timestamps)
