"""Blocks that were read late, by source: what arrived while nobody read is dated too late."""

from __future__ import annotations

from recoil_acquisition.devices.device import EVENT, Block

WAITED_S = 0.02
"""Time from which on what waited before it was read moves the begin of a shot: far less than makes a source late, for
the frames' own clock counts from when they came."""


class LateReads:
    """Follows the blocks of a session, in the order in which they came.

    A source that is read all the time and never found empty is busy, not late. One that was read late stays so until it
    was found empty again: what had waited comes in several blocks.
    """

    def __init__(self) -> None:
        self._read_ns: dict[str, int] = {}
        self._open_ns: dict[str, tuple[int, int]] = {}

    def since_s(self, block: Block) -> float | None:
        """Return the host time since which a block that was read late may have arrived; None if it was not."""
        if block.kind == EVENT:
            return None
        before_ns = self._read_ns.get(block.source)
        self._read_ns[block.source] = block.host_ns
        if not block.is_data or block.empty_ns is None:
            return None
        opened = self._open_ns.get(block.source)
        if opened is not None and block.empty_ns >= opened[1]:
            opened = None
            del self._open_ns[block.source]
        if opened is None and before_ns is not None and block.late_s(before_ns) > WAITED_S:
            opened = max(block.empty_ns, before_ns), block.host_ns
            self._open_ns[block.source] = opened
        return None if opened is None else opened[0] / 1e9
