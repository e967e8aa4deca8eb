"""Aspheric terms for a device: which files, how many steps, how well series follow them, and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from aspheres import MIRRORS, asphere_scene, powers

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.packing.asphere import for_device, quadric_radius_mm
from irtscots_cl.tracing.packing.departures import MAX_NEWTON_STEPS
from irtscots_cl.tracing.packing.scene import pack

FILES = {  # fp32: (asphere, zernike)
    "even": ("even", "none"), "order-20": ("even", "none"), "odd": ("odd", "none"), "q-bfs": ("even", "none"),
    "q-fine": ("none", "clenshaw"), "deviated": ("even", "power"), "off-axis": ("none", "power"),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_files_and_steps(name):
    packed = pack(ChiefRays(asphere_scene(name)), "fp32")
    assert (packed.choices["asphere"], packed.choices["zernike"]) == FILES[name]
    assert packed.choices["approach"] == "exact"
    assert packed.constants["newton_steps"][0] <= 3  # for departures of up to a millimetre
    assert pack(ChiefRays(asphere_scene(name)), "fp64").constants["newton_steps"][0] <= 4


def test_mirrors_without_terms_keep_their_files():
    packed = pack(ChiefRays(load_scene("sphere-deviated")), "fp32")
    assert (packed.choices["asphere"], packed.choices["approach"]) == ("none", "slight")
    assert "asphere" not in packed.scene.dtype.names
    assert "asphere" not in pack(ChiefRays(load_scene("sphere")), "fp32").choices


@pytest.mark.parametrize("name", ["off-axis", "off-axis-odd", "off-axis-sphere"])
def test_series_follow_segments_to_a_picometre(name):
    surface, random = Surface.of(MIRRORS[name]), np.random.default_rng(3)
    (series,) = for_device(surface, np.float32)
    radius, angle = surface.aperture_radius_mm * np.sqrt(random.random(2000)), random.random(2000) * 2 * np.pi
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    height, *slopes = (a - b for a, b in zip(series.at(x, y), surface.departure_at(x, y), strict=True))
    assert np.abs(height).max() < 1e-9 and np.abs(slopes).max() < 1e-11


def test_light_for_the_rim_meets_the_conic_outside_it():
    """Terms of 6 mm lift the rim of a flat: light that is 0.2 steep there meets the plane 1 mm farther out or in."""
    chief = ChiefRays(asphere_scene("flat"))
    assert 50.5 < quadric_radius_mm(chief) < 54
    assert pack(chief, "fp64").scene["mirror"]["departure_radius2"][0] >= quadric_radius_mm(chief) ** 2


def with_terms(scene, **changes):
    return replace(scene, mirror=replace(scene.mirror, **changes))


def test_segments_that_no_series_follows_are_refused():
    """A steep odd term whose cusp at the parent's axis lies inside the segment."""
    scene = with_terms(asphere_scene("off-axis"), off_axis_mm=30.0, asphere=Asphere(powers(p3=0.5)))
    with pytest.raises(
        SceneError, match=r"^mirror.asphere: must be followed to 1e-09 mm .* they leave \S+ mm, \S+ rad$"
    ):
        pack(ChiefRays(scene), "fp64")


def test_designs_that_rays_do_not_reach_in_a_few_steps_are_refused(monkeypatch):
    monkeypatch.setattr("irtscots_cl.tracing.packing.departures.MAX_NEWTON_STEPS", 2)
    with pytest.raises(
        SceneError, match=r"^scene asphere: mirror: must lie near enough to its conic for rays to reach"
    ):
        pack(ChiefRays(asphere_scene("order-20")), "fp64")
    assert MAX_NEWTON_STEPS == 8


def test_non_sequential_traces_take_slight_terms_only():
    scene = load_scene("sphere")
    slight = with_terms(scene, asphere=Asphere({4: 1e-3 / 532**4}))
    assert components_of(slight)[0].shape == "deviated"
    with pytest.raises(SceneError, match=r"^scene sphere: mirror: must depart from the conic by at most 0.01 mm and "):
        components_of(with_terms(scene, asphere=Asphere({4: 1.0 / 532**4})))
    with pytest.raises(SceneError, match=r"slopes of 1e-05 in non-sequential traces"):
        components_of(with_terms(scene, asphere=Asphere({20: 5e-3 / 532**20})))
