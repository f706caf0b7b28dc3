"""Real recordings beside the checkout, where there are any."""

from __future__ import annotations

from pathlib import Path

import pytest

_FOLDER = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def shared_file(name: str) -> Path:
    """Return a real file, or skip the test aloud."""
    path = _FOLDER / name
    if not path.exists():
        pytest.skip(f"the real file {name} is not on this machine")
    return path
