"""Files of the readers of container formats, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders import container_files as build
from tests.builders import mdf3_files

BY_NAME = {reader.name: reader for reader in READERS}
RECORDER = Declarations("dewetron")

DEWESOFT = {"Data1_AI_1": (-2.0, 6.0), "Data1_Temp": (15.0, 25.0)}
HDF5 = {"AI/acc": (-2.0, 8.0), "slow/temperature": (19.0, 23.0)}
MAT = build.mat_file(build.dewesoft_variables())
MAT_COMPRESSED = build.mat_file(build.dewesoft_variables(), compressed=True)
MAT_V73 = build.mat_v73_file({"Data1_time_AI_1": build.ramp(16) + 2.0, "Data1_AI_1": build.ramp(16)})
TDMS = build.small_tdms()
UFF = build.uff_text(build.ramp(12)) + build.uff_binary(build.ramp(10), entity="p")
TOGETHER = mdf3_files.stored_together([(1 + n % 3 % 2, n / 8, n) for n in range(24)], behind=True)


def at_segment_end(cut: bytes) -> bool:
    return len(cut) in build.tdms_ends(TDMS)


def at_dataset_end(cut: bytes) -> bool:
    return cut.rstrip().endswith(b"-1")


CASES = (
    Case("wav", BY_NAME["WAV"], build.small_wave(), RECORDER, {"channel 1": (-1.0, 1.0), "channel 2": (-1.0, 1.0)}),
    Case("npy", BY_NAME["NumPy array"], build.small_npy(), RECORDER, {"column_2": (-2.0, 18.0)}),
    Case("hdf5", BY_NAME["HDF5"], build.small_hdf5(), RECORDER, HDF5),
    # A file may end behind any variable
    Case("mat", BY_NAME["MATLAB"], MAT, RECORDER, DEWESOFT, lambda cut: len(cut) in build.element_ends(MAT)),
    Case(
        "mat-compressed",
        BY_NAME["MATLAB"],
        MAT_COMPRESSED,
        RECORDER,
        DEWESOFT,
        lambda cut: len(cut) in build.element_ends(MAT_COMPRESSED),
    ),
    Case("mat-7.3", BY_NAME["MATLAB"], MAT_V73, RECORDER, {"Data1_AI_1": (-2.0, 6.0)}),
    # A file may end behind any segment
    Case("tdms", BY_NAME["TDMS"], TDMS, RECORDER, {"AI/acc": (-2.0, 4.0)}, at_segment_end),
    # A file may end behind any dataset
    Case("uff", BY_NAME["UFF 58"], UFF, RECORDER, {"acc": (-2.0, 4.0), "p": (-2.0, 4.0)}, at_dataset_end),
    Case("mdf", BY_NAME["MDF 4"], build.small_mdf(), RECORDER, {"acc": (-1.0, 12.0), "p": (-2.0, 4.0)}),
    Case("mdf3", BY_NAME["MDF 3"], mdf3_files.small_old_mdf(), RECORDER, {"acc": (-0.5, 6.0)}),
    Case("mdf3-big-endian", BY_NAME["MDF 3"], mdf3_files.small_old_mdf(">"), RECORDER, {"acc": (-0.5, 6.0)}),
    # A recorder may have been stopped behind any record
    Case(
        "mdf3-unfinished",
        BY_NAME["MDF 3"],
        mdf3_files.small_old_mdf(mark=b"UnFinMF ", stated=0),
        RECORDER,
        {"acc": (-0.5, 6.0)},
    ),
    Case("mdf3-unsorted", BY_NAME["MDF 3"], TOGETHER, RECORDER, {"a": (0.0, 30.0), "b": (0.0, 30.0)}),
)
