"""Captures of live acquisition: ranges of a log, in which several sources may be."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import FileEnd, ReadError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.readers.captured import CapturedSource, sources_of
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording


class CaptureReader:
    """Reader of captures: of the source that the declarations name, or of the only one of their kind."""

    name = "recoil-daq capture"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open one source of a capture.

        Raises
        ------
        ReadError
            If the capture does not hold the source, is damaged, or what decodes it is not declared.
        """
        source = _chosen(path, sources_of(read_capture(path)), declared)
        kind = source.live_kind
        if kind is None or (source.device and kind.key != source.device):
            raise ReadError(
                f"what {source.name!r} delivered cannot be decoded",
                path=path,
                found=f"a {source.kind} source that was read live by `{source.device}`",
                remedy="install the package that reads such devices",
            )
        recording: Recording = kind.load("capture")(path, source, declared)
        return recording


def _chosen(path: Path, sources: tuple[CapturedSource, ...], declared: Declarations) -> CapturedSource:
    named = [source for source in sources if source.name == declared.clock]
    fitting = named or [source for source in sources if source.delivered and _decoded_by(source, declared)]
    if len(fitting) != 1:
        raise ReadError(
            f"which source of this capture is meant is not known: {declared.clock!r} is none of them",
            path=path,
            expected=", ".join(f"{source.name} ({source.kind})" for source in sources) or "a session that says so",
            remedy="name the rig that it was acquired on",
            file_end=FileEnd.THERE if sources else FileEnd.UNCLEAR,
        )
    return fitting[0]


def _decoded_by(source: CapturedSource, declared: Declarations) -> bool:
    """Return whether a rig declares what decodes a source of this kind."""
    kind = source.live_kind
    return kind is not None and bool(kind.declared) and getattr(declared, kind.declared) is not None
