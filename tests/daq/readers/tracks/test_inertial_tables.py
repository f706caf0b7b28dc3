"""Tables of inertial sensors, with X, Y and Z of each and no frames, are no camera's."""

from __future__ import annotations

import pytest

from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.table import reader_by_name, surest_claim
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader

HEADS = (
    ["Counter", "Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z"],
    ["Zähler", "Beschl X", "Beschl Y", "Beschl Z"],
    ["Packet number", "Gyroscope X (deg/s)", "Gyroscope Y (deg/s)", "Gyroscope Z (deg/s)"],
)


def table(names: list[str], separator: str = ",") -> bytes:
    rows = "".join(separator.join(str(k + i) for i in range(len(names))) + "\n" for k in range(40))
    return f"// Sample rate: 50.0Hz\n{separator.join(names)}\n{rows}".encode()


@pytest.mark.parametrize("names", HEADS, ids=lambda names: names[0])
def test_it_is_no_tracks(names, tmp_path):
    assert surest_claim(Head(table(names)))[0] is Claim.NO
    (path := tmp_path / "a.csv").write_bytes(table(names))
    assert reader_by_name(path, {"dewetron"}) is None
    assert reader_by_name(path, {"camera"}).name == ProAnalystTextReader.name


@pytest.mark.parametrize("names", [["Frame", *HEADS[0][1:]], ["n", "Tip X", "Tip Y", "Breech X", "Breech Y"]])
def test_tracks_are_tracks(names):
    assert ProAnalystTextReader().claims(Head(table(names))) is Claim.GENERIC
