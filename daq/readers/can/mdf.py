"""Bus logging of MDF 4: raw frames of CAN buses.

Layout: "ASAM MDF 4, bus logging": a group per kind of event has a channel ``CAN_DataFrame``, ``CAN_RemoteFrame``,
``CAN_ErrorFrame`` or ``CAN_OverloadFrame`` composed of ``.ID``, ``.IDE``, ``.BusChannel``, ``.DataLength`` and
``.DataBytes``. The columns are taken by asammdf as they are stored; frames are decoded like those of any log.
"""

from __future__ import annotations

import datetime as dt
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from traceback import walk_tb
from typing import Any

import numpy as np

from daq.errors import CorruptFileError, ReadError
from daq.readers.can.frames import EXTENDED, ID_MASK, LATEST_NS, CanLog, FrameBlock, FrameList
from daq.readers.can.recording import CanRecording, declared_database
from daq.readers.mdf.blocks import check_blocks
from daq.readers.mdf.kind import is_bus_file, is_bus_logging, is_undecided
from daq.readers.reader import Declarations
from daq.timebase import AbsoluteStart

FRAME = "CAN_DataFrame"
LARGEST_RATIO = 100
"""Unpacked frames take no more than so many times the file's size."""

_COLUMNS = ("ID", "DataLength", "DataBytes")
_OPTIONAL = ("IDE", "BusChannel")
_LOCAL_TIME = 0x1


class MdfBusReader:
    """Reader of bus logging in MDF 4."""

    name = "MDF4 bus logging"
    kind = "can"
    suffixes = (".mf4",)

    def claims(self, head: bytes) -> bool:
        """Tell whether an MDF 4 file holds frames of a CAN bus, or does not tell it in its first bytes."""
        return is_bus_logging(head) or is_undecided(head)

    def confirms(self, path: Path) -> bool:
        """Tell from all of a file whether it holds frames of a bus alone."""
        return is_bus_file(path)

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if it is damaged, or the extra or the database is missing or wrong."""
        database = declared_database(declared, path)
        return CanRecording(path, self.name, read_mdf(path), database, declared)


def read_mdf(path: Path) -> CanLog:
    """Read the frames of all buses in a file.

    Returns
    -------
    CanLog
        Time counts from the first data frame.

    Raises
    ------
    ReadError
        If the file cannot be read, or asammdf is not installed.
    CorruptFileError
        If asammdf cannot make sense of it.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror}", path=path, remedy="check its permissions") from error
    try:
        from asammdf import MDF
    except ImportError as error:
        raise ReadError(
            "MDF files need the library asammdf", path=path, remedy="pip install 'recoil-daq[mdf]'"
        ) from error
    unfinished = content.startswith(b"UnFin")
    check_blocks(path, content, finished=not unfinished)
    try:
        # from memory: asammdf finishes an unfinished file where it reads it, and a recording is never written to
        with _quiet(), MDF(BytesIO(content)) as file:
            return _read_groups(path, len(content), file, unfinished=unfinished)
    except ReadError:
        raise
    except Exception as error:  # whatever a damaged file makes of asammdf
        _close_what_was_half_opened(error)
        raise CorruptFileError(
            "asammdf cannot read the file",
            path=path,
            found=f"{type(error).__name__}: {str(error)[:200]}",
            remedy="copy the file again",
        ) from error


def _close_what_was_half_opened(error: BaseException) -> None:
    """Close what asammdf left: its own closing fails on a file that it could not open, once it is collected."""
    for frame, _ in walk_tb(error.__traceback__):
        half_opened: Any = frame.f_locals.get("self")
        if type(half_opened).__name__ == "MDF4" and not half_opened._closed:
            half_opened._closed = True
            half_opened._tempfile.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep asammdf from talking: what it would say of a file, the notes say."""
    logger = logging.getLogger("asammdf")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _read_groups(path: Path, size: int, file: Any, *, unfinished: bool) -> CanLog:
    found = FrameList()
    notes: list[str] = []
    missing = 0
    blocks: list[FrameBlock] = []
    for number, group in enumerate(file.groups):
        names = [channel.name for channel in group.channels]
        count = int(group.channel_group.cycles_nr)
        kinds = {name.partition(".")[0] for name in names}
        if FRAME in kinds:
            if count * int(group.channel_group.samples_byte_nr) > LARGEST_RATIO * size:
                raise CorruptFileError(
                    "a group states more frames than the file can hold",
                    path=path,
                    place=f"group {number}",
                    found=f"{count} frames in {size} bytes",
                )
            if count:
                block, damaged = _block(path, file, number, names)
                found.damaged += damaged
                missing += max(0, count - block.key.size - damaged)
                blocks.append(block)
        else:
            found.error_frames += count * ("CAN_ErrorFrame" in kinds)
            found.remote_frames += count * ("CAN_RemoteFrame" in kinds)
            other = not {"CAN_ErrorFrame", "CAN_RemoteFrame"} & kinds
            found.other_events += count * other
            if count and other:
                notes.append(
                    f"group {number} ({names[1] if len(names) > 1 else 'no channels'}): no CAN frames, not read"
                )
    for block in _by_time(blocks):
        found.add_block(block)
    frames, zero_ns = found.frames(from_first=True)
    cuts = []
    if missing:
        cuts.append(f"the file is cut: {missing} frames that it states are not there")
    if unfinished:
        cuts.append("the recorder did not close the file: its last frames may be missing")
    header = file.header
    metadata = {
        **found.counts(),
        "version": str(file.version),
        "first_stamp_s": zero_ns / 1e9,
        "recorder_did_not_close_the_file": unfinished,
    }
    start = _start(int(header.abs_time) + zero_ns, int(header.time_flags))
    return CanLog(frames, start, (*found.notes(), *notes, *cuts), "; ".join(cuts[:1] if missing else []), metadata)


def _block(path: Path, file: Any, group: int, names: list[str]) -> tuple[FrameBlock, int]:
    """Take the columns of one group in one select; return its frames, and how many are damaged."""
    absent = [name for name in _COLUMNS if f"{FRAME}.{name}" not in names]
    if absent:
        raise CorruptFileError(
            "a group of CAN frames lacks columns",
            path=path,
            place=f"group {group}",
            expected=", ".join(f"{FRAME}.{name}" for name in _COLUMNS),
            found=", ".join(names[:20]),
        )
    wanted = [name for name in (*_COLUMNS, *_OPTIONAL) if f"{FRAME}.{name}" in names]
    chosen = [(f"{FRAME}.{name}", group, names.index(f"{FRAME}.{name}")) for name in wanted]
    signals = dict(zip(wanted, file.select(chosen, raw=True, copy_master=False), strict=True))
    time_s = np.asarray(signals["ID"].timestamps, dtype=np.float64)
    stored = signals["ID"].samples.astype(np.int64)
    data = np.asarray(signals["DataBytes"].samples)
    if data.dtype != np.uint8 or data.ndim != 2 or data.shape[1] > 64:
        raise CorruptFileError("the data of CAN frames are no bytes", path=path, place=f"group {group}")
    length = signals["DataLength"].samples.astype(np.int64)
    extended = signals["IDE"].samples != 0 if "IDE" in signals else stored & EXTENDED != 0
    channel = signals["BusChannel"].samples.astype(np.int64) if "BusChannel" in signals else np.zeros_like(stored)
    key = stored & ID_MASK
    sound = np.isfinite(time_s) & (np.abs(np.nan_to_num(time_s)) < LATEST_NS / 2e9) & (length <= data.shape[1])
    sound &= extended | (key <= 0x7FF)
    for signal in signals.values():
        if signal.invalidation_bits is not None:
            sound &= ~np.asarray(signal.invalidation_bits, dtype=bool)
    width = max(8, data.shape[1])
    padded = np.zeros((int(sound.sum()), width), dtype=np.uint8)
    padded[:, : data.shape[1]] = data[sound]
    padded[np.arange(width) >= length[sound, None]] = 0
    whole_s = np.floor(time_s[sound])
    time_ns = whole_s.astype(np.int64) * 1_000_000_000 + np.rint((time_s[sound] - whole_s) * 1e9).astype(np.int64)
    block = FrameBlock(
        place=np.arange(len(padded), dtype=np.int64),
        time_ns=time_ns,
        key=(key[sound] | np.where(extended[sound], EXTENDED, 0)).astype(np.uint32),
        channel=channel[sound],
        length=length[sound],
        data=padded,
    )
    return block, int((~sound).sum())


def _by_time(blocks: list[FrameBlock]) -> list[FrameBlock]:
    """Give the frames of several groups their places in time; one group keeps its order."""
    if len(blocks) < 2:
        return blocks
    time_ns = np.concatenate([block.time_ns for block in blocks])
    place = np.empty(time_ns.size, dtype=np.int64)
    place[np.argsort(time_ns, kind="stable")] = np.arange(time_ns.size)
    placed, at = [], 0
    for block in blocks:
        end = at + block.key.size
        placed.append(FrameBlock(place[at:end], block.time_ns, block.key, block.channel, block.length, block.data))
        at = end
    return placed


def _start(start_ns: int, flags: int) -> AbsoluteStart | None:
    """Return the wall-clock time of the first frame."""
    try:
        instant = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=(start_ns + 500) // 1000)
    except OverflowError:
        return None
    local = bool(flags & _LOCAL_TIME)
    return AbsoluteStart(
        instant.isoformat(timespec="microseconds"),
        "unknown" if local else "UTC",
        "MDF header block and stamp of the first frame" + (", local time of the recorder" if local else ""),
    )
