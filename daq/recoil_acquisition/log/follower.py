"""A log that is followed while another thread or process writes it."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.log.folder import in_order, open_log
from recoil_acquisition.log.record import Record
from recoil_acquisition.log.scan import Damage, FileScan, is_hole
from recoil_acquisition.log.segment import segment_paths


class LogFollower:
    """Reads a log as it grows, from its first record on.

    Half a record at the end is waited for; it counts as damaged only once a sound one stands behind it.

    Parameters
    ----------
    folder : Path

    Attributes
    ----------
    damages : list of Damage

    Raises
    ------
    StoreError
        As `open_log`.
    """

    def __init__(self, folder: Path) -> None:
        log = open_log(folder)
        self._folder = folder
        self._log_id = log.log_id
        self._path = log.segments[0].path
        self._scan = FileScan(self._path, self._log_id, growing=True)
        self._following = 0
        self.damages: list[Damage] = []

    def poll(self) -> list[Record]:
        """Return what was appended since the last call, in the order of the log.

        Raises
        ------
        StoreError
            If a segment cannot be read.
        """
        found: list[Record] = []
        while True:
            # asked for before the last look at this one: nothing is appended here once the next one is begun
            path = self._begun_next()
            self._scan.growing = path is None
            found += self._scan
            if path is None:
                break
            self.close()
            self.damages += self._scan.damages
            self._path, self._scan = path, FileScan(path, self._log_id, growing=True)
        records = list(in_order(found, self._following))
        self._following = records[-1].number + 1 if records else self._following
        return records

    def close(self) -> None:
        """Let go of the file."""
        self._scan.__exit__(None, None, None)

    def _begun_next(self) -> Path | None:
        later = [path for path in segment_paths(self._folder).values() if path.name > self._path.name]
        if not later or is_hole(later[0]):
            return None
        with FileScan(later[0], self._log_id) as scan:
            return None if scan.head_from(0, 1) is None else later[0]
