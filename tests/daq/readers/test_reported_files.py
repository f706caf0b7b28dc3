"""Small files that show what public bug reports describe: each gives its right values, or says rightly why it does not.

A file is read as `show` and `ingest` read it. What is refused is refused by a sentence with the true cause.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, field

import numpy as np
import pytest

import recoil_daq
from recoil_acquisition.errors import ReadError, RecoilDaqError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from tests.builders.shared_data import shared_file


@dataclass(frozen=True)
class Signal:
    """Samples of one signal at their instants; `unit` is the file's."""

    times_s: list[float]
    values: list[float]
    unit: str | None = None


@dataclass(frozen=True)
class Right:
    """What a file holds.

    Attributes
    ----------
    signals
        By name; the file has no others.
    said
        Patterns of which each is found in what the recording says of itself: notes, and how it is cut off.
    start
        Of the wall-clock time of its time zero.
    database, rig
        Files beside it that it is opened with.
    """

    signals: dict[str, Signal]
    said: tuple[str, ...] = ()
    start: str = ""
    database: str | None = None
    rig: str | None = None


@dataclass(frozen=True)
class Refused:
    """A file that is not read: patterns of which each is found in the one line that says so."""

    because: tuple[str, ...]
    database: str | None = None
    rig: str | None = None
    error: type[RecoilDaqError] = ReadError
    not_because: tuple[str, ...] = field(default=("damaged",))


G = "g"
UFF = [
    -16.0386, -26.4872, -4.9672, 8.4089, 22.7209, 2.1941, -11.0529, -15.6956, 14.9749, 32.6957, 5.4554, -24.6666,
    -19.1653, 32.0004, 4.0576, -34.6427, -1.6739, -23.2645, -12.5858, -9.7601,
]  # fmt: skip
TWO_BUS = "two_bus.dbc"
IMU = "imu.dbc"
SILENT = ("^ ?$",)
"""Of a recording that says nothing of itself."""


def ms(*, step: float = 1.0, count: int, start: float = 0.0) -> list[float]:
    return [1e-3 * (start + step * k) for k in range(count)]


def us(start: float = 0.0) -> list[float]:
    return [1e-6 * (start + k) for k in range(200)]


def sines(count: int, scale: float = 1.0, step: float = 1.0) -> list[float]:
    return [scale * math.sin(step * k) for k in range(count)]


FRAMES = [*range(10), *range(20, 40)]
WITH_GAP = [1e-3 * frame for frame in FRAMES]
SLICES = [frame + 1 for frame in FRAMES]
AFTER_1_MS = [1e-3 * frame for frame in SLICES]
COUNTED = [*range(50), *range(80, 200)]

FILES: dict[str, Right | Refused] = {
    "two_bus.log": Right(
        {
            "IMU.Accel@can0": Signal(ms(step=10, count=8), [float(k + 1) for k in range(8)], G),
            "IMU.Accel@can1": Signal(ms(step=10, count=8, start=0.3), [-5.0] * 8, G),
        },
        said=("came on several buses.*can0.*can1",),
        database=TWO_BUS,
    ),
    "dup_msg.log": Right(
        {
            "IMU#0x100.Accel": Signal(ms(step=10, count=8), [float(k + 1) for k in range(8)], G),
            "IMU#0x200.Accel": Signal(ms(step=10, count=8, start=5), [-5.0] * 8, G),
        },
        said=("messages of one name",),
        database="dup_msg.dbc",
    ),
    "tdms_restart.tdms": Right(
        {
            "G/a": Signal(
                [*ms(count=100), *ms(count=100, start=10_000)],
                [*map(float, range(100)), *map(float, range(1000, 1100))],
                G,
            )
        },
        said=("a second recording begins",),
        start="2024-03-01T10:00:00",
    ),
    "tdms_xunit.tdms": Right({"G/a": Signal(ms(count=100), [float(k) for k in range(100)], G)}),
    "tdms_adv.tdms": Right({"G/a": Signal(ms(count=100), [float(k) for k in range(100)], G)}),
    "asc_joined.asc": Right(
        {
            "IMU.Accel": Signal(
                [0.1, 0.2, 0.3, *(3600.1 + 0.1 * k for k in range(6))],
                [0.01, 0.02, 0.03, *(0.17 + 0.01 * k for k in range(6))],
                G,
            )
        },
        said=("a second recording begins in line 9, 3600 s",),
        database=TWO_BUS,
    ),
    "asc_fr.asc": Right({"IMU.Accel": Signal([0.5], [0.01], G)}, start="2020-04-16T13:59:01", database=TWO_BUS),
    "thousands_de.csv": Refused((r"line 22, column 'p \(mbar\)'", "sets thousands apart", r"'1\.000' beside 999")),
    "uff_no_space.uff": Right({"CH1": Signal(ms(count=20), UFF)}),
    "uff_m1_in_header.uff": Right({"CH1": Signal(ms(count=20), UFF)}),
    "q_dewesoft.csv": Right({"acc": Signal(ms(count=80), sines(80), G)}),
    "nul_csv.csv": Right({"acc": Signal(ms(count=60), sines(60), G)}, said=("cut off|NUL",)),
    "text_column.csv": Right({"acc": Signal(ms(count=60), sines(60), G)}, said=("Status",)),
    "qnan.csv": Right(
        {
            "acc": Signal(ms(count=200), [], G),  # the cells as they stand, see below
            "p": Signal(ms(count=200), [3.0 if k == 50 else 1000.0 + 1.5 * k for k in range(200)], "bar"),
        }
    ),
    "hms.csv": Right(
        {
            "acc": Signal(ms(step=10, count=200), sines(200), G),
            "p": Signal(ms(step=10, count=200), [float(k) for k in range(200)], "bar"),
        }
    ),
    "blf_v3hdr.blf": Refused(("header version 3 .*is not known",), TWO_BUS),
    "mat_struct.mat": Right({"S.acc": Signal(ms(count=100), sines(100, step=0.05))}),
    "mat_v4.mat": Right({"acc": Signal(ms(count=100), sines(100, step=0.05))}),
    "h5_compound.h5": Right({"table/acc": Signal(ms(count=100), sines(100, step=0.05))}),
    "notread_pico.csv": Right(
        {
            "Channel A": Signal(us(), sines(200, step=0.1), "V"),
            "Channel B": Signal(us(), [-one for one in sines(200, step=0.1)], "mV"),
        }
    ),
    "notread_rigol.csv": Right(
        {
            "CH1": Signal(us(-100), sines(200, step=0.1), "Volt"),
            "CH2": Signal(us(-100), [-one for one in sines(200, step=0.1)], "Volt"),
        }
    ),
    "notread_tek_mso.csv": Right({"CH1": Signal(us(-100), sines(200, step=0.1), "V")}),
    "blf_neg.blf": Right({"IMU.Accel": Signal([-60.0, -59.9, 0.1], [0.01, 0.02, 0.03], G)}, database=TWO_BUS),
    "savvy1045.trc": Right(
        {"IMU.Accel": Signal([0.0, 0.0012], [0.05, 38.4], G)}, said=("1 error frame",), database=TWO_BUS
    ),
    "cd_misc.log": Right(
        {"IMU.Accel": Signal([0.0, 0.1, 0.5, 0.8], [5.13, 5.13, 5.13, math.nan], G)},
        said=("1 error frame", "2 entries are damaged", "1 frames? (are|is) too short"),
        database=TWO_BUS,
    ),
    "layout_missing.csv": Refused(("declares a layout, and .* without it", "`match`"), rig="layout_missing.toml"),
    "imu_pairs.txt": Right(
        {
            "Counter": Signal(ms(step=10, count=200), [2552.0 + k for k in range(200)]),
            "Acc_X": Signal(ms(step=10, count=200), sines(200, step=0.1)),
            "Acc_Y": Signal(ms(step=10, count=200), sines(200, step=0.2)),
            "Acc_Z": Signal(ms(step=10, count=200), [9.81] * 200),
            "Gyr_X": Signal(ms(step=10, count=200), sines(200, step=0.3)),
            "Gyr_Y": Signal(ms(step=10, count=200), [0.0] * 200),
            "Gyr_Z": Signal(ms(step=10, count=200), [0.1] * 200),
        },
        rig="imu_pairs.toml",
    ),
    "imagej_gap.csv": Right(
        {
            "column 1": Signal(AFTER_1_MS, [float(k) for k in range(1, 31)]),
            "Area": Signal(AFTER_1_MS, [0.0] * 30),
            **{name: Signal(AFTER_1_MS, [10.0] * 30) for name in ("Mean", "Min", "Max")},
            "X": Signal(AFTER_1_MS, [10.0 + frame for frame in SLICES]),
            "Y": Signal(AFTER_1_MS, [20.0 + 2 * frame for frame in SLICES]),
        },
        said=("'Slice' as frame", "missing frames .*: 10"),
        rig="imagej_gap.toml",
    ),
    "dlc_gap.csv": Right(
        {
            "tip x": Signal(WITH_GAP, [10.0 + frame for frame in FRAMES], "px"),
            "tip y": Signal(WITH_GAP, [20.0 + 2 * frame for frame in FRAMES], "px"),
            "tip likelihood": Signal(WITH_GAP, [0.99] * 30),
        },
        said=("missing frames .*: 10",),
        rig="dlc_gap.toml",
    ),
    "view_err.log": Right(
        {"IMU.Accel": Signal(ms(step=100, count=4), [0.01, 0.02, 0.03, 0.04], G)},
        said=("1 error frame",),
        database=IMU,
    ),
    "sna.log": Right(
        {"IMU.Accel": Signal(ms(step=100, count=6), [0.0, 0.5, math.nan, 1.0, math.nan, 1.5])},
        said=("2 of 6 frames hold a code that is no measurement .2046 'Neutralwert' x1, 2047 'Fehler' x1.",),
        database="sna.dbc",
    ),
    "na_n2k.log": Right(
        {"Heading.Dev": Signal(ms(step=100, count=5), [0.01, 0.02, math.nan, 0.03, 0.04], "rad")},
        said=("1 of 5 frames hold a code that is no measurement .0x7FFD and above x1.",),
        database="na_n2k.dbc",
    ),
    "c_comment_top.log": Right({"IMU.Accel": Signal(ms(step=100, count=2), [0.01, 0.02], G)}, SILENT, database=IMU),
    "rigol_padded.csv": Right(
        {"CH1": Signal(us(-100), sines(200, step=0.1))}, said=("^time is the row number over 1e.06 Hz",)
    ),
    "h5_packed_time.h5": Right({"acc": Signal(ms(count=100), sines(100, step=0.05), G)}, SILENT),
    "h5_attr_conversion_factor.h5": Refused(
        (r"acc: integers with the attribute conversion_factor, whose meaning is open",)
    ),
    "dst_spring.csv": Refused(("line 32, time column: the clock jumps by 3600 s",), rig="dst_spring.toml"),
    "iso_gap.csv": Right(
        {
            "acc": Signal(
                [0.01 * k for k in (*range(100), *range(150, 300))],
                [math.sin(0.1 * k) for k in (*range(100), *range(150, 300))],
                G,
            )
        },
        said=("50 rows are missing in 1 gap before line 102",),
        rig="iso_gap.toml",
    ),
    "asc_busmaster.asc": Right(
        {"IMU.Accel": Signal(ms(step=100, count=4, start=40_874_808.2), [0.01, 0.02, 0.03, 0.04], G)},
        said=("stamps begin at the time of day .* counted from midnight",),
        start="2021-12-06T00:00:00",
        database=IMU,
    ),
    "log_len8.log": Right({"IMU.Accel": Signal([0.0, 0.1, 0.3], [0.01, 0.02, 0.03], G)}, SILENT, database=IMU),
    "mux_ext.log": Right(
        {
            "IMU.M1": Signal(ms(step=100, count=12), [3.0, 5.0, 4.0] * 4),
            "IMU.M2": Signal([0.0, 0.1, 0.3, 0.4, 0.6, 0.7, 0.9, 1.0], [2.0, 5.0, 5.0, 2.0] * 2),
            "IMU.Ax": Signal([0.0, 0.4, 0.6, 1.0], [1.0, 1.04, 1.06, 1.1], G),
            "IMU.Ay": Signal([0.1, 0.3, 0.7, 0.9], [1.01, 1.03, 1.07, 1.09], G),
        },
        database="mux_ext.dbc",
    ),
    "mux_sym.log": Right(
        {
            "IMU.FSM": Signal(ms(step=100, count=6), [1.0, 2.0] * 3),
            "IMU.Accel": Signal(ms(step=200, count=3), [1.0, 1.02, 1.04], G),
            "IMU.Accel#2": Signal(ms(step=200, count=3, start=100), [-1.01, -1.03, -1.05], G),
        },
        said=("told apart by numbers: IMU.Accel#2",),
        database="mux_sym.sym",
    ),
    "float.log": Right(
        {
            "IMU.Accel": Signal(ms(step=100, count=4), [1.5, 2.5, 3.5, 4.5], G),
            "IMU.Rate": Signal(ms(step=100, count=4), [0.0, -2.25, -4.5, -6.75], "deg/s"),
        },
        database="float.dbc",
    ),
    "trc13.trc": Right(
        {"IMU.Accel": Signal([0.0, 0.01, 0.03], [0.01, 0.02, 0.03], G)},
        start="2022-04-05T11:57:29.473",
        database=IMU,
    ),
    "mdf_local.mf4": Right({"acc": Signal(ms(count=100), sines(100, step=0.05), G)}, start="2024-07-01T12:00:00"),
    "tdms_recip.tdms": Right(
        {"G/ref": Signal(ms(count=100), [float(k) for k in range(100)], G)}, said=("G/a: .*'Reciprocal'.* left out",)
    ),
    "uff_uneven_double.uff": Right({"acc": Signal(ms(count=100), sines(100, step=0.05), G)}),
    "lvm_two_headings.lvm": Right(
        {
            "A": Signal(
                [*ms(count=50), *ms(count=50, start=10_000)],
                [*map(float, range(50)), *map(float, range(1000, 1050))],
                G,
            )
        }
    ),
    "h5_packed.h5": Right(
        {
            "acc": Signal(
                ms(count=100),
                [math.nan if k == 20 else round(one, 3) for k, one in enumerate(sines(100, step=0.05))],
                G,
            )
        }
    ),
    "rigol_digital.csv": Right(
        {"CH1": Signal(us(-100), sines(200, step=0.1), "Volt")}, said=("left out: D7-D0 .*D15-D8",)
    ),
    "mixed_rates.csv": Right(
        {
            "acc": Signal(ms(count=400), sines(400, step=0.1), G),
            "p": Signal(ms(count=400), [k / 10 if k % 10 == 0 else math.nan for k in range(400)], "bar"),
        },
        said=("^p: 1 of 10 rows holds a sample, from row 1 on: that is its rate, no loss $",),
    ),
    "xsens_gap.txt": Right(
        {
            "Counter": Signal([1e-2 * k for k in COUNTED], [2552.0 + k for k in COUNTED]),
            "Acc_X": Signal([1e-2 * k for k in COUNTED], [float(k) for k in COUNTED]),
            "Acc_Y": Signal([1e-2 * k for k in COUNTED], [0.0] * 170),
            "Acc_Z": Signal([1e-2 * k for k in COUNTED], [9.81] * 170),
        },
        said=("Counter counts the rows and jumps in 1 place, first behind line 55: 30 rows are missing",),
        rig="xsens_gap.toml",
    ),
    "np_default.txt": Right({"acc": Signal(ms(count=200), sines(200, step=0.05), G)}, rig="np_default.toml"),
}
"""Whether a file is read or refused, and what it then holds or why."""

FIRST_OF_BIT_FIELDS = {
    "u12le_b3": 2143, "s12le_b3": -1953, "u12be_b3": 3864, "s13be_b1": -153, "u24be": 16302782, "s24le": -4275464,
    "s5be": -2,
}  # fmt: skip


def opened(name: str, database: str | None = None, rig: str | None = None) -> Recording:
    path = shared_file(f"reports/{name}")
    if rig is not None:
        return recoil_daq.open_recording(path, recoil_daq.load_rig(shared_file(f"reports/{rig}")))
    text = None if database is None else shared_file(f"reports/{database}").read_text(encoding="utf-8")
    return recognise(path).open(path, Declarations(clock="source", database=text))


def cells_of(name: str, signal: str) -> list[float]:
    """Read the cells of a column by the standard library, what is no number as NaN."""
    with shared_file(f"reports/{name}").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    at = next(k for k, cell in enumerate(header) if cell.startswith(signal))
    return [math.nan if "#" in row[at] else float(row[at]) for row in rows]


def assert_gives(name: str, expected: Right | Refused) -> None:
    if isinstance(expected, Right):
        assert_holds(name, expected)
    else:
        assert_refused(name, expected)


def assert_holds(name: str, right: Right) -> None:
    recording = opened(name, right.database, right.rig)
    assert {header.name for header in recording.signals} == set(right.signals)
    for header in recording.signals:
        signal = right.signals[header.name]
        samples, times_s = recording.read(header.name), recording.time_base(header.name).times_s
        np.testing.assert_allclose(times_s, signal.times_s, atol=1e-6)
        # texts are rounded to the digits that they have
        values = signal.values or cells_of(name, header.name)
        np.testing.assert_allclose(samples, values, atol=1e-3 if name.endswith(".csv") else 1e-4)
        assert signal.unit in (None, header.unit)
    said = " ".join((*recording.notes, recording.incomplete))
    for pattern in right.said:
        assert re.search(pattern, said), said
    if right.start:
        assert recording.absolute_start is not None
        assert recording.absolute_start.text.startswith(right.start)


def assert_refused(name: str, refused: Refused) -> None:
    with pytest.raises(refused.error) as caught:
        _ = opened(name, refused.database, refused.rig).notes  # of a text the cells are read for them, as `show` does
    said = str(caught.value)
    assert "\n" not in said
    for pattern in refused.because:
        assert re.search(pattern, said), said
    for pattern in refused.not_because:
        assert not re.search(pattern, said.split("expected one of", maxsplit=1)[0]), said


@pytest.mark.parametrize("name", FILES)
def test_a_reported_file_gives_its_right_values_or_is_refused_by_its_true_cause(name: str) -> None:
    assert_gives(name, FILES[name])


def test_bit_fields_at_odd_bits_keep_their_values() -> None:
    recording = opened("mdf_bits.mf4")
    for name, first in FIRST_OF_BIT_FIELDS.items():
        assert recording.read(name)[0] == first
        np.testing.assert_allclose(recording.time_base(name).times_s, ms(count=20), atol=1e-9)
    assert len(recording.signals) == 13
    assert any("u64_b4" in note and "left out" in note for note in recording.notes)


def test_the_tables_name_every_file_of_the_folder() -> None:
    beside = {name for one in FILES.values() for name in (one.database, one.rig) if name is not None}
    files = {path.name for path in shared_file("reports").iterdir()}
    assert files == {*FILES, *beside, "mdf_bits.mf4", "one_can.toml", "MANIFEST.md"}
