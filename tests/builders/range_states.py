"""States of a day at the range, as the armed screen is to show them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.capture.status import ChannelStatus, SourceStatus
from recoil_acquisition.devices.device import Counters
from recoil_acquisition.quantities.unit_choice import UnitChoice
from recoil_acquisition.shot.usability import Usability
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import FigureCode, RangeFigure, RangeShot, RangeSource, RangeState
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from recoil_daq.live.shot import ShotState
from recoil_daq.terminal.verdict_line import VerdictLine

_DAQ = SourceStatus("daq", "dewetron", 12.8e6, 0.03, Counters(received=1, counter_gaps=0), "")
_CAN = SourceStatus("can", "can", 2157.0, 0.0, Counters(received=1, counter_gaps=0, error_frames=1), "", "frames")
_IMU = SourceStatus("imu", "serial", 42_600.0, 0.02, Counters(received=1, counter_gaps=2, bad=2), "")

SOURCES = (
    RangeSource("daq", "dewetron", "live", _DAQ, growing=(("0003_daq.dmd", 48_000_000),)),
    RangeSource("can", "can", "live", _CAN),
    RangeSource("imu", "serial", "live", _IMU),
    RangeSource("camera", "camera", "for files", None, "0002_camera.csv", ("0003",), (), 12.0, 108.0),
)
CHANNELS = (
    ChannelStatus("acc_recoil", "daq", "m/s^2", Level(-2.1, -3.0, 1.0), (-5000.0, 5000.0), None, (-2260.0, 1240.0)),
    ChannelStatus("acc_carriage_x", "daq", "m/s^2", Level(0.1, -0.4, 0.4), (-500.0, 500.0), None, (-33.2, 20.9)),
    ChannelStatus("acc_carriage_y", "daq", "m/s^2", Level(9.8, 9.6, 9.9), (-500.0, 500.0), None, (-19.7, 36.8)),
    ChannelStatus("p_breech", "daq", "Pa", Level(2e4, -1e4, 3e4), (0.0, 300e6), 5e6, (-8e5, 131.4e6)),
    ChannelStatus("p_brake", "can", "Pa", Level(3e4, 2e4, 4e4), (0.0, 16e6), None, (-4e4, 7.48e6)),
    ChannelStatus("p_recuperator", "can", "Pa", Level(1.66e6, 1.65e6, 1.67e6), (0.0, 8e6), None, (1.6e6, 3.1e6)),
    ChannelStatus("acc_recoil_can", "can", "m/s^2", Level(-1.0, -4.0, 3.0), (-2000.0, 2000.0), None, (-80.4, 1418.0)),
    ChannelStatus("gyro_carriage", "imu", "rad/s", Level(-8e-4, -2e-3, 1e-3), (-1.0, 1.0), None, (-6.4e-3, 1.93e-2)),
    ChannelStatus("gyro_tipping", "imu", "rad/s", Level(0.0, -1e-3, 1e-3), (-1.0, 1.0), None, (-0.042, 0.133)),
    ChannelStatus("imu_acc_x", "imu", "m/s^2", Level(0.02, -0.1, 0.1), (-160.0, 160.0), None, (-8.8, 6.92)),
)
WARNED = (
    "can: 1 error frame on the bus, counted from -0.360 s; check bit rate, termination and cable before the next shot",
    "imu: 2 of 1254 (0.159 %, limit 1 %) in 2 gaps of the counter, at most 1 in a row, 2.00 ms (limit 10 ms)",
)
MASS = {
    "value": 783.0, "u": 2.65, "U95": [777.8, 788.2], "E_n": 0.2, "valid": True, "reason": "", "report": "reports/0003",
}  # fmt: skip
FIGURES = (
    RangeFigure(FigureCode.BREECH, 131.4e6, "Pa"),
    RangeFigure(FigureCode.STROKE, 0.822, "m"),
    RangeFigure(FigureCode.SPEED, 11.2, "m/s"),
)
PEAKS = {"p_breech": (-8e5, 131.4e6)}


def usable(name: str, **changes: Any) -> RangeShot:
    """Return a shot that has its verdict and its mass."""
    made = RangeShot(
        name, ShotState.USABLE, settled=True, verdict=VerdictLine(Usability.USABLE, (), WARNED), peaks=PEAKS,
        mass=MASS, figures=FIGURES, age_s=100.0,
    )  # fmt: skip
    return replace(made, **changes)


CLIPPED = RangeShot(
    "0001", ShotState.NOT_USABLE, settled=True, why="p_breech at the high end of its range",
    verdict=VerdictLine(Usability.NOT_USABLE, ("p_breech at the high end of its range",)), age_s=400.0,
)  # fmt: skip
SPOILT = RangeShot(
    "0003", ShotState.NOT_USABLE, settled=True, age_s=4.0, figures=FIGURES, peaks=PEAKS,
    mass={**MASS, "valid": False, "reason": "the peak of p_breech is cut off"},
    why="p_breech at the high end of its range: 12 of 50000 samples (limit 0); choose a larger range, or a gauge for "
    "400 MPa, before the next shot",
)  # fmt: skip
"""A shot that is not usable, with what is known of it."""
TRIGGERED = Notice(7, "2026-11-26T14:02:33.120+00:00", "trigger (p_breech at 5.1 MPa)")
CAPTURED = Notice(8, "2026-11-26T14:02:34.310+00:00", "shot 0003 captured: 1.000 s; waiting for files of camera")
CAMPAIGN = {
    "shots": ["0001", "0002"], "value": 782.4, "u": 1.8, "U95": [778.8, 786.0], "changes": [], "valid": True,
    "reason": "", "expected": {"shots": 4, "u": 1.4},
}  # fmt: skip


def day(**changes: Any) -> RangeState:
    """Return a range that is armed again, with its last shot on the way."""
    waiting = RangeShot("0003", ShotState.WAITING, ("camera",), left_s=108.0)
    made = RangeState(
        utc="2026-11-26T14:02:46.000+00:00", rig="mixed", virtual=False, state="armed", since_s=2467.0, alert="",
        next_shot="0004", sources=SOURCES, channels=CHANNELS, shots=(CLIPPED, usable("0002"), waiting), triggered=3,
        armed_s=7200.0, decision=None, alarms=0, cautions=(), notices=(TRIGGERED, CAPTURED), campaign=CAMPAIGN,
        added_mass="", asked="", out=Path("shots"), watched=Path("incoming"), folder_made=False,
        disk_free_bytes=77_000_000_000, journal_bytes=1_570_000_000, unsynced_s=0.1, unseen_bytes=0,
    )  # fmt: skip
    return replace(made, **changes)


_HOME = (*SOURCES[:3], replace(SOURCES[3], awaited=(), waited_s=None, left_s=None, last_file="0003_camera.csv"))
_GROWING = replace(SOURCES[3], growing=(("0003_camera.csv", 1_230_000),))
_LOST = replace(SOURCES[2], state="lost", live=replace(_IMU, age_s=4.2))
_VERDICT = Notice(9, "2026-11-26T14:02:49.020+00:00", "shot 0003 usable, 2 warnings (key w)")
STATES = {
    "armed": day(
        shots=(), triggered=0, campaign=None, notices=(), next_shot="0001", folder_made=True, virtual=True,
        sources=(*_HOME[:3], replace(_HOME[3], last_file="")),
        channels=tuple(one.with_peak(None) for one in CHANNELS),
    ),
    "waiting": day(sources=(*SOURCES[:3], _GROWING)),
    "shot": day(
        shots=(CLIPPED, usable("0002", age_s=300.0), usable("0003", provisional=True)), sources=_HOME,
        notices=(CAPTURED, _VERDICT),
    ),
    "usable": day(
        shots=(CLIPPED, usable("0002", age_s=300.0), usable("0003", age_s=4.0)), sources=_HOME,
        notices=(CAPTURED, _VERDICT),
    ),
    "not_usable": day(
        shots=(usable("0001", age_s=700.0), usable("0002", age_s=300.0), SPOILT), sources=_HOME,
        notices=(CAPTURED, replace(_VERDICT, text=f"shot 0003 not usable: {SPOILT.why}")),
    ),
    "seen": day(
        shots=(usable("0001"), usable("0002", age_s=300.0, excluded="misfire"), replace(SPOILT, seen=True)),
        sources=_HOME, notices=(CAPTURED,),
    ),
    "baud": day(
        alert="imu NOT UNDERSTOOD: bytes come, none of them good: check baud rate, framing and cable",
        sources=(*SOURCES[:2], replace(SOURCES[2], state="not understood"), _HOME[3]), shots=(usable("0003"),),
    ),
    "note": day(shots=(usable("0003"),), sources=_HOME, asked="note on shot 0003 (Enter): wind from the left, 5 m/s"),
    "bar": day(units=UnitChoice.named(["bar", "g"]), shots=(usable("0003"),), sources=_HOME, notices=()),
    "recording": day(state="recording", since_s=0.4, sources=_HOME, shots=(CLIPPED, usable("0002"))),
    "disarmed": day(state="disarmed", sources=_HOME, shots=(usable("0003", mass=None, mass_to_come=True),)),
    "alarm": day(
        state="disarmed", sources=_HOME, shots=(usable("0003"),),
        alert="ALARM: p_breech crossed while disarmed at 14:05:01Z, at 5.2 MPa, 3 times: no shot is made; a arms, "
        "d takes this away",
        cautions=(
            "calibration overdue: p_brake (was due 2026-03-01)", "zero of p_breech +0.21 MPa since before 0003",
        ),
    ),
    "lost": day(
        alert="imu LOST: it is opened as soon as it is back",
        sources=(*SOURCES[:2], _LOST, SOURCES[3]), unsynced_s=2.4, unseen_bytes=7700,
        disk_free_bytes=900_000_000, added_mass="120 kg, u 0.1 kg",
    ),
    "quit": day(asked="ARMED: end the session? y yes, n go on"),
    "many": day(
        shots=(
            *(usable(f"00{n:02d}", age_s=900.0) for n in range(2, 14)), replace(CLIPPED, name="0014"),
            usable("0015", mass={**MASS, "valid": False, "reason": "one clock is ambiguous"}),
            *(RangeShot(f"00{n}", ShotState.WAITING, ("camera",), left_s=90.0 + n) for n in (16, 17, 18)),
        ),
        next_shot="0019", notices=(TRIGGERED,),
        sources=(*SOURCES[:3], replace(SOURCES[3], awaited=("0016", "0017", "0018"), left_s=106.0)),
    ),
    "words": day(shots=(CLIPPED, usable("0002"), usable("0003"))),
}  # fmt: skip
"""States by name; that of the words is looked at in words."""
SIZES = ((60, 15), (80, 24), (120, 40))


def screen_text(name: str, width: int, height: int) -> str:
    """Return the screen of a state on a terminal of some size, without its colours."""
    drawn = picture(STATES[name], Look(width, height, words=name == "words"))
    return "\n".join(line.plain.rstrip() for line in drawn.lines)


def lines_of(state: RangeState, width: int = 80, height: int = 24, **look: bool) -> list[str]:
    """Return the lines of a screen without what is blank at their ends."""
    return [line.plain.rstrip() for line in picture(state, Look(width, height, **look)).lines]


def line_of(lines: list[str], word: str) -> str:
    """Return the first line that begins with a word."""
    return next(line for line in lines if line.startswith(word))
