"""A draft that lacks what the files or another rig have says so last, and does not end as one that is whole."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from recoil_acquisition.packages import extras
from recoil_daq.drafting.init import draft_rig

CAMERA_LAYOUT = (
    'layout = { header_row = 1, first_row = 2, frame_column = 1, time_column = 2, unit = "mm", '
    'features = [{ name = "Marke1", x = 3, y = 4 }] }'
)


@pytest.fixture
def recorded(tmp_path: Path) -> list[Path]:
    """Return a table of a gun's recorder and one of its camera, of a shot that is drawn in outline."""
    daq, camera = tmp_path / "0001_daq.csv", tmp_path / "0001_camera.csv"
    swings = ("AI 1/p_breech (MPa)", 100.0), ("AI 2/p_brake (MPa)", 10.0), ("AI 3/acc_recoil (m/s2)", 900.0)
    rows = "".join(
        f"{n / 1000:.4f}," + ",".join(f"{size * (100 < n < 130):.2f}" for _, size in swings) + "\n" for n in range(400)
    )
    daq.write_text(f"Time (s),{','.join(name for name, _ in swings)}\n{rows}")
    frames = "".join(f"{n},{n / 6000:.6f},{max(n - 600, 0):.3f},0.0\n" for n in range(1200))
    camera.write_text(f"Bild,Zeit (s),Marke1 - X (mm),Marke1 - Y (mm)\n{frames}")
    return [daq, camera]


@pytest.mark.whole_way
def test_a_file_that_an_optional_library_would_read_is_the_last_line_and_the_code(
    run, recorded: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "0001_rest.tdms").write_bytes(b"TDSm\x0e\0\0\0\x69\x12\0\0" + bytes(16))
    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    drafted = run("init", *recorded, tmp_path / "0001_rest.tdms", "--out", tmp_path / "rig.toml")
    assert drafted.exit_code == 1
    last = " ".join(drafted.stdout.split("lacks: ")[-1].split())
    assert last.startswith("0001_rest.tdms is not in the draft: nptdms, which reads this file, is not installed")
    assert "pip install 'npTDMS>=1.9'" in last


def test_among_an_incomplete_set_nothing_has_a_role_that_its_name_does_not_have(tmp_path: Path) -> None:
    pushes = {"AI 1 (MPa)": 100.0, "AI 2 (MPa)": 10.0, "p_recuperator (MPa)": 3.0, "acc_recoil (m/s2)": 900.0}
    rows = "".join(
        f"{n / 1000:.4f},"
        + ",".join(f"{5.0 * (size == 3.0) + size * (100 < n < 130):.2f}" for size in pushes.values())
        + "\n"
        for n in range(400)
    )
    (tmp_path / "0001_daq.csv").write_text(f"Time (s),{','.join(pushes)}\n{rows}")
    (tmp_path / "0001_other.xyz").write_bytes(b"\x01\x02nothing of ours" * 9)
    alone = draft_rig([tmp_path / "0001_daq.csv"], out=tmp_path / "rig.toml").roles.by_signal
    by_rank = {key for key, one in alone.items() if "its name says nothing" in one.reason and one.role}
    assert by_rank
    some = draft_rig([tmp_path / "0001_daq.csv", tmp_path / "0001_other.xyz"], out=tmp_path / "rig.toml")
    assert {some.roles.by_signal[key].role for key in by_rank} == {""}
    assert some.lacks == ()


@pytest.mark.whole_way
def test_a_cameras_layout_is_kept_and_its_file_is_read_by_it(run, recorded: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "old.toml"
    other.write_text(
        '[[source]]\nname = "camera"\nkind = "camera"\nmatch = "*camera*"\n'
        f"{CAMERA_LAYOUT}\nframe_rate = '6000 Hz'\n"
        '[[channel]]\nname = "x"\nsource = "camera"\nsignal = "Marke1 x"\nquantity = "displacement"\n'
        'role = "recoil_displacement"\n'
    )  # fmt: skip
    result = run("init", *recorded, "--from", other, "--out", tmp_path / "new.toml", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    channels = {one["signal"]: one["role"] for one in document["channels"] if one["source"] == "camera"}
    assert channels == {"Marke1 x": "recoil_displacement"}
    tables = tomllib.loads((tmp_path / "new.toml").read_text())
    (source,) = [one for one in tables["source"] if one["name"] == "camera"]
    assert source["layout"]["features"] == [{"name": "Marke1", "x": 3, "y": 4}]
    assert source["frame_rate"] == "6000 Hz"


def test_a_draft_that_loses_a_role_of_the_other_rig_says_so_last(run, recorded: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "old.toml"
    other.write_text(
        '[[source]]\nname = "recorder"\nkind = "recorder"\n[[channel]]\nname = "gone"\nsource = "recorder"\n'
        'signal = "AI 99/turned"\nquantity = "angular_rate"\nrole = "tipping_rate"\n'
    )
    result = run("init", recorded[0], "--from", other, "--out", tmp_path / "new.toml")
    assert result.exit_code == 1
    lost = "lacks: no channel has the role tipping_rate that old.toml gives 'gone'"
    assert lost in " ".join(result.stdout.split())


def test_a_layout_of_text_whose_rate_is_still_open_is_asked_for_again(tmp_path: Path) -> None:
    rows = "".join(f"{k};{9.0 * (k > 500):.1f};{2.0 * (k > 500):.1f}\n" for k in range(1000))
    (tmp_path / "0001_daq.txt").write_text(f"made by hand\nn;acc;p\n-;m/s2;bar\n{rows}", encoding="utf-8")
    first = draft_rig([tmp_path / "0001_daq.txt"], out=tmp_path / "rig.toml")
    first.write()
    again = draft_rig([tmp_path / "0001_daq.txt"], other=tmp_path / "rig.toml", out=tmp_path / "new.toml")
    (source,) = tomllib.loads(again.draft.text())["source"]
    assert source["layout"]["rate_hz"].startswith("TODO samples per second")
    assert {one.parts[-1] for one in again.draft.questions()} == {one.parts[-1] for one in first.draft.questions()}
