"""A file that a document was made of, beside what lies there now."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store.shot_log import ShotLog
from recoil_identification.report.document.reproduction import Comparison, Difference


@dataclass(frozen=True)
class Ingredient:
    """A file that a document was made of, by its name and digest then.

    Attributes
    ----------
    paths
        Paths at which it may be now; one with its digest is taken, else the first that is there.
    absent
        Words for its state if it is nowhere there.
    since
        Function that says more of one that has changed.
    named
        Paths that somebody named: what lies there is told, also if another copy was taken.
    """

    name: str
    sha256: str
    paths: tuple[Path, ...]
    absent: str
    since: Callable[[Path], str] = lambda _: ""
    named: tuple[Path, ...] = ()

    def states(self) -> Iterator[dict[str, Any]]:
        """Say whether it is still as it was, with ``file``, ``sha256``, ``found``, ``sha256_now`` and ``state``."""
        for path, now in _digests(self.named):
            if now != self.sha256:
                yield self._state(path, now, "another file than the report was made of")
        there = _digests(self.paths)
        same = next((found for found in there if found[1] == self.sha256), None)
        if same is not None:
            yield self._state(*same, "as it was")
        elif there:
            yield self._state(*there[0], f"changed since{self.since(there[0][0])}")
        else:
            yield self._state(None, None, self.absent)

    def _state(self, path: Path | None, now: str | None, state: str) -> dict[str, Any]:
        found = None if path is None else str(path)
        return {"file": self.name, "sha256": self.sha256, "found": found, "sha256_now": now, "state": state}


def _digests(paths: Iterable[Path]) -> list[tuple[Path, str]]:
    return [(path, InputFile.of(path).sha256) for path in paths if path.is_file()]


def digest_differences(expected: Iterable[tuple[Path, str | Collection[str], str]]) -> Comparison:
    """Compare files with what a document states of them, as far as they are there.

    Parameters
    ----------
    expected
        Path, digests that it may have, and what a difference says that it should be.
    """
    return Comparison.of(
        Difference(f"SHA-256 of {path}", stated, now)
        for one, allowed, stated in expected
        for path, now in _digests([one])
        if now not in allowed
    )


def rows_since(path: Path, logged: Mapping[str, Mapping[str, Any] | None]) -> str:
    """Say of a shot log that has changed whether its rows of some shots have.

    Parameters
    ----------
    logged
        Cells of each shot's row as they were; None for a shot that had none.
    """
    try:
        log = ShotLog.read(path)
        rows = {shot: log.row(shot) for shot in logged}
    except RecoilDaqError as error:
        return f", and at fault now: {error}"
    now = {shot: {} if row is None else row.to_json() for shot, row in rows.items()}
    others = [shot for shot, was in logged.items() if _said(was) != _said(now[shot])]
    if len(logged) == 1:
        return ", and so is its row of this shot" if others else ", its row of this shot is the same"
    return f", and so are its rows of {', '.join(others)}" if others else ", its rows of these shots are the same"


def _said(row: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the cells of a row that say something; no mass added is a mass of 0."""
    return {key: cell for key, cell in (row or {}).items() if cell not in (None, "", 0.0)}
