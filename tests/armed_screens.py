"""Writes the armed screen of each state of `tests.builders.range_states` into tests/recoil_daq/live/screens.

A test compares them with what is drawn; whoever changes the screen writes them anew and looks at every one.
"""

from __future__ import annotations

from pathlib import Path

from tests.builders.range_states import SIZES, STATES, screen_text

SCREENS = Path(__file__).resolve().parent / "recoil_daq" / "live" / "screens"


def screens_of(name: str) -> str:
    """Return the text of a file: the screens of one state, from the smallest terminal to the largest."""
    parts = [f"== {width}x{height}\n{screen_text(name, width, height)}\n" for width, height in SIZES]
    return "\n".join(parts)


if __name__ == "__main__":
    SCREENS.mkdir(exist_ok=True)
    for state in STATES:
        (SCREENS / f"{state}.txt").write_text(screens_of(state), encoding="utf-8", newline="\n")
