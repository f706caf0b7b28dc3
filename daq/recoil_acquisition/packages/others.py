"""Parts that other packages add, which announce them by entry points.

A package names one in its ``pyproject.toml``::

    [project.entry-points."recoil_daq.readers"]
    itx = "recoil_itx:ItxReader"

Nothing of it is imported before somebody asks. What is looked through, as readers are for the one that knows a file,
is left out where it cannot be loaded, and reported once, in a line; what is asked for by the name of its entry point,
as a target is, is an error then.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

from recoil_acquisition.errors import IdentificationError, RecoilDaqError, visible

_LOG = logging.getLogger(__name__)


@cache
def offered(group: str, parts: Sequence[str]) -> tuple[Any, ...]:
    """Return what other packages offer, in the order of their names.

    Parameters
    ----------
    group
        Name of the group of entry points; each leads to an instance, or to a class that is called without arguments.
    parts
        Attributes that each must have.
    """
    return tuple(_loaded(group, parts))


def _loaded(group: str, parts: Sequence[str]) -> Iterator[Any]:
    for point in announced(group):
        try:
            found = point.load()
            found = found() if isinstance(found, type) else found
            missing = [part for part in parts if not hasattr(found, part)]
            if missing:
                raise TypeError(f"it has no {', '.join(missing)}")
        except Exception as error:
            package = point.dist.name if point.dist is not None else "a package"
            warn_of_fault(f"{point.name!r} ({point.value}) of {package}", error)
        else:
            yield found


@cache
def announced(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, in the order of their names; nothing of theirs is imported."""
    from importlib.metadata import entry_points

    return tuple(sorted(set(entry_points(group=group)), key=lambda point: (point.name, point.value)))


@cache
def named(group: str, name: str) -> Any:
    """Load what a package announces under a name: what its entry point leads to, of a class an instance.

    Raises
    ------
    IdentificationError
        If it cannot be loaded, or two packages announce one of this name, or none does.
    """
    points = [point for point in announced(group) if point.name == name]
    if len(points) != 1:
        raise IdentificationError(
            f"which {name!r} of {group} is meant cannot be told", expected="one package that announces it",
            found=", ".join(point.value for point in points) or "none", remedy="uninstall the others",
        )  # fmt: skip
    with at_work(f"{name!r} ({points[0].value}), which another package announces,"):
        found = points[0].load()
        return found() if isinstance(found, type) else found


@contextmanager
def at_work(what: str) -> Iterator[None]:
    """Let something of another package do its work; what it raises is an error in one line that names it.

    Raises
    ------
    IdentificationError
        For any exception but the project's own, which passes.
    """
    try:
        yield
    except RecoilDaqError:
        raise
    except Exception as error:
        raise IdentificationError(
            f"{what} does not work",
            found=visible(f"{type(error).__name__}: {error}"),
            remedy="tell its authors, or uninstall it",
        ) from error


def warn_of_fault(what: str, error: Exception) -> None:
    """Say in one line that something of another package does not work and is left out."""
    _LOG.warning("%s", visible(f"{what} does not work and is left out: {type(error).__name__}: {error}"))
