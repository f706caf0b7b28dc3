"""A shot file to files of another format."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import StoreError
from recoil_acquisition.exporters.content import Content, gather
from recoil_acquisition.exporters.publication import ExportedFile, write_export
from recoil_acquisition.exporters.table import exporter_of
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store import read_shot
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.version import __version__


@dataclass(frozen=True, repr=False)
class Exported(Printed):
    """Export of one shot.

    Attributes
    ----------
    notes
        Sentences that a user must know about all files.
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

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``export --json``."""
        return {
            "schema": "recoil-daq/exported/1",
            "shot": self.shot,
            "rig": self.rig,
            "format": self.format,
            "aligned": self.aligned,
            "complete": self.complete,
            "files": [
                {
                    "file": str(file.path),
                    "clocks": list(file.clocks),
                    "channels": list(file.channels),
                    "samples": file.samples,
                    "bytes": file.size,
                    "exact": file.exact,
                    "losses": list(file.losses),
                    "left_out": list(file.left_out),
                }
                for file in self.files
            ],
            "notes": list(self.notes),
        }

    def show(self) -> None:
        """Print a row per file, what each lost, and what concerns all of them."""
        from recoil_daq.terminal.file import print_exported

        print_exported(self.to_json())

    def __repr__(self) -> str:
        return f"Exported({self.shot!r} as {self.format}: {len(self.files)} files -> {self.files[0].path.parent})"


def export(
    path: str | Path,
    format_name: str,
    *,
    out: str | Path = "exports",
    channels: Sequence[str] = (),
    aligned: bool = False,
    frequency_class: int | None = None,
    rate_hz: float | None = None,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> Exported:
    """Write a shot in another format, read it back, and say what is exact and what is lost.

    Parameters
    ----------
    path
        Shot file.
    format_name
        Name of one of `recoil_acquisition.exporters.table.exporter_names`.
    out
        Folder of the files.
    channels
        Channels to export; all if empty.
    aligned
        Whether all instants are mapped to the reference clock.
    frequency_class
        Channel frequency class of SAE J211-1 and ISO 6487 through which every channel is passed, on the grid of
        `rate_hz` where its own samples are not evenly spaced; channels that it cannot be applied to stay as recorded,
        and are named. None for no filter.
    rate_hz
        Rate of one even grid on the reference clock that every channel is put on, with what it cannot hold taken out
        before; the notes say what that took off. None for the channels' own instants.
    progress
        Function called with the name of each step.

    Raises
    ------
    ValueError
        If the format is unknown.
    StoreError
        If the file is no shot file, a channel or an alignment is missing, the rate is none or would make more samples
        than make sense, or a file exists, cannot be written or does not read back. Nothing is left behind then.
    """
    exporter = exporter_of(format_name)
    source = Path(path)
    progress("read")
    shot = read_shot(source)
    unfiltered: dict[str, str] = {}
    if frequency_class is not None:
        progress("filter")
        shot, unfiltered = _filtered(shot, channels, frequency_class)
    provenance = {
        "program": f"recoil-daq {__version__}",
        "shot_file": source.name,
        "sha256": InputFile.of(source).sha256,
    }
    try:
        content = gather(shot, provenance, channels, aligned=aligned or rate_hz is not None)
    except StoreError as error:
        error.path = source
        raise
    losses: tuple[str, ...] = ()
    if rate_hz is not None:
        progress("resample")
        try:
            content, losses = content.on_one_grid(rate_hz, __version__)
        except ValueError as error:
            raise StoreError(f"no grid of {rate_hz:g} Hz: {error}", path=source, remedy="correct --rate") from error
        if frequency_class is not None:
            content, unfiltered = _filtered_on_grid(content, unfiltered, frequency_class)
    # `ingest` names shots so that this changes nothing; files of other makers may not
    stem = re.sub(r"[^\w.+-]", "_", shot.name).lstrip(".") or "shot"
    files = write_export(content, exporter, Path(out), stem, overwrite=overwrite, progress=progress)
    if losses:
        files = tuple(replace(file, exact=False, losses=(*losses, *file.losses)) for file in files)
    return Exported(
        shot.name, shot.rig_name, exporter.name, aligned or rate_hz is not None, files,
        (*content.notes, *_not_filtered(unfiltered, frequency_class, on_grid=rate_hz is not None)),
    )  # fmt: skip


def _not_filtered(why: Mapping[str, str], frequency_class: int | None, *, on_grid: bool) -> Iterator[str]:
    """Yield a note for each reason why channels have not passed a channel frequency class."""
    for reason in dict.fromkeys(why.values()):
        names = ", ".join(name for name, one in why.items() if one == reason)
        remedy = "" if on_grid else "; --rate HZ puts all channels on an even grid, and filters these there"
        yield f"as recorded, not filtered by cfc-{frequency_class} because {reason}: {names}{remedy}"


def _filtered_on_grid(content: Content, why: Mapping[str, str], frequency_class: int) -> tuple[Content, dict[str, str]]:
    """Pass the channels through a channel frequency class on their grid that have not passed it by their own instants.

    Returns
    -------
    content
        Content with these channels filtered.
    dict of str to str
        Why one of them has not passed it there either, by name.
    """
    from recoil_processing.filters import ChannelFrequencyClass
    from recoil_processing.shot.filtered_channel import filtered_channel

    zero_phase, left = ChannelFrequencyClass(frequency_class), dict[str, str]()

    def filtered(channel: Channel) -> Channel:
        if channel.name not in why:
            return channel
        try:
            return filtered_channel(channel, zero_phase, __version__)
        except ValueError as error:
            left[channel.name] = str(error)
            return channel

    groups = [replace(group, channels=tuple(map(filtered, group.channels))) for group in content.groups]
    return content.only(groups), left


def _filtered(shot: Shot, names: Sequence[str], frequency_class: int) -> tuple[Shot, dict[str, str]]:
    """Return a shot whose channels have passed a channel frequency class, and why others have not, by name."""
    from recoil_processing.filters import ChannelFrequencyClass
    from recoil_processing.shot.filtered_channel import filtered_channel

    zero_phase = ChannelFrequencyClass(frequency_class)
    channels: dict[str, Channel] = {}
    why: dict[str, str] = {}
    for name, channel in shot.channels.items():
        channels[name] = channel
        if names and name not in names:
            continue
        try:
            channels[name] = filtered_channel(channel, zero_phase, __version__)
        except ValueError as error:
            why[name] = str(error)
    return replace(shot, channels=channels), why
