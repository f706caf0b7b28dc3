"""Recordings of DEWETRON OXYGEN, built from bytes by the layout in `recoil_acquisition.readers.oxygen.blocks`."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

FILE_SEGMENT = 65535
WIDTHS = {"sint24": 3, "sint32": 4, "uint32": 4, "float": 4, "double": 8}


@dataclass(frozen=True)
class Stored:
    """One channel: what is stored, and what the setup says of it.

    ``values`` are stored numbers, or a function of first and end tick that gives them.
    ``ticks`` are the stamps of an asynchronous channel.
    """

    name: str
    values: np.ndarray | Callable[[int, int], np.ndarray] | Sequence[float]
    unit: str = "V"
    sample_format: str = "sint24"
    scaling: str = '<Scaling><Linear k="0.5" d="0"/></Scaling>'
    ticks: Sequence[int] | None = None
    dimension: int = 1
    properties: str = ""
    chain_step: int = 0
    source_scaling: str | None = None

    @property
    def width(self) -> int:
        return WIDTHS.get(self.sample_format, 8)

    def encode(self, values: np.ndarray | Sequence[float]) -> bytes:
        if self.sample_format == "sint24":
            return np.asarray(values, "<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
        kinds = {"sint32": "<i4", "uint32": "<u4", "float": "<f4", "double": "<f8"}
        return np.asarray(values).astype(kinds.get(self.sample_format, "<f8")).tobytes()


def block(
    segment: int, kind: int, payload: bytes, level: int = 0, samples_head: bytes = b"", spare: bytes = b""
) -> bytes:
    whole = 20 + len(samples_head) + len(payload) + len(spare)
    head = struct.pack("<4sIIHBB", b"DMDH", len(payload), whole, segment, level, kind)
    return head + struct.pack("<I", zlib.crc32(head[:15])) + samples_head + payload + spare


def packed(text: bytes) -> bytes:
    return b"\x99MZX" + struct.pack(">I", len(text)) + zlib.compress(text)


def file_head(version: int = 8) -> bytes:
    content = struct.pack("<4sIBBB64s", b"DMDF", version, 20, 0, 0, b"DMD Library ver.2.3.0.0")
    return (content + struct.pack("<I", zlib.crc32(content))).ljust(4096, b"\0")


def event_text(what: str, tick: int, frequency_hz: float, group: str | None) -> str:
    named = "" if group is None else f'<Property name="groupID"><StringValue>"{group}"</StringValue></Property>'
    return (
        f'<Event><Property name="eventType"><EnumValue enum="EventType">oxy::{what}</EnumValue></Property>{named}'
        f'<Property name="ticks"><UnsignedInt64>{tick}</UnsignedInt64></Property>'
        f'<Property name="frequency"><DoubleValue>{frequency_hz:g}</DoubleValue></Property></Event>'
    )


def _quoted(name: str, text: str) -> str:
    return f'<Property name="{name}"><StringValue>"{escape(text)}"</StringValue></Property>'


def channel_text(channel: Stored, segment: int, offset: int, stride: int, frequency_hz: float) -> str:
    source = "" if channel.source_scaling is None else _quoted("Scaling", channel.source_scaling)
    mode = "SYNC" if channel.ticks is None else "ASYNC"
    return (
        f'<Channel id="{segment}{offset}"><DataFormat frequency="{mode}" sample_format="{channel.sample_format}" '
        f'sample_dimension="{channel.dimension}"/><TimeBase frequency="{frequency_hz:g}"/><MeasurementChain>'
        f"{source}{_quoted('Neon/Name', channel.name)}{_quoted('Scaling', channel.scaling)}"
        f"{_quoted('Neon/PhysicalUnit', channel.unit)}{channel.properties}</MeasurementChain>"
        f'<ChannelStorage chain_step="{channel.chain_step}"><DMDStorageDetails segment_id="{segment}" '
        f'raw_offset="{offset}" raw_stride="{stride}"/></ChannelStorage></Channel>'
    )


def oxygen_chunks(
    channels: Sequence[Stored],
    *,
    windows: Sequence[tuple[int, int | None]] = ((0, None),),
    blocks: Sequence[tuple[int, int]] = ((0, 10),),
    per_block: int | None = None,
    frequency_hz: float = 1000.0,
    segment_frequency_hz: float | None = None,
    compression: str = "",
    is_packed: bool = False,
    is_finished: bool = True,
    other_group: Sequence[tuple[int, int | None]] | None = None,
    not_stored: Sequence[str] = (),
    start: str = "2026-08-05T10:21:17.978Z",
    extra: bytes = b"",
    stale: bytes = b"",
) -> Iterator[bytes]:
    """Yield a file block by block; ``blocks`` are first ticks and counts of the synchronous ones."""
    sync = [c for c in channels if c.ticks is None]
    loose = [c for c in channels if c.ticks is not None]
    per_block = per_block or max((count for _, count in blocks), default=1)
    # planar: one channel behind the other, each as long as a whole block
    offsets = np.cumsum([0, *(c.width * per_block for c in sync)])
    segments = ([0] if sync else []) + list(range(1, 1 + len(loose)))
    config_at, event_at, recovery_at = 100, 101, 102
    rate = frequency_hz if segment_frequency_hz is None else segment_frequency_hz
    described = "".join(
        f"<segment><identifier>{s}</identifier><time_base_frequency_hz>{f:g}</time_base_frequency_hz>"
        f"<compression>{c}</compression><name>{n}</name></segment>"
        for s, f, c, n in (
            *((s, rate, compression, "") for s in segments),
            (config_at, 0, "", "oxy_config"),
            (event_at, 0, "", "oxy_event"),
            (recovery_at, 0, "", "oxy_event_recovery"),
        )
    )  # fmt: skip
    config = f'<?xml version="1.0"?><dmd_cfg>{described}<big_endian_file_layout>0</big_endian_file_layout></dmd_cfg>'
    listed = [channel_text(c, 0, 8 * int(at), 8 * c.width, frequency_hz) for c, at in zip(sync, offsets, strict=False)]
    listed += [channel_text(c, 1 + i, 0, 0, frequency_hz) for i, c in enumerate(loose)]
    listed += [
        f'<Channel id="9"><DataFormat frequency="SYNC" sample_format="double"/>{_quoted("Neon/Name", name)}</Channel>'
        for name in not_stored
    ]
    setup = (
        '<?xml version="1.0"?><MeasurementConfig xmlns="http://xml.dewetron.com/oxygen/config"><MeasurementHeader>'
        f'<Property name="AcquisitionStartTime"><DateTimeValue>{start}</DateTimeValue></Property></MeasurementHeader>'
        f"<Channels>{''.join(listed)}</Channels></MeasurementConfig>"
    )

    def text(segment: int, content: str) -> bytes:
        return block(segment, 9, packed(content.encode()) if is_packed else content.encode())

    events = [
        (what, tick, group)
        for group, spans in (("FAST", windows), ("SLOW", windows if other_group is None else other_group))
        for span in spans
        for what, tick in (("storing_start", span[0]), ("storing_stop", span[1]))
        if tick is not None
    ]
    said = [event_text(what, tick, frequency_hz, group) for what, tick, group in events]
    yield file_head()
    yield block(FILE_SEGMENT, 1, config.encode())
    yield text(config_at, setup)
    # the recorder writes down when storing stops before it writes the last samples
    for event in said:
        yield block(recovery_at, 9, f"<Events>{event}</Events>".encode())
    for i, channel in enumerate(loose):
        yield from _loose_blocks(channel, 1 + i, compression)
    for tick, count in blocks if sync else ():
        parts = []
        for channel in sync:
            values = (
                channel.values(tick, tick + count) if callable(channel.values) else channel.values[tick : tick + count]
            )
            parts.append(channel.encode(values).ljust(channel.width * per_block, b"\0"))
        head = struct.pack("<BQQQQ", 7, tick, count, 2**64 - 1, count)
        yield block(0, 2, compressed(b"".join(parts), compression), 0, head)
        yield block(0, 2, b"\x55" * 16, 1, struct.pack("<BQQQQ", 7, tick, 1, 2**64 - 1, 1))
    yield extra
    if is_finished:
        yield text(config_at, setup)
        yield text(event_at, f"<Events>{''.join(said)}</Events>")
        yield block(FILE_SEGMENT, 1, config.encode())
        yield block(FILE_SEGMENT, 4, b"FDMDIDXT")
        yield block(FILE_SEGMENT, 8, b"FDMDIDXR")
        yield stale


def _loose_blocks(channel: Stored, segment: int, compression: str, size: int = 4) -> Iterator[bytes]:
    ticks = np.asarray(channel.ticks, "<u8")
    for at in range(0, ticks.size, size):
        part = ticks[at : at + size]
        pairs = b"".join(
            struct.pack("<Q", int(t)) + channel.encode([v])
            for t, v in zip(part, channel.values[at : at + size], strict=True)
        )
        head = struct.pack("<BQQQQ", 7, int(part[0]), int(np.ptp(part)) + 1, at, part.size)
        yield block(segment, 6, compressed(pairs, compression), 0, head)


def compressed(payload: bytes, compression: str) -> bytes:
    if compression != "lz4":
        return payload
    from lz4.block import compress

    return struct.pack("<I", len(payload)) + compress(payload, store_size=False)


def oxygen_dmd(channels: Sequence[Stored], **options: object) -> bytes:
    return b"".join(oxygen_chunks(channels, **options))
