"""The page of every key of a rig file is that of the models, and leaves none out."""

from __future__ import annotations

import re

import pytest

from recoil_acquisition.devices import serial_port
from recoil_acquisition.frames.ready_made import READY_MADE
from recoil_acquisition.quantities.declaration import DeclaredTable
from recoil_rigs.tables.rig_tables import ROLES
from tests import rig_keys


@pytest.mark.whole_way
def test_the_page_is_what_the_models_say() -> None:
    written = rig_keys.PAGE.read_text(encoding="utf-8")
    assert written == rig_keys.page(), "write it again with `python -m tests.rig_keys`"


@pytest.mark.whole_way
def test_no_table_of_a_rig_file_is_left_out() -> None:
    page = rig_keys.page()

    def models(of: type[DeclaredTable]) -> list[type[DeclaredTable]]:
        below = of.__subclasses__()
        return [*below, *(one for model in below for one in models(model))]

    ours = [one for one in models(DeclaredTable) if one.__module__.startswith("recoil_")]
    assert len(ours) > 20
    for model in ours:
        for name, field in model.model_fields.items():
            assert f"\n| `{field.alias or name}` |" in page, (model.__name__, name)


def test_every_ready_made_framing_device_key_and_role_is_there() -> None:
    page = rig_keys.page()
    assert re.findall(r"^### `(.*)`$", page, re.MULTILINE) == list(READY_MADE)
    assert set(rig_keys.DEVICE_OF_PORT) == set(serial_port._KEYS)
    assert all(f"`{role}`" in page for role in ROLES)


def test_a_key_without_a_meaning_is_refused() -> None:
    class Bare(DeclaredTable):
        size: float = 1.0

    with pytest.raises(ValueError, match=r"Bare\.size has no meaning: give its field a description or a docstring"):
        rig_keys.rows_of(Bare)
