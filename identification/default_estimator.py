"""Which estimator of the mass a shot's channels call for.

=================================================  ==============  ===============================================
there is                                           default         because
=================================================  ==============  ===============================================
forces, accelerometer, aligned camera              ``joint``       random error at the bound of all three; a zero
                                                                   that shifts and a skew are unknowns of it
forces, aligned camera                             ``camera-gls``  nothing is differentiated; at the camera's bound
forces, accelerometer, even samples, silence       ``ar-gls``      at the accelerometer's bound with ringing
                                                                   modelled, uncertainty checked by the silence
forces, accelerometer otherwise                    ``weak``        finite reach: lost samples cost their
                                                                   surroundings and no more
=================================================  ==============  ===============================================

The measured figures behind it are those of tests/benchmarks/test_errors_in_variables_benchmark.py. Where sensors'
scales are less certain than the shot is random, restricted scales (`identification.calibration`) add what the forces'
different phases tell of them; that is another question than this rule's.
"""

from __future__ import annotations

from dataclasses import dataclass

from daq.errors import IdentificationError

LARGEST_LOST_SHARE = 0.02
"""Of the interval's samples, beyond which autoregressive errors are told from pieces too short."""


@dataclass(frozen=True)
class Available:
    """What one shot has.

    Attributes
    ----------
    forces : bool
        Breech, brake and recuperator pressure, on aligned clocks.
    accelerometer : bool
        On the recoiling part, on an aligned clock.
    camera : bool
        Its displacement, on a clock that was aligned without doubt.
    silence : bool
        Samples before the shot, to tell noise and zeros.
    lost_share : float
        Of the accelerometer's and the forces' samples in the identification interval.
    """

    forces: bool
    accelerometer: bool
    camera: bool
    silence: bool
    lost_share: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.lost_share <= 1.0:
            raise ValueError(f"lost_share must lie between 0 and 1, not {self.lost_share}")


@dataclass(frozen=True)
class DefaultEstimator:
    """The estimator to take.

    Attributes
    ----------
    name : str
        Key of `identification.estimates.further_estimates`.
    reason : str
        A sentence.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"


def default_estimator(available: Available) -> DefaultEstimator:
    """Return the one estimator that a shot's channels call for.

    Parameters
    ----------
    available : Available

    Raises
    ------
    IdentificationError
        If no mass can be told from these channels.
    """
    a = available
    if not a.forces:
        raise IdentificationError(
            "no mass without the forces",
            expected="breech, brake and recuperator pressure, on clocks that could be aligned",
            remedy="declare the roles in the rig file, or mend the alignment",
        )
    if a.accelerometer and a.camera:
        return DefaultEstimator(
            "joint",
            "force, accelerometer and camera together are at the bound of what they tell, "
            "and a shifted zero or a skew does not bias them",
        )
    if a.camera:
        return DefaultEstimator(
            "camera-gls", "the displacement against the force's double integral needs no derivative of it"
        )
    if not a.accelerometer:
        raise IdentificationError(
            "no mass without the motion",
            expected="the recoiling part's accelerometer, or a camera, on a clock that could be aligned",
            remedy="declare its role in the rig file, or mend the alignment",
        )
    if a.silence and a.lost_share <= LARGEST_LOST_SHARE:
        return DefaultEstimator(
            "ar-gls", "ringing is modelled as autoregressive errors, and the silence before the shot bounds the noise"
        )
    lost = (
        f"{100.0 * a.lost_share:.1f} % of the samples are lost" if a.silence else "there is no silence to tell noise by"
    )
    return DefaultEstimator("weak", f"{lost}: averages over functions of finite reach depend on neither")
