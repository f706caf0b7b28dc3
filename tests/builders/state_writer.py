"""A session that only writes how it is doing, some times a second, as an armed one does: ``python -m .. FOLDER``.

It stands for a session in tests of its page: it can be killed, and shows what a test gives it.
"""

from __future__ import annotations

import datetime as dt
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

from recoil_daq.live.range_state import RangeState
from recoil_daq.live.shot import ShotState
from recoil_daq.live.state_file import StateFile
from tests.builders.range_states import CLIPPED, MASS, SOURCES, day, usable

HOSTILE = "<img src=x onerror=\"document.title='owned'\">\u202e</script><script>window.owned=1</script>"


@dataclass(frozen=True)
class Written:
    """State that is written, with the time at which it is."""

    state: RangeState

    def write_to(self, folder: Path, armed_s: float = 1.0) -> None:
        now = dt.datetime.now(dt.UTC).isoformat(timespec="milliseconds")
        fault = StateFile(folder).write(replace(self.state, utc=now, armed_s=armed_s))
        assert not fault


DIGEST = "0" * 64
WITH_MASS = {**MASS, "thinned_hz": None, "bare": False, "peaks": {"breech_pressure_pa": 131.4e6}, "peaks_u": {}}
STATE = Written(
    day(
        sources=(*SOURCES[:3], replace(SOURCES[3], awaited=(), waited_s=None, left_s=None)),
        shots=(
            replace(CLIPPED, overview=DIGEST),
            usable("0002", mass=WITH_MASS, overview=DIGEST),
            usable("0003", mass={**WITH_MASS, "value": 784.2}, overview=DIGEST),
        ),
    )
)
FILES = Written(day(shots=(usable("0002", mass=WITH_MASS), replace(CLIPPED, name="0003", state=ShotState.WAITING))))


def write_on(folder: Path, state: RangeState) -> None:
    """Write a state again and again, until the process ends."""
    file, began_s = StateFile(folder), time.monotonic()
    while True:
        now = dt.datetime.now(dt.UTC).isoformat(timespec="milliseconds")
        file.write(replace(state, utc=now, armed_s=time.monotonic() - began_s))
        time.sleep(0.2)


if __name__ == "__main__":
    write_on(Path(sys.argv[1]), STATE.state)
