"""Captures of live acquisition: ranges of a log, in which several sources may be."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import FileEnd, ReadError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.readers.can.capture import open_bus
from recoil_acquisition.readers.captured import LIVE, CapturedSource, sources_of
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.serial.capture import open_port


class CaptureReader:
    """Reader of captures: of the source that the declarations name, or of the only one of their kind."""

    name = "recoil-daq capture"
    kind = LIVE
    suffixes = (".rdlog",)

    def claims(self, head: Head) -> Claim:
        """Say that a capture is certain: the table asks where a record's mark was found."""
        del head
        return Claim.CERTAIN

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open one source of a capture.

        Raises
        ------
        ReadError
            If the capture does not hold the source, is damaged, or what decodes it is not declared.
        """
        source = _chosen(path, sources_of(read_capture(path)), declared)
        if source.kind == "can":
            return open_bus(path, source, declared)
        return open_port(path, source, declared)


def _chosen(path: Path, sources: tuple[CapturedSource, ...], declared: Declarations) -> CapturedSource:
    named = [source for source in sources if source.name == declared.clock]
    kinds = [kind for kind, given in (("can", declared.database), ("serial", declared.framing)) if given is not None]
    fitting = named or [source for source in sources if source.kind in kinds and source.delivered]
    if len(fitting) != 1:
        raise ReadError(
            f"which source of this capture is meant is not known: {declared.clock!r} is none of them",
            path=path,
            expected=", ".join(f"{source.name} ({source.kind})" for source in sources) or "a session that says so",
            remedy="name the rig that it was acquired on",
            file_end=FileEnd.THERE if sources else FileEnd.UNCLEAR,
        )
    return fitting[0]
