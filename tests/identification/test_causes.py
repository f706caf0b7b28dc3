"""What else may be wrong costs the mass what moving it and estimating anew gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.calibration import Beside, Calibration, calibrated_mass
from recoil_identification.camera_rows import OTHER, OTHER_ZERO, CameraRows, camera_rows
from recoil_identification.causes import MOVES_S, SKEW, moving_zero, zero_moves
from recoil_identification.identified import Identification
from recoil_identification.late_readings import late_readings
from recoil_identification.mass import ACCELERATION, FRICTION, GAUGES
from recoil_identification.preparation import Prepared, prepare
from recoil_identification.sensor_priors import CAMERA_SCALE, DISTORTIONS, ZERO
from recoil_processing.shot.camera_motion import recorded_motion
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.assumptions import AREAS
from tests.builders.virtual_shots import identified, virtual_shot

RIGS = ["field-2013", "mixed"]
MOVING = 0.001
"""Share of their ranges by which the gauges' zeros move."""
SIGN = (1.0, -1.0, -1.0)
Change = Callable[[Regression, float], Regression]


def late(regression: Regression, column: np.ndarray, by_s: float) -> np.ndarray:
    return np.interp(regression.times_s - by_s, regression.times_s, column)


def changes(name: str) -> dict[str, Change]:
    """What each source does to the columns as recorded, by one of its own standard uncertainty times a factor."""
    virtual, found = virtual_shot(name, u_zero_rel=MOVING), identified(name, u_zero_rel=MOVING)
    u = {row.source: row.u_source for row in found.calibration.estimate.budget}
    made: dict[str, Change] = {}

    def of_force(column: int, change: Callable[[Regression], np.ndarray]) -> Change:
        def changed(recorded: Regression, factor: float) -> Regression:
            forces = recorded.forces_n.copy()
            forces[:, column] += factor * change(recorded)
            return replace(recorded, forces_n=forces)

        return changed

    def shifted(columns: list[int], acceleration: bool, by_s: float) -> Change:
        def changed(recorded: Regression, factor: float) -> Regression:
            forces = recorded.forces_n.copy()
            for column in columns:
                forces[:, column] = late(recorded, forces[:, column], factor * by_s)
            moved = late(recorded, recorded.acceleration_m_s2, factor * by_s)
            return replace(
                recorded, forces_n=forces, acceleration_m_s2=moved if acceleration else recorded.acceleration_m_s2
            )

        return changed

    for column, (role, area) in enumerate(zip(PRESSURE_ROLES, AREAS, strict=True)):
        scale = np.expm1(u[GAUGES[column]])
        made[GAUGES[column]] = of_force(column, lambda r, c=column, s=scale: s * r.forces_n[:, c])
        if (source := f"{role} zero") in u:
            newtons = SIGN[column] * getattr(virtual.rig.mechanism, area) * u[source]
            made[source] = of_force(column, lambda r, n=newtons: n * r.released)
        if role != "breech_pressure":  # whose own late readings would move, too
            for tau, move in zip(
                MOVES_S, zero_moves(found.recorded.times_s, found.recorded.interval_s[0]).T, strict=True
            ):
                source = moving_zero(role, tau)
                newtons = SIGN[column] * virtual.rig.mechanism.force_areas[column] * u[source]
                made[source] = of_force(column, lambda _, n=newtons, m=move: n * m)
    made[FRICTION] = of_force(3, lambda r, n=u[FRICTION]: n * r.friction_direction)
    clocks = {role: virtual.shot.by_role(role).time_base.clock for role in (*PRESSURE_ROLES, "recoil_acceleration")}
    for source, u_s in u.items():
        if source.startswith("alignment of clock"):
            clock = source.rpartition(" ")[2]
            columns = [i for i, role in enumerate(PRESSURE_ROLES) if clocks[role] == clock]
            made[source] = shifted(columns, clocks["recoil_acceleration"] == clock, u_s)
    made[SKEW] = shifted([], True, u[SKEW])

    def of_acceleration(change: Callable[[Regression], np.ndarray]) -> Change:
        return lambda r, factor: replace(r, acceleration_m_s2=r.acceleration_m_s2 + factor * change(r))

    made[ACCELERATION] = of_acceleration(lambda r: np.expm1(u[ACCELERATION]) * r.acceleration_m_s2)
    made[ZERO] = of_acceleration(lambda r: u[ZERO] * r.released)
    return made


@cache
def prepared(name: str) -> Prepared:
    virtual = virtual_shot(name, u_zero_rel=MOVING)
    return prepare(virtual.shot, virtual.rig)


def frames(found: Identification, name: str, recorded: Regression) -> CameraRows:
    """Take the camera's frames anew, with an accelerometer that reads what is recorded now."""
    before = prepared(name)
    moved = recorded.acceleration_m_s2 - found.recorded.acceleration_m_s2
    track = recorded_motion(found.signals, before.acceleration_m_s2 + moved, found.camera, before.camera_clock)
    was = found.calibration.camera
    assert track is not None
    assert isinstance(was, CameraRows)
    rows = camera_rows(
        track,
        recorded.filtered(found.mass_low_pass),
        recorded,
        before.inertial_m_s2 + moved,
        found.calibration.block.causes,
        before.signals,
        virtual_shot(name, u_zero_rel=MOVING).rig,
    )
    assert rows is not None
    return replace(rows, density=was.density)


def refitted_kg(
    found: Identification, name: str, recorded: Regression, camera: CameraRows, late_pa: float = 0.0
) -> float:
    """Estimate anew, the breech gauge reading so much more once the bore is empty."""
    calibration = found.calibration
    late = late_readings(found.signals, found.fitted.interval_s, calibration.block.causes)
    assert late is not None
    rows = replace(late.rows, recorded=late.rows.recorded + late_pa)
    again = calibrated_mass(
        recorded.filtered(found.mass_low_pass),
        scale_uncertainty(virtual_shot(name, u_zero_rel=MOVING).rig),
        found.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(calibration.block.causes, camera, (rows,), (late.prior,)),
    )
    return again.estimate.mass_kg


@pytest.mark.parametrize("name", RIGS)
def test_every_row_is_what_moving_its_source_and_estimating_anew_gives(name: str) -> None:
    found = identified(name, u_zero_rel=MOVING)
    estimate = found.calibration.estimate
    rows = {row.source: row for row in estimate.budget}
    made = changes(name)
    assert {"breech_pressure zero", "brake_pressure zero", SKEW} <= made.keys()
    for source, change in made.items():
        row = rows[source]
        late_pa = row.u_source if source == "breech_pressure zero" else 0.0
        moved = [change(found.recorded, sign) for sign in (1.0, -1.0)]
        up, down = (
            refitted_kg(found, name, one, frames(found, name, one), sign * late_pa)
            for one, sign in zip(moved, (1.0, -1.0), strict=True)
        )
        assert row.sensitivity is not None
        assert row.sensitivity * row.u_source == pytest.approx((up - down) / 2, abs=0.02 * estimate.u_kg), source


@pytest.mark.parametrize("name", RIGS)
def test_every_row_of_the_camera_is_what_moving_its_frames_and_estimating_anew_gives(name: str) -> None:
    found = identified(name, u_zero_rel=MOVING)
    estimate, camera = found.calibration.estimate, frames(found, name, found.recorded)
    rows = {row.source: row for row in estimate.budget}
    moves: dict[str, Callable[[float], CameraRows]] = {
        CAMERA_SCALE: lambda by: replace(camera, recorded_m=(1.0 + by) * camera.recorded_m),
        OTHER.name: lambda by: replace(camera, other_m=(1.0 + by) * camera.other_m),
        OTHER_ZERO.name: lambda by: replace(camera, other_m=camera.other_m + by * camera.free_m),
        **{
            source: lambda by, number=number: replace(
                camera, recorded_m=camera.recorded_m + by * camera.bends[:, number]
            )
            for number, source in enumerate(DISTORTIONS)
        },
    }
    for source, move in moves.items():
        row = rows[source]
        up, down = (refitted_kg(found, name, found.recorded, move(sign * row.u_source)) for sign in (1.0, -1.0))
        assert row.sensitivity is not None
        assert row.sensitivity * row.u_source == pytest.approx((up - down) / 2, abs=0.02 * estimate.u_kg), source


def without_causes(calibration: Calibration) -> CameraRows:
    """Return the frames that know of nothing that may be wrong in what the accelerometer reads."""
    camera = calibration.camera
    assert isinstance(camera, CameraRows)
    return replace(camera, zeros_m=np.zeros((camera.times_s.size, 0)), sizes=())


@pytest.mark.parametrize("name", RIGS)
def test_causes_hardly_move_a_sound_shot_and_are_in_its_uncertainty(name: str) -> None:
    found = identified(name, gain_errors=False, u_zero_rel=MOVING)
    calibration = found.calibration
    bare = calibrated_mass(
        found.fitted,
        scale_uncertainty(virtual_shot(name, u_zero_rel=MOVING).rig),
        found.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(camera=without_causes(calibration)),
    )
    with_causes = calibration.estimate
    assert abs(with_causes.mass_kg - bare.estimate.mass_kg) < 0.3 * with_causes.u_kg
    assert with_causes.u_kg > bare.estimate.u_kg
    assert all(abs(calibration.normalised_residuals[cause.source]) < 3.29 for cause in calibration.block.causes)


def test_without_them_zeros_that_move_would_be_in_the_mass() -> None:
    found, truth = identified("mixed", u_zero_rel=MOVING), virtual_shot("mixed", u_zero_rel=MOVING).truth["m3"]
    calibration = found.calibration
    bare = calibrated_mass(
        found.fitted,
        scale_uncertainty(virtual_shot("mixed", u_zero_rel=MOVING).rig),
        found.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(camera=without_causes(calibration)),
    )
    assert abs(bare.estimate.mass_kg - truth) > 4.0
    assert abs(calibration.estimate.mass_kg - truth) < 1.0
