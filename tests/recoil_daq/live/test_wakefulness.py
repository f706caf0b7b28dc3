"""A computer that is armed does not fall asleep, where its system can be told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import wakepy

from recoil_daq.live.wakefulness import kept_awake


class Mode:
    """Mode of the library, whose system answers as it is told."""

    def __init__(self, active: bool | Exception) -> None:
        self.active, self.entered = active, False

    def __enter__(self) -> Mode:
        if isinstance(self.active, Exception):
            raise self.active
        self.entered = True
        return self

    def __exit__(self, *_: object) -> None:
        self.entered = False


def system(monkeypatch: pytest.MonkeyPatch, mode: Any) -> None:
    monkeypatch.setattr(wakepy, "keep", SimpleNamespace(running=lambda **_: mode))


def test_it_is_kept_awake_for_as_long_as_the_session_lasts_and_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    mode = Mode(True)
    system(monkeypatch, mode)
    ended = KeyError()

    def session() -> None:
        with kept_awake(said.append):
            assert mode.entered
            raise ended

    with pytest.raises(KeyError):
        session()
    assert not mode.entered
    assert not said


@pytest.mark.parametrize("answer", [False, RuntimeError("no bus")])
def test_where_it_cannot_be_that_is_said_once_and_the_session_goes_on(
    answer: bool | Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    system(monkeypatch, Mode(answer))
    with kept_awake(said.append):
        went_on = True
    assert went_on
    (text,) = said
    assert "cannot be kept awake" in text
    assert text.endswith("switch its sleep off in its settings")
    assert ("no bus" in text) == isinstance(answer, Exception)
