"""Clocks that an electric line shows are proposed where the files show them, and only there."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import FaultCode, RigError
from recoil_daq.drafting.init import draft_rig
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders.line_shots import of_the_page

Table = tuple[list[str], np.ndarray]


def recorder_of(fired: TwinShot) -> Table:
    file = next(file for file in fired.files if "dewetron" in file.name)
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    return head.split(","), np.array([[float(cell) for cell in row.split(",")] for row in rows])


def write(path: Path, names: list[str], columns: np.ndarray) -> Path:
    rows = "".join(",".join(f"{value:.7g}" for value in row) + "\n" for row in columns)
    path.write_text(",".join(names) + "\n" + rows, encoding="utf-8")
    return path


def blow_s(times_s: np.ndarray, names: list[str], columns: np.ndarray) -> float:
    pressure = columns[:, next(k for k, name in enumerate(names) if "p_breech" in name)]
    return float(times_s[np.argmax(pressure > 0.2 * pressure.max())])


def clocks(text: str) -> dict[str, dict]:
    return {row["name"]: row.get("align") for row in tomllib.loads(text)["source"]}


def assert_open_alone(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RigError) as refused:
        load_rig(path)
    assert {fault.code for fault in refused.value.faults} == {FaultCode.OPEN}


@pytest.mark.whole_way
def test_pulses_at_the_frame_rate_are_a_camera_s_clock(field_shot: TwinShot, tmp_path: Path) -> None:
    names, columns = recorder_of(field_shot)
    camera = next(file for file in field_shot.files if "camera" in file.name)
    found = next(one for one in draft_rig(field_shot.files).sources if one.kind == "camera")
    rate_hz = found.signals[0].rate_hz
    for share, method in ((1.0, "exposure"), (1.07, "motion")):
        pulses = np.where((columns[:, 0] * rate_hz * share + 0.3) % 1.0 < 0.4, 4.8, 0.1)
        daq = write(tmp_path / "0001_daq.csv", [*names, "AI 9/sync (V)"], np.c_[columns, pulses])
        text = draft_rig([daq, camera], out=tmp_path / "rig.toml").draft.text()
        align = clocks(text)["camera"]
        assert align["method"] == method
        assert align["against"] == "acc_recoil"
        rows = {row["name"]: row for row in tomllib.loads(text)["channel"]}
        if method == "exposure":
            assert align["channel"] == "sync"
            assert rows["sync"]["quantity"] == "voltage"
            # many pulses are no trigger, whatever the line is called
            assert "role" not in rows["sync"]
            assert_open_alone(text, tmp_path / "rig.toml")


@pytest.mark.whole_way
def test_an_edge_that_two_recorders_saw_is_their_clock(field_shot: TwinShot, tmp_path: Path) -> None:
    names, columns = recorder_of(field_shot)
    times_s = columns[:, 0]
    at_s = blow_s(times_s, names, columns) - 0.02
    line = np.where((times_s > at_s) & (times_s < at_s + 0.05), 4.9, 0.0)
    one = [k for k, name in enumerate(names) if k and not any(word in name for word in ("brake", "recup"))]
    two = [k for k, name in enumerate(names) if any(word in name for word in ("brake", "recup"))]
    first = write(
        tmp_path / "0001_a.csv",
        [names[0], *(names[k] for k in one), "AI 9/D1 (V)"],
        np.c_[times_s, columns[:, one], line],
    )
    for late_s, expected in ((0.0, True), (0.3, False)):
        edge = np.where((times_s > at_s + late_s) & (times_s < at_s + late_s + 0.05), 5.0, 0.2)
        shown = np.c_[times_s[::2], columns[::2][:, two], edge[::2]]
        second = write(tmp_path / "0001_b.csv", [names[0], *(names[k] for k in two), "CH4 (V)"], shown)
        text = draft_rig([first, second], out=tmp_path / "rig.toml").draft.text()
        (align,) = [align for align in clocks(text).values() if align is not None]
        roles = {row["name"]: row.get("role") for row in tomllib.loads(text)["channel"]}
        if expected:
            assert align == {"method": "trigger", "channel": "CH4"}
            assert roles["D1"] == "trigger"
        else:
            # the blow would be at two instants: the edges are of two events
            assert str(align).startswith("TODO ")
            assert roles.get("D1") != "trigger"
        assert_open_alone(text, tmp_path / "rig.toml")


@pytest.mark.whole_way
@pytest.mark.parametrize(("page", "source"), [("cell and servo", "recorder_2"), ("cell and camera", "camera")])
def test_what_the_forces_of_a_line_drive_is_aligned_by_them(page: str, source: str, tmp_path: Path) -> None:
    simulated = simulate_shot(of_the_page(page), tmp_path / "files", seed=2, shot="0001")
    text = draft_rig(list(simulated.files), out=tmp_path / "rig.toml").draft.text()
    align = clocks(text)[source]
    assert align["method"] == "motion"
    assert align["against"] == of_the_page(page).with_role("driving_force")[0].name
