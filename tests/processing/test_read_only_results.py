from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.motion.scale_and_zero import ScaleAndZero
from recoil_processing.repairs.autoregressive import Interpolation
from recoil_processing.repairs.droop import DroopCorrection
from recoil_processing.repairs.dropouts import DropOuts
from recoil_processing.repairs.hum import Hum
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass
from recoil_processing.shot.kinematics import AngularMotion
from recoil_processing.shot.signals import Signals
from recoil_processing.spectra.spectrum import Spectrum
from recoil_processing.stress_waves.shock_response import ShockResponse

RESULTS = (
    AngularMotion,
    DoubleImpulseMass,
    DroopCorrection,
    DropOuts,
    FusedMotion,
    Hum,
    Interpolation,
    ScaleAndZero,
    ShockResponse,
    Spectrum,
)


@pytest.mark.parametrize("kind", RESULTS, ids=lambda kind: kind.__name__)
def test_nobody_writes_into_a_result_and_who_made_its_arrays_still_may(kind: type[ReadOnlyArrays]) -> None:
    arrays = {field.name: np.zeros(3) for field in fields(kind) if any(s in field.type for s in ("Array", "Flags"))}
    assert arrays
    result = kind(**{field.name: arrays.get(field.name) for field in fields(kind)})
    for name, made in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            getattr(result, name)[0] = 1.0
        made[0] = 2.0
        assert getattr(result, name)[0] == 2.0


def test_arrays_in_a_mapping_are_read_only_too() -> None:
    made = {"breech_pressure": np.zeros(3)}
    signals = Signals(0.0, 1e-3, made, {}, (0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match="read-only"):
        signals.series["breech_pressure"][0] = 1.0
    made["breech_pressure"][0] = 2.0
    assert signals.series["breech_pressure"][0] == 2.0
