"""Plain files of what a serial port delivered."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import ReadError, system_errors_as
from recoil_acquisition.frames.scan import PortStream
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.captured_port import declared_framing, serial_recording


class SerialBytesReader:
    """Reader of plain files of what a port delivered, without host times."""

    name = "serial bytes"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a plain file of bytes.

        Raises
        ------
        ReadError
            If no framing is declared or it is faulty, or nothing dates the frames.
        CorruptFileError
            If not one frame is found.
        """
        framing = declared_framing(declared, path)
        with system_errors_as(ReadError, path, "read"):
            port = PortStream.plain(path.read_bytes())
        return serial_recording(path, self.name, port, framing, declared.clock)
