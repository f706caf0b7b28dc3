"""An HDF5 file is read by another process first, so that one that ends its library costs one line."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.processes.reader_process import READER
from recoil_acquisition.readers.hdf5.rehearsal import REHEARSAL, needs_rehearsal
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders import vendor_files


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "recording.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(500) / 1e4
        file["time"].attrs["unit"] = "s"
        file.create_dataset("acc", data=np.sin(np.arange(500)), chunks=(100,), compression="gzip")
        file.create_dataset("names", data=["a", "bb", "ccc"] * 40, dtype=h5py.string_dtype())
        for i in range(30):
            file.create_group(f"group {i}").attrs["unit"] = "V"
    return path


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the process that reads is asked for; it still answers."""
    said: list[str] = []
    ask = READER.ask

    def listening(path: Path, what: str, size: int) -> tuple[bytearray, str]:
        said.append(what)
        return ask(path, what, size)

    monkeypatch.setattr(READER, "ask", listening)
    return said


def test_files_of_the_library_need_it_and_others_do_not(recording: Path, tmp_path: Path) -> None:
    assert needs_rehearsal(recording.read_bytes())
    matlab = tmp_path / "v73.mat"
    matlab.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b"\0") + recording.read_bytes())
    assert needs_rehearsal(matlab.read_bytes())
    assert not needs_rehearsal(b"Time;acc\n0;1\n")


def test_a_file_is_rehearsed_once_for_each_state_of_it(recording: Path, asked: list[str]) -> None:
    recognise(recording)
    recognise(recording)
    assert asked == [REHEARSAL]
    os.utime(recording, ns=(1, 1))
    recognise(recording)
    assert asked == [REHEARSAL] * 2


def test_a_file_of_no_such_library_costs_no_rehearsal(tmp_path: Path, asked: list[str]) -> None:
    (tmp_path / "a.csv").write_bytes(vendor_files.dewesoft_text(vendor_files.motion_rows()))
    recognise(tmp_path / "a.csv")
    assert asked == []


@pytest.mark.parametrize(
    "fault", ["the HDF5 library ended while reading it", "the HDF5 library was not done after 20 s"]
)
def test_a_file_over_which_the_library_ended_is_not_opened_here(
    recording: Path, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(READER, "ask", lambda *_: (bytearray(), fault))
    monkeypatch.setattr(h5py, "File", refused_here)
    with pytest.raises(CorruptFileError, match=fault):
        recognise(recording)


refused_here: Callable[..., None] = lambda *_, **__: pytest.fail("the file was opened in this process")  # noqa: E731


@pytest.mark.exhaustive
def test_damage_anywhere_is_a_refusal_or_a_recording(recording: Path) -> None:
    whole, said = recording.read_bytes(), []
    for seed in range(40):
        choice = random.Random(seed)  # noqa: S311 - a test's choice of damages, no secret
        content = bytearray(whole)
        for _ in range(20):
            content[choice.randrange(len(content))] = choice.randrange(256)
        damaged = recording.with_name(f"{seed}.h5")
        damaged.write_bytes(content)
        try:
            opened = recognise(damaged).open(damaged, Declarations("recorder"))
            for signal in opened.signals:
                opened.read(signal.name)
        except ReadError as error:
            said.append(str(error))
    assert len(said) > 20
    assert all(line.startswith(str(recording.parent)) for line in said)
