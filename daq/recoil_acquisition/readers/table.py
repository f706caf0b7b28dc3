"""The table of readers, and how a file finds its reader.

`READERS` is the table, and `readers` adds those of other packages. Nothing of a reader's module is imported before a
file shows the reader's sign. A file is recognised by its content (`recognise`): the surest claim takes it, and where
two claims are equally sure, the error names both. A table that only its shape speaks for, as other programs write it
too, is taken where a rig says of which kind its source is. `BY_LAYOUT` are the readers of files whose layout or
framing the rig declares; they claim nothing.

A new format is a module with a class that has `name` and `open`, and `claims` where its signs are not enough; a row
here; and a file of it among ``tests/contracts/cases_*.py``, over which every rule of readers runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.files.regular_file import check_regular
from recoil_acquisition.packages.extras import DEWESOFT, PARQUET, TDMS, XLSX, Extra
from recoil_acquisition.packages.others import offered, warn_of_fault
from recoil_acquisition.readers.foreign_formats import foreign_format
from recoil_acquisition.readers.hdf5.rehearsal import needs_rehearsal, rehearse_apart
from recoil_acquisition.readers.head import HEAD_BYTES, Claim, Head
from recoil_acquisition.readers.text.cells import split_cells
from recoil_acquisition.readers.text.proposed_layout import propose_layout

if TYPE_CHECKING:
    from recoil_acquisition.readers.reader import Declarations, Reader
    from recoil_acquisition.readers.recording import Recording


class _Loaded(Protocol):
    """A reader of this package as its module has it."""

    def claims(self, head: Head) -> Claim: ...

    def open(self, path: Path, declared: Declarations) -> Recording: ...


@dataclass(frozen=True)
class TableReader:
    """One row of the table: a `Reader` whose module is imported when it is needed.

    Attributes
    ----------
    name
        Name of the format, as users know it.
    kind
        Kind of source that writes it.
    suffixes
        Usual endings of its files: a hint for people.
    path
        Module, below `recoil_acquisition.readers`, and the reader or its class.
    signs
        Regular expressions, as `Head.shows` takes them, one of which every file of this format shows.
    claim
        Claim for which a sign is enough; None if the reader must look itself.
    """

    name: str
    kind: str
    suffixes: tuple[str, ...]
    path: str
    signs: tuple[bytes | str, ...] = ()
    claim: Claim | None = None
    extra: Extra | None = None

    @cached_property
    def _loaded(self) -> _Loaded:
        module, _, name = self.path.partition(":")
        found = getattr(import_module(f"recoil_acquisition.readers.{module}"), name)
        reader: _Loaded = found() if isinstance(found, type) else found
        return reader

    def claims(self, head: Head) -> Claim:
        """Say from the beginning of a file how sure this is that the file is of its format."""
        if not any(map(head.shows, self.signs)):
            return Claim.NO
        return self._loaded.claims(head) if self.claim is None else self.claim

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file.

        Raises
        ------
        ReadError
            If what reads it is not installed, or the file is not what it seems; if it was recognised by its content
            although its source declares a layout.
        """
        if self.extra is not None:
            self.extra.check(path)
        if self.signs:
            _refuse_layout(declared, path)
        return _opened(self._loaded, self.name, path, declared)


class OthersReader:
    """A reader of another package, whose mistakes are its own."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self.name, self.kind, self.suffixes = reader.name, reader.kind, reader.suffixes

    def claims(self, head: Head) -> Claim:
        """Say how sure it is; one that fails is noted and claims nothing."""
        try:
            return Claim(self._reader.claims(head))
        except Exception as error:
            warn_of_fault(f"the reader {self.name!r}", error)
            return Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file.

        Raises
        ------
        ReadError
            If the file is not what it seems, whatever the reader raises; if its source declares a layout.
        """
        _refuse_layout(declared, path)
        return _opened(self._reader, self.name, path, declared)


def _refuse_layout(declared: Declarations, path: Path) -> None:
    """Refuse a file that was recognised by its content although its source declares a layout: it would not count."""
    if declared.layout is not None:
        raise ReadError(
            f"source {declared.clock!r} declares a layout, and the file was recognised without it",
            path=path,
            expected="a source whose `match` pattern, and no other's, fits the file's name",
            remedy="add `match` to the source in the rig file, or leave out its `layout`",
        )


def _opened(reader: _Loaded, name: str, path: Path, declared: Declarations) -> Recording:
    """Open what is a file, no pipe or device; what a reader did not foresee of one is an error of the file's, too."""
    from recoil_acquisition.readers.recording import map_to_corrupt_file

    check_regular(path)
    with map_to_corrupt_file(path, f"a whole file of {name}"):
        return reader.open(path, declared)


GROUP = "recoil_daq.readers"
"""Entry points by which other packages announce their readers."""

COUNTED_LINES = 50
"""Lines by which the columns of a table are counted that nobody knows."""

_HDF5 = rb"\x89HDF\r\n\x1a\n"
_USER_BLOCKS = b"|".join(b".{%d}" % (512 << i) for i in range(7))
_MDF4 = rb"(?s)(MDF     4\.|UnFinMF 4\.).{55}"
_MDF3 = rb"(?s)(MDF     |UnFinMF )[23]\.\d.{53}"

READERS: tuple[Reader, ...] = (
    TableReader(
        "Dewesoft text export", "dewetron", (".csv", ".txt"), "text.dewesoft:DewesoftTextReader",
        (r'(?im)^(?:[^\S\n]|")*time|waterfall|/orders? \(', r'(?m)^[^()\n,;\t]*\((?:s|ms|us|µs)\)"?[,;\t]'),
    ),
    TableReader(
        "Dewesoft recording", "dewetron", (".dxd", ".d7d"), "dewesoft.native:DewesoftReader",
        (rb"MULTI_STREAM_FILE_VER",), Claim.CERTAIN, DEWESOFT,
    ),
    TableReader(
        "OXYGEN text export", "dewetron", (".csv", ".txt"), "text.oxygen:OxygenTextReader",
        (r'(?im)^(?:[^\S\n]|")*(time|zeit|date)',),
    ),
    TableReader(
        "DEWETRON OXYGEN recording", "dewetron", (".dmd",), "oxygen.dmd:OxygenReader",
        (rb"(?s)DMDF.{0,49}DMD Library",), Claim.CERTAIN,
    ),
    TableReader(
        "DASYLab ASCII", "dewetron", (".asc", ".txt"), "text.dasylab:DasylabTextReader",
        (r"\ADASYLab|(?i:measurement time)",),
    ),
    TableReader(
        "LabVIEW measurement", "dewetron", (".lvm",), "text.lvm:LvmReader", (r"\ALabVIEW Measurement",), Claim.CERTAIN
    ),
    TableReader(
        "Tektronix oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:TEKTRONIX",
        (r"(?im)^#?Sample Interval[,;\t]",),
    ),
    TableReader(
        "Keysight oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:KEYSIGHT",
        (r"\Ax-axis[,;\t]", r"(?m)^[ \t]*XInc[ \t]*:"),
    ),
    TableReader(
        "Rohde & Schwarz oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:ROHDE_SCHWARZ",
        (r'\A"?in s"?[,;\t]',),
    ),
    TableReader(
        "LeCroy oscilloscope text", "dewetron", (".csv", ".txt"), "text.oscilloscope:LECROY", (r"\ALECROY",)
    ),
    TableReader(
        "Yokogawa oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:YOKOGAWA",
        (r'(?m)^"?HResolution\s*"?',),
    ),
    TableReader(
        "PicoScope oscilloscope text", "dewetron", (".csv", ".txt"), "text.oscilloscope:PICOSCOPE",
        (r"\A[^\n]*\n\([^\n]*\)[ \t,;]*\n[ \t,;]*\n",),
    ),
    TableReader(
        "Rigol oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:RIGOL",
        (r"\A[^\n]*(Increment|tInc|\nSecond)",),
    ),
    TableReader(
        "Siglent oscilloscope text", "dewetron", (".csv",), "text.oscilloscope:SIGLENT", (r"(?m)^Second[,;\t]",)
    ),
    TableReader("MDF 4", "dewetron", (".mf4",), "mdf.reader:MdfReader", (_MDF4,), Claim.GENERIC),
    TableReader("MDF 3", "dewetron", (".dat", ".mdf"), "mdf3.reader:OldMdfReader", (_MDF3,), Claim.CERTAIN),
    TableReader(
        "TDMS", "dewetron", (".tdms",), "tdms.reader:TdmsReader", (rb"(?s)TDS[mh].{24}",), Claim.CERTAIN,
        TDMS,
    ),
    TableReader(
        "UFF 58", "dewetron", (".uff", ".unv"), "uff.reader:UffReader",
        (rb"[ \t\r\n]*-1[ \t]*\r?\n[ \t]*\d{1,5}[ \t]*b?[^\r\n]*\r?\n",), Claim.CERTAIN,
    ),
    TableReader(
        # of version 7.3, which is HDF5 behind a header, of version 5, whose header ends with the byte order, and of
        # version 4, which begins with a variable: its type, two sizes, whether it is complex, the length of its name
        "MATLAB", "dewetron", (".mat",), "mat.reader:MatReader",
        (rb"MATLAB 7\.3 MAT-file", rb"(?s)[^\0-\x08]{4}.{120}(\x00\x01IM|\x01\x00MI)",
         rb"(?s)[\x00-\x34]\0\0\0.{8}[\0\1]\0\0\0[\x02-\x40]\0\0\0[A-Za-z]",
         rb"(?s)\0\0[\x03\x04].{9}\0\0\0[\0\1]\0\0\0[\x02-\x40][A-Za-z]"),
    ),
    TableReader(
        "HDF5", "dewetron", (".h5", ".hdf5"), "hdf5.reader:Hdf5Reader",
        (b"(?s)(|" + _USER_BLOCKS + b")" + _HDF5,), Claim.GENERIC,
    ),
    TableReader(
        "WAV", "dewetron", (".wav",), "wav.reader:WavReader", (rb"(?s)(RIFF|RF64|BW64).{4}WAVE",), Claim.CERTAIN
    ),
    TableReader("NumPy array", "dewetron", (".npy",), "npy.reader:NpyReader", (rb"\x93NUMPY",), Claim.CERTAIN),
    TableReader(
        "recoil-daq CSV", "dewetron", (".csv",), "exported.recoil_csv:RecoilCsvReader", (r"\A# recoil-daq: ",)
    ),
    TableReader(
        "recoil-daq Parquet", "dewetron", (".parquet",), "exported.recoil_parquet:RecoilParquetReader",
        (rb"PAR1",), Claim.GENERIC, PARQUET,
    ),
    TableReader(
        "ProAnalyst text", "camera", (".csv", ".txt"), "tracks.proanalyst_text:ProAnalystTextReader", (r"\d",)
    ),
    TableReader(
        "ProAnalyst workbook", "camera", (".xlsx",), "tracks.proanalyst_text:ProAnalystWorkbookReader",
        (rb"PK\x03\x04",), None, XLSX,
    ),
    TableReader(
        "DeepLabCut", "camera", (".csv", ".h5"), "tracks.deeplabcut:DeepLabCutReader",
        (r'(?i)\A[\s"]*scorer', b"(?s)" + _HDF5 + b".*df_with_missing"),
    ),
    TableReader("DLTdv points", "camera", (".csv",), "tracks.dltdv:DltdvReader", (r"(?i)\A[^\n]*_cam_?\d",)),
    TableReader(
        "Tracker text", "camera", (".txt", ".csv"), "tracks.tracker_text:TrackerTextReader", (r'(?m)^[ "]*t\b',)
    ),
    TableReader("SLEAP text", "camera", (".csv",), "tracks.sleap_text:SleapTextReader", (r"\A[^\n]*frame_idx",)),
    TableReader("SLEAP analysis", "camera", (".h5",), "tracks.sleap_analysis:SleapAnalysisReader", (_HDF5,)),
    TableReader("Vector ASC log", "can", (".asc",), "can.log:ASC", (r"(?im)^base\s+(hex|dec)\b",)),
    TableReader("Vector BLF log", "can", (".blf",), "can.log:BLF", (rb"LOGG",), Claim.CERTAIN),
    TableReader("candump log", "can", (".log",), "can.log:CANDUMP", (r"\A\n*[^\n]*[#\[]",)),
    TableReader("PEAK TRC trace", "can", (".trc",), "can.log:TRC", (r"\A\s*;",)),
    TableReader(
        "python-can CSV log", "can", (".csv",), "can.log:CAN_CSV", (r'\A\s*"?timestamp"?,"?arbitration_id"?,',)
    ),
    TableReader(
        "CANedge CSV log", "can", (".csv",), "can.log:CANEDGE_CSV", (r'\A\s*"?TimestampEpoch"?;"?BusChannel"?;"?ID"?;',)
    ),
    TableReader(
        "python-can SQLite log", "can", (".db",), "can.log:CAN_SQLITE",
        (rb"(?s)SQLite format 3\0(?=.*arbitration_id)(?=.*messages)",), Claim.CERTAIN,
    ),
    TableReader("MDF4 bus logging", "can", (".mf4",), "can.mdf:MdfBusReader", (_MDF4,)),
    TableReader(
        "recoil-daq capture", "live", (".rdlog",), "rdlog:CaptureReader", (rb"\x8dRDL",), Claim.CERTAIN
    ),
)  # fmt: skip
"""Every reader, in the order in which they are listed to users."""

BY_LAYOUT: Mapping[str, Reader] = {
    "dewetron": TableReader(
        "declared text table", "dewetron", (".csv", ".txt"), "text.declared_table:DeclaredTextReader"
    ),
    "camera": TableReader(
        "declared track table", "camera", (".csv", ".txt", ".xlsx"), "tracks.declared_table:DeclaredTrackReader"
    ),
    "serial": TableReader("serial bytes", "serial", (".bin",), "serial.plain:SerialBytesReader"),
}
"""Kind of source -> what reads its files where the rig declares their layout or framing: nothing in them states it."""


def readers() -> tuple[Reader, ...]:
    """Return every reader: those of the table, and those that other packages announce under `GROUP`."""
    return (*READERS, *map(OthersReader, offered(GROUP, ("name", "kind", "suffixes", "claims", "open"))))


def surest_claim(head: Head) -> tuple[Claim, tuple[Reader, ...]]:
    """Return the surest claim on a file, and the readers that make it."""
    claims = [(reader.claims(head), reader) for reader in readers()]
    surest = max(claim for claim, _ in claims)
    return surest, tuple(reader for claim, reader in claims if claim == surest)


def recognise(path: Path, kinds: Collection[str] = ()) -> Reader:
    """Find the one reader whose claim on a file's content is the surest.

    Parameters
    ----------
    kinds
        Kinds of the sources that a rig says the file may be of: a table of the shape that is read for one of them is
        taken, though nothing in it says whose it is.

    Raises
    ------
    ReadError
        If the file cannot be read at all, or damaged so that its library ends over it.
    UnknownFormatError
        If no reader claims it, or more than one is equally sure.
    """
    head = Head.of(path)
    if needs_rehearsal(head.content):
        rehearse_apart(path)
    surest, claiming = surest_claim(head)
    names = [reader.name for reader in readers()]
    if surest > Claim.SHAPE:
        if len(claiming) == 1:
            return claiming[0]
        raise UnknownFormatError(path, [reader.name for reader in claiming], names)
    foreign = foreign_format(head)
    if foreign is not None:
        raise UnknownFormatError(path, [], names, foreign=foreign.name, remedy=foreign.remedy)
    found, remedy = _text_table(head)
    if surest is Claim.SHAPE:
        suiting = [reader for reader in claiming if reader.kind in kinds]
        if len(suiting) == 1:
            return suiting[0]
        whose = (
            f'say in a rig whose it is, a source with `kind = "{claiming[0].kind}"` and a `match` of the file\'s name'
        )
        remedy = f"{whose}, or {remedy}" if remedy else whose
    shapes = [reader.name for reader in claiming] if surest is Claim.SHAPE else []
    raise UnknownFormatError(path, [], names, found=found, remedy=remedy, shapes=shapes)


def reader_by_name(path: Path, kinds: Collection[str]) -> Reader | None:
    """Return the reader of a file that a rig assigns by its name to a source of one of some kinds.

    Of the readers of these kinds the surest is taken, however sure those of others are. A camera's table that begins
    with time has the shape of a recorder's: where a rig calls it a camera's, it is one if it has a coordinate.

    Returns
    -------
    Reader or None
        Reader of the file; None if no reader of these kinds can read it, or several can equally well.
    """
    head = Head.of(path)
    claims = [(reader.claims(head), reader) for reader in readers() if reader.kind in kinds]
    surest = max((claim for claim, _ in claims), default=Claim.NO)
    found = [reader for claim, reader in claims if claim == surest]
    if surest > Claim.NO:
        return found[0] if len(found) == 1 else None
    if "camera" in kinds:
        from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader, has_coordinates

        if has_coordinates(head):
            return next(reader for reader in READERS if reader.name == ProAnalystTextReader.name)
    return None


def _text_table(head: Head) -> tuple[str, str]:
    """Say what a text holds that no reader knows, and by which layout it would be read; empty for what is no text."""
    if not head.text.strip():
        return "", ""
    proposed = propose_layout(head.lines[:-1] if len(head.content) == HEAD_BYTES else head.lines)
    if proposed is None:
        return "a text without a table of numbers", ""
    columns = _column_count(head, proposed.table["separator"])
    found = f"a table of text of {columns} columns, which does not say what program wrote it"
    return found, f"declare {proposed}"


def _column_count(head: Head, separator: str) -> int:
    """Return how many cells most of the first lines have."""
    lines = [line for line in head.lines[:-1][:COUNTED_LINES] if line.strip()]
    counts = Counter(len(split_cells(line, separator)) for line in lines)
    return counts.most_common(1)[0][0] if lines else 0
