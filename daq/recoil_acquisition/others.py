"""Readers and exporters of other packages, which announce them by entry points.

A package names them in its ``pyproject.toml``::

    [project.entry-points."recoil_daq.readers"]
    itx = "recoil_itx:ItxReader"

Nothing of it is imported before somebody asks. One that cannot be loaded is reported once, in a line, and left out.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from recoil_acquisition.errors import visible

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
    from importlib.metadata import entry_points

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
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


def warn_of_fault(what: str, error: Exception) -> None:
    """Say in one line that something of another package does not work and is left out."""
    _LOG.warning("%s", visible(f"{what} does not work and is left out: {type(error).__name__}: {error}"))
