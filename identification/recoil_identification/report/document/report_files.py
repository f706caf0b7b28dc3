"""The files of a report, written and read again: ``report.json``, ``mass.csv`` and ``curves.csv``.

A document has the same bytes wherever it is written or attached. It states the computer, since the same numbers to the
last bit can be expected of the same alone, and a digest of its own content, so that a digit that is changed in it
shows, be it one that nothing is computed of.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import platform
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json, told_in_one_line
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.linear_algebra import threads
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.shot.firing_record import CURVES, Curves
from recoil_identification.shot.identified import Result
from recoil_processing.shot.error_source import ErrorSource

SCHEMA = "recoil-daq/report/1"
REPORT_FILE = "report.json"
TRACE_FILE = "mass.csv"
CURVES_FILE = "curves.csv"
TRACE_COLUMNS = ("time_s", "mass_kg", "u_kg", "identified")
LARGEST_REPORT = 4_000_000
"""Bytes of a report.json, beyond which it is none."""
DEEPEST = 32
"""Levels of a report.json, one in another, beyond which it is none."""
LARGEST_TRACE = 64_000_000
"""Bytes of a mass.csv, beyond which it is none: two seconds of a recoil at a million samples a second."""
LARGEST_CURVES = 1_000_000
"""Bytes of a curves.csv, beyond which it is none."""
_PLAIN = frozenset((str, int, bool, type(None)))
SEAL = "digest"
"""Key of the provenance."""
DRAWN = "drawn"
"""Key of the provenance: the forms in which a document is drawn."""
OWN_DIGEST = "this document's own digest (provenance.digest)"
"""Words before the digest of its content that a document bears, on page and paper."""


def to_json(value: Any) -> Any:
    """Reduce a value to JSON types; a number that is not finite becomes null, a text that carries more a plain one."""
    kind = type(value)
    if kind in _PLAIN:  # most of what a report holds
        return value
    if kind is float:
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): to_json(v) for k, v in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Sequence):
        return [to_json(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def stated(one: object, *names: str) -> dict[str, Any]:
    """Return attributes of a value by their names, which are the document's keys."""
    return {name: getattr(one, name) for name in names}


def budget_rows(
    budget: Sequence[BudgetRow],
    scope_of: Callable[[BudgetRow], str],
    estimates: Mapping[ErrorSource, float] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """State an uncertainty budget, the largest contribution first.

    Parameters
    ----------
    scope_of
        Function that says how far a source reaches.
    estimates
        Errors of the sources as they were found, each in the source's unit; null is stated of those left out.
    """
    return [
        {
            "source": row.source,
            "group": row.group,
            "u_kg": row.u_kg,
            "type": row.kind,
            "sensitivity_kg": row.sensitivity,
            "sensitivity_per": row.sensitivity_per if row.sensitivity is not None else None,
            "u_source": math.nan if row.u_source is None else row.u_source,
            "estimate": estimates.get(row.source) if row.sensitivity is not None else None,
            "scope": scope_of(row),
            **stated(row, "degrees_of_freedom", "distribution"),
        }
        for row in sorted(budget, key=lambda row: -row.u_kg)
    ]


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Write a document as JSON, in ASCII, one key a line.

    Raises
    ------
    ValueError
        A number that is not finite.
    """
    return (json.dumps(document, indent=2, allow_nan=False) + "\n").encode("ascii")


def write_document(folder: Path, document: Mapping[str, Any]) -> Path:
    """Write ``report.json`` into a folder."""
    path = folder / REPORT_FILE
    path.write_bytes(json_bytes(document))
    return path


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write texts into a folder, by name; the bytes are the same on every system."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def trace_text(result: Result) -> str:
    """Return the text of ``mass.csv``, the identified mass over time; what was not identified is left blank."""
    trace = result.trace
    rows = [",".join(TRACE_COLUMNS)]
    for t, mass, u, identified in zip(trace.times_s, trace.mass_kg, trace.u_kg, trace.identified, strict=True):
        number = f"{mass:.6f},{u:.6f},1" if identified else ",,0"
        rows.append(f"{t:.9g},{number}")
    return "\n".join(rows) + "\n"


def curves_text(curves: Curves) -> str:
    """Return the text of ``curves.csv``, thin curves over the time after the onset of force; what was lost is blank."""
    rows = [",".join(("time_s", *CURVES))]
    columns = [curves.values.get(name, np.full(curves.times_s.size, math.nan)) for name in CURVES]
    for t, *values in zip(curves.times_s, *columns, strict=True):
        rows.append(",".join([f"{t:.6g}", *(f"{value:.6g}" if math.isfinite(value) else "" for value in values)]))
    return "\n".join(rows) + "\n"


def computer() -> dict[str, str]:
    """Return what decides the last bits of a result: the processor's kind, the libraries and their versions.

    Returns
    -------
    dict of str to str
        ``system``, ``machine``, ``python``, ``numpy``, ``scipy``, ``blas`` (numpy's and scipy's), ``blas_threads``
        that share its sums, and ``simd``: which extensions of the processor numpy found and uses. It tells kinds of
        computers apart, and names none.
    """
    import scipy  # no page needs it

    built: list[Any] = [np.show_config(mode="dicts"), scipy.show_config(mode="dicts")]
    blas = [one.get("Build Dependencies", {}).get("blas", {}) for one in built]
    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "blas": ", ".join(dict.fromkeys(f"{one.get('name', '')} {one.get('version', '')}".strip() for one in blas)),
        "blas_threads": threads(),
        "simd": " ".join(built[0].get("SIMD Extensions", {}).get("found", ())),
    }


def digest_of(document: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a report without its own digest.

    It is that of the JSON text with its keys sorted, without spaces and with every number as a float, so that a
    program which reads a report and writes it anew changes nothing.
    """
    provenance = {key: value for key, value in document["provenance"].items() if key != SEAL}
    plain = _plain({**document, "provenance": provenance})
    return hashlib.sha256(json.dumps(plain, sort_keys=True, separators=(",", ":")).encode("ascii")).hexdigest()


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a report with its digest in its provenance."""
    return {**document, "provenance": {**document["provenance"], SEAL: digest_of(document)}}


def seal_fault(document: Mapping[str, Any]) -> str:
    """Say why a report is not what was written: its digest is that of another content, or it has none; else nothing.

    A report that has none was made by an earlier version, or the digest was taken out: nothing vouches for it.
    """
    seal = document["provenance"].get(SEAL)
    if seal is None:
        return f"has no digest of its content (provenance.{SEAL})"
    if seal != digest_of(document):
        return f"was changed after it was written: its content has another digest than provenance.{SEAL}"
    return ""


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


def read_document(path: Path, content: bytes | None = None) -> dict[str, Any]:
    """Read a ``report.json``.

    Parameters
    ----------
    content
        Bytes of the file, where they are at hand.

    Raises
    ------
    ReadError
        If it is no report of a shot, has a key twice in one object, or a number that is not finite, for which null
        stands in reports.
    """
    content = read_small(path, LARGEST_REPORT, "a report") if content is None else content
    with told_in_one_line("this is no report of a shot", path, expected=f"schema {SCHEMA}"):
        document = of_schema(content, SCHEMA)
        lacking = [key for key in ("shot", "rig", "mass", "rpe_percent", "valid", "provenance") if key not in document]
        if lacking:
            raise ValueError(f"no {', '.join(lacking)}")
    return dict(document)


def of_schema(content: bytes, schema: str) -> Any:
    """Return a document by its bytes.

    Raises
    ------
    ValueError
        If it is of another schema, or nested more deeply than any that this project wrote.
    LookupError, TypeError
        If it states no schema.
    """
    document = read_json(content)
    if document["schema"] != schema:
        raise ValueError(f"schema {document['schema']!r}")
    _refuse_deep(document)
    return document


def _refuse_deep(document: Any) -> None:
    level = [document]
    for _ in range(DEEPEST):
        level = [
            part for one in level if isinstance(one, dict | list)
            for part in (one.values() if isinstance(one, dict) else one)
        ]  # fmt: skip
    if level:
        raise ValueError(f"more than {DEEPEST} levels")


def refuse_changed(path: Path, sha256: str) -> None:
    """Raise `ReadError` if a table beside a report is there and is not the one that was written with it."""
    if path.exists() and hashlib.sha256(read_small(path, LARGEST_TRACE, "a table")).hexdigest() != sha256:
        raise ReadError(
            "was changed after it was written", path=path, expected=f"SHA-256 {sha256}, as its report says",
            remedy="identify the shot anew",
        )  # fmt: skip


def read_trace(folder: Path) -> Array | None:
    """Read the ``mass.csv`` of a report's folder: time in s, mass and u in kg, NaN where blank; None if there is none.

    Raises
    ------
    ReadError
        If it is no such file.
    """
    numbers = _read_table(
        folder / TRACE_FILE, TRACE_COLUMNS, LARGEST_TRACE, "a trace", "this is no mass over time",
        "without a time", lambda times_s: bool(np.isfinite(times_s).all()),
    )  # fmt: skip
    return None if numbers is None else numbers[:, :3]


def read_curves(folder: Path) -> Curves | None:
    """Read the ``curves.csv`` of a report's folder; None where there is none.

    Raises
    ------
    ReadError
        If it is no such file.
    """
    numbers = _read_table(
        folder / CURVES_FILE, ("time_s", *CURVES), LARGEST_CURVES, "a shot's curves", "these are no curves of a shot",
        "times that do not ascend", lambda times_s: bool(np.all(np.diff(times_s) > 0)),
    )  # fmt: skip
    if numbers is None:
        return None
    values = {name: numbers[:, 1 + k] for k, name in enumerate(CURVES)}
    return Curves(numbers[:, 0], {name: column for name, column in values.items() if np.isfinite(column).any()})


def _read_table(
    path: Path, columns: Sequence[str], largest_bytes: int, what: str, is_none: str, bad_times: str,
    good: Callable[[Array], bool],
) -> Array | None:  # fmt: skip
    """Read a table of numbers, times in its first column, NaN where blank; None if there is no such file.

    Parameters
    ----------
    columns
        Columns that its first line must name.
    what, is_none, bad_times
        Words for what it should be, for what is said of one that is not, and of one whose times are not `good`.
    """
    if not path.exists():
        return None
    lines = io.TextIOWrapper(io.BytesIO(read_small(path, largest_bytes, what)), "utf-8", errors="replace")
    header, numbers = next(lines, "").rstrip("\n"), array("d")
    try:
        if header.split(",") != list(columns):
            raise ValueError(f"the columns {header!r}")
        for line in lines:
            cells = line.rstrip("\n").split(",")
            if len(cells) != len(columns):
                raise ValueError(f"rows of another length, or {bad_times}")
            numbers.extend(float(cell) if cell else math.nan for cell in cells)
        table = np.array(numbers).reshape(-1, len(columns))
        if not table.size or not good(table[:, 0]):
            raise ValueError(f"rows of another length, or {bad_times}")
    except ValueError as error:
        raise ReadError(
            is_none, path=path, expected=f"columns {', '.join(columns)}", found=str(error),
            remedy="identify the shot anew",
        ) from error  # fmt: skip
    return table
