"""Beginnings of files of formats that nothing here reads, made from what their descriptions demand."""

from __future__ import annotations

import gzip
import io
import struct
import zipfile

import numpy as np


def telemetry_packet() -> bytes:
    """Return a packet of IRIG 106 chapter 10: twelve words of header, of which the last is the sum of the others."""
    words = struct.pack("<HHIIBBBB", 0xEB25, 1, 48, 24, 6, 0, 0, 0x11) + bytes(6)
    return words + struct.pack("<H", sum(struct.unpack("<11H", words)) & 0xFFFF) + bytes(24)


def igor_wave() -> bytes:
    """Return the header of a binary wave of version 5, whose 192 words add up to zero."""
    head = bytearray(struct.pack("<hh", 5, 0) + struct.pack("<i", 320) + bytes(376))
    struct.pack_into("<h", head, 2, -((5 + 320) & 0x7FFF))
    return bytes(head) + bytes(32)


def captured_motion() -> bytes:
    """Return a C3D file: 512 bytes of header, whose first byte says where the parameters begin."""
    return b"\x02\x50" + bytes(510) + b"\x01\x50\x02\x54" + bytes(508)


def catman_recording() -> bytes:
    """Return the head of a catman file: identifier, offset of the data, a comment, and texts of two bytes' length."""
    comment = b"stand 3"
    return struct.pack("<hih", 5012, 2000, len(comment)) + comment + bytes(1983)


def edf(version: bytes = b"0       ") -> bytes:
    """Return the header of an EDF file of two signals."""
    return version + b"X" * 160 + b"16.09.1116.09.11" + b"768     " + b" " * 44 + b"10      1       2   " + b" " * 512


def archive(name: str, content: bytes = b"x") -> bytes:
    """Return a ZIP archive of one file, which is not packed."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as packed:
        packed.writestr(name, content)
    return buffer.getvalue()


def _arrays() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, acc=np.arange(4.0))
    return buffer.getvalue()


EBML = b"\x1a\x45\xdf\xa3\x9f\x42\x86\x81\x01\x42\xf7\x81\x01\x42\xf2\x81\x04\x42\xf3\x81\x08"

FOREIGN_FILES: dict[str, tuple[bytes, ...]] = {
    "a CAN database": (
        b'VERSION ""\r\n\r\nNS_ :\r\n\tCM_\r\n\r\nBS_:\r\n\r\nBU_: Node\r\n\r\nBO_ 256 m: 8 Node\r\n',
        b'FormatVersion=6.0 // Do not edit this line!\r\nTitle="bus"\r\n',
        b"<NetworkDefinition xmlns='http://kayak.2codeornot2code.org/1.0'>",
        b'<?xml version="1.0" encoding="UTF-8"?>\n<AUTOSAR xmlns="http://autosar.org/schema/r4.0">',
    ),
    "an imc FAMOS file": (
        b"|CF,2,1,1;|CK,1,3,1,1;|NO,1,10,0,0,0,0,0;|CG,1,5,1,1,1;",
        b"|CF,2,1,1;\r\n|CK,1,3,1,1;\r\n|NO,1,12,1,5,Famos,0,;\r\n",
    ),
    "an HBM catman file": (catman_recording(),),
    "a SoMat SIE file": (b"\0\0\x01\x00" + bytes(4) + b"\x51\xed\xa7\xa0<?xml version='1.0'?>",),
    "an NI DIAdem header (DAT)": (b"DIAEXTENDED  {@:ENGLISH\r\n\r\n#BEGINGLOBALHEADER\r\n  1,WINDOWS 32Bit\r\n",),
    "an NI TDM header": (
        b'<?xml version="1.0" encoding="UTF-8"?>\n<usi:tdm xmlns:usi="http://www.ni.com/Schemas/USI/1_0">',
    ),
    "an IRIG 106 Chapter 10 recording": (telemetry_packet(),),
    "an enDAQ recording (IDE)": (EBML + b"\x42\x82\x84mide" + bytes(60),),
    "a Gantner UDBF file": (b"\x01\x6b\x00\x15\x00UniversalDataBinFile - GANTNER instruments\0",),
    "an MTS RPC III file": (b"FORMAT".ljust(32, b"\0") + b"BINARY_IEEE_LITTLE_END".ljust(96, b"\0"),),
    "an EDF file": (edf(),),
    "a BDF file": (edf(b"\xffBIOSEMI"),),
    "an ISO-MME test or channel": (
        b"Data format edition number  :1.6\r\nLaboratory name             :range\r\n",
        b"Test object number          :1\r\nName of the channel         :acc\r\n",
    ),
    "a Campbell Scientific TOA5 table": (
        b'"TOA5","stand","CR1000","1","CR1000.Std","CPU:a.CR1","1","Fast"\r\n"TIMESTAMP","acc"\r\n',
    ),
    "a Campbell Scientific TOB file": (b'"TOB1","stand","CR1000","1","CR1000.Std"\r\n',),
    "an ASAM ODS ATFX file": (b'<?xml version="1.0"?>\n<atfx_file xmlns="http://www.asam.net/ODS/5">',),
    "an Igor binary wave": (igor_wave(),),
    "an Igor text wave": (b"IGOR\rWAVES/D acc\rBEGIN\r\t0.1\r\t0.2\rEND\r",),
    "a SEG-2 file": (b"\x55\x3a\x01\x00\x00\x01\x04\x00" + bytes(24),),
    "a miniSEED file": (b"000001D XSTND 00BHZNN" + bytes(40), b"MS\x03\x00" + bytes(60)),
    "a netCDF 3 file": (b"CDF\x01" + bytes(28),),
    "an Origin project": (b"CPYA 4.2673 552#\n" + bytes(40),),
    "a Tektronix ISF file": (b":WFMPRE:BYT_NR 2;BIT_NR 16;ENC BIN;:CURVE #520000" + bytes(40), b"WFMO:BYT_N 1;"),
    "a Tektronix WFM file": (b"\x0f\x0f:WFM#003\x07" + bytes(40),),
    "a Keysight or Agilent BIN file": (b"AG10" + struct.pack("<II", 152, 1) + bytes(40),),
    "a LeCroy TRC file": (b"#9000200144WAVEDESC\0\0\0\0\0\0\0\0LECROY_2_3" + bytes(40), b"WAVEDESC\0\0\0\0"),
    "a Rigol WFM or BIN file": (b"\xa5\xa5\0\0" + bytes(60), b"RG03" + bytes(60)),
    "a Yokogawa waveform header (HDR, WDF)": (
        b"//YOKOGAWA ASCII FILE FORMAT\r\n\r\n$PublicInfo\r\nFormatVersion  1.01\r\nModel  DL750\r\n",
        bytes(200) + b"//YOKOGAWA ASCII FILE FORMAT\r\n",
    ),
    "a SavvyCAN log (GVRET)": (
        b"Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n4335546,000000FD,false,Rx,0,2,A5,D5,\n",
        b"Time Stamp,ID,Extended,Bus,LEN,D1,D2\n10,00000100,false,0,2,01,02,\n",
    ),
    "an OVMS log (CRTD)": (
        b"1524311386.811100 1CXX Info Type:crtd\n1524311386.811100 1R11 100 01 02 03\n",
        b"1320745424.000 R11 402 FA 01 C3\n1320745424.002 R11 400 02\n",
    ),
    "a BUSMASTER log": (b"***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n***NOTE: PLEASE DO NOT EDIT***\n",),
    "a Microchip CAN BUS Analyzer log": (
        b"//---------------------------------\nMicrochip Technology Inc.\nCAN BUS Analyzer\n10;RX;0x100;1;0x01;\n",
    ),
    "a CARBUS Analyzer log": (b"@ TEXT @ 3 @ 0 @ 20 @ 0 @ 0 @\r\n10;0;00000000;100;2;0102\r\n",),
    "an IXXAT trace": (b"ASCII Trace IXXAT Automation GmbH  V1.7\nDate: 8.8.2014\n",),
    "a Kvaser listing": (b"Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir\n",),
    "a CSS Electronics CLX000 log": (b"# Logger type: CL2000\n# HW rev: 6.3x\n# FW rev: 5.87\n",),
    "a packet capture (pcap)": (
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227),
        struct.pack(">IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 227),
        struct.pack("<III", 0x0A0D0D0A, 28, 0x1A2B3C4D) + bytes(16),
    ),
    "a ROS bag": (b"#ROSBAG V2.0\n" + bytes(40),),
    "an MCAP file": (b"\x89MCAP0\r\n" + bytes(40),),
    "a PX4 ULog file": (b"ULog\x01\x12\x35\x01" + bytes(40),),
    "an ArduPilot DataFlash log": (b"\xa3\x95\x80\x80\x59FMT\0BBnNZ\0" + bytes(80),),
    "a Photron header of a video (CIH)": (
        b"#Camera Information Header\r\nDate : 2026/11/26\r\nRecord Rate(fps) : 6000\r\n",
        b"cihx\x10\x00" + bytes(8) + b"<cih>\n<recordInfo>",
    ),
    "a Phantom cine video": (b"CI\x2c\x00\x00\x00\x01\x00" + bytes(40),),
    "a video": (
        b"RIFF\x00\x10\x00\x00AVI LIST" + bytes(40),
        b"\x00\x00\x00\x18ftypisom" + bytes(40),
        EBML + b"\x42\x82\x88matroska" + bytes(40),
    ),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(40), b"\xff\xd8\xff\xe0" + bytes(40), b"II*\0" + bytes(40)),
    "a C3D motion capture": (captured_motion(),),
    "a motion capture table (TRC)": (b"PathFileType\t4\t(X/Y/Z)\tshot.trc\nDataRate\tCameraRate\n",),
    "a Tracker or Kinovea project": (
        b'<?xml version="1.0" encoding="UTF-8"?>\n<object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">',
        b'<?xml version="1.0" encoding="utf-8"?>\n<KinoveaVideoAnalysis>\n',
    ),
    "a COMTRADE record of a protection relay": (
        b"STATION,DEVICE,2013\r\n6, 4A,2D\r\n1,IA ,,Line, A,0.1,0.05,0,-32768,32767,933,1,s\r\n",
        b"--- file type: CFG ---\r\nSTATION,DEVICE,2013\r\n",
    ),
    "a RIFX file of a big-endian program's sound samples": (b"RIFX\0\0\0\x24WAVEfmt " + bytes(28),),
    "an Arrow or Feather table": (b"ARROW1\0\0" + bytes(40), b"FEA1" + bytes(40)),
    "an archive of NumPy arrays": (_arrays(),),
    "an SQLite database": (b"SQLite format 3\0\x10\x00" + bytes(82),),
    "an OpenDocument file": (archive("mimetype", b"application/vnd.oasis.opendocument.spreadsheet"),),
    "an OLE document such as a workbook of Excel before 2007": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500),),
    "a packed archive": (archive("a.csv"), gzip.compress(bytes(range(256))), b"7z\xbc\xaf\x27\x1c\0\4" + bytes(30)),
    "a PDF": (b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n",),
    "a web page or another XML document": (
        b"<!DOCTYPE html><html><body>not found</body></html>",
        b'<?xml version="1.0"?>\n<a/>',
    ),
    "a JSON document": (b'{"mass": {"value": 782.0}}', b'[\n  {"a": 1}\n]'),
}
"""Name of each format -> beginnings of its files."""
