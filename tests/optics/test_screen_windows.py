"""The windows of the transport map: which screen pixels are kept for each detector pixel."""

from __future__ import annotations

import numpy as np
import pytest
from lopsided import lopsided
from scenes import coarse, coarse_screen, scene_of

from irtscots_cl.optics.chief_rays import trace_chief_rays as chief_rays
from irtscots_cl.optics.screen_windows import Windows, place_windows


def test_values_are_gathered_by_row_and_column_from_each_origin():
    of_screen = np.arange(5 * 7).reshape(5, 7)
    windows = Windows(np.array([3, 8]), np.array([[4, 2], [0, 3]], np.int32), 2, 3)
    assert windows.gather(of_screen).tolist() == [[[18, 19, 20], [25, 26, 27]], [[21, 22, 23], [28, 29, 30]]]
    assert windows.count == 12


@pytest.mark.parametrize("margin", [0, 1, 3])
@pytest.mark.parametrize("name", ["sphere-deviated", "off-axis", "lopsided"])
def test_windows_lie_on_the_screen_and_hold_where_rays_land(name, margin):
    """Rays of the oracle-tested chief through the pixel's middle and eight points of the aperture's rim."""
    scene = scene_of(name)
    chief = chief_rays(scene)
    windows = place_windows(chief, margin)
    size = np.array(scene.screen.pixels)
    assert (windows.origins >= 0).all() and (np.add(windows.origins, (windows.columns, windows.rows)) <= size).all()
    np.testing.assert_array_equal(windows.pixels, np.flatnonzero(chief.sees_mirror))
    row, column = np.divmod(windows.pixels, chief.shape[1])
    angle, radius = np.arange(8) * np.pi / 4, scene.camera.aperture_diameter_mm / 2
    points, *landing = chief.reverse(row[:, None], column[:, None], radius * np.cos(angle), radius * np.sin(angle))
    on_mirror = chief.surface.contains(points[..., 0], points[..., 1])
    for k, length in enumerate((windows.columns, windows.rows)):
        place = (landing[k] - scene.screen.centre_offset_mm[k]) / scene.screen.pitch_mm + (size[k] - 1) / 2
        line = np.round(place)
        light = on_mirror & (line >= 0) & (line < size[k])
        first = windows.origins[:, k, None]
        assert light.any() and ((line >= first) & (line < first + length))[light].all()


def test_a_margin_widens_windows_by_itself_on_either_side():
    chief = chief_rays(coarse("sphere", 9))
    narrow, wide = place_windows(chief, 0), place_windows(chief, 2)
    assert (wide.rows, wide.columns) == (narrow.rows + 4, narrow.columns + 4)
    inside = (narrow.origins >= 2).all(1) & (narrow.origins + narrow.rows + 2 <= 21).all(1)
    assert inside.any()
    np.testing.assert_array_equal(wide.origins[inside], narrow.origins[inside] - 2)


def test_windows_are_no_larger_than_the_screen():
    chief = chief_rays(coarse_screen(lopsided()))
    windows = place_windows(chief, 1000)
    assert (windows.rows, windows.columns) == (7, 7) and not windows.origins.any()


def test_windows_that_are_shared_cannot_be_written_to():
    windows = place_windows(chief_rays(coarse("sphere", 9)), 1)
    with pytest.raises(ValueError, match="read-only"):
        windows.origins[0] = 0
