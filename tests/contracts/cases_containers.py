"""Files of the readers of container formats, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.readers.hdf5.reader import Hdf5Reader
from recoil_acquisition.readers.mat.reader import MatReader
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tdms.reader import TdmsReader
from recoil_acquisition.readers.uff.reader import UffReader
from recoil_acquisition.readers.wav.reader import WavReader
from tests.builders import container_files as build
from tests.contracts.reader_rules import Case

RECORDER = Declarations("dewetron")

DEWESOFT = {"Data1_AI_1": (-2.0, 6.0), "Data1_Temp": (15.0, 25.0)}
MAT = build.mat_file(build.dewesoft_variables())
MAT_COMPRESSED = build.mat_file(build.dewesoft_variables(), compressed=True)
MAT_V73 = build.mat_v73_file({"Data1_time_AI_1": build.ramp(16) + 2.0, "Data1_AI_1": build.ramp(16)})
TDMS = build.small_tdms()
UFF = build.uff_text(build.ramp(12)) + build.uff_binary(build.ramp(10), entity="p")


def at_dataset_end(cut: bytes) -> bool:
    return cut.rstrip().endswith(b"-1")


CASES = (
    Case("wav", WavReader(), build.small_wave(), RECORDER, {"channel 1": (-1.0, 1.0), "channel 2": (-1.0, 1.0)}),
    Case("hdf5", Hdf5Reader(), build.small_hdf5(), RECORDER, {"AI/acc": (-2.0, 8.0), "slow/temperature": (19.0, 23.0)}),
    # A file may end behind any variable
    Case("mat", MatReader(), MAT, RECORDER, DEWESOFT, lambda cut: len(cut) in build.element_ends(MAT)),
    Case(
        "mat-compressed",
        MatReader(),
        MAT_COMPRESSED,
        RECORDER,
        DEWESOFT,
        lambda cut: len(cut) in build.element_ends(MAT_COMPRESSED),
    ),
    Case("mat-7.3", MatReader(), MAT_V73, RECORDER, {"Data1_AI_1": (-2.0, 6.0)}),
    # A file may end behind any segment
    Case("tdms", TdmsReader(), TDMS, RECORDER, {"AI/acc": (-2.0, 4.0)}, lambda cut: len(cut) in build.tdms_ends(TDMS)),
    # A file may end behind any dataset
    Case("uff", UffReader(), UFF, RECORDER, {"acc": (-2.0, 4.0), "p": (-2.0, 4.0)}, at_dataset_end),
    Case("mdf", MdfReader(), build.small_mdf(), RECORDER, {"acc": (-1.0, 12.0), "p": (-2.0, 4.0)}),
)
