"""States of an armed range one after the other: what they make of sources whose bytes are not what the rig declares."""

from __future__ import annotations

from dataclasses import replace
from inspect import Parameter, signature
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recoil_acquisition.capture.status import ChannelStatus
from recoil_daq.live import range_states
from recoil_daq.live.range_state import NOT_UNDERSTOOD_S
from recoil_daq.live.range_states import RangeStates
from recoil_daq.live.shot import LiveOptions
from recoil_rigs.rig import load_rig
from tests.builders.live_status import BRAKE, CAN, IMU, SILENT, status


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(range_states, "time", SimpleNamespace(monotonic=lambda: now.s))
    return now


def states(out: Path) -> RangeStates:
    rig = load_rig("mixed")
    quiet = SimpleNamespace(
        lost=(), away="", folder=None, folder_made=False, watched=False, last_of=lambda _: "", growing_of=lambda _: (),
        next_name="0001", added_mass=None, last=None, alarms=0, look=lambda _: (), noticed=(), shots=(),
    )  # fmt: skip
    sources = [source for source in rig.sources if source.name in ("can", "imu")]
    parts = [one.name for one in signature(RangeStates).parameters.values() if one.kind is Parameter.KEYWORD_ONLY]
    return RangeStates(rig, LiveOptions(out), quiet, sources, [], **{**dict.fromkeys(parts, quiet), "masses": None})


def looked(made: RangeStates, channels: tuple[ChannelStatus, ...], **changes: Any) -> dict[str, str]:
    imu = replace(IMU, **changes)
    session = SimpleNamespace(status=status(sources=(CAN, imu), channels=channels))
    return {source.name: source.state for source in made.state(session, [], "").sources}


def test_a_source_whose_bytes_have_long_made_no_sample_is_not_understood(tmp_path: Path, clock: Any) -> None:
    made = states(tmp_path)
    assert looked(made, (BRAKE, SILENT)) == {"can": "live", "imu": "live"}
    clock.s += NOT_UNDERSTOOD_S - 0.1
    assert looked(made, (BRAKE, SILENT)) == {"can": "live", "imu": "live"}
    clock.s += 0.2
    assert looked(made, (BRAKE, SILENT)) == {"can": "live", "imu": "not understood"}
    assert looked(made, (BRAKE, SILENT), age_s=3.0) == {"can": "live", "imu": "silent"}
    # one good sample of any of its channels is enough
    assert looked(made, (BRAKE, replace(SILENT, level=BRAKE.level)))["imu"] == "live"
    clock.s += NOT_UNDERSTOOD_S - 0.1
    assert looked(made, (BRAKE, SILENT))["imu"] == "live"
