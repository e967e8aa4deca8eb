"""A map of the mirror's support, known only roughly, as an error source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from height_maps import letter, with_maps
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.sources import known_sources, source_of
from irtscots_cl.budget.trials import Trials
from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.validation import SceneError

RADIUS = 532.0
LETTER = MirrorMap(heights=letter(), outside="nearest")


def zernike_map(noll: int, nodes: int = 161) -> MirrorMap:
    """1 um of a Zernike term on the mirror's disk, and on beyond it."""
    x = np.linspace(-1.05, 1.05, nodes)
    heights = 1e-3 * zernike(noll, *np.meshgrid(x, x))
    return MirrorMap(heights=HeightMap(heights, pitch_mm=(2.1 * RADIUS / (nodes - 1),) * 2))


def design_with(*tables: MirrorMap, pixels: int = 61) -> MeasuredDesign:
    return MeasuredDesign.of(Setup(with_maps(small_scene(pixels), *tables)))


@pytest.mark.parametrize("noll", [6, 8, 11])
def test_a_map_of_a_zernike_term_is_that_term(noll):
    design = design_with(zernike_map(noll))
    sources = [source_of(name, design.setup.scene, maps=design.maps) for name in ("map.1", f"zernike.{noll}_um")]
    of_map, of_term = sensitivities(design, sources)
    assert of_map.height_mm == pytest.approx(of_term.height_mm, abs=1e-3 * np.abs(of_term.height_mm).max())


def test_the_test_sees_the_map_where_it_is():
    """A letter, turned and moved: the heights on the mirror, smoothed by the pixels of the coarse grid."""
    table = replace(LETTER, rotation_deg=35.0, centre_mm=(20.0, -30.0))
    design = design_with(table, pixels=125)
    source = source_of("map.1", design.setup.scene, maps=design.maps)
    height = design.heights_mm(source.changes_mm(design, 2.0, Draw(0, 0)))
    seen, c, s = design.seen, np.cos(np.radians(35)), np.sin(np.radians(35))
    x, y = seen.x_mm[seen.mask] - 20, seen.y_mm[seen.mask] + 30
    drawn = letter()
    column, row = (np.rint(place / 16.0 + 35).astype(int) for place in (c * x + s * y, c * y - s * x))
    told = 2 * drawn.heights_mm[np.clip(row, 0, 70), np.clip(column, 0, 70)]
    assert np.corrcoef(height, told)[0, 1] > 0.97
    assert height.std() == pytest.approx(told.std(), rel=0.03)


def test_a_map_stays_with_the_mount_when_the_mirror_turns():
    """Astigmatism of the mount goes with three turns of the mirror, that of the mirror stays."""
    scene = with_maps(small_scene(41), zernike_map(6))
    budget = Budget(sources={"map.1": 0.1, "zernike.6_um": 0.1}, mirror_turns=3)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)
    of_map, of_mirror = trials.heights_mm([(0, {"map.1": 0.1}), (0, {"zernike.6_um": 0.1})])
    assert of_mirror.std() * 1e6 == pytest.approx(100, rel=0.05)
    assert of_map.std() < 0.02 * of_mirror.std()


def test_names():
    design = design_with(LETTER, LETTER, pixels=31)
    scene = design.setup.scene
    assert [name for name in known_sources(scene, maps=design.maps) if name.startswith("map.")] == ["map.1", "map.2"]
    assert not any(name.startswith("map.") for name in known_sources(scene))
    for name in ("map.3", "map.0", "map.x"):
        with pytest.raises(SceneError, match=rf"^sphere: budget.sources.'{name}': unknown source; did you mean map"):
            source_of(name, scene, maps=design.maps)
