"""How far the clocks of CAN and serial are off over many virtual shots, against what their alignment says."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import match_sources, reader_of
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_rigs.rig import Rig
from recoil_rigs.shots.assemble import assemble_channels
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import with_twin

SHOTS = 60
CLOCKS = ("can", "imu")


def assembled(rig: Rig, folder: Path, seed: int):
    simulated = simulate_shot(rig, folder, seed=seed, shot="s")
    readers = {path: reader_of(path, rig) for path in simulated.files}
    recordings: dict[str, Recording] = {}
    for source, path in match_sources(rig, list(readers.items())).items():
        recordings[source] = readers[path].open(path, rig.declarations(rig.source(source)))
    channels = assemble_channels(rig, recordings, "0")
    for path in simulated.files:
        path.unlink()
    return Shot("s", rig.name, rig.text, rig.reference_clock, channels), simulated.truth


def test_the_clocks_of_bus_and_port_are_as_sure_as_they_say(benchmark, capsys, tmp_path: Path):
    rig = with_twin("mixed", sample_rate_hz=25e3, duration_s=0.45)
    shots = [assembled(rig, tmp_path / str(seed), seed) for seed in range(2001, 2001 + SHOTS)]
    found = benchmark.pedantic(
        lambda: [{a.clock: a for a in align_clocks(FiredShot(shot, rig))} for shot, _ in shots],
        rounds=1,
        warmup_rounds=0,
    )
    table = {}
    for clock in CLOCKS:
        errors, u, ok = [], [], 0
        for (_, truth), alignments in zip(shots, found, strict=True):
            a, true = alignments[clock], truth["clocks"][clock]
            middle = 0.5 * (truth["t_fire"] + truth["t_end"])
            at_source = (middle - true["offset_s"]) / (1 + true["drift"])
            # the line is that of the lower edge: the mean wait is not in it, the shortest way is
            shortest = true.get("latency_s", 0.0) - a.details["stamps"].get("wait_s", 0.0)
            errors.append(a.to_reference(at_source) - (middle - shortest))
            u.append(a.u_offset_s)
            ok += a.status == "ok"
        z = np.array(errors) / u
        table[clock] = (np.mean(errors), np.std(errors), np.median(u), np.sqrt(np.mean(z**2)), np.abs(z).max(), ok)
    with capsys.disabled():
        print(f"\n{SHOTS} shots of the rig mixed, {benchmark.stats.stats.min / SHOTS:.2f} s each for all clocks")
        print(f"{'clock':6} {'bias us':>8} {'sd us':>7} {'u us':>7} {'z rms':>6} {'|z| max':>8} {'ok':>4}")
        for clock, (bias, sd, u_s, rms, most, ok) in table.items():
            print(f"{clock:6} {1e6 * bias:+8.1f} {1e6 * sd:7.1f} {1e6 * u_s:7.1f} {rms:6.2f} {most:8.2f} {ok:4d}")
    for _, _, _, rms, most, ok in table.values():
        assert 0.8 < rms < 1.2
        assert most < 5.0
        assert ok >= 0.95 * SHOTS
