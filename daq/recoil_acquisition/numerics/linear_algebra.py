"""Threads of the linear algebra: one, wherever a shot is worked on.

The matrices of a shot are small. Threads that share their sums wait for one another in a loop, and cost several times
the processor time of the sums themselves. A limit in the environment counts where it stands before numpy is loaded,
which a script or a notebook may have done long ago: so the libraries themselves are told, for as long as a call takes.
"""

from __future__ import annotations

import contextlib
import functools
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any, ParamSpec, TypeVar

LIMITS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
)
"""Environment variables that limit the threads of the linear algebra: one that is set is what somebody wants."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


class _Limit:
    """Limit of this process, held while any call of any of its threads needs it, and given back with the last one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._calls = 0
        self._before: list[tuple[Any, int]] = []

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        with self._lock:
            if self._calls == 0:
                self._before = [(one, one.num_threads) for one in _libraries()]
                for library, _ in self._before:
                    _set(library, 1)
            self._calls += 1
        try:
            yield
        finally:
            with self._lock:
                self._calls -= 1
                if self._calls == 0:
                    for library, number in self._before:
                        _set(library, number)


_LIMIT = _Limit()


def on_one_thread(call: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let a function's linear algebra run on one thread, unless the environment sets a number of threads.

    What the process had before comes back when the last such call of any thread returns. A generator is none: its body
    runs when it is asked for its values.
    """

    @functools.wraps(call)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if stated_threads() is not None:
            return call(*args, **kwargs)
        with _LIMIT.held():
            return call(*args, **kwargs)

    return limited


def stated_threads() -> str | None:
    """Return the limit that the environment sets; None if it sets none."""
    return next((os.environ[name] for name in LIMITS if os.environ.get(name)), None)


def threads() -> str:
    """Return how many threads share a sum of the linear algebra at present, as a text."""
    stated = stated_threads()
    return str(max((one.num_threads for one in _libraries()), default=1)) if stated is None else stated


def _libraries() -> list[Any]:
    """Return the linear algebra of this process; numpy's and scipy's are loaded first, or they would escape."""
    import numpy.linalg  # noqa: F401 - loads its library
    import scipy.linalg  # noqa: F401 - loads a library of its own
    from threadpoolctl import ThreadpoolController

    return [one for one in ThreadpoolController().lib_controllers if one.user_api == "blas"]


def _set(library: Any, number: int) -> None:
    # In later versions of threadpoolctl only the first thread that ever asked may ask again, for as long as it lives;
    # calls that are counted under a lock need no such rule, and the last to end may be another thread's than the first
    getattr(library, "_real_set_num_threads", library.set_num_threads)(number)
