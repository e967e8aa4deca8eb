"""A scene's numbers in the kernels' structures, and the files that are chosen for it."""

from __future__ import annotations

import numpy as np
import pytest
from loaded_modules import loaded_modules
from lopsided import lopsided
from scenes import scene_of, with_part

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.packing.departures import MAX_NEWTON_STEPS, newton_steps
from irtscots_cl.tracing.packing.scene import pack


def deviated(**noll_um: float):
    terms = ZernikeTerms(540.0, "noll", {int(key.removeprefix("z")): value for key, value in noll_um.items()})
    return with_part(load_scene("sphere"), "mirror", zernike=(terms,))


@pytest.mark.parametrize(
    "scene, precision, expected",
    [
        (load_scene("sphere"), "fp32",
         {"surface": "sphere", "mirror": "nominal", "arrival": "plain", "aperture": "disk"}),
        (with_part(load_scene("sphere"), "mirror", conic=-1.0, obscuration_mm=9.0), "fp32",
         {"surface": "conic", "mirror": "nominal", "aperture": "annulus"}),
        (with_part(load_scene("sphere"), "mirror", off_axis_mm=100.0), "fp32", {"surface": "sphere"}),
        (load_scene("off-axis"), "fp32", {"surface": "off_axis"}),
        (load_scene("sphere"), "fp32", {"frame": "level"}),
        (with_part(load_scene("sphere"), "screen", look_at_mm=(0.0, 1e-3, 0.0)), "fp32", {"frame": "upright"}),
        (with_part(load_scene("sphere"), "camera", position_mm=(-218.0, 1e-3, 4161.0)), "fp32", {"frame": "upright"}),
        (with_part(load_scene("sphere"), "camera", roll_deg=1e-9), "fp32", {"frame": "turned"}),
        (lopsided(), "fp64", {"zernike": "clenshaw", "mirror": "deviated", "arrival": "plain"}),
        (deviated(z6=10.0), "fp32", {"zernike": "power", "arrival": "plain"}),
        (deviated(z6=1e-5), "fp32", {"zernike": "power", "arrival": "compensated"}),
        (deviated(z6=1e-5), "fp64", {"arrival": "plain"}),  # double precision does not lose it
    ],
)  # fmt: skip
def test_files_are_chosen_by_what_the_scene_has(scene, precision, expected):
    choices = pack(ChiefRays(scene), precision).choices
    assert choices | expected == choices
    assert ("zernike" in choices) == bool(scene.mirror.zernike)


def test_a_conic_imports_nothing_of_departures():
    loaded = loaded_modules(
        "from irtscots_cl.optics.chief_rays import ChiefRays; "
        "from irtscots_cl.scene.presets import load_scene; from irtscots_cl.tracing.packing.scene import pack; "
        "pack(ChiefRays(load_scene('off-axis')), 'fp32')"
    )
    packing, optics = "irtscots_cl.tracing.packing.", "irtscots_cl.optics."
    assert packing + "scene" in loaded
    assert not {packing + "departures", packing + "maps", packing + "outline", optics + "height_map"} & loaded
    assert "numpy.polynomial" not in loaded


@pytest.mark.parametrize("name", ["sphere", "off-axis", "lopsided"])
def test_the_packed_mirror_and_devices_are_the_scenes(name):
    """By what the numbers mean: points of the surface, places on the screen and the detector."""
    scene = scene_of(name)
    chief = ChiefRays(scene)
    packed = pack(chief, "fp64").scene[0]
    mirror, angle = packed["mirror"], np.arange(7.0)
    x, y = 50 * np.cos(angle), 90 * np.sin(angle)
    z = chief.surface.quadric.meet(x, y, 0.0, 0.0)
    # on the quadric q_xx x^2 + q_yy y^2 + q_zz z^2 + 2 q_xz x z = 2 z
    left = mirror["q_xx"] * x**2 + mirror["q_yy"] * y**2 + mirror["q_zz"] * z**2 + 2 * mirror["q_xz"] * x * z
    np.testing.assert_allclose(left, 2 * z, rtol=1e-12)
    assert mirror["aperture_radius2"] == pytest.approx((scene.mirror.diameter_mm / 2) ** 2)
    for part, frame in (("screen", chief.screen_frame), ("camera", chief.camera_frame)):
        axes = np.stack([list(packed[part][axis].tolist())[:3] for axis in ("axis_x", "axis_y", "axis_z")])
        place = np.array(packed[part]["position"].tolist()[:3])
        np.testing.assert_allclose(axes, frame.axes, rtol=0, atol=1e-15)
        np.testing.assert_allclose(place, frame.position_mm, rtol=1e-15)
        offset = np.array(packed[part]["offset"].tolist()[:3])
        np.testing.assert_allclose(axes @ place + offset, 0, atol=1e-9)  # the frame's origin is its zero
    # the left edge of the screen's first column is half a grid from its centre
    pitch, edge = packed["screen_pitch_x"], (packed["screen_left"], packed["screen_top"])
    for k in range(2):
        first_edge = scene.screen.centre_offset_mm[k] - scene.screen.pixels[k] / 2 * pitch
        assert first_edge / pitch + edge[k] == pytest.approx(0, abs=1e-12)


def test_newton_steps_are_as_many_as_the_slope_error_needs():
    """Each further step leaves less; a slight deviation needs fewer than a strong one."""
    slight, strong = ChiefRays(deviated(z9=0.001)), ChiefRays(deviated(z9=20.0, z38=5.0))
    assert newton_steps(strong, 1e-3) == 1
    found = [newton_steps(strong, slope) for slope in (1e-3, 1e-9, 1e-13, 0.0)]
    assert found == sorted(found) and found[0] < found[2] <= found[3] <= MAX_NEWTON_STEPS
    assert newton_steps(slight, 1e-13) < newton_steps(strong, 1e-13)
    packed = [pack(strong, precision).constants["newton_steps"][0] for precision in ("fp32", "fp64")]
    assert packed == [newton_steps(strong, 1e-9), newton_steps(strong, 1e-13)]
