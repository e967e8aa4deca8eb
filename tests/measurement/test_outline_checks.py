"""Pictures of a mirror against its design: what is named, and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mirror_pictures import disk, picture, share
from real_setup import REAL
from scenes import coarse, with_part

from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.mirror_outline import NoOutlineError
from irtscots_cl.measurement.outline_checks import find_outline, outline_checks
from irtscots_cl.measurement.rim_curve import RimCurve
from irtscots_cl.optics.chief_rays import ChiefRays

N = 72
SCENE = with_part(coarse("sphere", N), "mirror", diameter_mm=900.0, obscuration_mm=260.0)
CHIEF = ChiefRays(SCENE)
RIM, HOLE = (RimCurve.of_design(CHIEF, r) for r in (450.0, 130.0))
MIDDLE, RADIUS, HOLE_RADIUS = RIM.centre, RIM.radius_px, HOLE.radius_px


def mirror(shift=(0.0, 0.0), scale=1.0, hole_shift=(0.0, 0.0), hole_scale=1.0):
    at = MIDDLE + shift
    return disk((N, N), at, scale * RADIUS, scale * hole_scale * HOLE_RADIUS, at + hole_shift)


def judged(on_mirror, chief=CHIEF, **kind):
    signal = picture(on_mirror, noise=0.7, **kind)
    lit = mirror_mask(signal, largest=False)
    found = find_outline(signal, lit, chief)
    return found, {check.name: check for check in outline_checks(found, signal, lit)}


def named(checks):
    return {name for name, check in checks.items() if check.level != "ok"}


def test_a_mirror_in_its_place_raises_no_check():
    """Five pictures with noise, blur and light that falls by 30 %; false alarms at 1e-6 each."""
    for seed in range(5):
        found, checks = judged(mirror(), seed=seed)
        assert named(checks) == set(), checks
        assert set(checks) == {
            "outline shift", "outline size", "outline shape", "obscuration", "dark parts", "other light", "vignetting"
        }  # fmt: skip
        assert np.abs(found.shift_mm).max() < 5 * found.shift_error_mm.max() < 5


def test_coverage_is_that_of_rim_and_hole():
    found, _ = judged(mirror((0.4, 0.3)))
    truth = mirror((0.4, 0.3))
    assert np.abs(found.coverage - truth).max() < 0.1
    assert found.whole.sum() + found.cut.sum() == np.count_nonzero(found.coverage)
    assert abs(found.coverage.sum() / truth.sum() - 1) < 2e-3


def test_a_shift_is_told_in_pixels_and_mm():
    found, checks = judged(mirror((2.0, -1.0)))
    assert named(checks) == {"outline shift"}
    pitch = SCENE.camera.detector.pitch_mm / SCENE.camera.image_distance_mm * SCENE.camera.focus_mm
    np.testing.assert_allclose(found.shift_mm, [-pitch, 2 * pitch], rtol=0.05)
    assert "+2.0" in checks["outline shift"].text and "mm) on the mirror" in checks["outline shift"].text
    assert "the camera's direction or position, or the mirror's place, differs" in checks["outline shift"].text


@pytest.mark.parametrize(
    ("on_mirror", "names", "said"),
    [
        (mirror(scale=1.03), {"outline size"}, "1.0"),
        (mirror(hole_shift=(0.9, -0.5)), {"obscuration"}, "the central hole is decentred, 1.0"),
        (mirror(hole_scale=1.12), {"obscuration"}, "times the design's size: mirror.obscuration_mm differs"),
    ],
)
def test_another_size_and_a_decentred_hole_are_named(on_mirror, names, said):
    _, checks = judged(on_mirror)
    assert named(checks) == names
    assert said in "; ".join(checks[name].text for name in names)


def bar(row, column):
    return np.abs((row - MIDDLE[0]) * 0.9 + (column - MIDDLE[1]) * 0.44 - 14) < 1.6


def hand(row, column):
    return (np.abs(row - MIDDLE[0] + 8) < 5) & (column > MIDDLE[1] + 19)


def spot(row, column):
    return np.hypot(row - MIDDLE[0] - 14, column - MIDDLE[1]) < 2.7


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (bar, "from rim to rim: a cable, an arm or a bar across the mirror"),
        (hand, "in from the rim: a hand, a clamp, a shadow"),
        (spot, "inside: dirt, a mark, or light that misses the screen"),
    ],
)
def test_what_is_in_front_of_the_mirror_is_named(inside, said):
    on_mirror = mirror() * (1 - share((N, N), inside))
    found, checks = judged(on_mirror)
    assert "dark parts" in named(checks) <= {"dark parts", "outline shape"}
    assert said in checks["dark parts"].text
    assert np.abs(found.rim.shift_px).max() < 0.1
    known = share((N, N), inside) > 0
    signal = picture(on_mirror, noise=0.7)
    lit = mirror_mask(signal, largest=False)
    again = {check.name: check for check in outline_checks(found, signal, lit, known)}
    assert again["dark parts"].level == "ok"


def test_a_second_bright_object_is_named():
    on_mirror = mirror()
    on_mirror[2:6, 3:8] = 0.8
    _, checks = judged(on_mirror)
    assert named(checks) == {"other light"}
    assert "1 bright place beside the mirror: " in checks["other light"].text


def test_vignetting_is_named_with_its_side():
    column = np.arange(N)
    fall = np.clip(1 - (column - MIDDLE[1] - 5) / 30, 0.2, 1)
    _, checks = judged(mirror() * fall)
    assert "vignetting" in named(checks) <= {"vignetting", "dark parts", "outline shape"}
    assert "at the rim (right)" in checks["vignetting"].text


def test_another_shape_is_named():
    """An ellipse whose axes differ by 4 %."""
    on_mirror = share((N, N), lambda r, c: np.hypot((r - MIDDLE[0]) * 1.02, (c - MIDDLE[1]) * 0.98) <= RADIUS)
    chief = ChiefRays(with_part(SCENE, "mirror", obscuration_mm=0.0))
    _, checks = judged(on_mirror, chief)
    assert named(checks) == {"outline shape"}


def test_a_mirror_that_is_not_there_is_refused():
    with pytest.raises(NoOutlineError):
        judged(disk((N, N), (5.0, 5.0), 3.0))


@pytest.mark.parametrize("name", ["real", "turned"])
def test_the_rim_is_projected_through_the_camera_model(name):
    """Of cameras with distortion and roll: every projected point's chief ray meets the rim."""
    chief = ChiefRays(REAL[name]())
    rim = RimCurve.of_design(chief, chief.surface.aperture_radius_mm)
    points = chief.reverse(rim.points[:, 0], rim.points[:, 1])[0]
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), chief.surface.aperture_radius_mm, rtol=1e-9)


def test_a_pixel_of_a_small_hole_is_not_taken_for_dirt():
    scene = with_part(SCENE, "mirror", obscuration_mm=60.0)
    found, checks = judged(disk((N, N), MIDDLE, RADIUS, 60 / 260 * HOLE_RADIUS), ChiefRays(scene))
    assert found.hole is None and named(checks) == set()
    assert "pixels wide" in checks["obscuration"].text
    assert replace(found).why_no_hole
