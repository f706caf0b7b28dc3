"""Shots of the virtual rig ``mixed`` whose bus is a second recorder, its clock aligned by absolute time."""

from __future__ import annotations

import datetime as dt
import math
import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.shared_motions import made_once
from tests.builders.virtual_shots import SHORTER, with_twin

SECOND = "can"
COMPARED = ', channel = "acc_recoil_can", against = "acc_recoil"'
NOON = dt.datetime(2026, 6, 1, 12)


def two_recorders(by: str = "irig-b", align: str = f"u_s = 1e-5{COMPARED}") -> Rig:
    """Load the rig, with what locks both recorders and the keys of the alignment."""
    mixed = with_twin("mixed", **SHORTER)
    text = re.sub(r"device = \{ virtual[^}]*\}.*", "", mixed.text)
    bus, imu, trigger, twin = (
        text.index(part) for part in ('[[source]]\nname = "can"', '[[source]]\nname = "imu"', "[trigger]", "[twin]")
    )
    time = f'time = {{ by = "{by}" }}\n'
    source = f'[[source]]\nname = "{SECOND}"\nkind = "dewetron"\nmatch = "*_can.csv"\n{time}'
    more = ", ".join(filter(None, ('method = "absolute"', align)))
    head = text[:bus].replace('kind = "dewetron" ', f'{time}kind = "dewetron" ', 1)
    measures = '\n[twin.measures]\nacc_recoil_can = "recoil_acceleration"\n'
    text = f"{head}{source}align = {{ {more} }}\n\n{text[imu:trigger]}{text[twin:]}{measures}"
    return parse_rig(text, mixed.path)


@dataclass(frozen=True, eq=False)
class Apart:
    """A shot of both recorders, and by how much the clock of the second one is behind."""

    rig: Rig
    shot: Shot
    offset_s: float
    m3_kg: float

    def at(self, wrong_s: float = 0.0, digits: int = 9, said: str = "") -> FiredShot:
        """Return the shot, aligned, whose second recorder's start is wrong by a time, stated to so many digits."""
        starts = {self.rig.reference_clock: 0.0, SECOND: self.offset_s + wrong_s}
        channels = {
            name: replace(c, time_base=replace(c.time_base, absolute_start=start_at(starts[clock], digits, said)))
            if (clock := c.time_base.clock) in starts
            else c
            for name, c in self.shot.channels.items()
        }
        fired = FiredShot(replace(self.shot, channels=channels, alignments=()), self.rig)
        return FiredShot(replace(fired.shot, alignments=align_clocks(fired)), self.rig)


def start_at(after_noon_s: float, digits: int = 9, said: str = "") -> AbsoluteStart:
    """Return a start so long after noon."""
    whole = math.floor(after_noon_s)
    ticks = round((after_noon_s - whole) * 10**digits)
    text = (NOON + dt.timedelta(seconds=whole)).isoformat()
    return AbsoluteStart(f"{text}.{ticks:0{digits}d}", "UTC", "header of the file", said)


@made_once
def apart(seed: int = 3) -> Apart:
    """Simulate and ingest a shot of both recorders, once."""
    rig = two_recorders()
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=seed, shot="s1")
        ingested = ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=dt.date(2026, 6, 1))
    offset_s = simulated.truth["sources"][SECOND]["clock"]["offset_s"]
    return Apart(rig, ingested.shot, offset_s, simulated.truth["m3"])
