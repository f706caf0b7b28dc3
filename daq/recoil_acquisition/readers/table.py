"""The table of readers, and how a file finds its reader.

`READERS` is the table. A file is recognised by its content (`recognise`): exactly one reader claims it, or the error
names the candidates. A table that only its shape speaks for, as other programs write it too, is taken where a rig says
of which kind its source is. A text table whose layout the rig declares is read by `readers.text.declared_table`,
which claims nothing and is not in the table.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers.can.capture import CanCaptureReader
from recoil_acquisition.readers.can.log import (
    AscReader,
    BlfReader,
    CanCsvReader,
    CandumpReader,
    CanSqliteReader,
    TrcReader,
)
from recoil_acquisition.readers.can.mdf import MdfBusReader
from recoil_acquisition.readers.dewesoft.native import DewesoftReader
from recoil_acquisition.readers.exported.recoil_csv import RecoilCsvReader
from recoil_acquisition.readers.exported.recoil_parquet import RecoilParquetReader
from recoil_acquisition.readers.hdf5.reader import Hdf5Reader
from recoil_acquisition.readers.hdf5.rehearsal import needs_rehearsal, rehearse_apart
from recoil_acquisition.readers.mat.reader import MatReader
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.oxygen.dmd import OxygenReader
from recoil_acquisition.readers.reader import (
    HEAD_BYTES,
    Confirming,
    Declarations,
    Reader,
    Recording,
    Shaped,
    SignalHeader,
)
from recoil_acquisition.readers.serial.capture import SerialCaptureReader
from recoil_acquisition.readers.tdms.reader import TdmsReader
from recoil_acquisition.readers.text.dasylab import DasylabTextReader
from recoil_acquisition.readers.text.dewesoft import DewesoftTextReader
from recoil_acquisition.readers.text.oxygen import OxygenTextReader
from recoil_acquisition.readers.tracks.deeplabcut import DeepLabCutReader
from recoil_acquisition.readers.tracks.dltdv import DltdvReader
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader
from recoil_acquisition.readers.tracks.proanalyst_workbook import ProAnalystWorkbookReader
from recoil_acquisition.readers.tracks.sleap_analysis import SleapAnalysisReader
from recoil_acquisition.readers.tracks.sleap_text import SleapTextReader
from recoil_acquisition.readers.tracks.tracker_text import TrackerTextReader
from recoil_acquisition.readers.uff.reader import UffReader
from recoil_acquisition.readers.unread import foreign_format
from recoil_acquisition.readers.wav.reader import WavReader
from recoil_acquisition.regular_file import read_beginning

READERS: tuple[Reader, ...] = (
    DewesoftTextReader(),
    DewesoftReader(),
    OxygenTextReader(),
    OxygenReader(),
    DasylabTextReader(),
    MdfReader(),
    TdmsReader(),
    UffReader(),
    MatReader(),
    Hdf5Reader(),
    WavReader(),
    RecoilCsvReader(),
    RecoilParquetReader(),
    ProAnalystTextReader(),
    ProAnalystWorkbookReader(),
    DeepLabCutReader(),
    DltdvReader(),
    TrackerTextReader(),
    SleapTextReader(),
    SleapAnalysisReader(),
    AscReader(),
    BlfReader(),
    CandumpReader(),
    TrcReader(),
    CanCsvReader(),
    CanSqliteReader(),
    MdfBusReader(),
    CanCaptureReader(),
    SerialCaptureReader(),
)
"""Every reader, in the order in which they are listed to users."""


class Extra(NamedTuple):
    """What a reader needs beside the package.

    Attributes
    ----------
    name : str
        Of the extra, as pip takes it.
    module : str
        What it installs.
    """

    name: str
    module: str


EXTRAS: Mapping[str, Extra] = {
    "Dewesoft recording": Extra("dewesoft", "dwdatareader"),
    "MDF 4": Extra("mdf", "asammdf"),
    "ProAnalyst workbook": Extra("xlsx", "openpyxl"),
    "TDMS": Extra("tdms", "nptdms"),
    "recoil-daq Parquet": Extra("parquet", "pyarrow"),
}
"""Name of a reader -> the extra that it needs; the others need none."""


def read_head(path: Path) -> bytes:
    """Read the first `HEAD_BYTES` bytes of a file.

    Raises
    ------
    ReadError
        If the file is missing, no file but a directory, a pipe or a device, empty or not readable.
    """
    head = read_beginning(path, HEAD_BYTES)
    if not head:
        raise ReadError("the file is empty", path=path, remedy="export it again")
    return head


def recognise(path: Path, kinds: Collection[str] = ()) -> Reader:
    """Find the one reader that claims a file by its content.

    Parameters
    ----------
    path : Path
    kinds : collection of str
        Kinds of the sources that a rig says the file may be of: a table of the shape that is read for one of them is
        taken, though nothing in it says whose it is.

    Raises
    ------
    ReadError
        If the file cannot be read at all, or damaged so that its library ends over it.
    UnknownFormatError
        If no reader claims it, or more than one does.
    """
    head = read_head(path)
    if needs_rehearsal(head):
        rehearse_apart(path)
    claiming = [reader for reader in READERS if reader.claims(head)]
    if len(claiming) > 1:
        claiming = [reader for reader in claiming if not isinstance(reader, Confirming) or reader.confirms(path)]
    if len(claiming) == 1:
        return claiming[0]
    if claiming:
        raise UnknownFormatError(path, [r.name for r in claiming], [r.name for r in READERS])
    found, remedy = foreign_format(path, head)
    if not found:
        shapes = {r: shape for r in READERS if isinstance(r, Shaped) and (shape := r.suits(head))}
        suiting = [reader for reader in shapes if reader.kind in kinds]
        if len(suiting) == 1:
            return suiting[0]
        if shapes:
            reader, found = next(iter(shapes.items()))
            remedy = (
                f'say in a rig whose it is, a source with `kind = "{reader.kind}"` and a `match` of the file\'s name'
            )
    raise UnknownFormatError(path, [], [r.name for r in READERS], found=found, remedy=remedy)


__all__ = [
    "EXTRAS",
    "HEAD_BYTES",
    "READERS",
    "Declarations",
    "Extra",
    "Reader",
    "Recording",
    "SignalHeader",
    "read_head",
    "recognise",
]
