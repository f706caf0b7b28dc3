"""Sources that somebody wants left out of a shot: which may be."""

from __future__ import annotations

from collections.abc import Sequence

from recoil_acquisition.errors import ReadError, did_you_mean
from recoil_rigs.rig import Rig


def left_out(rig: Rig, names: Sequence[str], *, armed: bool = False) -> frozenset[str]:
    """Return the sources of a rig that are left out.

    Parameters
    ----------
    armed
        Whether the rig's trigger must find its channels without them.

    Raises
    ------
    ReadError
        If a name is of no source, or nothing can be done without that source.
    """
    sources = [source.name for source in rig.sources]
    watched = () if rig.trigger is None or not armed else rig.trigger.channels
    for name in names:
        if name not in sources:
            raise ReadError(f"no source {name!r} to leave out", path=rig.path, remedy=did_you_mean(name, sources))
        if name == rig.reference_clock:
            raise ReadError(
                f"source {name!r} cannot be left out: all other clocks are aligned to it", path=rig.path,
                remedy="take it away from --without, and give its file",
            )  # fmt: skip
        if seen := [channel.name for channel in rig.channels_of(name) if channel.name in watched]:
            raise ReadError(
                f"source {name!r} cannot be left out: the trigger looks at {', '.join(seen)}", path=rig.path,
                remedy="take it away from --without, or let the trigger look at another channel",
            )  # fmt: skip
    return frozenset(names)
