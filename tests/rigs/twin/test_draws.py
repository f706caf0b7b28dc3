"""What the virtual rig draws of forces that no gauge reads is what its rig file states, and its truth tells it."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from scipy.stats import kstest, norm

from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.twin import draw_scene, draws, simulate_shot
from recoil_rigs.twin.draws import FORMS, DrawnForces, draw_forces, draw_noise, usual_noise
from recoil_rigs.twin.motion import nominal_recoil_of
from recoil_rigs.twin.nominal_recoil import NominalRecoil
from recoil_rigs.twin.settings import TwinSettings, read_settings
from recoil_rigs.twin.unread_forces import UnreadForces
from tests.builders.virtual_shots import with_twin

SHORT = {"sample_rate_hz": 10e3, "duration_s": 0.3}
SEEDS = range(250)


@cache
def bundled() -> Mechanism:
    return load_rig("field-2013").mechanism


def mechanism(**stated: float) -> Mechanism:
    """Return the bundled rig's, with values and, by ``u_``, uncertainties of its own."""
    m = bundled()
    u = {key.removeprefix("u_"): value for key, value in stated.items() if key.startswith("u_")}
    values = {key: value for key, value in stated.items() if not key.startswith("u_")}
    return dataclasses.replace(m, **values, u=MappingProxyType({**m.u, **u}))


@pytest.fixture(autouse=True)
def _one_nominal_recoil(monkeypatch: pytest.MonkeyPatch) -> None:
    """Integrate the recoil that a mechanism makes by itself once, not once for each seed."""
    found: dict[str, NominalRecoil] = {}

    def once(m: Mechanism, settings: TwinSettings) -> NominalRecoil:
        asked = repr((m, settings))
        if asked not in found:
            found[asked] = nominal_recoil_of(m, settings)
        return found[asked]

    monkeypatch.setattr(draws, "nominal_recoil_of", once)


def forces_of(seed: int, campaign_seed: int | None = None, **stated: float) -> DrawnForces:
    return draw_forces(mechanism(**stated), TwinSettings(), seed, campaign_seed)


@cache
def drawn() -> list[DrawnForces]:
    return [forces_of(seed) for seed in SEEDS]


@pytest.mark.exhaustive
def test_the_share_that_is_not_read_is_drawn_from_what_is_stated() -> None:
    shares = [one.truth["share"] for one in drawn()]
    assert kstest(shares, norm(0.0, 0.01).cdf).pvalue > 0.01
    other = [forces_of(seed, unread_share=0.02, u_unread_share=0.003).truth["share"] for seed in SEEDS]
    assert np.mean(other) == pytest.approx(0.02, abs=4 * 0.003 / 15)
    assert np.std(other) == pytest.approx(0.003, rel=0.15)


def test_where_it_is_positive_it_is_a_mixture_and_where_negative_a_pressure() -> None:
    parts = [[one.truth["form"][form] for form in FORMS] for one in drawn() if one.truth["share"] > 0]
    assert 100 < len(parts) < 150
    np.testing.assert_allclose(np.sum(parts, axis=1), 1.0, rtol=1e-12)
    # a mixture of three parts of which none is preferred: mean 1/3, standard deviation 0.236
    np.testing.assert_allclose(np.mean(parts, axis=0), 1 / 3, atol=0.08)
    np.testing.assert_allclose(np.std(parts, axis=0), np.sqrt(2.0) / 6, rtol=0.2)
    for one in drawn():
        f, positive = one.forces, one.truth["share"] > 0
        assert (f.packing_share > 0, f.slide_n_s_m > 0, f.rod_share > 0) == (positive, positive, positive)
        assert (f.back_pressure_pa > 0) is not positive


@pytest.mark.exhaustive
@pytest.mark.parametrize("share", [0.02, -0.015])
def test_the_impulse_of_a_share_is_that_share_of_what_is_read(share: float) -> None:
    rig = with_twin(
        "field-2013", (("unread_share", share), ("u_unread_share", 1e-9)), unread_errors=True, shot_to_shot=0.0, **SHORT
    )
    for seed in (1, 2, 3):
        scene = draw_scene(rig, seed, "1")
        m, motion = scene.mechanism, scene.motion
        recoils = (motion.times_s >= motion.t_fire_s) & (motion.times_s <= motion.t_end_s)
        read = m.brake_area * motion.brake_pressure_pa + m.recuperator_area * motion.recuperator_pressure_pa
        # a body on a line is not quite the mechanism
        assert motion.unread_n[recoils].sum() / read[recoils].sum() == pytest.approx(share, rel=0.08)


def test_shots_of_a_campaign_share_it_but_for_a_scatter() -> None:
    shots = [forces_of(seed, 7) for seed in SEEDS]
    shares = np.array([one.truth["share"] for one in shots])
    assert np.std(shares) == pytest.approx(0.002, rel=0.15)
    assert np.mean(shares) == pytest.approx(forces_of(7).truth["share"], abs=4 * 0.002 / 15)
    positive = [one.truth["form"] for one in shots if one.truth["share"] > 0]
    assert all(form == positive[0] for form in positive)
    assert {one.forces.curves_seed for one in shots} == {7}
    # the first campaign's own draws are not the next one's
    assert forces_of(1, 8).truth["share"] != forces_of(1, 7).truth["share"]


def test_slides_and_oil_are_drawn_beside_it_and_are_never_negative() -> None:
    stated = {"slide_friction": 50.0, "u_slide_friction": 40.0, "carried_mass": 3.0, "u_carried_mass": 2.0}
    found = [forces_of(seed, u_unread_share=0.0, unread_force=0.0, **stated) for seed in SEEDS]
    slides, oil = (np.array([getattr(one.forces, key) for one in found]) for key in ("slide_n_s_m", "carried_oil_kg"))
    for values, mean, u in ((slides, 50.0, 40.0), (oil, 3.0, 2.0)):
        assert values.min() == 0.0
        assert np.median(values) == pytest.approx(mean, abs=0.2 * u)
        assert np.quantile(values, 0.8413) == pytest.approx(mean + u, abs=0.3 * u)
    assert "share" not in found[0].truth


@pytest.mark.exhaustive
def test_the_latent_force_has_the_size_that_is_stated_and_is_the_rigs() -> None:
    assert {one.forces.latent_share for one in drawn()} == {0.002}
    scenes = [draw_scene(with_twin("field-2013", LATENT, unread_errors=True, **SHORT), k, "1") for k in range(12)]
    sizes = []
    for scene in scenes:
        motion = scene.motion
        recoils = (motion.q[:, 4] > 0.05) & (motion.times_s < motion.t_end_s)
        places = np.linspace(0.06, 0.7, 200)
        sizes.append(np.interp(places, motion.q[recoils, 4], motion.unread_n[recoils]))
    largest = scenes[0].settings.unread.largest_force_n
    assert largest is not None
    assert np.sqrt(np.mean(np.square(sizes))) == pytest.approx(0.01 * largest, rel=0.35)


LATENT = (("unread_force", 0.01), ("unread_share", 0.0), ("u_unread_share", 0.0))


def test_without_draws_it_is_what_the_rig_file_states() -> None:
    quiet = TwinSettings(unread_errors=False)
    assert draw_forces(mechanism(), quiet, 3, None) == DrawnForces(UnreadForces(), {})
    stated = mechanism(unread_share=0.02, slide_friction=80.0, carried_mass=5.0, u_carried_mass=2.0)
    found = draw_forces(stated, quiet, 3, None)
    assert found.forces.packing_share == pytest.approx(0.02)
    rest = found.forces.model_copy(update={"packing_share": 0.0})
    assert rest == UnreadForces(slide_n_s_m=80.0, carried_oil_kg=5.0)
    assert found == draw_forces(stated, quiet, 4, 9)


def test_what_was_asked_for_is_there_beside_what_was_drawn() -> None:
    asked = TwinSettings(unread=UnreadForces(packing_share=0.02, bump_n=500.0, curves_seed=11))
    found, without = draw_forces(mechanism(), asked, 5, None), draw_forces(mechanism(), TwinSettings(), 5, None)
    assert found.forces.packing_share == pytest.approx(0.02 + without.forces.packing_share)
    assert (found.forces.bump_n, found.forces.curves_seed) == (500.0, 11)


@pytest.mark.exhaustive
def test_the_truth_tells_what_was_drawn(tmp_path: Path) -> None:
    rig = load_rig("field-2013")
    brief = parse_rig(rig.text.replace("duration_s = 0.5", "duration_s = 0.3"), rig.path)
    told = simulate_shot(brief, tmp_path, seed=5, shot="1").truth["unread"]
    expected = draw_forces(rig.mechanism, TwinSettings(), 5, None)
    assert told["share"] == expected.truth["share"]
    assert told["forces"] == expected.forces.model_dump(exclude_defaults=True)
    assert told["impulse_share"] == pytest.approx(told["share"], abs=0.005)
    still = with_twin("field-2013", **SHORT)
    assert "unread" not in simulate_shot(still, tmp_path / "still", seed=5, shot="1").truth


def test_the_usual_noise_is_the_middle_of_what_is_drawn_and_none_where_none_is() -> None:
    settings = read_settings(load_rig("mixed"))
    drawn = [draw_noise(settings, seed, None).truth for seed in range(400)]
    for key, usual in usual_noise(settings).items():
        assert np.median([one[key] for one in drawn]) == pytest.approx(usual, rel=0.15)
    assert usual_noise(settings.model_copy(update={"unread_errors": False})) == {}
