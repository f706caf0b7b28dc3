"""SLEAP's analysis file, HDF5.

Datasets ``tracks`` (coordinates in pixels, float64, NaN where nothing was found), ``track_names``, ``node_names``,
and, where there are scores, ``point_scores``. SLEAP itself and the default of sleap-io write axes (track, xy, node,
frame); sleap-io writes other orders too and names them in the attribute ``dims``, a JSON list. Frames are counted
from 0, the centre of the first pixel is 0, and the file has no time. Source: sleap-io documentation, "Analysis HDF5
format", and SLEAP, ``sleap.info.write_tracking_h5``.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.hdf5.attributes import plain_attributes
from recoil_acquisition.readers.hdf5.kind import is_in_file, is_sleap_file, names_beyond_head
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.tracks.columns import Column
from recoil_acquisition.readers.tracks.frame_time import counted_clock
from recoil_acquisition.readers.tracks.recording import TrackTable, track_recording

DIMS = ("track", "xy", "node", "frame")
"""Axes of ``tracks`` where the file does not name them."""

LEAST_BOUND = 1 << 26
"""Bytes that are read in any case: lost positions compress to nothing."""

BOUND = 10
"""Times the file's size that is read of a larger one."""

MOST_NAMES = 4096
"""Names of tracks, or of nodes, at most."""

MOST_NAME_BYTES = 1 << 20


class SleapAnalysisReader:
    """Reader of SLEAP's analysis HDF5."""

    name = "SLEAP analysis"

    def claims(self, head: Head) -> Claim:
        """Be certain of names of nodes and tracks, which may stand behind the first bytes."""
        named = b"node_names" in head.content and b"track_names" in head.content
        return Claim.CERTAIN if named or (names_beyond_head(head.content) and is_sleap_file(head.path)) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an analysis file.

        Raises
        ------
        ReadError
            If it cannot be read, is too large for its size, or no frame rate is declared.
        CorruptFileError
            If it is damaged, or its datasets contradict each other.
        """
        import h5py

        try:
            size = path.stat().st_size
            with h5py.File(path, "r", locking=False) as file:
                return track_recording(_table(file, path, size, declared, self.name), declared)
        except ReadError:
            raise
        except FileNotFoundError as error:
            raise ReadError("no such file", path=path, remedy="check the name and the folder") from error
        except Exception as error:  # HDF5 raises whatever its C library meets
            raise CorruptFileError(
                f"is not a readable HDF5 file: {str(error).splitlines()[0] if str(error) else type(error).__name__}",
                path=path,
                remedy="copy or export it again",
            ) from error


def _table(file: Any, path: Path, size: int, declared: Declarations, reader: str) -> TrackTable:
    missing = [name for name in ("tracks", "track_names", "node_names") if not is_in_file(file, name)]
    if missing:
        raise ReadError(
            "this HDF5 file is no analysis of SLEAP",
            path=path,
            expected="datasets tracks, track_names, node_names",
            found=", ".join(sorted(file))[:120] or "an empty file",
            remedy="leave it out, or export the tracks as text",
        )
    tracks, nodes = _names(file, "track_names", path), _names(file, "node_names", path)
    positions = _axes(file, "tracks", DIMS, ("frame", "track", "node", "xy"), path, size)
    count = positions.shape[0]
    expected = (count, max(len(tracks), 1), len(nodes), 2)
    if positions.shape != expected or not count:
        raise CorruptFileError(
            "the positions do not fit the names of tracks and nodes",
            path=path,
            place="tracks",
            expected=f"{len(tracks)} tracks, {len(nodes)} nodes, x and y",
            found=f"{positions.shape[1]}, {positions.shape[2]}, {positions.shape[3]} and {count} frames",
            remedy="export it again",
        )
    parts = [positions]
    if is_in_file(file, "point_scores"):
        dims = tuple(d for d in DIMS if d != "xy")
        scores = _axes(file, "point_scores", dims, ("frame", "track", "node"), path, size)
        if scores.shape == expected[:3]:
            parts.append(scores[..., np.newaxis])
    kinds = ("x", "y", "score")[: 1 + len(parts)]
    columns = []
    for track in tracks or [""]:
        for node in nodes:
            feature = f"{track} {node}" if len(tracks) > 1 else node
            for kind in kinds:
                at = ("score", "", "") if kind == "score" else ("position", "px", kind.upper())
                columns.append(Column(at[0], f"{feature}.{kind}", at[1], feature, at[2]))
    values = np.concatenate(parts, axis=-1).reshape(count, -1)
    values[~np.isfinite(values)] = np.nan
    clock = counted_clock(np.arange(count, dtype=np.int64), declared.frame_rate_hz, path)
    metadata = {
        "tracks": tracks, "nodes": nodes, "first_pixel": 0,
        "attributes": plain_attributes(file) | plain_attributes(file["tracks"]),
    }  # fmt: skip
    return TrackTable(path, reader, tuple(columns), values, clock, metadata)


def _dataset(file: Any, name: str, path: Path) -> Any:
    import h5py

    dataset = file.get(name)
    if not isinstance(dataset, h5py.Dataset) or dataset.is_virtual or dataset.external:
        raise CorruptFileError(f"there is no dataset {name!r} in the file itself", path=path, remedy="export it again")
    return dataset


def _names(file: Any, name: str, path: Path) -> list[str]:
    dataset = _dataset(file, name, path)
    if (
        dataset.size is None
        or dataset.size > MOST_NAMES
        or dataset.dtype.kind not in "OS"
        or _chunk_bytes(dataset) > MOST_NAME_BYTES
        or dataset.dtype.itemsize * dataset.size > MOST_NAME_BYTES
    ):
        raise CorruptFileError(f"dataset {name!r} holds no names", path=path, expected=f"at most {MOST_NAMES} texts")
    return [n.decode("utf-8", errors="replace") if isinstance(n, bytes) else str(n) for n in dataset[()].ravel()]


def _chunk_bytes(dataset: Any) -> int:
    return math.prod(dataset.chunks or ()) * int(dataset.dtype.itemsize)


def _axes(
    file: Any, name: str, usual: tuple[str, ...], wanted: tuple[str, ...], path: Path, size: int
) -> NDArray[np.float64]:
    """Read a dataset with its axes in the wanted order, after checking how large it is."""
    dataset = _dataset(file, name, path)
    dims = usual
    if "dims" in dataset.attrs:
        text = dataset.attrs["dims"]
        dims = tuple(json.loads(text if isinstance(text, str | bytes) else str(text)))
    if sorted(map(str, dims)) != sorted(usual) or len(dataset.shape) != len(usual) or dataset.dtype.kind not in "fiu":
        raise CorruptFileError(
            "the dataset has other axes",
            path=path,
            place=name,
            expected=", ".join(usual),
            found=f"{', '.join(map(str, dims))[:80]}, shape {dataset.shape}",
            remedy="export it again",
        )
    bound = max(BOUND * size, LEAST_BOUND)
    # a chunk is unpacked as a whole, however little of it is in use
    inflated = max(8 * dataset.size, _chunk_bytes(dataset))
    if inflated > bound:
        raise ReadError(
            "the dataset is too large for the file that holds it",
            path=path,
            place=name,
            expected=f"at most {bound} bytes",
            found=f"{inflated}",
            remedy="export it without compression",
        )
    values = np.asarray(dataset[()], dtype=np.float64)
    return values.transpose([dims.index(axis) for axis in wanted])
