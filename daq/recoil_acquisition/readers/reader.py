"""Interface of every reader of an instrument's files.

A `Reader` says from the beginning of a file whether it is its own, and opens it as a `Recording`:
headers first, samples when asked for. The rules are checked for every reader by one suite of
functions, `recoil_acquisition.conformance`, which other packages may call on their own:

- headers before samples; the promised dtype; unknown names say which exist;
- reading a part is the same as reading all and cutting; parts concatenate;
- the time base is as long as the samples and increases strictly;
- a file cut at any byte gives a `recoil_acquisition.errors.CorruptFileError`, or fewer samples and a note, never
  another exception and never a hang;
- nothing is resampled, filled or converted: values are in the file's own unit, lost ones NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.recording import Recording


@dataclass(frozen=True)
class Declarations:
    """Declarations of the rig about a source, because its files do not carry it.

    Attributes
    ----------
    clock
        Name of the source, which names its clock.
    database
        Text of the CAN database (DBC, KCD, SYM or ARXML) of a ``can`` source.
    bus
        Bus of the log that a ``can`` source is, by number or name; None where the log has one.
    captured_bus
        Bus of a live capture that a ``can`` source is, where its device delivers several; None where it delivers one.
    counters
        Signals of a ``can`` source, such as ``Message.Signal``, that count the messages they are in.
    framing
        Declared framing of a ``serial`` source.
    frame_rate_hz
        Record rate of a ``camera`` source.
    scale_mm_per_px
        Scale of a ``camera`` source whose tracks are in pixels.
    layout
        Layout of the text table of a ``dewetron`` or ``camera`` source whose files do not state it themselves.
    """

    clock: str
    database: str | None = None
    bus: int | str | None = None
    captured_bus: int | str | None = None
    counters: tuple[str, ...] = ()
    framing: Mapping[str, Any] | None = None
    frame_rate_hz: float | None = None
    scale_mm_per_px: float | None = None
    layout: Mapping[str, Any] | None = None


class Reader(Protocol):
    """One format."""

    @property
    def name(self) -> str:
        """Name of the format, as users know it."""

    @property
    def kind(self) -> str:
        """Kind of source that writes it: ``dewetron``, ``can``, ``serial`` or ``camera``; ``live``: several of them."""

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Usual endings of its files: a hint for people, never used to recognise a file."""

    def claims(self, head: Head) -> Claim:
        """Say from the beginning of a file how sure it is that the file is of this format."""

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file.

        Raises
        ------
        ReadError
            If the file is not what it seems, with the line or byte.
        """
