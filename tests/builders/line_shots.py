"""Shots of virtual bodies on a line, simulated, ingested and identified in one go."""

from __future__ import annotations

import datetime as dt
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.rig_variants import bundled_tables, toml_of

DAY = dt.date(2026, 6, 1)
"""Day on which the virtual sensors' calibrations count."""
SLED: dict[str, Any] = {}
"""Settings of the bundled rig as it is: a push and a brake."""
STROKES: dict[str, Any] = {
    "push_n": 0.0, "strokes": 20, "brake_from_m": -1.0, "ringing": 0.0, "sample_rate_hz": 1000.0, "duration_s": 25.0,
}  # fmt: skip
"""A record of half a minute in which the sled goes to and fro."""
STROKE = STROKES | {"strokes": 1, "duration_s": 1.4}
"""One stroke of a second."""
HAMMER = """\
schema = "recoil-daq/rig/1"
name = "drop-tower"
reference_clock = "recorder"

[mechanism]
model = "line"
m3 = 12.0
phi20 = -1.5708
friction = 8.0
u_friction = 3.0
u_unread_share = 0.002
unread_share = 0.0
carried_mass = 0.0
u_carried_mass = 0.0

[[source]]
name = "recorder"
kind = "recorder"
match = "*_recorder.csv"

[[channel]]
name = "f_anvil"
source = "recorder"
signal = "f_anvil"
quantity = "force"
unit = "N"
role = "resisting_force"
sensor = { u_rel = 0.005, u_zero_rel = 0.0005, range = [-20000.0, 200000.0] }

[[channel]]
name = "acc_hammer"
source = "recorder"
signal = "acc_hammer"
quantity = "acceleration"
unit = "m/s2"
role = "recoil_acceleration"
sensor = { u_rel = 0.01, range = [-20000.0, 20000.0] }

[twin]
sample_rate_hz = 200e3
duration_s = 0.02
pre_trigger_s = 0.005
push_n = 0.0
start_m_s = 3.0
ringing = 0.02
brake_n = 0.0
brake_n_s_m = 0.0
buffer_from_m = 0.015
buffer_n_m = 1.184e8
"""
"""A hammer that falls upon an anvil, whose stiffness throws it back within a millisecond."""


def of_the_page(marker: str) -> Rig:
    """Return a rig of the page on lines: `cell and servo`, or `cell and camera`."""
    page = (Path(__file__).parents[2] / "docs" / "line-rigs.md").read_text(encoding="utf-8")
    text = page.partition(f"<!-- {marker} -->\n```toml\n")[2].partition("```")[0]
    return parse_rig(text, Path("rig.toml"))


def hammer() -> Rig:
    """Return the rig of a drop tower."""
    return parse_rig(HAMMER, Path("drop-tower.toml"))


def drop_tower(noise: float = 0.0005) -> Rig:
    """Return the drop tower with a blow of a millisecond, and its rebound, in a record of a second."""
    rig = with_settings(
        hammer(),
        {
            "start_m_s": 0.5, "pre_trigger_s": 0.3, "buffer_from_m": 0.59, "duration_s": 1.0, "sample_rate_hz": 20e3,
            "noise": noise,
        },
    )  # fmt: skip
    # what flies is held by nothing
    return replace(rig, mechanism=replace(rig.mechanism, unread_force=2e-5))


def sled_without_camera() -> Rig:
    """Return the bundled rig with what its recorder reads alone."""
    tables = bundled_tables("sled")
    for key, of in (("source", "name"), ("channel", "source")):
        tables[key] = [one for one in tables[key] if one[of] != "camera"]
    return parse_rig(toml_of(tables), Path("sled.toml"))


@dataclass(frozen=True)
class Outcome:
    """What one shot gave, and its true mass, kg: what the forces move."""

    found: Identification
    truth_kg: float
    truth: Mapping[str, Any]

    @property
    def error_rel(self) -> float:
        """Relative error of the mass."""
        return self.found.chosen.estimate.mass_kg / self.truth_kg - 1.0

    @property
    def covers(self) -> bool:
        """Whether the interval holds the true mass."""
        low, high = self.found.chosen.estimate.interval_kg
        return low <= self.truth_kg <= high


def identified(
    rig: Rig, files: Sequence[Path], folder: Path, shot: str = "1", options: Options | None = None
) -> Identification:
    """Ingest files and identify their shot."""
    ingested = ingest_files(rig, files, shot=shot, out=folder, on=DAY).shot
    return identify_shot(FiredShot(ingested, rig), options or Options())


def sled_outcome(seed: int, settings: Mapping[str, Any], rig: Rig | None = None) -> Outcome:
    """Simulate, ingest and identify a shot of the bundled rig, or of another one of a line."""
    chosen = with_settings(rig or load_rig("sled"), settings) if settings else rig or load_rig("sled")
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(chosen, Path(folder) / "files", seed=seed, shot="1")
        found = identified(chosen, simulated.files, Path(folder) / "shots")
    truth = simulated.truth
    return Outcome(found, float(truth["m3"]) + float(truth["carried_mass"]), truth)
