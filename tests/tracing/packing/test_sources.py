"""Sources of rays of a bent screen: what a forward ray of each pixel carries."""

from __future__ import annotations

import numpy as np
import pytest
from real_setup import measured_points, real_setup
from scenes import with_part
from tracers import setup_of

from irtscots_cl.tracing.packing.sources import emitters


def strongly_bent(glass):
    return with_part(real_setup("points", glass), "screen", shape=measured_points(9, bend=3.0))


@pytest.mark.parametrize("aim", ["mirror", "camera"])
@pytest.mark.parametrize("glass", [False, True])
def test_a_pixel_of_a_bent_screen_has_its_own_area(glass, aim):
    """Areas of the quadrangles between the pixels' corners; glass changes them by its thickness over the radius."""
    scene = strongly_bent(glass)
    setup, screen = setup_of(scene), scene.screen
    _, area = emitters(setup, "fp64", 1.0, aim)
    of_aim = (setup.mirror_aim if aim == "mirror" else setup.camera_aim).area
    u, v = (
        (np.arange(n + 1) - n / 2) * pitch + offset
        for n, pitch, offset in zip(screen.pixels, screen.pitch_xy_mm, screen.centre_offset_mm, strict=True)
    )
    corner = setup.chief_rays.screen_model.to_world(*np.meshgrid(u, v))
    diagonals = corner[1:, 1:] - corner[:-1, :-1], corner[1:, :-1] - corner[:-1, 1:]
    own = (np.linalg.norm(np.cross(*diagonals), axis=-1) / 2).ravel()
    assert own.max() / own.min() > 1.1  # so this tells something
    found = area / of_aim * screen.pixel_area_mm2
    np.testing.assert_allclose(found, own, rtol=0.04 if glass else 5e-4)  # 0.4 mm over 10 mm and more; bend of a pixel
    assert (np.abs(found / own - 1).max() > 2e-3) == glass


def test_facets_hold_the_place_and_the_edges_of_their_pixels():
    scene = strongly_bent(False)
    sources, _ = emitters(setup_of(scene), "fp64", 1.0, "mirror")
    model, screen = setup_of(scene).chief_rays.screen_model, scene.screen
    row, column = np.divmod(np.arange(len(sources)), screen.pixels[0])
    for s, t in ((0.0, 0.0), (0.4, -0.3)):
        place = [(at + step - (n - 1) / 2) * pitch + offset for at, step, n, pitch, offset in
                 zip((column, row), (s, t), screen.pixels, screen.pitch_xy_mm, screen.centre_offset_mm,
                     strict=True)]  # fmt: skip
        point = sources["facet"]["point"] + s * sources["facet"]["pixel_x"] + t * sources["facet"]["pixel_y"]
        bend = 0.0 if s == 0 else 0.01  # mm: pitch^2 / 8 over the radius
        np.testing.assert_allclose(point, model.to_world(*place), rtol=0, atol=1e-9 + bend)
