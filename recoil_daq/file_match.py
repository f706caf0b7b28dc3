"""Which shot a dropped file belongs to: by its source, its time and its name. What fits two shots is given to none."""

from __future__ import annotations

import re
from collections.abc import Sequence

from daq.errors import ReadError
from recoil_daq.folder_watch import DroppedFile
from recoil_daq.ingest import reader_of
from recoil_daq.live_shot import LiveShot
from rigs.assemble import match_files
from rigs.rig import Rig


def source_of(rig: Rig, file: DroppedFile) -> str:
    """Return the source of a file.

    Raises
    ------
    ReadError
        If no reader knows it, or it fits none or several sources.
    """
    reader = reader_of(file.path, rig)
    return next(iter(match_files(rig, [(file.path, reader.kind)])))


def shot_of(file: DroppedFile, source: str, shots: Sequence[LiveShot]) -> LiveShot | None:
    """Return the shot that a file of a source belongs to.

    A file belongs to a shot that waits for its source, and that was fired before the file was first seen. Of several,
    the one whose number stands in the file's name.

    Parameters
    ----------
    file : DroppedFile
    source : str
    shots : sequence of LiveShot

    Returns
    -------
    LiveShot or None
        None if no shot was fired that could have it.

    Raises
    ------
    ReadError
        If it fits several shots, or its name is that of a shot which has such a file already.
    """
    fired = [s for s in shots if source in s.wanted and s.window is not None and s.window.trigger_s <= file.seen_s]
    waiting = [s for s in fired if source in s.missing and not s.settled]
    numbers = {int(run) for run in re.findall(r"\d+", file.path.stem) if len(run) < 10}
    named = [s for s in fired if s.name.isdigit() and int(s.name) in numbers]
    if len(named) == 1:
        if named[0] in waiting:
            return named[0]
        raise ReadError(
            f"by its name it belongs to shot {named[0].name}, which has a file of {source} or waits no longer",
            path=file.path,
            remedy="ingest that shot again with it, by hand",
        )
    if not waiting:
        return None
    if len(waiting) > 1:
        raise ReadError(
            f"a file of {source} for several shots: {', '.join(s.name for s in waiting)}",
            path=file.path,
            remedy="write the shot's number into its name, or ingest by hand",
        )
    return waiting[0]
