"""What killed sessions left half written in the output folder: taken away when it is old."""

from __future__ import annotations

import os
import time
from pathlib import Path

from recoil_acquisition.files.new_file import partial_path
from recoil_acquisition.files.temporary_folder import LEFT_AFTER_S
from recoil_daq.live.output_folder import OutputFolder

OLD_S = time.time() - 2.0 * LEFT_AFTER_S


def test_half_written_captures_and_shot_files_go_when_a_range_is_armed_anew(tmp_path: Path) -> None:
    (tmp_path / "captures").mkdir()
    places = tmp_path / "captures" / "0001.rdlog", tmp_path / "0001.h5"
    left = [partial_path(place) for place in places]
    for path in (*left, *places, young := partial_path(tmp_path / "0002.h5")):
        path.write_bytes(b"half")
    for path in (*left, *places):
        os.utime(path, (OLD_S, OLD_S))
    with OutputFolder(tmp_path):
        assert not any(path.exists() for path in left)
        assert all(path.exists() for path in (*places, young))
