"""Remarks on a shot, its record or its mass: sentences that carry a code, and what they are about.

::

    Remark           a sentence with code, subject and severity
    +-- Reason       speaks against the mass (fatal), with the figure, its limit and the remedy
    +-- Caution      changes what samples mean, or a check that only warns (warn)
    +-- Note         what a reader should know although it makes nothing invalid (note)

A remark is its text, so that it is printed and joined as that. Decisions are made by its code, never by its words.
The figures in it are values with units (`recoil_acquisition.measured`) where its text was put together of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Any, ClassVar, Self

from recoil_acquisition.measured import Worded, beside, figures_of


class Severity(StrEnum):
    """How much a remark weighs."""

    NOTE = "note"
    WARN = "warn"
    FATAL = "fatal"
    """The result is not valid, or the shot not usable."""


class ReasonCode(StrEnum):
    """Kind of a reason against a mass.

    Those up to `LOST_FORCE` are of the record, and known at the range; those behind it only an estimate can tell, and
    those from `MASS_STEP` on only a campaign or a target beside the mass.
    """

    CHECK = "check"
    NOISE = "noise"
    RIG = "rig"
    CLOCK = "clock"
    ROLE = "role"
    BASELINE = "baseline"
    COUPLING = "coupling"
    LOST_FORCE = "lost force"
    METHOD = "method"
    SENSOR = "sensor"
    CONSTANCY = "constancy"
    HIDDEN_DRIFT = "hidden drift"
    """A drift of the mass that the shot cannot tell would move it beyond its interval."""
    BREECH_CHAIN = "breech chain"
    CONVERGENCE = "convergence"
    ZERO = "zero"
    RESIDUAL = "residual"
    ROUTES = "routes"
    TRACK = "track"
    TRACE = "trace"
    MASS_STEP = "mass step"
    """The mass changed among the shots."""
    ADDED_MASS = "added mass"
    """What the shot log states as added is off."""
    ADDED_SIGN = "added sign"
    """What the shot log states as added has the other sign."""
    CALIBRATION = "calibration"
    """A sensor is off in all shots."""
    AGREEMENT = "agreement"
    """Shots, masses or forces that should agree do not."""
    MODEL = "model"
    """A model does not describe what was recorded."""
    BALANCE = "balance"
    """Energy or momentum is not conserved."""
    NOT_IDENTIFIED = "not identified"
    """The shot does not tell a quantity."""
    IMPLAUSIBLE = "implausible"
    """A quantity has a value that it cannot have."""


class NoteCode(StrEnum):
    """Kind of a note; those from `CUT` on are notes on a file by its reader."""

    READER = "reader"
    """A note of a reader of another package, which states no kind."""
    NO_LOG_ROW = "no log row"
    """The shot log has no row of the shot: nothing is taken as added."""
    LOG_ROW = "log row"
    """The shot log's row of the shot, or one of no shot."""
    CORRECTION = "correction"
    """A corrected rig file, and what followed from it."""
    SET_ASIDE = "set aside"
    """A channel or a shot that is not used."""
    NOT_USED = "not used"
    """A channel, or frames, that the mass does not hang on."""
    NO_ESTIMATE = "no estimate"
    """A method that gives no mass of the shot."""
    NO_ADVICE = "no advice"
    """A line of advice that could not be worked out, and is left out."""
    FILTER = "filter"
    """The low-pass, and what another would do."""
    THINNED = "thinned"
    """Channels that were thinned for a number soon."""
    UNCHECKED = "unchecked"
    """What an absent sensor would have checked."""
    CLOCK = "clock"
    ROLE = "role"
    """A role without a usable channel."""
    RECORD_END = "record end"
    """The record ends before the recoil does."""
    NOT_IDENTIFIED = "not identified"
    """Samples or quantities that the shot does not tell."""
    NEAR_LIMIT = "near limit"
    """A sensor that is within its limit by little."""
    GAUGE_SCALE = "gauge scale"
    """A gauge whose scale in the shots is told by them, and not by its certificate."""
    ZERO = "zero"
    """A zero that shifted, or that is not known."""
    ADDED_MASS = "added mass"
    AGREEMENT = "agreement"
    """Shots that leave more than their noise allows, of their own rows or between them."""
    MOTION_NOISE = "motion noise"
    """A motion that is far noisier than the rest."""
    CONFIGURATION = "configuration"
    """Configurations that can only mean other parts."""
    SPECIFICATION = "specification"
    """What the mass is compared with."""
    IDENTIFIED_ANEW = "identified anew"
    """A shot whose report was not current."""
    COMPARISON = "comparison"
    """How a result compares with another of the same shot."""
    MODEL = "model"
    """The choice of a model."""
    NOT_CHECKED = "not checked"
    """No file of a source was given to lay beside the rig."""
    SENSITIVITY = "sensitivity"
    """A stated sensitivity is not applied: the file has the measured quantity already."""
    ASSUMPTION = "assumption"
    """Value or condition that is taken for granted: rig file and shot log do not state it."""
    SESSION = "session"
    """A rig file stands in for what a damaged journal says of its session."""
    CUT = "cut"
    """The file was cut off, or its recorder did not finish it."""
    LOST = "lost"
    """Samples or frames are missing between others, or have no value."""
    LEFT_OUT = "left out"
    """Something that the file holds is not read, or not given as a signal."""
    SECOND_RECORDING = "second recording"
    """The file holds another recording behind the first one."""
    TIME = "time"
    """Where instants come from, and what the file does not state of them or of its start."""
    OWN_RATE = "own rate"
    """A channel of a table is slower than its rows."""
    CONTRADICTION = "contradiction"
    """Two statements differ; the note says which of them counts."""
    UNITS = "units"
    """A unit is not stated, or a stated scaling is not applied."""
    NAMES = "names"
    """A name is that of several signals, or is not what the file has."""
    UNMATCHED = "unmatched"
    """The CAN database and the log do not hold the same messages."""
    UNSEEN = "unseen"
    """What the format cannot show: missing frames without a counter, buses that it does not store."""
    TRACK = "track"
    """What tracking software did to positions, or got wrong in them."""
    EXCERPT = "excerpt"
    """The recording is a part of a longer one."""


class CautionCode(StrEnum):
    """Kind of a caution."""

    LOSS = "loss"
    """Records of a source are missing from a journal."""
    LOG_FAULT = "log fault"
    """The shot log has no row of the shot, or what it says is not used."""
    DAMAGED_ENTRIES = "damaged entries"
    """Entries of a log are damaged and were left out."""
    UNKNOWN_ENTRIES = "unknown entries"
    """Entries of a log are written in a way that is not known, and were not read."""
    NOT_INCREASING = "not increasing"
    """Frames whose stamps do not increase were left out."""
    LATE_STAMPS = "late stamps"
    """Stamps come in bursts or behind a stall: samples are dated late."""
    OTHER_STARTS = "other starts"
    """Signals are dated apart by their file, which does not say by how much."""
    OTHER_COUNT = "other count"
    """A counter counts otherwise than the rig declares: gaps are not what they seem."""
    DOUBTFUL_START = "doubtful start"
    """A file states a start that no instrument can have: it dates nothing."""


class Remark(Worded):
    """One sentence with its code, what it is about, and the figures that its text has.

    Attributes
    ----------
    code
        Kind of the remark, a member of a small StrEnum.
    about
        Channel, clock, source, sensor, role, method, file or row of the budget; None where it is about none of them.
    severity
        Weight of all remarks of the class.
    """

    __slots__ = ("about", "code")
    code: StrEnum
    about: str | None
    severity: ClassVar[Severity]

    def __new__(cls, code: StrEnum, about: str | None, text: str) -> Self:
        """Attach code and subject to a text."""
        self = super().__new__(cls, text, figures_of(text))
        self.code, self.about = code, about
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep code, subject and figures where it is given to another process."""
        return type(self), (self.code, self.about, Worded(self, self.figures))

    def again(self, text: str) -> Self:
        """Return a remark of the same code and subject in other words."""
        return type(self)(self.code, self.about, text)

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, as an entry of ``findings``; with ``figures`` if it has any."""
        said = {"code": self.code.value, "about": self.about, "severity": self.severity.value, "text": str(self)}
        return said | beside(self)


class Reason(Remark):
    """Reason against a shot's mass, or a failed check: the figure, its limit, and what to do about it."""

    __slots__ = ()
    about: str
    severity = Severity.FATAL


class Note(Remark):
    """Remark that a reader should know although it makes nothing invalid."""

    __slots__ = ()
    severity = Severity.NOTE


class Caution(Remark):
    """Warning that no summary hides: samples were left out, their instants are not what they seem, or a check warns."""

    __slots__ = ()
    severity = Severity.WARN


def findings_of(*remarks: Iterable[Remark]) -> list[dict[str, Any]]:
    """Return remarks as the ``findings`` of a document, in their order."""
    return [one.to_json() for some in remarks for one in some]
