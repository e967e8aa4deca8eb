"""Names of unknowns as a user writes them, and what is known of them."""

from __future__ import annotations

import math

import pytest
from calibrations import knowing, paraboloid

from irtscots_cl.calibration.known import distances_of, named_unknowns, priors_of
from irtscots_cl.scene.validation import SceneError

SCENE = paraboloid(21)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("camera.x_mm", ["camera.x_mm"]),
        ("intrinsics", ["camera.principal_x_px", "camera.principal_y_px", "camera.focal_relative"]),
        ("camera.k1, distortion", ["camera.k1", "camera.k2", "camera.p1", "camera.p2", "camera.k3"]),
        ("zernike.4-6", ["zernike.4_um", "zernike.5_um", "zernike.6_um"]),
        ("screen.tilt_*,", ["screen.tilt_x_rad", "screen.tilt_y_rad"]),
        ("screen.sag_3_0_mm", ["screen.sag_3_0_mm"]),
        ("", []),
    ],
)  # fmt: skip
def test_lists_of_names(text, names):
    assert list(named_unknowns(text, SCENE)) == names


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera.x_m", "did you mean camera.x_mm?"),
        ("zernike.9-4", "zernike.4-15, from 1 to 861"),
        ("zernike.4-999", "zernike.4-15, from 1 to 861"),
        ("nothing.*", "nothing.*"),
        ("camera.x_mm;screen", "unknown 'camera.x_mm;screen'"),
    ],
)
def test_what_is_no_name(text, message):
    with pytest.raises(ValueError, match="unknown") as caught:
        named_unknowns(text, SCENE)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_defaults_and_what_the_scene_says():
    scene = knowing(SCENE, camera__x_mm=0.02)
    priors = priors_of(("camera.x_mm", "camera.y_mm", "camera.roll_rad"), scene)
    assert [priors[name].sigma for name in priors] == pytest.approx([0.02, 0.5, math.radians(0.1)])
    assert [priors[name].source for name in priors] == ["calibration.known", "default", "default"]
    bare = priors_of(("camera.x_mm", "camera.y_mm"), scene, defaults=False)
    assert bare["camera.x_mm"].sigma == 0.02 and math.isnan(bare["camera.y_mm"].sigma)


def test_distances():
    scene = knowing(SCENE, camera_to_screen=(400.0, 0.05), mirror_to_camera=0.1)
    known = {d.name: d for d in distances_of(scene)}
    assert (known["camera to screen"].mm, known["camera to screen"].sigma) == (400.0, 0.05)
    there = math.dist(scene.camera.position_mm, (0, 0, 0))
    assert known["mirror to camera"].mm == pytest.approx(there) == known["mirror to camera"].of(scene)


def test_an_unknown_name_in_the_scene():
    with pytest.raises(SceneError, match=r"^my\.toml: calibration\.known: unknown 'camera\.roll'.*camera\.roll_rad"):
        priors_of(("camera.x_mm",), knowing(SCENE, camera__roll=0.1), source="my.toml")
