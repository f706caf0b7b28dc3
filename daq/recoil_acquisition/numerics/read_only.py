"""Arrays of results that nobody can write to: a frozen dataclass does not freeze what its fields hold."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class ReadOnlyArrays:
    """A frozen dataclass whose arrays are read-only views, those in its dictionaries too.

    Whoever made an array may still write to it.
    """

    def __post_init__(self: DataclassInstance) -> None:
        for name in _names(type(self)):
            value: Any = getattr(self, name)
            # what is more than a dictionary keeps its own kind
            if type(value) is dict and any(isinstance(one, np.ndarray) for one in value.values()):
                object.__setattr__(self, name, {key: _read_only(one) for key, one in value.items()})
            elif (view := _read_only(value)) is not value:
                object.__setattr__(self, name, view)


@cache
def _names(kind: type[DataclassInstance]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _read_only(value: Any) -> Any:
    if not (isinstance(value, np.ndarray) and value.flags.writeable):
        return value
    view = value.view()
    view.flags.writeable = False
    return view
