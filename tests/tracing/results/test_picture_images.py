"""Images of any pictures from transport maps, without new rays."""

from __future__ import annotations

import numpy as np
import pytest
from pattern_folders import small_scene

import irtscots_cl as irt
from irtscots_cl.imaging.pictures import Pictures

pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def scene():
    return small_scene()


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="adjoint", rays_per_pixel=256, seed=1)


def test_light_is_additive(scene, run):
    """A picture is the sum of its pixels' light: of two parts of it, and of gamma as of the values' power."""
    values = np.random.default_rng(1).random((1, 21, 21))
    part = np.random.default_rng(2).random((21, 21)) < 0.5
    whole, first, second = run.images(Pictures(scene, np.concatenate([values, values * part, values * ~part])))
    np.testing.assert_allclose(first + second, whole, rtol=1e-12, atol=1e-25)
    assert whole.shape == (24, 24) and whole.max() > 0
    np.testing.assert_array_equal(
        run.images(Pictures(scene, values, gamma=2.0)), run.images(Pictures(scene, values**2))
    )


def test_a_single_lit_pixel_is_one_bin_of_the_map(scene, run):
    picture = np.zeros((1, 21, 21))
    picture[0, 12, 9] = 1
    image = run.images(Pictures(scene, picture))[0].ravel()
    flux, windows = run.flux_w(), run.windows
    for k in range(0, len(windows.pixels), 7):
        column, row = 9 - windows.origins[k, 0], 12 - windows.origins[k, 1]
        inside = 0 <= column < windows.columns and 0 <= row < windows.rows
        assert image[windows.pixels[k]] == pytest.approx(flux[k, row, column] if inside else 0.0, rel=1e-12, abs=0)
    assert image.max() > 0


def test_lines_and_fringes_are_pictures_too(scene, run):
    analytic = irt.trace(scene, estimator="analytic")
    sets = (irt.FringeSet.equal("x", (2.0,), 3), irt.FringeSet.equal("y", (2.0,), 3))
    shown = [one.values((np.arange(21) + 0.5) / 21) for one in sets]
    pictures = np.concatenate(
        [np.broadcast_to(shown[0][:, None, :], (3, 21, 21)), np.broadcast_to(shown[1][:, :, None], (3, 21, 21))]
    )
    for traced in (run, analytic):
        images = traced.images(Pictures(scene, pictures))
        np.testing.assert_allclose(images, traced.images(irt.FringeScan(scene, sets)).frames, rtol=1e-9, atol=1e-22)
    lines = analytic.images(irt.LineScan(scene)).x
    one = np.zeros((1, 21, 21))
    one[0, :, 10] = 1
    np.testing.assert_allclose(analytic.images(Pictures(scene, one))[0], lines.image(10), rtol=1e-12, atol=1e-25)


def test_pictures_need_a_map_of_transport(scene):
    analytic = irt.trace(scene, estimator="analytic")
    picture = np.eye(21)[None]
    with pytest.raises(ValueError, match="picture 0: not the same along columns or rows.*adjoint or forward"):
        analytic.images(Pictures(scene, picture))
