"""One opened file of one instrument: headers first, samples when they are asked for.

Formats differ in how they say what a file holds. Once that is known, a channel is a header, a time base and a function
that reads some of its samples, whatever the format, and a recording is its channels with what the file says of itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import (
    CorruptFileError,
    FileEnd,
    MissingChannelError,
    NoSignalError,
    ReadError,
    RecoilDaqError,
)
from recoil_acquisition.listing import Listed, Listing
from recoil_acquisition.processes.shortage import REMEDY, is_shortage
from recoil_acquisition.readers.overload import about_overload, find_marks, may_have_marks
from recoil_acquisition.readers.statements import (
    MOST_SHOWN,
    NOTHING,
    Statements,
    about_open,
    about_outside,
    about_rates,
    about_starts,
    about_usual_code,
    outside,
    usual_code,
)
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark
from recoil_acquisition.track import Track

T = TypeVar("T")

_UNSCALED_REMEDY = "export it as numbers in its unit"


@dataclass(frozen=True)
class SignalHeader:
    """Description of a signal in its file, before its samples are read.

    Attributes
    ----------
    name
        Name in the file, without the unit.
    unit
        Unit as the file spells it; empty if the file states none.
    dtype
        Type of the samples that `Recording.read` returns; ``float64`` unless the reader says otherwise.
    metadata
        Other statements of the file on the signal, JSON types only.
    """

    name: str
    unit: str
    sample_count: int
    dtype: str = "float64"
    metadata: Mapping[str, Any] = field(default_factory=dict)


def _nothing_to_say(_name: str) -> None:
    return None


@dataclass(frozen=True, eq=False)
class StoredChannel:
    """One channel of a file.

    Attributes
    ----------
    time_base
        Instants of its samples; a function that returns them where finding them takes reading numbers.
    samples
        Function that reads samples ``start`` to ``stop`` (0 <= start <= stop <= count) into an array of the caller's
        own, float64, shape (stop - start,), in the file's unit, lost ones NaN.
    raw
        Function that reads the stored integers of the same samples; None if there are none.
    overloads
        Function that counts the samples that the file marks as an overload in its own way, and which `samples` gives as
        NaN; None if it marks none.
    beside
        All that stands beside its samples, used or not: what becomes of the rest is decided where it is recorded.
    """

    header: SignalHeader
    time_base: TimeBase | Callable[[], TimeBase]
    samples: Callable[[int, int], NDArray[np.float64]]
    raw: Callable[[int, int], RawCounts | None] | None = None
    overloads: Callable[[], int] | None = None
    beside: Statements = NOTHING


@contextmanager
def map_to_corrupt_file(path: Path, expected: str) -> Iterator[None]:
    """Turn what a library raises over a damaged file into a `CorruptFileError`.

    Parameters
    ----------
    expected
        Name of what the file should have been, for the message.

    Raises
    ------
    ReadError
        If the file cannot be read at all, or there is not enough memory for what it states.
    CorruptFileError
        If anything else is raised than this project's own errors: libraries answer damaged bytes with
        whatever exception the first wrong number leads to.
    """
    try:
        yield
    except RecoilDaqError:
        raise
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise ReadError(f"cannot be read: {error.strerror or error}", path=path, remedy="check the name") from error
    except Exception as error:
        if is_shortage(error):
            raise ReadError(
                "there is not enough memory to read it", path=path, found=type(error).__name__, remedy=REMEDY
            ) from error
        text = " ".join(str(error).split())[:200] or "no message"
        raise CorruptFileError(
            "the file is damaged", path=path, expected=expected, found=f"{type(error).__name__}: {text}",
            remedy="copy or export it again",
        ) from error  # fmt: skip


def _about_times_apart(channels: Iterable[StoredChannel]) -> Iterator[Note]:
    """Say which channels have no instant in common with the others, of those whose instants are known by their head."""
    spans: dict[tuple[float, float], list[str]] = {}
    for one in channels:
        if isinstance(one.time_base, TimeBase) and one.time_base.count:
            spans.setdefault((one.time_base.start_s, one.time_base.end_s), []).append(one.header.name)
    runs: list[tuple[float, float, list[str]]] = []
    for (start_s, end_s), names in sorted(spans.items()):
        if runs and start_s <= runs[-1][1]:
            first_s, last_s, known = runs[-1]
            runs[-1] = first_s, max(last_s, end_s), known + names
        else:
            runs.append((start_s, end_s, names))
    if len(runs) < 2:
        return
    shown = [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}, {start_s:.9g} to {end_s:.9g} s"
        for start_s, end_s, names in runs[:MOST_SHOWN]
    ]
    more = [f"{len(runs) - MOST_SHOWN} more"] if len(runs) > MOST_SHOWN else []
    text = f"channels have no instant in common: {'; '.join([*shown, *more])}: these may be several recordings"
    yield Note(NoteCode.TIME, None, text)


class Recording(Listed):
    """One opened file of one instrument.

    What takes reading numbers may be given as a callable, which is asked when somebody wants to know.

    Parameters
    ----------
    reader
        Name of the reader that opened it.
    channels
        Channels with unique names, in the file's order.
    metadata
        Statements of the file on itself: preamble, versions, counters of losses; JSON types only.
    notes
        Notes that a user must know before trusting the samples: losses, repairs, contradictions. A text without a code
        becomes a note of a reader.
    incomplete
        Sign by which it shows that the file was cut off; empty if nothing shows that.
    absolute_start
        Wall-clock time of the recording's time zero, if the file states one.
    tracks
        Function that returns the markers' paths of a camera's file.
    check_name
        Function that is given a name that no channel has, and raises `ReadError` if it knows why.
    aliases
        Other names of channels, under which they are found too.
    """

    def __init__(
        self,
        path: Path,
        reader: str,
        channels: Sequence[StoredChannel],
        *,
        metadata: Mapping[str, Any],
        notes: Sequence[str] | Callable[[], Sequence[str]] = (),
        incomplete: str = "",
        absolute_start: AbsoluteStart | Callable[[], AbsoluteStart | None] | None = None,
        tracks: Callable[[], tuple[Track, ...]] = tuple,
        check_name: Callable[[str], None] = _nothing_to_say,
        aliases: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.path, self.reader, self.metadata, self.incomplete = path, reader, metadata, incomplete
        self._refused = {one.header.name: one.beside.refusal for one in channels if one.beside.refusal}
        kept = [one for one in channels if one.header.name not in self._refused]
        if channels and not kept:
            raise NoSignalError(
                "no signal is known to be a measurement", self._refused, path=path,
                found="; ".join(f"{name}: {why}" for name, why in list(self._refused.items())[:4]),
                remedy=_UNSCALED_REMEDY, file_end=FileEnd.MISSING if incomplete else FileEnd.UNCLEAR,
            )  # fmt: skip
        self.signals = tuple(channel.header for channel in kept)
        self._channels = {channel.header.name: channel for channel in kept}
        self._marked: dict[str, tuple[int, int]] = {}
        self._outside: dict[str, tuple[int, int]] = {}
        self._usual: dict[str, tuple[float, int, int]] = {}
        self._notes, self._absolute_start, self._tracks = notes, absolute_start, tracks
        # a name with its signs over letters apart is one with another, whoever typed it
        names = [name for name in self._channels if not name.isascii()]
        spelled = {normalize(form, name): name for name in names for form in ("NFC", "NFD")}
        other = {name: own for name, own in spelled.items() if name not in self._channels}
        self.check_name, self.aliases = check_name, MappingProxyType(other | dict(aliases))

    def __repr__(self) -> str:
        cut = ", cut off" if self.incomplete else ""
        return f"Recording({self.path.name!r}: {len(self.signals)} signals, {self.reader}{cut})"

    def listing(self) -> Listing:
        """List the signals, of which no sample is read."""
        rows = [(header.name, header.unit or None, header.sample_count) for header in self.signals]
        return Listing(repr(self), ("signal", "unit", "samples"), tuple(rows))

    @property
    def notes(self) -> tuple[Remark, ...]:
        """Losses, repairs and contradictions, which a user must know before trusting the samples.

        Samples that numbers mark as an overload are counted when they are read, and noted from then on.
        """
        own = self._said(self._notes) if callable(self._notes) else self._notes
        return (*(one if isinstance(one, Remark) else Note(NoteCode.READER, None, one) for one in own), *self._found())

    def _found(self) -> Iterator[Remark]:
        """Yield the notes on what stands beside the samples, and on what they themselves showed when they were read."""
        for name, why in self._refused.items():
            yield Note(NoteCode.LEFT_OUT, name, f"{name}: {why}: left out")
        start = self.absolute_start
        if start is not None and start.is_doubtful:
            text = f"{self.path.name}: its start, {start.text} ({start.origin}), is none that an instrument can have"
            yield Caution(CautionCode.DOUBTFUL_START, self.path.name, f"{text}: it dates nothing; set the clock")
        yield from _about_times_apart(self._channels.values())
        beside = {name: one.beside for name, one in self._channels.items()}
        yield from about_open(beside)
        yield from about_rates(
            {
                name: (one.beside, one.time_base.rate_hz)
                for name, one in self._channels.items()
                if isinstance(one.time_base, TimeBase) and one.time_base.step_s
            }
        )
        if start is None:
            yield from about_starts(beside)
        for name, (count, of) in self._marked.items():
            yield about_overload(name, count, of)
        for name, usual in self._usual.items():
            yield about_usual_code(name, *usual)
        for name, (count, of) in self._outside.items():
            limits = self._channels[name].beside.limits
            if count and limits is not None:
                yield about_outside(name, count, of, limits)

    @property
    def absolute_start(self) -> AbsoluteStart | None:
        """Wall-clock time of the recording's time zero, if the file states one."""
        return self._said(self._absolute_start) if callable(self._absolute_start) else self._absolute_start

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,).

        Numbers by which instruments mark a sample that they could not measure are lost samples; an infinity stays one.

        Raises
        ------
        MissingChannelError
            If there is no such signal.
        CorruptFileError
            If its samples are damaged.
        """
        found = self._find(name)
        values = self._part(found.samples, found.header, start, stop)
        if may_have_marks(values):
            marks = find_marks(values)
            values[marks] = np.nan
            count = int(np.count_nonzero(marks))
            if count >= self._marked.get(found.header.name, (1, 0))[0]:
                self._marked[found.header.name] = count, values.size
        if (usual := usual_code(values)) is not None and usual[1] >= self._usual.get(found.header.name, (0.0, 1, 0))[1]:
            self._usual[found.header.name] = (*usual, values.size)
        if (limits := found.beside.limits) is not None:
            count = outside(values, limits)
            if count >= self._outside.get(found.header.name, (1, 0))[0]:
                self._outside[found.header.name] = count, values.size
        return values

    def overloads(self, name: str) -> int:
        """Return how many samples of a signal, of those that were read, are marked as an overload; raises as `read`."""
        found = self._find(name)
        return self._marked.get(found.header.name, (0, 0))[0] + (0 if found.overloads is None else found.overloads())

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        """Return the integers that the source stored for samples of one signal, if it stored any; raises as `read`."""
        found = self._find(name)
        return None if found.raw is None else self._part(found.raw, found.header, start, stop)

    def time_base(self, name: str) -> TimeBase:
        """Return the instants of one signal's samples on the source's clock.

        Raises
        ------
        MissingChannelError
            If there is no such signal.
        CorruptFileError
            If what dates them is damaged.
        """
        base = self._find(name).time_base
        if not callable(base):
            return base
        with map_to_corrupt_file(self.path, f"instants of {self.reader}"):
            return base()

    def header(self, name: str) -> SignalHeader:
        """Return the header of one signal.

        Raises
        ------
        MissingChannelError
            If there is no such signal.
        """
        return self._find(name).header

    def statements(self, name: str) -> Statements:
        """Return what stands beside the samples of one signal; raises as `header`."""
        return self._find(name).beside

    def tracks(self) -> tuple[Track, ...]:
        """Return the markers' paths of a camera's file; empty for every other kind."""
        return self._said(self._tracks)

    def _find(self, name: str) -> StoredChannel:
        try:
            return self._channels[self.aliases.get(name, name)]
        except KeyError:
            if name in self._refused:
                raise ReadError(
                    f"signal {name!r} cannot be read", path=self.path, found=self._refused[name],
                    remedy=_UNSCALED_REMEDY, file_end=FileEnd.THERE,
                ) from None  # fmt: skip
            self.check_name(name)
            raise MissingChannelError(name, tuple(self._channels), path=self.path) from None

    def _said(self, ask: Callable[[], T]) -> T:
        with map_to_corrupt_file(self.path, f"a whole file of {self.reader}"):
            return ask()

    def _part(self, part: Callable[[int, int], T], header: SignalHeader, start: int, stop: int | None) -> T:
        first, last, _ = slice(start, stop).indices(header.sample_count)
        with map_to_corrupt_file(self.path, f"a whole file of {self.reader}"):
            return part(first, max(first, last))
