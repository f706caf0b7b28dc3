"""One segment of a LabVIEW measurement file, and its channels apart where each has a column of times of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO

from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.readers.text_file import TextFile

X_VALUE = "X_Value"


@dataclass(frozen=True)
class Segment:
    """One segment: what its head states, and its rows.

    Attributes
    ----------
    keys
        Key -> values, one for each column behind the first.
    names
        Names of the columns, without that of the comments.
    rows
        Rows of numbers, one width each, as a text of their own.
    line
        Number of the first row's line in the file, from 1.
    """

    keys: Mapping[str, Sequence[str]]
    names: tuple[str, ...]
    rows: TextFile
    line: int

    def value(self, key: str, column: int) -> str:
        """Return what the head states of a column; empty if it does not."""
        values = self.keys.get(key, ())
        return values[column - 1].strip() if 0 < column <= len(values) else ""

    def stamp_text(self, column: int) -> str:
        """Return the date and time that the head states of a column, as they are printed."""
        return f"{self.value('Date', column)} {self.value('Time', column)}".strip()

    def apart(self, separator: str) -> list[Segment]:
        """Return a segment for each column of times with the columns behind it; itself where all times are the same.

        A row in which a channel has neither a time nor a sample is none of its: channels may be of fewer samples.
        """
        begins = [i for i, name in enumerate(self.names) if name == X_VALUE]
        columns = [range(at, end) for at, end in zip(begins, [*begins[1:], len(self.names)], strict=True)]
        columns = [one for one in columns if len(one) > 1]
        if len(columns) < 2:
            return [self]
        mark = separator.encode()
        firsts = [one.start for one in columns]
        same = all(row[at] == row[firsts[0]] for row in self._cells(mark) for at in firsts if len(row) > at)
        if same and len({self.stamp_text(i) for one in columns for i in one[1:]}) == 1:
            return [self]
        named, _ = unique_names([name or f"column {i}" for i, name in enumerate(self.names)])
        return [self._of(one, named, mark) for one in columns]

    def _cells(self, mark: bytes) -> Iterator[list[bytes]]:
        """Yield the cells of each row; all of them at once take a multiple of the file."""
        for line in BytesIO(self.rows.data):
            yield line.rstrip(b"\n").split(mark)

    def _of(self, columns: range, named: Sequence[str], mark: bytes) -> Segment:
        kept, held = bytearray(), False
        for row in self._cells(mark):
            cells = mark.join(row[columns.start : columns.stop])
            if held := bool(cells.strip(mark + b" \r")):
                kept += cells + b"\n"
        if held and not self.rows.data.endswith(b"\n"):
            del kept[-1:]
        values = {key: [self.value(key, i) for i in columns[1:]] for key in self.keys}
        names = (X_VALUE, *(named[i] for i in columns[1:]))
        return replace(self, keys=values, names=names, rows=replace(self.rows, data=bytes(kept)))
