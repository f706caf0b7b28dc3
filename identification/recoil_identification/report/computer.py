"""On what a report was computed: the same numbers to the last bit can be expected of the same again only."""

from __future__ import annotations

import platform

import numpy as np
import scipy


def computer() -> dict[str, str]:
    """Return what decides the last bits of a result: the processor's kind, the libraries and their versions.

    Returns
    -------
    dict of str to str
        ``system``, ``machine``, ``python``, ``numpy``, ``scipy``, ``blas`` (numpy's and scipy's), and ``simd``: which
        extensions of the processor numpy found and uses. It tells kinds of computers apart, and names none.
    """
    built = [np.show_config(mode="dicts") or {}, scipy.show_config(mode="dicts") or {}]
    blas = [one.get("Build Dependencies", {}).get("blas", {}) for one in built]
    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "blas": ", ".join(dict.fromkeys(f"{one.get('name', '')} {one.get('version', '')}".strip() for one in blas)),
        "simd": " ".join(built[0].get("SIMD Extensions", {}).get("found", ())),
    }
