"""What else may be wrong costs the mass what moving it and estimating anew gives."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Beside, calibrated_mass
from recoil_identification.estimate.budget import combined_u
from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows.camera_rows import OTHER, OTHER_ZERO, CameraRows, camera_rows
from recoil_identification.rows.causes import (
    DISTORTIONS,
    SKEW,
    Cause,
    carriage_part_causes,
    causes_of,
    moving_zero,
)
from recoil_identification.rows.late_readings import GAS, late_readings
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE, ZERO
from recoil_identification.rows.unread_resistance import FORCE, SHARE, SLIDE, force_shapes, shape_of_force
from recoil_identification.shot.identified import Identification
from recoil_identification.shot.preparation import Prepared, prepare
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.shot.camera_motion import recorded_motion
from recoil_processing.shot.error_source import ErrorSource, SourceGroup, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, zero_moves
from recoil_processing.shot.kinematics import angular_motion, seen_acceleration
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression
from recoil_processing.shot.sensor_scales import BORE_FRICTION, scale_uncertainty
from recoil_processing.shot.signals import Offset, Signals
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.force_input import AREAS
from tests.builders.bench_shots import (
    BORE_M2,
    BRAKE_M2,
    FIRE_S,
    RECUPERATOR_M2,
    bench_regression,
    bench_rig,
    bench_shot,
    bench_signals,
)
from tests.builders.virtual_shots import identified, virtual_shot

BRAKE_DELAY = ErrorSource(SourceKind.DELAY, "brake_pressure")
RECUPERATOR_DELAY = ErrorSource(SourceKind.LINE, "recuperator_pressure")

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
    u = {row.source: row.u_source for row in found.route.calibration.estimate.budget}
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
        moves = zero_moves(found.route.recorded.times_s, found.route.recorded.interval_s[0])
        for tau, move in zip(MOVES_S, moves.T, strict=True):
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
    made[BRAKE_DELAY] = shifted([1], False, u[BRAKE_DELAY])

    def of_acceleration(change: Callable[[Regression], np.ndarray]) -> Change:
        return lambda r, factor: replace(r, acceleration_m_s2=r.acceleration_m_s2 + factor * change(r))

    made[ACCELERATION] = of_acceleration(lambda r: np.expm1(u[ACCELERATION]) * r.acceleration_m_s2)
    made[ZERO] = of_acceleration(lambda r: u[ZERO] * r.released)
    # what is expected of the stop is no reading: too low, as a reading that is too high leaves the truth
    push_n_s = u[RELEASE] * found.route.calibration.m0_kg
    made[RELEASE] = lambda r, factor: replace(r, release_n_s=r.release_n_s - factor * push_n_s)
    made[GAS.name] = lambda r, _: r
    return made


@cache
def prepared(name: str) -> Prepared:
    virtual = virtual_shot(name, u_zero_rel=MOVING)
    return prepare(FiredShot(virtual.shot, virtual.rig))


def frames(found: Identification, name: str, recorded: Regression) -> CameraRows:
    """Take the camera's frames anew, with an accelerometer that reads what is recorded now."""
    before = prepared(name)
    moved = recorded.acceleration_m_s2 - found.route.recorded.acceleration_m_s2
    track = recorded_motion(
        found.route.signals, before.acceleration_m_s2 + moved, found.route.camera, before.camera_clock
    )
    was = found.route.calibration.camera
    assert track is not None
    assert isinstance(was, CameraRows)
    rows = camera_rows(
        track,
        recorded.filtered(found.route.mass_low_pass),
        recorded,
        before.inertial_m_s2 + moved,
        found.route.calibration.block.causes,
        before.signals,
        virtual_shot(name, u_zero_rel=MOVING).rig,
    )
    assert rows is not None
    return replace(rows, density=was.density)


def refitted_kg(
    found: Identification, name: str, recorded: Regression, camera: CameraRows, off: tuple[str, float] = ("", 0.0)
) -> float:
    """Estimate anew; a source that is off by so much is in what the breech gauge reads once the bore is empty, too."""
    calibration = found.route.calibration
    late = late_readings(found.route.signals, found.route.fitted.interval_s, calibration.block.causes)
    assert late is not None
    shapes = dict(zip(late.rows.unknowns, late.rows.columns.T, strict=True))
    rows = replace(late.rows, recorded=late.rows.recorded + off[1] * shapes.get(off[0], 0.0))
    again = calibrated_mass(
        recorded.filtered(found.route.mass_low_pass),
        scale_uncertainty(virtual_shot(name, u_zero_rel=MOVING).rig),
        found.route.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(calibration.block.causes, camera, (rows,), (late.prior,)),
    )
    return again.estimate.mass_kg


def rows_and_refits_kg(name: str) -> dict[str, tuple[float, float]]:
    """Return what rows of the budget say, and half the difference of two masses with their source moved either way."""
    found, pairs = identified(name, u_zero_rel=MOVING), {}
    rows = {row.source: row for row in found.route.calibration.estimate.budget}
    made = changes(name)
    assert {"breech_pressure zero", "brake_pressure zero", SKEW} <= made.keys()
    for source, change in made.items():
        row = rows[source]
        moved = [change(found.route.recorded, sign) for sign in (1.0, -1.0)]
        up, down = (
            refitted_kg(found, name, one, frames(found, name, one), (source, sign * row.u_source))
            for one, sign in zip(moved, (1.0, -1.0), strict=True)
        )
        assert row.sensitivity is not None
        pairs[source] = row.sensitivity * row.u_source, (up - down) / 2
    return pairs


def rows_and_refits_of_frames_kg(name: str) -> dict[str, tuple[float, float]]:
    """Return the same of what moves the camera's frames."""
    found, pairs = identified(name, u_zero_rel=MOVING), {}
    camera = frames(found, name, found.route.recorded)
    rows = {row.source: row for row in found.route.calibration.estimate.budget}
    moves: dict[str, Callable[[float], CameraRows]] = {
        CAMERA_SCALE: lambda by: replace(camera, recorded_m=(1.0 + by) * camera.recorded_m),
        OTHER.name: lambda by: replace(camera, other_m=(1.0 + by) * camera.other_m),
        OTHER_ZERO.name: lambda by: replace(camera, other_m=camera.other_m + by * camera.free_m),
        "rate of clock camera": lambda by: replace(camera, drift=camera.drift + by),
        **{
            source: lambda by, number=number: replace(
                camera, recorded_m=camera.recorded_m + by * camera.bends[:, number]
            )
            for number, source in enumerate(DISTORTIONS)
        },
    }
    for source, move in moves.items():
        row = rows[source]
        up, down = (refitted_kg(found, name, found.route.recorded, move(sign * row.u_source)) for sign in (1.0, -1.0))
        assert row.sensitivity is not None
        pairs[source] = row.sensitivity * row.u_source, (up - down) / 2
    return pairs


@pytest.mark.exhaustive
@pytest.mark.parametrize("pairs_of", [rows_and_refits_kg, rows_and_refits_of_frames_kg])
@pytest.mark.parametrize("name", RIGS)
def test_every_row_is_what_moving_its_source_and_estimating_anew_gives(name: str, pairs_of: Callable) -> None:
    u_kg = identified(name, u_zero_rel=MOVING).route.calibration.estimate.u_kg
    for source, (row, refit) in pairs_of(name).items():
        assert row == pytest.approx(refit, abs=0.02 * u_kg), source


UNREAD = {"kind": False, "unread_errors": False, "mechanism": (("slide_friction", 0.0), ("u_slide_friction", 20.0))}
"""Settings of a shot whose rig takes what is usual of forces that no gauge reads, and slides that hold besides."""


def unread(recorded: Regression, found: Identification) -> dict[str, np.ndarray]:
    """Write down what an error of one standard uncertainty of each source adds to the readings of forces, N."""
    inside, forces = recorded.inside, np.nan_to_num(recorded.forces_n)
    u = {row.source: row.u_source for row in found.route.calibration.estimate.budget}
    velocity = np.cumsum(inside * np.nan_to_num(recorded.acceleration_m_s2)) * recorded.step_s
    travel = np.cumsum(inside * velocity) * recorded.step_s
    share = np.clip(travel / travel.max(), 0.0, 1.0)
    resistance = found.route.fitted.forces_n[found.route.fitted.inside, 1:].sum(axis=1)
    size = 0.002 * np.abs(resistance).max() * (1.0 - np.exp(-100.0 * share)) * inside
    # more is held than is read: what is read is too little, the other way round for what pushes
    made = {
        SHARE: -u[SHARE] * forces * (inside[:, np.newaxis] * [0.0, 1.0, 1.0, 0.0]),
        SLIDE: np.outer(u[SLIDE] * inside * velocity, [0.0, 1.0, 0.0, 0.0]),
        BORE_FRICTION: np.expm1(u[BORE_FRICTION]) * forces * [1.0, 0.0, 0.0, 0.0],
    }
    if RECUPERATOR_DELAY in u:  # alone on no clock of its own
        # a record that is late shows what was before; the instant of the release is none of it
        released = int(np.argmax(recorded.released > 0))
        held = np.where(np.arange(len(forces)) < released, forces[released, 2], forces[:, 2])
        change = late(recorded, held, u[RECUPERATOR_DELAY]) - late(recorded, held, -u[RECUPERATOR_DELAY])
        made[RECUPERATOR_DELAY] = np.outer(0.5 * recorded.released * change, [0.0, 0.0, 1.0, 0.0])
    for number, shape in enumerate(force_shapes().T):
        over_travel = size * np.interp(share, np.linspace(0.0, 1.0, shape.size), shape)
        made[shape_of_force(number)] = np.outer(over_travel, [0.0, 1.0, 0.0, 0.0])
    return made


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", RIGS)
def test_a_row_of_what_no_gauge_reads_is_what_moving_it_and_estimating_anew_gives(name: str) -> None:
    virtual, found = virtual_shot(name, **UNREAD), identified(name, **UNREAD)
    calibration, recorded = found.route.calibration, found.route.recorded
    inferred, estimate = calibration.inferred, calibration.estimate

    def anew_kg(moved: Regression) -> float:
        again = calibrated_mass(
            moved.filtered(found.route.mass_low_pass),
            scale_uncertainty(virtual.rig),
            found.route.signals.offsets["recoil_acceleration"].u,
            noise=calibration.noise,
            beside=Beside(calibration.block.causes, calibration.camera, calibration.further, gauges_own(calibration)),
        )
        return again.estimate.mass_kg

    def gauges_own(one: Calibration) -> tuple[Prior, ...]:
        of_causes = {cause.source for cause in one.block.causes}
        return tuple(p for p in one.own if p.sources[0] == GAS.name and p.sources[0] not in of_causes)

    assert anew_kg(recorded) == pytest.approx(estimate.mass_kg, rel=1e-9)
    made = unread(recorded, found)
    for source, added_n in made.items():
        up, down = (anew_kg(replace(recorded, forces_n=recorded.forces_n + sign * added_n)) for sign in (1.0, -1.0))
        row_kg = -estimate.mass_kg * inferred.contribution(source, "ln mass")
        assert row_kg == pytest.approx((up - down) / 2, abs=0.025 * estimate.u_kg), source
    rows = {row.source: row for row in estimate.budget}
    shapes = [inferred.contribution(shape_of_force(n), "ln mass") for n in range(force_shapes().shape[1])]
    assert rows[FORCE].u_kg == pytest.approx(estimate.mass_kg * np.linalg.norm(shapes), rel=1e-9)
    # groups of sources add up to the whole
    groups = {row.group for row in estimate.budget}
    parts = [combined_u([row for row in estimate.budget if row.group == group]) for group in groups]
    assert np.linalg.norm(parts) == pytest.approx(estimate.u_kg, rel=1e-9)
    assert SourceGroup.UNREAD_FORCES in groups


def without_causes(calibration: Calibration) -> CameraRows:
    """Return the frames that know of nothing that may be wrong in what the accelerometer reads."""
    camera = calibration.camera
    assert isinstance(camera, CameraRows)
    return replace(camera, zeros_m=np.zeros((camera.times_s.size, 0)), sizes=())


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", RIGS)
def test_causes_hardly_move_a_sound_shot_and_are_in_its_uncertainty(name: str) -> None:
    found = identified(name, gain_errors=False, u_zero_rel=MOVING)
    calibration = found.route.calibration
    bare = calibrated_mass(
        found.route.fitted,
        scale_uncertainty(virtual_shot(name, u_zero_rel=MOVING).rig),
        found.route.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(camera=without_causes(calibration)),
    )
    with_causes = calibration.estimate
    assert abs(with_causes.mass_kg - bare.estimate.mass_kg) < 0.3 * with_causes.u_kg
    assert with_causes.u_kg > bare.estimate.u_kg
    assert all(abs(calibration.normalised_residuals[cause.source]) < 3.29 for cause in calibration.block.causes)


def test_without_them_zeros_that_move_would_be_in_the_mass() -> None:
    found, truth = identified("mixed", u_zero_rel=MOVING), virtual_shot("mixed", u_zero_rel=MOVING).truth["m3"]
    calibration = found.route.calibration
    bare = calibrated_mass(
        found.route.fitted,
        scale_uncertainty(virtual_shot("mixed", u_zero_rel=MOVING).rig),
        found.route.signals.offsets["recoil_acceleration"].u,
        noise=calibration.noise,
        beside=Beside(camera=without_causes(calibration)),
    )
    assert abs(bare.estimate.mass_kg - truth) > 4.0
    assert abs(calibration.estimate.mass_kg - truth) < 1.5


LOW_PASS = LowPass(300.0)
BENCH_AREAS_M2 = (BORE_M2, -BRAKE_M2, -RECUPERATOR_M2)
"""Of breech, brake and recuperator, as their forces count."""


@cache
def bench() -> Regression:
    return bench_regression().filtered(LOW_PASS)


def of_bench(**changed: object) -> dict[str, Cause]:
    """Return the causes of the bench shot, with other parts of it."""
    fired = FiredShot(changed.pop("shot", bench_shot()), changed.pop("rig", bench_rig()))
    parts = {"regression": bench(), "recorded": bench_regression(), "signals": bench_signals(), "fired": fired}
    found = causes_of(**{**parts, **changed})
    named = {cause.source: cause for cause in found}
    assert len(named) == len(found)
    return named


def filtered(column: np.ndarray) -> np.ndarray:
    return LOW_PASS.apply(column, bench().rate_hz)


def test_a_zero_of_the_baseline_is_a_cause_where_it_is_known_and_not_exact() -> None:
    u_pa = {"breech_pressure": 5e3, "brake_pressure": np.inf, "recuperator_pressure": 0.0}
    signals = replace(bench_signals(), offsets={role: Offset(0.0, u, u) for role, u in u_pa.items()})
    found = of_bench(signals=signals)
    assert [source for source in found if source.endswith("pressure zero")] == ["breech_pressure zero"]
    zero = found["breech_pressure zero"]
    assert (zero.u, zero.unit, zero.kind) == (5e3, "Pa", "A")
    np.testing.assert_allclose(zero.forces_n, np.outer(-BORE_M2 * bench().released, [1.0, 0.0, 0.0]))
    assert not zero.acceleration_m_s2.any()


@pytest.mark.parametrize("column", range(3))
def test_a_zero_that_moves_takes_its_shape_off_the_force_of_its_gauge(column: int) -> None:
    role = PRESSURE_ROLES[column]
    found = of_bench()
    largest_pa = np.abs(bench_signals().series[role]).max()
    since = np.maximum(bench().times_s - FIRE_S, 0.0)
    at_once, slowly, later = (1.0 - np.exp(-since / tau_s) for tau_s in (2e-3, 30e-3, 0.3))
    for tau_s, way in ((2e-3, at_once), (30e-3, slowly), (0.3, at_once - later)):
        cause = found[f"{role} zero that moves in {1e3 * tau_s:g} ms"]
        # where no range is declared, a thousandth of what it reads
        assert (cause.u, cause.unit, cause.kind) == (pytest.approx(1e-3 * largest_pa), "Pa", "B")
        expected = np.zeros((since.size, 3))
        expected[:, column] = -BENCH_AREAS_M2[column] * filtered(way / math.sqrt(3.0))
        np.testing.assert_allclose(cause.forces_n, expected, atol=1e-6)


def test_of_two_gauges_the_mean_moves_by_less_and_is_late_by_the_share_that_is_on_a_late_clock() -> None:
    rig = bench_rig(p_brake="range = [0, 4e7]")
    second = rig.channel("p_brake").model_copy(update={"name": "p_brake_2", "signal": "p_brake_2"})
    shot = bench_shot()
    late = replace(
        shot.channels["p_brake"], name="p_brake_2", time_base=TimeBase.uniform("late", 0.0, 5e-5, bench().times_s.size)
    )
    shot = replace(
        shot,
        channels={**shot.channels, "p_brake_2": late},
        alignments=(ClockAlignment("late", 0.0, 2e-5, 0.0, 0.0, "ok", "fixed"),),
    )
    found = of_bench(shot=shot, rig=replace(rig, channels=(*rig.channels, second)))
    assert found[moving_zero("brake_pressure", 2e-3)].u == pytest.approx(4e4 / np.sqrt(2))
    clock = found["alignment of clock late"]
    assert (clock.u, clock.unit, clock.kind) == (2e-5, "s", "B")
    slope_n_s = np.gradient(bench().forces_n[:, 1], bench().times_s)
    np.testing.assert_allclose(clock.forces_n, np.outer(0.5 * slope_n_s, [0.0, 1.0, 0.0]), rtol=1e-6, atol=1e-3)
    assert not clock.acceleration_m_s2.any()


@pytest.mark.parametrize(("u_s", "counts"), [(2e-5, True), (0.0, False), (np.inf, False)])
def test_a_clock_of_the_acceleration_moves_it_and_one_that_is_exact_or_unknown_is_no_cause(
    u_s: float, counts: bool
) -> None:
    shot = bench_shot()
    late = replace(shot.channels["acc"], time_base=TimeBase.uniform("late", 0.0, 5e-5, bench().times_s.size))
    shot = replace(
        shot,
        channels={**shot.channels, "acc": late},
        alignments=(ClockAlignment("late", 0.0, u_s, 0.0, 0.0, "ok", "fixed"),),
    )
    found = of_bench(shot=shot)
    jerk_m_s3 = np.gradient(bench().acceleration_m_s2, bench().times_s)
    assert [source for source in found if source.startswith("alignment")] == ["alignment of clock late"] * counts
    for cause in (*(found[source] for source in ("alignment of clock late",) if counts), found[SKEW]):
        np.testing.assert_allclose(cause.acceleration_m_s2, -jerk_m_s3, rtol=1e-6, atol=1e-3)
        assert not cause.forces_n.any()
    assert (found[SKEW].u, found[SKEW].unit) == (5e-5, "s")


@pytest.mark.parametrize(("declared", "u_s"), [({}, 2e-5), ({"p_brake": "delay_s = 1e-3, u_delay_s = 3e-4"}, 3e-4)])
def test_the_brakes_gauge_may_be_late_by_what_is_declared_of_it(declared: dict[str, str], u_s: float) -> None:
    cause = of_bench(rig=bench_rig(**declared))[BRAKE_DELAY]
    assert (cause.u, cause.unit, cause.kind) == (u_s, "s", "B")
    slope_n_s = np.gradient(bench().forces_n[:, 1], bench().times_s)
    np.testing.assert_allclose(cause.forces_n, np.outer(slope_n_s, [0.0, 1.0, 0.0]), rtol=1e-6, atol=1e-3)
    assert not cause.acceleration_m_s2.any()


@pytest.mark.parametrize(("name", "u_skew_s", "u_first_s"), [("p_breech", 5e-5, 3e-4), ("acc", 3.0414e-4, None)])
def test_skew_and_the_first_forces_delay_are_as_uncertain_as_is_declared(
    name: str, u_skew_s: float, u_first_s: float | None
) -> None:
    declared = bench_rig(**{name: "delay_s = 1e-3, u_delay_s = 3e-4"})
    found = of_bench(rig=declared)
    assert found[SKEW].u == pytest.approx(u_skew_s, rel=1e-4)
    first = found.get(ErrorSource(SourceKind.DELAY, "breech_pressure"))
    assert (first and first.u) == u_first_s
    shot = bench_shot()
    base = TimeBase.uniform("late", 0.0, 5e-5, bench().times_s.size)
    shot = replace(
        shot,
        channels={**shot.channels, name: replace(shot.channels[name], time_base=base)},
        alignments=(ClockAlignment("late", 0.0, 2e-5, 0.0, 0.0, "ok", "fixed"),),
    )
    # alone on a clock of its own, whose alignment knows the delay
    assert of_bench(rig=declared, shot=shot)[SKEW].u == 5e-5


@pytest.mark.whole_way
@pytest.mark.parametrize("role", ["carriage_acceleration_x", "tipping_rate"])
def test_a_carriages_sensor_that_is_late_adds_what_its_late_reading_would(role: str) -> None:
    virtual = virtual_shot("field-2013")
    channel, late_s = virtual.shot.by_role(role).name, 1e-3
    text = re.sub(
        rf'(name = "{channel}"\n.*?sensor = {{)', rf"\1 u_delay_s = {late_s},", virtual.rig.text, flags=re.DOTALL
    )
    fired = FiredShot(virtual.shot, parse_rig(text, virtual.rig.path))
    known = prepare(fired)
    (cause,) = carriage_part_causes(known.recorded, known.signals, fired)
    assert (cause.source, cause.u, cause.scope) == (ErrorSource(SourceKind.DELAY, role), late_s, "rig")

    def travel_m(signals: Signals) -> np.ndarray:
        seen = seen_acceleration(signals, fired.rig, angular_motion(signals, fired.rig))
        return integrate(integrate(known.recorded.released * seen, signals.step_s), signals.step_s)

    signals = known.signals
    reading = np.roll(bridge(signals.series[role]), round(late_s / signals.step_s))
    late = travel_m(replace(signals, series={**signals.series, role: reading}))
    added = late_s * integrate(integrate(cause.travel_m_s2, signals.step_s), signals.step_s)
    expected = (late - travel_m(signals))[known.recorded.inside]
    assert np.abs(expected).max() > 1e-6
    np.testing.assert_allclose(added[known.recorded.inside], expected, atol=0.1 * np.abs(expected).max())


@pytest.mark.parametrize(("late", "counts"), [(("p_brake",), False), (("p_brake", "p_recuperator"), True)])
def test_a_brake_gauge_that_is_alone_on_its_clock_is_late_with_it(late: tuple[str, ...], counts: bool) -> None:
    shot = bench_shot()
    base = TimeBase.uniform("late", 0.0, 5e-5, bench().times_s.size)
    shot = replace(
        shot,
        channels={**shot.channels, **{name: replace(shot.channels[name], time_base=base) for name in late}},
        alignments=(ClockAlignment("late", 0.0, 2e-5, 0.0, 0.0, "ok", "fixed"),),
    )
    found = of_bench(shot=shot)
    assert "alignment of clock late" in found
    assert (BRAKE_DELAY in found) == counts


def test_what_a_repair_may_have_left_is_a_cause_of_the_force_or_of_the_motion() -> None:
    left = np.linspace(0.0, 1e5, bench().times_s.size)
    roles = ("brake_pressure", "recoil_acceleration", "carriage_rate")
    repairs = {ErrorSource(SourceKind.REPAIR, role, "droop"): left for role in roles}
    found = of_bench(signals=replace(bench_signals(), left=repairs))
    force, motion = found["brake_pressure droop"], found["recoil_acceleration droop"]
    assert (force.u, force.unit, force.kind) == (motion.u, motion.unit, motion.kind) == (1.0, "1", "B")
    error = left * bench().released
    np.testing.assert_allclose(force.forces_n, np.outer(BRAKE_M2 * error, [0.0, 1.0, 0.0]))
    np.testing.assert_allclose(motion.acceleration_m_s2, error)
    assert not force.acceleration_m_s2.any()
    assert not motion.forces_n.any()
    assert "carriage_rate droop" not in found


def test_the_four_longest_stretches_of_lost_samples_are_causes_in_order_of_time() -> None:
    recorded = bench_regression()
    trusted = np.ones(recorded.times_s.size, dtype=bool)
    first = round(FIRE_S / recorded.step_s)
    lost = {first + 200: 1, first + 400: 5, first + 600: 3, first + 800: 2, first + 1000: 8, first + 1200: 4}
    # before the onset nothing is lost that counts
    for at, count in {first - 100: 20, **lost}.items():
        trusted[at : at + count] = False
    recorded = replace(recorded, trusted=trusted)
    found = of_bench(recorded=recorded)
    stretches = [source for source in found if source.startswith("samples lost")]
    assert stretches == [f"samples lost at {at}.0 ms" for at in (20, 30, 50, 60)]
    largest = np.abs(bench().acceleration_m_s2[bench().inside]).max()
    for source, at in zip(stretches, (400, 600, 1000, 1200), strict=True):
        cause = found[source]
        assert (cause.u, cause.unit, cause.kind) == (pytest.approx(0.3 * largest), "m/s^2", "B")
        box = np.zeros(trusted.size)
        box[first + at : first + at + lost[first + at]] = 1.0
        np.testing.assert_allclose(cause.acceleration_m_s2, filtered(box), atol=1e-9)
        assert not cause.forces_n.any()
    # without a filter nothing of a bridge is carried into the rows that count
    assert not any(source.startswith("samples lost") for source in of_bench(regression=recorded, recorded=recorded))


def test_a_pressure_that_was_not_recorded_has_no_zero_that_moves() -> None:
    role = "recuperator_pressure"
    signals = bench_signals()
    series = {other: samples for other, samples in signals.series.items() if other != role}
    for changed in (
        {"signals": replace(signals, series=series)},
        {"rig": bench_rig().without_channel("p_recuperator")},
    ):
        assert not any(source.startswith(role) for source in of_bench(**changed))


def test_zeros_of_a_shot_without_a_filter_move_as_they_are() -> None:
    found = of_bench(regression=bench_regression())
    since = np.maximum(bench().times_s - FIRE_S, 0.0)
    cause = found[moving_zero("breech_pressure", 0.03)]
    np.testing.assert_allclose(cause.forces_n[:, 0], BORE_M2 * np.expm1(-since / 0.03) / math.sqrt(3.0), atol=1e-12)
