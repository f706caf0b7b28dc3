"""What a session frees goes back to the system, though small blocks that stay were made between large ones."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

KEPT_MB = """
import os
from recoil_daq.live.free_memory import return_large_blocks
told = {told} and return_large_blocks()
def resident_mb():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
del (_ := [bytes(4 << 20)])[:]  # from now on the library takes smaller blocks for small ones
before, kept = resident_mb(), []
for _ in range(100):
    large = bytes(300_000), bytes(300_000)
    kept.append((large, bytes(1000)))
kept = [small for _, small in kept]
del large
print(told, resident_mb() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="needs the GNU C library, which keeps what is free")
def test_large_blocks_go_back_to_the_system_when_they_are_free() -> None:
    def kept_mb(*, told: bool) -> tuple[str, float]:
        command = [sys.executable, "-c", KEPT_MB.replace("{told}", str(told))]
        said, mb = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        return said, float(mb)

    assert kept_mb(told=False)[1] > 20.0
    said, mb = kept_mb(told=True)
    assert said == "True"
    assert mb < 3.0
