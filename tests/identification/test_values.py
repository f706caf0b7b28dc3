"""Values of the package stay what they are; one that holds arrays is equal to itself alone."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from dataclasses import FrozenInstanceError, fields, is_dataclass

import numpy as np
import pytest

import recoil_identification
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


def values() -> list[type]:
    """List every dataclass of the package."""
    modules = [
        importlib.import_module(one.name)
        for one in pkgutil.walk_packages(recoil_identification.__path__, "recoil_identification.")
    ]
    found = {kind for module in modules for _, kind in inspect.getmembers(module, inspect.isclass)}
    own = [kind for kind in found if is_dataclass(kind) and kind.__module__.startswith("recoil_identification")]
    return sorted(own, key=lambda kind: f"{kind.__module__}.{kind.__qualname__}")


def filled(kind: type) -> object:
    """Fill each field with an array, whatever the class makes of it."""
    one = object.__new__(kind)
    for field in fields(kind):
        object.__setattr__(one, field.name, np.zeros(2))
    return one


@pytest.mark.parametrize("kind", values(), ids=lambda kind: kind.__qualname__)
def test_nobody_changes_a_value(kind: type) -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(filled(kind), fields(kind)[0].name, None)


@pytest.mark.parametrize(
    "kind", [one for one in values() if issubclass(one, ReadOnlyArrays)], ids=lambda kind: kind.__qualname__
)
def test_one_that_holds_arrays_is_equal_to_itself_alone_and_has_a_hash(kind: type) -> None:
    # two equal arrays are no single truth, and have no hash
    one, other = filled(kind), filled(kind)
    assert one == one
    assert one != other
    assert len({one, other}) == 2
