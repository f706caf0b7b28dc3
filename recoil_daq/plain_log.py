"""A live session as plain lines, for a pipe or a log: what happened at once, how it is doing now and then."""

from __future__ import annotations

import datetime as dt
import threading
import time
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, TextIO

from daq.capture.status import LiveStatus, SourceStatus
from recoil_daq.live_shot import LiveShot
from recoil_daq.losses import losses_of

STATUS_EVERY_S = 10.0
CHANGE_AFTER_S = 1.0
"""A change of the trigger's state or of the losses is told at once, but not more often than this."""


class PlainLog:
    """Writes lines, each with its time in UTC, and flushes every one.

    Parameters
    ----------
    stream : text stream
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._lock = threading.Lock()
        self._told_s = -STATUS_EVERY_S
        self._told: tuple[str, ...] = ()

    def __enter__(self) -> PlainLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.flush()

    def show(self, status: LiveStatus, shots: Sequence[LiveShot]) -> None:
        """Write how it is doing, every ten seconds and when the state or the losses change."""
        now_s = time.monotonic()
        telling = (status.state, *(losses_of(s.counters) + s.error for s in status.sources))
        due = STATUS_EVERY_S if telling == self._told else CHANGE_AFTER_S
        if now_s - self._told_s < due:
            return
        self._told_s, self._told = now_s, telling
        waiting = sum(shot.state in ("waiting", "converting", "cutting") for shot in shots)
        parts = [status.state, *(_source(s) for s in status.sources)]
        parts.append(f"shots {status.shots}" + (f", {waiting} not finished" if waiting else ""))
        parts.append(f"disk {status.disk_free_bytes / 1e9:.1f} GB free")
        if status.unseen_bytes:
            parts.append(f"the trigger fell behind by {status.unseen_bytes} bytes")
        self._line(" | ".join(parts))

    def notice(self, text: str) -> None:
        """Write what happened."""
        self._line(text)

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Write the verdict on a shot."""
        from rich.console import Console

        from recoil_daq.tables import PIPED_WIDTH, print_verdict

        with self._lock:
            print_verdict(document, Console(file=self._stream, width=PIPED_WIDTH, highlight=False, emoji=False))
            self._stream.flush()

    def key(self) -> str:
        """Return nothing: a log has no keys."""
        return ""

    def _line(self, text: str) -> None:
        now = dt.datetime.now(dt.UTC).isoformat(sep=" ", timespec="milliseconds").removesuffix("+00:00")
        with self._lock:
            self._stream.write(f"{now}Z  {' '.join(text.split())}\n")
            self._stream.flush()


def _source(source: SourceStatus) -> str:
    age = "never heard" if source.age_s is None else f"age {source.age_s:.2f} s"
    text = f"{source.name} {rate_of(source)}, {age}, losses {losses_of(source.counters)}"
    return text + (f", STOPPED: {source.error}" if source.error else "")


def rate_of(source: SourceStatus) -> str:
    """Write how much a source delivers: frames of a bus, bytes of a port."""
    if source.kind == "can":
        return f"{source.rate_hz:.0f} frames/s"
    return f"{source.rate_hz / 1e3:.1f} kB/s"
