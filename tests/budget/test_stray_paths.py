"""Error sources: ghosts and scattered light of a file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loaded_modules import loaded_modules
from small_budget import small_scene
from stray_files import made_maps, write_made

from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.procedure import Procedure
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.sources import known_sources, source_of
from irtscots_cl.budget.stray_paths import SOURCES, ray_noise, without_value
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import SceneError

NO_DRAW = Draw(0, 0)
GHOSTS, SCATTER = SOURCES["stray.ghosts"], SOURCES["stray.scatter"]


@pytest.fixture(scope="module")
def scene():
    return small_scene(31)


@pytest.fixture
def designed(tmp_path, scene):
    """The design with made maps of these kinds."""

    def made(budget=None, **kinds):
        path = tmp_path / "stray-light.h5"
        write_made(path, scene, **kinds)
        budget = replace(budget or Budget(), stray_light=str(path))
        return MeasuredDesign.of_budget(Setup(scene), budget), budget

    return made


def test_places_are_those_of_the_pixels_times_the_factor(scene, designed):
    """Of light r s over r: the centroid with it less that without, where a factor f is on the light."""
    maps, factor = made_maps(scene), 40.0
    design, _ = designed(ghost=maps)
    for one in (design, design.coarse(16)):
        row, column = (values.astype(int) for values in one.seen.pixels)
        change, share = maps.change_mm[0][:, row, column], maps.of_direct[row, column]
        place = change * (1 + share) / share  # of the stray light, from the direct light's centroid
        expected = factor * share * place / (1 + factor * share)
        assert np.abs(GHOSTS.changes_mm(one, factor, NO_DRAW) - expected).max() < 1e-15
        assert np.abs(GHOSTS.changes_mm(one, 1.0, Draw(3, 4)) - change).max() < 1e-15
    assert design.coarse(16).count < design.count / 3


def test_pixels_without_a_value_get_the_nearest_ones(scene, designed):
    maps = made_maps(scene)
    maps.change_mm[2, 0, 15, 15] = maps.of_direct[10, 12] = np.nan
    maps.change_mm[:, :, 0, 0] = np.nan  # a corner, which sees no mirror
    design, _ = designed(scatter=maps)
    assert without_value(design, "scatter") == 2
    found = design.seen.on_grid(SCATTER.changes_mm(design, 1.0, NO_DRAW))
    for row, column in ((15, 15), (10, 12)):
        own = [np.array_equal(found[:, row, column], maps.change_mm[0, :, row + a, column + b])
               for a, b in ((0, 1), (0, -1), (1, 0), (-1, 0))]  # fmt: skip
        assert sum(own) == 1


def test_noise_of_rays_is_that_of_as_many_rays(scene, designed):
    """Replicates with white noise: what the jackknife says is the height of the noise of their mean."""
    maps, random, sigma, count = made_maps(scene), np.random.default_rng(5), 1e-4, 12
    noise = sigma * random.standard_normal((count, *maps.change_mm.shape[1:]))
    left_out = (noise.sum(0) - noise) / (count - 1)
    design, _ = designed(ghost=replace(maps, change_mm=maps.change_mm[0] + np.stack([noise.mean(0), *left_out])))
    draws = sigma / count**0.5 * random.standard_normal((64, 2, design.count))
    expected = np.sqrt(np.mean(design.response.left(design.response.heights_mm(draws)) ** 2, axis=0)) * 1e6
    found = ray_noise(Procedure(design), GHOSTS, 1.0)
    assert found.nm == pytest.approx(expected, rel=0.2) and found.name == "stray.ghosts"
    assert ray_noise(Procedure(design), GHOSTS, 0.5).nm == pytest.approx(found.nm / 2, rel=1e-3)
    fitted = ray_noise(Procedure(design, ("screen.z_mm",)), GHOSTS, 1.0).nm
    assert fitted[0] < (1 - 1e-3) * found.nm[0]


def test_one_replicate_has_no_noise(scene, designed):
    maps = made_maps(scene)
    design, _ = designed(ghost=replace(maps, change_mm=maps.change_mm[:2]))
    assert np.isnan(ray_noise(Procedure(design), GHOSTS, 1.0).nm).all()


def test_it_is_the_same_in_all_trials(scene, designed):
    budget = Budget(sources={"stray.ghosts": 1.0, "stray.scatter": 2.0}, trials=4, exposures=5)
    _, budget = designed(budget, ghost=made_maps(scene), scatter=made_maps(scene, seed=2))
    found = assess_budget(scene, budget)
    rms = found.monte_carlo.rms_nm[:, 0]
    assert rms == pytest.approx(np.full(4, rms[0]), rel=1e-12)
    alone = [found.linear.nm[name][0] for name in ("stray.ghosts", "stray.scatter")]
    assert alone[1] == pytest.approx(2 * alone[0], rel=2e-3)  # not in proportion: the light counts in the mean, too
    assert rms[0] == pytest.approx(sum(alone), rel=3e-3) and [one.name for one in found.ray_noise] == list(SOURCES)


def test_sources_are_listed_where_there_is_a_file(scene, designed):
    design, budget = designed(ghost=made_maps(scene))
    known = assess_budget(scene, budget)
    assert "stray.ghosts" in known.sensitivities and "stray.scatter" not in known.sensitivities
    assert [one.name for one in known.ray_noise] == ["stray.ghosts"] and known.linear is None
    assert not known_sources(scene).keys() & SOURCES.keys()
    with pytest.raises(SceneError, match=r"'stray.ghosts': needs budget.stray_light: the file stray-light.h5 that "
                       "`irtscots paths SCENE --out DIR` writes$"):  # fmt: skip
        source_of("stray.ghosts", scene)
    with pytest.raises(SceneError, match="'stray.scatter': must be left out: the file of budget.stray_light has g"):
        source_of("stray.scatter", scene, design.stray)
    with pytest.raises(SceneError, match="did you mean stray.ghosts"):
        source_of("stray.ghost", scene)


def test_files_that_do_not_fit_are_refused_in_one_line(scene, designed, tmp_path):
    with pytest.raises(SceneError, match=r"^sphere: budget.stray_light: must be left out with budget.periods: [^\n]*$"):
        designed(Budget(periods=(8.0,)), ghost=made_maps(scene))
    budget = Budget(stray_light=str(tmp_path / "none.h5"))
    with pytest.raises(SceneError, match=r"^sphere: budget.stray_light: /[^\n]*none.h5: [^\n]*no file of that name$"):
        MeasuredDesign.of_budget(Setup(scene), budget)
    maps = made_maps(scene)
    maps.change_mm[0, :, :8] = np.nan
    with pytest.raises(SceneError, match=r"ghost: \d+ of the design's \d+ pixels have no value; at most a tenth may: "):
        designed(ghost=maps)


def test_budgets_without_a_file_import_no_reader():
    code = (
        "from irtscots_cl.budget.trials import Trials; from irtscots_cl.budget.measured_design import MeasuredDesign; "
        "import irtscots_cl.report.budget; from irtscots_cl.budget.sources import known_sources; "
        "from irtscots_cl.scene.error_sources import Budget; from irtscots_cl.scene.presets import load_scene; "
        "from irtscots_cl.optics.setup import Setup; scene = load_scene('sphere'); known_sources(scene); "
        "budget = Budget(sources={'noise.place_mm': 1e-3}); "
        "Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget).heights_mm([(0, None)])"
    )
    loaded = loaded_modules(code)
    assert "irtscots_cl.budget.trials" in loaded
    assert not {"h5py", "irtscots_cl.budget.stray_paths", "irtscots_cl.imaging.stray_files"} & loaded
