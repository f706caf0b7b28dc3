"""Expected uncertainty of a campaign, before the day: a rig, one nominal shot, and what would be better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import Fault, FaultCode, IdentificationError, ReadError, RigError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.remark import findings_of
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.arguments import named_shot
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.stored_shot import read_stored
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.version import __version__
from recoil_identification.campaign.advice import worked_out
from recoil_identification.campaign.joint_rows import Scatter
from recoil_identification.campaign.prediction import (
    OTHER_SHOTS,
    SUPPOSED,
    Found,
    NominalShot,
    Plan,
    alone,
    found_by,
    predicted_u_rel,
    what_ifs,
)
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.shot_summary import geometry_of
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.stated_uncertainty import SCALED_ROLES, with_uncertainties
from recoil_rigs.twin import CampaignPlan, simulate_shot, virtual_settings
from recoil_rigs.twin.draws import usual_noise

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "recoil-daq/predict/1"
NOMINAL = "nominal"
"""Name of the shot that is simulated."""
SIMULATED_SHARE = 0.2
"""Share of the mass that the second nominal shot carries in addition, where no other added mass is asked for."""
LARGEST_ADDED_SHARE = 2.0
"""Share of the mass beyond which what is added is no part of the same mechanism any more: grams for kilograms,
perhaps."""
MOST_SHOTS, MOST_CHARGES = 1000, 4
"""Largest numbers of shots and of different charges, each of which is simulated."""
NOTHING_FOUND = Found(None, (), None)
EXPECTED = ("added_mass_kg", "u_added_mass_kg", "charges", "friction_scatter", "repeatability")
"""Keys of a campaign's plan that are known before the day."""


@dataclass(frozen=True, repr=False)
class Predicted(Printed):
    """Expected uncertainty of a campaign.

    Attributes
    ----------
    document
        Document of ``predict --json``.
    """

    document: dict[str, Any]

    @property
    def u_rel(self) -> float:
        """Relative standard uncertainty of one shot's mass."""
        return float(self.document["u_rel"])

    @property
    def campaign(self) -> pd.DataFrame:
        """One row for each number of shots, without and with an added mass: `shots`, `added_mass_kg`, `u_rel`."""
        import pandas as pd

        return pd.DataFrame(self.document["campaign"])

    @property
    def what_if(self) -> pd.DataFrame:
        """One row for each change, the best first: `change`, `u_rel_shot`, `u_rel_campaign`."""
        import pandas as pd

        return pd.DataFrame(self.document["what_if"])

    @property
    def valid(self) -> bool:
        """Whether the nominal shot's own mass is to be trusted."""
        return bool(self.document["valid"])

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``predict --json``."""
        return self.document

    def show(self) -> None:
        """Print what to expect of a shot and of campaigns, and what would be better."""
        from recoil_daq.terminal.prediction import print_predicted

        print_predicted(self.to_json())

    def __repr__(self) -> str:
        return f"Predicted({self.document['rig']!r}: u {100 * self.u_rel:.3f} % a shot)"


@on_one_thread
def predict(
    rig: Rig,
    *,
    from_shot: str | Path | None = None,
    shots: int = 8,
    plan: CampaignPlan | None = None,
    uncertainties: Mapping[str, float] | None = None,
    progress: Progress = lambda _: None,
) -> Predicted:
    """Say how well a campaign will tell the mass, and what would make it better.

    Parameters
    ----------
    rig
        Rig of the campaign, with a table ``[twin]`` unless a shot is given.
    from_shot
        Shot file of the rig, whose motion and forces are taken for those of the shots to come.
    shots
        Number of shots in the campaign, 1 to 1000.
    plan
        Plan of the campaign: the mass that every second shot is to carry in addition, up to four different charges, and
        by how much gains and friction do not repeat from shot to shot; where it does not state that, the little that a
        few shots cannot tell from nothing.
    uncertainties
        Standard uncertainties in place of the rig's: ``p_breech.u_rel`` (a channel's) as a share, ``u_friction``,
        ``u_bore_area`` and the other areas' in their units, ``u_bore_friction``, of those that the rig's model has.
    progress
        Function called with the name of each step.

    Raises
    ------
    ValueError
        If the plan does not go with the number of shots, or has what nobody can expect.
    RigError
        If an uncertainty is none of the rig's, the added mass is no part of it, or it cannot be simulated.
    ReadError, StoreError
        If the shot is of another rig, or its file is at fault.
    IdentificationError
        If the nominal shot has no mass.
    """
    planned = plan or CampaignPlan()
    check_expected(shots, planned, recorded=from_shot is not None)
    expected = _expected(rig, shots, planned)
    supposed = with_uncertainties(rig, uncertainties or {})
    if from_shot is None:
        found, nominal = _simulated(rig, expected, progress)
    else:
        found, nominal = _recorded(rig, Path(from_shot), progress)
    progress("predict")
    nominal = [one.known_by(supposed) for one in nominal]
    of_itself = _row(nominal, expected)
    of_others = worked_out(
        {f"{one.shots} shots, {one.added_mass_kg:g} kg added": partial(_row, nominal, one) for one in _others(expected)}
    )
    others = what_ifs(nominal, supposed, expected)
    found_changes = worked_out({"the smallest changes that are found": partial(found_by, nominal, expected)})
    (changes,) = found_changes.lines or (NOTHING_FOUND,)
    notes = (*of_others.notes, *others.notes, *found_changes.notes)
    document = {
        "schema": SCHEMA,
        "rig": rig.name,
        "from": None if from_shot is None else str(from_shot),
        "mass_kg": nominal[0].mass_kg,
        "u_rel": predicted_u_rel(nominal, alone(expected)),
        "shots": expected.shots,
        "added_mass_kg": expected.added_mass_kg,
        "charges": list(expected.charges),
        "campaign": sorted([of_itself, *of_others.lines], key=lambda row: (row["shots"], row["added_mass_kg"])),
        "what_if": [
            {"change": one.change, "u_rel_shot": one.u_rel_shot, "u_rel_campaign": one.u_rel_campaign}
            for one in others.lines
        ],
        "least_found": {
            "mass_step_kg": changes.mass_step_kg,
            "drifts": [{"influence": label, "size": size} for label, size in changes.drifts],
            "u_difference_kg": changes.u_difference_kg,
        },
        "repeatability": {"gain_rel": expected.scatter.gain_rel, "friction_rel": expected.scatter.friction_rel},
        "valid": not found.reasons,
        "reasons": list(found.reasons),
        "notes": list(notes),
        "findings": findings_of(found.reasons, notes),
        "provenance": {
            "version": __version__,
            "inputs": [] if from_shot is None else [_input(Path(from_shot))],
            "parameters": {
                "plan": {} if plan is None else plan.model_dump(mode="json", exclude_unset=True),
                "uncertainties": dict(uncertainties or {}),
            },
        },
    }
    return Predicted(document)


def check_expected(shots: int, plan: CampaignPlan, *, recorded: bool) -> None:
    """Check whether a campaign can be predicted; `recorded` if by a shot file.

    Raises
    ------
    ValueError
        If it has no shots, or none that could have all that is planned, or what nobody can expect is planned.
    """
    plan.check_shots(shots)
    if not 1 <= shots <= MOST_SHOTS:
        raise ValueError(f"shots must be 1 to {MOST_SHOTS}, not {shots}")
    if unexpected := plan.model_fields_set.difference(EXPECTED):
        raise ValueError(f"{', '.join(sorted(unexpected))}: nobody expects that of shots to come")
    if recorded and plan.charges:
        raise ValueError("charges: a recorded shot tells of its own only")
    if len(set(plan.charges)) > MOST_CHARGES:
        raise ValueError(f"charges: {len(set(plan.charges))} different ones, and at most {MOST_CHARGES} are simulated")


def _expected(rig: Rig, shots: int, plan: CampaignPlan) -> Plan:
    """Return what is expected of a campaign."""
    added_kg, mass_kg = plan.added_mass_kg or 0.0, rig.mechanism.m3
    if added_kg > LARGEST_ADDED_SHARE * mass_kg:
        problem = f"{added_kg:g} kg are more than {LARGEST_ADDED_SHARE:g} times the recoiling mass of {mass_kg:g} kg"
        raise RigError(rig.path, [Fault(("added mass",), problem, FaultCode.RANGE)])
    scatter = Scatter(
        plan.repeatability if "repeatability" in plan.model_fields_set else SUPPOSED.gain_rel,
        plan.friction_scatter if "friction_scatter" in plan.model_fields_set else SUPPOSED.friction_rel,
    )
    return Plan(shots, added_kg, plan.u_added_mass_kg, scatter, plan.charges or (1.0,))


def _others(expected: Plan) -> list[Plan]:
    """Return the same campaign with other numbers of shots, each without and with the added mass."""
    planned = [
        replace(expected, shots=n, added_mass_kg=added_kg)
        for n in {1, *OTHER_SHOTS, expected.shots}
        for added_kg in {0.0, expected.added_mass_kg if n > 1 else 0.0}
    ]
    return [one for one in planned if one != expected]


def _row(nominal: Sequence[NominalShot], plan: Plan) -> dict[str, float]:
    u_rel = predicted_u_rel(nominal, plan)
    return {"shots": plan.shots, "added_mass_kg": plan.added_mass_kg, "u_rel": u_rel}


def _simulated(rig: Rig, plan: Plan, progress: Progress) -> tuple[Identification, list[NominalShot]]:
    """Fire the virtual rig as planned, and identify its shots as they would be recorded."""
    if not rig.twin:
        problem = "is missing: without it nothing says how the mechanism moves; state it, or give a recorded shot"
        raise RigError(rig.path, [Fault(("twin",), problem, FaultCode.MISSING)])
    mass_kg = rig.mechanism.m3
    usual, *others = dict.fromkeys(plan.charges)
    progress("nominal shot")
    first = _fired(rig, usual, Options())
    nominal = [NominalShot.of(mass_kg, 0.0, first.summary, usual)]
    options = Options(mass_cutoff_hz=first.route.mass_low_pass.cutoff_hz)
    added_kg = plan.added_mass_kg or float(f"{SIMULATED_SHARE * mass_kg:.2g}")
    for more_kg, charge in ((added_kg, usual), *((0.0, charge) for charge in others)):
        progress(f"nominal shot with {more_kg:g} kg more, {charge:g} of the charge")
        one = _fired(rig.with_added_mass(more_kg, None), charge, options)
        nominal.append(NominalShot.of(mass_kg, more_kg, one.summary, charge))
    return first, nominal


def _fired(rig: Rig, charge: float, options: Options) -> Identification:
    settings = virtual_settings(rig)
    changed = settings.undrawn() | settings.with_charge(charge) | {"readings": usual_noise(settings)}
    whole = replace(rig, twin={key: value for key, value in rig.twin.items() if key != "m3_true"} | changed)
    virtual = replace(whole, twin={**whole.twin, "duration_s": settings.telling_s})
    with temporary_folder() as folder:
        files = Path(folder) / "files"
        try:
            fired = simulate_shot(virtual, files, seed=1, shot=NOMINAL)
        except RigError:
            # a slow mechanism, or nothing that can be simulated at all
            virtual = whole
            fired = simulate_shot(virtual, files, seed=1, shot=NOMINAL)
        done = ingest_files(virtual, fired.files, shot=NOMINAL, out=Path(folder) / "shots")
    return identify_shot(FiredShot(done.shot, virtual), options)


def _recorded(rig: Rig, path: Path, progress: Progress) -> tuple[Identification, list[NominalShot]]:
    """Identify a recorded shot, and take its motion for that of the shots to come."""
    progress(f"read {path.name}")
    path = named_shot(path)
    fired = read_stored(path)
    _refuse_other(rig, fired.rig, path)
    progress(f"identify {path.name}")
    found = identify_shot(fired, Options())
    added_kg = fired.rig.added_mass_kg
    mass_kg = found.chosen.estimate.mass_kg - added_kg
    if mass_kg <= 0:
        raise IdentificationError("the shot's mass is less than what was added to it", found=f"{mass_kg:g} kg")
    return found, [NominalShot.of(mass_kg, added_kg, found.summary)]


def _refuse_other(rig: Rig, recorded: Rig, path: Path) -> None:
    """Refuse a shot of another stand: what it tells would be taken with certificates of other sensors."""

    def described_by(one: Rig) -> dict[str, object]:
        return {
            "name": one.name,
            **{channel.name: channel.role for channel in one.channels if channel.role in SCALED_ROLES},
        }

    stated, of_shot = geometry_of(rig.mechanism), geometry_of(recorded.mechanism)
    # what one of them does not state is not compared
    both = [symbol for symbol in stated if symbol in of_shot]
    expected = {**described_by(rig), **{symbol: stated[symbol] for symbol in both}}
    found = {**described_by(recorded), **{symbol: of_shot[symbol] for symbol in both}}
    if other := [key for key in {**expected, **found} if expected.get(key) != found.get(key)]:
        raise ReadError(
            "the shot was recorded on another rig", path=path,
            expected=", ".join(f"{key} {expected.get(key, 'missing')}" for key in other),
            found=", ".join(f"{key} {found.get(key, 'missing')}" for key in other),
            remedy="give a shot of this rig, or the rig as it was then",
        )  # fmt: skip


def _input(path: Path) -> dict[str, str]:
    one = InputFile.of(path)
    return {"file": one.name, "sha256": one.sha256}
