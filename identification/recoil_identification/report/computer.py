"""On what a report was computed: the same numbers to the last bit can be expected of the same again only."""

from __future__ import annotations

import os
import platform
from typing import Any

import numpy as np
import scipy

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables that limit the threads of the linear algebra."""


def computer() -> dict[str, str]:
    """Return what decides the last bits of a result: the processor's kind, the libraries and their versions.

    Returns
    -------
    dict of str to str
        ``system``, ``machine``, ``python``, ``numpy``, ``scipy``, ``blas`` (numpy's and scipy's), ``blas_threads``
        that share its sums, and ``simd``: which extensions of the processor numpy found and uses. It tells kinds of
        computers apart, and names none.
    """
    built: list[Any] = [np.show_config(mode="dicts"), scipy.show_config(mode="dicts")]
    blas = [one.get("Build Dependencies", {}).get("blas", {}) for one in built]
    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "blas": ", ".join(dict.fromkeys(f"{one.get('name', '')} {one.get('version', '')}".strip() for one in blas)),
        "blas_threads": next((os.environ[name] for name in _THREADS if os.environ.get(name)), str(os.cpu_count())),
        "simd": " ".join(built[0].get("SIMD Extensions", {}).get("found", ())),
    }
