"""Small shots with everything in them that a shot can hold."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel, RawCounts, Step
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.shot.acquisition import AcquiredEvent, AcquiredSource, Acquisition, TriggerDecision
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, InputFile, Shot

RIG_TEXT = 'schema = "recoil-daq/rig/1"\nname = "bench"  # Prüfstand, µ = 0,1\n'


CLOCK_FIT = {
    "device_zero_ns": 40_000_000_000,
    "host_zero_ns": 5_000_000_000_000,
    "offset_s": 3e-4,
    "u_offset_s": 2.5e-6,
    "drift": -1.25e-5,
    "u_drift": 4e-7,
    "steps": [{"index": 90, "device_ns": 1, "host_ns": 5_001_250_000_000, "step_s": 0.5, "u_step_s": 3e-5}],
    "wrong_stamps": 0,
    "order_faults": None,
    "typical_delay_s": 2e-4,
    "largest_delay_s": 1.5e-2,
    "scatter_s": 1e-6,
    "frames": 1200,
}
"""How a device's clock went, with one step."""


def acquired_source(name: str, kind: str, file: str, **changes: Any) -> AcquiredSource:
    """Make the record of a source that delivered everything and met nothing."""
    sound = AcquiredSource(name, kind, file, 150, 60_000, 0.5, False, 0.01, 0, 0, 0, None, 4, -2.0, ())
    return replace(sound, **changes)


def make_acquisition(shot: str = "0007", rig: str = "bench", **changes: Any) -> Acquisition:
    """Make the record of a shot with a bus and a port, of 0.5 s before and 1 s behind the trigger."""
    sound = Acquisition(
        shot=shot,
        rig=rig,
        trigger_ns=5_000_500_000_000,
        trigger_utc="2026-03-01T09:15:00.750000",
        pre_s=0.5,
        post_s=1.0,
        pre_actual_s=0.5,
        duration_s=1.5,
        decisions=(TriggerDecision(0.0, "trigger", "", "p_brake", 2.5e6),),
        sources=(
            acquired_source("can", "can", f"{shot}.rdlog"),
            acquired_source("imu", "serial", f"{shot}.rdlog", events=(AcquiredEvent(-2.0, "opened", "Größe µ"),)),
        ),
    )
    return replace(sound, **changes)


def recorder_channel(
    name: str,
    quantity: str,
    time_base: TimeBase,
    *,
    role: str = "",
    seed: int = 0,
    scale: float = 100.0,
    counts: bool = True,
) -> Channel:
    """Make a channel of a 24-bit recorder: noise, with its counts beside it."""
    stored = np.random.default_rng(seed).integers(-(2**23), 2**23, time_base.count).astype(np.int32)
    gain = scale / 2**23
    return Channel(
        name=name,
        quantity=quantity,
        samples=gain * stored.astype(np.float64),
        time_base=time_base,
        signal=f"AI 1/{name}",
        role=role,
        u_rel=0.005,
        resolution=gain,
        raw=RawCounts(stored, gain, 0.0, "V") if counts else None,
        history=(Step("convert to SI", "0.1.0", {"unit": "m/s2", "polarity": -1, "chain": {"gain": [1.0, None]}}),),
    )


def make_shot(count: int = 400, frames: int = 60) -> Shot:
    """Make a shot of four clocks: a recorder, a camera with lost frames, a bus of two time bases, a serial sensor.

    Parameters
    ----------
    count : int
        Samples of the recorder at 20 kHz.
    frames : int
        Frames of the camera at 5 kHz, four of them missing from the file and one lost.
    """
    started = AbsoluteStart("2026-03-01T10:15:00.250", "unknown", "preamble, line 4")
    dewetron = TimeBase.uniform("dewetron", -0.01, 5e-5, count, started)
    numbers = np.delete(np.arange(frames + 4), [7, 8, 9, 30])
    camera = TimeBase.stamped("camera", numbers / 5000.0)
    position = np.linspace(0.0, 0.4, frames) ** 2
    position[frames // 2] = np.nan
    bus = TimeBase.stamped("can", _stamps(25, 1e-3, seed=3))
    slow = TimeBase.stamped("can", _stamps(10, 1e-2, seed=4))
    serial = TimeBase.uniform("imu", 0.0, 1 / 3000, 90, AbsoluteStart("2026-03-01T08:15:00", "UTC", "header"))
    channels = [
        recorder_channel("p_breech", "pressure", dewetron, role="breech_pressure", seed=1, scale=3e8),
        recorder_channel("acc_recoil", "acceleration", dewetron, role="recoil_acceleration", seed=2, scale=5000.0),
        Channel("x_recoil", "displacement", position, camera, "muzzle/X", "recoil_displacement", 0.002),
        recorder_channel("temperature", "temperature", slow, counts=False, seed=5),
        recorder_channel("rate_tipping", "angular_rate", bus, role="tipping_rate", seed=6),
        replace(recorder_channel("rate_carriage", "angular_rate", bus, role="carriage_rate", seed=7), raw=None),
        Channel("acc_imu", "acceleration", np.linspace(-1, 1, 90, dtype=np.float32), serial, "ax"),
    ]
    return Shot(
        name="0007",
        rig_name="bench",
        rig_text=RIG_TEXT,
        reference_clock="dewetron",
        channels={channel.name: channel for channel in channels},
        alignments=(
            ClockAlignment(
                "camera",
                -0.0123,
                1.5e-5,
                2e-5,
                1e-6,
                "ambiguous",
                "motion",
                ("two candidates", "µ"),
                {"gain": 1.01, "candidates": [[-0.0123, 0.9], [0.002, 0.89]], "note": None},
            ),
            ClockAlignment("can", 0.25, 1e-4, 0.0, 5e-5, "ok", "fixed"),
            ClockAlignment("imu", 0.0, float("inf"), 0.0, float("nan"), "failed", "redundant", ("no common motion",)),
        ),
        quality=(
            QualityCheck("acc_recoil", Check.RANGE, "ok", "0 of 400 samples at full scale"),
            QualityCheck("x_recoil", Check.LOST_FRAMES, "warn", "1 of 60 frames lost, limit 5 %"),
            QualityCheck("imu", Check.ALIGNMENT, "fail", "no common motion; mount the sensor rigidly"),
        ),
        inputs=(
            InputFile("shot_daq.csv", "ab" * 32, 123_456, "dewetron", "Dewesoft text export"),
            InputFile("Schuß 7.txt", "0f" * 32, 2**33, "camera", "ProAnalyst text export"),
        ),
        started="2026-03-01T10:15:00.250",
        started_source="Schuß 7.csv, header of the file",
        history=(
            Step("assemble", "0.1.0", {"files": ["shot_daq.csv", "Schuß 7.txt"]}),
            Step("align", "0.1.0", {"drift_allowance": 5e-5}),
        ),
        databases={"rig.dbc": 'VERSION ""\r\n', "empty.dbc": ""},
        acquisition=make_acquisition(),
        clock_fits={"can": CLOCK_FIT, "imu": {**CLOCK_FIT, "u_drift": None, "steps": []}},
    )


def _stamps(count: int, step_s: float, seed: int) -> NDArray[np.float64]:
    return np.asarray(np.cumsum(step_s * np.random.default_rng(seed).uniform(0.5, 1.5, count)), dtype=np.float64)
