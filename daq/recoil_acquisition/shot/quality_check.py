"""Quality checks: their names, and the outcome of one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

from recoil_acquisition.measured import beside, worded
from recoil_acquisition.remark import Caution, Note, Reason, Remark

Verdict = Literal["ok", "warn", "fail"]


class Check(StrEnum):
    """Name of a quality check, as shot files and documents write it."""

    # files, and what was lost on the way from the devices
    FILE = "file"
    FILE_NAMES = "file names"
    READER = "reader"
    MISSING_FRAMES = "missing frames"
    STREAM = "stream"
    LATE_STAMPS = "late stamps"
    """Stamps that come in bursts or behind a stall."""
    PREVIEW = "preview"
    """What was read live of an instrument that writes a file of its own, which takes its place."""
    PREVIEW_COMPARED = "preview compared"
    """How that stands beside the file that took its place."""
    DELIVERY = "delivery"
    CONNECTION = "connection"
    KERNEL_DROPS = "kernel drops"
    DAMAGED_ENTRIES = "damaged entries"
    ERROR_FRAMES = "error frames"
    UNANSWERED = "unanswered"
    PRE_TIME = "pre-time"
    TRIGGER = "trigger"
    JOURNAL = "journal"
    # clocks
    CLOCK_FIT = "clock fit"
    CLOCK_STEPS = "clock steps"
    CLOCK_STAMPS = "clock stamps"
    ALIGNMENT = "alignment"
    # one channel by itself
    LOSSES = "losses"
    CONSTANT = "constant"
    CODE = "code"
    """A value that stands for lost samples."""
    OVERFLOW = "overflow"
    """Jumps over a whole word."""
    RANGE = "range"
    FLAT_TOPS = "flat tops"
    HELD_VALUES = "held values"
    TIME_STEPS = "time steps"
    REFERENCE_GAP = "gap of the reference"
    """Samples are missing in the motion by which another clock, that is in doubt, is aligned."""
    BASELINE = "baseline"
    STEADY_BASELINE = "steady baseline"
    LEVEL_AFTER = "level after"
    FILTERED_NOISE = "filtered noise"
    HUM = "hum"
    OUT_OF_BAND = "out of band"
    ALIASING = "aliasing"
    SPECTRAL_GAP = "spectral gap"
    SHOCK_RESPONSE = "shock response"
    POLARITY = "polarity"
    CALIBRATION = "calibration"
    SENSOR = "sensor"
    """A sensor's certificate that may be of another channel's."""
    SET_ASIDE = "set aside"
    """Mark of a channel without which the mass is found."""
    # a camera's frames and tracks
    FRAME_RATE = "frame rate"
    LOST_FRAMES = "lost frames"
    PICTURES = "pictures"
    DISTANCE = "distance"
    REPEATED_FRAMES = "repeated frames"
    HELD_ENDS = "held ends"
    MARKER_NOISE = "marker noise"
    JUMPS = "jumps"
    BATTERY = "battery"
    PEAK_LOCKING = "peak locking"
    RESIDUAL = "residual"
    # sensors of one motion against one another
    ONSET = "onset"
    SECOND_SENSOR = "second sensor"
    VELOCITY = "velocity"
    CARRIAGE = "carriage"
    FORCE = "force"
    FORCE_SIGN = "force sign"
    IMPULSE = "impulse"
    BRAKING = "braking"
    ZERO_SHIFT = "zero shift"
    SKEW = "skew"
    REST_TO_REST = "rest to rest"
    # of a file that another version wrote
    OTHER = "other"


@dataclass(frozen=True)
class QualityCheck:
    """The outcome of one check of one channel or of the shot.

    Attributes
    ----------
    channel
        Name of the channel, of the clock or source, or ``shot``.
    check
        Kind of the check; `Check.OTHER` of a check that this version does not make.
    verdict
        Outcome: ``ok``, ``warn`` or ``fail``.
    detail
        Sentence with the figure, its limit, and what to do about it; a `recoil_acquisition.measured.Worded` where its
        figures are known.
    written
        Name of the check in the file that it was read from, where that is no `Check`; None of any other.
    """

    channel: str
    check: Check
    verdict: Verdict
    detail: str
    written: str | None = None

    @classmethod
    def named(cls, channel: str, check: str, verdict: Verdict, detail: str) -> QualityCheck:
        """Return what a file states of a check by its name, which another version may have given it."""
        known = check in Check.__members__.values()
        return cls(channel, Check(check) if known else Check.OTHER, verdict, detail, None if known else check)

    @property
    def name(self) -> str:
        """Name of the check, as its file has it."""
        return self.check.value if self.written is None else self.written

    def remark(self) -> Remark:
        """Return it as a reason (it failed), a caution or a note about its channel, with the check as its code."""
        kind = {"fail": Reason, "warn": Caution, "ok": Note}[self.verdict]
        return kind(self.check, self.channel, worded(self.channel, ": ", self.detail))

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types; with the ``figures`` of its detail if that has any."""
        stated = {"channel": self.channel, "check": self.name, "verdict": self.verdict, "detail": str(self.detail)}
        return stated | beside(self.detail)
