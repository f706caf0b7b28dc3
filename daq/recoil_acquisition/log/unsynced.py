"""Records that are held in memory until they are on the disk, so that they can be written elsewhere."""

from __future__ import annotations

from collections import deque

KEPT_BYTES = 64 << 20
"""Most that is held; beyond it the oldest go."""


class UnsyncedRecords:
    """The records that may not be on the disk yet, in the order of their numbers."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, bytes, bytes]] = deque()
        self._bytes = 0

    def keep(self, number: int, head: bytes, data: bytes | memoryview) -> None:
        """Hold a record."""
        self._kept.append((number, head, bytes(data)))
        self._bytes += len(head) + len(data)
        while self._bytes > KEPT_BYTES:
            self._forget_first()

    def forget(self, until: int) -> None:
        """Let go of the records before a number: they are on the disk."""
        while self._kept and self._kept[0][0] < until:
            self._forget_first()

    def take_all(self) -> list[tuple[bytes, bytes]]:
        """Return heads and payloads of all of them, and hold none any more."""
        taken = [(head, data) for _, head, data in self._kept]
        self._kept.clear()
        self._bytes = 0
        return taken

    def _forget_first(self) -> None:
        _, head, data = self._kept.popleft()
        self._bytes -= len(head) + len(data)
