"""Formats that are known by their bytes and that nothing here reads, with what to do instead.

`FOREIGN_FORMATS` is the one table, and `foreign_format` looks a file up in it once no reader is sure of it, so that
every command says the same. A sign is what the format's own description demands of every file, so that no file bears
the name of a maker whose marks are not in it. What a program exports is from its maker's pages.

Magic numbers are of the descriptions that stand beside each row; of text, signs are the words that open it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.head import GZIP, Head

AS_TEXT = "export it as a table of text, whose `layout` a rig declares"
AS_LOG = "save it as candump or Vector ASC"
AS_TRACKS = "track its marks in ProAnalyst, DLTdv, Tracker, DeepLabCut or SLEAP, and give their export"
COMTRADE = "a COMTRADE record of a protection relay"
UNPACK = "unpack it, and give the files in it"
DOCUMENT = "it holds no samples"


def _anything(_head: Head) -> bool:
    return True


@dataclass(frozen=True)
class ForeignFormat:
    """A format that is not read.

    Attributes
    ----------
    name
        Name of the format as people know it, with its article: it ends the sentence that begins "this is".
    signs
        Regular expressions, as `Head.shows` takes them, one of which every file shows.
    remedy
        Action of the user: another export, or the ``layout`` that reads it.
    source
        Description of the format that the signs are from.
    holds
        Function that looks at what no pattern can.
    """

    name: str
    signs: tuple[bytes | str, ...]
    remedy: str
    source: str
    holds: Callable[[Head], bool] = _anything

    def is_of(self, head: Head) -> bool:
        """Whether a file is of this format."""
        return any(map(head.shows, self.signs)) and self.holds(head)


def _sum_is_right(head: Head) -> bool:
    """Whether the checksum of the first packet of a telemetry recorder holds: the sum of its first eleven words."""
    if len(head.content) < 24:
        return False
    *words, stated = struct.unpack("<12H", head.content[:24])
    return bool(sum(words) & 0xFFFF == stated)


def _wave_header_is_right(head: Head) -> bool:
    """Whether the words of an Igor wave's header add up to zero, as they must."""
    for order in "<>":
        version = struct.unpack(f"{order}h", head.content[:2])[0]
        size = {2: 126, 5: 384}.get(version, 0)
        if size and len(head.content) >= size:
            return not sum(struct.unpack(f"{order}{size // 2}h", head.content[:size])) & 0xFFFF
    return False


def _has_parameters(head: Head) -> bool:
    """Whether the parameter section of a motion capture begins where its first byte says, and names its processor."""
    at = (head.content[0] - 1) * 512 if head.content else -1
    return 0 < at + 4 <= len(head.content) and head.content[at + 3] in (84, 85, 86)


def _is_catman(head: Head) -> bool:
    """Whether the offset of a catman file's data lies behind its header, whose comment is text."""
    if len(head.content) < 8:
        return False
    _, offset, length = struct.unpack("<hih", head.content[:8])
    comment = head.content[8 : 8 + max(length, 0)]
    return 200 < offset < 1 << 28 and 0 <= length < 4096 and b"\0" not in comment


def _is_edf(head: Head) -> bool:
    """Whether the header's own size is what its number of signals makes it: 256 bytes, and 256 for each."""
    size, signals = head.content[184:192].strip(), head.content[252:256].strip()
    return size.isdigit() and signals.isdigit() and int(size) == 256 * (int(signals) + 1)


FOREIGN_FORMATS: tuple[ForeignFormat, ...] = (
    # recorders
    ForeignFormat(
        "an imc FAMOS file",
        (rb"\|CF,\d,1,\d;\s*\|CK,1,",),
        "export it as MATLAB, or as ASCII, whose `layout` a rig declares",
        "imc, FAMOS file format: the key CF opens a file, CK follows",
    ),
    ForeignFormat(
        "an HBM catman file",
        (rb"[\x92-\x94]\x13",),
        "export it in catman as MDF 4, UFF 58 or MATLAB",
        "HBM, catman file format: the identifiers 5010 to 5012, then where data begin, then a comment",
        _is_catman,
    ),
    ForeignFormat(
        "a SoMat SIE file",
        (rb"(?s).{4}\0\0\0\0\x51\xed\xa7\xa0",),
        "export it in nCode or catman as UFF 58, MATLAB or text",
        "HBM, The SIE Format: size, group 0 and the synchronisation word of the first block",
    ),
    ForeignFormat(
        "an NI DIAdem header (DAT)",
        (r"(?m)\A\s*DIAEXTENDED|^#BEGINGLOBALHEADER",),
        "save it in DIAdem as TDMS",
        "NI, Structure of DAT files",
    ),
    ForeignFormat(
        "an NI TDM header",
        (r"\A\s*(<\?xml[^>]*>)?\s*<usi:tdm\b",),
        "save it in DIAdem or LabVIEW as TDMS",
        "NI, TDM header file, namespace usi",
    ),
    ForeignFormat(
        "an IRIG 106 Chapter 10 recording",
        (rb"\x25\xeb",),
        f"take its channels out with the range's tools, and {AS_TEXT}",
        "IRIG 106-22, chapter 11, packet header: synchronisation EB25, checksum over eleven words",
        _sum_is_right,
    ),
    ForeignFormat(
        "an enDAQ recording (IDE)",
        (rb"(?s)\x1a\x45\xdf\xa3.{0,60}\x42\x82\x84mide",),
        "export it in enDAQ Lab as MATLAB or text, whose `layout` a rig declares",
        "RFC 8794 (EBML), document type mide",
    ),
    ForeignFormat(
        "a Gantner UDBF file",
        (rb"(?s).{0,8}UniversalDataBinFile",),
        f"in GI.bench, {AS_TEXT}",
        "Gantner, Universal Data Bin File Format",
    ),
    ForeignFormat(
        "an MTS RPC III file",
        (rb"(?s)FORMAT\0.{25}(BINARY|ASCII)",),
        f"save it as UFF 58, or {AS_TEXT}",
        "MTS, RPC III file format: records of a key of 32 and a value of 96 bytes, the first of them FORMAT",
    ),
    ForeignFormat(
        "an EDF file",
        (rb"0 {7}.{80}",),
        AS_TEXT,
        "Kemp et al., A simple format for exchange of digitized polygraphic "
        "recordings, 1992: the version, and sizes that agree",
        _is_edf,
    ),
    ForeignFormat(
        "a BDF file",
        (rb"\xffBIOSEMI",),
        AS_TEXT,
        "BioSemi, BDF file format",
        _is_edf,
    ),
    ForeignFormat(
        "an ISO-MME test or channel",
        (r"\A\ufeff?(Data format edition number|Test object number)\s*:",),
        f"a channel is one column without its time: {AS_TEXT}, all channels beside a column of time",
        "ISO/TS 13499, multimedia data exchange format",
    ),
    ForeignFormat(
        "a Campbell Scientific TOA5 table",
        (r'\A"?TOA5"?,',),
        "declare `layout` of its source: header_row 2, unit_row 3, first_row 5, time_column TIMESTAMP",
        "Campbell Scientific, LoggerNet manual, appendix B: four lines of header",
    ),
    ForeignFormat(
        "a Campbell Scientific TOB file",
        (rb'"TOB[123]"',),
        "convert it with CardConvert to TOA5, whose `layout` a rig declares",
        "Campbell Scientific, LoggerNet manual, appendix B",
    ),
    ForeignFormat(
        "an ASAM ODS ATFX file",
        (r"\A\s*(<\?xml[^>]*>)?\s*<atfx_file\b",),
        "export it as MDF 4",
        "ASAM ODS, ATF in XML",
    ),
    ForeignFormat(
        "an Igor binary wave",
        (rb"[\x02\x05]\x00|\x00[\x02\x05]",),
        f"save it in Igor Pro as HDF5, or {AS_TEXT}",
        "WaveMetrics, Technical Note PTN003: version, and a checksum that makes the header's words add to zero",
        _wave_header_is_right,
    ),
    ForeignFormat(
        "an Igor text wave",
        (r"\AIGOR\s",),
        f"save it in Igor Pro as HDF5, or {AS_TEXT}",
        "WaveMetrics, PTN003",
    ),
    ForeignFormat(
        "a SEG-2 file",
        (rb"\x55\x3a[\x01\x02]\0|\x3a\x55\0[\x01\x02]",),
        AS_TEXT,
        "SEG-2, Pullan 1990: file descriptor block 3A55 and its revision",
    ),
    ForeignFormat(
        "a miniSEED file",
        (rb"\d{6}[DRQM][ \0][A-Z0-9 ]{12}|MS\x03",),
        AS_TEXT,
        "FDSN, SEED 2.4 and miniSEED 3",
    ),
    ForeignFormat(
        "a netCDF 3 file",
        (rb"CDF[\x01\x02\x05]",),
        "convert it with `nccopy -k nc4`: that is HDF5",
        "Unidata, NetCDF Classic Format Specification",
    ),
    ForeignFormat(
        "an Origin project",
        (rb"CPYU?A \d",),
        AS_TEXT,
        "OriginLab, project files begin with CPYA and their version",
    ),
    # oscilloscopes
    ForeignFormat(
        "a Tektronix ISF file",
        (rb":?(WFMP(RE)?|WFMO(UTPRE)?|CURVE?)[: ]",),
        "save the waveform as a spreadsheet (CSV)",
        "Tektronix, programmer manuals: WFMOutpre and CURVe",
    ),
    ForeignFormat(
        "a Tektronix WFM file",
        (rb"(\x0f\x0f|\xf0\xf0):?WFM#00\d",),
        "save the waveform as a spreadsheet (CSV)",
        "Tektronix 077-0220, Performance Oscilloscope Reference Waveform File Format",
    ),
    ForeignFormat(
        "a Keysight or Agilent BIN file",
        (rb"AG(01|03|10)",),
        "save the waveform as CSV",
        "Keysight, InfiniiVision user's guide, Binary data (.bin) format: cookie AG and version",
    ),
    ForeignFormat(
        "a LeCroy TRC file",
        (rb"(?s)(#\d\d{1,9})?WAVEDESC\0",),
        "save the waveform as ASCII",
        "LeCroy, remote control manual, template LECROY_2_3",
    ),
    ForeignFormat(
        "a Rigol WFM or BIN file",
        (rb"\xa5\xa5(\0\0|\x38\0)|\xa1\xa5\0\0|RG0[13]",),
        "save the waveform as CSV",
        "Rigol, DS1000 to DS2000 and MSO5000 files, as scottprahl/RigolWFM describes them",
    ),
    ForeignFormat(
        "a Yokogawa waveform header (HDR, WDF)",
        (rb"(?s).{0,4000}//YOKOGAWA ASCII FILE FORMAT",),
        "save the waveform as ASCII (CSV) on the instrument or with its viewer",
        "Yokogawa, DL850E user's manual, appendix: ASCII header file format",
    ),
    # buses
    ForeignFormat(
        "a SavvyCAN log (GVRET)",
        (r"\A\s*Time Stamp,ID,Extended,(Dir,)?Bus,LEN",),
        AS_LOG,
        "collin80/SavvyCAN, framefileio.cpp, native CSV",
    ),
    ForeignFormat(
        "an OVMS log (CRTD)",
        (r"\A(\d+\.\d+ \d?C[A-Z]{2} [^\n]*\n)*\d+\.\d+ \d?(R11|R29|T11|T29) [0-9A-Fa-f]+", r"\A\d+\.\d+ \d?CXX "),
        AS_LOG,
        "OVMS v3 developer's guide, CRTD log format",
    ),
    ForeignFormat(
        "a BUSMASTER log",
        (r"\A\s*-?\*\*\*BUSMASTER Ver",),
        "convert it with BUSMASTER to Vector ASC",
        "rbei-etas/busmaster, LogObjectCAN.cpp",
    ),
    ForeignFormat(
        "a Microchip CAN BUS Analyzer log",
        (r"\A//-+\s*\n\s*Microchip Technology Inc\.\s*\n\s*CAN ?BUS Analyzer",),
        "convert it with SavvyCAN to candump or Vector ASC",
        "collin80/SavvyCAN, framefileio.cpp, Microchip",
    ),
    ForeignFormat(
        "a CARBUS Analyzer log",
        (r"(?i)\A@ TEXT @",),
        "convert it with SavvyCAN to candump or Vector ASC",
        "collin80/SavvyCAN, framefileio.cpp, CARBUS Analyzer",
    ),
    ForeignFormat(
        "an IXXAT trace",
        (r"(?i)\A[^\n]*\bIXXAT\b",),
        "convert it with SavvyCAN to candump or Vector ASC",
        "collin80/SavvyCAN, framefileio.cpp, IXXAT",
    ),
    ForeignFormat(
        "a Kvaser listing",
        (r"\A\s*Chn\s+Identifier\s+Flg\s+DLC\s+D0",),
        "save it in CanKing or Kvaser's converter as Vector ASC, BLF or MDF 4",
        "collin80/SavvyCAN, framefileio.cpp, Kvaser",
    ),
    ForeignFormat(
        "a CSS Electronics CLX000 log",
        (r"\A# Logger type: CL",),
        "convert it with the maker's tools to MDF 4",
        "CSS Electronics, CLX000 documentation, log file",
    ),
    ForeignFormat(
        "a packet capture (pcap)",
        (
            rb"\xa1\xb2(\xc3\xd4|\x3c\x4d)|(\xd4\xc3|\x4d\x3c)\xb2\xa1",
            rb"(?s)\x0a\x0d\x0d\x0a.{4}(\x1a\x2b\x3c\x4d|\x4d\x3c\x2b\x1a)",
        ),
        "of a CAN bus: record it with candump -l, or convert it to that",
        "IETF draft-ietf-opsawg-pcap and pcapng",
    ),
    ForeignFormat(
        "a ROS bag",
        (rb"#ROSBAG V\d",),
        f"from its topics, {AS_TEXT}",
        "ROS wiki, Bags/Format/2.0",
    ),
    ForeignFormat(
        "an MCAP file",
        (rb"\x89MCAP0\r\n",),
        f"from its topics, {AS_TEXT}",
        "mcap.dev, MCAP format specification",
    ),
    ForeignFormat(
        "a PX4 ULog file",
        (rb"ULog\x01\x12\x35",),
        "convert it with ulog2csv, and declare `layout`",
        "PX4, ULog file format",
    ),
    ForeignFormat(
        "an ArduPilot DataFlash log",
        (rb"\xa3\x95\x80\x80",),
        "convert it with mavlogdump to CSV, and declare `layout`",
        "ArduPilot, DataFlash log: head A395, message FMT, which describes itself first",
    ),
    # cameras
    ForeignFormat(
        "a Photron header of a video (CIH)",
        (r"\A#Camera Information Header", rb"(?s).{0,2048}<cih\b"),
        f"it describes a video, whose Record Rate is `frame_rate` of the camera's source; {AS_TRACKS}",
        "Photron, FASTCAM Viewer manual, CIH and CIHX",
    ),
    ForeignFormat(
        "a Phantom cine video",
        (rb"CI\x2c\0[\0-\x02]\0[\0\x01]\0",),
        AS_TRACKS,
        "Vision Research, Cine file format: type CI, header of 44 bytes, compression, version",
    ),
    ForeignFormat(
        "a video",
        (
            rb"(?s)RIFF.{4}AVI |.{4}(ftyp|moov|mdat)",
            rb"(?s)\x1a\x45\xdf\xa3.{0,60}\x42\x82[\x84-\x88](webm|matroska)",
        ),
        AS_TRACKS,
        "AVI, ISO 14496-12 and RFC 9559",
    ),
    ForeignFormat(
        "a picture",
        (rb"\x89PNG\r\n\x1a\n|\xff\xd8\xff|II\*\0|MM\0\*|GIF8[79]a|BM.{8}[\x36\x7a\x8a]\0\0\0",),
        AS_TRACKS,
        "PNG, JPEG, TIFF 6.0, GIF, BMP",
    ),
    ForeignFormat(
        "a C3D motion capture",
        (rb"[\x01-\x80]\x50",),
        f"{AS_TEXT}: a marker's coordinates beside the time",
        "c3d.org, user guide: key 50, and the processor in the parameter section",
        _has_parameters,
    ),
    ForeignFormat(
        "a motion capture table (TRC)",
        (r"\APathFileType\t\d",),
        "declare `layout` of the camera's source: names in line 4, rows from line 6 or 7 on",
        "OpenSim, Marker (.trc) files",
    ),
    ForeignFormat(
        "a Tracker or Kinovea project",
        (
            r"<object class=.org\.opensourcephysics\.cabrillo\.tracker",
            r"<KinoveaVideoAnalysis",
        ),
        "export the points as a table of text",
        "physlets.org/tracker and kinovea.org, project files are XML",
    ),
    # programs
    ForeignFormat(
        COMTRADE,
        (r"\A[^\n]*\n\s*\d+\s*,\s*\d+\s*[Aa]\s*,\s*\d+\s*[Dd]\s*\n", r"(?i)\A--- file type: CFG"),
        "export it as a table of text under `Time (s)` and `name (unit)`",
        "IEEE C37.111: the second line counts all channels, the analog and the digital ones",
    ),
    ForeignFormat(
        "a RIFX file of a big-endian program's sound samples",
        (rb"RIFX",),
        "export it as WAV, which begins with RIFF",
        "Microsoft and IBM, Multimedia Programming Interface, 1991",
    ),
    ForeignFormat(
        "an Arrow or Feather table",
        (rb"ARROW1\0\0|FEA1",),
        f"save it as HDF5, or {AS_TEXT}",
        "Apache Arrow, IPC format",
    ),
    ForeignFormat(
        "a NumPy array",
        (rb"\x93NUMPY", rb"(?s)PK\x03\x04.{26}[^/\0]{1,200}\.npy"),
        "save it with scipy.io.savemat as MATLAB, the time beside the channels, or with h5py as HDF5",
        "NumPy, NEP 1, and archives of such files",
    ),
    ForeignFormat(
        "an SQLite database",
        (rb"SQLite format 3\0",),
        f"from its tables, {AS_TEXT}",
        "SQLite, database file format",
    ),
    ForeignFormat(
        "an OpenDocument file",
        (rb"(?s)PK\x03\x04.{26}mimetypeapplication/vnd\.oasis",),
        "save the sheet as CSV, and declare its `layout`",
        "OASIS OpenDocument 1.3, part 2",
    ),
    ForeignFormat(
        "an OLE document such as a workbook of Excel before 2007",
        (rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",),
        "save the sheet as CSV, and declare its `layout`",
        "Microsoft, MS-CFB",
    ),
    ForeignFormat(
        "a packed archive",
        (
            rb"PK(\x03\x04|\x05\x06)|7z\xbc\xaf\x27\x1c|Rar!\x1a\x07|\xfd7zXZ\0",
            rb"BZh\d1AY&SY|\x28\xb5\x2f\xfd",
            GZIP,
        ),
        UNPACK,
        "ZIP, 7z, RAR, xz, bzip2, Zstandard (RFC 8878) and gzip (RFC 1952)",
    ),
    ForeignFormat("a PDF", (rb"%PDF-",), DOCUMENT, "ISO 32000"),
    ForeignFormat(
        "a web page or another XML document", (r"(?i)\A\s*(<!DOCTYPE|<html|<\?xml)",), DOCUMENT, "W3C, HTML and XML 1.0"
    ),
    ForeignFormat(
        "a JSON document",
        (r'\A\s*[\[{]\s*("[^"\n]*"\s*:|\{|\[|\]|\})',),
        DOCUMENT,
        "RFC 8259",
    ),
)
"""Formats that are not read; the first one whose sign a file shows names it, so that the general ones stand last."""


def foreign_format(head: Head) -> ForeignFormat | None:
    """Return the format of a file that is not read; None if it is not known either."""
    found = next((one for one in FOREIGN_FORMATS if one.is_of(head)), None)
    return found or _beside(head)


def _beside(head: Head) -> ForeignFormat | None:
    """Return the format of a file whose description lies beside it: the samples of a COMTRADE record."""
    described = next(one for one in FOREIGN_FORMATS if one.name == COMTRADE)
    for suffix in (".cfg", ".CFG"):
        try:
            if head.path.suffix and described.is_of(Head.of(head.path.with_suffix(suffix))):
                return described
        except ReadError:
            continue
    return None
