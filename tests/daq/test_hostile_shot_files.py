"""Shot files that are damaged or forged: one clear line, nothing of another file, and this process goes on."""

from __future__ import annotations

import os
import random
import signal
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import StoreError
from recoil_acquisition.processes import reader_process
from recoil_acquisition.processes.reader_process import READER, most_bytes
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store import is_shot_file, read_shot, shot_file, shot_summary, write_shot
from tests.builders.hostile_shot_files import CRAFTED, SECRET, craft, replace_item, wrong_types
from tests.builders.shots import make_shot


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "0007.h5"
    write_shot(make_shot(), path)
    return path


HARMLESS = {"huge attributes", "rate of a text"}
"""To one who wants the samples: a large file of attributes, and one attribute that only the summary has."""


@pytest.mark.exhaustive
@pytest.mark.parametrize("what", sorted(set(CRAFTED) - HARMLESS))
def test_a_crafted_file_is_refused_with_one_line(sound: Path, tmp_path: Path, what: str) -> None:
    path = craft(sound, tmp_path / "x.h5", CRAFTED[what])
    with pytest.raises(StoreError, match="is damaged: ") as caught:
        read_shot(path)
    assert "\n" not in str(caught.value)
    assert SECRET.decode() not in str(caught.value)
    assert read_shot(sound).name == "0007"


@pytest.mark.exhaustive
@pytest.mark.parametrize("what", ["huge attributes", "rate of a text"])
def test_what_nobody_reads_but_stands_under_the_seal_is_damage_as_well(sound: Path, tmp_path: Path, what: str) -> None:
    path = craft(sound, tmp_path / "a.h5", CRAFTED[what])
    with pytest.raises(StoreError, match="is damaged: something in it was changed since it was written"):
        read_shot(path)
    with pytest.raises(StoreError, match="is damaged"):
        shot_summary(path)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("what", "named"),
    [
        ("external link", "/entry/rig/text is a link to another file"),
        ("external group", "/entry/rig is a link to another file"),
        ("external storage", "/entry/dewetron/acc_recoil is stored in another file"),
        ("virtual data set", "/entry/dewetron/acc_recoil is put together from other files"),
        ("cycle", "stands in two places"),
        ("deep groups", "lies deeper than any group"),
        ("many attributes", "/entry/many has 5000 attributes"),
        ("many groups", "more than 50000 groups"),
        ("huge shape", "more than a shot file of its size"),
        ("large shapes", "c0 lacks some of its samples"),
        ("huge chunk", "chunks of 268435456 elements"),
        ("foreign filter", "is packed in a way"),
        ("identifier of bytes", "is not UTF-8 text"),
    ],
)
def test_what_is_wrong_is_named(sound: Path, tmp_path: Path, what: str, named: str) -> None:
    path = craft(sound, tmp_path / "x.h5", CRAFTED[what])
    for read in (read_shot, shot_summary):
        with pytest.raises(StoreError, match=named):
            read(path)
    assert is_shot_file(path)


@pytest.mark.exhaustive
def test_no_other_type_of_any_value_gives_another_error(sound: Path, tmp_path: Path) -> None:
    with h5py.File(sound) as file:
        cases = wrong_types(file)
    assert len(cases) > 100
    # the benchmark tries all of them
    for name, value in random.Random(7).sample(cases, 24):  # noqa: S311 - a choice of cases, no secret
        path = replace_item(sound, tmp_path / "x.h5", name, value)
        for read in (read_shot, shot_summary):
            try:
                read(path)
            except StoreError as error:
                assert "is damaged: " in str(error)  # noqa: PT017 - some of them are not used by one of the two


@pytest.mark.exhaustive
def test_twenty_random_bytes_end_no_process_of_the_operators(sound: Path, tmp_path: Path) -> None:
    whole = sound.read_bytes()
    choice = random.Random(5)  # noqa: S311 - a test's choice of places, no secret
    for _ in range(20):
        content = bytearray(whole)
        for _ in range(20):
            content[choice.randrange(len(content))] = choice.randrange(256)
        (tmp_path / "x.h5").write_bytes(content)
        try:
            read_shot(tmp_path / "x.h5")
        except StoreError as error:
            assert "\n" not in str(error)  # noqa: PT017 - a change may hit what is not used
    assert read_shot(sound).name == "0007"


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_the_death_of_the_reading_process_is_one_line_and_the_next_file_is_read(
    sound: Path, number: signal.Signals
) -> None:
    process = READER.start()
    os.kill(process.pid, signal.SIGSTOP)
    os.kill(process.pid, number)
    os.kill(process.pid, signal.SIGCONT)
    assert process.ended(60.0) is not None
    assert read_shot(sound).name == "0007"


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of processor time; there the clock ends it")
def test_a_file_that_takes_too_long_is_given_up(sound: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader_process, "CPU_S", 1)
    monkeypatch.setattr(reader_process, "CPU_BYTES_PER_S", 1_000_000_000)
    path = tmp_path / "x.h5"
    path.write_bytes(sound.read_bytes())
    with h5py.File(path, "r+") as file:
        # each of its chunks of 4 samples the library has to find
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk((4,))
        how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        space = h5py.h5s.create_simple((800_000,))
        h5py.h5d.create(file["entry/dewetron"].id, b"c", h5py.h5t.NATIVE_DOUBLE, space, how)
    with pytest.raises(StoreError, match=r"was not done after [16] s"):
        read_shot(path)


def test_arrays_are_aligned_and_nobody_may_change_them(sound: Path) -> None:
    for channel in read_shot(sound).channels.values():
        assert channel.samples.flags.aligned
        assert not channel.samples.flags.writeable


@pytest.mark.exhaustive
def test_samples_that_compress_without_bounds_are_written_so_that_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (reader_process, shot_file):
        monkeypatch.setattr(module, "SPARE_BYTES", 1 << 20)
    many = TimeBase.uniform("dewetron", 0.0, 1e-5, 1_000_000)
    still = Channel("still", "force", np.ones(many.count), many)
    shot = Shot("1", "r", "", "dewetron", {"still": still})
    assert shot_file._content_bytes(shot) > most_bytes(len(shot_file._packed(shot, tmp_path, compressed=True)))
    write_shot(shot, tmp_path / "1.h5")
    assert np.array_equal(read_shot(tmp_path / "1.h5").channels["still"].samples, still.samples)
