"""For how long a process waits for the machine: by so much it may be late without a fault of its own."""

from __future__ import annotations

import contextlib
import os
import threading
import time
import tty
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

EVERY_S = 0.02


@dataclass(frozen=True)
class _Look:
    """For how long each thread has waited for a processor by an instant, and how long a byte took that arrived then."""

    at_ns: int
    threads_ns: dict[str, int]
    byte_ns: int


class MachineWaits:
    """Looks, while its block runs, at what the kernel counts of another process's threads, and at its own terminal.

    A thread that sleeps, or waits for a lock, does not wait for the machine. What is written into a pseudo-terminal is
    handed on by a worker of the kernel, which needs a processor as well: on a busy machine it was seen 0.7 s late.

    Parameters
    ----------
    process : int
        Its number.
    """

    def __init__(self, process: int) -> None:
        self._tasks = Path(f"/proc/{process}/task")
        self._sent_ns = 0
        self._seen = deque([_Look(time.monotonic_ns(), {}, 0)], maxlen=1000)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> MachineWaits:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()

    def longest_ns(self, over_ns: int) -> int:
        """Return the longest wait in the time up to now, ns: of a thread, or of a byte that came or is to come."""
        now_ns, now = time.monotonic_ns(), self._threads_ns()
        looks = tuple(self._seen)
        before = [look for look in looks if look.at_ns <= now_ns - over_ns] or looks[:1]
        threads = (waited - before[-1].threads_ns.get(thread, 0) for thread, waited in now.items())
        bytes_ns = (look.byte_ns for look in looks if look.at_ns > now_ns - over_ns)
        on_its_way_ns = now_ns - sent_ns if (sent_ns := self._sent_ns) else 0
        return max(0, on_its_way_ns, *threads, *bytes_ns)

    def _watch(self) -> None:
        writer, reader = os.openpty()
        tty.setraw(reader)
        with open(writer, "wb", buffering=0) as one, open(reader, "rb", buffering=0) as other:  # noqa: PTH123 - descriptors
            while not self._over.wait(EVERY_S):
                self._sent_ns = before_ns = time.monotonic_ns()
                one.write(b".")
                other.read(1)
                now_ns = time.monotonic_ns()
                self._seen.append(_Look(now_ns, self._threads_ns(), now_ns - before_ns))
                self._sent_ns = 0

    def _threads_ns(self) -> dict[str, int]:
        waits = {}
        with contextlib.suppress(OSError):  # the process has ended
            for thread in os.listdir(self._tasks):  # noqa: PTH208 - names alone, of what may be gone by now
                with contextlib.suppress(OSError, IndexError):  # the thread has ended
                    waits[thread] = int((self._tasks / thread / "schedstat").read_text().split()[1])
        return waits
