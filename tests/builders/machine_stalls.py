"""For how long the machine under the tests did nothing: what plays in real time is late by as much."""

from __future__ import annotations

import threading
import time
from types import TracebackType

NAP_S = 0.002


class MachineStalls:
    """Measures, while its block runs, by how much a nap was late at most.

    Attributes
    ----------
    largest_s : float
        Largest lateness so far.
    """

    def __init__(self) -> None:
        self.largest_s = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._nap, daemon=True)

    def __enter__(self) -> MachineStalls:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()

    def _nap(self) -> None:
        last = time.monotonic()
        while not self._over.wait(NAP_S):
            now = time.monotonic()
            self.largest_s = max(self.largest_s, now - last - NAP_S)
            last = now
