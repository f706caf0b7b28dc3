"""The checks of one channel by itself, chosen by its role and by what is known of its sensor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.quantities.quantity import Unit
from recoil_acquisition.shot.quality_check import Check, Verdict
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge, near
from recoil_processing.quality.clipping_checks import check_clipping, check_flat_tops, check_out_of_band
from recoil_processing.quality.level_checks import (
    check_baseline,
    check_filtered_noise,
    check_level_after,
    check_steady_baseline,
)
from recoil_processing.quality.limits import Outcome
from recoil_processing.quality.loss_checks import check_held, check_losses, check_time_steps
from recoil_processing.quality.lost_code import find_lost_code
from recoil_processing.quality.motion_checks import check_polarity
from recoil_processing.quality.spectral_checks import (
    check_aliasing,
    check_gap,
    check_hum,
    check_no_gap,
    check_srs_symmetry,
    last_octave_fall_db,
)
from recoil_processing.quality.word_overflow import find_word_overflow
from recoil_processing.repairs.hum import Hum, subtract_hum
from recoil_processing.shot.blow import Blow
from recoil_processing.shot.gauge_zero import moving_zero_pa
from recoil_processing.shot.regression import MASS_ROLES, PRESSURE_ROLES
from recoil_processing.shot.signals import BASELINE_MARGIN_S
from recoil_processing.shot.verdict.motion_quality import CUTOFF_HZ, SLOWEST_SHARE
from recoil_processing.spectra.spectral_gap import SpectralGap, find_gap
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.shots.assemble import shown_unit
from recoil_rigs.tables.channel_table import range_si
from recoil_rigs.tables.rig_tables import FORCE_ROLES

LEAST_SAMPLES = 8
"""Number of samples below which there is no record."""
HUM_RATE_HZ = 2000.0
"""Least rate at which the mains' harmonics are looked for."""
EMPTY_BORE_S = 0.15
"""Time after the onset from which on the bore is open: thirty time constants of a breech pressure's decay."""
BEFORE_S = 5e-3
"""Time kept before the onset for the shock response spectrum."""
PULSES = 3.0
"""Number that, over the pulse's duration, is the frequency below which a one-sided pulse rightly makes a lopsided shock
response spectrum."""
REST_SPAN_S = 0.02
"""Time at the end of the record over which a level is taken."""


def check_channel(
    channel: Channel,
    rig: Rig,
    *,
    reference_s: Array | None,
    onset_s: float | None,
    rest_s: float | None,
    counted: bool,
    driven_m_s2: float | None = None,
) -> Iterator[tuple[Check, Outcome]]:
    """Check one channel.

    Parameters
    ----------
    reference_s : ndarray, shape (n,), or None
        Instants of the samples on the reference clock; None if the channel's clock could not be aligned.
    onset_s
        Onset of force on the reference clock; None if there is none.
    rest_s
        Instant since which the mechanism rests again, on the reference clock; None if it is not known.
    counted
        Whether a counter shows which frames of the source are missing.
    driven_m_s2
        Largest acceleration that the breech force gives the recoiling part; None if it was not measured.

    Yields
    ------
    check, (verdict, detail)
    """
    spec = rig.channel(channel.name)
    samples = np.asarray(channel.samples, dtype=np.float64)
    unit, own = shown_unit(spec)
    present = _shown(samples[np.isfinite(samples)], own)
    if present.size < LEAST_SAMPLES:
        found = f"only {present.size} samples" if present.size else "no sample at all"
        yield Check.LOSSES, ("fail", f"{found}: check the sensor and its signal's name")
        return
    if np.ptp(present) == 0:
        # what nothing is made of may stand still: a temperature, a mark on the tipping part
        verdict: Verdict = "fail" if channel.role or channel.name in aligning_channels(rig) else "warn"
        always = measured(float(present[0]), unit, ".4g")
        yield Check.CONSTANT, (verdict, worded("always ", always, ": sensor not connected, or the wrong signal"))
        return
    by_camera = rig.source(channel.time_base.clock).kind == "camera"
    unclipped = True
    if not by_camera:
        yield Check.LOSSES, check_losses(samples, channel.time_base.rate_hz, channel.overloads)
        limits, shown = range_si(spec), _shown(samples, own)
        # a pulse that triggers or exposes has two levels, and may stand at the recorder's end: that is no code
        is_pulse = channel.quantity == "voltage"
        ends = None if limits is None else tuple(_shown(limits, own).tolist())
        code = None if is_pulse else find_lost_code(shown, ends)
        broken = code or find_word_overflow(shown)
        if broken is not None:
            # its range, its polarity and its spectrum say nothing of what it measured
            verdict, detail = broken.outcome(unit)
            used = channel.role or channel.name in aligning_channels(rig)
            yield Check.CODE if code else Check.OVERFLOW, (verdict if used else "warn", detail)
            return
        ranged = None if limits is None else check_clipping(shown, *_shown(limits, own), unit=unit)
        if ranged is not None:
            yield Check.RANGE, ranged
        # what is clipped at the declared range is not reported twice
        tops = check_flat_tops(samples, declared=limits is not None) if ranged is None or ranged[0] == "ok" else ranged
        unclipped = tops[0] == "ok"
        if tops is not ranged:
            yield Check.RANGE if ranged is None else Check.FLAT_TOPS, tops
        if channel.role:
            yield Check.HELD_VALUES, check_held(samples, channel.time_base.rate_hz)
        if channel.role and channel.time_base.stamps_s is not None and not counted:
            even = rig.source(channel.time_base.clock).kind == "dewetron"
            yield Check.TIME_STEPS, check_time_steps(channel.time_base.stamps_s, even=even)
    elif (limits := range_si(spec)) is not None:
        yield Check.RANGE, check_clipping(_shown(samples, own), *_shown(limits, own), unit=unit)
    if reference_s is None or onset_s is None:
        return
    # what is infinite was reported by the range's check; of the rest it says nothing
    samples = channel.measured
    in_baseline = reference_s < onset_s - BASELINE_MARGIN_S
    if (
        channel.role
        and channel.quantity not in ("displacement", "voltage")
        and math.isfinite(channel.time_base.rate_hz)
    ):
        yield from _levels(channel, spec, rig, samples, in_baseline, reference_s, onset_s, rest_s)
        record = _Record.of(channel, (unit, own), samples, in_baseline, reference_s, onset_s, rig.mechanism.spans_s)
        hum = _hum(record)
        yield Check.FILTERED_NOISE, _filtered_noise(record, hum)
        if hum is not None:
            yield Check.HUM, _hum_outcome(record, hum)
        if unclipped:
            yield Check.OUT_OF_BAND, check_out_of_band(record.samples, record.in_baseline)
        yield from _spectra(record, driven_m_s2)
    if channel.role in rig.mechanism.positive_pulses:
        yield Check.POLARITY, check_polarity(samples, in_baseline, polarity=spec.polarity)


def _shown(values: Array | tuple[float, float], unit: Unit) -> Array:
    """Return SI values in the unit that they are shown in."""
    si = np.asarray(values, dtype=np.float64)
    return si if (unit.factor, unit.offset) == (1.0, 0.0) else (si - unit.offset) / unit.factor


@dataclass(frozen=True, eq=False)
class _Record:
    """One channel's samples up to the end of recoil: as recorded, bridged and low-passed, and which are when."""

    channel: Channel
    unit: tuple[str, Unit]
    samples: Array
    whole: Array
    smooth: Array
    low_pass: LowPass
    in_baseline: Flags
    pulse: Flags
    reference_s: Array
    onset_s: float

    @classmethod
    def of(
        cls,
        channel: Channel,
        unit: tuple[str, Unit],
        samples: Array,
        in_baseline: Flags,
        reference_s: Array,
        onset_s: float,
        spans_s: tuple[float, float],
    ) -> _Record:
        """Take a record apart; ``spans_s`` from the onset are those of its spectra, and of what is looked through.

        Where they have no end a blow has one of its own, and a low-pass that leaves it what it is.
        """
        rate_hz = channel.time_base.rate_hz
        stop = int(np.searchsorted(reference_s, onset_s + spans_s[1]))
        samples, in_baseline, reference_s = samples[:stop], in_baseline[:stop], reference_s[:stop]
        whole = bridge(samples, otherwise=0.0)
        pulse = (reference_s >= onset_s) & (reference_s < onset_s + spans_s[0])
        blow = None if math.isfinite(spans_s[0]) else Blow.of(whole, pulse, rate_hz)
        pulse = pulse if blow is None else blow.flags
        quickest_hz = CUTOFF_HZ if blow is None else max(CUTOFF_HZ, blow.cutoff_hz)
        low_pass = LowPass(min(quickest_hz, SLOWEST_SHARE * rate_hz))
        smooth = low_pass.apply(whole, rate_hz)
        return cls(channel, unit, samples, whole, smooth, low_pass, in_baseline, pulse, reference_s, onset_s)

    @property
    def rate_hz(self) -> float:
        return self.channel.time_base.rate_hz

    @property
    def level(self) -> float:
        """Before the shot."""
        return float(np.median(self.whole[self.in_baseline])) if self.in_baseline.any() else 0.0


def _levels(
    channel: Channel,
    spec: ChannelSpec,
    rig: Rig,
    samples: Array,
    in_baseline: Flags,
    reference_s: Array,
    onset_s: float,
    rest_s: float | None,
) -> Iterator[tuple[Check, Outcome]]:
    """Check levels before and after the shot."""
    role, (unit, own) = channel.role, shown_unit(spec)
    static = None if spec.sensor.time_constant_s else rig.mechanism.at_rest.get(role)
    u_moving = moving_zero_pa(spec, samples) / own.factor if role in PRESSURE_ROLES else 0.0
    if (own.factor, own.offset) != (1.0, 0.0):
        # of what is shown only differences and levels count, so that one unit is as good as another
        samples, static = _shown(samples, own), None if static is None else own.from_si(static)
    yield Check.BASELINE, check_baseline(samples, in_baseline, static, unit=unit)
    yield Check.STEADY_BASELINE, check_steady_baseline(samples, in_baseline, unit=unit)
    since_s = onset_s + EMPTY_BORE_S if role == "breech_pressure" else rest_s
    # an AC-coupled chain comes back late, a recuperator warm
    if since_s is None or spec.sensor.time_constant_s is not None or role == "recuperator_pressure":
        return
    end_s = float(reference_s[-1])
    if end_s - since_s >= REST_SPAN_S:
        after = reference_s >= end_s - REST_SPAN_S
        yield Check.LEVEL_AFTER, check_level_after(samples, in_baseline, after, unit=unit, u_moving=u_moving)


def _filtered_noise(record: _Record, hum: Hum | None) -> Outcome:
    """Check the noise behind the low-pass, where neither the shot nor the record's begin reaches; hum is none."""
    reach = record.low_pass.reach_samples(record.rate_hz)
    lost = ~np.isfinite(record.samples)
    trusted = ~near(lost, reach) if lost.any() else ~lost
    still = record.in_baseline & trusted
    baseline_at = np.flatnonzero(record.in_baseline)
    if baseline_at.size:
        still[: baseline_at[0] + reach] = False
        still[max(int(baseline_at[-1]) + 1 - reach, 0) :] = False
    smooth = record.smooth
    if hum is not None and hum.lines:
        # far below the cut-off it passes the filter as it is, and is taken off before the mass is found
        since_s = (np.arange(smooth.size) - baseline_at[0]) / record.rate_hz - hum.origin_s
        smooth = smooth - np.sum([line.taken_at(since_s) for line in hum.lines], axis=0)
    return check_filtered_noise(
        smooth, still, record.pulse & trusted, needed=record.channel.role in (*MASS_ROLES, *FORCE_ROLES)
    )


def _hum(record: _Record) -> Hum | None:
    """Look for the mains' hum in the pre-trigger baseline; None where the record is too slow for its harmonics."""
    every = int(record.rate_hz / HUM_RATE_HZ)
    baseline_at = np.flatnonzero(record.in_baseline)
    if every < 1 or baseline_at.size < every:
        return None
    # means of a few samples keep the harmonics and make the fit quick
    count = baseline_at.size // every
    means = record.samples[baseline_at[0] : baseline_at[0] + count * every].reshape(count, every).mean(axis=1)
    found = subtract_hum(means, record.rate_hz / every, np.ones(count, dtype=bool))
    # a mean stands in the middle of its samples
    return replace(found, origin_s=found.origin_s + 0.5 * (every - 1) / record.rate_hz)


def _hum_outcome(record: _Record, found: Hum) -> Outcome:
    if not found.lines:
        return "ok", found.reason
    peak = float(np.nanmax(np.abs(record.samples - record.level)))
    unit, own = record.unit
    return check_hum(found.amplitude / own.factor, found.frequency_hz, peak / own.factor, unit=unit)


def _spectra(record: _Record, driven_m_s2: float | None) -> Iterator[tuple[Check, Outcome]]:
    """Check what lies above the rigid body's band."""
    rate_hz, above_hz = record.rate_hz, 2 * max(CUTOFF_HZ, record.low_pass.cutoff_hz)
    fall_db = last_octave_fall_db(record.whole, record.in_baseline, record.pulse, rate_hz, above_hz)
    if fall_db is not None:
        yield Check.ALIASING, check_aliasing(fall_db, rate_hz)
    if record.channel.role != "recoil_acceleration" or not record.pulse.any():
        return
    gap = find_gap(record.samples, rate_hz, onset_index=int(np.argmax(record.pulse)))
    if not isinstance(gap, SpectralGap):
        ringing = float(np.std((record.whole - record.smooth)[record.pulse]))
        yield Check.SPECTRAL_GAP, check_no_gap(gap, ringing, float(np.max(record.smooth - record.level)))
        return
    yield Check.SPECTRAL_GAP, check_gap(gap.depth_db, gap.valley_hz, gap.shoulder_hz)
    if gap.valley_hz >= 0.25 * rate_hz:
        return
    below = LowPass(gap.valley_hz).apply(record.whole, rate_hz)
    window = record.pulse | near(record.pulse, round(BEFORE_S * rate_hz))
    pulse_s = _pulse_s(record)
    if pulse_s is not None:
        lowest_hz = max(gap.shoulder_hz, PULSES / pulse_s)
        motion = record.whole[window] - record.level
        pulse = float(np.max(np.abs(below[window] - record.level))) if driven_m_s2 is None else driven_m_s2
        over = float(np.max(np.abs((record.whole - below)[window]))) / max(pulse, 1e-300)
        yield Check.SHOCK_RESPONSE, check_srs_symmetry(motion, rate_hz, lowest_hz, over)


def _pulse_s(record: _Record) -> float | None:
    """Duration of the pulse: from the onset until the low-passed signal returns to its level; None if it does not."""
    first = int(np.argmax(record.pulse))
    pulse = record.smooth[first:] - record.level
    peak = int(np.argmax(pulse[: max(np.count_nonzero(record.pulse), 1)]))
    back = np.flatnonzero(pulse[peak:] <= 0)
    duration_s = float(record.reference_s[first + peak + back[0]] - record.onset_s) if back.size else 0.0
    # where the pulse itself was lost, what is left may never rise over the level
    return duration_s if duration_s > 0 else None


def aligned_by(source: Source) -> set[str]:
    """Return the names of the channels that the clock of a source is aligned by."""
    return {name for key in ("channel", "against") if (name := getattr(source.align, key, None)) is not None}


def aligning_channels(rig: Rig) -> set[str]:
    """Return the names of the channels that clocks are aligned by."""
    return {name for source in rig.sources for name in aligned_by(source)}
