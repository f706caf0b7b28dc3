"""Colours and dashes that survive colour blindness and grey paper."""

from itertools import combinations

import numpy as np
import pytest

from recoil_identification.report.figure.appearance import DASHES, HUES, METHODS, dash_of, hue_of
from recoil_identification.report.figure.figure import Trace

SEEN_BY = {
    # Machado, Oliveira, Fernandes, IEEE Transactions on Visualization and Computer Graphics 15 (2009) 1291, severity 1
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
    "all colours": np.eye(3),
}
TO_XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
WHITE = (0.95047, 1.0, 1.08883)
TOLD_APART = 10.0
"""CIELAB distance of two lines' colours; 2.3 is what an eye just sees of two areas that touch."""


def linear(hue):
    share = np.array(hue.split(","), dtype=float) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(light):
    ratio = np.array(TO_XYZ) @ np.clip(light, 0.0, 1.0) / WHITE
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("sight", SEEN_BY)
def test_every_two_hues_are_told_apart_by_everybody(sight):
    seen = {hue: lab(np.array(SEEN_BY[sight]) @ linear(hue)) for hue in HUES}
    for one, other in combinations(HUES, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > TOLD_APART, (one, other)


def test_lines_of_one_panel_differ_in_dashes():
    lines = [Trace(str(k), [0.0], [1.0], "reference") for k in range(len(DASHES) - 2)]
    assert len({dash_of(line, k) for k, line in enumerate(lines)}) == len(lines)
    assert "" not in {dash_of(line, k) for k, line in enumerate(lines)}
    assert dash_of(Trace("m", [0.0], [1.0], "measured", hue=3), 2) == ""
    assert dash_of(Trace("f", [0.0], [1.0], "filtered", hue=3, dash=0), 2) == ""


def test_every_two_methods_differ_in_colour_or_in_dashes():
    drawn = [Trace(name, [0.0], [1.0], "reference", hue=number) for number, name in enumerate(METHODS)]
    assert len({(hue_of(trace, 0), dash_of(trace, 0)) for trace in drawn}) == len(METHODS)
