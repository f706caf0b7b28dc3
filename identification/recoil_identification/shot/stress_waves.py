"""Stress waves on a shot's channels, and the channels without them: for the report."""

from __future__ import annotations

from dataclasses import dataclass, replace

from recoil_identification.shot.filter_choice import FilterChoice
from recoil_processing.shot.signals import Signals
from recoil_processing.spectra.cutoff import CutoffChoice, refusal
from recoil_processing.stress_waves.stress_wave import StressWaveReport, strip_stress_waves
from recoil_rigs.shots.fired_shot import FiredShot

RINGING_ROLES = {
    "recoil_acceleration": "acceleration",
    "tipping_rate": "angular_rate",
    "carriage_rate": "angular_rate",
}
"""Role -> its quantity. The paper blames the stress waves on the angular rates, the mass hangs on the acceleration."""
U_ONSET_SAMPLES = 2.0
"""Standard uncertainty of the onset, samples of the grid: it is traced back to the last silent one."""


@dataclass(frozen=True, eq=False)
class StressWaves:
    """The stress waves of one channel."""

    channel: str
    role: str
    unit: str
    report: StressWaveReport


def find_stress_waves(fired: FiredShot, signals: Signals, choice: FilterChoice) -> tuple[StressWaves, ...]:
    """Look for stress waves on the channels of the reference clock that they matter to.

    Channels of other clocks are sampled too slowly to show what rings.

    Parameters
    ----------
    choice
        Filter of the regression: all channels pass the same filter.
    """
    said = refusal(choice.reason, choice.low_pass.half_order) if choice.cutoff is None else choice.cutoff
    cutoff = _with_filter(said, choice)
    found = []
    for role, quantity in RINGING_ROLES.items():
        if role not in fired.roles or role not in signals.series:
            continue
        channel = fired.roles[role][0].recorded
        if channel.time_base.clock != fired.shot.reference_clock:
            continue
        report = strip_stress_waves(
            signals.series[role],
            signals.rate_hz,
            onset_s=signals.onset_s - signals.start_s,
            u_onset_s=U_ONSET_SAMPLES * signals.step_s,
            quantity=quantity,
            choice=cutoff,
        )
        found.append(StressWaves(channel.name, role, channel.unit, report))
    return tuple(found)


def _with_filter(said: CutoffChoice, choice: FilterChoice) -> CutoffChoice:
    """Put the filter that was taken in the place of the one that the spectra alone would have chosen."""
    return replace(said, cutoff_hz=choice.low_pass.cutoff_hz, half_order=choice.low_pass.half_order)
