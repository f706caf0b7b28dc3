"""A shot file to files of another format."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import StoreError
from recoil_acquisition.exporters.content import gather
from recoil_acquisition.exporters.publication import ExportedFile, write_export
from recoil_acquisition.exporters.table import exporter_of
from recoil_acquisition.shot import Shot
from recoil_acquisition.store import read_shot
from recoil_daq import __version__

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Exported:
    """What was exported of one shot.

    Attributes
    ----------
    shot, rig, format : str
    aligned : bool
    files : tuple of ExportedFile
    notes : tuple of str
        What a user must know about all of them.
    """

    shot: str
    rig: str
    format: str
    aligned: bool
    files: tuple[ExportedFile, ...]
    notes: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every channel that was asked for is in a file."""
        return not any(file.left_out for file in self.files)


def export_shot(
    path: str | Path,
    format_name: str,
    *,
    out: str | Path = "exports",
    channels: Sequence[str] = (),
    aligned: bool = False,
    frequency_class: int | None = None,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> Exported:
    """Write a shot in another format, read it back, and say what is exact and what is lost.

    Parameters
    ----------
    path : path
        A shot file.
    format_name : str
        Name of one of `recoil_acquisition.exporters.table.exporters`.
    out : path
        Folder of the files.
    channels : sequence of str
        Channels to export; all if empty.
    aligned : bool
        Map all instants to the reference clock.
    frequency_class : int, optional
        Pass every channel through this channel frequency class of SAE J211-1 and ISO 6487; those that it cannot be
        applied to stay as recorded, and are named.
    overwrite : bool
    progress : callable
        Told the name of each step.

    Raises
    ------
    ValueError
        If the format is unknown.
    StoreError
        If the file is no shot file, a channel or an alignment is missing, or a file exists, cannot be written or does
        not read back. Nothing is left behind then.
    """
    exporter = exporter_of(format_name)
    source = Path(path)
    progress("read")
    shot = read_shot(source)
    with source.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    notes: list[str] = []
    if frequency_class is not None:
        progress("filter")
        shot, notes = _filtered(shot, channels, frequency_class)
    provenance = {"program": f"recoil-daq {__version__}", "shot_file": source.name, "sha256": digest}
    try:
        content = gather(shot, provenance, channels, aligned=aligned)
    except StoreError as error:
        error.path = source
        raise
    # `ingest` names shots so that this changes nothing; files of other makers may not
    stem = re.sub(r"[^\w.+-]", "_", shot.name).lstrip(".") or "shot"
    files = write_export(content, exporter, Path(out), stem, overwrite=overwrite, progress=progress)
    return Exported(shot.name, shot.rig_name, exporter.name, aligned, files, (*content.notes, *notes))


def _filtered(shot: Shot, names: Sequence[str], frequency_class: int) -> tuple[Shot, list[str]]:
    """Return a shot whose channels have passed a channel frequency class, and notes on those that have not."""
    from recoil_processing.filters import ChannelFrequencyClass
    from recoil_processing.shot.filtered_channel import filtered_channel

    zero_phase = ChannelFrequencyClass(frequency_class)
    channels: dict[str, Channel] = {}
    notes: list[str] = []
    for name, channel in shot.channels.items():
        channels[name] = channel
        if names and name not in names:
            continue
        try:
            channels[name] = filtered_channel(channel, zero_phase, __version__)
        except ValueError as error:
            notes.append(f"{name} is as recorded, not filtered by cfc-{frequency_class}: {error}")
    return replace(shot, channels=channels), notes
