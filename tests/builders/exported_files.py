"""Files as `export` writes them, built line by line, and shots of which everything may be odd."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.shot.shot import Shot

START = {"text": "2026-03-01T10:15:00.250", "zone": "unknown", "origin": "preamble, line 4"}
COUNT = 6
TIMES = tuple(-0.01 + 5e-05 * k for k in range(COUNT))
STAMPS = (0.0, 0.1, 0.25, 0.5, 0.75, 1.5)
PRESSURE = (101325.0, 101326.5, float("nan"), 2e8, 1e5, -0.0)
ACCELERATION = (0.1, -9.80665, 1 / 3, float("inf"), 5e-324, 4e3)


def document(step_s: float | None = 5e-05, **changes: Any) -> dict[str, Any]:
    """Return what an export says about a pressure and an acceleration."""
    time = {"start_s": -0.01 if step_s else 0.0, "step_s": step_s, "count": COUNT}
    channels = [{"name": "p_breech", "unit": "Pa"}, {"name": "acc, recoil", "unit": "m/s^2"}]
    said = {"schema": "recoil-daq/export/1", "shot": "0007", "clock": "dewetron", "reference_clock": "dewetron"}
    return {**said, "aligned": False, "time": time, "absolute_start": START, "channels": channels, **changes}


def csv_file(said: dict[str, Any] | None = None, times: Sequence[float] = TIMES) -> bytes:
    """Write our CSV."""
    lines = ['# recoil-daq: "csv/1"']
    for key, value in (said or document()).items():
        for item in value if key == "channels" else [value]:
            text = json.dumps(item, ensure_ascii=False)
            lines.append(f"# channel: {text}" if key == "channels" else f"# {key}: {text}")
    lines.append('time_s [s],p_breech [Pa],"acc, recoil [m/s^2]"')
    lines += [f"{t!r},{p!r},{a!r}" for t, p, a in zip(times, PRESSURE, ACCELERATION, strict=True)]
    return ("\n".join(lines) + "\n").encode()


def parquet_file(said: Any = None, times: Sequence[float] = TIMES, **options: Any) -> bytes:
    """Write our Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {"time_s": times, "p_breech": PRESSURE, "acc, recoil": ACCELERATION}
    arrays = [pa.array(np.array(values, dtype=np.float64)) for values in columns.values()]
    metadata = {"recoil-daq": json.dumps(document() if said is None else said)}
    schema = pa.schema([pa.field(name, pa.float64()) for name in columns], metadata=metadata)
    file = io.BytesIO()
    settings = {"use_dictionary": False, "compression": "none", "write_page_checksum": True, "write_statistics": False}
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), file, **{**settings, **options})
    return file.getvalue()


def odd_shots(names: st.SearchStrategy[str], *, least: int = 0) -> st.SearchStrategy[Shot]:
    """Draw shots of several clocks with any float64 and float32 in them.

    Parameters
    ----------
    names : strategy of str
        Of the channels.
    least : int
        Samples of a time base at least.
    """
    finite = st.floats(-1e6, 1e6, allow_subnormal=False)
    clocks = st.sampled_from(["dewetron", "camera", "can bus", "ä"])
    zones = st.sampled_from(["unknown", "UTC", "+02:00"])
    starts = st.none() | st.builds(AbsoluteStart, st.just("2026-03-01T10:15:00.250"), zones, st.just("header"))

    @st.composite
    def bases(draw: st.DrawFn) -> TimeBase:
        clock, start = draw(clocks), draw(starts)
        if draw(st.booleans()):
            count = draw(st.integers(least, 40))
            return TimeBase.uniform(clock, draw(finite), draw(st.floats(1e-6, 10.0)), count, start)
        stamps = draw(st.lists(finite, min_size=least, max_size=40, unique=True))
        return TimeBase.stamped(clock, np.array(sorted(stamps), dtype=np.float64), start)

    @st.composite
    def shots(draw: st.DrawFn) -> Shot:
        given = draw(st.lists(bases(), min_size=1, max_size=3))
        channels = {}
        for name in draw(st.lists(names, min_size=1, max_size=5, unique=True)):
            base = draw(st.sampled_from(given))
            samples = draw(npst.arrays(draw(st.sampled_from([np.float64, np.float32])), base.count))
            channels[name] = Channel(name, draw(st.sampled_from(sorted(SI_UNITS))), samples, base)
        return Shot("0007", "bench", 'name = "bench"', "dewetron", channels)

    return shots()
