"""Shots of the virtual rig, simulated and ingested once in a test run."""

from __future__ import annotations

import datetime as dt
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_rigs.rig import Rig, find_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.shared_motions import made_once

SHORTER = {"sample_rate_hz": 25e3, "duration_s": 0.35}
KIND = {"bore_friction": 0.0, "u_bore_friction": 0.0, "unread_share": 0.0, "u_unread_share": 0.0, "unread_force": 0.0}
"""Values of a mechanism whose gauges read all forces."""


@dataclass(frozen=True, eq=False)
class VirtualShot:
    """A simulated shot as the shot file would have it, its rig, and what its files hide."""

    rig: Rig
    shot: Shot
    truth: Mapping[str, Any]


def with_twin(
    name: str,
    mechanism: tuple[tuple[str, float], ...] = (),
    u_zero_rel: float = 0.0,
    u_standard_rel: float = 0.0,
    kind: bool = True,
    **settings: float | bool,
) -> Rig:
    """Load a bundled rig with other settings of its virtual rig.

    Parameters
    ----------
    mechanism
        More values of it.
    u_zero_rel
        By what share of their ranges the gauges' zeros move.
    u_standard_rel
        What a standard that calibrated all gauges may be off, of what they may.
    kind
        Whether nothing resists that is not read, in time, and noise is the same at rest and in motion; else these are
        as the rig has them.
    """
    path = find_rig(name)
    head, _, tail = path.read_text(encoding="utf-8").partition("[twin]\n")
    values = (KIND if kind else {}) | dict(mechanism)
    settings = ({"unread_errors": False} if kind else {}) | settings
    more = "".join(f"{key} = {value}\n" for key, value in values.items())
    if kind and name == "field-2013":
        head = head.replace('serial = "V303",', 'serial = "V303", delay_s = 0,')
    gauge = f"u_zero_rel = {u_zero_rel}," + (
        f' reference = "dead weights", u_reference_rel = {u_standard_rel},' if u_standard_rel else ""
    )
    head = head.replace("[mechanism]\n", f"[mechanism]\n{more}").replace("u_zero_rel = 0.001,", gauge)
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {key: f"{key} = {str(value).lower()}" for key, value in settings.items()}
    return parse_rig("\n".join([f"{head}[twin]", *lines.values(), ""]), path)


def settling_soon(rig: Rig, settle_s: float = 0.4) -> Rig:
    """Take the files that a rig's recorder and camera drop for whole when they have not changed for so long."""
    text = rig.text.replace("settle_s = 1.0 ", f"settle_s = {settle_s} ")
    text = text.replace('[[source]]\nname = "camera"', f'[[source]]\nsettle_s = {settle_s}\nname = "camera"')
    if text.count(f"settle_s = {settle_s}") != 2:
        raise ValueError("the bundled rig has other times to settle")
    return parse_rig(text, rig.path, rig.databases)


def with_second_gauge(name: str, **settings: float | bool) -> Rig:
    """Load a bundled rig with other settings of its virtual rig, and mount a second breech gauge of the same kind."""
    path = find_rig(name)
    text = with_twin(name, **settings).text
    first = text.index('[[channel]]\nname = "p_breech"')
    stop = text.index("[[channel]]", first + 1)
    second = text[first:stop].replace("p_breech", "p_breech_2").replace("AI 6/", "AI 26/").replace("V301", "V399")
    return parse_rig(text[:stop] + second + text[stop:], path)


@made_once
def virtual_shot(
    name: str = "field-2013",
    seed: int = 3,
    mechanism: tuple[tuple[str, float], ...] = (),
    u_zero_rel: float = 0.0,
    kind: bool = True,
    **settings: float | bool,
) -> VirtualShot:
    """Simulate and ingest a shot of a bundled rig, in a shorter record than the rig's own; a few seconds, once."""
    rig = with_twin(name, mechanism, u_zero_rel, kind=kind, **SHORTER | settings)
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=seed, shot="s1")
        ingested = ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=dt.date(2026, 6, 1))
    return VirtualShot(rig, ingested.shot, simulated.truth)


@made_once
def identified(name: str = "field-2013", seed: int = 3, **settings: float | bool) -> Identification:
    """Identify the mass of a virtual shot by the default options, once."""
    virtual = virtual_shot(name, seed, **settings)
    return identify_shot(FiredShot(virtual.shot, virtual.rig), Options())


def with_channels(shot: Shot, **samples: np.ndarray) -> Shot:
    """Put other samples into channels of a shot."""
    channels = {n: replace(c, samples=samples[n]) if n in samples else c for n, c in shot.channels.items()}
    return replace(shot, channels=channels)


def without_channels(shot: Shot, *names: str) -> Shot:
    """Leave channels out of a shot."""
    return replace(shot, channels={n: c for n, c in shot.channels.items() if n not in names})
