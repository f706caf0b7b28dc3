"""Captures of serial ports, taken apart by the framing that the rig declares.

A capture holds every byte and the host's time of each read. Samples are dated by the device's own clock where its
frames carry one, counted from the first frame; else by the host's reads, dated back, or by the frames' counter where
a read delivers several; else by a declared rate. Device clocks have been seen to step while the packet counter ran
on, so the counter says what is missing, and the clock never sorts anything; where the host stamped the reads, such
steps are found, listed and taken out (`recoil_acquisition.clocks.clock_fit`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.clock_fit import ClockFit, fit_clock, whole_ns
from recoil_acquisition.clocks.timebase import WALL_CLOCK_NS, AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, FramingError, ReadError
from recoil_acquisition.frames.count_cycle import CountCycle, find_cycle
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.field import Field
from recoil_acquisition.frames.frame_set import FrameSet
from recoil_acquisition.frames.framing import DeviceTime, Framing, PacketCounter
from recoil_acquisition.frames.ready_made import xsens_precision
from recoil_acquisition.frames.scan import PortStream, find_frames_of_port
from recoil_acquisition.frames.values import FieldSeries, decode_fields, unwrap
from recoil_acquisition.log.record import Kind
from recoil_acquisition.readers.captured import CapturedSource, event_of
from recoil_acquisition.readers.counter_gaps import find_gaps, gaps_as_json
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.serial.raw_bytes import look_into
from recoil_acquisition.readers.time.bursts import Bursts, find_bursts
from recoil_acquisition.readers.time.clock_notes import notes_of_clock, notes_of_jumps
from recoil_acquisition.readers.time.counted_beat import CountedBeat, counted_beat, frame_numbers
from recoil_acquisition.readers.time.increasing_stamps import increasing, single_ahead
from recoil_acquisition.readers.time.stalls import late_stamps
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark

_LOSSES = {
    "bad_checksum": "places looked like a frame and had a wrong checksum",
    "bad_length": "places looked like a frame and had a wrong length or no numbers",
    "implausible": "places looked like a frame and had a value beyond what is declared plausible",
    "not_followed": "places looked like a frame and were not followed by the next one",
    "unknown_types": "frames are of no declared type",
    "timed_out": "silences ended a half frame",
}
_COMPARE = "compare `framing` with the device's manual"
_MORE_THAN_CARRIED = 1.05
"""Bytes of a capture over those that its line carries, from which on the declared rate is not the line's."""
_LOOKED_AT = 200
"""Frames in which the elements are looked for that a device sends."""


def back_dated(
    host_ns: NDArray[np.int64], read_ends: NDArray[np.int64], frame_ends: NDArray[np.int64], byte_s: float
) -> NDArray[np.float64]:
    """Date frames back from the reads that delivered them.

    A read returns many frames at one instant. A frame ended on the line before the bytes behind it,
    each of which took its bits' time: ``t = t_read - bytes_behind * bits_per_byte / baudrate``.

    Parameters
    ----------
    host_ns : ndarray of int64, shape (n_reads,)
        Host time of each read.
    read_ends : ndarray of int64, shape (n_reads,)
        Byte of the stream behind each read.
    frame_ends : ndarray of int64, shape (n_frames,)
        Byte of the stream behind each frame.
    byte_s
        Time that a byte takes on the line, s; 0 to leave the frames at their read.

    Returns
    -------
    ndarray of float64, shape (n_frames,)
        Seconds from the first read; NaN for a frame whose read has no host time.
    """
    reads = np.searchsorted(read_ends, frame_ends, side="left")
    known = reads < host_ns.size
    times_s = np.full(frame_ends.size, np.nan)
    at = reads[known]
    behind = read_ends[at] - frame_ends[known]
    times_s[known] = (host_ns[at] - host_ns[0]) / 1e9 - behind * byte_s
    return times_s


def without_steps(
    device_s: NDArray[np.float64],
    host_s: NDArray[np.float64],
    host_zero_ns: int,
    counts: NDArray[np.int64] | None,
) -> tuple[NDArray[np.float64], ClockFit | None]:
    """Compare the device's clock with the host's, and take its steps and wrong stamps out.

    Parameters
    ----------
    device_s : ndarray of float64, shape (n_frames,)
        Stamps of the device in the order of the frames.
    host_s : ndarray of float64, shape (n_frames,)
        Stamps of the host, as `back_dated` gives them, s; frames without either stamp are not compared.
    host_zero_ns
        Time zero of the host's stamps on the host's clock, ns.
    counts : ndarray of int64, shape (n_frames,), or None
        Packet counter of the frames, unwrapped.

    Returns
    -------
    instants : ndarray of float64, shape (n_frames,)
        Instants in s from the first frame, exactly the device's where nothing had to be taken out.
    fit : ClockFit or None
        Fit of the device's clock to the host's; None below two frames with both stamps.
    """
    compared = np.flatnonzero(np.isfinite(device_s) & np.isfinite(host_s))
    device_ns = whole_ns(device_s[compared])
    host_ns = host_zero_ns + whole_ns(host_s[compared])
    fit = fit_clock(device_ns, host_ns, counts=None if counts is None else counts[compared])
    if fit is None or not (fit.steps or fit.wrong_stamps):
        return device_s, fit
    shift_ns = np.zeros(device_s.size, dtype=np.int64)
    for step in fit.steps:
        # Frames that the host did not stamp are on the side of the last one that it did
        shift_ns[compared[step.index] :] -= whole_ns(np.float64(step.step_s))
    shift_ns[compared] = fit.device_instants_ns(device_ns, host_ns) - device_ns
    instants = device_s + shift_ns / 1e9
    return instants - instants[0], fit


def open_port(path: Path, source: CapturedSource, declared: Declarations) -> Recording:
    """Open the port of a capture; raises `ReadError` if nothing dates the frames, or as `declared_framing`."""
    framing = declared_framing(declared, path)
    port = PortStream.of_reads(_reads(source), incomplete=source.incomplete)
    return serial_recording(path, "recoil-daq capture", port, framing, declared.clock)


def declared_framing(declared: Declarations, path: Path) -> Framing:
    """Return the framing that a rig declares for a port; raises `ReadError` if there is none, or it is faulty."""
    if declared.framing is None:
        raise ReadError(
            "a serial capture holds no signals without its framing",
            path=path,
            remedy="declare `framing = { ... }` of this source",
        )
    try:
        return framing_from_table(declared.framing)
    except FramingError as error:
        raise ReadError(
            f"the declared framing is faulty: {error}", path=path, remedy="correct `framing` in the rig file"
        ) from error


def _reads(source: CapturedSource) -> Iterator[tuple[int, bytes | None]]:
    """Yield what each read returned and when, and None where the port was lost or opened anew, or a read is missing."""
    following: int | None = None
    for record in source.records:
        event = event_of(record)
        if event is not None:
            broken = event.name in ("lost", "reopened")
        else:
            broken = following is not None and record.source_number != following
        following = record.source_number + 1
        if broken:
            yield record.host_ns, None
        if record.kind == Kind.SERIAL:
            host_ns = record.host_ns if source.anchor is None else source.anchor.wall_of(record.host_ns)
            yield host_ns, record.payload


def serial_recording(path: Path, reader: str, capture: PortStream, framing: Framing, clock: str) -> Recording:
    """Return the recording of what a port delivered.

    Parameters
    ----------
    path
        File it is from.
    reader
        Name of its reader.
    capture
        Bytes of the port, and when they were read.
    framing
        Framing of its bytes.
    clock
        Clock of the recording.

    Raises
    ------
    ReadError
        If nothing dates the frames, or nothing separates them.
    CorruptFileError
        If not one frame, or field, can be read.
    """
    if framing.kind == "idle" and not capture.host_ns.size:
        raise ReadError(
            "frames that end by silence cannot be separated without host times",
            path=path,
            expected="a capture with the host's time of each read",
            remedy="record it as a capture, or declare a `framing` of another kind",
        )
    frames = find_frames_of_port(framing, capture)
    if not frames.begins.size:
        held = look_into(capture.stream)
        advised = f"declare {held.framings[0].advice}" if held.framings else _COMPARE
        found = held.found or _counted(asdict(frames.counters))
        raise CorruptFileError("not one frame fits the declared framing", path=path, found=found, remedy=advised)
    return _Port(path, capture, framing, frames).recording(reader, clock)


class _Port:
    """The frames of a port as they are read.

    Parameters
    ----------
    path
        File they are from.
    capture
        Bytes of the port, and when they were read.
    framing
        Framing of its bytes.
    frames
        Frames in them, at least one.
    """

    def __init__(self, path: Path, capture: PortStream, framing: Framing, frames: FrameSet) -> None:
        self._path, self._capture, self._framing, self._frames = path, capture, framing, frames
        self._series = decode_fields(framing, frames)
        self._by_reads = bool(framing.device_time is None and framing.baudrate and capture.host_ns.size)
        self._notes: list[Remark] = []
        self._metadata: dict[str, Any] = {}

    def recording(self, reader: str, clock: str) -> Recording:
        """Return the recording, read under a name, on a clock."""
        capture, frames, notes = self._capture, self._frames, self._notes
        counters = asdict(frames.counters)
        self._note_losses(counters)
        self._metadata |= {**counters, "bytes": len(capture.stream), "reads": int(capture.host_ns.size)}
        self._metadata["skipped_at_ends"] = min(
            int(frames.ends[0] - frames.lengths[0]) + len(capture.stream) - int(frames.ends[-1]),
            counters["skipped_bytes"],
        )
        times_s = self._instants()
        self._count_gaps(times_s)
        start = _host_start(capture) if self._by_reads else None
        absent = {name: self._why_absent(found.field) for name, found in self._series.items() if not found.frames.size}
        for reason in dict.fromkeys(absent.values()):
            names = [name for name, why in absent.items() if why == reason]
            about = names[0] if len(names) == 1 else None
            notes.append(Note(NoteCode.LEFT_OUT, about, f"{', '.join(names)}: {reason}: not a signal"))
        channels = []
        for name, found in self._series.items():
            if name in absent:
                continue
            kept = increasing(times_s[found.frames])
            if not kept.any():
                text = f"{name}: no frame that holds it has an instant: not a signal"
                notes.append(Note(NoteCode.LEFT_OUT, name, text))
                continue
            if not kept.all():
                left_out = int((~kept).sum())
                text = f"{name}: {left_out} of {kept.size} samples do not increase in time and were left out"
                notes.append(Note(NoteCode.LEFT_OUT, name, text))
            channels.append(
                StoredChannel(
                    SignalHeader(name, found.field.unit, int(kept.sum())),
                    partial(_instants, clock, times_s, found.frames[kept], start),
                    partial(_samples, found, kept),
                    partial(_raw, found, kept),
                )
            )
        if not channels:
            why = next(iter(absent.values()), _counted(counters))
            raise CorruptFileError("no frame holds a declared field", path=self._path, found=why, remedy=_COMPARE)
        return Recording(
            self._path, reader, channels, metadata=self._metadata, notes=notes,
            incomplete=capture.incomplete, absolute_start=start,
            check_name=partial(_refuse_absent, absent, self._path),
        )  # fmt: skip

    def _note(self, code: NoteCode, text: str, about: str | None = None) -> None:
        self._notes.append(Note(code, about, text))

    def _note_losses(self, counters: dict[str, int]) -> None:
        """Say what of the stream became no sample."""
        if self._capture.incomplete:
            self._note(NoteCode.CUT, self._capture.incomplete)
        for key, what in _LOSSES.items():
            if counters[key]:
                self._note(NoteCode.LOST, f"{counters[key]} {what}")
        if counters["skipped_bytes"]:
            of = len(self._capture.stream)
            self._note(NoteCode.LOST, f"{counters['skipped_bytes']} of {of} bytes belong to no good frame")

    def _count_gaps(self, times_s: NDArray[np.float64]) -> None:
        declared = self._framing.counter
        if declared is None:
            self._note(NoteCode.UNSEEN, "the framing declares no packet counter: missing frames cannot be seen")
            return
        counter = self._series[declared.field]
        counts = counter.raw.astype(np.int64)
        found = find_gaps(counts, times_s[counter.frames], declared.modulo, declared.step)
        self._metadata |= gaps_as_json([found])
        if found.places:
            text = f"the packet counter has {found.places} gaps: {found.missing} frames are missing"
            self._note(NoteCode.LOST, text, declared.field)
        other = _other_cycle(declared, counts)
        if other is not None:
            text = f"the packet counter counts otherwise than declared: {_told_cycle(other)}"
            self._notes.append(Caution(CautionCode.OTHER_COUNT, declared.field, text))

    def _instants(self) -> NDArray[np.float64]:
        """Instant of every frame in seconds, NaN where it has none."""
        clock = self._framing.device_time
        self._metadata["dated_by"] = "device" if clock is not None else "host" if self._by_reads else "rate"
        if clock is not None:
            return self._device_instants(clock)
        if self._by_reads:
            return self._host_instants()
        if self._framing.rate_hz:
            return self._counted_instants()
        raise ReadError(
            "nothing dates the frames",
            path=self._path,
            expected="a device clock, host times with a baud rate, or a rate",
            remedy="declare `device_time`, `baudrate` or `rate_hz` in `framing`",
        )

    def _device_instants(self, clock: DeviceTime) -> NDArray[np.float64]:
        capture, frames, ticks = self._capture, self._frames, self._series[clock.field]
        if not ticks.raw.size:
            raise CorruptFileError(
                "no frame holds the device's time",
                path=self._path,
                remedy="compare `device_time` in `framing` with the device's manual",
            )
        ticks_s = unwrap(ticks.raw, clock.modulo) * clock.tick_s
        counts = self._counts_of(ticks.frames)
        self._metadata["device_time_of_first_frame_s"] = float(ticks.raw[0]) * clock.tick_s
        if capture.host_ns.size:
            host_s = back_dated(capture.host_ns, capture.ends, frames.ends[ticks.frames], self._framing.byte_s)
            ticks_s, fit = without_steps(ticks_s, host_s, int(capture.host_ns[0]), counts)
            self._metadata["clock_fit"] = None if fit is None else fit.to_json()
            self._notes += [] if fit is None else notes_of_clock(fit, "device")
            start = _host_start(capture)
            self._metadata["host_start"] = None if start is None else start.text + "Z"
        elif counts is not None:
            self._notes += notes_of_jumps(ticks_s, counts)
        backwards = int((np.diff(ticks_s) <= 0).sum())
        if backwards:
            self._note(NoteCode.TIME, f"the device's clock stood still or stepped back {backwards} times")
        times_s = np.full(frames.begins.size, np.nan)
        times_s[ticks.frames] = ticks_s
        return times_s

    def _counted_instants(self) -> NDArray[np.float64]:
        """Date frames by their packet counter, or their number where they have none, at the declared rate."""
        rate_hz, counter, count = self._framing.rate_hz, self._framing.counter, self._frames.begins.size
        self._note(NoteCode.TIME, f"samples are dated by the declared rate of {rate_hz:g} Hz")
        if counter is None:
            return np.arange(count) / rate_hz
        counts = self._series[counter.field]
        other = _other_cycle(counter, counts.raw.astype(np.int64))
        if other is not None:
            raise ReadError(
                "the packet counter counts otherwise than declared, and frames are dated by it",
                path=self._path,
                expected=f"modulo {counter.modulo}, step {counter.step}",
                found=_told_cycle(other),
                remedy="correct `modulo` or `step` of `counter` in `framing`",
            )
        times_s = np.full(count, np.nan)
        numbers = unwrap(counts.raw.astype(np.int64), counter.modulo)
        single = single_ahead(numbers)
        back = np.flatnonzero(np.diff(numbers[~single]) < 0)
        if back.size:
            at = int(np.flatnonzero(~single)[back[0] + 1])
            raise ReadError(
                "the packet counter goes back, and frames are dated by it",
                path=self._path,
                place=f"frame {int(counts.frames[at]) + 1}",
                expected="a count beyond the one before: the device began anew there, or more is missing than it shows",
                found=f"{counts.raw[at]} behind {counts.raw[at - 1]}",
                remedy="take the recordings apart there, or record with the host's times of the reads",
            )
        times_s[counts.frames] = numbers / counter.step / rate_hz
        return times_s

    def _host_instants(self) -> NDArray[np.float64]:
        """Date frames back from the host's reads, or by their counter where those are late."""
        capture, frames = self._capture, self._frames
        _refuse_set_back(capture, self._path)
        byte_s = self._line_byte_s()
        times_s = back_dated(capture.host_ns, capture.ends, frames.ends, byte_s)
        known = np.flatnonzero(np.isfinite(times_s))
        # a line carries one byte after the other: what came behind a frame says when it ended at the latest
        behind_s = byte_s * frames.ends[known]
        times_s[known] = np.minimum.accumulate((times_s[known] - behind_s)[::-1])[::-1] + behind_s
        bursts = find_bursts(times_s[known])
        beat = self._beat(known, times_s[known], bursts)
        if beat is not None and beat.late:
            why = bursts or f"the host's reads are late by up to {1e3 * beat.latest_s:.3g} ms"
            self._note(NoteCode.TIME, f"{why}: samples are dated by the frames' counter instead")
            times_s[known] = beat.times_s
            return times_s
        late = late_stamps(times_s[known])
        if late is None:
            text = "samples are dated by the host's reads: their instants are uncertain by its delay"
            self._note(NoteCode.TIME, text)
            return times_s
        why = "declare the frames' `counter` in `framing`"
        if self._framing.counter is not None:
            why = f"{self._framing.counter.field} does not count frames of an even beat"
        text = f"{late.text}: samples are dated late by up to {1e3 * late.most_s:.3g} ms; {why}"
        self._notes.append(Caution(CautionCode.LATE_STAMPS, None, text))
        return times_s

    def _line_byte_s(self) -> float:
        """Return the time of a byte on the line, by what the capture holds where that is more than the line carries."""
        ends, host_ns, byte_s = self._capture.ends, self._capture.host_ns, self._framing.byte_s
        read, span_s = int(ends[-1] - ends[0]), float(host_ns[-1] - host_ns[0]) / 1e9
        if read * byte_s <= _MORE_THAN_CARRIED * span_s or span_s <= 0:
            return byte_s
        text = (
            f"{read} bytes came in {span_s:.6g} s, more than a line of the declared {self._framing.baudrate:g} baud"
            " carries: frames are dated back by the rate at which they came"
        )
        self._notes.append(Caution(CautionCode.LATE_STAMPS, None, text))
        return span_s / read

    def _beat(
        self, wanted: NDArray[np.int64], times_s: NDArray[np.float64], bursts: Bursts | None
    ) -> CountedBeat | None:
        """Return the even beat of some frames by their counter."""
        counter = self._framing.counter
        if counter is None:
            return None
        own = self._series[counter.field]
        held = np.isin(wanted, own.frames)
        counts = np.zeros(wanted.size, dtype=np.int64)
        counts[held] = own.raw[np.isin(own.frames, wanted)].astype(np.int64)
        numbers = frame_numbers(counts, held, CountCycle(counter.modulo, counter.step))
        return None if numbers is None else counted_beat(numbers, times_s, bursts)

    def _counts_of(self, wanted: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """Return the unwrapped packet counter of some frames; None if not every one of them holds it."""
        counter = None if self._framing.counter is None else self._series[self._framing.counter.field]
        if self._framing.counter is None or counter is None or not np.isin(wanted, counter.frames).all():
            return None
        counts: NDArray[np.int64] = unwrap(counter.raw.astype(np.int64), self._framing.counter.modulo)
        return counts[np.searchsorted(counter.frames, wanted)]

    def _why_absent(self, field: Field) -> str:
        """Say why not one frame holds a field: of elements, which ones the first frames have."""
        framing, frames = self._framing, self._frames
        elements = next((one.elements for one in framing.types if field in one.fields), None)
        if elements is None or field.element is None:
            return "no frame holds it"
        present: set[int] = set()
        for i in range(min(frames.begins.size, _LOOKED_AT)):
            frame = frames.frame(i)
            present |= {found for found, _, _ in elements.places(frame, elements.start, len(frame) - framing.trailer)}
        precision = xsens_precision(framing.sync, field.element, present)
        if precision:
            return f'no frame holds element {field.element:#06x}; the file\'s are those of `precision = "{precision}"`'
        shown = ", ".join(f"{one:#06x}" for one in sorted(present)[:12])
        return f"no frame holds element {field.element:#06x}, but {shown or 'none at all'}"


def _other_cycle(counter: PacketCounter, counts: NDArray[np.int64]) -> CountCycle | None:
    """Return the cycle of a counter by its counts where that is another than is declared."""
    found = find_cycle(counts, counter.modulo, counter.step)
    return found if found is not None and (found.modulo, found.step) != (counter.modulo, counter.step) else None


def _told_cycle(cycle: CountCycle) -> str:
    begins = "" if cycle.first is None else f"from {cycle.first} to {cycle.first + cycle.modulo - cycle.step}, "
    return f"its numbers go {begins}by {cycle.step} from frame to frame"


def _refuse_absent(absent: dict[str, str], path: Path, name: str) -> None:
    if name in absent:
        raise ReadError(
            f"{name!r} is not in the file",
            path=path,
            found=absent[name],
            remedy="correct `framing` in the rig file, or leave out the channel",
        )


def _instants(
    clock: str, times_s: NDArray[np.float64], frames: NDArray[np.int64], start: AbsoluteStart | None
) -> TimeBase:
    return TimeBase.stamped(clock, times_s[frames], start)


def _samples(series: FieldSeries, kept: NDArray[np.bool_], start: int, stop: int) -> NDArray[np.float64]:
    values = series.values[kept][start:stop]
    values[~np.isfinite(values)] = np.nan
    return values


def _raw(series: FieldSeries, kept: NDArray[np.bool_], start: int, stop: int) -> RawCounts | None:
    """Return the stored integers; None for a field that is a float or text."""
    if series.raw.dtype.kind != "i":
        return None
    return RawCounts(series.raw[kept][start:stop], series.field.scale, series.field.offset, series.field.unit)


def _refuse_set_back(capture: PortStream, path: Path) -> None:
    """Refuse reads whose host times go back: of a clock that was set nobody knows when the frames came."""
    back = np.flatnonzero(np.diff(capture.host_ns) < 0)
    if back.size:
        at = int(back[0]) + 1
        raise CorruptFileError(
            "the host's times of the reads go back",
            path=path,
            place=f"read {at + 1}",
            expected="those of a clock that nobody sets",
            found=f"{(capture.host_ns[at] - capture.host_ns[at - 1]) / 1e9:+.6g} s",
            remedy="declare the device's own time as `device_time` in `framing`, or record it again",
        )


def _counted(counters: dict[str, int]) -> str:
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counters.items() if count) or "nothing"


def _host_start(capture: PortStream) -> AbsoluteStart | None:
    """Return the host time of the first read; None if the host stamped with no wall clock."""
    if capture.host_ns[0] < WALL_CLOCK_NS:
        return None
    return AbsoluteStart.since_1970(int(capture.host_ns[0]), "UTC", "host's clock at the first read")
