"""The virtual rig: one simulated shot as the vendors' files that the real rig would have written.

`simulate_shot` integrates the three-body model, or one body on a line, lets the rig's sensors measure it with their
errors, stress waves and clocks, and writes the files together with what they hide (``truth.json``).
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from recoil_acquisition.errors import ErrorCode, Fault, FaultCode, RigError, StoreError
from recoil_rigs.mechanism.beam import shapes
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import Rig, Source
from recoil_rigs.twin.breech_chain import with_breech_chain
from recoil_rigs.twin.campaign import CampaignPlan, PlannedShot
from recoil_rigs.twin.can_node import can_files
from recoil_rigs.twin.draws import draw_forces, draw_noise
from recoil_rigs.twin.instruments import generator, stress_waves
from recoil_rigs.twin.line_motion import LineMotion
from recoil_rigs.twin.line_scene import draw_line_scene, line_impulses, line_truth_of
from recoil_rigs.twin.line_settings import LineSettings
from recoil_rigs.twin.loads import check_statics
from recoil_rigs.twin.motion import Motion, simulate_motion, tube_of
from recoil_rigs.twin.recorder_settings import measured_roles
from recoil_rigs.twin.serial_sensor import serial_file
from recoil_rigs.twin.settings import TwinSettings, read_settings
from recoil_rigs.twin.sources import Scene, SourceFile, camera_file, dewetron_file
from recoil_rigs.twin.virtual_settings import set_apart, virtual_settings, with_settings

__all__ = [
    "CampaignPlan",
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

LARGEST_BORE_FRICTION = 0.5
"""Largest bore friction that is drawn, share of the breech force."""
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
    return _SCENES[type(rig.mechanism)](rig, seed, shot, campaign_seed, planned)


def _draw_gun_scene(rig: Rig, seed: int, shot: str, campaign_seed: int | None, planned: PlannedShot | None) -> Scene:
    settings = with_breech_chain(rig, read_settings(rig), seed if campaign_seed is None else campaign_seed)
    m3_kg, charge, friction_factor = settings.m3_true or rig.mechanism.m3, 1.0, 1.0
    unread = draw_forces(dataclasses.replace(rig.mechanism, m3=m3_kg), settings, seed, campaign_seed)
    noise = draw_noise(settings, seed, campaign_seed)
    settings = settings.model_copy(update={"unread": unread.forces, "readings": noise.readings})
    if planned is not None:
        m3_kg, charge, friction_factor = planned.m3_kg(m3_kg), planned.charge, planned.friction_factor
    mechanism = dataclasses.replace(rig.mechanism, m3=m3_kg)
    faults = check_statics(mechanism, settings)
    if faults:
        raise RigError(rig.path, faults)
    rng = generator(seed, "shot")
    peak_scatter, friction_error = rng.normal(0.0, 1.0, 2)
    if campaign_seed is not None:
        friction_error = generator(campaign_seed, "friction").normal()
    friction = mechanism.friction + settings.friction_error * mechanism.u.get("friction", 0.0) * float(friction_error)
    u_bore = settings.friction_error * mechanism.u.get("bore_friction", 0.0)
    if u_bore:
        drawn = generator(seed if campaign_seed is None else campaign_seed, "bore friction").normal()
        in_bore = min(max(mechanism.bore_friction + u_bore * float(drawn), 0.0), LARGEST_BORE_FRICTION)
        mechanism = dataclasses.replace(mechanism, bore_friction=in_bore)
    motion = simulate_motion(
        mechanism,
        settings,
        peak_pressure_pa=charge * settings.peak_pressure_pa * (1.0 + settings.shot_to_shot * float(peak_scatter)),
        friction_n=max(friction_factor * friction, 0.0),
    )
    if not motion.t_end_s <= settings.duration_s:
        problem = f"the recoil does not end within {settings.duration_s} s; it has come {motion.q[-1, 4]:.3f} m"
        raise RigError(rig.path, [Fault(("twin", "duration_s"), problem, FaultCode.CONTRADICTION)])
    if motion.released_kg and not motion.t_release_s < motion.t_end_s:
        ends = motion.t_end_s - motion.t_fire_s
        problem = f"the recoil ends {ends:.4f} s after it begins"
        raise RigError(rig.path, [Fault(("twin", "release_after_s"), problem, FaultCode.CONTRADICTION)])
    modes = stress_waves(motion.times_s, motion.t_fire_s, motion.t_end_s, generator(seed, "stress waves"))
    roles = measured_roles(rig, settings)
    return Scene(
        rig, settings, mechanism, motion, modes, roles, seed, shot, campaign_seed, planned, unread.truth, noise.truth
    )


_SCENES: Mapping[type[Mechanism], Callable[..., Scene]] = {Gun: _draw_gun_scene, Line: draw_line_scene}


def _truth(scene: Scene, recorded: list[SourceFile]) -> dict[str, Any]:
    motion = scene.motion
    truth: dict[str, Any] = {
        "shot": scene.shot,
        "seed": scene.seed,
        "m3": scene.mechanism.m3,
        **(line_truth_of(scene, motion) if isinstance(motion, LineMotion) else _truth_of_gun(scene, motion)),
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
    if isinstance(motion, Motion):
        truth |= _parts_of_gun(scene, motion)
    if scene.unread or scene.late:
        acts: dict[str, Any] = {}
        if scene.unread:
            impulses = line_impulses(motion) if isinstance(motion, LineMotion) else _impulses(scene, motion)
            acts = {**scene.unread, **impulses}
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


def _truth_of_gun(scene: Scene, motion: Motion) -> dict[str, Any]:
    """Return what the truth says of the forces and the recoil of a gun alone."""
    return {
        "friction": float(motion.friction_n.max()),
        "bore_friction": scene.mechanism.bore_friction,
        "t_fire": motion.t_fire_s,
        "t_end": motion.t_end_s,
        "stroke_m": float(motion.q[:, 4].max()),
        "peak_breech_force_n": float(scene.mechanism.force_areas[0] * motion.breech_pressure_pa.max()),
    }


def _parts_of_gun(scene: Scene, motion: Motion) -> dict[str, Any]:
    """Return what the truth says of a part that lets go, and of a flexible tube."""
    truth: dict[str, Any] = {}
    if motion.released_kg:
        truth["m3_after"] = scene.mechanism.m3 - motion.released_kg
        truth["t_release"] = motion.t_release_s
    settings = scene.settings
    tube = tube_of(scene.mechanism, settings) if isinstance(settings, TwinSettings) else None
    if tube is not None and isinstance(settings, TwinSettings):
        ends = shapes(settings.tube_length_m, tube.modes, [settings.tube_length_m])[0][:, 0]
        end = motion.modal @ ends
        truth["tube"] = {
            "clamped_frequencies_hz": (np.sqrt(tube.stiffness_n_m / tube.mass_kg) / (2 * np.pi)).tolist(),
            "sag_m": float(-end[0]),
            "largest_deflection_m": float(np.max(np.abs(end - end[0]))),
        }
    return truth


def _impulses(scene: Scene, motion: Motion) -> dict[str, float]:
    """Return the impulse that is not read up to the end of the recoil, N s, and its share of that which is."""
    m = scene.mechanism
    recoils = motion.times_s <= motion.t_end_s
    read_n = m.brake_area * motion.brake_pressure_pa + m.recuperator_area * motion.recuperator_pressure_pa
    unread, read = (
        float(np.trapezoid(force[recoils & (motion.times_s >= motion.t_fire_s)], dx=float(motion.times_s[1])))
        for force in (motion.unread_n, read_n)
    )
    return {"impulse_n_s": unread, "impulse_share": unread / read}


def _write(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write all files into a folder, none over an existing one."""
    for name in contents:
        if (folder / name).exists():
            raise StoreError(
                "exists already",
                code=ErrorCode.EXISTS,
                path=folder / name,
                remedy="choose another folder or remove it first",
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            with (folder / name).open("xb") as file:
                file.write(content)
    except OSError as error:
        raise StoreError(f"cannot be written: {error.strerror}", path=error.filename or folder) from error
