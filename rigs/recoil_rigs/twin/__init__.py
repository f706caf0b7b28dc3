"""The virtual rig: one simulated shot as the vendors' files that the real rig would have written.

`simulate_shot` integrates the three-body model, or one body on a line, lets the rig's sensors measure it with their
errors, stress waves and clocks, and writes the files together with what they hide (``truth.json``).
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from recoil_acquisition.errors import ErrorCode, Fault, RigError, StoreError, system_errors_as
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import Rig, Source
from recoil_rigs.twin.campaign import CampaignPlan, PlannedShot
from recoil_rigs.twin.can_node import can_files
from recoil_rigs.twin.gun_scene import draw_gun_scene, gun_impulses, gun_parts, gun_truth
from recoil_rigs.twin.line_scene import draw_line_scene, line_impulses, line_truth_of
from recoil_rigs.twin.line_settings import LineSettings
from recoil_rigs.twin.serial_sensor import serial_file
from recoil_rigs.twin.settings import TwinSettings, read_settings
from recoil_rigs.twin.sources import Scene, SourceFile, camera_file, dewetron_file
from recoil_rigs.twin.virtual_settings import set_apart, virtual_settings, with_settings

__all__ = [
    "CampaignPlan",
    "ErrorCode",
    "LineSettings",
    "PlannedShot",
    "TwinSettings",
    "TwinShot",
    "draw_scene",
    "read_settings",
    "simulate_shot",
    "virtual_settings",
    "with_settings",
]


class _Model(NamedTuple):
    """Functions of a kind of mechanism: what is drawn of it, and the truth of its motion, parts and unread forces."""

    draw: Callable[..., Scene]
    truth: Callable[..., dict[str, Any]]
    parts: Callable[..., dict[str, Any]]
    impulses: Callable[..., dict[str, float]]


_MODELS: Mapping[type[Mechanism], _Model] = {
    Gun: _Model(draw_gun_scene, gun_truth, gun_parts, gun_impulses),
    Line: _Model(draw_line_scene, line_truth_of, lambda *_: {}, line_impulses),
}
_RECORDERS: Mapping[str, Callable[[Scene, Source, list[Fault]], SourceFile]] = {
    "dewetron": dewetron_file,
    "serial": serial_file,
    "camera": camera_file,
}


@dataclass(frozen=True)
class TwinShot:
    """One simulated shot.

    Attributes
    ----------
    files
        The recorders' files, to be ingested, in the order of the rig's sources.
    truth
        The content of ``truth_file``.
    """

    shot: str
    folder: Path
    files: tuple[Path, ...]
    rig_file: Path
    truth_file: Path
    truth: Mapping[str, Any]


def simulate_shot(
    rig: Rig,
    folder: Path,
    *,
    seed: int,
    shot: str,
    campaign_seed: int | None = None,
    planned: PlannedShot | None = None,
) -> TwinShot:
    """Simulate one shot of a rig and write the files that its recorders would have written.

    The same rig, seed and shot name give the same bytes. Nothing is written unless all of it can be.

    Parameters
    ----------
    rig
        Rig with a complete mechanism; its table ``[twin]`` holds the settings, see `TwinSettings`.
    folder
        Folder of the files; it is made if it is not there.
    seed
        Seed of what is drawn, not negative.
    shot
        The shot's identifier; part of the file names.
    campaign_seed
        Shots with the same one share their sensors: the errors of scales and friction are drawn by it, all else by
        `seed`.
    planned
        Shot of a campaign's plan, see `CampaignPlan`; none if left out.

    Raises
    ------
    RigError
        With every reason why this rig cannot be simulated.
    StoreError
        If a file exists already, or cannot be written.
    ValueError
        If the seed is negative or the shot's name is not fit for a file name.

    Notes
    -----
    Keys of the truth of a body on a line: ``m3``, ``carried_mass``, ``friction``, ``slide_friction`` as drawn;
    ``t_fire`` and ``t_end``, start of the push or the strokes and end of the last motion; ``stroke_m``,
    ``peak_speed_m_s``, ``peak_driving_force_n``, ``peak_resisting_force_n``; the rest as of a gun.

    Keys of the truth of a gun, SI: ``m3``; ``m3_after`` and ``t_release``, if a part of the mass lets go, what is left
    and from when on the reference clock; ``friction``; ``bore_friction``; ``t_fire`` and ``t_end``,
    first rise of the breech force and end of recoil travel on the reference clock; ``stroke_m``;
    ``peak_breech_force_n``; ``gains`` and
    ``offsets`` by channel (offsets in the unit of the file); ``moves``, by channel how zeros moved in the shot and
    what optics bent, where the rig states that they may; ``clocks``: ``t_ref = (1 + drift) t + offset_s``,
    with ``latency_s``, the mean time from a sample to its stamp where a recorder stamps messages (an alignment
    by a repeated channel finds ``offset_s`` less the shortest such time, the stamps' lower edge); the declared
    ``delay_s`` of a sensor is not in it;
    ``tube``, if it is flexible: the frequencies at which it would bend if clamped to what does not move, its end's
    sag at rest and largest deflection from there;
    ``unread``, the forces that no gauge reads, if there are any: ``share`` and ``form`` as drawn, ``forces`` with the
    keys of ``[twin.unread]``, ``impulse_n_s`` that they took in the recoil and ``impulse_share``, its share of the
    impulse of brake and recuperator, ``delays`` of gauges by channel; ``noise``, what the motion brings and how much of
    it is there at rest; ``readings``, other keys of ``[twin.readings]`` that were set; ``settings``, what the rig's
    ``[twin]`` has by dotted key that its file does not say;
    ``campaign_seed``, if there is one;
    ``added_mass_kg`` (the true one, which ``m3`` includes), ``configuration`` and ``campaign``, all that was planned
    and drawn of the campaign for this shot, if it was planned;
    ``sources``: all that is known of each source's file; ``cam_offset``, ``cam_drift`` and ``lost_frames`` of
    the (first) camera; ``seed``.
    """
    if seed < 0:
        raise ValueError(f"seed must not be negative, not {seed}")
    if campaign_seed is not None and campaign_seed < 0:
        raise ValueError(f"campaign_seed must not be negative, not {campaign_seed}")
    if not shot or PurePath(shot).name != shot or shot in (".", ".."):
        raise ValueError(f"shot must be fit for a file name, not {shot!r}")
    scene = draw_scene(rig, seed, shot, campaign_seed, planned)
    faults: list[Fault] = []
    sources = [s for s in rig.sources if any(c.source == s.name for c in rig.channels)]
    of_buses: dict[str, SourceFile] = {}
    recorded = []
    for source in sources:
        if source.kind == "can" and not of_buses:
            of_buses = {file.source: file for file in can_files(scene, [s for s in sources if s.kind == "can"], faults)}
        is_bus = source.name in of_buses
        recorded.append(of_buses[source.name] if is_bus else _RECORDERS[source.kind](scene, source, faults))
    if faults:
        raise RigError(rig.path, faults)
    truth = _truth(scene, recorded)
    contents = {file.name: file.content for file in recorded}
    contents["rig.toml"] = rig.text.encode("utf-8")
    for name, text in rig.databases.items():
        if PurePath(name).name == name:
            contents[name] = text.encode("cp1252", errors="replace")
    contents["truth.json"] = (json.dumps(truth, indent=2) + "\n").encode("utf-8")
    _write(folder, contents)
    files = tuple(dict.fromkeys(folder / file.name for file in recorded))
    return TwinShot(shot, folder, files, folder / "rig.toml", folder / "truth.json", truth)


def draw_scene(
    rig: Rig, seed: int, shot: str, campaign_seed: int | None = None, planned: PlannedShot | None = None
) -> Scene:
    """Draw what this shot's mechanism truly is, and let it move; parameters as of `simulate_shot`.

    Raises
    ------
    RigError
        If it cannot be simulated.
    """
    return _MODELS[type(rig.mechanism)].draw(rig, seed, shot, campaign_seed, planned)


def _truth(scene: Scene, recorded: list[SourceFile]) -> dict[str, Any]:
    motion, model = scene.motion, _MODELS[type(scene.rig.mechanism)]
    truth: dict[str, Any] = {
        "shot": scene.shot,
        "seed": scene.seed,
        "m3": scene.mechanism.m3,
        **model.truth(scene, motion),
        "gains": scene.gains,
        "offsets": scene.offsets,
        **({"moves": scene.moves} if scene.moves else {}),
        "clocks": {f.source: f.truth["clock"] for f in recorded if f.source != scene.rig.reference_clock},
        "sources": {f.source: {"file": f.name, **f.truth} for f in recorded},
    }
    if scene.campaign_seed is not None:
        truth["campaign_seed"] = scene.campaign_seed
    if scene.planned is not None:
        truth |= scene.planned.truth()
    truth |= model.parts(scene, motion)
    if scene.unread or scene.late:
        acts: dict[str, Any] = {}
        if scene.unread:
            acts = {**scene.unread, **model.impulses(scene, motion)}
        truth["unread"] = acts | ({"delays": scene.late} if scene.late else {})
    if given := set_apart(scene.rig):
        truth["settings"] = given
    if scene.noise:
        truth["noise"] = dict(scene.noise)
    readings = scene.settings.readings.model_dump(exclude_defaults=True, exclude=set(scene.noise))
    if readings:
        truth["readings"] = readings
    for file in recorded:
        if "lost_frames" in file.truth and "cam_offset" not in truth:
            truth["cam_offset"], truth["cam_drift"] = file.truth["clock"]["offset_s"], file.truth["clock"]["drift"]
            truth["lost_frames"] = file.truth["lost_frames"]
    return truth


def _write(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write all files into a folder, none over an existing one; none of them is there unless it is whole."""
    for name in contents:
        if (folder / name).exists():
            raise StoreError.exists(folder / name, "choose another folder or remove it first")
    partials = {name: partial_path(folder / name) for name in contents}
    try:
        with system_errors_as(StoreError, folder, "written", "choose another folder with --out, or make room there"):
            folder.mkdir(parents=True, exist_ok=True)
            for name, content in contents.items():
                partials[name].write_bytes(content)
            for name, partial in partials.items():
                give_name(partial, folder / name)
    finally:
        for partial in partials.values():
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
