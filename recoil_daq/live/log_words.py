"""Words that somebody at the range writes into a shot's row of the shot log: a note, or why it is left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog

EXCLUDE, NOTES = "exclude", "notes"
_JOIN = "; "


@dataclass(frozen=True)
class LogWords:
    """Words for one cell.

    Attributes
    ----------
    column
        `EXCLUDE`, whose words take the place of those before, or `NOTES`, which has all of them.
    text
        Words; empty to take back what stands there.
    """

    shot: str
    column: str
    text: str

    def write(self, out: Path) -> str:
        """Write them into the row of the shot, as a row that somebody wrote; return why it cannot be, empty if it was.

        Parameters
        ----------
        out
            Folder of the shot files.
        """

        def with_words(log: ShotLog) -> ShotLog:
            before = log.cells(self.shot).get(self.column, "")
            if self.column == NOTES and before and self.text:
                return log.with_cells(self.shot, {self.column: f"{before}{_JOIN}{self.text}"})
            return log.with_cells(self.shot, {self.column: self.text})

        try:
            ShotLog.changed(out / SHOT_LOG, with_words)
        except (RecoilDaqError, ValueError) as error:
            return f"{self} is NOT in the shot log: {error}"
        return ""

    def __str__(self) -> str:
        if self.column == NOTES:
            return f"note on shot {self.shot}: {self.text}"
        return f"shot {self.shot} excluded: {self.text}" if self.text else f"shot {self.shot} not excluded any more"
