"""Lines on the preview that an instrument's own file replaced: how both stand beside each other, and their masses."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from recoil_acquisition.shot.quality_check import Check

LARGE_DIFFERENCE = 0.05
"""Difference of the masses by preview and file, in standard uncertainties, beyond which it is another mass."""


def previewed_sources(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the sources of which a shot file has what was read live alone, by a document of ``ingest --json``."""
    return tuple(one["channel"] for one in document.get("quality", ()) if one["check"] == Check.PREVIEW.value)


def preview_of(sources: Collection[str]) -> tuple[str, ...]:
    """Say why a mass is not the last word, where the own files of some sources are to come; nothing of none."""
    return (f"preview of {', '.join(sorted(sources))}",) if sources else ()


def compared_lines(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a line for each thing that the comparison with the preview found, by a document of ``ingest --json``."""
    found = [one for one in document.get("quality", ()) if one["check"] == Check.PREVIEW_COMPARED.value]
    return tuple(f"{one['channel']}: {one['detail']}" for one in found)


def mass_by_file(preview: Mapping[str, Any], mass: Mapping[str, Any]) -> str:
    """Say by how much the mass by the instruments' own files differs from that by the preview, in u.

    Parameters
    ----------
    preview, mass
        Masses of `recoil_daq.live.shot.LiveShot`.
    """
    apart_kg = mass["value"] - preview["value"]
    in_u = abs(apart_kg) / mass["u"]
    if in_u <= LARGE_DIFFERENCE:
        return f"the file gives the mass of the preview: {apart_kg:+.3g} kg, {in_u:.2g} u"
    return f"the file CHANGES THE MASS of the preview by {apart_kg:+.3g} kg, {in_u:.2g} u"
