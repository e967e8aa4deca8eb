"""Chains of many elements: their paths, the limit of events that the scene asks for, and what is said beyond it."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from path_scenes import light_of, wide
from scenes import coarse_screen
from tracers import setup_of

from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.elements.direct_light import longest_direct_path
from irtscots_cl.report.facts import path_facts
from irtscots_cl.report.tables import path_tables
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions


def chain(plates, where="camera", reflectance=0.0):
    """The sphere with plane-parallel plates before the camera, or before the mirror, where light crosses them twice."""
    scene = coarse_screen(wide(load_scene("sphere")))
    at = np.array(scene.camera.position_mm) if where == "camera" else np.array([0.0, 0.0, 100.0])
    away = -at / np.linalg.norm(at) if where == "camera" else np.array([0.0, 0.0, 1.0])
    faces = []
    for k in range(2 * plates):
        cursor = at + (4.0 + 2.0 * k) * away
        back, front = (1.0, 1.5) if k % 2 == 0 else (1.5, 1.0)
        faces.append(Element(f"face.{k}", "refractor", tuple(cursor.tolist()), tuple((cursor + away).tolist()),
                             diameter_mm=60.0 if where == "camera" else 1100.0, index_front=front, index_back=back,
                             reflectance=reflectance))  # fmt: skip
    return replace(scene, element=tuple(faces))


def traced(scene, device, **options):
    return light_of(scene, device, rays_per_pixel=2**9, replicates=2, branches="random", **options)


@pytest.mark.parametrize(("plates", "where"), [(5, "camera"), (2, "mirror"),
                                               pytest.param(8, "camera", marks=pytest.mark.slow),
                                               pytest.param(5, "mirror", marks=pytest.mark.slow)])  # fmt: skip
def test_all_light_of_a_chain_that_reflects_nothing_arrives(device, plates, where):
    """As much as without the chain, whose plates move the light by nothing that matters here; on one path."""
    bare, light = (traced(scene, device, seed=3) for scene in (chain(0), chain(plates, where)))
    (path,) = (path for path in light.paths if path.rays)
    met = 2 * plates * (2 if where == "mirror" else 1)
    assert path.kind == "direct" and path.name.count("face.") == met
    assert path.flux_w == pytest.approx(bare.paths[0].flux_w, rel=2e-3, abs=0)  # plates before the mirror: its rim
    assert light.ends["bounce limit"] == 0
    assert light.bounce_limit == max(10, met + 3 + 4)


@pytest.mark.parametrize(("name", "elements"), [("sphere", 3), ("sphere-singlet", 4), ("sphere-doublet", 5),
                                                ("sphere-window", 5), ("ghosts", 6), ("baffled", 3)])  # fmt: skip
def test_the_presets_keep_ten_events_and_short_codes(name, elements):
    setup = setup_of(load_scene(name))
    assert longest_direct_path(setup.chief_rays, components_of(setup.scene)) == elements
    task = PathTask(setup, TraceOptions(NONSEQUENTIAL))
    assert (task.bounce_limit, task.code_length) == (10, "short")


@pytest.mark.second_device
def test_long_codes_change_no_light_of_short_paths(device):
    """The same random numbers, whatever the code's length: the direct light and its image, to the bit."""
    scene = load_scene("sphere-singlet")
    short, long = (traced(scene, device, bounce_limit=limit) for limit in (10, 11))
    assert short.paths[0] == long.paths[0] and short.paths[0].rays > 0
    np.testing.assert_array_equal(short.images_w[:, 0], long.images_w[:, 0])
    assert long.ends["bounce limit"] <= short.ends["bounce limit"]


def test_paths_of_more_than_ten_events_have_their_names(device):
    """Between two half mirrors light goes to and fro; every pass more is two events more, and a quarter of the light.

    A path that a code of ten events cannot hold.
    """
    light = traced(chain(1, reflectance=0.5), device, bounce_limit=20, seed=4)
    found = {path.name: path.flux_w for path in light.paths if path.rays}
    names = [f"screen > mirror > face.1{' > face.0 (r) > face.1 (r)' * k} > face.0 > lens > detector" for k in range(6)]
    assert all(name in found for name in names)
    ratios = [found[b] / found[a] for a, b in itertools.pairwise(names)]
    np.testing.assert_allclose(ratios[:3], 0.25, rtol=0.2)  # by chance: 10,000 rays and fewer
    assert names[5].count(">") > 10


def test_a_chain_that_is_cut_says_what_was_cut(device):
    scene = chain(5)
    with pytest.raises(SceneError) as caught:
        traced(scene, device, bounce_limit=10)
    line = str(caught.value)
    assert line.startswith("scene sphere: detector: no path from the screen reaches it; must be reached by one of ")
    assert "of them were given up after 10 events, with " in line and "W (--bounce-limit goes up to 42)" in line


def test_the_table_names_the_limit_beside_the_light_that_was_given_up(device):
    light = traced(chain(1, reflectance=0.5), device, bounce_limit=7)
    rows = {row[0]: row for row in path_tables(path_facts(light, ()))[-1].rows}
    _, rays, flux = rows["given up after 7 events (--bounce-limit)"]
    assert int(rays.replace(",", "")) == light.ends["bounce limit"] > 0
    assert float(flux.split()[0]) == pytest.approx(light.losses[-1].flux_w, rel=0.1)
