"""One firing, assembled."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.clocks.one_grid import grid, read_on_grid
from recoil_acquisition.errors import AlignmentError, ReadError, StoreError, nearest_first, system_errors_as
from recoil_acquisition.files.regular_file import open_regular
from recoil_acquisition.files.shot_name import check_shot_name
from recoil_acquisition.listing import Listed, Listing
from recoil_acquisition.measured import joined, worded
from recoil_acquisition.packages.extras import XARRAY
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.shot.causes import Subject, reasons_of
from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.shot.usability import Usability, usability

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

AlignmentStatus = Literal["ok", "ambiguous", "failed"]
Times = TypeVar("Times", float, NDArray[np.float64])


@dataclass(frozen=True)
class InputFile:
    """A file that went into a shot.

    Attributes
    ----------
    name
        File name without folders.
    sha256
        Hexadecimal digest of its bytes.
    size
        Size in bytes.
    source
        Name of the rig's source that it was matched to; empty for the record of the acquisition.
    reader
        Name of the reader that read it; ``acquisition`` for that record.
    seal
        Seal that a shot file bears in itself, see `recoil_acquisition.store.seal`; empty of other files.
    """

    name: str
    sha256: str
    size: int
    source: str
    reader: str
    seal: str = ""

    @classmethod
    def of(cls, path: Path, source: str = "", reader: str = "shot file") -> InputFile:
        """Describe a file, a shot file if nothing else is said, for the provenance of what is made of it.

        Raises
        ------
        ReadError
            If it is no file that can be read to its end, as `recoil_acquisition.files.regular_file.open_regular` says.
        """
        with open_regular(path) as file, system_errors_as(ReadError, path, "read"):
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            size = os.fstat(file.fileno()).st_size
        return cls(path.name, digest, size, source, reader)


@dataclass(frozen=True)
class ClockAlignment:
    """Map of one clock to the reference clock: ``t_ref = (1 + drift) * t_source + offset_s``.

    Attributes
    ----------
    u_offset_s
        Standard uncertainty of the mapped time in the middle of the motion.
    drift
        Drift against the reference clock, dimensionless; 0 where the record cannot resolve one.
    status
        State: ``ok``, ``ambiguous`` or ``failed``.
    method
        Method: ``motion``, ``redundant``, ``trigger``, ``exposure``, ``fixed`` or ``reference``.
    reasons
        Sentences on why it is not ``ok``.
    details
        Figures of the method, JSON types only: gain, innovation statistic, candidates.
    """

    clock: str
    offset_s: float
    u_offset_s: float
    drift: float
    u_drift: float
    status: AlignmentStatus
    method: str
    reasons: tuple[str, ...] = ()
    details: Mapping[str, Any] | None = None

    def to_reference(self, times_s: Times) -> Times:
        """Map instants of the source's clock, a number or an array, to the reference clock."""
        return (1.0 + self.drift) * times_s + self.offset_s

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types without its details; a number that is not finite is None."""
        numbers = {name: getattr(self, name) for name in ("offset_s", "u_offset_s", "drift", "u_drift")}
        return {
            "clock": self.clock,
            **{name: number if math.isfinite(number) else None for name, number in numbers.items()},
            "status": self.status,
            "method": self.method,
            "reasons": list(self.reasons),
        }


@dataclass(frozen=True, eq=False)
class Shot(Listed):
    """One firing: channels on their own clocks and how the clocks relate.

    Attributes
    ----------
    name
        Identifier of the shot.
    rig_text
        Text of the rig file, verbatim.
    channels
        Channels by the names of the rig, in its order.
    alignments
        Alignments, one for each clock other than the reference.
    started
        Absolute start, ISO 8601, or empty if no source states one.
    started_source
        File, or clock, that the start comes from, and whether its zone is known.
    databases
        Texts of the files that the rig names (CAN databases), by file name.
    acquisition
        Record of the live acquisition; None if there is none.
    clock_fits
        Relation of a device's clock to the host's, by source, as
        `recoil_acquisition.clocks.clock_fit.ClockFit.to_json`, or, of a clock that counts samples, as
        `recoil_acquisition.devices.tick_clock.tick_anchors`; JSON types.
    against_mass
        Reasons against the shot's mass although no check failed, the first reason first.

    Raises
    ------
    ValueError
        If it cannot bear its name, a channel stands under another name than its own, or a clock is aligned twice.
    """

    name: str
    rig_name: str
    rig_text: str
    reference_clock: str
    channels: Mapping[str, Channel]
    alignments: tuple[ClockAlignment, ...] = ()
    quality: tuple[QualityCheck, ...] = ()
    inputs: tuple[InputFile, ...] = ()
    started: str = ""
    started_source: str = ""
    history: tuple[Step, ...] = ()
    databases: Mapping[str, str] | None = None
    acquisition: Acquisition | None = None
    clock_fits: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    against_mass: tuple[Reason, ...] = ()

    def __post_init__(self) -> None:
        check_shot_name(self.name)
        for key, channel in self.channels.items():
            if key != channel.name:
                raise ValueError(f"channel {channel.name!r} stands under the name {key!r}")
        clocks = [alignment.clock for alignment in self.alignments]
        if len(set(clocks)) < len(clocks):
            raise ValueError(f"a clock is aligned twice: {', '.join(clocks)}")

    def __repr__(self) -> str:
        clocks = len({channel.time_base.clock for channel in self.channels.values()})
        found = f"{len(self.channels)} channels, {clocks} clocks, {self.state}"
        return f"Shot({self.name!r} on {self.rig_name!r}: {found})"

    def listing(self) -> Listing:
        """List the channels, and what the checks found of each."""
        found = {name: [c.verdict for c in self.quality if c.channel == name] for name in self.channels}
        rows = [
            (
                channel.name, channel.role or None, channel.unit, channel.samples.size, channel.time_base.rate_hz,
                channel.time_base.clock, next((v for v in ("fail", "warn", "ok") if v in found[channel.name]), None),
            )
            for channel in self.channels.values()
        ]  # fmt: skip
        return Listing(repr(self), ("channel", "role", "unit", "samples", "rate, Hz", "clock", "checks"), tuple(rows))

    def __getitem__(self, name: str) -> Channel:
        """Return a channel by its name.

        Raises
        ------
        KeyError
            If there is none of this name, with the nearest names.
        """
        if name not in self.channels:
            near = ", ".join(nearest_first(name, list(self.channels))[:4])
            raise KeyError(f"no channel {name!r} in shot {self.name}; nearest: {near or 'none, it has no channels'}")
        return self.channels[name]

    def with_channel(self, channel: Channel) -> Shot:
        """Return the shot with a channel in place of the one of its name, or behind the others if none bears it.

        What the checks found of the one that it replaces stays: `recoil_daq.identify` goes by it.
        """
        return replace(self, channels={**self.channels, channel.name: channel})

    def reference_times_s(self, name: str) -> NDArray[np.float64]:
        """Return the instants of a channel on the reference clock, shape (n_samples,).

        Raises
        ------
        KeyError
            If there is no such channel.
        AlignmentError
            If its clock was not aligned.
        """
        base = self[name].time_base
        found = next((one for one in self.alignments if one.clock == base.clock), None)
        if base.clock == self.reference_clock:
            return base.times_s
        if found is None or found.status == "failed":
            raise AlignmentError(
                f"the clock {base.clock!r} of channel {name!r} was not aligned",
                found="; ".join(found.reasons) if found is not None else "no alignment",
                remedy="leave the channel out: shot.without_channel(..)",
            )
        return np.asarray(found.to_reference(base.times_s))

    def frame(self, rate_hz: float | None = None) -> pd.DataFrame:
        """Return all channels as one pandas frame on the reference clock.

        Parameters
        ----------
        rate_hz
            Rate of one even grid, see `recoil_acquisition.clocks.one_grid`: what it cannot hold is taken out before.
            None for every instant of every channel, where each row has what was sampled then, and nothing is resampled.

        Returns
        -------
        DataFrame
            Columns are the channels in SI, NaN where nothing was sampled, lost, or before and behind a record. The
            index is the time on the reference clock in seconds; ``attrs["units"]`` gives the units.

        Raises
        ------
        AlignmentError
            If a channel's clock was not aligned.
        ValueError
            If the rate is no positive number or would make more samples than make sense.
        """
        import pandas as pd

        times_s = {name: self.reference_times_s(name) for name in self.channels}
        sampled = {name: times for name, times in times_s.items() if times.size}
        if rate_hz is None:
            columns = [pd.Series(self[name].samples, index=times, name=name) for name, times in times_s.items()]
            frame = pd.concat(columns, axis=1).sort_index() if columns else pd.DataFrame()
        else:
            spans = [(float(times[0]), float(times[-1])) for times in sampled.values()]
            start_s, count = grid(spans, rate_hz) if spans else (0.0, 0)
            instants_s = start_s + np.arange(count) / rate_hz
            read = {
                name: read_on_grid(times, self[name].measured, instants_s, rate_hz).samples
                for name, times in times_s.items()
            }
            frame = pd.DataFrame(read, index=instants_s)
        frame.index.name = "time_s"
        frame.attrs["units"] = {name: channel.unit for name, channel in self.channels.items()}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return all channels as an xarray data set, each on the time of its own clock; nothing is resampled.

        Returns
        -------
        Dataset
            Variables are the channels in SI, over ``time_<clock>`` in seconds on that clock (numbered where a clock has
            several time bases); attributes are unit, quantity, role and clock, and of the times what maps them to the
            reference clock: ``t_ref = (1 + drift) t + offset_s``.

        Raises
        ------
        StoreError
            If xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise StoreError("a data set needs xarray", remedy=XARRAY.remedy) from error

        variables, coordinates = {}, {}
        for clock, frame in self.frames().items():
            dimension = f"time_{clock}"
            own = self[str(frame.columns[0])].time_base.clock
            found = next((one for one in self.alignments if one.clock == own), None)
            to_reference = {} if found is None else {"offset_s": found.offset_s, "drift": found.drift}
            told = {"units": "s", "clock": own, **to_reference}
            coordinates[dimension] = (dimension, frame.index.to_numpy(), told)
            for name in map(str, frame.columns):
                channel = self[name]
                attributes = {"units": channel.unit, "quantity": channel.quantity, "role": channel.role, "clock": own}
                variables[name] = (dimension, channel.samples, attributes)
        head = {"shot": self.name, "rig": self.rig_name, "reference_clock": self.reference_clock}
        return xr.Dataset(variables, coordinates, head)

    def by_role(self, role: str) -> Channel | None:
        """Return the (first) channel of a role, or None."""
        return next(iter(self.with_role(role)), None)

    def with_role(self, role: str) -> tuple[Channel, ...]:
        """Return all channels of a role: several gauges may measure one pressure."""
        return tuple(c for c in self.channels.values() if c.role == role)

    def without_channel(self, name: str) -> Shot:
        """Leave a channel out, and what was found of its quality."""
        channels = {other: channel for other, channel in self.channels.items() if other != name}
        return replace(self, channels=channels, quality=tuple(c for c in self.quality if c.channel != name))

    def alignment(self, clock: str) -> ClockAlignment:
        """Return how a clock maps to the reference clock; the identity for the reference itself.

        Raises
        ------
        KeyError
            If the shot does not say how.
        """
        if clock == self.reference_clock:
            return ClockAlignment(clock, 0.0, 0.0, 0.0, 0.0, "ok", "reference")
        for alignment in self.alignments:
            if alignment.clock == clock:
                return alignment
        raise KeyError(clock)

    def frames(self) -> dict[str, pd.DataFrame]:
        """Return the channels as pandas frames, one per time base.

        Returns
        -------
        dict of str to DataFrame
            Frames by clock, and by clock and number where one clock has several time bases. The index is the time on
            that clock in seconds; `shot.alignment(clock).to_reference` maps it. Columns are the channels in SI, lost
            samples NaN; ``attrs["units"]`` gives their units.
        """
        import pandas as pd

        groups: list[list[Channel]] = []
        for channel in self.channels.values():
            group = next((g for g in groups if g[0].time_base.same_instants(channel.time_base)), None)
            if group is None:
                groups.append([channel])
            else:
                group.append(channel)
        frames: dict[str, pd.DataFrame] = {}
        for group in groups:
            base = group[0].time_base
            names = [base.clock, *(f"{base.clock}_{i}" for i in range(2, len(groups) + 1))]
            index = pd.Index(base.times_s, name="time_s")
            frame = pd.DataFrame({c.name: c.samples for c in group}, index=index)
            frame.attrs["units"] = {c.name: c.unit for c in group}
            frames[next(name for name in names if name not in frames)] = frame
        return frames

    @property
    def failed(self) -> tuple[QualityCheck, ...]:
        """Checks that failed."""
        return tuple(check for check in self.quality if check.verdict == "fail")

    @property
    def state(self) -> Usability:
        """State of its verdict."""
        return usability(self.failed, self.against_mass)

    @property
    def usable(self) -> bool:
        """Whether nothing that is known before an estimate speaks against its mass."""
        return self.state is Usability.USABLE

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the shot is not usable, the first reason first: the failed checks, and what speaks against its mass."""
        return reasons_of(self.quality, self.against_mass, self.subjects)

    @property
    def subjects(self) -> tuple[Subject, ...]:
        """Subjects of findings, one for each channel."""
        return tuple(Subject(c.name, c.role, c.time_base.clock, c.quantity) for c in self.channels.values())

    def with_results(
        self,
        alignments: tuple[ClockAlignment, ...],
        quality: tuple[QualityCheck, ...],
        step: Step,
        against_mass: tuple[Reason, ...] = (),
    ) -> Shot:
        """Return a new shot with alignments, quality verdicts and one more line of history."""
        history = (*self.history, step)
        return replace(self, alignments=alignments, quality=quality, against_mass=against_mass, history=history)


def doubted_clocks(alignments: Sequence[ClockAlignment]) -> tuple[Reason, ...]:
    """Say of each clock that was not aligned beyond doubt why."""
    return tuple(
        Reason(ReasonCode.CLOCK, a.clock, worded(f"clock {a.clock}: alignment {a.status}: ", joined("; ", a.reasons)))
        for a in alignments
        if a.status != "ok"
    )
