"""A shot as if it had been fired and recorded once more: the same samples out of other files."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from recoil_acquisition.shot.shot import Shot


def fired_again(shot: Shot, name: str) -> Shot:
    """Give a shot another name, and its recorded files other digests: those of one recording are one shot."""
    inputs = tuple(
        replace(one, sha256=hashlib.sha256(f"{name} {one.sha256}".encode()).hexdigest()) for one in shot.inputs
    )
    return replace(shot, name=name, inputs=inputs)
