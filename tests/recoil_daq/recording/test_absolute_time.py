"""Two recorders whose files state when they began: one clock for both by absolute time."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.two_recorders import SECOND, two_recorders

nptdms = pytest.importorskip("nptdms")
NOON = np.datetime64("2026-06-01T12:00:00.000000000")


def as_tdms(text: Path, start: np.datetime64) -> Path:
    """Write a recorder's text as a TDMS file that begins at an instant."""
    recording = recognise(text).open(text, Declarations("x"))
    channels = []
    for one in recording.signals:
        base = recording.time_base(one.name)
        said = {
            "wf_start_time": start, "wf_start_offset": base.start_s, "wf_increment": 1.0 / base.rate_hz,
            "unit_string": one.unit,
        }  # fmt: skip
        channels.append(nptdms.ChannelObject("recorder", one.name, recording.read(one.name), said))
    path = text.with_suffix(".tdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)
    return path


def of_tdms(rig: Rig) -> Rig:
    """Have a rig read the TDMS files of its recorders."""
    text = rig.text.replace('_dewetron.csv"', '_dewetron.*"').replace('_can.csv"', '_can.*"')
    for name in ("AI ", "RecoilNode."):
        text = text.replace(f'signal = "{name}', f'signal = "recorder/{name}')
    return parse_rig(text, rig.path)


def by_files(folder: Path, wrong_s: float) -> tuple[Shot, float]:
    rig = two_recorders()
    twin = simulate_shot(rig, folder / "files", seed=3, shot="s1")
    offset_s = twin.truth["sources"][SECOND]["clock"]["offset_s"]
    starts = {"dewetron": NOON, SECOND: NOON + np.timedelta64(round(1e9 * (offset_s + wrong_s)), "ns")}
    files = []
    for path in twin.files:
        source = path.stem.partition("_")[2]
        files.append(as_tdms(path, starts[source]) if source in starts else path)
    shot = ingest_files(of_tdms(rig), files, shot="s1", out=folder / "shots", on=dt.date(2026, 6, 1)).shot
    return shot, offset_s


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("wrong_s", "verdict", "method"), [(1e-5, "ok", "absolute"), (1e-3, "warn", "redundant"), (1.0, "fail", "absolute")]
)
def test_files_that_state_their_start_are_aligned_by_it_used_warned_of_or_refused(
    tmp_path: Path, wrong_s: float, verdict: str, method: str
) -> None:
    shot, offset_s = by_files(tmp_path, wrong_s)
    (check,) = (one for one in shot.quality if one.check is Check.ALIGNMENT and one.channel == SECOND)
    clock = shot.alignment(SECOND)
    assert (check.verdict, clock.method) == (verdict, method)
    if verdict != "fail":
        assert abs(clock.offset_s - offset_s) < 5e-5
    assert shot.usable == (verdict != "fail")
    assert clock.details is not None
    assert clock.details["absolute"]["source"]["start"]["origin"] == "property wf_start_time"
