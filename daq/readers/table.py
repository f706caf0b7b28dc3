"""The table of readers, and how a file finds its reader.

`READERS` is the table. A file is recognised by its content alone (`recognise`): exactly one reader
claims it, or the error names the candidates.
"""

from __future__ import annotations

from pathlib import Path

from daq.errors import ReadError, UnknownFormatError
from daq.readers.can_capture import CanCaptureReader
from daq.readers.can_log import AscReader, BlfReader, CandumpReader
from daq.readers.deeplabcut import DeepLabCutReader
from daq.readers.dewesoft_text import DewesoftTextReader
from daq.readers.dltdv import DltdvReader
from daq.readers.proanalyst_text import ProAnalystTextReader
from daq.readers.proanalyst_workbook import ProAnalystWorkbookReader
from daq.readers.reader import HEAD_BYTES, Declarations, Reader, Recording, SignalHeader
from daq.readers.serial_capture import SerialCaptureReader
from daq.readers.sleap_analysis import SleapAnalysisReader
from daq.readers.sleap_text import SleapTextReader
from daq.readers.tracker_text import TrackerTextReader

READERS: tuple[Reader, ...] = (
    DewesoftTextReader(),
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
    CanCaptureReader(),
    SerialCaptureReader(),
)
"""Every reader, in the order in which they are listed to users."""


def read_head(path: Path) -> bytes:
    """Read the first `HEAD_BYTES` bytes of a file.

    Raises
    ------
    ReadError
        If the file is missing, a directory, empty or not readable.
    """
    if path.is_dir():
        raise ReadError("this is a directory", path=path, expected="a file", remedy="name the files in it")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise ReadError("no such file", path=path, remedy="check the name and the folder") from error
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror}", path=path, remedy="check its permissions") from error
    if not head:
        raise ReadError("the file is empty", path=path, remedy="export it again")
    return head


def recognise(path: Path) -> Reader:
    """Find the one reader that claims a file by its content.

    Raises
    ------
    ReadError
        If the file cannot be read at all.
    UnknownFormatError
        If no reader claims it, or more than one does.
    """
    head = read_head(path)
    claiming = [reader for reader in READERS if reader.claims(head)]
    if len(claiming) != 1:
        raise UnknownFormatError(path, [r.name for r in claiming], [r.name for r in READERS])
    return claiming[0]


__all__ = [
    "HEAD_BYTES",
    "READERS",
    "Declarations",
    "Reader",
    "Recording",
    "SignalHeader",
    "read_head",
    "recognise",
]
