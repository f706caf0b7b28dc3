"""Plain faults of a range, drawn at random and put into a shot's own files and its rig, as a person would make them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Draw = np.random.Generator
Change = Callable[[Path, Draw], str]
"""Function from a shot's folder, whose files it changes, to what was done, in words; empty if there is nothing."""

RECORDER, CAMERA, RIG = "0001_dewetron.csv", "0001_camera.csv", "rig.toml"
_OTHER_UNITS = {"m/s2": "g", "MPa": "bar", "rad/s": "deg/s", "mm": "m"}
GAINS = (-1.0, 0.5, 0.9, 0.95, 0.97, 0.98, 0.99, 1.01, 1.02, 1.03, 1.05, 1.1, 2.0, 10.0, 1000.0)
FACTORS = (0.5, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 2.0)
KEYS = (
    "m1", "m2", "J1", "J2", "X1", "Y1", "XA", "YA", "s2", "b", "d", "e", "L", "f", "phi10", "phi20", "g", "bore_area",
    "brake_area", "recuperator_area", "friction",
)  # fmt: skip
"""Keys of the mechanism; of m3, which nothing but the comparison needs, a fault is seen there and nowhere else."""


@dataclass(frozen=True)
class RandomFault:
    """A single fault of a number's own drawing."""

    number: int

    def put_into(self, folder: Path, others: Path) -> str:
        """Change the files of a shot, and return what was done; `others` is the folder of another shot."""
        rng = np.random.default_rng([2027, self.number])
        kinds = [*_IN_TABLES, *_IN_RIG, *([_another_shots_imu(others)] if (others / "0001_imu.rdlog").exists() else [])]
        while True:  # a rig may have nothing of a kind
            if done := kinds[int(rng.integers(len(kinds)))](folder, rng):
                return done


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    head, *rows = path.read_text("utf-8").splitlines()
    return head.split(","), np.array([[float(cell or "nan") for cell in row.split(",")] for row in rows])


def _write(path: Path, head: Sequence[str], cells: np.ndarray) -> None:
    rows = (",".join("" if np.isnan(cell) else f"{cell:.9g}" for cell in row) for row in cells.tolist())
    path.write_text("\n".join([",".join(head), *rows]) + "\n", "utf-8")


def _columns(path: Path, head: Sequence[str]) -> list[int]:
    """Return which columns are channels: of the camera's the one that a channel reads, and the one across it."""
    first = 1 if path.name == RECORDER else 2
    return list(range(first, len(head) if path.name == RECORDER else 4))


def _to_a_column(change: Callable[[np.ndarray, Draw], str], only: str = "") -> Change:
    def changed(folder: Path, rng: Draw) -> str:
        path = folder / (only or str(rng.choice([RECORDER, RECORDER, CAMERA])))
        head, cells = _table(path)
        j = int(rng.choice(_columns(path, head)))
        what = change(cells[:, j], rng)  # in place
        _write(path, head, cells)
        return f"{head[j]}: {what}"

    return changed


def _gain(column: np.ndarray, rng: Draw) -> str:
    gain = float(rng.choice(GAINS))
    column *= gain
    return f"times {gain:g}"


def _offset(column: np.ndarray, rng: Draw) -> str:
    share = float(rng.choice([-0.1, -0.02, -0.005, 0.005, 0.02, 0.1]))
    column += share * np.nanmax(np.abs(column))
    return f"{100 * share:+g} % of its peak added"


def _drift(column: np.ndarray, rng: Draw) -> str:
    share = float(rng.choice([-0.05, -0.01, 0.01, 0.05]))
    column += share * np.nanmax(np.abs(column)) * np.linspace(0.0, 1.0, column.size)
    return f"drifts by {100 * share:+g} % of its peak"


def _late(column: np.ndarray, rng: Draw) -> str:
    rows = int(rng.choice([2, 5, 10, 25, 100]))
    column[rows:] = column[:-rows].copy()
    return f"{rows} rows late"


def _frozen(column: np.ndarray, rng: Draw) -> str:
    length = int(rng.choice([column.size // 500, column.size // 50, column.size // 5]))
    at = int(rng.integers(column.size // 6, column.size // 2))
    column[at : at + length] = column[at]
    return f"holds its value over {length} rows from row {at} on"


def _empty(column: np.ndarray, rng: Draw) -> str:
    every = int(rng.choice([3, 20, 300]))
    column[int(rng.integers(every)) :: every] = np.nan
    return f"each row of {every} is empty"


def _zeros(column: np.ndarray, rng: Draw) -> str:
    length, at = column.size // 60, int(rng.integers(column.size // 6, column.size // 2))
    column[at : at + length] = 0.0
    return f"{length} zeros from row {at} on"


def _clipped(column: np.ndarray, rng: Draw) -> str:
    share = float(rng.choice([0.3, 0.7, 0.95]))
    limit = share * np.nanmax(np.abs(column))
    np.clip(column, -limit, limit, out=column)
    return f"clipped at {100 * share:g} % of its peak"


def _spikes(column: np.ndarray, rng: Draw) -> str:
    at = rng.integers(0, column.size, 12)
    column[at] = 3.0 * np.nanmax(np.abs(column))
    return "12 spikes"


def _coarse(column: np.ndarray, rng: Draw) -> str:
    step = np.nanmax(np.abs(column)) / float(rng.choice([15, 63, 255]))
    column[:] = np.round(column / step) * step
    return f"in steps of {step:.3g}"


def _hum(column: np.ndarray, rng: Draw) -> str:
    share = float(rng.choice([0.01, 0.05]))
    rows = np.arange(column.size) / column.size
    column += share * np.nanmax(np.abs(column)) * np.sin(2 * np.pi * 27.5 * rows)
    return f"27.5 periods of {100 * share:g} % of its peak"


def _headings_exchanged(folder: Path, rng: Draw) -> str:
    path = folder / RECORDER
    head, cells = _table(path)
    a, b = (int(j) for j in rng.choice(_columns(path, head), 2, replace=False))
    cells[:, [a, b]] = cells[:, [b, a]]
    _write(path, head, cells)
    return f"columns of {head[a]} and {head[b]} exchanged"


def _unit_renamed(folder: Path, rng: Draw) -> str:
    path = folder / str(rng.choice([RECORDER, CAMERA]))
    head, cells = _table(path)
    j = int(rng.choice(_columns(path, head)))
    old = head[j]
    head[j] = re.sub(r"\((.+)\)", lambda unit: f"({_OTHER_UNITS[unit[1]]})", old)
    _write(path, head, cells)
    return f"{old} headed {head[j]}"


def _times(folder: Path, rng: Draw) -> str:
    path, factor = folder / str(rng.choice([RECORDER, CAMERA])), float(rng.choice([0.5, 0.99, 0.999, 1.001, 1.01, 2.0]))
    head, cells = _table(path)
    cells[:, head.index("Time (s)")] *= factor
    _write(path, head, cells)
    return f"times of {path.name} times {factor:g}"


def _rows(folder: Path, rng: Draw) -> str:
    path = folder / str(rng.choice([RECORDER, CAMERA]))
    head, cells = _table(path)
    at, length = int(rng.integers(len(cells) // 6, len(cells) // 2)), int(rng.choice([1, 20, len(cells) // 20]))
    done = str(rng.choice(["left out", "twice", "reversed", "cut"]))
    before, part, behind = cells[:at], cells[at : at + length], cells[at + length :]
    parts = {"left out": [before, behind], "twice": [before, part, part, behind], "cut": [before]}
    _write(path, head, np.concatenate(parts.get(done, [before, part[::-1], behind])))
    return f"{length} rows of {path.name} from row {at} on {done}"


def _whole_rows_gone(folder: Path, rng: Draw) -> str:
    """Close a gap over, as a program does that numbers rows anew: the times stay even."""
    path = folder / str(rng.choice([RECORDER, CAMERA]))
    head, cells = _table(path)
    at, length = int(rng.integers(len(cells) // 6, len(cells) // 2)), int(rng.choice([1, 3, 20, 100]))
    columns = [j for j in range(len(head)) if head[j] not in ("Time (s)", "Frame")]
    closed = np.concatenate([cells[:at], cells[at + length :]])
    cells = cells[: len(closed)]
    cells[:, columns] = closed[:, columns]
    _write(path, head, cells)
    return f"{length} rows of {path.name} lost at row {at}, and the times closed over them"


def _key(folder: Path, rng: Draw) -> str:
    key, factor = str(rng.choice(KEYS)), float(rng.choice(FACTORS))
    return _in_rig(
        folder, rf"(?m)^{key} = ([-+.\de]+)", lambda m: f"{key} = {factor * float(m[1]):.9g}", f"x {factor:g}"
    )


def _in_rig(folder: Path, pattern: str, put: Callable[[re.Match[str]], str], what: str, which: int = 0) -> str:
    text = (folder / RIG).read_text("utf-8")
    found = list(re.finditer(pattern, text))[which]
    (folder / RIG).write_text(text[: found.start()] + put(found) + text[found.end() :], "utf-8")
    return f"rig: {found[0].splitlines()[0][:70]} {what}"


def _any_in_rig(pattern: str, put: Callable[[re.Match[str]], str], what: str) -> Change:
    def changed(folder: Path, rng: Draw) -> str:
        count = len(re.findall(pattern, (folder / RIG).read_text("utf-8")))
        return _in_rig(folder, pattern, put, what, int(rng.integers(count))) if count else ""

    return changed


def _two_exchanged(pattern: str, what: str) -> Change:
    """Exchange the group of two places of the rig."""

    def changed(folder: Path, rng: Draw) -> str:
        text = (folder / RIG).read_text("utf-8")
        a, b = sorted((list(re.finditer(pattern, text))[int(i)] for i in rng.choice(
            len(re.findall(pattern, text)), 2, replace=False)), key=lambda m: m.start())  # fmt: skip
        (folder / RIG).write_text(
            text[: a.start(1)] + b[1] + text[a.end(1) : b.start(1)] + a[1] + text[b.end(1) :], "utf-8"
        )
        return f"rig: {what} exchanged: {a[1][:50]} and {b[1][:50]}"

    return changed


def _another_shots_imu(others: Path) -> Change:
    def changed(folder: Path, _: Draw) -> str:
        (folder / "0001_imu.rdlog").write_bytes((others / "0001_imu.rdlog").read_bytes())
        return "the imu's file of another shot"

    return changed


_IN_TABLES: tuple[Change, ...] = (
    *(_to_a_column(one) for one in (_gain, _gain, _offset, _drift, _late, _frozen, _empty, _zeros, _clipped, _spikes)),
    *(_to_a_column(one) for one in (_coarse, _hum)),
    _headings_exchanged, _unit_renamed, _times, _rows, _rows, _whole_rows_gone,
)  # fmt: skip
_SENSOR = r"sensor = (\{.*\})"
_IN_RIG: tuple[Change, ...] = (
    _key, _key, _key,
    _any_in_rig(r"polarity = (-?1)", lambda m: f"polarity = {-int(m[1])}", "turned"),
    _any_in_rig(r", u_zero_rel = [.\d]+", lambda _: "", "left out"),
    _any_in_rig(r", (?:delay_s|filter_hz) = [.\d]+", lambda m: re.sub(r"[.\d]+$", "0.0", m[0]), "set to 0"),
    _any_in_rig(r"u_rel = ([.\d]+)", lambda m: f"u_rel = {float(m[1]) / 10:g}", "a tenth"),
    _any_in_rig(r"frame_rate = ([.\d]+)", lambda m: f"frame_rate = {1.05 * float(m[1]):g}", "5 % more"),
    _any_in_rig(r'unit = "(MPa|m/s2|rad/s|mm)"', lambda m: f'unit = "{_OTHER_UNITS[m[1]]}"', "another unit"),
    _any_in_rig(r"position = \[(-?[.\d]+), (-?[.\d]+)\]", lambda m: f"position = [{m[2]}, {m[1]}]", "turned round"),
    _two_exchanged(_SENSOR, "sensors"), _two_exchanged(r'\nrole = "(\w+)"', "roles"),
    _two_exchanged(r'\nsignal = "(.+)"', "signals"),
)  # fmt: skip
