"""Texts of oscilloscopes, written line by line as each maker's manual shows them, with their numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

STEP_S = 2e-6
START_S = -40e-6
COUNT = 40


@dataclass(frozen=True)
class WrittenWaveform:
    """A text of an oscilloscope.

    Attributes
    ----------
    maker
        Name of its reader.
    content
        Bytes of the file.
    signals
        Name of each signal -> its unit and its numbers as printed.
    start_s, step_s
        Time of the first row, and from row to row.
    """

    maker: str
    content: bytes
    signals: Mapping[str, tuple[str, Sequence[float]]]
    start_s: float = START_S
    step_s: float = STEP_S


def printed(count: int) -> tuple[list[str], list[str], list[str]]:
    """Return the times and the samples of two channels as they are printed; the samples come back after 1,000 rows."""
    times = [f"{START_S + i * STEP_S:.9e}" for i in range(count)]
    once = [i % 1000 for i in range(count)]
    return times, [f"{100.25 + i / 16:.4f}" for i in once], [f"{-0.5 * i * i / 64:.5e}" for i in once]


def _of(texts: Sequence[str]) -> list[float]:
    return [float(text.replace(",", ".")) for text in texts]


def tektronix(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a MSO: keys, two analog channels, and digital ones with a time of their own."""
    t, a, b = printed(count)
    head = (
        "Model,MSO58\r\nFirmware Version,2.0.3\r\n\r\nWaveform Type,ANALOG,ANALOG,,DIGITAL\r\n"
        f"Horizontal Units,s,s,,s\r\nSample Interval,{STEP_S:g},{STEP_S:g}\r\nRecord Length,{count},{count}\r\n"
        "Gating,0.0% to 100.0%\r\nVertical Units,V,A\r\nLabel,force,coil,\r\n,,\r\nTIME,CH1,CH2,,TIME,D0\r\n"
    )
    rows = "".join(f"{t[i]},{a[i]},{b[i]},,{t[i]},{i % 2}\r\n" for i in range(count))
    return WrittenWaveform(
        "Tektronix oscilloscope text", (head + rows).encode(), {"CH1": ("V", _of(a)), "CH2": ("A", _of(b))}
    )


def tektronix_beside(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a TDS: the keys stand beside the first rows."""
    t, a, _ = printed(count)
    keys = [
        ("Record Length", f"{count:e}"), ("Sample Interval", f"{STEP_S:e}"), ("Trigger Point", "2.000000000000e+01"),
        ("", ""), ("Source", "CH2"), ("Vertical Units", "V"), ("Vertical Scale", "5.000000e-01"),
        ("Horizontal Units", "s"), ("Note", '"shot 3, first"'), ("Model Number", "TDS2024C"),
    ]  # fmt: skip
    keys += [("", "")] * (count - len(keys))
    rows = "".join(f"{keys[i][0]},{keys[i][1]},,{t[i]},  {a[i]},\r\n" for i in range(count))
    return WrittenWaveform("Tektronix oscilloscope text", rows.encode(), {"CH2": ("V", _of(a))})


def keysight(count: int = COUNT) -> WrittenWaveform:
    """Write the text of an InfiniiVision: two lines above the rows."""
    t, a, b = printed(count)
    rows = "".join(f"{t[i]},{a[i]},{b[i]}\r\n" for i in range(count))
    return WrittenWaveform(
        "Keysight oscilloscope text", ("x-axis,1,2\r\nsecond,Volt,Ampere\r\n" + rows).encode(),
        {"1": ("Volt", _of(a)), "2": ("Ampere", _of(b))},
    )  # fmt: skip


def infiniium(count: int = COUNT) -> WrittenWaveform:
    """Write the text of an Infiniium: keys with a colon, then ``Data:``."""
    t, a, _ = printed(count)
    head = (
        f"Revision:,0\r\nType:,raw\r\nStart:,0\r\nPoints:,{count}\r\nCount:,1\r\nXDispRange:,1.0E-04\r\n"
        f"XDispOrg:,-5.0E-05\r\nXInc:,{STEP_S:e}\r\nXOrg:,{START_S:e}\r\nX Units:,second\r\nY Units:,Volt\r\n"
        'Frame:,DSO90804A\r\nDate:,"03 AUG 2026"\r\nTime:,"12:23:05:12"\r\nMax Bandwidth:,8.0E+09\r\nData:,\r\n'
    )
    rows = "".join(f"{t[i]},{a[i]}\r\n" for i in range(count))
    return WrittenWaveform("Keysight oscilloscope text", (head + rows).encode(), {"waveform": ("Volt", _of(a))})


def rohde_schwarz(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a RTB: one line above the rows."""
    t, a, b = printed(count)
    rows = "".join(f"{t[i]},{a[i]},{b[i]}\n" for i in range(count))
    return WrittenWaveform(
        "Rohde & Schwarz oscilloscope text", ("in s,C1 in V,C2 in A\n" + rows).encode(),
        {"C1": ("V", _of(a)), "C2": ("A", _of(b))},
    )  # fmt: skip


SEGMENT_S = 0.75
"""Time from the trigger of one segment to that of the next, s."""


def lecroy(count: int = COUNT, segments: int = 1) -> WrittenWaveform:
    """Write the text of a WaveRunner, with semicolons and decimal commas."""
    t, a, _ = (text for text in printed(count))
    head = f"LECROYWR625Zi;61392;Waveform\r\nSegments;{segments};SegmentSize;{count}\r\n"
    head += "Segment;TrigTime;TimeSinceSegment1\r\n"
    for i in range(segments):
        since = f"{SEGMENT_S * i:g}".replace(".", ",")
        head += f"#{i + 1};05-Nov-2026 16:34:0{i % 10};{since}                 \r\n"
    rows = "".join(f"{t[i]};{a[i]}\r\n".replace(".", ",") for i in range(count)) * segments
    return WrittenWaveform("LeCroy oscilloscope text", (head + "Time;Ampl\r\n" + rows).encode(), {"Ampl": ("", _of(a))})


def yokogawa(count: int = COUNT, leads: bool = True, blocks: int = 1) -> WrittenWaveform:
    """Write the text of a DLM: keys in quotes; the first cell of each row is empty, or is not there."""
    _, a, b = printed(count)
    keys = [
        ("Header Size", "15"), ("Model Name", '"DLM4000"'), ("Comment", '""'), ("BlockNumber", f"{blocks},{blocks}"),
        ("TraceName", '"CH1","CH3"'), ("BlockSize", f"{count},{count}"), ("VUnit", '"V","A"'),
        ("SampleRate", f"{1 / STEP_S:e},{1 / STEP_S:e}"), ("HResolution", f"{STEP_S:e},{STEP_S:e}"),
        ("HOffset", f"{START_S:e},{START_S:e}"), ("HUnit", '"s","s"'), ("DisplayBlockSize", f"{count},{count}"),
        ("DisplayPointNo.", "1,1"), ("Date", '"2026/11/26","2026/11/26"'), ("Time", '"12:33:56.1","12:33:56.1"'),
    ]  # fmt: skip
    head = "".join(f'"{key}",{value}\r\n' for key, value in keys)
    rows = "".join(f"{',' if leads else ''}{a[i]}, {b[i]}\r\n" for i in range(count))
    return WrittenWaveform(
        "Yokogawa oscilloscope text", (head + "\r\n" + rows).encode(), {"CH1": ("V", _of(a)), "CH3": ("A", _of(b))}
    )


def picoscope(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a PicoScope: microseconds, units in parentheses, an empty line."""
    _, a, b = printed(count)
    times = [f"{1e6 * (START_S + i * STEP_S):.8f}" for i in range(count)]
    rows = "".join(f"{times[i]},{a[i]},{b[i]}\n" for i in range(count))
    return WrittenWaveform(
        "PicoScope oscilloscope text", ("Time,Channel A,Channel B\n(µs),(V),(mV)\n\n" + rows).encode(),
        {"Channel A": ("V", _of(a)), "Channel B": ("mV", _of(b))},
    )  # fmt: skip


def rigol(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a DS1000Z: the number of the sample, and start and increment above."""
    _, a, b = printed(count)
    head = f"X,CH1,CH2,Start,Increment,\r\nSequence,Volt,Volt,{START_S:.6e},{STEP_S:.6e}\r\n"
    rows = "".join(f"{i},{a[i]},{b[i]},\r\n" for i in range(count))
    return WrittenWaveform(
        "Rigol oscilloscope text", (head + rows).encode(), {"CH1": ("Volt", _of(a)), "CH2": ("Volt", _of(b))}
    )


def rigol_later(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a DS4000 whose first sample is not number 0."""
    _, a, _ = printed(count)
    head = f"X,CH1,Start,Increment,\r\nSequence,Volt,{START_S:.6e},{STEP_S:.6e}\r\n"
    rows = "".join(f"{i + 22},{a[i]},\r\n" for i in range(count))
    return WrittenWaveform(
        "Rigol oscilloscope text", (head + rows).encode(), {"CH1": ("Volt", _of(a))}, START_S + 22 * STEP_S
    )


def rigol_seconds(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a DS1000E: the time of each sample."""
    t, a, b = printed(count)
    rows = "".join(f"{t[i]},{a[i]},{b[i]},\r\n" for i in range(count))
    return WrittenWaveform(
        "Rigol oscilloscope text", ("X,CH1,CH2,\r\nSecond,Volt,Volt,\r\n" + rows).encode(),
        {"CH1": ("Volt", _of(a)), "CH2": ("Volt", _of(b))},
    )  # fmt: skip


def rigol_memory(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a MSO5000's memory: samples alone."""
    _, a, b = printed(count)
    head = f"CH1(V),CH3(A),t0 = {START_S:g}s, tInc = {STEP_S:g},\n"
    rows = "".join(f"{a[i]},{b[i]},\n" for i in range(count))
    return WrittenWaveform(
        "Rigol oscilloscope text", (head + rows).encode(), {"CH1": ("V", _of(a)), "CH3": ("A", _of(b))}
    )


def siglent(count: int = COUNT) -> WrittenWaveform:
    """Write the text of a SDS: keys, then the sources."""
    t, a, b = printed(count)
    head = (
        f"Record Length,Analog:{count},\r\nSample Interval,Analog:{STEP_S:E},\r\nVertical Units,CH1:V, CH2:A,,\r\n"
        "Vertical Scale,CH1:0.05 CH2:0.10,,\r\nHorizontal Units,s,,\r\nModel Number,SDS1204X-E,,\r\n\r\n"
        "Source,CH1,CH2\r\nSecond,Value,Value\r\n"
    )
    rows = "".join(f"{t[i]},{a[i]},{b[i]}\r\n" for i in range(count))
    return WrittenWaveform(
        "Siglent oscilloscope text", (head + rows).encode(), {"CH1": ("V", _of(a)), "CH2": ("A", _of(b))}
    )


def siglent_converted(count: int = COUNT) -> WrittenWaveform:
    """Write the text that the maker's converter makes of a binary file: one channel, without its source."""
    t, a, _ = printed(count)
    head = f"Record Length,Analog:{count}\nSample Rate,{1 / STEP_S:.1f}\nVertical Scale,CH1: 0.05\n"
    rows = "".join(f"{t[i]},{a[i]}\n" for i in range(count))
    return WrittenWaveform(
        "Siglent oscilloscope text", (head + "Horizontal Scale, 0.00001\nSecond,Volt\n" + rows).encode(),
        {"CH1": ("Volt", _of(a))},
    )  # fmt: skip


WAVEFORMS: Mapping[str, Callable[[int], WrittenWaveform]] = {
    "tektronix": tektronix, "tektronix-beside": tektronix_beside, "keysight": keysight, "infiniium": infiniium,
    "rohde-schwarz": rohde_schwarz, "lecroy": lecroy, "yokogawa": yokogawa, "picoscope": picoscope, "rigol": rigol,
    "rigol-later": rigol_later, "rigol-seconds": rigol_seconds, "rigol-memory": rigol_memory,
    "siglent": siglent, "siglent-converted": siglent_converted,
}  # fmt: skip
"""Name of a layout -> writer of a file of so many rows."""
