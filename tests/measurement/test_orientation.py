"""Orientation: every way to turn images and to exchange or reverse scans is named; right ones are left alone."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from lopsided import lopsided
from scenes import coarse

from irtscots_cl.measurement.orientation import IMAGES, best_orientation
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene, preset_names

UNDONE_BY = {  # what was done to the image: what undoes it. All but quarter turns undo themselves.
    name: name for name in IMAGES
} | {
    "the image turned by a quarter": "the image turned by a quarter the other way",
    "the image turned by a quarter the other way": "the image turned by a quarter",
}
CENTRES = [1.3, -7.3]


def design(rows: int = 21, columns: int = 21) -> list[np.ndarray]:
    """Maps of centroids x, y without any symmetry, with a rim and a hole off centre."""
    row, column = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    x = 3.0 + 2.0 * column + 0.7 * row + 0.5 * column**2 - 0.3 * row * column
    y = -8.0 + 0.4 * column - 1.5 * row + 0.6 * row**2 + 0.2 * column**2
    outside = ((row - 0.1) ** 2 + column**2 > 0.9) | (row**2 + (column + 0.2) ** 2 < 0.02)
    return [np.where(outside, np.nan, v) for v in (x, y)]


def recorded(maps, done: str, exchanged: bool, signs) -> list[np.ndarray]:
    """Centroids as measured in images and scans that were changed like this."""
    x, y = (centre + sign * (v - centre) for v, centre, sign in zip(maps, CENTRES, signs, strict=True))
    if exchanged:  # the scan that is called x was of y's lines
        x, y = (v - own + other for v, own, other in ((y, CENTRES[1], CENTRES[0]), (x, CENTRES[0], CENTRES[1])))
    return [IMAGES[done](v) for v in (x, y)]


@pytest.mark.parametrize("done", IMAGES)
@pytest.mark.parametrize("exchanged", [False, True])
def test_every_change_is_undone_by_what_is_named(done, exchanged):
    truth = design()
    for signs in itertools.product((1, -1), repeat=2):
        noise = np.random.default_rng(1).normal(0, 0.02, (2, 21, 21))
        measured = [v + n for v, n in zip(recorded(truth, done, exchanged, signs), noise, strict=True)]
        found = best_orientation(measured, truth, CENTRES)
        words = [UNDONE_BY[done]] if done else []
        words += ["the scans exchanged"] if exchanged else []
        words += [f"the {axis} scan reversed" for axis, sign in zip("xy", signs, strict=True) if sign < 0]
        if not words:
            assert found.names == () and not found.is_wrong
            assert found.misfit == found.best_misfit < 0.01
        else:
            assert found.is_wrong and " and ".join(words) in found.names, (done, exchanged, signs, found)
            assert found.best_misfit < 0.01 < found.misfit


def test_a_tilted_mirror_is_no_wrong_orientation():
    truth = design()
    found = best_orientation([truth[0] + 5.0, truth[1] - 3.0], truth, CENTRES)
    assert found.names == () and found.misfit < 1e-12


def test_images_that_are_not_square_are_not_turned_by_a_quarter():
    truth = design(21, 31)
    found = best_orientation([v[::-1] for v in truth], truth, CENTRES)
    assert found.is_wrong and found.names == ("the rows upside down",)


def test_a_symmetric_set_up_names_all_that_fit():
    """A sphere seen along its axis: turned images and reversed scans do the same."""
    row, column = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21), indexing="ij")
    truth = [column, row]
    found = best_orientation([-column, row], truth, [0.0, 0.0])
    assert found.is_wrong and set(found.names) == {"the columns mirrored", "the x scan reversed"}
    assert best_orientation(truth, truth, [0.0, 0.0]).names == ()


def test_what_a_symmetric_set_up_does_not_tell_is_listed():
    """As recorded or wrong: the other ways that fit as well, the simplest first; none without a symmetry."""
    row, column = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21), indexing="ij")
    right = best_orientation([column, row], [column, row], [0.0, 0.0])
    assert right.names == right.images == () and len(right.alike) == 7  # each image has its own scans
    assert "the rows upside down and the y scan reversed" in right.alike
    assert right.alike[0].count(" and the ") == 1  # rows and columns, and the scans, exchanged; or one of each reversed
    wrong = best_orientation([-column, row], [column, row], [0.0, 0.0])
    assert dict(zip(wrong.names, wrong.images, strict=True)) == {
        "the columns mirrored": "columns-reversed", "the x scan reversed": "upright",
    }  # fmt: skip
    assert len(wrong.alike) == 6 and not set(wrong.alike) & set(wrong.names)
    truth = design()
    assert best_orientation(truth, truth, CENTRES).alike == ()
    turned = best_orientation([v[::-1, ::-1] for v in truth], truth, CENTRES)
    assert (turned.images, turned.alike) == (("half-turn",), ())


@pytest.mark.parametrize("count", [0, 3])
def test_too_few_centroids_tell_nothing(count):
    truth = design()
    few = [np.full((21, 21), np.nan) for _ in "xy"]
    for one, other in zip(few, truth, strict=True):
        known = np.flatnonzero(np.isfinite(other))[:count]
        one.ravel()[known] = other.ravel()[known]
    found = best_orientation(few, truth, CENTRES)
    assert found.names == () and not found.is_wrong


def test_noise_alone_is_not_called_turned():
    truth = design()
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(0, 2.0, (2, 21, 21))
        assert not best_orientation([n + v * 0 for n, v in zip(noise, truth, strict=True)], truth, CENTRES).is_wrong


@pytest.mark.parametrize("name", [*preset_names(), "lopsided"])
def test_a_mirror_as_its_scene_has_it_is_not_called_wrong(name):
    """With the deviation that it has: centroids of the true mirror against those of the design."""
    scene = lopsided() if name == "lopsided" else coarse(load_scene(name), 25)
    measured, truth = (design_points(Setup(s))[2:] for s in (scene, scene.nominal()))
    assert np.isfinite(measured[0] + measured[1]).sum() > 100
    centres = list(scene.screen.centre_offset_mm)
    found = best_orientation(measured, truth, centres)
    assert not found.is_wrong, found
    # and a wrong one is, but where the design itself is symmetric
    upside_down = best_orientation([v[::-1] for v in measured], truth, centres)
    assert upside_down.is_wrong or upside_down.misfit < 1.5 * upside_down.best_misfit
