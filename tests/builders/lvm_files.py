"""LabVIEW measurement files, written line by line as the maker's specification shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Column:
    """One channel of a segment: what its head states, and its samples as they are printed."""

    name: str
    unit: str
    cells: Sequence[str]
    x0: str = "0.0000000000000000E+0"
    delta_x: str = "0.001000"
    date: str = "2026/08/03"
    time: str = "12:23:05.7570000000000000001"
    dimension: str = "Time"
    samples: str = ""
    times: Sequence[str] = ()
    """Cells of its own column of time, in a file of ``Multi``; else those of its segment."""


@dataclass(frozen=True)
class Lvm:
    """A file: its channels in one segment or several.

    Attributes
    ----------
    x_columns
        ``No``, ``One`` or ``Multi``.
    times
        Cells of the columns of time, one list for each segment; not for ``No``.
    comments
        Comment of a row, by its number.
    """

    segments: Sequence[Sequence[Column]]
    x_columns: str = "No"
    times: Sequence[Sequence[str]] = ()
    comments: dict[int, str] = field(default_factory=dict)
    preference: str = "Absolute"
    decimal: str = "."
    states_decimal: bool = True
    separator: str = "\t"
    trailing: bool = True
    line_end: str = "\r\n"

    def content(self) -> bytes:
        """Return the bytes of the file."""
        tab = self.separator
        head = ["LabVIEW Measurement" + tab, f"Writer_Version{tab}2", f"Reader_Version{tab}2"]
        head += [f"Separator{tab}{'Tab' if tab == chr(9) else 'Comma'}"]
        head += [f"Decimal_Separator{tab}{self.decimal}"] if self.states_decimal else []
        head += [f"Multi_Headings{tab}Yes", f"X_Columns{tab}{self.x_columns}", f"Time_Pref{tab}{self.preference}"]
        head += [
            f"Operator{tab}stand",
            f"Date{tab}2026/08/03",
            f"Time{tab}12:23:05,757",
            f"***End_of_Header***{tab}",
            tab,
        ]
        lines = list(head)
        for number, columns in enumerate(self.segments):
            lines += self._segment(columns, self.times[number] if self.times else ())
            lines += [tab]
        return "".join(line + self.line_end for line in lines).encode()

    def _segment(self, columns: Sequence[Column], times: Sequence[str]) -> list[str]:
        tab, multi = self.separator, self.x_columns == "Multi"

        def row(key: str, values: Sequence[str]) -> str:
            spread = [cell for value in values for cell in ((value, "") if multi else (value,))]
            return tab.join([key, *(spread[:-1] if multi else spread)]) + (tab if self.trailing else "")

        counts = [column.samples or str(len(column.cells)) for column in columns]
        lines = [
            f"Channels{tab}{len(columns)}", row("Samples", counts), row("Date", [c.date for c in columns]),
            row("Time", [c.time.replace(".", self.decimal) for c in columns]),
            row("Y_Unit_Label", [c.unit for c in columns]), row("X_Dimension", [c.dimension for c in columns]),
            row("X0", [c.x0.replace(".", self.decimal) for c in columns]),
            row("Delta_X", [c.delta_x.replace(".", self.decimal) for c in columns]), f"***End_of_Header***{tab}",
        ]  # fmt: skip
        names = [name for c in columns for name in (("X_Value", c.name) if multi else (c.name,))]
        lines.append(tab.join([*([] if multi else ["X_Value"]), *names, "Comment"]))
        for i in range(max(len(column.cells) for column in columns)):
            cells = [column.cells[i] if i < len(column.cells) else "" for column in columns]
            x = times[i] if times else ""
            own_x = [column.times[i] if i < len(column.times) else x for column in columns]
            cells = (
                [cell for x, own in zip(own_x, cells, strict=True) for cell in (x if own else "", own)]
                if multi
                else [x, *cells]
            )
            cells += [self.comments[i]] if i in self.comments else []
            lines.append(tab.join(cell.replace(".", self.decimal) for cell in cells))
        return lines


def columns(count: int = 40, first: float = 0.0) -> list[Column]:
    """Return two channels: the number of the sample, and its negative eighth; they come back after 1,000 samples."""
    numbers = [first + i % 1000 for i in range(count)]
    return [
        Column("acc", "m/s^2", [f"{100.25 + one:.6f}" for one in numbers]),
        Column("p", "Newtons", [f"{-one / 8:.6f}" for one in numbers]),
    ]


def seconds(count: int = 40, step_s: float = 1e-3) -> list[str]:
    """Return the cells of a column of time."""
    return [f"{i * step_s:.6f}" for i in range(count)]
