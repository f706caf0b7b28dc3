"""Readings of a virtual rig that are not what its rig file takes them for: the table ``[twin.readings]``.

What each sensor feels is changed before its chain and its recorder, on the grid of the motion; with
``LP2(f, z) = w^2 / (s^2 + 2 z w s + w^2)``, ``w = 2 pi f``, and ``FS`` for the full scale:

=====================  ==================================================================================
gauge ahead            ``p [1 - gauge_ahead (L0 / (L0 + x_p))^2]``: Lagrange's gradient in the chamber, x_p the
                       projectile's travel (J. Corner, "Theory of the Interior Ballistics of Guns", 1950)
breech linearity       ``p + s FS 2 z (1 - z)``, ``z = p / FS``
breech hysteresis      behind the peak ``p + s FS y (1 - y)``, ``y = p / p_max``
orifice                ``R_r + tau R_r' = R``
lines                  ``LP2(c / 4 l, z)`` of brake and recuperator: a closed pipe's quarter wave
tube along its axis    accelerometer ``a + s^2 / (s^2 + 2 z w s + w^2) [2 (a - a_0)]``, frames
                       ``x + LP2[2 (a - a_0)] / w^2``
brackets               ``LP2`` of the accelerometer's and of the marker's reading
charge amplifier       ``s tau / (s tau + 1)``, not in the rig file
gateway                samples of its own rate, held, each late by a draw of a gamma distribution of shape 2
camera on the ground   ``-(r - r_0) e5_0``, r the marker's place on the ground, e5_0 the bore at rest
rolling shutter        a marker is seen late by its share of the travel
=====================  ==================================================================================
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from recoil_acquisition.quantities.declaration import Finite, NotNegative, Positive

Damping = Annotated[float, Field(ge=0, lt=1)]


class Readings(BaseModel):
    """Readings that are not what the rig file takes them for; each is as it should be if left out."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    recuperator_orifice_s: NotNegative = 0.0
    """Time constant of an orifice before the recuperator's gauge."""
    recuperator_line_hz: NotNegative = 0.0
    """Resonance of a line before the recuperator's gauge, a quarter wave; 0 for none."""
    brake_line_hz: NotNegative = 0.0
    """Resonance of a line before the brake's gauge; 0 for none."""
    line_damping: Damping = 0.2
    """Damping of these resonances, share of the critical one."""
    gauge_ahead: Annotated[float, Field(ge=-1, le=1)] = 0.0
    """Share by which a breech gauge at the chamber's mouth reads low at first."""
    chamber_length_m: Positive = 0.5
    """Length of the chamber, over which that share falls."""
    breech_linearity: Finite = 0.0
    """Error of the breech gauge's line in its middle, twice the share of full scale."""
    breech_hysteresis: Finite = 0.0
    """Error of the breech gauge as the pressure falls, four times the share of full scale."""
    tube_axial_hz: NotNegative = 0.0
    """First mode of the tube along its axis; 0 for none."""
    tube_axial_damping: Damping = 0.01
    """Damping of that mode, share of the critical one."""
    accelerometer_bracket_hz: NotNegative = 0.0
    """Resonance of the recoil accelerometer's bracket; 0 for none."""
    accelerometer_bracket_damping: Damping = 0.03
    """Damping of that resonance, share of the critical one."""
    accelerometer_amplifier_s: NotNegative = 0.0
    """Time constant of the recoil accelerometer's charge amplifier that nobody declared; 0 for none."""
    breech_amplifier_s: NotNegative = 0.0
    """Time constant of the breech gauge's charge amplifier that nobody declared; 0 for none."""
    brake_gateway_s: NotNegative = 0.0
    """Mean latency of a gateway that hands the brake's pressure on; 0 for none."""
    recuperator_gateway_s: NotNegative = 0.0
    """Mean latency of a gateway that hands the recuperator's pressure on; 0 for none."""
    gateway_hz: Positive = 1000.0
    """Samples that such a gateway takes in a second."""
    breech_drift_pa_s: Finite = 0.0
    """Drift of the breech gauge's zero."""
    brake_drift_pa_s: Finite = 0.0
    """Drift of the brake gauge's zero."""
    recuperator_drift_pa_s: Finite = 0.0
    """Drift of the recuperator gauge's zero."""
    frame_rate: Annotated[float, Field(ge=-0.1, le=0.1)] = 0.0
    """Share by which the camera's frames lie farther apart than is declared."""
    frame_jitter_s: NotNegative = 0.0
    """Standard deviation of the frames' instants."""
    camera_on_ground: bool = False
    """Whether the camera stands on the ground and not on the tipping part, whatever the rig file says it sees."""
    marker_bracket_hz: NotNegative = 0.0
    """Resonance of the bracket that carries the marker; 0 for none."""
    marker_bracket_damping: Damping = 0.05
    """Damping of that resonance, share of the critical one."""
    rolling_shutter_s: Finite = 0.0
    """Time by which a picture is read later at the end of the travel than in battery."""
    lens_m: Finite = 0.0
    """Bow of the travel in the picture, in its middle."""
    noise_of_acceleration: NotNegative = 0.0
    """Standard deviation of white noise on the recoil accelerometer, share of the size of the acceleration."""
    noise_of_reading: NotNegative = 0.0
    """Standard deviation of white noise on the pressure gauges while the part moves, share of the reading."""
    noise_of_speed_per_s: NotNegative = 0.0
    """Standard deviation of white noise on the recoil accelerometer, m/s^2 for each m/s of speed."""
    gauge_noise_of_speed_s_m: NotNegative = 0.0
    """Standard deviation of white noise on the pressure gauges, share of full scale for each m/s of speed."""
    structure_borne_m_s2: NotNegative = 0.0
    """Standard deviation of white noise on the recoil accelerometer while the part moves."""
    knocks: Annotated[int, Field(ge=0, le=1000)] = 0
    """Number of knocks on the recoil accelerometer while it recoils, half sines of 1 ms."""
    knock_m_s2: NotNegative = 10.0
    """Size of a knock, of which it is a multiple drawn from Student's t of two degrees of freedom."""
    rest_noise: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Share of their noise that all channels but the camera's have while the part rests."""
