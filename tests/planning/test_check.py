"""Mistakes that people make, one scene each, and the code that `check` must give; no false alarm on good scenes."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl.planning.check import check_scene
from irtscots_cl.planning.sight import Sight
from irtscots_cl.planning.unreadable import explain
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.presets import load_scene, preset_names, preset_text
from irtscots_cl.scene.validation import SceneError

ROOT = Path(__file__).resolve().parents[2]
PLANNING = ROOT / "irtscots_cl" / "planning"
NEWTONIAN, SPHERE, OFF_AXIS = (load_scene(name) for name in ("newtonian", "sphere", "off-axis"))
LEVELS = ("error", "warning")


def mirror(scene=NEWTONIAN, **values):
    return replace(scene, mirror=replace(scene.mirror, **values))


def screen(scene=NEWTONIAN, **values):
    return replace(scene, screen=replace(scene.screen, **values))


def camera(scene=NEWTONIAN, **values):
    return replace(scene, camera=replace(scene.camera, **values))


def detector(scene=NEWTONIAN, **values):
    return camera(scene, detector=replace(scene.camera.detector, **values))


def noise(**values):
    return detector(noise=DetectorNoise(full_well_e=1e4, shot_noise=True, **values))


X, Y, Z = OFF_AXIS.screen.position_mm
WRONG = {
    "radius given in inches": ("radius-in-inches", lambda: mirror(radius_mm=128.0)),
    "twice the radius, for a diameter": ("radius-doubled", lambda: mirror(radius_mm=6502.4)),
    "focal length for radius": ("radius-is-focal-length", lambda: mirror(radius_mm=1625.6)),
    "sign of a convex mirror": ("radius-sign", lambda: mirror(radius_mm=-3251.2)),
    "screen along y instead of x": ("screen-axes", lambda: screen(position_mm=(0.0, 180.0, 3255.0))),
    "screen on the other side": ("screen-side", lambda: screen(OFF_AXIS, position_mm=(-X, Y, Z))),
    "camera looks past": ("camera-looks-past", lambda: camera(look_at_mm=(400.0, 0.0, 0.0))),
    "rows for columns": ("screen-pixels-swapped", lambda: screen(pixels=(12, 36))),
    "screen's pitch in metres": ("screen-pitch-unit", lambda: screen(pitch_mm=0.2331e-3)),
    "sensor's pitch in micrometres": ("detector-pitch-unit", lambda: detector(pitch_mm=27.6)),
    "half-size screen": ("screen-too-small", lambda: screen(pixels=(10, 8))),
    "screen of few pixels": ("screen-too-small", lambda: screen(SPHERE, pixels=(4, 4))),
    "whole 4K monitor line by line": ("screen-too-large", lambda: screen(pixels=(3840, 2160))),
    "screen inside the focus": ("light-misses-screen", lambda: screen(position_mm=(90.0, 0.0, 1500.0))),
    "lens too long": ("mirror-cut-off", lambda: camera(focal_length_mm=75.0)),
    "lens too short": ("mirror-small", lambda: camera(focal_length_mm=5.0)),
    "lens focused near": ("camera-defocused", lambda: camera(focus_distance_mm=1000.0, aperture_diameter_mm=8.75)),
    "screen turned away": ("screen-slanted", lambda: screen(look_at_mm=(2000.0, 0.0, 2900.0))),
    "screen over camera": ("screen-blocks-camera", lambda: screen(position_mm=(0.0, 0.0, 3254.0), pixels=(2560, 1440))),
    "screen in the camera's plane": ("camera-before-screen", lambda: screen(pixels=(3840, 2160))),
    "exposure too long": ("saturated", lambda: noise(electrons_at_peak=5e4)),
    "exposure too short": ("too-dark", lambda: noise(electrons_at_peak=20.0)),
    "pixels of a large display": ("light-too-small", lambda: screen(pitch_mm=5.0, pixels=(10, 10))),
}  # fmt: skip


def codes(found):
    return {one.code for one in found.findings if one.level in LEVELS}


@pytest.mark.parametrize("mistake", WRONG)
def test_a_mistake_gets_its_code(mistake):
    code, make = WRONG[mistake]
    found = check_scene(make(), heights=False)
    assert code in codes(found)
    assert all("\n" not in one.text for one in found.findings)
    assert found.worst in LEVELS


@pytest.mark.parametrize("name", preset_names())
def test_presets_raise_no_alarm(name):
    found = check_scene(load_scene(name), heights=False)
    assert codes(found) == set()
    assert found.measured == 1.0


@pytest.mark.parametrize(
    ("periods", "code"),
    [
        ((36.0,), "fringes-too-fine"),
        ((5.0,), "fringes-blurred"),
        ((3.0,), "fringes-ambiguous"),
        ((0.9, 1.24, 1.7), None),
    ],
)
def test_fringes(periods, code):
    assert codes(check_scene(NEWTONIAN, periods=periods, heights=False)) == ({code} if code else set())


def test_detail_needs_pixels():
    assert codes(check_scene(NEWTONIAN, detail_mm=5.0, heights=False)) == {"pixels-coarse"}
    assert codes(check_scene(NEWTONIAN, detail_mm=20.0, heights=False)) == set()


def test_a_radius_in_metres_is_refused_and_explained(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(preset_text("newtonian").replace("radius_mm = 3251.2", "radius_mm = 3.2512"), encoding="utf-8")
    with pytest.raises(SceneError) as refused:
        load_scene(path)
    found = explain(path, refused.value)
    assert [one.code for one in found] == ["radius-in-metres", "scene-refused"]
    assert "3251.2" in found[0].text


def test_a_file_that_nothing_explains_keeps_its_error(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(preset_text("newtonian").replace("conic = -1.0", 'conic = "parabola"'), encoding="utf-8")
    with pytest.raises(SceneError, match="conic") as refused:
        load_scene(path)
    with pytest.raises(SceneError, match="conic"):
        explain(path, refused.value)


def test_the_screen_that_is_asked_for_is_enough():
    """The size and the place that the text names measure the whole mirror."""
    small = screen(pixels=(10, 8), centre_offset_mm=(0.4, -0.3))
    text = next(one.text for one in check_scene(small, heights=False).findings if one.code == "screen-too-small")
    pixels = tuple(int(n) for n in text.split("screen.pixels = [")[1].split("]")[0].split(","))
    offset = tuple(float(n) for n in text.split("centre_offset_mm = [")[1].split("]")[0].split(","))
    assert Sight.of(screen(pixels=pixels, centre_offset_mm=offset)).measured == 1.0
    assert Sight.of(screen(pixels=(pixels[0] - 8, pixels[1]), centre_offset_mm=offset)).measured < 1.0


def test_the_sight_of_the_sphere_is_that_of_closed_form():
    """A mirror of diameter D at distance d: an image of D s' / d; near the centre of curvature, light as wide as the
    aperture's image, the size of the aperture."""
    sight, scene = Sight.of(SPHERE), SPHERE
    distance = math.dist(scene.camera.position_mm, (0, 0, 0))
    across = scene.mirror.diameter_mm * scene.camera.image_distance_mm / distance / scene.camera.detector.pitch_mm
    ring = np.sqrt(11.5 / 12)  # of the outermost points
    assert sight.image_px[1] == pytest.approx(across * ring, rel=0.01)
    assert sight.measured == 1.0


def test_height_errors_are_those_of_a_run_without_rays():
    from irtscots_cl.pipeline.simulate import simulate

    found = {one.code: one for one in check_scene(SPHERE).findings}
    run = simulate(SPHERE, estimator="analytic")
    expected = run.comparison.height_error_nm["piston_tilt"].value
    assert f"{expected:.3g} nm with --measure paper" in found["height-error-method"].text
    assert {"height-error-noise", "height-error-geometry"} <= set(found)
    assert all(one.level == "info" for one in found.values())


def test_every_code_has_its_paragraph():
    """The codes in the source of planning/, and the headings of docs/checks.md."""
    source = "".join(path.read_text(encoding="utf-8") for path in sorted(PLANNING.glob("*.py")))
    used = set(re.findall(r'"([a-z]+(?:-[a-z]+)+)"', source)) - {"my-mirror", "utf-8"}
    used |= set(re.findall(r'Finding\(\s*"([a-z]+)"', source))
    used |= {f"{key}-{what}" for key in ("screen", "detector") for what in ("pixels-swapped", "pitch-unit")}
    headings = set(
        re.findall(r"^### ([a-z-]+)$", (ROOT / "docs" / "checks.md").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert used == headings
