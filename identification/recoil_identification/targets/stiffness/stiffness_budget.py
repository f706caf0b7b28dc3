"""Stiffness and damping of all supports with the uncertainty of everything that they hang on.

Every cause is moved by its standard uncertainty and everything is identified again; the changes are the rows of
the budget (JCGM 100:2008, 5.1.4), one column per parameter, so that what supports share stays correlated. The
sensors' noise is drawn some times from a seeded generator and added to the channels: the scatter of the estimates is
the random part where the residual's autocorrelation does not tell a larger one, and their shift is what noise
of the deflections does to the slopes, because noise that is there once has done as much already.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.shot.shot import Shot
from recoil_identification.estimate.budget import CHOICE_FACTORS
from recoil_identification.targets.stiffness.carriage_record import MOTION_ROLES, CarriageRecord
from recoil_identification.targets.stiffness.restoring_force import RestoringFit, fit_restoring_force, rows_of
from recoil_identification.targets.stiffness.support_filter import Band
from recoil_identification.targets.stiffness.supports import PARAMETERS, Assumptions, supports_of
from recoil_processing.shot.instants import delay_of
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.signals import Signals
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.shots.fired_shot import FiredShot

LOW_PASS_HZ = 80.0
"""Above the natural frequencies of such mechanisms, below the stress waves, and within a slow gyro's band."""
LARGEST_SHARE_OF_RATE = 0.2
"""Largest low-pass over the rate of a slow record."""
SHARE_OF_NARROWEST = 0.35
"""Largest low-pass over the corner of the narrowest sensor."""
HIGH_PASSES = ((0.0, 1), (5.0, 1), (10.0, 2), (15.0, 2))
"""High-passes that are tried, Hz, each with the order of its drift columns."""
MUCH_WORSE = 4.0
"""Product of two uncertainties over the least one, beyond which a band is not worth considering."""
NOISE_DRAWS = 24
SEED = 20130621

SYMBOLS = tuple(symbol for symbols in PARAMETERS.values() for symbol in symbols)
"""All parameters, in the order of every vector here."""
ATTENUATION = "noise of the deflections"


@dataclass(frozen=True, eq=False)
class Variant:
    """The shot with one cause moved by its standard uncertainty."""

    source: str
    record: CarriageRecord
    mechanism: Mechanism
    assumptions: Assumptions
    low_pass_factor: float = 1.0
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class SupportEstimates(ReadOnlyArrays):
    """All parameters with their joint uncertainty.

    Attributes
    ----------
    values : ndarray, shape (9,)
        Parameters in the order of `SYMBOLS`; NaN where a support could not be fitted at all.
    random : ndarray, shape (9, 9)
        Covariance by noise and residual.
    changes : mapping of str to ndarray, shape (9,)
        Change of all parameters by one standard uncertainty of each source.
    fits
        Fits by support.
    bands
        The one that was chosen for each support: with the least uncertainty.
    lifted_s
        Time within the interval for which each support had lifted off.
    """

    values: Array
    random: Array
    changes: Mapping[str, Array]
    fits: Mapping[str, RestoringFit]
    bands: Mapping[str, Band]
    lifted_s: Mapping[str, float]

    @property
    def covariance(self) -> Array:
        """Covariance of all parameters, shape (9, 9)."""
        stacked = np.array(list(self.changes.values())).reshape(-1, len(SYMBOLS))
        return np.asarray(self.random + stacked.T @ stacked)

    def value(self, symbol: str) -> float:
        """Return one parameter."""
        return float(self.values[SYMBOLS.index(symbol)])

    def u(self, symbol: str) -> float:
        """Return its standard uncertainty."""
        i = SYMBOLS.index(symbol)
        return math.sqrt(self.covariance[i, i])


def estimate_supports(record: CarriageRecord, signals: Signals, fired: FiredShot) -> SupportEstimates:
    """Identify all supports with their uncertainty.

    Parameters
    ----------
    signals
        Signals, for the zeros' uncertainties and the noise.
    fired
        Shot and rig: clocks, rates, and what the rig file declares of sensors and mechanism.
    """
    low_pass = min(LOW_PASS_HZ, LARGEST_SHARE_OF_RATE / record.step_s)
    if record.narrowest is not None:
        low_pass = min(low_pass, SHARE_OF_NARROWEST * record.narrowest.cutoff_hz)
    bands = tuple(Band(low_pass, high, order) for high, order in HIGH_PASSES if 2 * high < low_pass)
    as_is = Variant("", record, fired.rig.mechanism, Assumptions())
    base_fits = _fits(as_is, bands)
    base = _parameters(base_fits)
    changes: dict[str, Array] = {}
    for variant in _variants(as_is, signals, fired):
        change = variant.share * (_parameters(_fits(variant, bands)) - base)
        known = changes.get(variant.source)
        changes[variant.source] = change if known is None else np.where(np.abs(change) > np.abs(known), change, known)
    noisy = [replace(as_is, record=one) for one in noisy_records(record, signals, fired.shot)]
    drawn = np.array([_parameters(_fits(one, bands)) for one in noisy]) - base
    changes[ATTENUATION] = drawn.mean(axis=0)
    scatter = drawn - drawn.mean(axis=0)
    chosen, picked, fits = {}, [], {}
    choice = np.zeros(len(SYMBOLS))
    stacked = np.array(list(changes.values()))
    for name, symbols in PARAMETERS.items():
        columns = [SYMBOLS.index(symbol) for symbol in symbols]
        variance = (scatter[..., columns] ** 2).sum(axis=0) / (NOISE_DRAWS - 1)
        by_residual = np.array([np.diag(fit.covariance) for fit in (base_fits[name][i] for i in range(len(bands)))])
        total = np.fmax(variance, by_residual) + (stacked[..., columns] ** 2).sum(axis=0)
        relative = np.sqrt(total) / np.abs(base[:, columns])
        sound = np.array([fit.identifiable for fit in base_fits[name]])
        worth = np.where(sound & np.isfinite(relative).all(axis=1), relative[:, 0] * relative[:, 1], np.inf)
        best = int(np.argmin(worth))
        chosen[name], fits[name] = bands[best], base_fits[name][best]
        picked += [best] * len(symbols)
        # bands of about the same worth, any of which might have been taken: for two, the deviation of either
        others = base[worth <= MUCH_WORSE * worth[best]][:, columns] if np.isfinite(worth[best]) else base[:1, columns]
        choice[columns] = 0.5 * np.ptp(others, axis=0)
    every = np.arange(len(SYMBOLS))
    random = np.cov(scatter[:, picked, every], rowvar=False)
    by_residual = np.concatenate([np.diag(fits[name].covariance) for name in PARAMETERS])
    factor = np.sqrt(np.fmax(by_residual / np.maximum(np.diag(random), 1e-300), 1.0))
    return SupportEstimates(
        values=base[picked, every],
        random=random * np.outer(factor, factor),
        changes={source: change[picked, every] for source, change in changes.items()} | {"high-pass": choice},
        fits=fits,
        bands=chosen,
        lifted_s=_lifted(as_is),
    )


def _fits(variant: Variant, bands: tuple[Band, ...]) -> dict[str, list[RestoringFit]]:
    record = variant.record
    supports = supports_of(record, variant.mechanism, variant.assumptions)
    found: dict[str, list[RestoringFit]] = {name: [] for name in supports}
    for band in bands:
        moved = replace(band, low_pass_hz=band.low_pass_hz * variant.low_pass_factor)
        # the rows stay those of the band itself: they are samples of one and the same stretch
        rows = rows_of(record.times_s, record.interval_s, record.trusted, band.low_pass_hz)
        for name, support in supports.items():
            found[name].append(fit_restoring_force(support.filtered(moved, record.interval_s[0], rows)))
    return found


def _lifted(as_is: Variant) -> dict[str, float]:
    record = as_is.record
    inside = (record.times_s >= record.interval_s[0]) & (record.times_s <= record.interval_s[1])
    supports = supports_of(record, as_is.mechanism, as_is.assumptions)
    return {name: record.step_s * int(np.sum(s.contact[inside] < 0.5)) for name, s in supports.items()}


def _parameters(fits: Mapping[str, list[RestoringFit]]) -> Array:
    """Stack all parameters, shape (n_bands, 9)."""
    return np.hstack([np.array([fit.parameters for fit in fits[name]]) for name in PARAMETERS])


def _variants(as_is: Variant, signals: Signals, fired: FiredShot) -> Iterator[Variant]:
    """Move every cause by its standard uncertainty; two variants of one source count by the larger change."""
    record, mechanism = as_is.record, as_is.mechanism
    roles = (*MOTION_ROLES, *PRESSURE_ROLES, "recoil_acceleration")
    released = record.released
    for role in roles:
        channel, spec = fired.shot.by_role(role), fired.rig.by_role(role)
        if channel is None or spec is None:
            continue
        yield replace(as_is, source=f"{role} sensitivity", record=record.scaled(role, 1.0 + (channel.u_rel or 0.0)))
        zero = signals.offsets[role].u if role in signals.offsets else 0.0
        if math.isfinite(zero) and zero > 0:
            error = zero * released if role in PRESSURE_ROLES else zero
            yield replace(as_is, source=f"{role} zero", record=record.added(role, error))
        late = delay_of(spec, fired.rig.source(spec.source)).u_s
        if late > 0:
            yield replace(as_is, source=f"{role} delay", record=record.later((role,), late))
    for clock in sorted({c.time_base.clock for role in roles if (c := fired.shot.by_role(role)) is not None}):
        if clock == fired.shot.reference_clock:
            continue
        u_s = fired.shot.alignment(clock).u_offset_s
        on_it = tuple(r for r in roles if (c := fired.shot.by_role(r)) is not None and c.time_base.clock == clock)
        if math.isfinite(u_s):
            for shift in (u_s, -u_s):
                yield replace(as_is, source=f"alignment of clock {clock}", record=record.later(on_it, shift))
    for symbol, u in mechanism.u.items():
        if u > 0:
            moved = replace(mechanism, **{symbol: getattr(mechanism, symbol) + u})
            yield replace(as_is, source=f"mechanism {symbol}", mechanism=moved)
    track = fired.shot.by_role("recoil_displacement") or fired.shot.by_role("recoil_acceleration")
    scale = 1.0 + (track.u_rel or 0.0 if track is not None else 0.0)
    longer = replace(record, travel_m=scale * record.travel_m, velocity_m_s=scale * record.velocity_m_s)
    yield replace(as_is, source="recoil travel", record=longer)
    third = 1.0 / math.sqrt(3.0)  # limits of a rectangular distribution
    for factor in CHOICE_FACTORS:
        yield replace(as_is, source="low-pass cut-off", low_pass_factor=factor, share=third)
    plain = as_is.assumptions
    for factor in (0.5, 2.0):
        harder = replace(plain, sliding_m_s=factor * plain.sliding_m_s)
        yield replace(as_is, source="onset of sliding", assumptions=harder, share=third)
        lighter = replace(plain, contact_share=factor * plain.contact_share)
        yield replace(as_is, source="limit of contact", assumptions=lighter, share=third)


def noisy_records(
    record: CarriageRecord, signals: Signals, shot: Shot, draws: int = NOISE_DRAWS, *, zeros: bool = False
) -> Iterator[CarriageRecord]:
    """Add to every channel noise as there was before the shot, white up to the rate of its own samples.

    Parameters
    ----------
    signals
        Signals, which give the noise.
    shot
        Shot, which gives the channels' own rates.
    zeros
        Whether an error of the zero is drawn as well.

    Yields
    ------
    CarriageRecord
        The same ones every time.
    """
    rng = np.random.default_rng(SEED)
    rate = 1.0 / record.step_s
    for _ in range(draws):
        noisy = record
        for role in (*MOTION_ROLES, *PRESSURE_ROLES):
            channel = shot.by_role(role)
            offset = signals.offsets.get(role)
            if channel is None or offset is None or not offset.noise > 0:
                continue
            base = channel.time_base
            own = (base.count - 1) / (base.end_s - base.start_s)
            if own >= rate:
                noise = rng.normal(0.0, offset.noise * math.sqrt(rate / own), record.times_s.size)
            else:
                at = np.arange(record.times_s[0] - 1.0 / own, record.times_s[-1] + 2.0 / own, 1.0 / own)
                noise = _between(at, rng.normal(0.0, offset.noise, at.size), record.times_s)
            if zeros and math.isfinite(offset.u):
                noise = noise + rng.normal(0.0, offset.u)
            noisy = noisy.added(role, noise * record.released if role in PRESSURE_ROLES else noise)
        yield noisy


def _between(at: Array, samples: Array, times_s: Array) -> Array:
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(at, samples)(times_s), dtype=np.float64)
