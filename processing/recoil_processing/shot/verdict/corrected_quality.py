"""The verdict of a shot whose rig was corrected: what hangs on the corrected values is judged anew."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.shot.shot import Shot
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay


def judged_anew(recorded: FiredShot, corrected: FiredShot, day: CalibrationDay) -> tuple[Shot, list[str]]:
    """Judge a corrected shot: what a correction changes is taken, everything else is as ingest found it.

    Both shots are checked without their recorded files, which are not at hand, and only what differs between them
    counts. What was found from the files themselves (lost frames, stamps, a file that was cut off) is therefore kept.

    Parameters
    ----------
    recorded
        Shot and rig of the shot file.
    corrected
        Shot with its samples as the corrected rig has them, and that rig.
    day
        Day that the calibrations must cover.

    Returns
    -------
    shot : Shot
        Corrected shot with its verdict.
    kept : list of str
        Checks that the correction changes and that cannot be made without the recorded files: they stand as they were.
    """
    before = check_shot(recorded, recorded.shot.alignments, {}, day)
    after = check_shot(corrected, corrected.shot.alignments, {}, day)
    gone, come = Counter(before) - Counter(after), Counter(after) - Counter(before)
    quality, kept = list(recorded.shot.quality), []
    for place in dict.fromkeys(_place(check) for check in (*gone, *come)):
        were, are = _at(place, gone), _at(place, come)
        there = [check for check in quality if _place(check) == place]
        if any(check not in there for check in were) or (there and not were):
            kept.append(" ".join(place))
            continue
        first = quality.index(were[0]) if were else len(quality)
        quality = [check for check in quality if check not in were]
        quality[first:first] = are
    return replace(corrected.shot, quality=tuple(quality)), kept


def _place(check: QualityCheck) -> tuple[str, str]:
    return check.channel, check.name


def _at(place: tuple[str, str], checks: Iterable[QualityCheck]) -> list[QualityCheck]:
    return [check for check in checks if _place(check) == place]
