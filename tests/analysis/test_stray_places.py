"""What ghosts do to the places that pixels see: the same as measures of scaled light find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, coarse_screen

from irtscots_cl.analysis.stray_light import stray_light
from irtscots_cl.analysis.stray_places import stray_maps
from irtscots_cl.budget.stray_paths import scaled
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.results.paths import KINDS
from irtscots_cl.tracing.trace import trace_paths


@pytest.fixture(scope="module")
def light(device):
    scene = coarse(coarse_screen(load_scene("sphere-singlet")))
    return trace_paths(scene, device=device, rays_per_pixel=2**14, seed=7, branches="split")


@pytest.fixture(scope="module")
def ghosts(light):
    return stray_maps(light, stray_light(light))["ghost"]


def times(light, factor):
    """The light with a factor on that of ghosts."""
    factors = np.where(np.array(KINDS) == "ghost", factor, 1.0)
    return replace(light, images_w=light.images_w * factors[None, :, None, None])


def changes(light, measure):
    """Change [2, rows, columns] of the measured centroids by the ghosts; NaN outside the mask."""
    pattern, setup = LineScan(light.scene), Setup(light.scene.nominal())
    both, alone = (measure_by(measure, one.images(pattern), setup) for one in (light, light.only("direct")))
    return np.stack([both.centroid_x_mm - alone.centroid_x_mm, both.centroid_y_mm - alone.centroid_y_mm])


@pytest.mark.parametrize("factor", [0.5, 1.0, 30.0])
def test_a_factor_on_the_light_acts_as_told(light, ghosts, factor):
    """To rounding; in proportion it would be wrong by the light itself, a few per cent of 30 times these ghosts."""
    found = changes(times(light, factor), "paper")
    used = np.isfinite(found).all(0)
    told = scaled(ghosts.change_mm[0], ghosts.of_direct, factor)
    assert used.sum() > 300 and np.abs(found - told)[:, used].max() < 1e-12
    assert np.abs(found[:, used]).max() > 5e-4 * factor
    if factor > 1:
        in_proportion = np.abs(found - factor * ghosts.change_mm[0])[:, used].max()
        assert in_proportion > 0.02 * np.abs(found[:, used]).max()


def test_a_windowed_centroid_takes_even_light_away(light):
    """So that the file's places are not its: what `irtscots paths --measure windowed` is for."""
    plain, windowed = (stray_light(light, measure)[0].height_nm.value for measure in ("paper", "windowed"))
    assert plain == pytest.approx(22.5, rel=0.1) and windowed < 0.3 * plain


def test_shares_are_those_of_the_light(light, ghosts):
    """Over the whole detector: weighted by the direct light of each pixel."""
    direct = light.only("direct").images_w.sum((0, 1, 2)).reshape(ghosts.of_direct.shape)
    seen = np.isfinite(ghosts.of_direct)
    share = np.sum((ghosts.of_direct * direct)[seen]) / direct[seen].sum()
    stray = light.only("ghost").images_w.sum((0, 1, 2)).reshape(direct.shape)
    assert share == pytest.approx(stray[seen].sum() / direct[seen].sum(), rel=1e-9)
    assert ghosts.facts["of_direct"] == pytest.approx(stray.sum() / direct.sum(), rel=1e-3)


def test_standard_errors_are_those_of_other_seeds(light, ghosts, device):
    again = trace_paths(light.scene, device=device, rays_per_pixel=2**14, seed=8, branches="split")
    other = stray_maps(again, stray_light(again))["ghost"]
    seen = np.isfinite(ghosts.height_nm) & np.isfinite(other.height_nm)
    for one, two, errors in (
        (ghosts.change_mm[0], other.change_mm[0], [jackknife_error(maps.change_mm) for maps in (ghosts, other)]),
        (ghosts.of_direct, other.of_direct, [maps.of_direct_error for maps in (ghosts, other)]),
    ):
        z = ((one - two) / np.hypot(*errors))[..., seen]
        # of Student's t with 7 degrees, whose square has the mean 7 / 5, from two errors: about 1.2
        assert 0.8 < np.mean(z**2) < 1.7
    z = (ghosts.height_nm - other.height_nm)[seen] / np.hypot(ghosts.height_error_nm, other.height_error_nm)[seen]
    assert 0.3 < np.mean(z**2) < 4  # few independent numbers: smooth maps


def test_pixels_without_direct_light_have_no_value(light, ghosts):
    dark = light.only("direct").images_w.sum((0, 1, 2)).reshape(ghosts.of_direct.shape) == 0
    assert dark.any() and np.isnan(ghosts.of_direct[dark]).all() and np.isnan(ghosts.change_mm[..., dark]).all()
    assert np.isfinite(ghosts.of_direct[~dark]).mean() > 0.9


def test_pixels_that_are_lost_have_no_value(light):
    """Much light where the geometry allows none makes a light curve unusable."""
    bright = times(light, 300.0)
    stray = stray_light(bright)
    found, (lost,) = stray_maps(bright, stray)["ghost"], [one.lost for one in stray]
    assert 0 < lost.sum() == stray[0].lost_pixels < 0.9 * np.isfinite(found.of_direct).sum()
    assert np.isnan(found.of_direct[lost]).all() and np.isnan(found.change_mm[..., lost]).all()
