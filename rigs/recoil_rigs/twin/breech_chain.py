"""The breech chain of a virtual rig, as its rig file states it: bent gauge, gauge ahead, muzzle brake, tube."""

from __future__ import annotations

from typing import Any

from recoil_rigs.rig import Rig
from recoil_rigs.tables.rig_tables import GAUGE_ROLES
from recoil_rigs.twin.instruments import generator
from recoil_rigs.twin.settings import TwinSettings


def with_breech_chain(rig: Rig, settings: TwinSettings, seed: int) -> TwinSettings:
    """Give the virtual rig the breech chain that its file states, off by draws from what that is uncertain by.

    What ``[twin.unread]`` and ``[twin.readings]`` state stays. A gauge ahead reads low, and a muzzle brake takes off:
    neither has another sign.

    Parameters
    ----------
    seed
        Seed of the shot, or of the campaign whose shots share it.
    """
    m, errors = rig.mechanism, float(settings.unread_errors)
    rng = generator(seed, "breech chain")
    bent, lags, ahead, takes = (errors * float(one) for one in rng.normal(0.0, 1.0, 4))
    readings: dict[str, Any] = {"tube_axial_hz": m.tube_axial_hz} if m.tube_axial_hz else {}
    unread: dict[str, Any] = {}
    if m.projectile_mass and m.bore_length:
        share = max(m.muzzle_brake + takes * m.u.get("muzzle_brake", 0.0), 0.0)
        unread |= {"muzzle_brake": share} if share else {}
        unread |= {"projectile_mass_kg": m.projectile_mass, "bore_length_m": m.bore_length}
    sensors = [spec.sensor for spec in rig.with_role(GAUGE_ROLES[0])]
    for sensor in sensors[:1]:
        if sensor.u_linearity_rel:
            readings |= {
                "breech_linearity": bent * sensor.u_linearity_rel,
                "breech_hysteresis": lags * sensor.u_linearity_rel,
            }
        if sensor.gauge_ahead is not None:
            readings |= {
                "gauge_ahead": abs(ahead) * sensor.gauge_ahead.u_share,
                "chamber_length_m": sensor.gauge_ahead.chamber_length_m,
            }
            unread |= {"projectile_mass_kg": sensor.gauge_ahead.projectile_mass_kg}

    def taken(table: Any, stated: dict[str, Any]) -> Any:
        return table.model_copy(update={key: one for key, one in stated.items() if key not in table.model_fields_set})

    return settings.model_copy(
        update={"readings": taken(settings.readings, readings), "unread": taken(settings.unread, unread)}
    )
