"""Text tables of recorders built from bytes, small and with known content."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence

FIRST = dt.datetime(2026, 8, 3, 12, 23, 5)

Row = tuple[float, float]


def rows(count: int = 40, offset: float = 100.25) -> list[Row]:
    """Numbers of two channels: the row number beyond an offset, and its square."""
    return [(offset + i, -0.5 * i * i) for i in range(count)]


def table(
    header: Sequence[str],
    times: Callable[[int], str],
    *,
    separator: str = ",",
    decimal: str = ".",
    line_end: str = "\r\n",
    encoding: str = "utf-8",
    ends: str = "",
    count: int = 40,
) -> bytes:
    """Lines above, then rows of time and two numbers, each row with what ends it."""
    lines = [*header]
    for i, row in enumerate(rows(count)):
        cells = [f"{value:.6f}".replace(".", decimal) for value in row]
        lines.append(separator.join([times(i), *cells]) + ends)
    return "".join(line + line_end for line in lines).encode(encoding)


def seconds(decimal: str = ".", step_s: float = 5e-5, decimals: int = 6) -> Callable[[int], str]:
    return lambda i: f"{i * step_s:.{decimals}f}".replace(".", decimal)


def instants(zone: str = "", step_us: int = 50) -> Callable[[int], str]:
    return lambda i: (FIRST + dt.timedelta(microseconds=757000 + i * step_us)).isoformat(" ", "microseconds") + zone


OXYGEN = table(["Time [s],AI 1/1 [m/s²],AI 2/1 [MPa]"], seconds())
OXYGEN_UNIT_ROW = table(
    ["Prüfstand 3", "", "Time;AI 1/1;AI 2/1", "[ms];[m/s²];[]"],
    lambda i: f"{0.05 * i:.2f}".replace(".", ","),
    separator=";", decimal=",", encoding="cp1252",
)  # fmt: skip
OXYGEN_ABSOLUTE = table(
    ["Date/Time\tAI 1/1 [m/s²]\tAI 2/1 [MPa]"], instants("+02:00"), separator="\t", encoding="utf-16", line_end="\n"
)

DASYLAB_PREAMBLE = (
    "DASYLab - V 11.00.00",
    "Worksheet name: 6by10beamlayout",
    "Recording date     : 7/15/2016,  4:52:39 PM",
    "Block length       : 2",
    "Delta              : 0.2 sec.",
    "Number of channels : 16",
)
DASYLAB = table(
    [*DASYLAB_PREAMBLE, "Date;Measurement time[hh:mm:ss];voltage [V];voltage2 [V];"],
    lambda i: f"7/15/2016;16:52:{39 + i // 5:02d}",
    separator=";", ends=";",
)  # fmt: skip
DASYLAB_TABS = table(
    ["Measurement time[s]\tDisp [in]\tLoad [lb]"], seconds(step_s=0.2, decimals=1), separator="\t", line_end="\r"
)

DECLARED = table(["some recorder", "t|u|v", "ms|bar|-"], lambda i: f"{0.5 * i:.1f}".replace(".", ","),
                 separator="|", decimal=",")  # fmt: skip
DECLARED_LAYOUT = {
    "separator": "|",
    "decimal": ",",
    "header_row": 2,
    "unit_row": 3,
    "first_row": 4,
    "time_column": "t",
    "time_unit": "ms",
}
BARE = (
    "# made by hand\n"
    + "".join(f"{i},{'-999' if i == 7 else 2 * i}\n" + ("# pause\n" if i == 20 else "") for i in range(40))
).encode()
BARE_LAYOUT = {
    "separator": ",",
    "first_row": 2,
    "names": ["count", "p"],
    "units": ["", "MPa"],
    "rate_hz": 1000.0,
    "missing": ["-999", "lost"],
    "comment": "#",
}
