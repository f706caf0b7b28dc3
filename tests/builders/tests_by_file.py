"""How the tests are dealt out to several workers: file by file, what plays devices in real time first and by one."""

from __future__ import annotations

import pytest
from xdist.scheduler import LoadFileScheduling

PLAYED = ("tests/recoil_daq/live/test_acquisition.py", "tests/recoil_daq/live/test_crash.py")
"""Files in which every test plays devices, or waits for what does: long for their number, and never two at once."""
LONG = "tests/test_docs.py"
"""File that takes a worker a minute: the last to begin, it would be the last to end, alone."""
FOLDERS_BEFORE = ("tests/contracts/", "tests/daq/")
"""Folders behind which it begins: it plays devices, too, but not beside the files that do so first."""


class TestsByFile(LoadFileScheduling):
    """A file's tests share what they simulate and identify, so one worker runs them all."""

    def _split_scope(self, nodeid: str) -> str:
        file = str(super()._split_scope(nodeid))
        return PLAYED[0] if file in PLAYED else file


def long_first(items: list[pytest.Item]) -> None:
    """Put the tests in front that would be the last to end, whoever else has nothing left to do."""
    first = (PLAYED, FOLDERS_BEFORE, (LONG,))
    items.sort(key=lambda item: next((at for at, of in enumerate(first) if item.nodeid.startswith(of)), len(first)))
