"""Channels of one file that have no instant in common are said to: they may be two recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from tests.builders.container_files import hdf5_file, mdf_file, ramp, tdms_file
from tests.builders.mdf3_files import stored_together

asammdf = pytest.importorskip("asammdf")
H8 = 8 * 3600.0


def opened(path: Path, content: bytes) -> Recording:
    path.write_bytes(content)
    return recognise(path).open(path, Declarations("c"))


def apart(recording: Recording) -> list[str]:
    return [note for note in recording.notes if "have no instant in common" in note]


def groups(late_s: float, version: str) -> bytes:
    """Two channels over one group's times, and one over another's that begins so much later."""
    times = np.arange(12) / 1000.0
    own = [asammdf.Signal(ramp(), times + late, name=name) for name, late in (("a", 0), ("b", 0), ("c", late_s))]
    return mdf_file(own[:2], own[2:], version=version)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_groups_whose_times_do_not_overlap_are_told(version: str, tmp_path: Path) -> None:
    (note,) = apart(opened(tmp_path / "a.mdf", groups(H8, version)))
    assert note == (
        "channels have no instant in common: a and 1 more, 0 to 0.011 s; c, 28800 to 28800.011 s: these may be several "
        "recordings"
    )
    for late_s in (0.0, 0.005, 0.011, -0.005):
        assert not apart(opened(tmp_path / "a.mdf", groups(late_s, version)))


def test_groups_that_are_stored_together_and_follow_one_another_are_told(tmp_path: Path) -> None:
    rows = [(1 + (n > 15), n / 8, n) for n in range(30)]
    assert len(apart(opened(tmp_path / "a.mdf", stored_together(rows)))) == 1


def test_a_channel_over_all_of_the_time_joins_the_others(tmp_path: Path) -> None:
    parts = [np.arange(4) / 10, 5 + np.arange(4) / 10, np.array([0.2, 5.1]), 1 + np.arange(4) / 10]
    signals = [
        [asammdf.Signal(np.arange(t.size, dtype=float), t, name=name)] for name, t in zip("abcd", parts, strict=True)
    ]
    assert not apart(opened(tmp_path / "a.mf4", mdf_file(*signals)))
    assert len(apart(opened(tmp_path / "a.mf4", mdf_file(*signals[:2])))) == 1


def test_every_container_is_told_of(tmp_path: Path) -> None:
    late = {"wf_increment": 1e-3, "wf_start_offset": H8}
    rows = [("g", "a", ramp(), late | {"wf_start_offset": 0.0}), ("g", "b", ramp(), late)]
    assert len(apart(opened(tmp_path / "a.tdms", tdms_file(rows)))) == 1

    def fill(file):
        for name, offset in (("a", 0.0), ("b", H8)):
            file[name] = ramp()
            file[name].attrs["fs"], file[name].attrs["start_offset"] = 1000.0, offset

    assert len(apart(opened(tmp_path / "a.h5", hdf5_file(fill)))) == 1
