"""A motion is shared between tests only where nothing that its integration looks at differs."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinSettings, read_settings
from recoil_rigs.twin.motion import Motion, simulate_motion
from tests.builders.shared_motions import FOLDER, Packer, SharedMotions, in_long_steps, made_once, once_in_this_run

RIG = load_rig("field-2013")
SHOT = {"peak_pressure_pa": 130e6, "friction_n": 1500.0}


class Counted:
    """Integrates, and counts how often."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self, *words: Any, **more: Any) -> Motion:
        self.times += 1
        return simulate_motion(*words, **more)


def settings(**changes: float) -> TwinSettings:
    return read_settings(RIG).model_copy(update={"sample_rate_hz": 10e3, "duration_s": 0.06, **changes})


def test_a_shot_with_other_sensors_has_the_motion_that_it_would_have_had(tmp_path: Path) -> None:
    counted = Counted()
    SharedMotions(tmp_path, counted)(RIG.mechanism, settings(), **SHOT)
    shared = SharedMotions(tmp_path, counted)(RIG.mechanism, settings(noise=0.01), **SHOT)
    own = simulate_motion(RIG.mechanism, settings(noise=0.01), **SHOT)
    assert counted.times == 1
    for name, value in vars(own).items():
        assert np.array_equal(getattr(shared, name), value, equal_nan=True), name
    with pytest.raises(ValueError, match="read-only"):
        shared.q[0] = 1.0


@pytest.mark.parametrize(
    "other",
    [
        {"duration_s": 0.05},
        {"orifice_m2": 1.1e-3},
        {"released_mass_kg": 60.0},
        {"tube_modes": 1},
        {"peak_pressure_pa": 130.1e6},
        {"friction_n": 1501.0},
    ],
)
def test_a_shot_that_moves_otherwise_is_integrated(tmp_path: Path, other: dict[str, float]) -> None:
    counted = Counted()
    motions = SharedMotions(tmp_path, counted)
    motions(RIG.mechanism, settings(), **SHOT)
    shot = {name: other.get(name, value) for name, value in SHOT.items()}
    changed = settings(**{name: value for name, value in other.items() if name not in SHOT})
    motions(RIG.mechanism, changed, **shot)
    assert counted.times == 2
    motions(RIG.mechanism, changed, **shot)
    motions(RIG.mechanism, settings(), **SHOT)
    assert counted.times == 2


def test_the_long_steps_of_a_test_run_move_the_part_as_the_short_ones_do() -> None:
    recorded = settings(sample_rate_hz=25e3, duration_s=0.1)
    own, long = (one(RIG.mechanism, recorded, **SHOT) for one in (simulate_motion, in_long_steps))
    assert own.times_s.size == 2 * long.times_s.size
    for name in ("q", "qd", "qdd", "brake_pressure_pa", "recuperator_pressure_pa"):
        short = getattr(own, name)[::2]
        assert np.abs(getattr(long, name) - short).max() < 1e-4 * np.abs(short).max(), name


def test_what_a_test_asks_for_is_made_once_and_by_another_one_where_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    made: list[Path] = []

    def make(folder: Path) -> int:
        (folder / "file").write_text("half")
        made.append(folder)
        if len(made) == 1:
            raise RuntimeError("power cut")
        return 782

    with pytest.raises(RuntimeError, match="power cut"):
        once_in_this_run("shots", make)
    assert list(tmp_path.iterdir()) == []
    assert [once_in_this_run("shots", make) for _ in range(2)] == [782, 782]
    assert len(made) == 2
    assert (made[1] / "file").read_text() == "half"


def test_the_same_arguments_however_written_are_asked_for_once_and_others_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    calls = []

    def shot(name: str = "field-2013", seed: int = 3, **settings: float) -> tuple[str, int, dict[str, float]]:
        calls.append(name)
        return name, seed, settings

    first, another_process = made_once(shot), made_once(shot)
    for asked in (first, another_process):
        same = [asked(), asked("field-2013"), asked(seed=3, name="field-2013")]
        assert same == [("field-2013", 3, {})] * 3
        assert asked(a=1.0, b=2.0) == asked(b=2.0, a=1.0) == ("field-2013", 3, {"a": 1.0, "b": 2.0})
        assert asked(seed=4) == ("field-2013", 4, {})
    assert len(calls) == 3


def test_what_nobody_may_change_comes_to_another_process_so() -> None:
    fixed = np.arange(3.0)
    fixed.setflags(write=False)
    free, mapping = pickle.loads(Packer.packed((np.arange(3.0), MappingProxyType({"fixed": fixed}))))  # noqa: S301
    assert free.flags.writeable
    assert isinstance(mapping, MappingProxyType)
    assert not mapping["fixed"].flags.writeable
    assert mapping["fixed"].tolist() == fixed.tolist()
