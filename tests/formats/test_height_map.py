"""Height maps: what they refuse, turns, surface and wavefront, and what a reader is told."""

import numpy as np
import pytest
from map_files import letter_map_nm

from irtscots_cl.formats.height_map import CameraPlace, Findings, HeightMap, MapOptions, unit_named

PITCH = (0.1, 0.2)


def letter(**others):
    return HeightMap(letter_map_nm() * 1e-6, PITCH, centre_mm=(3.0, -2.0), **others)


def height_at(height_map, x, y):
    """The height at a place: what a turn must carry along."""
    grid_x, grid_y = height_map.positions_mm()
    k = np.argmin(np.hypot(grid_x - x, grid_y - y))
    assert np.hypot(grid_x.flat[k] - x, grid_y.flat[k] - y) < 1e-9
    return height_map.heights_mm.flat[k]


TURNS = {
    "x": (lambda m: m.flipped("x"), lambda x, y: (-x, y)),
    "y": (lambda m: m.flipped("y"), lambda x, y: (x, -y)),
    "xy": (lambda m: m.flipped("xy"), lambda x, y: (-x, -y)),
    "quarter": (lambda m: m.rotated(), lambda x, y: (-y, x)),
}


@pytest.mark.parametrize("name", TURNS)
def test_turns_carry_heights_to_their_new_places(name):
    turn, place = TURNS[name]
    before, after = letter(), turn(letter())
    assert after.pitch_mm == (PITCH[::-1] if name == "quarter" else PITCH)
    for x, y in zip(*(grid.ravel() for grid in before.positions_mm()), strict=True):
        np.testing.assert_equal(height_at(after, *place(x, y)), height_at(before, x, y))


def test_turns_drop_the_camera_and_carry_intensity():
    frames = np.arange(99.0).reshape(1, 11, 9)
    turned = letter(intensity=frames, camera=CameraPlace(9, 11, 0, 0)).rotated()
    assert turned.camera is None
    np.testing.assert_array_equal(turned.intensity[0], frames[0].T[:, ::-1])


def test_positions():
    x, y = HeightMap(np.zeros((2, 3)), PITCH, centre_mm=(1.0, 2.0)).positions_mm()
    np.testing.assert_allclose(x, [[0.9, 1.0, 1.1]] * 2)
    np.testing.assert_allclose(y, [[1.9] * 3, [2.1] * 3])


def test_a_wavefront_is_twice_the_surface():
    surface = letter()
    wavefront = surface.as_kind("wavefront")
    np.testing.assert_array_equal(wavefront.heights_mm, 2 * surface.heights_mm)
    np.testing.assert_array_equal(wavefront.as_kind("surface").heights_mm, surface.heights_mm)
    assert surface.as_kind("surface") is surface
    with pytest.raises(ValueError, match="must be 'surface' or 'wavefront'"):
        surface.as_kind("opd")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"heights_mm": np.zeros(3)}, "must be [rows, columns]"),
        ({"heights_mm": np.zeros((0, 3))}, "must be [rows, columns]"),
        ({"heights_mm": np.array([[np.inf]])}, "must be within 1e+06 mm"),
        ({"heights_mm": np.array([[2e6, np.nan]])}, "heights from 2e+06 to 2e+06 mm"),
        ({"pitch_mm": (0.1, 0.0)}, "pitch of 0 mm"),
        ({"pitch_mm": (np.nan, 0.1)}, "pitch of nan mm"),
        ({"wavelength_nm": 0.5}, "wavelength of 0.5 nm"),
        ({"kind": "opd"}, "kind = 'opd'"),
        ({"centre_mm": (np.inf, 0.0)}, "centre at"),
        ({"intensity": np.zeros((1, 3, 3))}, "intensity of shape [1, 3, 3]"),
    ],
)
def test_what_no_map_can_be(arguments, said):
    with pytest.raises(ValueError, match=".") as caught:
        HeightMap(**{"heights_mm": np.zeros((2, 2)), **arguments})
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"unit": "furlong"}, "unit = 'furlong': must be one of m, cm, in, mm, um, nm, wave"),
        ({"kind": "opd"}, "kind = 'opd'"),
        ({"pitch_mm": (0.1, -1.0)}, "pitch_mm = -1"),
        ({"wavelength_nm": np.nan}, "wavelength_nm = nan"),
    ],
)
def test_options_are_checked(arguments, said):
    with pytest.raises(ValueError, match=".") as caught:
        MapOptions(**arguments)
    assert said in str(caught.value)


def test_flip_is_checked():
    with pytest.raises(ValueError, match="flip = 'z': must be one of x, y, xy"):
        letter().flipped("z")


@pytest.mark.parametrize(("unit", "mm"), [("nm", 1e-6), ("um", 1e-3), ("mm", 1.0), ("in", 25.4), ("wave", 632.8e-6)])
def test_units(unit, mm):
    assert Findings("a", MapOptions()).unit_mm(unit, 632.8) == pytest.approx(mm, rel=1e-15)
    assert Findings("a", MapOptions(unit=unit)).unit_mm(None, 632.8) == pytest.approx(mm, rel=1e-15)


def test_unit_conflicts_and_gaps():
    with pytest.raises(ValueError, match="a: heights in nm, told um"):
        Findings("a", MapOptions(unit="um")).unit_mm("nm", None)
    with pytest.raises(ValueError, match="a: tells no unit of its heights: give --unit"):
        Findings("a", MapOptions()).unit_mm(None, None)
    with pytest.raises(ValueError, match="heights in waves, and tells no wavelength"):
        Findings("a", MapOptions()).unit_mm("wave", None)


def test_kind_conflicts_and_gaps():
    found = Findings("a", MapOptions())
    assert found.kind(None) == "surface" and "taken as a surface" in found.warnings[0]
    with pytest.raises(ValueError, match="holds a surface, told a wavefront"):
        Findings("a", MapOptions(kind="wavefront")).kind("surface")


@pytest.mark.parametrize(
    ("text", "name"),
    [("NanoMeters", "nm"), ("\u00b5m", "um"), ("\u03bcm", "um"), (" Waves ", "wave"), ("MM", "mm"), ("furlong", None)],
)
def test_names_of_units(text, name):
    assert unit_named(text) == name


def test_flip_y_and_a_quarter_turn_exchange_x_and_y():
    heights = np.arange(6.0).reshape(2, 3)
    given = HeightMap(heights, (0.5, 0.25), centre_mm=(1.0, 2.0))
    turned = given.flipped("y").rotated()
    np.testing.assert_array_equal(turned.heights_mm, heights.T)
    assert (turned.pitch_mm, turned.centre_mm) == ((0.25, 0.5), (2.0, 1.0))
