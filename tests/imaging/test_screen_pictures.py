"""Pictures for a real screen: their pixels, edges and periods."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from PIL import Image
from scipy.special import j1

import irtscots_cl as irt
from irtscots_cl.imaging.fringe_manifest import ShownFrame
from irtscots_cl.imaging.screen_pictures import picture, usual_periods, write_picture
from irtscots_cl.optics.setup import Setup


@pytest.fixture(scope="module")
def scene():
    whole = irt.load_scene("sphere")
    return dataclasses.replace(whole, screen=dataclasses.replace(whole.screen, pixels=(40, 30)))


def test_the_first_row_and_column_are_at_plus_y_and_plus_x(scene):
    """From the world: who stands at the mirror and looks at the screen, y up, has x on the left."""
    frame = Setup(scene).chief_rays.screen_frame
    up, to_screen = frame.axes[1], np.asarray(frame.position_mm) / np.linalg.norm(frame.position_mm)
    right = np.cross(to_screen, up)
    assert right @ frame.axes[0] == pytest.approx(-1, abs=1e-9)
    # half a period: bright at s = 0, dark at s = 1
    x, y = (picture(ShownFrame("fringes", axis, 0.5, 0.0), scene) for axis in "xy")
    assert x.shape == y.shape == (30, 40)
    assert (x == x[0]).all() and (y == y[:, :1]).all()
    assert (x[0, 0], x[0, -1]) == (0, 255) and (y[0, 0], y[-1, 0]) == (0, 255)
    assert (np.diff(x[0].astype(int)) >= 0).all() and (np.diff(y[:, 0].astype(int)) >= 0).all()


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (16, np.uint16)])
def test_values_pixel_by_pixel(scene, bits, kind, tmp_path):
    frame, top = ShownFrame("fringes", "y", 3.0, 72.0), 2**bits - 1
    path = tmp_path / "a.png"
    write_picture(path, picture(frame, scene, bits))
    with Image.open(path) as file:
        values = np.asarray(file)
    assert values.dtype.itemsize >= kind().itemsize
    for row in range(30):
        s = (30 - 1 - row + 0.5) / 30
        wanted = (0.5 + 0.5 * np.cos(2 * np.pi * 3 * s - 2 * np.pi / 5)) * top
        assert np.abs(values[row] - wanted).max() <= 0.5 + 1e-6
    assert (picture(ShownFrame("dark"), scene, bits) == 0).all()
    white = picture(ShownFrame("white"), scene, bits)
    assert (white == top).all() and white.dtype == kind


def test_other_bits_are_refused(scene):
    with pytest.raises(ValueError, match="bits = 12: must be one of 8, 16"):
        picture(ShownFrame("dark"), scene, 12)


def test_usual_periods_are_the_most_precise_ones():
    """The highest number of periods is where p J1(x) / x, x = 2 pi p half-width / width, is greatest."""
    found = usual_periods(4000, 0.1, 1.0, 0.0)
    p = np.linspace(1, 400, 20000)
    best = p[np.argmax(j1(2 * np.pi * p / 400.0))]  # p times J1(x) / x
    assert found[0] == 0.9 and found[-1] == pytest.approx(best, rel=0.01)
    assert all(b / a <= 6.05 for a, b in itertools.pairwise(found))  # rounded to three digits
    assert usual_periods(60, 0.1, 1e-3, 0.0)[-1] == 10.0  # six pixels a period
    assert usual_periods(7, 0.1, 10.0, 0.0) == (0.9,)
