"""Elements of a scene in the structures of the non-sequential kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse_screen

from irtscots_cl.optics.elements.components import components_of, groups_of, targets_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.tracing.packing.components import MIN_WEIGHT, pack_elements, pack_scatter, path_job
from irtscots_cl.tracing.packing.sources import emitters


def packed(scene, least_chance=0.1):
    components = components_of(scene)
    return components, pack_elements(scene, components, np.float64, least_chance)


@pytest.mark.parametrize("preset", ["sphere-window", "sphere-singlet", "baffled"])
def test_elements_keep_their_place_whatever_group_they_are_in(preset):
    """An element's origin counts from its group's; offset takes coordinates of any group into its frame."""
    scene = load_scene(preset)
    components, entries = packed(scene)
    origins, group = groups_of(scene, components)
    for entry, component, of in zip(entries, components, group, strict=True):
        vector = [np.array(entry[name].tolist()[:3]) for name in ("origin", "axis_x", "axis_y", "axis_z")]
        np.testing.assert_allclose(origins[of] + vector[0], component.frame.position_mm, rtol=1e-13, atol=1e-9)
        np.testing.assert_allclose(vector[1:], component.frame.axes, atol=1e-15)
        assert entry["group"] == of
        for k, origin in enumerate(origins):
            there = component.frame.position_mm - origin  # the element's vertex is 0 in its own frame
            offset = np.array(entry["offset"][k].tolist())[:3]
            np.testing.assert_allclose(np.stack(vector[1:]) @ there + offset, 0, atol=1e-9)


def test_what_is_infinite_or_unknown_has_numbers_of_its_own():
    scene = load_scene("sphere-window")
    components, entries = packed(scene, 0.25)
    of = dict(zip((component.name for component in components), entries, strict=True))
    assert of["window.front"]["reflectance"] == -1.0  # Fresnel's
    assert of["mirror"]["reflectance"] == scene.mirror.reflectance
    assert of["mirror"]["half_u"] == of["mirror"]["half_v"] == 1e30 and np.isfinite(of["mirror"]["outer2"])
    assert of["mirror"]["inverse_focal_length"] == 0.0
    assert of["lens"]["inverse_focal_length"] == pytest.approx(1 / scene.camera.focal_length_mm)
    assert (entries["least_chance"] == 0.25).all() and (entries["min_weight"] == MIN_WEIGHT).all()


def test_rays_at_surfaces_that_scatter_never_take_both_branches():
    scene = load_scene("sphere-window")
    scattering = replace(scene, mirror=replace(scene.mirror, scatter=Lambertian(tis=0.01)))
    _, entries = packed(scattering)
    assert entries["min_weight"][0] == np.float64(1e30) and (entries["min_weight"][1:] == MIN_WEIGHT).all()


@pytest.mark.parametrize(
    "model", [Lambertian(tis=0.02), Harvey(l=0.01, s=-1.5, tis=0.0025), ABg(a=1e-4, b=1e-3, g=1.5)], ids=repr
)
def test_lobes_hold_their_models_numbers(model):
    """The kernels' sum of the numbers against bsdf at distances b from the reflected ray, and the totals' table."""
    scene = load_scene("sphere-window")
    scene = replace(scene, mirror=replace(scene.mirror, scatter=model))
    out, _ = pack_scatter(scene, components_of(scene), np.float64, aimed=True)
    lobe, b = out["lobes"][0], np.array([0.0, 0.003, 0.1, 0.9])
    first, second, third = (float(n) for n in lobe["numbers"].tolist()[:3])
    told = {
        Lambertian: lambda: np.full(4, first),
        Harvey: lambda: first * (1 + b**2 * second) ** third,
        ABg: lambda: first / (second + (b**2) ** third),
    }[type(model)]()
    np.testing.assert_allclose(told, [float(model.bsdf(at)) for at in b], rtol=1e-12)
    cosine = np.linspace(0, 1, len(lobe["tis"])) ** 2
    np.testing.assert_allclose(lobe["tis"], model.tis_at(np.sqrt(1 - cosine**2)), rtol=1e-12)
    assert lobe["target_count"] == len([t for t in targets_of(scene) if t.name != "mirror"]) > 0


def test_without_aiming_all_rays_are_drawn_from_the_lobe():
    scene = load_scene("sphere-window")
    scene = replace(scene, mirror=replace(scene.mirror, scatter=Lambertian(tis=0.01)))
    out, _ = pack_scatter(scene, components_of(scene), np.float64, aimed=False)
    assert out["lobes"]["share"][0] == 1.0 and out["lobes"]["target_count"][0] == 0


def test_the_jobs_unit_is_the_largest_aim():
    scene = coarse_screen(load_scene("sphere-window"))
    components = components_of(scene)
    sources, _ = emitters(Setup(scene), "fp64", 1.0, "mirror")
    job = path_job(scene, components, np.float64, 7, sources)
    assert job["element_count"] == len(components) and job["bounce_limit"] == 7
    weights = job["inverse_unit_area"] * sources["aim_ll"] * sources["aim_mm"]
    assert weights.max() == pytest.approx(1, rel=1e-15)
