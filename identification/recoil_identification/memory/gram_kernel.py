"""Compiled sums of products of sliding windows and their solution: what `windows` and `window_policy` do, in one pass.

The code is written out for a number of regressors and outputs: straight lines without an inner loop over entries,
which the compiler lays side by side for many windows. A chunk of windows stays in the nearest cache: the beginnings
of a block and the endings of the block before are summed chunk by chunk, the endings from marks that one pass
backward leaves at each chunk, so that time does not depend on the window. Every sum, product and quotient is formed
in the order and with the rounding of the plain arrays, and the results are the same to the last bit. Needs numba,
the extra ``fast``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from math import sqrt
from typing import Any, cast

import numpy as np

from recoil_acquisition.errors import RecoilDaqError
from recoil_identification.memory.samples import NEGLIGIBLE
from recoil_identification.memory.window_factors import NO_ENERGY, PIVOT_FLOOR, FloatArray, Packing
from recoil_identification.memory.windowed_estimates import (
    COLLINEAR_PIVOT,
    GUARDED_PIVOT,
    GUARDED_RESIDUAL,
    SILENT_BIT,
    WindowStatus,
)

CHUNK = 256
"""Windows that are solved together; with 5 regressors their sums take 86 kB."""
UNSOUND_BIT = 0x40
"""Bit of a window's mark that is set where sums of products are not accurate enough."""
HELD_ROWS = 4096
"""Rows of a block up to which they are kept, scaled, until the next block has needed them as well."""
STRIDE = CHUNK + 8
"""Numbers between the rows of the scratch memory: rows a power of two apart would share a few lines of the cache."""
MOST_COLUMNS = 12
"""Regressors and outputs up to which the code is written out; beyond, it would take minutes to compile."""

PARTS = ("load", "add_forward", "add_backward", "solve", "put", "give")
"""Functions that the kernel calls."""

Kernel = Callable[..., int]


@cache
def kernel_at_hand() -> bool:
    """Tell whether numba is installed."""
    return find_spec("numba") is not None


@cache
def load_kernel(n_parameters: int, n_outputs: int) -> Kernel:
    """Compile the kernel for a number of regressors and outputs, or load it from where an earlier process kept it.

    Parameters
    ----------
    n_parameters, n_outputs : int

    Returns
    -------
    callable
        See `kernel_source`.

    Raises
    ------
    RecoilDaqError
        If numba is not installed.
    """
    numba = _numba()
    njit = numba.njit
    namespace: dict[str, Any] = {"__name__": __name__, "sqrt": sqrt, "np": np}
    # under this file's name, so that what is compiled is kept beside it and is compiled anew when it changes
    source = kernel_source(n_parameters, n_outputs)
    exec(compile(source, __file__, "exec"), namespace)  # noqa: S102 - the source is this module's own
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "boundscheck": False}
    for name in (f"{part}_{n_parameters}_{n_outputs}" for part in PARTS):
        namespace[name] = njit(namespace[name], **options)
    types: Any = numba.types  # its own types of the constructor leave out what it takes
    given = [types.Array(types.float64, 2, "A", readonly=True)] * 2
    given += [
        types.Array(types.float64, 1, "C", readonly=True),
        types.Array(types.boolean, 1, "C", readonly=True),
        types.Array(types.int64, 1, "C", readonly=True),
    ]
    settings = [types.Array(types.float64, 1, "C", readonly=True)] * 5 + [types.float64] + [types.int64] * 6
    results = [types.float64[:, ::1]] * 3 + [types.float64[::1], types.uint8[::1]]
    signature = types.int64(*given, *settings, *results)
    plain = namespace[f"windows_{n_parameters}_{n_outputs}"]
    try:
        compiled = njit(signature, cache=True, **options)(plain)
    except (RuntimeError, OSError):
        # there is no folder where compiled code could be kept: it is compiled for this process alone
        compiled = njit(signature, **options)(plain)
    return cast("Kernel", compiled)


@cache
def load_scan() -> Callable[[FloatArray], FloatArray]:
    """Compile what looks for the largest magnitudes, or load it from where an earlier process kept it.

    Returns
    -------
    callable
        Of a table whose rows are contiguous: the largest magnitude of each column, NaN where a number is not finite.

    Raises
    ------
    RecoilDaqError
        If numba is not installed.
    """
    numba = _numba()
    types: Any = numba.types
    signature = types.float64[::1](types.Array(types.float64, 2, "C", readonly=True))
    try:
        compiled = numba.njit(signature, cache=True, nogil=True)(_largest_magnitudes)
    except (RuntimeError, OSError):
        compiled = numba.njit(signature, nogil=True)(_largest_magnitudes)
    return cast("Callable[[FloatArray], FloatArray]", compiled)


def _largest_magnitudes(table: FloatArray) -> FloatArray:  # pragma: no cover - runs compiled
    n_rows, n_columns = table.shape
    largest, spoilt = np.zeros(n_columns), np.zeros(n_columns)
    for k in range(n_rows):
        row = table[k]
        for i in range(n_columns):
            v = abs(row[i])
            largest[i] = v if v > largest[i] else largest[i]
            # of what is not finite it is not a number
            spoilt[i] += 0.0 * v
    return largest + spoilt


def _numba() -> Any:
    try:
        import numba
    except ImportError as error:
        raise RecoilDaqError(
            "the compiled least-squares kernel needs numba",
            remedy="install it by `pip install 'recoil-daq[fast]'`, or take the engine 'numpy'",
        ) from error
    return numba


def kernel_source(n_parameters: int, n_outputs: int) -> str:
    """Write the kernel.

    Parameters
    ----------
    n_parameters, n_outputs : int

    Returns
    -------
    str
        Functions that `windows` calls: of regressors, response, roots of weights, presence and counts (the last three
        empty where there are none); scales of the columns, least energies, two factors of the parameters' units, roots
        of the residuals' units; the largest relative error; block, window, least count, windows that are not tried for
        the start, first block, stop block; and the results. It returns the number of windows that are not sound.
    """
    packing = Packing(n_parameters, n_outputs)
    scratch = _Scratch(packing)
    n_e, n_pq, entries = packing.n_entries, n_parameters * n_outputs, range(packing.n_entries)
    pairs = _pairs(packing)
    # compiled functions of one name and one signature are taken for one function, in one process or between two
    of = f"{n_parameters}_{n_outputs}"
    return f"""
def load_{of}(x, y, root_weights, present, scales, first, m, s, start, stride):
    n, k0 = np.uint64(m), np.uint64(first)
    for j in range({packing.n_columns}):
        at, scale = np.uint64(start + j * stride), scales[j]
        if j < {n_parameters}:
            for i in range(np.uint64(0), n):
                s[i + at] = x[k0 + i, j] * scale
        else:
            for i in range(np.uint64(0), n):
                s[i + at] = y[k0 + i, j - {n_parameters}] * scale
        if root_weights.size:
            for i in range(np.uint64(0), n):
                s[i + at] *= root_weights[k0 + i]
        if present.size:
            for i in range(np.uint64(0), n):
                if not present[k0 + i]:
                    s[i + at] = 0.0
    for j in range({n_parameters}):
        at = np.uint64(start + j * stride)
        for i in range(np.uint64(0), n):
            v = s[i + at]
            s[i + at] = v if abs(v) >= {NEGLIGIBLE!r} else 0.0

def add_forward_{of}(rows, start, stride, s, sums, m, to):
    {_starts(packing)}
    {_unpack("sums[{}]", entries)}
    for t in range(np.uint64(0), np.uint64(m)):
        {_read(packing)}
        {_add(pairs)}
        {_store_entries(0, entries)}
    {_pack("sums[{}]", entries)}

def add_backward_{of}(rows, start, stride, s, sums, m, here, to):
    {_starts(packing)}
    {_unpack("sums[{}]", entries)}
    t = np.uint64(m)
    while t > np.uint64(here):
        t -= np.uint64(1)
        {_read(packing)}
        {_add(pairs)}
    while t > np.uint64(0):
        t -= np.uint64(1)
        {_store_entries(n_e, entries)}
        {_read(packing)}
        {_add(pairs)}
    {_pack("sums[{}]", entries)}

def solve_{of}(s, n, least, unit, other_unit, root_unit, most):
    {"; ".join(f"least{j} = least[{j}]" for j in range(n_parameters))}
    {"; ".join(f"unit{j} = unit[{j}]; other_unit{j} = other_unit[{j}]" for j in range(n_pq))}
    {"; ".join(f"root_unit{o} = root_unit[{o}]" for o in range(n_outputs))}
    for t in range(np.uint64(0), np.uint64(n)):
        {_solve(packing, scratch)}

def put_{of}(s, row, first, n, value):
    for i in range(n):
        s[row * {STRIDE} + first + i] = value

def give_{of}(s, row, out, first, n):
    at = np.uint64(row * {STRIDE})
    to = out[first : first + n]
    for i in range(np.uint64(0), np.uint64(n)):
        to[i] = s[i + at]

def windows_{of}(
    x, y, root_weights, present, counts, scales, least, unit, other_unit, root_unit, most, block, window, needed,
    skipped, first_block, stop_block, parameters, standard_errors, rss, pivots, marks
):
    n_samples = x.shape[0]
    s = np.zeros({scratch.n_rows * STRIDE})
    held = block <= {HELD_ROWS}
    stride = (block if held else {CHUNK}) + 8
    rows = np.zeros({2 * packing.n_columns} * stride)
    latest, before = 0, {packing.n_columns} * stride
    n_chunks = (block + {CHUNK - 1}) // {CHUNK}
    chunk = (block + n_chunks - 1) // n_chunks
    kept, begun, ended = np.zeros((n_chunks + 1, {n_e})), np.zeros({n_e}), np.zeros({n_e})
    filled, done, n_unsound, whole = 0, first_block * block, 0, 0
    if held and first_block > 0:
        load_{of}(x, y, root_weights, present, scales, (first_block - 1) * block, block, rows, latest, stride)
    for b in range(first_block, stop_block):
        start = b * block
        length = min(block, n_samples - start)
        if held:
            latest, before = before, latest
            load_{of}(x, y, root_weights, present, scales, start, length, rows, latest, stride)
        if b > 0 and n_chunks > 1:
            for e in range({n_e}):
                ended[e] = 0.0
            for c in range(n_chunks - 1, 0, -1):
                m = min(chunk, block - c * chunk)
                if m > 0 and held:
                    add_backward_{of}(rows, before + c * chunk, stride, s, ended, m, m, 0)
                elif m > 0:
                    load_{of}(x, y, root_weights, present, scales, start - block + c * chunk, m, rows, before, stride)
                    add_backward_{of}(rows, before, stride, s, ended, m, m, 0)
                for e in range({n_e}):
                    kept[c, e] = ended[e]
        for e in range({n_e}):
            begun[e] = 0.0
        for c in range(n_chunks):
            here = min(min(chunk, block - c * chunk), length - c * chunk)
            if here <= 0:
                break
            at = c * chunk if held else 0
            if not held:
                load_{of}(x, y, root_weights, present, scales, start + c * chunk, here, rows, latest, stride)
            add_forward_{of}(rows, latest + at, stride, s, begun, here, filled)
            if b > 0:
                m = min(chunk, block - c * chunk)
                if not held:
                    load_{of}(x, y, root_weights, present, scales, start - block + c * chunk, m, rows, before, stride)
                for e in range({n_e}):
                    ended[e] = kept[c + 1, e]
                add_backward_{of}(rows, before + at, stride, s, ended, m, here, filled)
            else:
                for e in range({n_e}, {2 * n_e}):
                    put_{of}(s, e, filled, here, 0.0)
            first = start + c * chunk
            if counts.size == 0 and first >= skipped and first + 1 >= window:
                # up to where they already are those of whole windows they stay
                missing = filled + here - max(whole, filled)
                if missing > 0:
                    put_{of}(s, {scratch.degrees}, filled + here - missing, missing, window - {n_parameters})
                    put_{of}(s, {scratch.code}, filled + here - missing, missing, 0.0)
                    whole = filled + here if whole >= filled else 0
            else:
                whole = min(whole, filled)
                for i in range(here):
                    n = counts[first + i] if counts.size else min(first + i + 1, window)
                    s[{scratch.degrees * STRIDE} + filled + i] = max(n - {n_parameters}, 1)
                    s[{scratch.code * STRIDE} + filled + i] = (
                        {int(WindowStatus.WINDOW_NOT_FULL)}.0 if first + i < skipped else
                        ({int(WindowStatus.TOO_FEW_SAMPLES)}.0 if n < needed else 0.0))
            filled += here
            last = b == stop_block - 1 and (c + 1) * chunk >= length
            if filled + chunk <= {CHUNK} and not last:
                continue
            solve_{of}(s, filled, least, unit, other_unit, root_unit, most)
            for j in range({n_pq}):
                give_{of}(s, {scratch.estimates} + j, parameters[j], done, filled)
                give_{of}(s, {scratch.errors} + j, standard_errors[j], done, filled)
            for j in range({n_outputs}):
                give_{of}(s, {scratch.residuals} + j, rss[j], done, filled)
            if pivots.size:
                give_{of}(s, {scratch.pivot}, pivots, done, filled)
            for i in range(filled):
                mark = np.uint8(np.int32(s[{scratch.mark * STRIDE} + i]))
                marks[done + i] = mark
                n_unsound += mark >> 6
            done += filled
            filled = 0
    return n_unsound
"""


class _Scratch:
    """Rows of the scratch memory, `CHUNK` numbers each."""

    def __init__(self, packing: Packing) -> None:
        n_pq = packing.n_parameters * packing.n_outputs
        self.degrees = 2 * packing.n_entries
        self.code = self.degrees + 1
        self.estimates = self.code + 1
        self.errors = self.estimates + n_pq
        self.residuals = self.errors + n_pq
        self.pivot = self.residuals + packing.n_outputs
        self.mark = self.pivot + 1
        self.n_rows = self.mark + 1


def _at(row: int) -> str:
    """Write the place of window `t` in a scratch row; unsigned, as a place that may be negative needs a test."""
    return f"t + np.uint64({row * STRIDE})"


def _block(lines: list[str], depth: int) -> str:
    """Join lines at the depth at which the first one is put in."""
    return ("\n" + " " * depth).join(lines)


def _pairs(packing: Packing) -> list[tuple[int, int]]:
    """Columns whose product each entry sums."""
    n_parameters, n_columns = packing.n_parameters, packing.n_columns
    pairs = [(i, k) for i in range(n_parameters) for k in range(i, n_columns)]
    return pairs + [(k, k) for k in range(n_parameters, n_columns)]


def _unpack(source: str, entries: range) -> str:
    return "; ".join(f"a{e} = {source.format(e)}" for e in entries)


def _pack(target: str, entries: range) -> str:
    return "; ".join(f"{target.format(e)} = a{e}" for e in entries)


def _starts(packing: Packing) -> str:
    return "; ".join(f"o{i} = np.uint64(start + {i} * stride)" for i in range(packing.n_columns))


def _read(packing: Packing) -> str:
    return "; ".join(f"z{i} = rows[t + o{i}]" for i in range(packing.n_columns))


def _add(pairs: list[tuple[int, int]]) -> str:
    return "; ".join(f"a{e} += z{i} * z{k}" for e, (i, k) in enumerate(pairs))


def _store_entries(first: int, entries: range) -> str:
    return "f = t + np.uint64(to); " + "; ".join(f"s[f + np.uint64({(first + e) * STRIDE})] = a{e}" for e in entries)


def _solve(packing: Packing, scratch: _Scratch) -> str:
    """Write the factorisation, solution and judgement of window `t`, as `windows` and `window_policy` do them."""
    p, q = packing.n_parameters, packing.n_outputs
    n_c = p + q
    lines = []
    for e, (i, k) in enumerate(_pairs(packing)):
        lines.append(f"g{i}_{k} = s[{_at(e)}] + s[{_at(packing.n_entries + e)}]")
    lines += [f"energy{j} = g{j}_{j}" for j in range(p)]
    lines += [f"response{o} = g{o}_{o}" for o in range(p, n_c)]
    for j in range(p):
        lines += [
            f"floor = {PIVOT_FLOOR!r} * energy{j}",
            f"d{j} = g{j}_{j} if g{j}_{j} > floor else floor",
            f"d{j} = 1.0 if energy{j} <= {NO_ENERGY!r} else d{j}",
        ]
        lines.append(f"precision{j} = 1.0 / d{j}")
        lines += [f"u{j}_{k} = g{j}_{k} * precision{j}" for k in range(j + 1, n_c)]
        lines += [f"g{k}_{i} -= u{j}_{k} * g{j}_{i}" for k in range(j + 1, p) for i in range(k, n_c)]
        lines += [f"g{o}_{o} -= u{j}_{o} * g{j}_{o}" for o in range(p, n_c)]
    lines.append("smallest = 1.0")
    for j in range(p - 1, -1, -1):
        lines += [f"w{j}_{k} = -u{j}_{k}" for k in range(j + 1, n_c)]
        for i in range(j + 1, p):
            lines += [f"w{j}_{k} -= u{j}_{i} * w{i}_{k}" for k in range(i + 1, n_c)]
        lines.append(f"factor{j} = precision{j}")
        lines += [f"factor{j} += w{j}_{k} * w{j}_{k} * precision{k}" for k in range(j + 1, p)]
        lines += [
            f"silent{j} = energy{j} <= {NO_ENERGY!r}",
            # the first regressor explains itself, and needs no division
            f"share = d{j} / (1.0 if silent{j} else energy{j})" if j else "share = 1.0",
            f"share = 0.0 if silent{j} else share",
            "smallest = share if share < smallest else smallest",
            f"energy{j} = 0.0 if silent{j} else energy{j}",
        ]
    lines.append("status = 0.0")
    for o in range(p, n_c):
        lines += [
            f"left{o} = g{o}_{o} if g{o}_{o} > 0.0 else 0.0",
            f"variance{o} = left{o} / s[{_at(scratch.degrees)}]",
        ]
        lines += [f"error{j}_{o} = sqrt(factor{j} * variance{o})" for j in range(p)]
        lines.append(f"status = status if error0_{o} <= most * abs(-w0_{o}) else {int(WindowStatus.NO_EXCITATION)}.0")
    if p > 1:
        lines.append(f"status = {int(WindowStatus.COLLINEAR)}.0 if smallest < {COLLINEAR_PIVOT!r} else status")
    for j in range(p):
        lines.append(f"status = {int(WindowStatus.NO_EXCITATION)}.0 if energy{j} < least{j} else status")
    lines += [
        f"sound = 1.0 if smallest >= {GUARDED_PIVOT!r} else 0.0",
        *(f"sound = sound if left{o} >= {GUARDED_RESIDUAL!r} * response{o} else 0.0" for o in range(p, n_c)),
        *(f"sound = 1.0 if silent{j} else sound" for j in range(p)),
        "is_silent = 0.0",
        *(f"is_silent = 1.0 if silent{j} else is_silent" for j in range(p)),
        f"untried = s[{_at(scratch.code)}]",
        "bits = 0.0 if untried > 0.0 else 1.0",
        "status = untried if untried > 0.0 else status",
        f"s[{_at(scratch.mark)}] = status + bits * (is_silent * {SILENT_BIT}.0 + (1.0 - sound) * {UNSOUND_BIT}.0)",
        f"s[{_at(scratch.pivot)}] = np.nan if untried > 0.0 else smallest",
        "keep = np.nan if status > 0.0 else 1.0",
    ]
    for o in range(p, n_c):
        lines.append(f"s[{_at(scratch.residuals + o - p)}] = left{o} * root_unit{o - p} * root_unit{o - p} * keep")
        for j in range(p):
            place = j * q + o - p
            lines += [
                f"s[{_at(scratch.estimates + place)}] = -w{j}_{o} * unit{place} * other_unit{place} * keep",
                f"s[{_at(scratch.errors + place)}] = error{j}_{o} * unit{place} * other_unit{place} * keep",
            ]
    return _block(lines, 8)
