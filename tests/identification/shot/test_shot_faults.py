"""Every fault in a shot of the virtual rig must be found by its own check, which says what to do, and by no other
without reason."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

ON = CalibrationDay(dt.date(2026, 6, 1), DayOf.START)
Changed = Mapping[str, np.ndarray]


def samples(name: str) -> np.ndarray:
    return np.asarray(virtual_shot().shot.channels[name].samples, dtype=np.float64).copy()


def times() -> np.ndarray:
    return virtual_shot().shot.channels["acc_recoil"].time_base.times_s


def rate_hz() -> float:
    return virtual_shot().shot.channels["acc_recoil"].time_base.rate_hz


def fire_s() -> float:
    return float(virtual_shot().truth["t_fire"])


def noise(name: str) -> float:
    return float(np.std(samples(name)[times() < fire_s() - 1e-3]))


def random(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def ringing(frequency_hz: float, peak: float, damping: float = 0.01) -> np.ndarray:
    """Give a mode's acceleration from the shot on."""
    since = np.maximum(times() - fire_s(), 0.0)
    wave = np.sin(2 * np.pi * frequency_hz * since) * np.exp(-damping * 2 * np.pi * frequency_hz * since)
    return np.asarray(peak * wave)


def slewing(signal: np.ndarray, most: float) -> np.ndarray:
    """Follow a signal by at most so much per sample."""
    followed = signal.copy()
    for i in range(1, signal.size):
        followed[i] = followed[i - 1] + np.clip(signal[i] - followed[i - 1], -most, most)
    return followed


def nothing() -> Changed:
    return {}


def flat_top() -> Changed:
    acc = samples("acc_recoil")
    return {"acc_recoil": np.minimum(acc, 0.5 * acc.max())}


def full_amplifier() -> Changed:
    pressure = samples("p_breech")
    limit = 0.45 * pressure.max()
    return {"p_breech": limit * np.tanh(pressure / limit)}


def slew_limited() -> Changed:
    acc = samples("acc_recoil") + ringing(1500.0, 20_000.0, 0.003)
    return {"acc_recoil": slewing(acc, 900.0)}


def offset() -> Changed:
    pressure = samples("p_brake")
    return {"p_brake": pressure + 0.2 * np.ptp(pressure)}


def creeping_level() -> Changed:
    acc = samples("acc_recoil")
    return {"acc_recoil": acc + 0.02 * acc.max() * np.minimum(times() - times()[0], 0.045) / 0.045}


def loose_cable() -> Changed:
    acc = samples("acc_carriage_x")
    shaken = (times() > 0.03) & (times() < 0.049)
    return {"acc_carriage_x": acc + 0.02 * np.ptp(acc) * random().normal(size=acc.size) * shaken}


def noisy() -> Changed:
    acc = samples("acc_recoil")
    return {"acc_recoil": acc + 0.05 * acc.max() * random().normal(size=acc.size)}


def shifted_gauge() -> Changed:
    pressure = samples("p_breech")
    return {"p_breech": pressure + 0.02 * pressure.max() * (times() > fire_s() + 0.003)}


def zero_shift() -> Changed:
    acc = samples("acc_recoil")
    return {"acc_recoil": acc + 0.012 * acc.max() * (times() > fire_s() + 0.001)}


def turned_accelerometer() -> Changed:
    return {"acc_recoil": -samples("acc_recoil")}


def turned_carriage() -> Changed:
    return {"acc_carriage_x": -samples("acc_carriage_x")}


def halved_carriage() -> Changed:
    return {"acc_carriage_x": 0.5 * samples("acc_carriage_x")}


def turned_brake() -> Changed:
    return {"p_brake": -samples("p_brake")}


def wrong_gain() -> Changed:
    return {"p_breech": 1.05 * samples("p_breech")}


def wrong_unit() -> Changed:
    return {"p_breech": 1.45 * samples("p_breech")}


def wrong_brake_gain() -> Changed:
    return {"p_brake": 1.06 * samples("p_brake")}


def late_accelerometer() -> Changed:
    return {"acc_recoil": np.roll(samples("acc_recoil"), round(4e-4 * rate_hz()))}


def rattling() -> Changed:
    acc, since = samples("acc_recoil"), np.maximum(times() - fire_s(), 0.0)
    band = butter(2, [20.0, 3000.0], "bandpass", fs=rate_hz(), output="sos")
    rattle = sosfilt(band, random(0).normal(size=acc.size))
    return {"acc_recoil": acc + 0.3 * acc.max() * rattle / np.std(rattle) * np.exp(-since / 0.1) * (since > 0)}


def folded() -> Changed:
    acc = samples("acc_recoil")
    return {"acc_recoil": acc + ringing(0.47 * rate_hz(), 0.3 * acc.max(), 0.002)}


def rectified() -> Changed:
    acc, top = samples("acc_recoil"), np.max(samples("acc_recoil"))
    rings = sum(ringing(f, size * top, 0.002) for f, size in ((1300.0, 30.0), (1700.0, 20.0), (2300.0, 20.0)))
    return {"acc_recoil": acc + np.maximum(rings, 0.0)}


def hum() -> Changed:
    pressure = samples("p_brake")
    return {"p_brake": pressure + 0.01 * pressure.max() * np.sin(2 * np.pi * 50.0 * times() + 0.4)}


def held() -> Changed:
    acc = samples("acc_carriage_y")
    for start in range(2000, 6000, 500):
        acc[start : start + 25] = acc[start]
    return {"acc_carriage_y": acc}


def slow_updates() -> Changed:
    rate = samples("gyro_tipping")
    return {"gyro_tipping": np.repeat(rate[::2], 2)[: rate.size]}


def lost() -> Changed:
    pressure = samples("p_brake")
    pressure[3000:3020] = np.nan
    return {"p_brake": pressure}


def frames() -> np.ndarray:
    return samples("x_camera")


def fastest_frame() -> int:
    """Give the frame of the largest velocity, near which none is lost."""
    x = frames()
    apart = x[40:] - x[:-40]
    return int(np.nanargmax(apart)) + 20


def stuck() -> Changed:
    x, at = frames(), fastest_frame()
    x[at : at + 8] = x[at - 1]
    return {"x_camera": x}


def jumping() -> Changed:
    x = frames()
    x[fastest_frame() + 300] += 0.02
    return {"x_camera": x}


def padded() -> Changed:
    x = frames()
    first = int(np.flatnonzero(np.isfinite(x))[0])
    x[:60] = x[first]
    return {"x_camera": x}


def left_the_picture() -> Changed:
    x = frames()
    far = int(np.nanargmax(x))
    x[far:] = x[far]
    return {"x_camera": x}


def blurred() -> Changed:
    x = frames()
    at = slice(x.size // 2, x.size // 2 + 400)
    x[at] += 4e-4 * random().normal(size=400)
    return {"x_camera": x}


def too_loud() -> Changed:
    return {"acc_recoil": 1.08 * samples("acc_recoil")}


@dataclass(frozen=True)
class Fault:
    """A fault, the check that must find it, and the others that have reason to."""

    make: Callable[[], Changed]
    channel: str
    check: str
    verdict: str
    advice: str
    others: frozenset[str] = field(default_factory=frozenset)
    align_again: bool = False
    rig: Callable[[str], str] | None = None


def fault(make, channel, check, verdict, advice, *others, **more) -> Fault:
    return Fault(make, channel, check, verdict, advice, frozenset(others), **more)


def wider_range(text: str) -> str:
    return text.replace("range = [-5000.0, 5000.0]", "range = [-500000.0, 500000.0]")


def narrower_range(text: str) -> str:
    return text.replace("range = [-5000.0, 5000.0]", "range = [-1000.0, 1000.0]")


MOTION = ("velocity", "impulse", "braking")
"""What is wrong with the acceleration's or the pressure's integral shows in these as well."""

FAULTS = [
    fault(nothing, "acc_recoil", "range", "fail", "raise the range beyond 1.5e+03", *MOTION, rig=narrower_range),
    fault(flat_top, "acc_recoil", "flat tops", "warn", "raise it there before the next shot", *MOTION),
    fault(full_amplifier, "p_breech", "out of band", "warn", "use a smaller gain", *MOTION),
    fault(slew_limited, "acc_recoil", "out of band", "warn", "slew rate", *MOTION, "aliasing", "force sign", "skew",
          "shock response", rig=wider_range),
    fault(offset, "p_brake", "baseline", "fail", "zero the sensor"),
    fault(creeping_level, "acc_recoil", "steady baseline", "warn", "wait until", *MOTION, "filtered noise"),
    fault(loose_cable, "acc_carriage_x", "steady baseline", "warn", "look for a loose cable", "baseline"),
    fault(noisy, "acc_recoil", "filtered noise", "warn", "choose a smaller range", "baseline", "velocity"),
    fault(shifted_gauge, "p_breech", "level after", "warn", "check its mounting", *MOTION),
    fault(zero_shift, "acc_recoil", "zero shift", "warn", "charge amplifier", *MOTION, "alignment", align_again=True),
    fault(zero_shift, "x_camera", "velocity", "warn", "a zero that is off by +", *MOTION),
    fault(too_loud, "x_camera", "velocity", "warn", "wrong sensitivity", *MOTION),
    fault(turned_accelerometer, "acc_recoil", "polarity", "fail", "turn the sensor", "force sign"),
    fault(turned_accelerometer, "acc_recoil", "force sign", "fail", "one of them is turned", "polarity"),
    fault(turned_carriage, "acc_carriage_x", "carriage", "fail", "the sensor is turned", align_again=True),
    fault(halved_carriage, "acc_carriage_x", "carriage", "fail", "its gain, its axis and its cable", align_again=True),
    fault(turned_brake, "p_brake", "polarity", "fail", "set `polarity = -1`", *MOTION, "range"),
    fault(wrong_gain, "shot", "impulse", "warn", "compare the gains"),
    fault(wrong_unit, "shot", "impulse", "fail", "compare every gain"),
    fault(wrong_brake_gain, "shot", "braking", "warn", "check both gauges"),
    fault(late_accelerometer, "acc_recoil", "skew", "warn", "declare it as `delay_s`"),
    fault(rattling, "acc_recoil", "spectral gap", "warn", "choose the cut-off", *MOTION, "aliasing", "skew"),
    fault(folded, "acc_recoil", "aliasing", "warn", "raise the sampling rate"),
    fault(rectified, "acc_recoil", "shock response", "warn", "clipped on one side", *MOTION, "aliasing", "force sign",
          "skew", "zero shift", "baseline", rig=wider_range),
    fault(hum, "p_brake", "hum", "warn", "a ground loop", "steady baseline", "filtered noise"),
    fault(held, "acc_carriage_y", "held values", "warn", "updates were lost"),
    fault(slow_updates, "gyro_tipping", "held values", "warn", "updated more slowly"),
    fault(lost, "p_brake", "losses", "warn", "check the cable"),
    fault(stuck, "x_camera", "repeated frames", "warn", "track it again", "jumps"),
    fault(jumping, "x_camera", "jumps", "warn", "track it again"),
    fault(padded, "x_camera", "held ends", "warn", "export the track without filling"),
    fault(left_the_picture, "x_camera", "held ends", "warn", "move the camera back"),
    fault(blurred, "x_camera", "marker noise", "warn", "shorten the exposure"),
]  # fmt: skip


@cache
def clean() -> frozenset[tuple[str, str]]:
    """Give what is not in order before anything is injected."""
    virtual = virtual_shot()
    found = check_shot(FiredShot(virtual.shot, virtual.rig), virtual.shot.alignments, {}, ON)
    return frozenset((c.channel, c.check) for c in found if c.verdict != "ok")


def checks_with(one: Fault) -> tuple[QualityCheck, ...]:
    virtual = virtual_shot()
    rig: Rig = virtual.rig
    if one.rig is not None:
        rig = parse_rig(one.rig(rig.text), rig.path, rig.databases)
    shot: Shot = with_channels(virtual.shot, **one.make())
    alignments: tuple[ClockAlignment, ...] = align_clocks(FiredShot(shot, rig)) if one.align_again else shot.alignments
    return check_shot(FiredShot(replace(shot, alignments=alignments), rig), alignments, {}, ON)


def test_a_shot_without_a_fault_has_no_complaint():
    assert clean() == frozenset()


@pytest.mark.whole_way
@pytest.mark.parametrize("one", FAULTS, ids=lambda f: f"{f.make.__name__}-{f.check}")
def test_a_fault_is_found_by_its_own_check_and_by_no_other_without_reason(one):
    found = checks_with(one)
    own = [c for c in found if (c.channel, c.check) == (one.channel, one.check)]
    assert [c.verdict for c in own] == [one.verdict], [c for c in found if c.verdict != "ok"]
    assert one.advice in own[0].detail
    rest = {c.check for c in found if c.verdict != "ok"} - {one.check} - one.others
    assert not rest, [c for c in found if c.check in rest and c.verdict != "ok"]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["acc_recoil", "p_breech", "p_brake", "acc_carriage_x", "gyro_tipping", "x_camera"])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_samples_that_are_no_number_are_told_and_stop_nothing(name, value):
    virtual = virtual_shot()
    odd = np.array(virtual.shot.channels[name].samples, dtype=np.float64)
    odd[:: odd.size // 20] = value
    shot = replace(with_channels(virtual.shot, **{name: odd}), alignments=(), quality=())
    alignments = align_clocks(FiredShot(shot, virtual.rig))
    checks = check_shot(FiredShot(replace(shot, alignments=alignments), virtual.rig), alignments, {}, ON)
    # of a camera track up to 2 % may be lost, and 1 % is
    assert name == "x_camera" or [c for c in checks if c.channel == name and c.verdict != "ok"]
    found = identify_shot(FiredShot(replace(shot, alignments=alignments, quality=checks), virtual.rig), Options())
    low, high = found.chosen.estimate.interval_kg
    assert not found.valid or low < virtual.truth["m3"] < high


def test_an_accelerometer_without_a_sample_is_refused_where_no_camera_followed_the_recoil():
    virtual = virtual_shot()
    silent = np.full(virtual.shot.channels["acc_recoil"].samples.shape, np.nan)
    shot = without_channels(with_channels(virtual.shot, acc_recoil=silent), "x_camera")
    with pytest.raises(IdentificationError, match="no sample of the recoiling part's accelerometer"):
        identify_shot(FiredShot(shot, virtual.rig), Options())
