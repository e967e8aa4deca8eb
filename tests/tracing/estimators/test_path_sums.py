"""A non-sequential trace without a device: what its kernel needs, and what its sums say. Sums are made by hand."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, coarse_screen

from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.estimators import nonsequential as module
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.estimators.path_sums import (
    ENDS,
    LOSS_ONE,
    SCALE_BITS,
    TRACKED_PATHS,
    TrackedPaths,
)
from irtscots_cl.tracing.options import TraceOptions

OPTIONS = TraceOptions("nonsequential", bounce_limit=8)
RAYS = np.array([100, 300])
DIRECT, GHOST = 0b000001_001010, 0b000001_001110_001010  # mirror, detector; a face that reflects


@pytest.fixture(scope="module")
def work():
    scene = coarse_screen(coarse("sphere-window", 5))
    return PathTask(Setup(scene), OPTIONS)


def test_weights_become_whole_numbers_of_at_most_the_bits_there_are():
    tracked = TrackedPaths((DIRECT, GHOST), (0.3, 1e-4))
    table = tracked.table()
    for entry, weight in zip(table, tracked.weights, strict=False):
        scaled = float(entry["scale"]) * weight
        assert 2 ** (SCALE_BITS - 1) < scaled <= 2**SCALE_BITS
        assert np.log2(entry["scale"]) % 1 == 0
    assert [sum(int(word) << 32 * k for k, word in enumerate(e["word"])) for e in table] == [DIRECT, GHOST, 0]
    assert table["kind"].tolist() == [0, 1, 1]  # all others count as ghosts
    np.testing.assert_array_equal(table["class_scale"], [table["scale"][0], table["scale"][1], table["scale"][1]])


def test_the_images_of_a_kind_share_the_scale_of_its_largest_weight():
    one, two = 0b000001_001010, 0b000001_001101  # both direct
    of_kind = TrackedPaths((one, two), (0.01, 0.4)).of_kind
    assert of_kind[0] == TrackedPaths((two,), (0.4,)).of_kind[0] and (of_kind[1:] == 2.0**SCALE_BITS).all()


def sums_of(work, ends, losses=(), paths=()):
    """[1, ...] of one replicate. ends: counts; losses: in rays; paths: (rays, weight in whole numbers)."""
    sums = np.zeros(work.sums_shapes[0], np.int64)
    sums[: len(ends)] = ends
    first = len(ENDS) + len(work.components)
    sums[first : first + len(losses)] = np.array(losses) * LOSS_ONE
    for place, (rays, weight) in paths:
        at = len(sums) - 2 * TRACKED_PATHS + 2 * place
        sums[at : at + 2] = rays, weight
    return sums


def test_a_faint_paths_scale_is_a_number():
    """Its weight to be a whole number would take more than single precision has."""
    table = TrackedPaths((DIRECT, GHOST), (0.3, 1e-40)).table()
    assert np.isfinite(table["scale"]).all() and np.isfinite(table["class_scale"]).all()


def test_ends_add_up_to_what_was_launched_and_parted(work):
    absorbed = [0] * len(work.components)
    absorbed[1] = 4
    launched = 7 + 2 + 1 + 0 + 4 - 3
    ends = work.light.ends(np.stack([sums_of(work, [7, 2, 1, 0, 3, *absorbed])]), launched)
    assert ends["launched"] == launched and ends["parted"] == 3 and ends["detected"] == 7
    assert ends[f"absorbed by {work.components[1].name}"] == 4
    with pytest.raises(AssertionError, match="rays launched and parted"):
        work.light.ends(np.stack([sums_of(work, [7, 2, 1, 0, 3, *absorbed])]), launched + 1)


def test_a_paths_flux_is_its_weight_in_rays_of_all_and_its_error_the_replicates_scatter(work):
    tracking = replace(work, tracked=TrackedPaths((DIRECT, GHOST), (0.5, 1.0)))
    assert work.tracked.codes == ()  # the original keeps its own
    scale = tracking.tracked.table()["scale"]
    sums = np.stack([
        sums_of(work, [], paths=[(0, (3, 6 * scale[0])), (1, (5, 80 * scale[1])), (2, (1, 2 * scale[2]))]),
        sums_of(work, [], paths=[(0, (4, 30 * scale[0])), (1, (6, 240 * scale[1]))]),
    ])  # fmt: skip
    ghost, direct, other = tracking.light.fluxes(sums, RAYS)  # by power
    assert direct.name == "screen > mirror > detector" and direct.kind == "direct" and direct.rays == 7
    assert (ghost.kind, ghost.rays) == ("ghost", 11) and (other.name, other.rays) == ("other", 1)
    each = np.array([6 / 100, 30 / 300]) * work.light.unit_w
    assert direct.flux_w == pytest.approx(36 / 400 * work.light.unit_w, rel=1e-12)
    assert direct.standard_error_w == pytest.approx(abs(each[1] - each[0]) / 2, rel=1e-12)
    assert ghost.standard_error_w == pytest.approx(0, abs=1e-12 * ghost.flux_w)


def test_light_that_is_lost_is_named_by_where_it_stays(work):
    losses = np.arange(len(work.components) + 2) + 1.0
    found = work.light.losses(np.stack([sums_of(work, [], losses)]), np.array([100]))
    assert [loss.name for loss in found[-2:]] == ["escaped", "bounce limit"]
    np.testing.assert_allclose([loss.flux_w for loss in found], losses * work.light.unit_w / 100, rtol=1e-12)
    assert np.isnan(found[0].standard_error_w)  # one replicate


def test_a_trace_travels_as_text(work):
    tracking = replace(work, tracked=TrackedPaths((GHOST, DIRECT), (0.25, 0.1)))
    again = PathTask.from_json(tracking.to_json())
    assert (again.setup.scene, again.options, again.tracked) == (work.setup.scene, work.options, tracking.tracked)
    assert again.sums_shapes == work.sums_shapes and again.light.unit_w == work.light.unit_w
    np.testing.assert_array_equal(again.source_structs, work.source_structs)
    assert pickle.loads(pickle.dumps(tracking)).to_json() == tracking.to_json()


def test_images_that_are_too_large_are_refused(work, monkeypatch):
    size = 8 * 3 * (7 + 7) * 5 * 5
    monkeypatch.setattr(module, "MAX_IMAGE_BYTES", size)
    PathTask(work.setup, work.options)
    monkeypatch.setattr(module, "MAX_IMAGE_BYTES", size - 1)
    with pytest.raises(ValueError, match=f"images of 14 lines with 25 pixels take {size} bytes"):
        PathTask(work.setup, work.options)


def test_the_flux_of_all_rays_is_the_screens(work):
    """Each screen pixel sends out radiance x its area x the projected solid angle of its aim."""
    aim = work.source_structs
    areas = np.array(aim["aim_ll"]) * np.array(aim["aim_mm"])
    assert len(areas) == work.sources == 49
    assert work.launched_w == pytest.approx(np.pi * 49 * 0.6**2, rel=1e-12)  # radiance 1
    assert work.light.unit_w * areas.sum() / areas.max() == pytest.approx(work.traced_w, rel=1e-6)  # float32
    assert 0 < work.traced_w < 0.1 * work.launched_w
