"""A channel of a TDMS file: whether it holds numbers, its samples, and the integers behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.bounded_file import BoundedFile
from recoil_acquisition.readers.containers.stored_time import selected

SCALINGS = frozenset(
    {"Linear", "Polynomial", "RTD", "Table", "Thermocouple", "Thermistor", "Strain", "Add", "Subtract"}
)
"""Scalings that npTDMS carries out; it would pass over any other in silence."""
MOST_SCALES = 256

Kept = NDArray[np.int64] | None
"""Indices of the samples that the time base has; None if it has all."""


def rejection_reason(channel: Any, levels: tuple[Mapping[str, Any], ...], size: int, path: Path) -> str:
    """Say why a channel is no channel of numbers; empty if it is one."""
    from nptdms import types

    if not len(channel):
        return "no samples"
    if channel.data_type in (types.TimeStamp, types.String):
        return "time stamps" if channel.data_type is types.TimeStamp else "texts"
    for properties in levels:
        for name, value in properties.items():
            if name.endswith("_Scale_Type") and value not in SCALINGS:
                return f"its scaling {value!r} is not covered"
            counted = name == "NI_Number_Of_Scales" or (name.startswith("NI_Scale[") and name.endswith("_Size"))
            if counted and not (isinstance(value, (int, np.integer)) and 0 <= value <= MOST_SCALES):
                return f"damaged: {name} is {value!r}"
    dtype = np.dtype(channel.dtype)
    if dtype.kind not in "fiub" or dtype.itemsize > 8:
        return f"not real numbers ({dtype})"
    types_stored = list((channel.scaler_data_types or {}).values()) or [channel.data_type]
    width = max((t.size or 0 for t in types_stored), default=0)
    if not width or len(channel) * width > size:
        raise CorruptFileError(
            "more samples are stated than the file can hold", path=path, place=f"channel {channel.path}",
            expected=f"at most {size} bytes", found=f"{len(channel)} samples of {width} bytes",
        )  # fmt: skip
    return ""


@dataclass(frozen=True)
class TdmsChannel:
    """A channel whose samples are read when they are asked for.

    Attributes
    ----------
    group, name
        Of the channel in the file.
    """

    path: Path
    group: str
    name: str

    def read(self, start: int, stop: int) -> Any:
        """Read samples as npTDMS scales them."""
        from nptdms import TdmsFile

        with BoundedFile(self.path) as file, TdmsFile.open(file, raw_timestamps=True) as tdms:
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
        from nptdms import TdmsFile

        with BoundedFile(self.path) as file, TdmsFile.open(file, raw_timestamps=True) as tdms:
            channel = tdms[self.group][self.name]
            if kept is None:
                counts = channel.read_data(start, stop - start, scaled=False)
            else:
                counts = channel.read_data(scaled=False)
            levels = (channel.properties, tdms[self.group].properties, tdms.properties)
        if isinstance(counts, dict):
            counts = next(iter(counts.values())) if len(counts) == 1 else np.empty(0)
        scales = [(k, p) for p in levels for k in p if k.endswith("_Scale_Type")]
        if counts.dtype.kind not in "iu" or len(scales) > 1:
            return None
        gain, offset = 1.0, 0.0
        if scales:
            key, properties = scales[0]
            prefix = key.removesuffix("Scale_Type")
            if properties[key] != "Linear" or properties.get("NI_Scaling_Status", "unscaled") == "scaled":
                return None
            gain = float(properties[f"{prefix}Linear_Slope"])
            offset = float(properties[f"{prefix}Linear_Y_Intercept"])
        return RawCounts(counts if kept is None else counts[kept[start:stop]], gain, offset, unit)
