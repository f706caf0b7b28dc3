"""A dropped file goes to the one shot that it fits, or to none."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq.errors import ReadError
from daq.trigger import ShotWindow
from recoil_daq.file_match import shot_of, source_of
from recoil_daq.folder_watch import DroppedFile
from recoil_daq.live_shot import LiveShot
from rigs.rig import load_rig


def shot(name: str, trigger_s: float, **files: Path) -> LiveShot:
    window = ShotWindow(trigger_s - 0.1, trigger_s, trigger_s + 1.0, 0.1, {}, ())
    return LiveShot(name, window, state="waiting", wanted={"camera", "dewetron"}, files=dict(files))


def dropped(name: str, seen_s: float) -> DroppedFile:
    return DroppedFile(Path(name), seen_s)


def test_the_only_shot_that_waits_gets_it_whatever_its_name() -> None:
    one = shot("0001", 10.0)
    assert shot_of(dropped("test_fire_a.csv", 12.0), "camera", [one]) is one


def test_a_file_from_before_the_trigger_belongs_to_no_shot() -> None:
    assert shot_of(dropped("a.csv", 9.0), "camera", [shot("0001", 10.0)]) is None


def test_of_several_the_number_in_the_name_decides() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    assert shot_of(dropped("cam_0001_final.csv", 30.0), "camera", shots) is shots[0]
    assert shot_of(dropped("shot2.csv", 30.0), "camera", shots) is shots[1]


def test_of_several_without_a_number_none_is_guessed() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    with pytest.raises(ReadError, match="for several shots: 0001, 0002; write the shot's number into its name"):
        shot_of(dropped("camera.csv", 30.0), "camera", shots)


def test_time_tells_where_the_name_does_not() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    assert shot_of(dropped("camera.csv", 15.0), "camera", shots) is shots[0]
    shots[0].files["camera"] = Path("x")
    assert shot_of(dropped("camera.csv", 30.0), "camera", shots) is shots[1]


def test_a_second_file_for_the_same_shot_is_refused_by_its_name() -> None:
    shots = [shot("0001", 10.0, camera=Path("x"))]
    with pytest.raises(ReadError, match="belongs to shot 0001, which has a file of camera"):
        shot_of(dropped("0001_again.csv", 30.0), "camera", shots)


def test_a_file_named_for_a_shot_that_has_one_never_goes_to_another() -> None:
    shots = [shot("0001", 10.0, camera=Path("x")), shot("0002", 20.0)]
    with pytest.raises(ReadError, match="belongs to shot 0001"):
        shot_of(dropped("0001_again.csv", 30.0), "camera", shots)


def test_a_file_that_is_of_no_source_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("wind from the west")
    with pytest.raises(ReadError):
        source_of(load_rig("mixed"), DroppedFile(file, 0.0))
