"""The running acquisition: one thread per device, the journal, and one thread that watches for shots.

A reading thread appends every block to the journal before anything else looks at it, and then puts it into a queue. The
watching thread takes it from there, so that whatever takes long (a trigger on many channels, a screen, the conversion
of the last shot) delays the trigger's decision and loses nothing. If it falls behind by more than `QUEUE_BYTES`, blocks
are recorded without being looked at, and counted.
"""

from __future__ import annotations

import queue
import shutil
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.cut import capture_has
from recoil_acquisition.capture.cut_process import cut_apart
from recoil_acquisition.capture.engine import PATIENCE_S, CaptureEngine, CounterHistory
from recoil_acquisition.capture.live_source import LiveSource
from recoil_acquisition.capture.session_record import KINDS, CompleteShot, Kept, LiveRecord, kept_of, longer
from recoil_acquisition.capture.shot_record import acquisition_of
from recoil_acquisition.capture.status import ChannelStatus, LiveStatus, SourceStatus, State
from recoil_acquisition.devices.device import EVENT, Block, Device, event_block, joined
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError, RecoilDaqError, StoreError
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.trigger import Decision, Edge, ShotWindow, Trigger

QUEUE_BYTES = 128 << 20
"""Most bytes that wait to be looked at."""

SEGMENT_BYTES = 16 << 20
_PAUSE_S = 0.01
"""Time over which the watching thread lets data come before it takes them at once: less often awake, less in the
readers' way."""
_MOST_AT_ONCE = 1 << 20
"""Bytes after which it looks up all the same."""
_SWITCH_S = 1e-4
"""Time after which a busy thread gives the interpreter back to a reading thread, which gives it away with every call of
the system: with Python's own 5 ms, one that reads frame by frame would fall to 200 per second meanwhile."""
_RELEASE_EVERY_S = 1.0
_STOOD_STILL_S = 0.25
"""Where this thread sleeps so much longer than it asked for, the process or its machine stood still: the readers get
their time to catch up before a source is given up or anything is released."""


@dataclass(frozen=True)
class CapturedShot:
    """A shot that is cut out of the journal.

    Attributes
    ----------
    path
        File of the shot's capture.
    """

    name: str
    path: Path
    acquisition: Acquisition


_NOTE_EVERY_S = 0.5
"""Time between two notes in the journal of what is kept block by block."""


class LiveSession:
    """Acquires from open devices until it is stopped.

    Parameters
    ----------
    devices
        Devices that are open, one for each source.
    folder
        Folder of the journal.
    reserve_bytes
        Space that must be there.
    spare
        Folder on another disk, where the journal goes on if the first one fails.
    notice
        Function that is given every decision of the trigger, in the watching thread.

    Raises
    ------
    StoreError
        If the journal cannot be made: no room, no permission.
    RecoilDaqError
        If a channel's signal is not in its source.
    """

    def __init__(
        self,
        record: LiveRecord,
        sources: Sequence[LiveSource],
        devices: Mapping[str, Device],
        trigger: Trigger,
        folder: Path,
        *,
        reserve_bytes: int,
        spare: Path | None = None,
        notice: Callable[[Decision], None] = lambda _: None,
    ) -> None:
        self.record = record
        self.trigger = trigger
        self._sources = {source.name: source for source in sources}
        self._notice = notice
        self._engine = CaptureEngine(sources, trigger)
        self._journal = LogWriter(folder, record.to_json(), reserve_bytes, spare=spare, segment_bytes=SEGMENT_BYTES)
        self._queue: queue.SimpleQueue[Block | Callable[[], None]] = queue.SimpleQueue()
        self._waiting_bytes = self._unseen_bytes = 0
        self._lock = threading.Lock()
        self._handing_on = False
        self._events: deque[Block] = deque()
        self._holding: dict[int, tuple[float, float]] = {}
        self._captured: list[tuple[float, float]] = []
        self._captures: list[tuple[Path, int, int]] = []
        self._kept: list[Kept] = []
        self._noted = "", 0.0
        self._awaited: dict[str, ShotWindow] = {}
        # no SimpleQueue: where a signal comes as its wait ends, it waits for ever
        self._windows: queue.Queue[ShotWindow] = queue.Queue()
        self._numbers = {source.name: i for i, source in enumerate(record.sources)}
        self._readers = {name: DeviceReader(device, self._sink) for name, device in devices.items()}
        self._history = CounterHistory(devices)
        self._watcher = threading.Thread(target=self._watch, name="watch for shots", daemon=True)
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._hung: dict[str, DeviceError] = {}
        self._shots = 0
        self._began_s = time.monotonic()
        self._released_s = self._looked_s = self._patient_until_s = 0.0
        self._switch_s = sys.getswitchinterval()

    def start(self) -> None:
        """Begin to read and to journal; not armed yet."""
        sys.setswitchinterval(min(_SWITCH_S, self._switch_s))
        self._watcher.start()
        for reader in self._readers.values():
            reader.start()

    def arm(self) -> None:
        """Let triggers count from now on."""
        now_s = time.monotonic()
        self._queue.put(lambda: self._engine.arm(now_s))

    def disarm(self) -> None:
        """Let nothing trigger until armed again."""
        self._queue.put(self._engine.disarm)

    def fire(self) -> None:
        """Trigger by hand, now."""
        now_s = time.monotonic()
        self._queue.put(lambda: self._engine.fire(now_s))

    def next_window(self, timeout_s: float) -> ShotWindow | None:
        """Return the next shot that is complete, or None if there is none in time.

        Its data stays in the journal until it is given back with `release`.
        """
        try:
            return self._windows.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def cut(self, name: str, window: ShotWindow, path: Path) -> CapturedShot:
        """Write a shot's capture, with the record of its acquisition.

        Parameters
        ----------
        name
            Identifier of the shot.
        window
            Span of the shot, from `next_window`.
        path
            File to be made.

        Raises
        ------
        StoreError
            If it cannot be written; the journal still has it.
        """
        self._say(Kind.SHOT, window.trigger_s, asdict(CompleteShot(name, window.trigger_s)))
        self._journal.sync()
        acquisition = acquisition_of(
            name, self.record, self.trigger, window, self._history.spans(window.start_s, window.stop_s),
            unseen_bytes=self._unseen_bytes,
        )  # fmt: skip
        start_ns, stop_ns = round(window.start_s * 1e9), round(window.stop_s * 1e9)
        written = cut_apart(self._journal.folder, path, acquisition, start_ns, stop_ns)
        with self._lock:
            self._captures.append((path, start_ns, stop_ns))
        return CapturedShot(name, path, written)

    def release(self, window: ShotWindow) -> None:
        """Give a shot's data in the journal back: its captures and its shot file are verified."""
        with self._lock:
            span = self._holding.pop(round(window.trigger_s * 1e9), None)
            if span is not None:
                self._captured.append(span)

    def device_events(self) -> tuple[Block, ...]:
        """Return what happened to the devices since the last call."""
        return tuple(self._events.popleft() for _ in range(len(self._events)))

    def rate_hz(self, source: str) -> float:
        """Return what comes of a source per second."""
        return self._history.rate_hz(source)

    @property
    def recording(self) -> bool:
        """Whether a shot is open, or complete and not yet taken with `next_window`."""
        return self._engine.recording or self._handing_on or not self._windows.empty()

    @property
    def idle(self) -> bool:
        """Whether no shot is open and nothing waits to be looked at."""
        return self._queue.empty() and not self._engine.recording and self._windows.empty()

    @property
    def kept(self) -> tuple[Kept, ...]:
        """Stretches of the journal that are in no shot: something crossed, arrived too late or was not looked at."""
        with self._lock:
            shots = [*self._captured, *self._holding.values()]
            return tuple(one for one in self._kept if not one.within(shots))

    def forget_kept(self) -> None:
        """Give back what is kept so far: of a session that was never armed, nothing belongs to a shot."""
        with self._lock:
            self._kept = []

    @property
    def journal_folder(self) -> Path:
        """The folder of the journal."""
        return self._journal.folder

    @property
    def error(self) -> RecoilDaqError | None:
        """The reason why it cannot go on: a device's reader or the watching thread ended by itself; None if it can."""
        failures = [self._error, *self._hung.values(), *(reader.error for reader in self._readers.values())]
        for failure in failures:
            if isinstance(failure, RecoilDaqError):
                return failure
            if failure is not None:
                return DeviceError(f"acquisition has ended by itself: {type(failure).__name__}: {failure}")
        return None

    @property
    def status(self) -> LiveStatus:
        """The state of the session at this moment."""
        journal = self._journal.counters
        now_s = time.monotonic()
        return LiveStatus(
            state=self._state,
            sources=tuple(self._source_status(name) for name in self._readers),
            channels=tuple(
                ChannelStatus(
                    c.name, s.name, c.unit, self._engine.level(c.name, now_s), c.range, self._triggers_at(c.name)
                )
                for s in self._sources.values()
                for c in s.channels
            ),
            shots=self._shots,
            armed_s=now_s - self._began_s,
            disk_free_bytes=_free_bytes(self._journal.folder),
            journal_bytes=journal.bytes,
            unsynced_s=journal.unsynced_s,
            unseen_bytes=self._unseen_bytes,
            released_records=journal.released,
            alert=", ".join(
                [
                    *(f"{source} CANNOT BE READ LIVE" for source in self._engine.faults),
                    *([f"the journal goes on in {self._journal.spare}: {journal.spare}"] if journal.spare else []),
                ]
            ),
        )

    def stop(self) -> None:
        """End in order: read what waits, close the devices, complete open shots with what there is.

        The windows of shots that were open are to be had from `next_window` afterwards. Further calls do nothing.

        Raises
        ------
        StoreError
            If the journal cannot be forced to the disk.
        """
        for name, reader in self._readers.items():
            if name in self._hung:
                continue
            try:
                reader.stop()
            except DeviceError as error:  # its driver hangs: the others are closed in order without it
                self._hung[name] = error
        self._stopping.set()
        if self._watcher.ident is not None:
            self._watcher.join()
            sys.setswitchinterval(self._switch_s)

    def close(self, *, complete: bool) -> None:
        """Close the journal, and remove it if all that happened in it is in verified shot files.

        Whether each capture still holds all that the journal has of its shot is looked at once more.
        """
        self.stop()
        self._journal.close(in_order=self._error is None)
        if complete and self.error is None and not self._holding and not self.kept:
            log = open_log(self._journal.folder)
            lacking = [path for path, *span in self._captures if not capture_has(log, path, *span)]
            if lacking:
                names = ", ".join(path.name for path in lacking)
                raise StoreError(
                    f"the journal is kept: not all that it has is in {names} as it was cut", path=log.folder,
                    remedy="look with `recoil-daq recover` at what is there",
                )  # fmt: skip
            log.remove()

    def _sink(self, block: Block) -> None:
        """Keep a block, in its reader's thread."""
        number, kind = self._numbers[block.source], KINDS[block.kind]
        self._journal.append(number, kind, block.host_ns, block.payload, empty_ns=block.empty_ns)
        if block.kind == EVENT:
            self._events.append(block)
        size = len(block.payload)
        with self._lock:
            seen = self._waiting_bytes + size <= QUEUE_BYTES
            if seen:
                self._waiting_bytes += size
            else:
                self._unseen_bytes += size
        if seen:
            self._queue.put(block)
        else:
            empty = replace(block, payload=b"")
            self._queue.put(lambda: self._take_unseen(empty))

    def _take_unseen(self, block: Block) -> None:
        at_s = block.host_ns / 1e9
        self._keep(Kept(at_s, at_s, at_s, at_s + 1.0, f"{block.source}: recorded without a look at it"))
        self._engine.take_unseen(block)

    def _keep(self, stretch: Kept, *, noted: bool = False) -> None:
        """Keep a stretch of the journal beyond the ring, and note so in it unless a decision does."""
        if not noted and not (stretch.why == self._noted[0] and stretch.start_s < self._noted[1]):
            self._say(Kind.KEPT, stretch.last_s, asdict(stretch))
            self._noted = stretch.why, stretch.last_s + _NOTE_EVERY_S
        with self._lock:
            self._kept = longer(self._kept, stretch)

    def _watch(self) -> None:
        self._looked_s = time.monotonic()
        try:
            while not self._stopping.wait(_PAUSE_S) or not self._queue.empty():
                self._take_waiting()
                now_s = time.monotonic()
                if now_s - self._looked_s > _STOOD_STILL_S:
                    self._patient_until_s = now_s + PATIENCE_S
                self._looked_s = now_s
                self._look(now_s)
            self._engine.finish()
            self._look(float("inf"))
        except BaseException as error:
            self._error = error

    def _take_waiting(self) -> None:
        """Take what waits, blocks of one source together: many small ones cost more than one large one."""
        blocks: list[Block] = []
        size = 0
        while size < _MOST_AT_ONCE:
            try:
                item = self._queue.get_nowait()
            except queue.Empty:
                break
            if isinstance(item, Block):
                blocks.append(item)
                size += len(item.payload)
            else:
                self._take(blocks)
                blocks = []
                item()
        self._take(blocks)
        with self._lock:
            self._waiting_bytes -= size

    def _take(self, blocks: Sequence[Block]) -> None:
        for block in blocks:
            self._engine.arrived(block)
            self._await(block)
        for block in joined(blocks):
            self._engine.take(block)

    def _await(self, block: Block) -> None:
        """Keep what a source still delivers of a shot for which it was no longer waited."""
        window = self._awaited.get(block.source)
        if window is None or not block.is_data or block.empty_ns is None:
            return
        if block.empty_ns / 1e9 >= window.stop_s:
            del self._awaited[block.source]
        else:
            from_s, until_s = block.empty_ns / 1e9, block.host_ns / 1e9
            self._keep(Kept(from_s, until_s, from_s, until_s, f"{block.source}: arrived when its shot was already cut"))

    def _look(self, now_s: float) -> None:
        """Record decisions, hand on complete shots, count, and give back what nobody needs."""
        for source in self._engine.new_faults():
            fault = event_block(source, time.monotonic_ns(), "undecoded", self._engine.faults[source])
            self._journal.append(self._numbers[source], Kind.EVENT, fault.host_ns, fault.payload)
            self._events.append(fault)
        for decision in self._engine.news():
            self._say(Kind.DECISION, decision.time_s, asdict(decision))
            self._shots += decision.outcome == "trigger"
            if (stretch := kept_of(decision, self.trigger)) is not None:
                self._keep(stretch, noted=True)
            self._notice(decision)
        self._history.count(self._needed_from_s)
        # how far the queue is behind is no reason to give a source up
        patient = now_s < self._patient_until_s or not self._queue.empty()
        self._handing_on = True
        for window in self._engine.ready(-float("inf") if patient else now_s):
            with self._lock:
                self._holding[round(window.trigger_s * 1e9)] = window.start_s, window.stop_s
            self._awaited |= dict.fromkeys(window.late_sources, window)
            self._windows.put(window)
        self._handing_on = False
        if not patient and now_s - self._released_s >= _RELEASE_EVERY_S:
            self._released_s = now_s
            self._release()

    @property
    def _needed_from_s(self) -> float:
        """The instant before which neither an open shot nor one that is being converted needs anything."""
        with self._lock:
            return min([self._engine.needed_from_s, *(start for start, _ in self._holding.values())])

    def _release(self) -> None:
        """Give back what was watched and in which nothing happened, and shots that are in verified files."""
        from_s = self._needed_from_s
        if from_s > 0:
            kept = [(round(one.start_s * 1e9), round(one.stop_s * 1e9) + 1) for one in self.kept]
            self._journal.release(int(from_s * 1e9), kept)

    def _say(self, kind: Kind, time_s: float, content: Mapping[str, Any]) -> None:
        self._journal.say(kind, round(time_s * 1e9), content)

    @property
    def _state(self) -> State:
        if self._stopping.is_set() or self._error is not None:
            return "stopped"
        if self._engine.recording:
            return "recording"
        return "armed" if self._engine.armed else "disarmed"

    def _source_status(self, name: str) -> SourceStatus:
        reader = self._readers[name]
        error = "" if reader.error is None else str(reader.error)
        source = self._sources[name]
        return SourceStatus(
            name, source.kind, self._history.rate_hz(name), reader.data_age_s, reader.device.counters, error,
            source.live_kind.counted,
        )  # fmt: skip

    def _triggers_at(self, channel: str) -> float | None:
        for condition in self.trigger.conditions:
            if condition.channel == channel and isinstance(condition, Edge):
                return condition.level
        return None


def _free_bytes(folder: Path) -> int:
    """Return the room on the disk of a folder, or of the one that it was in: a journal goes when its session ends."""
    for place in (folder, *folder.parents):
        try:
            return shutil.disk_usage(place).free
        except FileNotFoundError:
            continue
        except OSError:
            break
    return 0
