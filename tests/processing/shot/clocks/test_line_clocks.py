"""A clock of a body on a line from its forces, on virtual shots with two clocks and on lags that are put in."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.shot.shot import ClockAlignment
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.rows.causes import ASKED_TWICE, causes_of
from recoil_identification.shot.preparation import prepare
from recoil_processing.alignment.redundant_alignment import Beside, RedundantFit, align_redundant
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.line_shots import DAY, of_the_page, sled_outcome

PAGES = ("cell and camera", "cell and servo")


def fired(rig: Rig, folder: Path, seed: int = 1) -> tuple[FiredShot, float]:
    """Return an ingested shot, and the error of its second clock in the middle of the record, s."""
    simulated = simulate_shot(rig, folder / "files", seed=seed, shot="1")
    shot = ingest_files(rig, simulated.files, shot="1", out=folder / "shots", on=DAY).shot
    (clock,) = shot.alignments
    true = simulated.truth["clocks"][clock.clock]
    middle_s = 0.5 * simulated.truth["t_end"]
    return FiredShot(shot, rig), clock.to_reference(middle_s) - (1 + true["drift"]) * middle_s - true["offset_s"]


@pytest.mark.whole_way
@pytest.mark.parametrize("page", PAGES)
def test_the_forces_tell_the_clock_of_what_moves(page: str, tmp_path: Path) -> None:
    shot, error_s = fired(of_the_page(page), tmp_path)
    (clock,) = shot.shot.alignments
    assert (clock.status, clock.method) == ("ok", "force"), clock.reasons
    assert abs(error_s) < 2.5 * clock.u_offset_s < 1e-3
    assert clock.details is not None
    assert clock.details["mass_kg"] == pytest.approx(shot.rig.mechanism.m3, rel=0.03)


@pytest.mark.whole_way
@pytest.mark.parametrize("page", PAGES)
def test_two_clocks_tell_the_mass(page: str) -> None:
    outcome = sled_outcome(2, {}, of_the_page(page))
    assert outcome.covers
    assert outcome.found.valid, outcome.found.reasons


@pytest.mark.whole_way
def test_the_zero_of_a_speed_turns_no_friction_where_the_body_rests() -> None:
    # its servo holds it between two strokes with a force that no friction explains
    outcome = sled_outcome(37, {}, of_the_page("cell and servo"))
    assert outcome.covers
    assert outcome.found.valid, outcome.found.reasons


@pytest.mark.whole_way
def test_a_friction_that_nothing_is_known_of_leaves_the_offset_open(tmp_path: Path) -> None:
    rig = of_the_page("cell and servo")
    sure, _ = fired(rig, tmp_path / "sure")
    known = replace(rig, mechanism=replace(rig.mechanism, u={**rig.mechanism.u, "slide_friction": 0.0}))
    told, _ = fired(known, tmp_path / "known")
    assert told.shot.alignments[0].u_offset_s < sure.shot.alignments[0].u_offset_s


@pytest.mark.whole_way
def test_the_rows_of_the_mass_are_not_asked_twice_for_the_offset(tmp_path: Path) -> None:
    shot, _ = fired(of_the_page("cell and servo"), tmp_path)
    prepared = prepare(shot)
    found = causes_of(prepared.recorded, prepared.recorded, prepared.signals, shot, "recoil_velocity")
    (clock,) = (one for one in found if one.source.kind is SourceKind.ALIGNMENT)
    assert clock.u == pytest.approx(ASKED_TWICE * shot.shot.alignments[0].u_offset_s)


@pytest.mark.whole_way
def test_strokes_that_repeat_leave_the_clock_ambiguous(tmp_path: Path) -> None:
    rig = with_settings(of_the_page("cell and servo"), {"strokes": 20, "duration_s": 12.0, "begins_s": 2.0})
    shot, _ = fired(rig, tmp_path)
    assert shot.shot.alignments[0].status == "ambiguous"
    assert any("a second offset fits nearly as well" in one for one in shot.shot.alignments[0].reasons)


@pytest.mark.whole_way
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_scale_that_is_wrong_is_doubted(scale: float, tmp_path: Path) -> None:
    rig = of_the_page("cell and servo")
    stated = replace(rig, mechanism=replace(rig.mechanism, m3=scale * rig.mechanism.m3))
    simulated = simulate_shot(rig, tmp_path / "files", seed=1, shot="1")
    shot = ingest_files(stated, simulated.files, shot="1", out=tmp_path / "shots", on=DAY).shot
    doubted = [one for one in shot.alignments[0].reasons if "off the specification" in one]
    assert bool(doubted) is (scale != 1.0)


def lag(order: int, sizes: tuple[float, float], u: tuple[float, float]) -> RedundantFit:
    """Align an integral of a motion that a force drives against friction, 3 ms early, by what is known of both."""
    rng, step_s, lag_s = np.random.default_rng(5), 1e-3, 3e-3
    times_s = step_s * np.arange(4000)

    def speed(at_s: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * at_s) * np.sin(0.7 * np.pi * at_s) ** 2

    def acceleration(at_s: np.ndarray) -> np.ndarray:
        return (speed(at_s + 1e-5) - speed(at_s - 1e-5)) / 2e-5

    true = 5.0, 2.0
    force = acceleration(times_s) + true[0] * np.tanh(speed(times_s) / 0.02) + true[1] * speed(times_s)
    v = speed(times_s + lag_s)
    fine_s = np.arange(0.0, 4.1, 1e-4)
    travel = np.interp(times_s + lag_s, fine_s, 1e-4 * np.cumsum(speed(fine_s)))
    seen = (acceleration(times_s + lag_s), v, travel)[order] + 1e-6 * rng.standard_normal(times_s.size)
    fit = align_redundant(
        times_s, seen, 0.0, step_s, force, drift_allowance=0.0, cutoff_hz=20.0, derivative=order,
        beside=Beside(
            columns=-np.column_stack([np.tanh(v / 0.02), v]), sizes=np.array(sizes), parts=np.zeros((4000, 0)),
            u=np.array(u), counts=np.ones(4000, dtype=bool),
        ),
    )  # fmt: skip
    assert isinstance(fit, RedundantFit)
    return fit


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_motion_is_aligned_by_whichever_derivative_it_must_be_taken_of(order: int) -> None:
    fit = lag(order, (5.0, 2.0), (0.0, 0.0))
    assert fit.offset_s == pytest.approx(
        3e-3, abs=5e-5
    )  # the clock's end and the turns of the friction take a hundredth
    assert fit.gain == pytest.approx(1.0, abs=2e-3)


def test_what_is_unknown_beside_is_found_and_costs_certainty() -> None:
    off, held = lag(1, (4.0, 1.0), (2.0, 2.0)), lag(1, (5.0, 2.0), (0.0, 0.0))
    assert off.offset_s == pytest.approx(3e-3, abs=5e-5)
    assert off.u_offset_s > held.u_offset_s
    wrong = lag(1, (4.0, 1.0), (0.0, 0.0))
    assert abs(wrong.offset_s - 3e-3) > 1e-3


def test_a_clock_that_nothing_tells_is_no_clock(tmp_path: Path) -> None:
    rig = of_the_page("cell and servo")
    simulated = simulate_shot(with_settings(rig, {"strokes": 0, "start_m_s": 1e-4}), tmp_path, seed=1, shot="1")
    found: tuple[ClockAlignment, ...] = ingest_files(
        rig, simulated.files, shot="1", out=tmp_path / "shots", on=DAY
    ).shot.alignments
    assert found[0].status == "failed"
    assert math.isinf(found[0].u_offset_s) or found[0].reasons
