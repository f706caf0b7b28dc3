"""Files of tracks built from bytes, small and with known content."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

import h5py
import numpy as np

COUNT = 24
X = np.round(200.0 + 3.0 * np.arange(COUNT) + 0.25 * np.arange(COUNT) ** 2, 3)
Y = np.round(240.0 - 0.5 * np.arange(COUNT), 3)


def deeplabcut(
    count: int = COUNT, *, individuals: bool = False, likelihood: Mapping[int, float] | None = None
) -> bytes:
    low = likelihood or {}
    rows = [["scorer", *["net"] * 6]]
    if individuals:
        rows.append(["individuals", *["a"] * 3, *["b"] * 3])
    rows.append(["bodyparts", *["tip"] * 3, *(["tip"] * 3 if individuals else ["base"] * 3)])
    rows.append(["coords", *["x", "y", "likelihood"] * 2])
    rows += [
        [str(i), f"{X[i]}", f"{Y[i]}", f"{low.get(i, 0.99)}", f"{X[i] + 9}", f"{Y[i] + 9}", "0.98"]
        for i in range(count)
    ]
    return "".join(",".join(row) + "\n" for row in rows).encode()


def dltdv(count: int = COUNT, *, lost: Sequence[int] = (), header: str = "pt1_cam1_X,pt1_cam1_Y") -> bytes:
    rows = ["NaN,NaN" if i in lost else f"{X[i]:.6f},{Y[i]:.6f}" for i in range(count)]
    return "".join(line + "\r\n" for line in [header, *rows]).encode()


def tracker(count: int = COUNT, *, lost: Sequence[int] = (), separator: str = "\t") -> bytes:
    rows = []
    for i in range(count):
        cells = ["", ""] if i in lost else [f"{X[i]:.9E}", f"{-Y[i]:.9E}"]
        rows.append(separator.join([f"{i * 0.002:.9E}", *cells, ""]))
    return "".join(line + "\n" for line in ["cm_A", separator.join(["t", "x", "y", ""]), *rows]).encode()


def tracker_several(count: int = COUNT) -> bytes:
    lines = ["#multi:", "\tcm A\t\tcm B\t\t", "t\tx\ty\tv_{x}\tv_{y}\t"]
    for i in range(count):
        v = ["", ""] if i in (0, count - 1) else ["1.5", f"{i}.25"]
        lines.append("\t".join([f"{i * 0.002:.4f}", f"{X[i]}", f"{Y[i]}", *v, ""]))
    return "".join(line + "\n" for line in lines).encode()


def sleap_text(count: int = COUNT, *, tracks: Sequence[str] = ("mark",), missing: Sequence[int] = ()) -> bytes:
    lines = ["track,frame_idx,instance.score,tip.x,tip.y,tip.score"]
    for i in range(count):
        for n, track in enumerate(tracks):
            if i not in missing:
                lines.append(f"{track},{i},0.9,{X[i] + 50 * n},{Y[i]},{0.8 if n else 0.95}")
    return "".join(line + "\n" for line in lines).encode()


def sleap_analysis(
    count: int = COUNT, *, dims: Sequence[str] | None = None, tracks: Sequence[str] = ("mark",), scores: bool = True
) -> bytes:
    """Write an analysis file; axes in the usual order, or in another one that is then named."""
    usual = ("track", "xy", "node", "frame")
    positions = np.full((len(tracks), 2, 2, count), np.nan)
    for n in range(len(tracks)):
        positions[n, 0] = X[:count] + 50 * n + np.array([[0.0], [9.0]])
        positions[n, 1] = Y[:count]
    positions[0, :, 1, 5] = np.nan
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        order = [usual.index(d) for d in dims or usual]
        dataset = file.create_dataset("tracks", data=positions.transpose(order), compression="gzip")
        if dims is not None:
            dataset.attrs["dims"] = json.dumps(list(dims))
        file["track_names"] = np.array([t.encode() for t in tracks], dtype="S")
        file["node_names"] = np.array([b"tip", b"base"])
        if scores:
            file["point_scores"] = np.full((len(tracks), 2, count), 0.9)
    return buffer.getvalue()


def workbook(sheets: Mapping[str, Sequence[Sequence[object]]], *, extra: bytes = b"", dimension: str = "") -> bytes:
    """Write a minimal workbook (ECMA-376): numbers and inline texts."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    spread = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{package}/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{spread}.sheet.main+xml"/>'
        + "".join(
            f'<Override PartName="/xl/s{i}.xml" ContentType="{spread}.worksheet+xml"/>' for i in range(len(sheets))
        )
        + "</Types>",
        "_rels/.rels": f'<Relationships xmlns="{package}/relationships"><Relationship Id="r0" '
        f'Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>'
        + "".join(f'<sheet name="{escape(n)}" sheetId="{i + 1}" r:id="r{i}"/>' for i, n in enumerate(sheets))
        + "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{package}/relationships">'
        + "".join(f'<Relationship Id="r{i}" Type="{office}/worksheet" Target="s{i}.xml"/>' for i in range(len(sheets)))
        + "</Relationships>",
    }
    for i, rows in enumerate(sheets.values()):
        body = "".join(f"<row>{''.join(map(_cell, row))}</row>" for row in rows)
        size = f'<dimension ref="{dimension}"/>' if dimension else ""
        parts[f"xl/s{i}.xml"] = f'<worksheet xmlns="{main}">{size}<sheetData>{body}</sheetData></worksheet>'
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            data = text.encode() if not name.startswith("xl/s") else extra + text.encode()
            archive.writestr(zipfile.ZipInfo(name, (2024, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _cell(value: object) -> str:
    if value is None:
        return "<c/>"
    if isinstance(value, int | float):
        return f"<c><v>{value!r}</v></c>"
    return f'<c t="inlineStr"><is><t>{escape(str(value))}</t></is></c>'


def workbook_rows(count: int = COUNT, *, lost: Sequence[int] = (), unit: str = "mm") -> list[list[object]]:
    rows: list[list[object]] = [["Project", "a.avi"], ["Frame", "Time (s)", f"Muzzle X ({unit})", f"Muzzle Y ({unit})"]]
    for i in range(count):
        at = [-1, -1] if i in lost else [float(X[i]), float(Y[i])]
        rows.append([i, i / 2000, *at])
    return rows
