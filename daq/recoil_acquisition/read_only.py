"""Arrays of results that nobody can write to: a frozen dataclass does not freeze what its fields hold."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class ReadOnlyArrays:
    """A frozen dataclass whose arrays are read-only views; whoever made an array may still write to it."""

    def __post_init__(self: DataclassInstance) -> None:
        for field in fields(self):
            value: Any = getattr(self, field.name)
            if isinstance(value, np.ndarray) and value.flags.writeable:
                view = value.view()
                view.flags.writeable = False
                object.__setattr__(self, field.name, view)
