"""A channel of a TDMS file: whether it holds numbers, its samples, and the integers behind them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.bounded_file import BoundedFile
from recoil_acquisition.readers.containers.stored_time import selected
from recoil_acquisition.readers.tdms.library import tdms_library

SCALINGS = frozenset(
    {"Linear", "Polynomial", "RTD", "Table", "Thermocouple", "Thermistor", "Strain", "Add", "Subtract", "AdvancedAPI"}
)
"""Scalings that npTDMS carries out; it would pass over any other in silence, such as ``Reciprocal``."""
MOST_SCALES = 256

_WITHOUT_EFFECT = "AdvancedAPI"
"""A scaling that hands its input on: LabVIEW writes it where a program asked for none."""

_OF_SCALE = re.compile(r"NI_Scale\[(\d{1,9})\]_")

Kept = NDArray[np.int64] | None
"""Indices of the samples that the time base has; None if it has all."""


class MayBeTime(StrEnum):
    """Content of a channel that is none of numbers and may be a time, as the reason why it is no signal."""

    TIME_STAMPS = "time stamps"
    TEXTS = "texts"


def rejection_reason(channel: Any, levels: tuple[Mapping[str, Any], ...], size: int, path: Path) -> str:
    """Say why a channel is no channel of numbers; empty if it is one."""
    types = tdms_library().types
    if not len(channel):
        return "no samples"
    if channel.data_type in (types.TimeStamp, types.String):
        return MayBeTime.TIME_STAMPS if channel.data_type is types.TimeStamp else MayBeTime.TEXTS
    for properties in levels:
        is_scaled = _is_scaled(properties)
        for name, value in properties.items():
            if name.endswith("_Scale_Type") and not is_scaled:
                if value not in SCALINGS:
                    return f"its scaling {value!r} is not covered"
                own = f"{name.removesuffix('Scale_Type')}{_WITHOUT_EFFECT}_"
                further = [p for p in properties if p.startswith(own) and p != f"{own}Input_Source"]
                if value == _WITHOUT_EFFECT and further:
                    return f"its scaling {value!r} with {further[0]} is not covered"
            counted = name == "NI_Number_Of_Scales" or (name.startswith("NI_Scale[") and name.endswith("_Size"))
            if counted and not (isinstance(value, (int, np.integer)) and 0 <= value <= MOST_SCALES):
                return f"damaged: {name} is {value!r}"
        if not is_scaled and (unused := _of_no_scale(properties)):
            return f"its property {unused} is stated of no scale that counts"
    if _is_scaled(levels[0]) and any(map(_scales, levels[1:])):
        return "its samples are scaled by its NI_Scaling_Status and a scale of its file is stated: which counts is open"
    try:
        dtype = np.dtype(channel.dtype)
    except Exception as error:
        return _faulty_scaling(error)
    if dtype.kind not in "fiub" or dtype.itemsize > 8:
        return f"not real numbers ({dtype})"
    types_stored = list((channel.scaler_data_types or {}).values()) or [channel.data_type]
    width = max((t.size or 0 for t in types_stored), default=0)
    if not width or len(channel) * width > size:
        raise CorruptFileError(
            "more samples are stated than the file can hold", path=path, place=f"channel {channel.path}",
            expected=f"at most {size} bytes", found=f"{len(channel)} samples of {width} bytes",
        )  # fmt: skip
    for properties in levels:
        for name in _scales(properties):
            slope = properties.get(name.removesuffix("Scale_Type") + "Linear_Slope", 1.0)
            # what is no number at all is named where the scaling is carried out
            if isinstance(slope, (int, float, np.number)) and not (slope and isfinite(slope)):
                return f"its scaling has the slope {slope:g}, which makes nothing of its samples"
    return _scaling_fault(channel) if any("NI_Number_Of_Scales" in p or _scales(p) for p in levels) else ""


def _is_scaled(properties: Mapping[str, Any]) -> bool:
    """Return whether the samples are stored as they are after scaling."""
    return bool(properties.get("NI_Scaling_Status", "unscaled") == "scaled")


def _of_no_scale(properties: Mapping[str, Any]) -> str:
    """Return the first property of a scale that has no type, or whose number is beyond that of the scales; or empty."""
    stated = [(name, found) for name in properties if (found := _OF_SCALE.match(name)) is not None]
    last = max((int(found[1]) for name, found in stated if name.endswith("_Scale_Type")), default=-1)
    count = int(properties.get("NI_Number_Of_Scales", last + 1))
    for name, found in stated:
        if int(found[1]) >= count or f"NI_Scale[{found[1]}]_Scale_Type" not in properties:
            return name
    return ""


def _scales(properties: Mapping[str, Any]) -> list[str]:
    """Return the names of the properties that state a type of scaling, those that have an effect."""
    types = [name for name, value in properties.items() if name.endswith("_Scale_Type") and value != _WITHOUT_EFFECT]
    return [] if _is_scaled(properties) else types


def _scaling_fault(channel: Any) -> str:
    """Say why the scaling of a channel cannot be carried out, by its first sample; empty if it can."""
    try:
        with _quiet():
            first = np.asarray(channel.read_data(0, 1))
    except Exception as error:
        return _faulty_scaling(error)
    return "" if first.shape == (1,) and first.dtype.kind in "fiub" else f"its scaling makes {first.dtype} of it"


@contextmanager
def _quiet() -> Iterator[None]:
    """Pass over numpy's warnings of the samples that npTDMS leaves open in a scaling, and fills in or gives as NaN."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.filterwarnings("ignore", message="'where' used without 'out'")
        yield


def _faulty_scaling(error: Exception) -> str:
    """Say that a scaling lacks something, which npTDMS meets with whatever that leads to."""
    return f"damaged: its scaling cannot be carried out ({type(error).__name__}: {error})"


@dataclass(frozen=True)
class TdmsChannel:
    """A channel whose samples are read when they are asked for.

    Attributes
    ----------
    group, name
        Names of the group and of the channel in the file.
    """

    path: Path
    group: str
    name: str

    def read(self, start: int, stop: int) -> Any:
        """Read samples as npTDMS scales them."""
        with BoundedFile(self.path) as file, tdms_library().TdmsFile.open(file, raw_timestamps=True) as tdms, _quiet():
            return tdms[self.group][self.name].read_data(start, stop - start, scaled=True)

    def samples(self, kept: Kept, start: int, stop: int) -> NDArray[np.float64]:
        """Return samples that the time base has, shape (stop - start,)."""
        if stop == start:
            return np.empty(0)
        values = np.asarray(selected(kept, self.read, start, stop)).astype(np.float64)
        if values.size != stop - start:
            raise ValueError(f"{values.size} samples of {stop - start}")
        return values

    def counts(self, kept: Kept, unit: str, start: int, stop: int) -> RawCounts | None:
        """Return the integers of a channel that has no scaling or one linear scaling."""
        with BoundedFile(self.path) as file, tdms_library().TdmsFile.open(file, raw_timestamps=True) as tdms:
            channel = tdms[self.group][self.name]
            if kept is None:
                counts = channel.read_data(start, stop - start, scaled=False)
            else:
                counts = channel.read_data(scaled=False)
            levels = (channel.properties, tdms[self.group].properties, tdms.properties)
        if isinstance(counts, dict):
            counts = next(iter(counts.values())) if len(counts) == 1 else np.empty(0)
        scales = [(name, properties) for properties in levels for name in _scales(properties)]
        if counts.dtype.kind not in "iu" or len(scales) > 1:
            return None
        gain, offset = 1.0, 0.0
        if scales:
            key, properties = scales[0]
            prefix = key.removesuffix("Scale_Type")
            if properties[key] != "Linear":
                return None
            gain = float(properties[f"{prefix}Linear_Slope"])
            offset = float(properties[f"{prefix}Linear_Y_Intercept"])
        return RawCounts(counts if kept is None else counts[kept[start:stop]], gain, offset, unit)
