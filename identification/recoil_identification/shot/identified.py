"""The options of an identification, and its result for one shot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.files.strict_json import as_floats
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Note, Reason
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import MassConstancy, MassOverTime
from recoil_identification.calibration.methods import AS_RECORDED, CAMERA_METHODS, FURTHER, METHODS, Method
from recoil_identification.calibration.skew import RecorderSkew
from recoil_identification.calibration.suspicion import ShotSuspicion
from recoil_identification.calibration.trace import MassTrace
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.mass import LOGARITHMIC, MassEstimate
from recoil_identification.estimate.monte_carlo import IntervalBy, MonteCarlo
from recoil_identification.estimate.rounding import in_kg
from recoil_identification.estimators.endogeneity import Endogeneity
from recoil_identification.memory.window_length import WindowChoice
from recoil_identification.rows.equation_of_motion import MASS
from recoil_identification.shot.baseline import Baseline
from recoil_identification.shot.force_checks import ForceCheck
from recoil_identification.shot.route import Route
from recoil_identification.shot.shot_summary import ShotSummary
from recoil_identification.shot.stress_waves import StressWaves
from recoil_processing.filters import LowPassFilter
from recoil_processing.filters.table import USUAL, filter_names, filter_of
from recoil_processing.quality.repeatability import ShotPeaks
from recoil_processing.shot.error_source import ErrorSource
from recoil_processing.shot.regression import MEMORY_S, spaced_rows
from recoil_processing.spectra.cutoff import CutoffChoice
from recoil_rigs.tables.specification import Specification


@dataclass(frozen=True)
class Options:
    """Options of an identification.

    Attributes
    ----------
    method
        One of `METHODS`, ``camera`` or `FURTHER`; it gives the mass and the trace of the report. None for the one that
        `recoil_identification.shot.default_method` says.
    cutoff_hz
        -3 dB point of the zero-phase low-pass of both sides; None to choose it from the data.
    window_s
        Memory of the trace; None to choose it from the shot, see `recoil_identification.calibration.trace`.
    campaign
        Cut-off chosen for several shots, this one among them.
    mass_cutoff_hz
        Cut-off of the low-pass of the fit of the mass, for several shots; None to take the force's own band.
    compare
        Whether those of `FURTHER` are all computed.
    filter
        Name of the low-pass, of `recoil_processing.filters.table.filter_names`.
    thin
        Whether channels faster than `recoil_processing.shot.thinned.THINNED_ABOVE_HZ` are thinned: for the number soon
        after the shot.

    Raises
    ------
    ValueError
        If method or filter are unknown, or cut-off or window are not positive.
    TypeError
        If one of these is no number.
    """

    method: Method | None = None
    cutoff_hz: float | None = None
    window_s: float | None = MEMORY_S
    campaign: CutoffChoice | None = None
    compare: bool = False
    mass_cutoff_hz: float | None = None
    thin: bool = False
    filter: str = USUAL

    def __post_init__(self) -> None:
        known = tuple(dict.fromkeys((*METHODS, *CAMERA_METHODS, *FURTHER)))
        if self.method is not None and self.method not in known:
            raise ValueError(f"method must be one of {', '.join(known)}, not {self.method!r}")
        if self.filter != USUAL and self.filter not in filter_names():
            raise ValueError(f"filter must be one of {', '.join(filter_names())}, not {self.filter!r}")
        for name in ("cutoff_hz", "window_s", "mass_cutoff_hz"):
            value = getattr(self, name)
            if not isinstance(value, int | float | None):
                raise TypeError(f"{name} must be a number, not {value!r}")
            if value is not None and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, not {value}")

    @property
    def low_pass(self) -> LowPassFilter:
        """The low-pass, of some cut-off; IdentificationError if it is of another package and does not work."""
        return filter_of(self.filter)

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> Options:
        """Return the options that `to_json` stated; KeyError, TypeError or ValueError if these are none."""
        campaign = stated["campaign"]
        given = {**as_floats(stated, cls), "campaign": None if campaign is None else CutoffChoice.of_json(campaign)}
        return cls(**given)

    def to_json(self) -> dict[str, Any]:
        """Return all of them in JSON types: with them a shot is identified again."""
        stated = {**asdict(self), "campaign": None if self.campaign is None else self.campaign.to_json()}
        # the usual filter is not named: a report of a version that had no other is the same
        return {name: value for name, value in stated.items() if (name, value) != ("filter", USUAL)}


@dataclass(frozen=True, eq=False)
class Result:
    """One method's mass, trace and RPE.

    Attributes
    ----------
    rpe_percent
        RPE of the method's trace; NaN for a method that has none of its own.
    rpe_interval_percent
        Interval of the RPE, 95 %.
    """

    estimate: MassEstimate
    trace: MassTrace
    rpe_percent: float
    rpe_interval_percent: tuple[float, float]


class Inertial(NamedTuple):
    """Results that need an accelerometer on the recoiling part, see `Identification`."""

    calibration: Calibration
    zero_shift: ZeroShift
    skew: RecorderSkew
    peaks: ShotPeaks


@dataclass(frozen=True, eq=False)
class Identification(ReadOnlyArrays):
    """Everything that was found out about one shot.

    Attributes
    ----------
    options
        Options that were asked for.
    route
        Signals, rows and calibration by which the mass was found, and the method.
    specification
        Mass that the recoiling part should have in this shot, what was added and what goes along included.
    results
        Results by method; ``kinematic`` is the reverse estimate by the camera's motion.
    sensors
        Sensor of each source of the budget, by the source's name; a source that is of the rig or of this shot alone is
        missing.
    summary
        Mass and scales as the shot alone knows them, for what combines it with others.
    monte_carlo
        Distribution of the mass by the calibrated method; None where a draw has no mass.
    constancy
        Whether one mass explains the shot; None where that cannot be told.
    chain
        Suspicion of the breech chain where the rig states nothing of it; None where the shot can tell nothing.
    walk
        Mass as one that may change, found together with all sensors.
    window_choice
        Choice of the trace's memory from the shot; None where it was stated.
    stress_waves
        Stress waves found, by channel.
    alignments
        Alignments by clock.
    reasons
        Reasons for which the result is not valid; empty if it is.
    assumptions
        Assumptions where the rig file does not say otherwise, see `recoil_rigs.shots.assumptions`.
    force_checks
        Checks of the gauges against what is known beside their certificates.
    notes
        Remarks that a reader should know although they do not make the result invalid.
    set_aside
        Gauges that are not used, because others of the same pressure contradict them or tell more.
    baseline
        Level of each sensor before the shot, and its noise.
    peaks
        Peaks of the recoil acceleration, recorded and filtered; None where the mass is the camera's.
    endogeneity
        Whether force on acceleration, as recorded, is biased here; None where that cannot be told.
    """

    options: Options
    route: Route
    specification: Specification
    results: Mapping[str, Result]
    sensors: Mapping[ErrorSource, str]
    summary: ShotSummary
    monte_carlo: MonteCarlo | None
    constancy: MassConstancy | None
    chain: ShotSuspicion | None
    walk: MassOverTime
    window_choice: WindowChoice | None
    stress_waves: tuple[StressWaves, ...]
    alignments: Mapping[str, ClockAlignment]
    reasons: tuple[Reason, ...]
    assumptions: list[dict[str, str]]
    force_checks: tuple[ForceCheck, ...]
    notes: tuple[Note, ...] = field(default=())
    set_aside: tuple[str, ...] = ()
    baseline: tuple[Baseline, ...] = ()
    peaks: ShotPeaks | None = None
    endogeneity: Endogeneity | None = None

    @property
    def u_all_read_kg(self) -> float | None:
        """Standard uncertainty that the mass has if gauges and friction read all of the resistance.

        None where the rig states that they do, and for a method that has no unknown for it.
        """
        calibration = self.route.calibration
        if calibration.without_unread is calibration or self.route.method != calibration.estimate.method:
            return None
        return calibration.estimate.mass_kg * calibration.without_unread.inferred.u(MASS.name)

    @property
    def corrections(self) -> Calibration:
        """Errors taken off the sensors: those by which they were to explain a mass that changes would hide it."""
        constant = self.constancy is None or self.constancy.constant
        return self.route.calibration if constant or self.constancy is None else self.constancy.changed

    @property
    def chosen(self) -> Result:
        """The result of the method that gives the report's mass."""
        return self.results[self.route.method]

    @property
    def inertial(self) -> Inertial:
        """Results by the accelerometer on the recoiling part.

        Raises
        ------
        IdentificationError
            If the mass was identified without it.
        """
        if self.route.zero_shift is None or self.route.skew is None or self.peaks is None:
            raise IdentificationError(
                "this needs the route by the accelerometer on the recoiling part",
                found=f"the method {self.route.method}",
                remedy="record one, or take another --method",
            )
        return Inertial(self.route.calibration, self.route.zero_shift, self.route.skew, self.peaks)

    @property
    def frisch_bracket_kg(self) -> tuple[float, float] | None:
        """Masses by force on acceleration and by acceleration on force, ascending; None where the mass is the camera's.

        Of the signals that the mass is of: those of ``calibrated`` are without the errors that it found of the sensors,
        those of `AS_RECORDED` have passed no filter.
        """
        if "reverse" not in self.results:
            return None
        fitted = self.route.recorded if self.route.method in AS_RECORDED else self.route.fitted
        rows, sides = spaced_rows(fitted), (fitted.acceleration_m_s2, fitted.force_n)
        if self.route.method == "calibrated":
            sides = self.route.calibration.correct(fitted)
        acceleration, force = (side[rows] for side in sides)
        ends = (
            float(force @ acceleration / (acceleration @ acceleration)),
            float(force @ force / (acceleration @ force)),
        )
        return min(ends), max(ends)

    @property
    def distribution(self) -> MonteCarlo | None:
        """Distribution of the reported mass; None where it is by a method that nothing was drawn of."""
        return self.monte_carlo if self.chosen.estimate.method == self.route.calibration.estimate.method else None

    @property
    def interval_by(self) -> IntervalBy:
        """Way of the reported interval: where the draws do not validate the GUM's it is theirs (JCGM 101, 8.2)."""
        estimate, drawn = self.chosen.estimate, self.distribution
        if drawn is not None and not drawn.validates(estimate.interval_kg):
            return IntervalBy.MONTE_CARLO
        return IntervalBy.LOGARITHM if estimate.method in LOGARITHMIC else IntervalBy.GUM

    @property
    def interval_kg(self) -> tuple[float, float]:
        """95 % coverage interval of the mass."""
        drawn = self.distribution
        if drawn is not None and self.interval_by is IntervalBy.MONTE_CARLO:
            return drawn.interval
        return self.chosen.estimate.interval_kg

    @property
    def expanded_kg(self) -> float:
        """Half the width of it."""
        low, high = self.interval_kg
        return 0.5 * (high - low)

    @property
    def valid(self) -> bool:
        """True if nothing speaks against the result."""
        return not self.reasons

    @property
    def normalised_error(self) -> float:
        """E_n against the specification, see `recoil_rigs.tables.specification.Specification.normalised_error`."""
        estimate = self.chosen.estimate
        return self.specification.normalised_error(estimate.mass_kg, estimate.u_kg)

    @property
    def _felt(self) -> bool:
        """Whether an accelerometer measured the motion."""
        return self.route.recorded.motion_role == "recoil_acceleration"

    @property
    def deviation(self) -> str | None:
        """Say of a valid mass that it deviates from the specification, and what may be the cause; else None.

        It does not decide whether the mass is valid: the specification is what the mass is compared with.
        """
        if not self.valid or not abs(self.normalised_error) > 1.0:
            return None
        estimate, added_kg = self.chosen.estimate, self.specification.added_kg
        turned = replace(self.specification, added_kg=-added_kg)
        otherwise = turned.normalised_error(estimate.mass_kg, estimate.u_kg)
        # a mass that hardly moves the specification explains nothing
        if abs(otherwise) <= 1.0 <= abs(self.normalised_error - otherwise):
            return (
                f"deviates from the specification (E_n {self.normalised_error:+.2f}): is the sign of the added mass "
                f"right? With {-added_kg:+g} kg instead of {added_kg:+g} kg it agrees; correct `added_mass_kg` in the "
                "shot log"
            )
        scales = [*self.route.recorded.scales]
        if self.route.method == "camera":
            scales.append("that of the camera")
        elif self.route.camera is not None and self.route.method == "calibrated":
            scales.append("those of accelerometer and camera together")
        else:
            scales.append("that of the accelerometer" if self._felt else "that of what told the motion")
        if self.route.method in ("forward", "paper"):
            scales.append("noise of the acceleration, by which this method reads low")
        causes = ", ".join(["the mass itself", *scales[:-1]])
        return (
            f"deviates from the specification (E_n {self.normalised_error:+.2f}): {causes}, or {scales[-1]}; "
            "this shot cannot tell which"
        )

    def __repr__(self) -> str:
        verdict, estimate = "valid" if self.valid else "not valid", self.chosen.estimate
        return f"Identification({self.route.method}: {in_kg(estimate.mass_kg, estimate.u_kg)}, {verdict})"

    def __str__(self) -> str:
        against = [f"not valid: {reason}" for reason in self.reasons] or ["valid: nothing speaks against it"]
        constancy = [] if self.constancy is None else [str(self.constancy)]
        return "\n".join([*against, *constancy, str(self.chosen.estimate)])
