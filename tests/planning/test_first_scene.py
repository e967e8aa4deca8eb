"""First scenes for mirrors of all kinds: what is written loads, works, and raises no alarm."""

import math

import pytest

from irtscots_cl.planning.check import check_scene
from irtscots_cl.planning.first_scene import INCH_MM, Bench, design
from irtscots_cl.scene.presets import parse_scene

MIRRORS = {
    "paraboloid of a telescope": (406.4, 3251.2, {"conic": -1.0}),
    "sphere of the paper": (1064.0, 4166.747, {}),
    "off-axis paraboloid": (300.0, 3000.0, {"conic": -1.0, "off_axis_mm": 400.0}),
    "small fast sphere": (50.0, 200.0, {}),
    "hyperboloid with a hole": (800.0, 4000.0, {"conic": -1.2, "obscuration_mm": 200.0}),
    "convex sphere": (100.0, -2000.0, {}),
    "flat": (100.0, math.inf, {}),
}


@pytest.mark.parametrize("side", ["+x", "-y"])
@pytest.mark.parametrize("name", MIRRORS)
def test_a_first_scene_works(name, side):
    diameter, radius, more = MIRRORS[name]
    made = design(diameter, radius, bench=Bench(side=side), **more)
    found = check_scene(made.scene, heights=False)
    assert found.measured == 1.0
    assert [one.text for one in found.findings if one.level == "error"] == []
    loaded = parse_scene(made.toml)
    assert loaded == made.scene
    assert loaded.mirror.radius_mm == radius


def test_the_screen_is_a_part_of_the_monitor():
    bench = Bench(screen_diagonal_mm=24 * INCH_MM, screen_pixels=(1920, 1080))
    scene = design(406.4, 3251.2, conic=-1.0, bench=bench).scene
    assert scene.screen.pitch_xy_mm[0] == pytest.approx(24 * 25.4 / math.hypot(1920, 1080), rel=1e-5)
    assert all(used <= whole for used, whole in zip(scene.screen.pixels, bench.screen_pixels, strict=True))


def test_pixels_are_binned_to_what_the_mirror_needs():
    made = design(406.4, 3251.2, conic=-1.0, bench=Bench(sensor_pixels=(4000, 3000), sensor_pitch_um=2.0))
    assert made.binning > 1
    assert made.scene.camera.detector.pitch_mm == pytest.approx(2e-3 * made.binning)
    assert made.scene.camera.detector.pixels == (4000 // made.binning, 3000 // made.binning)


def test_a_monitor_that_is_too_small_is_said_with_the_size_it_takes():
    with pytest.raises(ValueError, match=r"needs one of about [0-9.e+]+ inch"):
        design(1000.0, -1000.0)


def test_a_side_that_is_none():
    with pytest.raises(ValueError, match="side = 'left': must be one of"):
        design(100.0, 1000.0, bench=Bench(side="left"))
