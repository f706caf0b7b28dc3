"""Files of DEWETRON OXYGEN, for the rules that every reader keeps."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders.oxygen_dmd import Stored, oxygen_dmd

READER = next(reader for reader in READERS if reader.name == "DEWETRON OXYGEN recording")
WAVE = np.arange(-12, 12) ** 3
CHANNELS = (
    Stored("AI 1/1", WAVE, "V"),
    Stored("AI 1/2", WAVE[::-1], "m/s²", "sint32", '<Scaling><Linear k="0.25" d="0"/><Linear k="2" d="1"/></Scaling>'),
    Stored("sum", WAVE / 7, "V", "double", "<Scaling/>"),
    Stored("AVG", np.arange(9.0), "V", "double", "<Scaling/>", ticks=(1, 4, 4, 7, 9, 14, 13, 18, 30)),
)
MAGNITUDES = {"AI 1/1": (-864.0, 666.0), "AI 1/2": (-900.0, 900.0), "sum": (-250.0, 200.0), "AVG": (0.0, 7.0)}

CASES = (
    Case(
        "oxygen",
        READER,
        oxygen_dmd(CHANNELS, windows=((3, 24),), blocks=((0, 10), (10, 10), (20, 4)), not_stored=("AI 1/3",)),
        Declarations("dewetron"),
        MAGNITUDES,
    ),
    Case(
        "oxygen-lz4-windows",
        READER,
        oxygen_dmd(
            CHANNELS, windows=((3, 8), (12, 24)), blocks=((0, 10), (10, 10), (20, 4)), compression="lz4", is_packed=True
        ),
        Declarations("dewetron"),
        MAGNITUDES,
    ),
)
