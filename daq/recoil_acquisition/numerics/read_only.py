"""Arrays of results that nobody can write to: a frozen dataclass does not freeze what its fields hold."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class ReadOnlyArrays:
    """A frozen dataclass whose arrays are read-only views, those in its dictionaries too.

    Whoever made an array may still write to it.
    """

    def __post_init__(self: DataclassInstance) -> None:
        for field in fields(self):
            value: Any = getattr(self, field.name)
            # what is more than a dictionary keeps its own kind
            if type(value) is dict and any(isinstance(one, np.ndarray) for one in value.values()):
                object.__setattr__(self, field.name, {key: _read_only(one) for key, one in value.items()})
            elif _read_only(value) is not value:
                object.__setattr__(self, field.name, _read_only(value))


def _read_only(value: Any) -> Any:
    if not (isinstance(value, np.ndarray) and value.flags.writeable):
        return value
    view = value.view()
    view.flags.writeable = False
    return view
