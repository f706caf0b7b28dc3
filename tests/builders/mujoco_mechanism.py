"""The mechanism as an independent simulator of rigid bodies has it."""

from __future__ import annotations

import math

import mujoco

from recoil_rigs.mechanism.model import Mechanism


def mujoco_model(m: Mechanism, added_kg: float = 0.0) -> mujoco.MjModel:
    """Build the same mechanism out of MuJoCo's bodies; x of MuJoCo is forward, z is up, hinges turn about -y.

    Parameters
    ----------
    added_kg
        A body of its own, without any extent, that sits on the recoiling part at its centre of mass.
    """
    ring = f'<body name="ring"><inertial mass="{added_kg}" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/></body>'

    def quaternion(angle: float) -> str:
        return f"{math.cos(angle / 2)} 0 {-math.sin(angle / 2)} 0"

    def inertial(mass: float, x: float, z: float, about_centre: float) -> str:
        size = about_centre  # only the middle one acts in plane; the others obey the triangle inequality
        return f'<inertial mass="{mass}" pos="{x} 0 {z}" diaginertia="{size} {size} {size}"/>'

    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option gravity="0 0 {-m.g}" integrator="RK4"/>
      <compiler angle="radian" autolimits="true"/>
      <worldbody>
        <body name="frame">
          <joint name="xi" type="slide" axis="1 0 0"/>
          <joint name="eta" type="slide" axis="0 0 1"/>
          <inertial mass="1e-9" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/>
          <body name="carriage" quat="{quaternion(m.phi10)}">
            <joint name="alpha" type="hinge" axis="0 -1 0"/>
            {inertial(m.m1, m.X1, m.Y1, m.J1 - m.m1 * (m.X1**2 + m.Y1**2))}
            <body name="tipping" pos="{m.XA} 0 {m.YA}" quat="{quaternion(m.phi20 - m.phi10)}">
              <joint name="beta" type="hinge" axis="0 -1 0"/>
              {inertial(m.m2, m.s2, m.d2, m.J2 - m.m2 * (m.s2**2 + m.d2**2))}
              <body name="recoiling" pos="{m.b} 0 {m.d}">
                <joint name="x" type="slide" axis="-1 0 0"/>
                {inertial(m.m3, 0, 0, m.J3c)}
                {ring if added_kg else ""}
              </body>
            </body>
          </body>
        </body>
      </worldbody>
    </mujoco>""")
