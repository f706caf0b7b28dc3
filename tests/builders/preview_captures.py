"""Captures of what was read live of a recorder of the virtual rig, as a kind of live source that stands in for one.

Its stream is packets of single precision, each with the tick of its first sample; the file of the same shot is the
twin's, as a text with nine digits.
"""

from __future__ import annotations

import datetime as dt
import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from recoil_acquisition import live_kind
from recoil_acquisition.capture.cut import ACQUISITION
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.live_kind import LiveKind
from recoil_acquisition.log.record import DATA
from recoil_acquisition.readers.captured import CapturedSource
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.shot.acquisition import AcquiredSource, Acquisition
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders import rdlog_bytes
from tests.builders.oxygen_dmd import Stored, oxygen_dmd
from tests.builders.virtual_shots import SHORTER, with_twin

KEY, STREAM = "stand_in", 3
KIND = LiveKind(
    KEY, ("dewetron",), "stream", f"{__name__}:none", f"{__name__}:none", f"{__name__}:opened", counted="bytes",
    example="{ stand_in = 1 }", is_preview=True,
)  # fmt: skip
BEGAN = dt.datetime(2026, 6, 1, 12, tzinfo=dt.UTC)
HOST_NS = 7_000_000_000_000
PACKET = 250
NO_UNITS: Mapping[str, str] = MappingProxyType({})


@contextmanager
def standing_in() -> Iterator[None]:
    """Have the kind known."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live_kind, "_OWN", (*live_kind._OWN, KIND))
        yield


def opened(path: Path, source: CapturedSource, declared: Declarations) -> Recording:
    """Open what a capture has of it, dated by its ticks."""
    packets = [_packet(record.payload) for record in source.records if record.kind in DATA]
    said, _ = packets[0]
    ticks = np.concatenate([head["first"] + np.arange(len(rows)) for head, rows in packets])
    values = np.concatenate([rows for _, rows in packets]).astype(np.float64)
    start = AbsoluteStart(said["start"], "UTC", "stream", said["by"]) if said["start"] else None
    base = TimeBase.stamped(declared.clock, ticks / said["rate_hz"] - said["zero_s"], start)
    channels = [
        StoredChannel(SignalHeader(name, unit, ticks.size), base, partial(_part, values[:, at]))
        for at, (name, unit) in enumerate(said["channels"])
    ]
    return Recording(path, KEY, channels, metadata={}, incomplete=source.incomplete, absolute_start=start)


def _packet(payload: bytes) -> tuple[dict[str, Any], np.ndarray]:
    head, _, body = payload.partition(b"\n")
    said = json.loads(head)
    return said, np.frombuffer(body, "<f4").reshape(-1, len(said["channels"]))


def _part(column: np.ndarray, start: int, stop: int) -> np.ndarray:
    return column[start:stop].copy()


@dataclass(frozen=True)
class Faults:
    """What is wrong with a preview.

    Attributes
    ----------
    scale
        Factor on samples, by signal.
    shift
        Samples by which it is read early: its ticks say the same.
    hole
        Samples that fell out, first and behind the last.
    hidden
        Whether the ticks go on over the hole as if nothing had fallen out.
    """

    scale: dict[str, float] = field(default_factory=dict)
    shift: int = 0
    hole: tuple[int, int] = (0, 0)
    hidden: bool = False


@dataclass(frozen=True, eq=False)
class PreviewedShot:
    """A twin shot of a rig whose recorder is read live, with its files."""

    rig: Rig
    twin: TwinShot
    folder: Path

    @property
    def own(self) -> Path:
        """The recorder's own file."""
        return next(path for path in self.twin.files if "dewetron" in path.name)

    @property
    def others(self) -> list[Path]:
        """Files of the other sources."""
        return [path for path in self.twin.files if path != self.own]

    def dmd(self, start: str = "2026-06-01T12:00:00.000Z") -> Path:
        """Write the recorder's own file as a recording of OXYGEN: whole counts, its start to the millisecond."""
        recording = recognise(self.own).open(self.own, Declarations("dewetron"))
        stored = []
        for one in recording.signals:
            values = recording.read(one.name)
            step = float(np.abs(values).max()) / 2**22
            scaling = f'<Scaling><Linear k="{step!r}" d="0"/></Scaling>'
            stored.append(Stored(one.name, np.rint(values / step).astype(int), one.unit, scaling=scaling))
        base = recording.time_base(recording.signals[0].name)
        first = round(base.start_s * base.rate_hz)
        path = self.folder / self.own.with_suffix(".dmd").name
        path.write_bytes(
            oxygen_dmd(
                stored, frequency_hz=float(round(base.rate_hz)), blocks=((first, base.count),),
                windows=((first, first + base.count),), start=start,
            )
        )  # fmt: skip
        return path

    def preview(
        self,
        faults: Faults | None = None,
        *,
        of: Path | None = None,
        first: int = 900,
        count: int = 7000,
        timed: bool = True,
        zero_s: int = 0,
        units: Mapping[str, str] = NO_UNITS,
    ) -> Path:
        """Write the capture of what was read live, samples `first` and the next ones of the file."""
        wrong = faults or Faults()
        own = of or self.own
        recording = recognise(own).open(own, Declarations("dewetron"))
        names = [(one.name, units.get(one.name, one.unit)) for one in recording.signals]
        rows = np.stack(
            [wrong.scale.get(n, 1.0) * recording.read(n)[first + wrong.shift :][:count] for n, _ in names], axis=1
        )
        base = recording.time_base(names[0][0])
        ticks = round(base.start_s * base.rate_hz) + first + np.arange(len(rows))
        kept = np.r_[0 : wrong.hole[0], wrong.hole[1] : len(rows)]
        rows = rows[kept].astype("<f4")
        ticks = ticks[: len(kept)] if wrong.hidden else ticks[kept]
        # the stream tells its start more finely than the file, and counts from the same instant
        # and, as readers of ticks since 1970 do, from a whole second of it
        began = (BEGAN + dt.timedelta(seconds=zero_s)).replace(tzinfo=None)
        head = {
            "zero_s": zero_s, "rate_hz": round(base.rate_hz), "channels": names,
            "start": f"{began.isoformat()}.000123456" if timed else "", "by": "PTP" if timed else "",
        }  # fmt: skip
        ends = np.flatnonzero(np.diff(ticks) != 1) + 1
        records = []
        for part in np.split(np.arange(len(rows)), sorted({*ends.tolist(), *range(PACKET, len(rows), PACKET)})):
            payload = json.dumps(head | {"first": int(ticks[part[0]])}).encode() + b"\n" + rows[part].tobytes()
            host_ns = HOST_NS + round(1e9 * (ticks[part[-1]] + 1) / base.rate_hz)
            records.append((0, STREAM, host_ns, payload))
        path = self.folder / f"{self.twin.shot}.rdlog"
        session = {
            "sources": [{"name": "dewetron", "kind": "dewetron", "device": KEY}],
            "anchor": {"wall_ns": round(1e9 * BEGAN.timestamp()), "monotonic_ns": HOST_NS, "within_ns": 0},
        }
        span_s = ticks[0] / base.rate_hz, len(rows) / base.rate_hz
        acquisition = _acquisition(self, path.name, *span_s, len(records))
        path.write_bytes(rdlog_bytes.rdlog(session, records, {ACQUISITION: acquisition.to_json()}))
        return path


def _acquisition(shot: PreviewedShot, file: str, begins_s: float, lasts_s: float, blocks: int) -> Acquisition:
    pre_s = 0.05
    trigger_s = begins_s + pre_s
    source = AcquiredSource("dewetron", "dewetron", file, blocks, 1, pre_s, False, 0.0, 0, 0, 0, None, 0, -pre_s, ())
    return Acquisition(
        shot=shot.twin.shot, rig=shot.rig.name, trigger_ns=HOST_NS + round(1e9 * trigger_s),
        trigger_utc=(BEGAN + dt.timedelta(seconds=trigger_s)).replace(tzinfo=None).isoformat(), pre_s=pre_s,
        post_s=lasts_s - pre_s, pre_actual_s=pre_s, duration_s=lasts_s, decisions=(), sources=(source,),
    )  # fmt: skip


def previewed_rig(**settings: float) -> Rig:
    """Load the rig ``field-2013`` with a recorder that is read live."""
    rig = with_twin("field-2013", **SHORTER | settings)
    text = rig.text.replace('match = "*_dewetron.csv"', f'device = {{ {KEY} = 1 }}\nmatch = "*_dewetron.*"', 1)
    return parse_rig(text, rig.path)


@contextmanager
def previewed_shot(seed: int = 3, name: str = "0001", **settings: float) -> Iterator[PreviewedShot]:
    """Simulate a shot in a folder of its own."""
    with standing_in(), tempfile.TemporaryDirectory() as folder:
        rig = previewed_rig(**settings)
        yield PreviewedShot(rig, simulate_shot(rig, Path(folder) / "files", seed=seed, shot=name), Path(folder))
