"""The mass of a shot by another program: dense least squares from the mechanism's equation alone.

Nothing of the identification is used but the filtered rows, the recorded travel and accelerations, the covariance of
their errors at rest, the sizes of what the motion adds and what is known of the sensors. With
``m a' = P - R`` and ``R`` the sum of brake, recuperator and friction, the accelerometer's reading is written down
again, its derivatives are taken by complex steps (W. Squire, G. Trapp, SIAM Review 40(1), 1998), and all but
the mass is folded into one covariance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.rows.row_noise import by_filter, rest_covariance
from recoil_identification.shot.preparation import prepare
from recoil_processing.double_integral import integrate
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot

STEP = 1e-30


def reading(x: np.ndarray, breech: np.ndarray, brake: np.ndarray, recuperator: np.ndarray, friction: np.ndarray,
            direction: np.ndarray, free: np.ndarray, let_go: np.ndarray, forces: np.ndarray, jerks: np.ndarray,
            m0: float) -> np.ndarray:  # fmt: skip
    """Return what an accelerometer reads: its scale times P - R over the mass, and what is added to that."""
    mass, p, k, r, df, scale, zero, velocity, *sizes = x
    wrong = forces @ np.array(sizes)
    breech, brake, recuperator = (
        (read + off) * np.exp(-scale)
        for read, off, scale in zip((breech, brake, recuperator), wrong.T, (p, k, r), strict=True)
    )
    force = breech + brake + recuperator + friction - df * direction
    return np.exp(scale) * force / (m0 * np.exp(mass)) + zero * free + velocity * let_go + jerks @ np.array(sizes)


def seen_by_camera(x: np.ndarray, felt: np.ndarray, other: np.ndarray, free: np.ndarray, wrong: np.ndarray,
                   speed: np.ndarray, slower: np.ndarray, bends: np.ndarray) -> np.ndarray:  # fmt: skip
    """Return where a camera sees the part: double integrals, each with its scale and zero, and the picture's bends."""
    scale, zero, *sizes = x[5], x[6], *x[8 : 8 + wrong.shape[1]]
    camera, share, tilt, place, late, rate, *bent = x[8 + wrong.shape[1] :]
    true = np.exp(-scale) * (felt - zero * free - wrong @ np.array(sizes)) + (1.0 - share) * other - tilt * free
    return np.exp(camera) * true + place + late * speed + rate * slower + bends @ np.array(bent)


def second_opinion(
    series: tuple[np.ndarray, ...],
    frames: tuple[np.ndarray, ...],
    seen: np.ndarray,
    m0: float,
    covariance: np.ndarray,
    known: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> tuple[float, float]:
    """Return the mass and its standard uncertainty, all that is known of the rest folded into one covariance.

    Known are rows, values and covariances of what is known; together they determine all but the mass.
    """
    n = known[0][0].shape[1]

    def model(x: np.ndarray) -> np.ndarray:
        return np.concatenate([reading(x[: 8 + series[-1].shape[-1]], *series, m0), seen_by_camera(x, *frames)])

    information, right = np.zeros((n - 1, n - 1)), np.zeros(n - 1)
    for rows, values, own in known:
        information += rows[:, 1:].T @ np.linalg.solve(own, rows[:, 1:])
        right += rows[:, 1:].T @ np.linalg.solve(own, values)
    size = 1.0 / np.sqrt(np.diag(information))
    scaled = np.linalg.inv(information * np.outer(size, size))
    prior, expected = scaled * np.outer(size, size), size * (scaled @ (size * right))
    x = np.append(0.0, expected)
    for _ in range(30):
        slopes = np.column_stack([model(x + 1j * STEP * np.eye(n)[i]).imag / STEP for i in range(n)])
        of_mass, others = slopes[:, 0], slopes[:, 1:]
        left = seen - model(x) + of_mass * x[0] - others @ (expected - x[1:])
        folded = covariance + others @ prior @ others.T
        # rows of one size: micrometers stand beside meters per second squared
        scale = np.sqrt(np.diag(folded))
        weighted = np.linalg.solve(folded / np.outer(scale, scale), np.column_stack([of_mass, left]) / scale[:, None])
        per_mass = of_mass / scale
        information_of_mass = per_mass @ weighted[:, 0]
        x[0] = per_mass @ weighted[:, 1] / information_of_mass
        x[1:] = expected + prior @ others.T @ ((weighted[:, 1] - weighted[:, 0] * x[0]) / scale)
    mass = m0 * np.exp(x[0])
    return mass, mass / np.sqrt(information_of_mass)


def bridged(columns: np.ndarray) -> np.ndarray:
    """Draw straight lines over lost samples."""
    at, known = np.arange(len(columns)), np.isfinite(columns)
    return np.stack([np.interp(at, at[ok], one[ok]) for one, ok in zip(columns.T, known.T, strict=True)], axis=1)


def unread_columns(recorded: Regression, rows: Regression) -> list[tuple[np.ndarray, float]]:
    """Return what resists and is not read, each for a size of one, with its standard uncertainty."""
    moving, forces = recorded.inside, bridged(recorded.forces_n)
    velocity = np.maximum(
        integrate(moving * bridged(recorded.acceleration_m_s2[:, np.newaxis])[:, 0], recorded.step_s), 0.0
    )
    travel = integrate(moving * velocity, recorded.step_s)
    places = np.linspace(0.0, 1.0, 60)
    apart = np.sqrt(3.0) * np.abs(places[:, np.newaxis] - places) / 0.35
    values, vectors = np.linalg.eigh((1.0 + apart) * np.exp(-apart))
    peak = np.abs(rows.forces_n[rows.inside, 1:].sum(axis=1)).max()
    begins = -0.002 * peak * moving * np.expm1(-travel / (0.01 * travel.max()))

    def behind(column: np.ndarray) -> np.ndarray:
        return rows.low_pass.apply(column, rows.rate_hz)

    slow = replace(rows.low_pass, cutoff_hz=0.25 * rows.low_pass.cutoff_hz)
    read = (slow.apply(behind(moving * forces[:, j]), rows.rate_hz) for j in (1, 2))
    share = np.column_stack([np.zeros(moving.size), *read])
    found = [(share, 0.01)]
    for value, vector in zip(values, vectors.T, strict=True):
        if value > 1e-3 * values.max():
            shape = np.interp(travel / travel.max(), places, np.sqrt(value) * vector)
            found.append((np.outer(behind(begins * shape), [0.0, 1.0, 0.0]), 1.0))
    return found


def in_motion(rows: Regression, at: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return what the motion adds to the covariance of the rows, with the sizes that the program found."""
    slow = replace(rows.low_pass, cutoff_hz=0.25 * rows.low_pass.cutoff_hz)
    moving = np.clip(np.abs(rows.released), 0.0, 1.0)
    accelerating = np.abs(slow.apply(rows.acceleration_m_s2, rows.rate_hz))
    speed = np.maximum(integrate(rows.inside * rows.acceleration_m_s2, rows.step_s), 0.0)
    shapes = [moving, accelerating / accelerating[at].max(), speed / speed[at].max(), moving, moving]
    instants = rows.times_s[at]
    apart = np.abs(instants[:, np.newaxis] - instants) / (rows.interval_s[1] - rows.interval_s[0])
    near = [by_filter(rows, instants)] * 3 + [np.exp(-apart / 0.03), np.exp(-apart / 0.1)]
    return sum(
        size**2 * np.outer(shape[at], shape[at]) * of for size, shape, of in zip(sizes, shapes, near, strict=True)
    )


def twice_integrated(acceleration: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrate straight lines through samples, from rest: travel and velocity."""
    first, second = acceleration[:-1], acceleration[1:]
    speed = np.concatenate([[0.0], np.cumsum((first + second) / 2 * step_s)])
    return np.concatenate([[0.0], np.cumsum(speed[:-1] * step_s + (2 * first + second) / 6 * step_s**2)]), speed


def moves(since_s: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the ways of a zero, each a third of its variance: within 2 ms, within 30 ms, at once and gone in .3 s."""
    left = [np.exp(-since_s / tau_s) / np.sqrt(3.0) for tau_s in (0.002, 0.03, 0.3)]
    return np.sqrt(1 / 3) - left[0], np.sqrt(1 / 3) - left[1], left[2] - left[0]


@pytest.mark.whole_way
@pytest.mark.parametrize("kind", [True, False], ids=["all is read", "not all is read"])
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_a_program_that_shares_nothing_finds_the_same_mass_and_uncertainty(name: str, kind: bool) -> None:
    settings = {"u_zero_rel": 0.001, "kind": kind, "unread_errors": False}
    found, shot = identified(name, **settings), virtual_shot(name, **settings)
    rows, rig = found.route.fitted, shot.rig
    at = spaced_rows(rows)
    series = (
        *(rows.forces_n[at, j] for j in range(4)),
        rows.friction_direction[at],
        rows.released[at],
        rows.release_per_s[at],
    )
    # zeros that read too high, records that are late: by what the forces change, and what the accelerometer reads
    steps = 1 / np.diff(rows.times_s).mean()
    # a gauge that is late moves no release: before it a force is held at what it is then
    held = bridged(found.route.recorded.forces_n[:, :3])
    release = int(np.argmax(found.route.recorded.released > 0))
    held[:release] = held[release]
    slopes = np.gradient(np.stack([rows.low_pass.apply(one, steps) for one in held.T], axis=1), axis=0) * steps
    jerk = np.gradient(rows.acceleration_m_s2) * steps
    roles = ("breech_pressure", "brake_pressure", "recuperator_pressure", "recoil_acceleration")
    clocks = [shot.shot.by_role(role).time_base.clock for role in roles]
    m = rig.mechanism
    # the breech gauge is felt less what the bore takes off the projectile's push
    areas = (m.bore_area * (1.0 - m.bore_friction), -m.brake_area, -m.recuperator_area)
    others = []
    for j, area in enumerate(areas):
        offset = found.route.signals.offsets.get(roles[j])
        if offset is not None and 0 < offset.u < np.inf:
            others.append((np.outer(-area * rows.released, np.eye(3)[j]), 0 * jerk, offset.u))
    # zeros that move: late, slow, and at once to die down again, behind the same filter, all three together by as
    # much as the rig says of each
    since = np.maximum(rows.times_s - rows.interval_s[0], 0.0)
    first_move = len(others)
    for j, area in enumerate(areas):
        sensor = next(c.sensor for c in rig.channels if c.role == roles[j])
        size = sensor.u_zero_rel * sensor.range[1] * 1e6
        for move in moves(since):
            moved = rows.low_pass.apply(move, rows.rate_hz)
            others.append((np.outer(-area * moved, np.eye(3)[j]), 0 * jerk, size))
    # what a repair of the accelerometer may have left
    others += [(np.zeros((jerk.size, 3)), left * rows.released, 1.0) for left in found.route.signals.left.values()]
    assert {source.of for source in found.route.signals.left} <= {"recoil_acceleration"}
    for clock in {*clocks} - {shot.shot.reference_clock}:
        on_it = np.array([one == clock for one in clocks], dtype=float)
        u_s = shot.shot.alignment(clock).u_offset_s
        others.append((slopes[:, :3] * on_it[:3], -on_it[3] * jerk, u_s))
    # gauges by themselves, of which the rig declares no delay; a line may stand before that of the gas
    others.append((slopes[:, :3] * np.eye(3)[1], 0 * jerk, 2e-5))
    line = 2e-3 if name == "field-2013" and not kind else 2e-5
    others.append((slopes[:, :3] * np.eye(3)[2], 0 * jerk, line))
    if not kind:
        others += [(column, 0 * jerk, size) for column, size in unread_columns(found.route.recorded, rows)]
    others.append((np.zeros((jerk.size, 3)), -jerk, 5e-5))
    # carriage sensors that are late with their own clock: what they tell then is the mechanism's to say, and is held
    # to a shot whose samples are moved where causes are tested
    aligned = {f"alignment of clock {one.clock}" for one in shot.shot.alignments} - {"alignment of clock camera"}
    of_carriage = [
        one
        for one in found.route.calibration.block.causes
        if one.source in aligned and one.travel_m_s2 is not None and not one.forces_n.any()
    ]
    frames_see = {len(others) + k: one.travel_m_s2 for k, one in enumerate(of_carriage)}
    others += [(np.zeros((jerk.size, 3)), one.acceleration_m_s2, one.u) for one in of_carriage]
    # the gas in the empty bore, which no force knows
    others.append((np.zeros((jerk.size, 3)), 0 * jerk, 10e3))
    forces, jerks = (np.stack([one[side][at] for one in others], axis=-1) for side in (0, 1))
    series = (*series, forces, jerks)
    n = 8 + len(others) + 8
    m0 = found.route.calibration.m0_kg
    # what is known of each sensor by the rig file, which takes the areas for exact: gauges, friction, accelerometer
    *gauges, accelerometer = (next(c.u_scale_rel for c in rig.channels if c.role == role) for role in roles)
    if not kind:
        gauges[0] = np.hypot(gauges[0], 0.006 / 0.99)
    u = [*gauges, rig.mechanism.u["friction"], accelerometer]
    u += [found.route.signals.offsets["recoil_acceleration"].u, rows.u_release_n_s / m0, *(one[2] for one in others)]
    # the camera's scale, share and zero of the carriage's part, place, clock and its rate, bow and S
    resting = [found.route.signals.offsets[f"carriage_acceleration_{axis}"].u for axis in "xy"]
    camera = shot.shot.by_role("recoil_displacement")
    u += [camera.u_rel, 0.01, np.hypot(*resting), 0.01, 1e-3, 5e-5, 1e-4, 5e-5]
    expected = np.zeros(len(u))
    expected[6] = rows.release_n_s / m0
    expected[-3] = -next(one.drift for one in shot.shot.alignments if one.clock == camera.time_base.clock)
    known = [(np.eye(n)[[1 + i]], expected[[i]], np.array([[one**2]])) for i, one in enumerate(u)]
    # its frames in means of a millisecond, from 20 ms before the onset on
    before, times, onset = prepare(FiredShot(shot.shot, rig)), rows.times_s, rows.interval_s[0]
    instants = before.camera_clock.to_reference(before.camera.time_base.times_s)
    bins = np.floor((instants - onset) / 1e-3)
    kept = (bins >= -20) & (instants <= rows.interval_s[1]) & np.isfinite(before.camera.samples)
    instants, places = instants[kept], np.unique(bins[kept], return_inverse=True)[1]
    frames_each = np.bincount(places)

    def mean(values: np.ndarray) -> np.ndarray:
        return (
            np.bincount(places, np.interp(instants, times, values) if values.size == times.size else values)
            / frames_each
        )

    def travelled(acceleration: np.ndarray) -> np.ndarray:
        return mean(twice_integrated(acceleration, 1 / steps)[0])

    moving = times >= onset
    inertial, whole = before.inertial_m_s2 * moving, before.acceleration_m_s2 * moving
    added = np.column_stack([travelled(frames_see.get(k, one[1])) for k, one in enumerate(others)])
    track = before.camera.samples[kept]
    share = track / track.max()
    bow = 4 * share * (1 - share)
    speed = twice_integrated(whole, 1 / steps)[1]
    slower = speed * (times - 0.5 * (onset + mean(instants)[-1]))
    frames = (
        *(travelled(inertial), travelled(whole - inertial), travelled(found.route.recorded.released), added),
        *(mean(speed), mean(slower), np.column_stack([mean(bow), mean(2.6 * bow * (1 - 2 * share))])),
    )
    noise_of_rows, camera_rows = found.route.calibration.noise, found.route.calibration.camera
    covariance = rest_covariance(rows, at, noise_of_rows, camera_rows)
    covariance[: at.size, : at.size] += in_motion(rows, at, noise_of_rows.sizes_m_s2)
    sigma = np.append(np.ones(at.size), camera_rows.sigma_m)
    covariance *= np.outer(sigma, sigma)
    assert sigma.size == at.size + frames_each.size
    # the breech gauge once the bore is empty, in means of 5 ms
    reading, noise = found.route.signals.series["breech_pressure"], found.route.signals.offsets["breech_pressure"].noise
    start = rows.interval_s[0] + 0.06
    zero = next(i for i, one in enumerate(others) if one[0][:, 0].any())
    late = []
    for number in range(int((rows.interval_s[1] - start) / 0.005)):
        low = start + 0.005 * number
        within = (rows.times_s >= low) & (rows.times_s < low + 0.005)
        row = np.zeros((1, n))
        row[0, 8 + zero], row[0, n - 9] = 1.0, 1.0
        row[0, 8 + first_move : 8 + first_move + 3] = [move.mean() for move in moves(since[within])]
        count = round(0.005 * rows.rate_hz)
        late.append((row, reading[within].mean(keepdims=True), noise**2 / count))
    # not less noisy than what their own columns leave of them
    columns, means = np.vstack([row for row, _, _ in late]), np.concatenate([mean_pa for _, mean_pa, _ in late])
    columns = columns[:, columns.any(axis=0)]
    fit = columns / np.linalg.norm(columns, axis=0)
    solution, _, rank, _ = np.linalg.lstsq(fit, means, rcond=1e-6)
    left = float(np.sum((means - fit @ solution) ** 2)) / (means.size - rank)
    known += [(row, mean_pa, np.array([[max(variance, left)]])) for row, mean_pa, variance in late]
    seen = np.append(rows.acceleration_m_s2[at], mean(track))
    mass, uncertainty = second_opinion(series, frames, seen, m0, covariance, known)
    assert mass == pytest.approx(found.route.calibration.estimate.mass_kg, rel=1e-6)
    assert uncertainty == pytest.approx(found.route.calibration.estimate.u_kg, rel=1e-6)
