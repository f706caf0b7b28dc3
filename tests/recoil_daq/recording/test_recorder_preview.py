"""A virtual OXYGEN recorder read live, and then its own file: trigger, capture, preview, and what replaces it."""

from __future__ import annotations

import datetime as dt
import json
import time
from pathlib import Path

import pytest

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.live_source import open_source
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.trigger import Edge, Trigger
from recoil_daq.live.shots.preview import mass_by_file
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.live_sources import live_sources, told_by
from recoil_rigs.twin import TwinShot, simulate_shot
from recoil_rigs.twin.player import TwinPlayer
from tests.builders.virtual_shots import SHORTER, with_twin

TRIGGER = Trigger((Edge("p_breech", 5e6, rearm=2e6),), "any", pre_s=0.05, post_s=0.3)


def read_live(virtual: Rig, shot: TwinShot, folder: Path) -> tuple[Rig, Path]:
    """Play a shot's recorder, trigger on its breech pressure, and cut the shot; return the rig that was armed."""
    over = {"dewetron": "oxygen"}
    with TwinPlayer(virtual, [shot], silence_before_s=1.5, silence_after_s=1.0, transports=over) as player:
        table = ", ".join(f"{key} = {json.dumps(value)}" for key, value in player.devices["dewetron"].items())
        match = 'match = "*_dewetron.csv"'
        rig = parse_rig(virtual.text.replace(match, f"device = {{ {table} }}\n{match}", 1), virtual.path)
        device = open_source(live_sources(rig)[0])
        (source,) = live_sources(rig, None, told_by(live_sources(rig), {"dewetron": device}))
        of_source = RecordedSource.of(source.name, source.kind, source.device)
        record = LiveRecord(rig.name, rig.text, "rig.toml", {}, anchor(), (of_source,))
        session = LiveSession(record, [source], {"dewetron": device}, TRIGGER, folder / "journal", reserve_bytes=0)
        session.start()
        session.arm()
        player.start()
        until_s = time.monotonic() + 60.0
        window = None
        while window is None and time.monotonic() < until_s:
            window = session.next_window(0.2)
        assert window is not None
        captured = session.cut(shot.shot, window, folder / f"{shot.shot}.rdlog")
        session.stop()
        session.close(complete=False)
    return rig, captured.path


@pytest.mark.real_time
def test_the_mass_comes_with_the_stream_and_the_file_proves_it_equal(tmp_path: Path) -> None:
    virtual = with_twin("field-2013", **SHORTER)
    shot = simulate_shot(virtual, tmp_path / "files", seed=3, shot="0001")
    rig, capture = read_live(virtual, shot, tmp_path)
    (own,) = (path for path in shot.files if "dewetron" in path.name)
    others = [path for path in shot.files if path != own]
    out, day = tmp_path / "shots", dt.date(2026, 6, 1)
    live = ingest_files(rig, [capture, *others], out=out, on=day)
    assert live.shot.usable
    assert [one.verdict for one in live.shot.quality if one.check is Check.PREVIEW] == ["warn"]
    whole = ingest_files(rig, [capture, own, *others], out=out, on=day, replaces=f"{own.name} replaces the preview")
    (check,) = (one for one in whole.shot.quality if one.check is Check.PREVIEW_COMPARED)
    assert check.verdict == "ok"
    assert f"the preview is proven equal to {own.name}: 70000 samples of 8 channels, single precision" in check.detail
    assert whole.shot.usable
    assert [path.name for path in out.glob("*.h5")] == ["0001.h5"]
    before, after = (identify_shot(FiredShot(one.shot, one.rig), Options()).chosen.estimate for one in (live, whole))
    # the stream has more of the rest than the file, and so another zero: that is said in u, and is no fault
    assert abs(after.mass_kg - before.mass_kg) < 0.5 * after.u_kg
    masses = ({"value": one.mass_kg, "u": one.u_kg} for one in (before, after))
    assert "of the preview" in mass_by_file(*masses)
