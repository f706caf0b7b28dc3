"""The mass over time, by the same inference as the mass: as a random walk, and whether it is constant.

``a = F'(1/m) + errors``: a mass that changes is a coefficient that changes. But so does a wrong sensor's: a breech
gauge that reads 1 % low makes the mass come out 1 % low as long as the breech force drives, and right while the brake
holds. So the change is estimated together with all that the sensors, their zeros and clocks may be off, each with
what is known of it beforehand; only what no such error explains counts against a constant mass.

Two departures from a constant are asked for, without a new fit, by what the constant one leaves (score test, C. R. Rao,
Proc. Camb. Phil. Soc. 44, 1948): a drift at an even rate over the travel, and a step at each of many instants. A slow
force of free shape and a mass that changes slowly say the same to one shot; so the mass is said to change only where
that is far likelier than that it does not, forces that no gauge reads being among what else there may be (Bayes factor,
R. E. Kass, A. E. Raftery, J. Am. Stat. Assoc. 90, 1995). Beside it stands how rare the shot is with a constant mass if
there are no such forces. How large the largest of the steps becomes by chance is drawn then, with the rows as they are
(D. W. K. Andrews, Econometrica 61(4), 1993; B. E. Hansen, J. Econometrics 97(1), 2000).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE, probability_text
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.noise_in_motion import noise_in_motion
from recoil_identification.calibration.solution import calibration_of
from recoil_identification.estimate.rounding import in_kg, signed
from recoil_identification.inference.change_odds import LEAST_FACTOR, could_hide_text, found_size, ln_odds_of_change
from recoil_identification.inference.score import Scores
from recoil_identification.rows.equation_of_motion import MASS, PIECES, change, ramps
from recoil_identification.rows.row_noise import correlation_of
from recoil_identification.rows.travel_rows import ForcedTravel
from recoil_processing.filters import filter_alike
from recoil_processing.shot.regression import Regression

Kind = Literal["drift", "step"]

WALK = 0.03
"""Standard deviation of its change over the whole travel, before the shot; a smaller one flattens and lies."""
DRIFT, STEP = 0.03, 0.02
"""Standard deviations of the mass's logarithm over the travel and at a step, if it changes: before the shot."""
INSTANTS = 24
"""Instants at which a step is tried, each as likely as the others; what lies between differs little."""
SD = np.array([DRIFT, *[STEP] * INSTANTS])
"""The same for a drift and all steps."""
DOUBTED_FROM = -0.7
"""Logarithm of the Bayes factor of a change, from which on the noise is found anew beside it: that of a constant mass
holds the change, too, and would hide it."""
TRIMMED = 0.03, 0.1
"""Shares of the travel's time at its beginning and its end in which no step is looked for: at the end hardly a force is
left to tell a mass by, and the friction turns."""
FINER = 41
"""Instants around the largest, for the step's own instant."""
DRAWS = 20_000
"""Draws of the largest step by chance: probabilities of 1 % are then known to a tenth."""
SEED = 0
"""Seed of the draws."""
BY_SCAN = 1.77
"""Factor for looking for a step everywhere: the root of the difference of the squares of what the largest exceeds as
often as one that was known before."""
LEAST_LEFT = 3
"""Rows beyond the unknowns without a prior, below which nothing can be told."""


@dataclass(frozen=True, eq=False)
class MassOverTime(ReadOnlyArrays):
    """The mass over the travel as a random walk.

    Attributes
    ----------
    times_s, mass_kg, u_kg : ndarray, shape (n,)
        Instant, mass and standard uncertainty at every sample of the identification interval; the uncertainty is random
        and systematic together.
    """

    times_s: Array
    mass_kg: Array
    u_kg: Array

    @property
    def at_nodes(self) -> MassOverTime:
        """The samples nearest to the ends of the pieces; between them the mass's logarithm is a straight line."""
        nodes_s = np.linspace(self.times_s[0], self.times_s[-1], PIECES + 1)
        at = np.abs(self.times_s - nodes_s[:, np.newaxis]).argmin(axis=1)
        return MassOverTime(self.times_s[at], self.mass_kg[at], self.u_kg[at])

    def __str__(self) -> str:
        first, last = (in_kg(float(self.mass_kg[at]), float(self.u_kg[at])) for at in (0, -1))
        length_ms = 1e3 * (self.times_s[-1] - self.times_s[0])
        return f"{first} at the onset, {last} {length_ms:.0f} ms later, a random walk between"


@dataclass(frozen=True, eq=False)
class MassConstancy:
    """Tests of the constancy of a shot's mass, and the change that explains the shot best.

    Attributes
    ----------
    kind
        Kind of the change that explains the shot best.
    normalised_drift, normalised_step
        Rest of a drift and of the largest step that the constant mass leaves, over its standard deviation.
    ln_bayes_factor
        Logarithm of the odds of a mass that changes, by a drift or a step, against a constant one that the shot adds.
    u_drift_rel
        Standard uncertainty that a drift over the travel would have, relative to the mass.
    found_drift_rel, found_step_rel
        Sizes of a drift over the travel, and of a step at the middle one of all instants, that are found in nineteen
        shots of twenty, relative to the mass.
    moved_by_drift
        Amount by which a drift that nobody tells moves the mass found, over the drift: a mean of the mass is moved by
        at most 1.
    p_drift, p_step
        Probabilities that a constant mass leaves as much if there are no forces that no gauge reads.
    sensor_residual
        Largest normalised residual of what sensors, friction and unread resistance may be off by.
    instant_s, interval_s
        Instant of the step, and the interval in which it comes with a probability of 95 %.
    onset_s
        Onset of the force, s.
    before_kg, u_before_kg, after_kg, u_after_kg
        Mass before and after the change of that kind.
    change_kg, u_change_kg
        Size of the change and its standard uncertainty, negative if something let go: better known than either mass.
    beside
        Estimate of a constant mass with the noise as it was found beside the change, where the mass is said to change:
        what a change leaves of a constant mass is no noise. Else the estimate that was tested.
    changed
        Everything else if the mass changes so.
    gain_of_chain
        Amount by which a shape of the breech chain raises the largest log likelihood that is suspected; 0 where none
        is.
    """

    kind: Kind
    normalised_drift: float
    normalised_step: float
    ln_bayes_factor: float
    u_drift_rel: float
    found_drift_rel: float
    found_step_rel: float
    moved_by_drift: float
    p_drift: float
    p_step: float
    sensor_residual: float
    instant_s: float
    interval_s: tuple[float, float]
    onset_s: float
    before_kg: float
    u_before_kg: float
    after_kg: float
    u_after_kg: float
    change_kg: float
    u_change_kg: float
    beside: Calibration
    changed: Calibration
    gain_of_chain: float = 0.0

    @property
    def constant(self) -> bool:
        """Whether no change of the mass can be told: also where a sensor or the breech chain explains more."""
        return self.ln_bayes_factor <= self.least_odds or self.by_a_sensor or self.by_the_chain

    @property
    def by_the_chain(self) -> bool:
        """Whether a mass that changes would explain the shot, and a shape of the breech chain does as well."""
        return self.ln_bayes_factor > self.least_odds and 0.0 < self.gain <= self.gain_of_chain

    @property
    def by_a_sensor(self) -> bool:
        """Whether a mass that changes would explain the shot, and a sensor that contradicts the others does better."""
        better = self.sensor_residual > CRITICAL_VALUE and 0.5 * self.sensor_residual**2 >= self.gain
        return self.ln_bayes_factor > self.least_odds and better

    @property
    def ends_kg(self) -> tuple[float, float]:
        """Mass before the change and after it."""
        return self.before_kg, self.after_kg

    @property
    def could_hide_percent(self) -> dict[str, float]:
        """Sizes of a ``drift`` over the travel and a ``step`` that would have been found in 19 shots of 20, percent."""
        return {"drift": 100 * self.found_drift_rel, "step": 100 * self.found_step_rel}

    @property
    def p_value(self) -> float:
        """Probability that a constant mass looks as variable to one of both tests, at most (Bonferroni).

        It holds if there are no forces that no gauge reads.
        """
        return min(1.0, 2 * min(self.p_step, self.p_drift))

    @property
    def normalised_residual(self) -> float:
        """Size of the departure beside those of sensors: a step's is less by what many instants find by chance."""
        return max(abs(self.normalised_drift), as_if_known(self.normalised_step))

    @property
    def gain(self) -> float:
        """By how much the change raises the largest log likelihood, what many instants find by chance taken off.

        Of one further unknown that is half the square of its normalised residual.
        """
        return 0.5 * self.normalised_residual**2

    def __str__(self) -> str:
        low, high = (1e3 * (t - self.onset_s) for t in self.interval_s)
        at = f"{1e3 * (self.instant_s - self.onset_s):.1f} ms after the onset"
        size = signed(in_kg(self.change_kg, self.u_change_kg))
        masses = f"{in_kg(self.before_kg, self.u_before_kg)} before, {in_kg(self.after_kg, self.u_after_kg)} after"
        odds = f"ln of the Bayes factor {self.ln_bayes_factor:+.1f}, limit {self.least_odds:g}"
        if self.constant:
            if self.ln_bayes_factor > self.least_odds:
                better = (
                    "a sensor that is off explains the shot better"
                    if not self.by_the_chain
                    else "something of the breech chain or its like explains the shot as well"
                )
                return f"No change of the mass can be told ({odds}): {better}."
            hidden = could_hide_text(self.could_hide_percent, "shots")
            return (
                f"No change of the mass can be told ({odds}): {hidden} behind forces that no gauge reads; if there are "
                f"none, a constant mass has {probability_text(self.p_value)}."
            )
        if self.kind == "step":
            best = f"a step of {size} {at} (95 %: {low:.1f} to {high:.1f} ms)"
        else:
            best = f"a drift of {size} over the travel"
        changing = self.what_changes
        return f"{changing[0].upper()}{changing[1:]} changes in the shot ({odds}): as a mass {best}; {masses}."

    @property
    def least_odds(self) -> float:
        """Logarithm of the odds beyond which the mass is said to change."""
        return LEAST_FACTOR + self.changed.block.regression.further_odds

    @property
    def what_changes(self) -> str:
        """Say what may change."""
        return self.changed.block.regression.may_change


def mass_over_time(calibration: Calibration) -> MassOverTime:
    """Estimate the mass over the travel, together with everything else."""
    regression = calibration.block.regression
    inside = regression.inside
    shapes = ramps(regression.times_s, regression.interval_s, PIECES)
    changed = calibration.with_changes(shapes, WALK / math.sqrt(PIECES))
    found, names = changed.inferred, (MASS.name, *(change(i).name for i in range(PIECES)))
    at = [[one.name for one in found.unknowns].index(name) for name in names]
    rows = np.column_stack([np.ones(int(inside.sum())), shapes[inside]])
    mass = changed.m0_kg * np.exp(rows @ found.values[at])
    variances = ((rows @ found.covariance[np.ix_(at, at)]) * rows).sum(axis=1)
    return MassOverTime(regression.times_s[inside], mass, mass * np.sqrt(variances))


def mass_constancy(calibration: Calibration) -> MassConstancy | None:
    """Test whether the mass changes in the shot; None if the rows are too few to tell."""
    tried = _tried(calibration)
    if tried is None:
        return None
    if tried.ln_odds > DOUBTED_FROM:
        anew = _tried(_with_noise_beside(calibration, tried.likeliest))
        tried = anew if anew is not None and anew.ln_odds > tried.ln_odds else tried
    return _told(tried, calibration)


@dataclass(frozen=True, eq=False)
class _Tried(ReadOnlyArrays):
    """A drift and steps that an estimate of a constant mass was asked for.

    Attributes
    ----------
    calibration
        The estimate.
    shapes : ndarray, shape (n, 1 + INSTANTS)
        The drift first.
    instants_s : ndarray, shape (INSTANTS,)
    scores, alone
        Scores of all shapes, and those if gauges and friction read all of the resistance.
    factors : ndarray, shape (1 + INSTANTS,)
        Logarithms of their Bayes factors.
    """

    calibration: Calibration
    shapes: Array
    instants_s: Array
    scores: Scores
    alone: Scores
    factors: Array

    @property
    def ln_odds(self) -> float:
        """Logarithm of the odds of a change against none."""
        return float(ln_odds_of_change(self.factors))

    @property
    def likeliest(self) -> Array:
        """Shape of the likeliest change, shape (n, 1)."""
        return self.shapes[:, [int(np.argmax(self.factors))]]

    @property
    def steps(self) -> NDArray[np.intp]:
        """Places of the steps that can be told."""
        return np.flatnonzero(self.scores.identifiable)[1:]


def _tried(calibration: Calibration) -> _Tried | None:
    """Ask an estimate for a drift and for steps; None if the rows are too few to tell."""
    regression = calibration.block.regression
    onset_s, end_s = regression.interval_s
    first_s, last_s = (share * (end_s - onset_s) for share in TRIMMED)
    instants_s = np.linspace(onset_s + first_s, end_s - last_s, INSTANTS)
    drift = ramps(regression.times_s, regression.interval_s, 1)
    shapes = np.column_stack([drift, steps_behind(regression, instants_s)])
    scores = _scores(calibration, shapes)
    alone = scores if calibration.without_unread is calibration else _scores(calibration.without_unread, shapes)
    if scores is None or not scores.identifiable[0] or np.count_nonzero(scores.identifiable) < 2 or alone is None:
        return None
    return _Tried(calibration, shapes, instants_s, scores, alone, scores.ln_bayes_factors(SD))


def _told(tried: _Tried, tested: Calibration) -> MassConstancy:
    """Say what an estimate was found to leave of a change; `tested` is the one with the noise of a constant mass."""
    calibration, scores, steps = tried.calibration, tried.scores, tried.steps
    regression = calibration.block.regression
    onset_s, end_s = regression.interval_s
    p_drift, p_step = _by_chance(tried.alone)
    instants, z = tried.instants_s[steps - 1], scores.normalised[steps]
    best = int(np.argmax(np.abs(z)))
    # the step's own instant, between those that were tried
    around = instants[best] + np.linspace(-1, 1, FINER) * (end_s - onset_s) / INSTANTS
    fine = np.union1d(instants, around[(around > onset_s) & (around < end_s)])
    finer = _scores(calibration, steps_behind(regression, fine))
    instant_s, interval_s = instants[best], (instants[best], instants[best])
    if finer is not None:
        instant_s, interval_s = _most_likely(fine[finer.identifiable], finer.normalised[finer.identifiable])
    # probabilities as small as a drawn one can be tell no more which explains the shot better
    kind: Kind = "step" if as_if_known(z[best]) >= abs(scores.normalised[0]) else "drift"
    shape = tried.shapes[:, :1] if kind == "drift" else steps_behind(regression, np.array([instant_s]))
    least_odds = LEAST_FACTOR + regression.further_odds
    beside = _with_noise_beside(tested, shape) if tried.ln_odds > least_odds else tested
    changed = beside.with_changes(shape)
    found = changed.inferred
    at = [[one.name for one in found.unknowns].index(name) for name in (MASS.name, change(0).name)]
    log, by = found.values[at]
    covariance = found.covariance[np.ix_(at, at)]
    before = changed.m0_kg * math.exp(log)
    return MassConstancy(
        kind=kind,
        normalised_drift=float(scores.normalised[0]),
        normalised_step=float(z[best]),
        ln_bayes_factor=tried.ln_odds,
        u_drift_rel=1.0 / math.sqrt(scores.information[0]),
        found_drift_rel=found_size(scores, SD, 0, least_odds),
        found_step_rel=found_size(scores, SD, int(steps[steps.size // 2]), least_odds),
        moved_by_drift=float(scores.moves[calibration.rows.unknowns.index(MASS.name), 0]),
        p_drift=p_drift,
        p_step=p_step,
        sensor_residual=max((abs(w) for w in calibration.judged_residuals.values()), default=0.0),
        instant_s=float(instant_s),
        interval_s=interval_s,
        onset_s=onset_s,
        before_kg=before,
        u_before_kg=before * math.sqrt(covariance[0, 0]),
        after_kg=before * math.exp(by),
        u_after_kg=before * math.exp(by) * math.sqrt(covariance.sum()),
        change_kg=before * math.expm1(by),
        u_change_kg=before * math.exp(by) * math.sqrt(covariance[1, 1]),
        beside=beside,
        changed=changed,
    )


def _with_noise_beside(calibration: Calibration, shape: Array) -> Calibration:
    """Find the motion's noise anew with a change of the mass as an unknown, and estimate a constant mass with it."""
    camera = calibration.camera
    if isinstance(camera, ForcedTravel) or calibration.noise.parts is None:
        return calibration
    changing = replace(calibration.block, changes=shape)
    unknowns = [
        *changing.all_unknowns,
        *(one for one in calibration.inferred.unknowns if one.name not in changing.unknowns),
    ]
    rest = replace(calibration.noise, parts=None, sizes_m_s2=np.zeros_like(calibration.noise.sizes_m_s2))
    priors = [*calibration.common, *calibration.own]
    noise = noise_in_motion(changing, rest, camera, calibration.further, priors, unknowns)
    block = replace(calibration.block, sigma_m_s2=noise.sigma_m_s2[calibration.block.rows])
    return calibration_of(
        calibration.estimate.method,
        block,
        noise,
        calibration.common,
        calibration.own,
        camera,
        correlation_of(block.regression, block.rows, noise, camera),
        calibration.further,
        calibration.inferred.unknowns,
    )


def _by_chance(scores: Scores) -> tuple[float, float]:
    """Return the probabilities that rows with nothing but their errors leave as much of a drift, and of any step."""
    p_drift = math.erfc(abs(scores.normalised[0]) / math.sqrt(2.0))
    steps = 1 + np.flatnonzero(scores.identifiable[1:])
    largest = _largest_by_chance(scores.correlation[np.ix_(steps, steps)])
    z = float(np.max(np.abs(scores.normalised[steps]), initial=0.0))
    return p_drift, (1 + float((largest >= z).sum())) / (largest.size + 1)


def as_if_known(step: float) -> float:
    """Return what the largest of all steps is worth beside something that was known before."""
    return math.sqrt(max(step**2 - BY_SCAN**2, 0.0))


def _scores(calibration: Calibration, shapes: Array) -> Scores | None:
    """Score shapes of the mass's logarithm, on the regression's grid; None if there are too few rows."""
    changing = replace(calibration, block=replace(calibration.block, changes=shapes)).rows
    sizes = [change(i).name for i in range(shapes.shape[1])]
    left, derivatives = changing.linearised(calibration.values | dict.fromkeys(sizes, 0.0))
    known = sum(len(prior.sources) for prior in (*calibration.common, *calibration.own))
    if left.size < max(len(calibration.rows.unknowns) - known, 0) + LEAST_LEFT:
        return None
    return calibration.scores(derivatives[:, [changing.unknowns.index(name) for name in sizes]])


def steps_behind(regression: Regression, instants_s: Array) -> Array:
    """Return what the regression's filter makes of steps, shape (n, n_instants); sharp ones of recorded signals."""
    since = regression.times_s[:, np.newaxis] - instants_s
    if regression.low_pass is None:
        return (since >= 0.0).astype(np.float64)
    reach = math.ceil(8 * regression.rate_hz / regression.low_pass.cutoff_hz)
    times = regression.step_s * np.arange(-reach, reach + 1)
    # half way up at the instant itself
    risen = filter_alike(regression.low_pass, {"step": 0.5 * (1 + np.sign(times))}, regression.rate_hz)["step"]
    return np.asarray(np.interp(since, times, risen, left=0.0, right=1.0))


def _largest_by_chance(correlation: Array) -> Array:
    """Draw the largest departure of rows that hold nothing but their errors."""
    values, vectors = np.linalg.eigh(correlation)
    drawn = _drawn(DRAWS, values.size, SEED)
    # round-off may leave the smallest eigenvalues a little below zero
    departures = (vectors * np.sqrt(np.abs(values))) @ drawn.T
    return np.asarray(np.maximum(departures.max(axis=0), -departures.min(axis=0)))


@lru_cache(maxsize=1)
def _drawn(draws: int, count: int, seed: int) -> Array:
    """Draw from a standard normal distribution; most shots ask for the same."""
    drawn = np.random.default_rng(seed).standard_normal((draws, count))
    drawn.setflags(write=False)
    return drawn


def _most_likely(instants: Array, normalised: Array) -> tuple[float, tuple[float, float]]:
    """Return the likeliest instant of a step, and the interval that holds it with 95 %, for a flat prior."""
    exponent = 0.5 * normalised**2
    edges = np.concatenate([instants[:1], 0.5 * (instants[1:] + instants[:-1]), instants[-1:]])
    weights = np.exp(exponent - exponent.max()) * np.maximum(np.diff(edges), 1e-12)
    risen = np.concatenate([[0.0], np.cumsum(weights) / weights.sum()])
    low, high = np.interp([0.025, 0.975], risen, edges)
    best = float(instants[int(np.argmax(exponent))])
    return best, (min(float(low), best), max(float(high), best))
