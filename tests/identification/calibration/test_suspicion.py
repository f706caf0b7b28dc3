"""What nobody states: named by its shape where a shot shows it, and by nothing else, and averaged over below that."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.remark import ReasonCode
from recoil_identification.calibration.suspicion import UNSTATED, ShotSuspicion, suspicion
from recoil_identification.rows.breech_chain import BREECH, TUBE, gauge_ahead_of, linearity_of
from recoil_identification.rows.suspects import HANGING, droop_of, suspects
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.sensor_doubts import LITTLE, weighed_doubts
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.sensor_reading import breech_reading
from recoil_rigs.twin.unread_forces import UnreadForces
from tests.builders.virtual_shots import VirtualShot, identified, virtual_shot, with_channels

FULL_PA = 250e6


@cache
def with_reading(**readings: float) -> Identification:
    """Identify a sound shot whose breech gauge reads what its chain makes of the pressure."""
    virtual = virtual_shot()
    return identify_shot(FiredShot(read_by(virtual, **readings), virtual.rig), Options())


def read_by(virtual: VirtualShot, **readings: float) -> Any:
    """Let the virtual rig's own equations turn what the breech gauge reads."""
    channel = virtual.shot.by_role(BREECH)
    assert channel is not None
    since_s = channel.time_base.times_s - channel.time_base.times_s[0]
    motion: Any = SimpleNamespace(times_s=since_s)
    mechanism = virtual.rig.mechanism
    # what the gauge reads at rest is its zero, and drives no projectile
    zero_pa = float(np.median(channel.samples[since_s < 0.04]))
    true_pa = np.where(since_s < 0.045, 0.0, channel.samples - zero_pa)
    off_pa = breech_reading(true_pa, motion, Readings(**readings), mechanism, UnreadForces(), FULL_PA) - true_pa
    return with_channels(virtual.shot, **{channel.name: channel.samples + off_pa})


@cache
def swung(tube_hz: float) -> Identification:
    """Identify a sound shot whose accelerometer sits on a tube that swings far above the motion."""
    virtual = virtual_shot()
    channel = virtual.shot.by_role("recoil_acceleration")
    assert channel is not None
    step_s = float(np.diff(channel.time_base.times_s[:2])[0])
    w = 2.0 * math.pi * np.fft.rfftfreq(channel.samples.size, step_s)
    # of the resonance itself a lag of the gauge's own time constant is left
    over = w / (2.0 * math.pi * tube_hz)
    swings = 2.0 * -(over**2) / (1.0 - over**2 + 0.3j * over)
    read = channel.samples + np.fft.irfft(swings * np.fft.rfft(channel.samples), channel.samples.size)
    return identify_shot(FiredShot(with_channels(virtual.shot, **{channel.name: read}), virtual.rig), Options())


def test_a_sound_shot_shows_none() -> None:
    found = identified()
    assert found.chain is not None
    assert not found.chain.suspected
    assert "Nothing of the breech chain" in str(found.chain)
    assert ReasonCode.BREECH_CHAIN not in {one.code for one in (*found.reasons, *found.notes)}


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("readings", "source", "key"),
    [
        ({"breech_linearity": 0.01, "breech_hysteresis": 0.01}, linearity_of(BREECH), "`u_linearity_rel`"),
        ({"gauge_ahead": 0.03}, gauge_ahead_of(BREECH), "`gauge_ahead`"),
    ],
)
def test_a_gauge_that_reads_otherwise_is_named_with_its_size_and_what_to_state(readings, source, key) -> None:
    found = with_reading(**readings)
    chain = found.chain
    assert chain is not None
    assert chain.suspected
    assert chain.source == source
    assert chain.size == pytest.approx(next(iter(readings.values())), abs=3.0 * chain.u_size)
    reasons = [one for one in found.reasons if one.code is ReasonCode.BREECH_CHAIN]
    assert [one.about for one in reasons] == [source]
    assert reasons[0].startswith(
        "The breech chain, a muzzle brake, the tube or their like; or the mass (ln of the Bayes factor"
    )
    assert key in reasons[0]
    assert found.constancy is not None
    assert found.constancy.constant
    assert not found.valid


@pytest.mark.whole_way
def test_a_tube_that_swings_is_named_with_its_frequency_and_a_bracket_by_the_sign() -> None:
    found = swung(500.0)
    chain = found.chain
    assert chain is not None
    assert chain.source == TUBE
    assert chain.swings_hz == pytest.approx(500.0, rel=0.1)
    assert "a tube that swings along its axis, at some" in str(chain)
    assert "state `tube_axial_hz`" in str(chain)
    bracket = replace(chain, size=-chain.size)
    assert bracket.swings_hz == pytest.approx(chain.swings_hz / math.sqrt(2.0))
    assert "a bracket under the accelerometer, at some" in str(bracket)
    assert "stiffen what carries the accelerometer" in str(bracket)


@pytest.mark.whole_way
def test_the_mass_moves_by_what_an_estimate_with_the_shape_finds() -> None:
    found = with_reading(gauge_ahead=0.03)
    chain, constancy = found.chain, found.constancy
    assert chain is not None
    assert constancy is not None
    # asked with the noise by which the mass would be said to change
    calibration = constancy.beside
    moved = chain.explained.inferred.value("ln mass") - calibration.inferred.value("ln mass")
    assert chain.moves_rel == pytest.approx(moved, rel=0.05)
    assert chain.explained.inferred.value(chain.source) == pytest.approx(chain.size, rel=0.05)


@pytest.mark.whole_way
def test_a_rig_that_states_it_is_asked_for_it_no_more_and_finds_it() -> None:
    virtual = virtual_shot()
    stated = "gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15.0, u_share = 0.03 },"
    rig = parse_rig(virtual.rig.text.replace('serial = "V301",', f'serial = "V301", {stated}'), virtual.rig.path)
    found = identify_shot(FiredShot(read_by(virtual, gauge_ahead=0.03), rig), Options())
    assert found.valid, found.reasons
    inferred = found.route.calibration.inferred
    source = gauge_ahead_of(BREECH)
    assert inferred.value(source) == pytest.approx(0.03, abs=3.0 * inferred.u(source))
    assert inferred.u(source) < 0.01
    kinds = [one.source for one in suspects(found.route.fitted, found.route.recorded, found.route.signals, rig, ())]
    assert source not in kinds


@pytest.mark.whole_way
def test_an_amplifier_of_the_breech_gauge_that_droops_is_named_with_its_time_constant() -> None:
    found = with_reading(breech_amplifier_s=0.4)
    assert found.chain is not None
    assert found.chain.source == droop_of(BREECH)
    assert 1.0 / found.chain.size == pytest.approx(0.4, rel=0.1)
    assert "an amplifier of breech_pressure with a time constant of 0.4" in str(found.chain)
    assert "state `time_constant_s` in the sensor of breech_pressure" in str(found.chain)


@pytest.mark.whole_way
def test_a_part_that_hangs_elastically_is_named_and_the_mass_holds_it() -> None:
    virtual = virtual_shot(kind=False, unread_errors=False, unread="{ hanging_kg = 12.0, hanging_hz = 25.0 }")
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
    assert found.chain is not None
    assert found.chain.source == HANGING
    assert "a part that hangs elastically" in str(found.chain)
    assert "tie down what swings on the recoiling part" in str(found.chain)
    low, high = found.chosen.estimate.interval_kg
    assert low < virtual.truth["m3"] < high


# ------------------------------------------------------------------------------------------ the mean over all of them


def test_the_mass_is_the_mean_over_all_shapes_and_its_budget_has_a_row_for_them() -> None:
    found = identified()
    plain, estimate, chain = found.route.calibration.estimate, found.chosen.estimate, found.chain
    assert chain is not None
    (row,) = (one for one in estimate.budget if one.source == UNSTATED)
    moved, variance = chain.hypotheses.moved(chain.by)
    assert estimate.mass_kg == pytest.approx(plain.mass_kg * (1.0 + moved), rel=1e-12)
    assert row.u_kg == pytest.approx(estimate.mass_kg * math.sqrt(variance), rel=1e-12)
    assert [replace(one, degrees_of_freedom=0.0) for one in estimate.budget[:-1]] == [
        replace(one, degrees_of_freedom=0.0) for one in plain.budget
    ]
    assert 0.0 < row.u_kg < 0.5 * plain.u_kg


def test_draws_of_the_mass_have_its_mean_and_its_uncertainty() -> None:
    found = identified()
    drawn = found.monte_carlo
    assert drawn is not None
    estimate = found.chosen.estimate
    assert drawn.mean == pytest.approx(estimate.mass_kg, abs=0.05 * estimate.u_kg)
    assert drawn.u == pytest.approx(estimate.u_kg, rel=0.03)


# ------------------------------------------------------------------------------------------ what is named first


def suspected(found: Identification, **changed: Any) -> ShotSuspicion:
    assert found.chain is not None
    return replace(found.chain, **({"ln_bayes_factor": 10.0, "normalised": 6.0} | changed))


def codes(found: Identification, chain: ShotSuspicion) -> list[tuple[str, bool]]:
    judged = weighed_doubts(found.route.calibration, found.constancy, chain)
    return [(reason.code, not held) for reason, held in judged]


def test_what_moves_the_mass_by_less_than_its_interval_holds_is_a_note() -> None:
    found = identified()
    u_rel = found.route.calibration.estimate.u_kg / found.route.calibration.estimate.mass_kg
    for share, against in ((0.9, False), (1.1, True)):
        chain = suspected(found, spread_rel=share * LITTLE * u_rel)
        assert codes(found, chain) == [(ReasonCode.BREECH_CHAIN, against)]
    assert codes(found, suspected(found, spread_rel=1.0, ln_bayes_factor=2.9)) == []


def test_a_mass_that_changes_is_not_said_where_the_chain_explains_the_shot_as_well() -> None:
    constancy = identified().constancy
    assert constancy is not None
    changing = replace(constancy, ln_bayes_factor=8.0, normalised_drift=6.0)
    assert not changing.constant
    assert replace(changing, gain_of_chain=18.1).constant
    assert "something of the breech chain or its like explains" in str(replace(changing, gain_of_chain=18.1))
    assert not replace(changing, gain_of_chain=17.9).constant


def test_nothing_is_told_where_nothing_is_suspected() -> None:
    assert suspicion(identified().route.calibration, ()) is None
