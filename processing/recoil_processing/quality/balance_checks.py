"""Checks of force against acceleration: impulse, direction, time.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.quality.limits import LIMITS, Outcome

LEAST_SAMPLES_CORRELATED = 8
"""Number of samples below which nothing is correlated."""


TOLERANCE_U = 3.0
"""Standard uncertainties of mass and sensors that the impulse may be off."""


def check_impulse(
    excess_n_s: float, momentum_kg_m_s: float, u_rel: float, *, mass_kg: float, added_mass_kg: float = 0.0
) -> Outcome:
    """Whether the forces' impulse is the momentum of the specification mass where the velocity is largest.

    A check of wiring, gains, areas and units, independent of any filter, not of the mass: the limit is not
    below `TOLERANCE_U` times what mass and sensors are uncertain by.

    Parameters
    ----------
    excess_n_s
        Integral of the net force by the gauges less the specification mass times the velocity by the
        accelerometer, from the release to the largest velocity.
    momentum_kg_m_s
        Specification mass times the largest velocity by the accelerometer.
    u_rel
        Standard uncertainty of the excess over the momentum, from the mass, the sensors and the friction.
    mass_kg
        Specification mass.
    added_mass_kg
        Part of the mass that was added for this shot: its sign is doubted first.
    """
    if not (math.isfinite(excess_n_s) and momentum_kg_m_s > 0):
        return _no_motion(excess_n_s, momentum_kg_m_s)
    limit = LIMITS["impulse_share"]
    off, bound = excess_n_s / momentum_kg_m_s, max(limit.warn, TOLERANCE_U * u_rel)
    text = (
        f"the gauges' impulse is {100 * off:+.1f} % off {mass_kg:g} kg times the largest velocity (tolerance of mass "
        f"and sensors {100 * u_rel:.1f} %"
    )
    if abs(off) <= bound:
        return "ok", f"{text})"
    other_kg = mass_kg - 2 * added_mass_kg
    # a mass that hardly moves the specification explains nothing
    if 2 * abs(added_mass_kg) > bound * mass_kg and other_kg > 0 and abs((off + 1) * mass_kg / other_kg - 1) <= bound:
        return "fail" if abs(off) > max(limit.fail, bound) else "warn", (
            f"{text}, limit {100 * limit.fail:g} %): is the sign of the added mass right? With {-added_mass_kg:+g} kg "
            f"instead of {added_mass_kg:+g} kg it agrees; correct `added_mass_kg` in the shot log"
        )
    if abs(off) > max(limit.fail, bound):
        return "fail", (
            f"{text}, limit {100 * limit.fail:g} %): a wrong gain, unit, area or cable; compare every gain at the "
            "recorder with the rig file before the next shot"
        )
    return "warn", (
        f"{text}, limit {100 * bound:.1f} %): a gain that is off, or the mass is not the specification's; compare the "
        "gains at the recorder with the rig file before the next shot"
    )


def check_braking(excess_n_s: float, momentum_kg_m_s: float, u_rel: float) -> Outcome:
    """Whether brake, recuperator and friction take away the momentum that the breech has given.

    Parameters
    ----------
    excess_n_s
        Excess as in `check_impulse`, from the largest velocity to the end of recoil.
    momentum_kg_m_s, u_rel
        Momentum and uncertainty as in `check_impulse`.

    Returns
    -------
    verdict, detail
        Verdict and its sentence, never a failure: the zero of any sensor counts for as long as the recoil lasts.
    """
    if not (math.isfinite(excess_n_s) and momentum_kg_m_s > 0):
        return _no_motion(excess_n_s, momentum_kg_m_s)
    off, bound = excess_n_s / momentum_kg_m_s, max(LIMITS["impulse_share"].warn, TOLERANCE_U * u_rel)
    text = (
        f"while it brakes {100 * off:+.1f} % of the momentum are not accounted for (tolerance of mass and sensors "
        f"{100 * u_rel:.1f} %"
    )
    if abs(off) <= bound:
        return "ok", f"{text})"
    return "warn", (
        f"{text}, limit {100 * bound:.1f} %): gain of the brake's or the recuperator's gauge, or a zero that moved; "
        "check both gauges, and the accelerometer's mounting, before the next shot"
    )


def _no_motion(excess_n_s: float, momentum_kg_m_s: float) -> Outcome:
    """Say that there is no momentum to compare an impulse with."""
    return "warn", f"impulse {excess_n_s:.4g} N s beyond a momentum of {momentum_kg_m_s:.4g} kg m/s: check both records"


def check_force_sign(force: Array, acceleration: Array, *, reversed_by: Sequence[str] = ()) -> Outcome:
    """Correlate force and acceleration below the cut-off, where no stress wave is left.

    Parameters
    ----------
    force, acceleration : ndarray, shape (n,)
        Force and acceleration behind one and the same low-pass, within the recoil; what is not trusted is NaN.
    reversed_by
        Names of the channels of both whose declared polarity is -1.
    """
    used = np.isfinite(force) & np.isfinite(acceleration)
    if np.count_nonzero(used) < LEAST_SAMPLES_CORRELATED:
        return "ok", f"{np.count_nonzero(used)} samples of the recoil: too few to correlate"
    f, a = force[used], acceleration[used]
    size = math.sqrt(float(np.sum(f**2)) * float(np.sum(a**2)))
    # about zero, not about the means: both are zero at rest, and that is part of Newton's law
    correlation = float(np.sum(f * a)) / size if size > 0 else math.nan
    limit = LIMITS["force_correlation"]
    text = f"force and acceleration correlate by {correlation:+.3f} below the cut-off"
    if limit.verdict(correlation) == "fail":
        remedy = "set `polarity = -1` of that sensor or turn it"
        if reversed_by:
            named = " and ".join(reversed_by)
            remedy = f"`polarity` of {named} is -1: take it out if that one is, else {remedy}"
        return "fail", f"{text}: one of them is turned; {remedy} before the next shot"
    remedy = (
        ": files of two shots, swapped cables, a wrong delay, or ringing below the cut-off; compare the channels' "
        "names with their plugs before the next shot"
    )
    return limit.outcome(correlation, text, remedy)


def check_skew(skew_s: float, u_s: float, *, significant: bool) -> Outcome:
    """Judge the time skew of force and acceleration.

    Parameters
    ----------
    skew_s, u_s
        Time by which the acceleration is late, and its standard uncertainty.
    significant
        Whether it differs significantly from zero.
    """
    limit = LIMITS["skew_s"]
    late, by = ("acceleration", "force") if skew_s > 0 else ("force", "acceleration")
    text = f"the {late} is {1e6 * abs(skew_s):.0f} us (u {1e6 * u_s:.0f} us) later than the {by}"
    if not significant or limit.verdict(abs(skew_s)) == "ok":
        return "ok", text
    return "warn", (
        f"{text} (limit {1e6 * limit.warn:g} us): `identify` takes it out; declare it as `delay_s` of that sensor, or "
        "switch the filters of all channels alike before the next shot"
    )
