"""What speaks against a shot's mass, and what its reader is told beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.remark import NoteCode, ReasonCode
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.mass import ACCELERATION, GAUGES, RANDOM
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.route import Route
from recoil_identification.shot.sensor_doubts import notes_on_doubts
from recoil_identification.shot.verdict import HIDDEN_U, against_this_shot, notes_on, reasons_against, require_explained
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot

BRAKE_DELAY = ErrorSource(SourceKind.DELAY, "brake_pressure")


def route_of(found: Identification, **other: object) -> Route:
    """How a mass was found, something of it otherwise."""
    return replace(found.route, **other)


def said_of(**other: object) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Reasons and notes of a sound shot of which something is otherwise."""
    virtual, found = virtual_shot(), identified()
    route = route_of(found, **other)
    reasons = reasons_against(FiredShot(virtual.shot, virtual.rig), route, found.chosen.trace, found.constancy)
    return reasons, notes_on(FiredShot(virtual.shot, virtual.rig), route, found.chosen.trace)


def test_nothing_speaks_against_a_sound_shot() -> None:
    reasons, _ = said_of()
    assert reasons == ()


def test_a_zero_that_shifted_is_a_reason_until_a_camera_confirms_it() -> None:
    shift = ZeroShift(step_m_s2=25.0, u_step_m_s2=2.0, criterion=40.0)
    (reason,), notes = said_of(zero_shift=shift)
    assert reason.startswith(
        "either the accelerometer's zero shifted at the shot by +25 m/s^2 (u 2 m/s^2) to stay, or a gauge"
    )
    assert not any("zero shifted" in note for note in notes)
    reasons, notes = said_of(zero_shift=replace(shift, confirmed=True))
    assert reasons == ()
    assert any(note.startswith("the accelerometer's zero shifted at the shot by +25 m/s^2") for note in notes)


def test_a_mass_that_a_drift_which_hides_would_move_beyond_its_interval_is_refused() -> None:
    virtual, found = virtual_shot(), identified()
    assert found.constancy is not None
    # of a mean of the mass over a travel
    assert 0.0 < found.constancy.moved_by_drift < 1.0
    expanded = found.chosen.estimate.coverage_factor * found.chosen.estimate.u_kg / found.chosen.estimate.mass_kg
    codes = [
        [
            one.code
            for one in reasons_against(
                FiredShot(virtual.shot, virtual.rig),
                found.route,
                found.chosen.trace,
                replace(found.constancy, moved_by_drift=moved, u_drift_rel=share * expanded / HIDDEN_U / abs(moved)),
            )
        ]
        for moved, share in ((2.0, 0.9), (2.0, 1.1), (-2.0, 1.1), (1.0, 5.0))
    ]
    assert codes == [[], [ReasonCode.HIDDEN_DRIFT], [ReasonCode.HIDDEN_DRIFT], []]


def test_a_fit_that_did_not_settle_is_said_to_be_one() -> None:
    calibration = identified().route.calibration
    (reason,), _ = said_of(calibration=replace(calibration, inferred=replace(calibration.inferred, converged=False)))
    assert reason.startswith("mass and sensors' errors did not settle")


def test_motion_that_is_left_in_a_way_that_no_noise_is_voids_the_mass_and_much_of_it_gives_no_number() -> None:
    calibration = identified().route.calibration

    def leaving(share: float) -> Calibration:
        return replace(calibration, noise=replace(calibration.noise, unexplained_share=share))

    reasons, _ = said_of(calibration=leaving(0.05))
    assert reasons == ()
    (reason,), _ = said_of(calibration=leaving(0.061))
    assert reason.startswith("mass and forces leave 6.1 % of the acceleration unexplained, in a way that no noise is")
    assert reason.code is ReasonCode.RESIDUAL
    require_explained(leaving(0.2))
    with pytest.raises(IdentificationError, match="acceleration and forces do not show one motion") as caught:
        require_explained(leaving(0.21))
    assert "found 21 %" in str(caught.value)


def test_a_motion_that_is_louder_than_the_rest_is_a_note_and_no_reason() -> None:
    calibration = identified().route.calibration
    for size, told in ((1.9, False), (2.1, True), (34.0, True)):
        reasons, notes = said_of(calibration=replace(calibration, noise=replace(calibration.noise, size=size)))
        assert reasons == ()
        said = [note for note in notes if note.code is NoteCode.MOTION_NOISE]
        assert len(said) == told
        assert all(f"leave {size:.1f} times the noise of the rest before the shot" in note for note in said)


def test_two_ways_to_the_acceleration_may_differ_by_three_of_what_they_do_not_share() -> None:
    estimates = {name: result.estimate for name, result in identified().results.items()}
    reverse = estimates["reverse"]
    own = {RANDOM, ACCELERATION, CAMERA_SCALE}
    both = (reverse, estimates["kinematic"])
    u_kg = math.hypot(*(row.u_kg for one in both for row in one.budget if row.source in own))
    for factor, count in ((2.9, 0), (3.1, 1), (-3.1, 1)):
        apart = replace(estimates["kinematic"], mass_kg=reverse.mass_kg + factor * u_kg)
        reasons, _ = said_of(estimates={**estimates, "kinematic": apart})
        assert len(reasons) == count
        assert all(f"the camera {apart.mass_kg:.1f} kg, 3.1 standard" in reason for reason in reasons)


def test_a_noisy_carriage_sensor_speaks_against_its_shots_mass_but_not_against_its_part_in_a_campaign() -> None:
    virtual, found = virtual_shot(), identified()
    carriage, breech = (virtual.shot.by_role(role) for role in ("carriage_rate", "breech_pressure"))
    assert carriage is not None
    assert breech is not None
    failed = [
        QualityCheck(carriage.name, Check.FILTERED_NOISE, "fail", "pulse 19 dB above it"),
        QualityCheck(carriage.name, Check.RANGE, "fail", "clipped"),
        QualityCheck(breech.name, Check.FILTERED_NOISE, "fail", "pulse 18 dB above it"),
    ]
    shot = replace(virtual.shot, quality=(*virtual.shot.quality, *failed))
    reasons = reasons_against(FiredShot(shot, virtual.rig), route_of(found), found.chosen.trace, found.constancy)
    assert reasons == tuple(f"quality: {check.channel}: {check.detail}" for check in failed)
    assert against_this_shot(reasons, virtual.rig) == reasons[1:]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_papers_regression_is_not_valid_where_the_report_calls_it_biased(name: str) -> None:
    virtual = virtual_shot(name)
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="paper"))
    assert found.endogeneity is not None
    assert found.endogeneity.biased
    assert not found.valid
    (reason,) = [one for one in found.reasons if one.code is ReasonCode.METHOD]
    assert reason.about == "paper"
    assert str(found.endogeneity) in reason
    # the shot's part in a campaign is of another method
    assert against_this_shot([reason], virtual.rig) == ()
    assert identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="forward")).valid


def test_a_plain_regression_is_not_valid_where_its_bracket_is_wide() -> None:
    found = identified()
    estimates = {name: result.estimate for name, result in found.results.items()}
    u_kg = estimates["forward"].u_kg
    for share, count in ((0.05, 0), (0.2, 1)):
        low = replace(estimates["forward"], mass_kg=estimates["reverse"].mass_kg - share * u_kg)
        route = replace(route_of(found, estimates={**estimates, "forward": low}), method="forward")
        reasons = reasons_against(
            FiredShot(virtual_shot().shot, virtual_shot().rig), route, found.chosen.trace, found.constancy
        )
        assert [one.about for one in reasons if one.code is ReasonCode.METHOD] == ["forward"] * count


def test_a_doubt_decides_by_the_mass_that_it_would_give() -> None:
    found = identified()
    calibration = found.route.calibration
    low, high = calibration.estimate.interval_kg
    rows = {row.source: row.u_kg for row in calibration.estimate.budget}

    def doubted(source: str, moves_kg: float) -> Calibration:
        """Let one source be so far off that forgetting it moves the mass by so much."""
        at = calibration.inferred.sources.index(source)
        w = 5.0
        residuals, pulls = (
            np.array(a) for a in (calibration.inferred.normalised_residuals, calibration.inferred.pulls)
        )
        residuals[:], residuals[at], pulls[at] = 0.0, w, w * w * rows[source] / moves_kg
        return replace(calibration, inferred=replace(calibration.inferred, normalised_residuals=residuals, pulls=pulls))

    half = 0.5 * (high - low)
    assert BRAKE_DELAY in rows
    for moves_kg, told in ((0.9 * half, False), (1.1 * half, True)):
        reasons, _ = said_of(calibration=doubted(BRAKE_DELAY, moves_kg))
        assert [one.about for one in reasons] == [BRAKE_DELAY] * told
        notes = notes_on_doubts(doubted(BRAKE_DELAY, moves_kg), None)
        assert len(notes) == (not told)
        assert all(note.endswith("which its interval holds") for note in notes)
    # what a certificate states is a reason whatever it does
    reasons, _ = said_of(calibration=doubted(GAUGES[0], 0.1 * half))
    assert [(one.code, one.about) for one in reasons] == [(ReasonCode.SENSOR, GAUGES[0])]


def test_a_change_that_the_interval_holds_is_a_note() -> None:
    found = identified()
    constancy, estimate = found.constancy, found.route.calibration.estimate
    assert constancy is not None
    kg, half = estimate.mass_kg, 0.5 * (estimate.interval_kg[1] - estimate.interval_kg[0])
    for off_kg, told in ((0.5 * half, False), (3 * half, True)):
        change = replace(
            constancy, ln_bayes_factor=5.0, normalised_step=9.0, before_kg=kg + off_kg, after_kg=kg, sensor_residual=0.0
        )
        assert change.constant is False
        reasons = reasons_against(
            FiredShot(virtual_shot().shot, virtual_shot().rig), route_of(found), found.chosen.trace, change
        )
        assert [one.code for one in reasons] == [ReasonCode.CONSTANCY] * told
        assert len(notes_on_doubts(found.route.calibration, change)) == (not told)
