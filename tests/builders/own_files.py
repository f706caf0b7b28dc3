"""Files of a stand that nobody made for this program: the virtual stand's shot as other instruments write it.

A recorder's table as German spreadsheets have it, in volts and behind sensors with a bias; two nodes of one kind, with
one identifier, on two buses; an inertial sensor's own frames of whole numbers; a camera's table with German headings.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.shot.shot import Shot

G_M_S2 = 9.80665
GAUGE_BITS, RATE_PER_COUNT, ACC_G_PER_COUNT = {"p_brake": 0.0005, "p_recuperator": 0.0002}, 1.0 / 32768.0, 1e-3
DATABASE = """VERSION ""

BU_: Knoten Rekorder

BO_ 416 Knoten: 8 Knoten
 SG_ {name} : 0|16@1- ({scale},0) [{low}|{high}] "MPa" Rekorder
 SG_ a_Rohr : 16|16@1- (0.2,0) [-6553.6|6553.4] "m/s2" Rekorder
 SG_ Zaehler : 32|8@1+ (1,0) [0|255] "" Rekorder
"""
CERTIFICATES = """\
serial;model;signal;quantity;unit;range_low;range_high;sensitivity;sensitivity_unit;zero_volts;U_percent;k;calibrated;due;zero_percent;filter_hz;filter_type;filter_order;delay_s;distortion_mm;calibration
V101;piezoresistiv;Rohr;acceleration;m/s2;-5000;5000;0,4;mV/(m/s2);;1;2;15.01.2026;31.12.2099;;;;;;;
V102;kapazitiv;Lafette längs;acceleration;g;-20;20;100;mV/g;2,5;2;2;15.01.2026;31.12.2099;;;;;;;
V103;kapazitiv;Lafette quer;acceleration;g;-20;20;100;mV/g;2,5;2;2;15.01.2026;31.12.2099;;;;;;;
V301;Druckaufnehmer;Kammer;pressure;MPa;-25;250;40;mV/MPa;;1;2;15.01.2026;31.12.2099;0,1;;;;;;static
V302;Druckaufnehmer;Knoten.p_Bremse;pressure;MPa;-1,6;16;;;;0,8;2;15.01.2026;31.12.2099;0,1;800;bessel;4;0,00042;;
V303;Druckaufnehmer;Knoten.p_Vorholer;pressure;MPa;-0,6;6;;;;0,8;2;15.01.2026;31.12.2099;0,1;800;bessel;4;0,00042;;
V401;Kamera;Marke1 X;displacement;mm;;;;;;0,2;2;15.01.2026;31.12.2099;;;;;;0,1;
V501;Kreisel;i16_at_8;angular_rate;rad/s;-1;1;;;;2;2;15.01.2026;31.12.2099;;250;bessel;4;0,00135;;
V501;Kreisel;i16_at_10;angular_rate;rad/s;-1;1;;;;2;2;15.01.2026;31.12.2099;;250;bessel;4;0,00135;;
V501;Kreisel;i16_at_12;acceleration;g;-20;20;;;;4;2;15.01.2026;31.12.2099;;250;bessel;4;0,00135;;
"""

Array = NDArray[np.float64]


def _comma(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace(".", ",")


def _raw(shot: Shot, name: str) -> Array:
    """Return a channel as its sensor gave it out, SI: with gravity and bias, before the polarity."""
    return np.asarray(shot[name].samples, dtype=np.float64)


def write_table(shot: Shot, path: Path) -> None:
    """Write the recorder's channels in volts: decimal commas, semicolons, a byte order mark, rows above the heading."""
    times_s = shot["acc_recoil"].time_base.times_s
    columns = [
        0.4e-3 * _raw(shot, "acc_recoil"), 2.5 + 0.1 * _raw(shot, "acc_carriage_x") / G_M_S2,
        2.5 + 0.1 * _raw(shot, "acc_carriage_y") / G_M_S2, 0.04e-6 * _raw(shot, "p_breech"),
    ]  # fmt: skip
    rows = np.column_stack([times_s - times_s[0], *columns])
    head = "Prüfstand Nord;;;;\r\n;;;;\r\nZeit [s];Rohr [V];Lafette längs [V];Lafette quer [V];Kammer [V]\r\n"
    body = "".join(";".join(_comma(one, 6) for one in row) + "\r\n" for row in rows.tolist())
    path.write_bytes(("\ufeff" + head + body).encode())


def write_buses(shot: Shot, folder: Path) -> None:
    """Write a log for each of two nodes with one identifier, and the database of each."""
    times_s = shot["p_brake"].time_base.times_s
    counts = np.round(_raw(shot, "acc_recoil_can") / 0.2).astype(int)
    for bus, (name, german) in enumerate((("p_brake", "p_Bremse"), ("p_recuperator", "p_Vorholer")), 1):
        scale = GAUGE_BITS[name]
        pressures = np.round(1e-6 * _raw(shot, name) / scale).astype(int)
        lines = (
            f"({1_795_160_000 + 500 * bus + at_s:.6f}) can{bus} 1A0#"
            + struct.pack("<hhBxxx", pressure, count, k % 256).hex().upper()
            for k, (at_s, pressure, count) in enumerate(
                zip((times_s - times_s[0]).tolist(), pressures.tolist(), counts.tolist(), strict=True)
            )
        )
        (folder / f"Bus{bus}_0001.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
        text = DATABASE.format(name=german, scale=scale, low=-32768 * scale, high=32767 * scale)
        (folder / f"bus{bus}.dbc").write_text(text, encoding="utf-8")


def write_port(shot: Shot, path: Path) -> None:
    """Write frames of an inertial sensor: mark, length, counter, clock in microseconds, whole numbers, CRC."""
    times_s = shot["gyro_carriage"].time_base.times_s
    since = times_s - times_s[0]
    columns = [
        _raw(shot, "gyro_carriage") / RATE_PER_COUNT, _raw(shot, "gyro_tipping") / RATE_PER_COUNT,
        _raw(shot, "imu_acc_x") / G_M_S2 / ACC_G_PER_COUNT,
    ]  # fmt: skip
    numbers = np.clip(np.round(np.column_stack(columns)), -32768, 32767).astype(int).tolist()
    content = bytearray()
    for at_s, row in zip(since.tolist(), numbers, strict=True):
        body = struct.pack(">BBI3hH", 18, round(1000 * at_s) % 256, 5_000_000 + round(1e6 * at_s), *row, 0)
        content += b"\xa5\x5a" + body + CHECKSUMS["crc16-ccitt-false"].of(body).to_bytes(2, "big")
    path.write_bytes(bytes(content))


def write_own_files(shot: Shot, camera: Path, folder: Path) -> list[Path]:
    """Write the files of one shot, the databases and the table of certificates; return those of the shot.

    Parameters
    ----------
    shot
        Shot of the rig ``mixed``.
    camera
        Table of its camera, as the virtual one writes it.
    """
    write_table(shot, folder / "Messung_0001.csv")
    write_buses(shot, folder)
    write_port(shot, folder / "Kreisel_0001.bin")
    rows = camera.read_text(encoding="utf-8").splitlines()[1:]
    head = "Bild;Zeit (s);Marke1 X (mm);Marke1 Y (mm);Marke2 X (mm);Marke2 Y (mm)"
    german = (row.replace(",", ";").replace(".", ",") for row in rows)
    (folder / "Kamera_0001.csv").write_text("\n".join([head, *german]) + "\n", encoding="utf-8")
    (folder / "sensoren.csv").write_bytes(("\ufeff" + CERTIFICATES.replace("\n", "\r\n")).encode())
    return [folder / name for name in ("Messung_0001.csv", "Bus1_0001.log", "Bus2_0001.log", "Kreisel_0001.bin",
                                       "Kamera_0001.csv")]  # fmt: skip
