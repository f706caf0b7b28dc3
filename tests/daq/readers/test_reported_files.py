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

from recoil_acquisition.errors import ReadError
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
    """

    signals: dict[str, Signal]
    said: tuple[str, ...] = ()
    start: str = ""
    database: str | None = None


@dataclass(frozen=True)
class Refused:
    """A file that is not read: patterns of which each is found in the one line that says so."""

    because: tuple[str, ...]
    database: str | None = None
    not_because: tuple[str, ...] = field(default=("damaged",))


G = "g"
UFF = [
    -16.0386, -26.4872, -4.9672, 8.4089, 22.7209, 2.1941, -11.0529, -15.6956, 14.9749, 32.6957, 5.4554, -24.6666,
    -19.1653, 32.0004, 4.0576, -34.6427, -1.6739, -23.2645, -12.5858, -9.7601,
]  # fmt: skip
TWO_BUS = "two_bus.dbc"


def ms(*, step: float = 1.0, count: int, start: float = 0.0) -> list[float]:
    return [1e-3 * (start + step * k) for k in range(count)]


def us(start: float = 0.0) -> list[float]:
    return [1e-6 * (start + k) for k in range(200)]


def sines(count: int, scale: float = 1.0, step: float = 1.0) -> list[float]:
    return [scale * math.sin(step * k) for k in range(count)]


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
    "mat_struct.mat": Refused(("S: a structure", "-struct")),
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
}
"""Whether a file is read or refused, and what it then holds or why."""
FIRST_OF_BIT_FIELDS = {
    "u12le_b3": 2143, "s12le_b3": -1953, "u12be_b3": 3864, "s13be_b1": -153, "u24be": 16302782, "s24le": -4275464,
    "s5be": -2,
}  # fmt: skip


def opened(name: str, database: str | None = None) -> Recording:
    path = shared_file(f"reports/{name}")
    text = None if database is None else shared_file(f"reports/{database}").read_text(encoding="utf-8")
    return recognise(path).open(path, Declarations(clock="source", database=text))


def cells_of(name: str, signal: str) -> list[float]:
    """Read the cells of a column by the standard library, what is no number as NaN."""
    with shared_file(f"reports/{name}").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    at = next(k for k, cell in enumerate(header) if cell.startswith(signal))
    return [math.nan if "#" in row[at] else float(row[at]) for row in rows]


RIGHT = [(name, one) for name, one in FILES.items() if isinstance(one, Right)]
REFUSED = [(name, one) for name, one in FILES.items() if isinstance(one, Refused)]


@pytest.mark.parametrize(("name", "right"), RIGHT, ids=[name for name, _ in RIGHT])
def test_a_reported_file_gives_its_right_values(name: str, right: Right) -> None:
    recording = opened(name, right.database)
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


@pytest.mark.parametrize(("name", "refused"), REFUSED, ids=[name for name, _ in REFUSED])
def test_a_reported_file_that_is_not_read_is_refused_by_its_true_cause(name: str, refused: Refused) -> None:
    with pytest.raises(ReadError) as caught:
        _ = opened(name, refused.database).notes  # of a text the cells are read for them, as `show` does
    said = str(caught.value)
    assert "\n" not in said
    for pattern in refused.because:
        assert re.search(pattern, said), said
    for pattern in refused.not_because:
        assert not re.search(pattern, said.split("expected one of", maxsplit=1)[0]), said


def test_bit_fields_at_odd_bits_keep_their_values() -> None:
    recording = opened("mdf_bits.mf4")
    for name, first in FIRST_OF_BIT_FIELDS.items():
        assert recording.read(name)[0] == first
        np.testing.assert_allclose(recording.time_base(name).times_s, ms(count=20), atol=1e-9)
    assert len(recording.signals) == 13
    assert any("u64_b4" in note and "left out" in note for note in recording.notes)


def test_the_table_names_every_file_of_the_folder() -> None:
    folder = shared_file("reports")
    files = {path.name for path in folder.iterdir() if path.suffix not in (".md", ".dbc")}
    assert files == {*FILES, "mdf_bits.mf4"}
