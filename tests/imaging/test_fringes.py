"""Fringe patterns and their stacks: values, conventions, what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from irtscots_cl.imaging.fringes import FringeScan, FringeSet, FringeStack, equal_steps
from irtscots_cl.scene.presets import load_scene


def test_values_are_cosines_of_the_fraction():
    fringes = FringeSet("x", (0.9, 4.0), (equal_steps(4), (0.0, 1.0, 2.5)))
    fraction = np.array([0.0, 0.3, 1.0])
    values = fringes.values(fraction)
    assert fringes.count == 7 and values.shape == (7, 3)
    np.testing.assert_allclose(values[1], 0.5 + 0.5 * np.cos(2 * np.pi * 0.9 * fraction - np.pi / 2))
    np.testing.assert_allclose(values[6], 0.5 + 0.5 * np.cos(2 * np.pi * 4 * fraction - 2.5))


def test_reversed_fringes_grow_the_other_way():
    there, back = (FringeSet.equal("y", (2.9,), 4, reverse=reverse) for reverse in (False, True))
    fraction = np.linspace(0, 1, 11)
    np.testing.assert_allclose(back.values(fraction), there.values(1 - fraction))


def test_fractions_of_pixels_at_the_edges_and_at_the_centres():
    edges, centres = (FringeSet.equal("x", (1.0,), ends=ends) for ends in ("edges", "centres"))
    np.testing.assert_allclose(edges.pixel_fractions(4), [1 / 8, 3 / 8, 5 / 8, 7 / 8])
    np.testing.assert_allclose(centres.pixel_fractions(4), [0, 1 / 3, 2 / 3, 1])
    for fringes in (edges, centres):  # the same places, in either convention
        own = fringes.pixel_fractions(4)
        np.testing.assert_allclose(fringes.edge_fraction(own, 4), [1 / 8, 3 / 8, 5 / 8, 7 / 8])
        np.testing.assert_allclose(fringes.position_mm(own, 4, 0.2, 1.0), [0.7, 0.9, 1.1, 1.3])


def test_a_screen_s_gamma_and_grey_levels():
    scene = load_scene("sphere")
    fringes = FringeSet.equal("x", (3.0,), 5)
    plain = FringeScan(scene, (fringes,)).radiance(fringes)
    assert plain.shape == (5, 21) and plain.min() >= 0 and plain.max() <= 1
    np.testing.assert_allclose(FringeScan(scene, (fringes,), gamma=2.2).radiance(fringes), plain**2.2)
    coarse = FringeScan(scene, (fringes,), levels=3).radiance(fringes)
    assert set(np.unique(coarse)) <= {0.0, 1 / 3, 2 / 3, 1.0} and np.abs(coarse - plain).max() <= 1 / 6 + 1e-12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axis": "z"}, 'axis = \'z\': must be "x" or "y"'),
        ({"ends": "middle"}, 'must be "edges" or "centres"'),
        ({"periods": ()}, r"periods = \[\]: must be numbers above 0"),
        ({"periods": (0.0,)}, r"periods = \[0.0\]: must be numbers above 0"),
        ({"periods": (math.nan,)}, "must be numbers above 0"),
        ({"periods": (1.0, 2.0)}, "1 series of steps for 2 numbers of periods"),
        ({"steps_rad": ((0.0, 1.0),)}, "2 steps; must be 3 to 64 finite numbers"),
        ({"steps_rad": (equal_steps(65),)}, "65 steps; must be 3 to 64 finite numbers"),
        ({"steps_rad": ((0.0, 1.0, math.inf),)}, "must be 3 to 64 finite numbers"),
        ({"steps_rad": ((0.0, math.pi, 2 * math.pi),)}, "at least three must differ, modulo 2 pi"),
    ],
)
def test_fringes_that_cannot_be_are_refused(change, message):
    parts = {"axis": "x", "periods": (1.0,), "steps_rad": (equal_steps(4),), "reverse": False, "ends": "edges"}
    with pytest.raises(ValueError, match=message):
        FringeSet(**(parts | change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sets": ()}, "no set of fringes"),
        ({"gamma": 0.0}, "gamma = 0.0: must be above 0"),
        ({"levels": 2**16}, "levels = 65536: must be"),
    ],
)
def test_scans_that_cannot_be_are_refused(change, message):
    parts = {"sets": (FringeSet.equal("x", (1.0,)),)}
    with pytest.raises(ValueError, match=message):
        FringeScan(load_scene("sphere"), **(parts | change))


def test_series_come_in_order_from_arrays_and_from_single_frames():
    sets = (FringeSet("y", (0.9, 4.0), (equal_steps(3), equal_steps(4))), FringeSet.equal("x", (0.9,), 5))
    images = np.arange(12 * 6).reshape(12, 2, 3)
    for frames in (images, list(images)):
        stack = FringeStack(sets, frames)
        assert stack.shape == (2, 3)
        parts = [part for number in (0, 1) for part in stack.series(number)]
        assert [(p, len(s)) for p, s, _ in parts] == [(0.9, 3), (4.0, 4), (0.9, 5)]
        np.testing.assert_array_equal(np.concatenate([image for _, _, image in parts]), images)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": np.zeros((7, 2, 3))}, r"7 fringe images; the fringes need 8 \(x: 4 \+ 4\)"),
        ({"frames": np.zeros((8, 6))}, r"fringe images have shape \(6,\); must be \[rows, columns\]"),
        ({"frames": np.zeros((8, 0, 3))}, r"shape \(0, 3\)"),
        ({"dark": np.zeros((3, 2))}, r"the dark image has shape \(3, 2\), the fringe images \(2, 3\)"),
        ({"saturation": 0.0}, "saturation = 0.0: must be above 0"),
        ({"sets": (FringeSet.equal("x", (1.0,)),) * 2}, "must be one set for each axis"),
    ],
)
def test_stacks_that_do_not_fit_their_fringes_are_refused(change, message):
    parts = {"sets": (FringeSet.equal("x", (0.9, 4.0)),), "frames": np.zeros((8, 2, 3))}
    with pytest.raises(ValueError, match=message):
        FringeStack(**(parts | change))


def test_a_single_frame_of_another_shape_is_named():
    frames = [np.zeros((2, 3))] * 3 + [np.zeros((3, 2))]
    with pytest.raises(ValueError, match=r"fringe image 3 has shape \(3, 2\), the first one \(2, 3\)"):
        list(FringeStack((FringeSet.equal("x", (1.0,)),), frames).series(0))


class Counted(list):
    """Frames that count how often they are read."""

    read = 0

    def __getitem__(self, number):
        self.read += 1
        return super().__getitem__(number)


def test_samples_and_lines_are_those_of_the_series():
    sets = (FringeSet.equal("x", (1.0, 3.0), 4), FringeSet.equal("y", (2.0,), 3))
    images = np.random.default_rng(1).integers(0, 255, (11, 5, 6)).astype(np.uint8)
    frames = Counted(images)
    stack, pixels = FringeStack(sets, frames), np.array([3, 17, 29])
    for number in (0, 1):
        for which, ((periods, steps, whole), (p, s, some)) in enumerate(
            zip(stack.series(number), stack.samples(number, pixels), strict=True)
        ):
            assert (periods, steps) == (p, s) and some.dtype == np.uint8
            np.testing.assert_array_equal(some, whole.reshape(len(steps), -1)[:, pixels])
            np.testing.assert_array_equal(np.stack(stack.lines(number, which)), whole.reshape(len(steps), -1))
    before = frames.read
    assert stack.shape == (5, 6) and frames.read == before  # asked for once
    stack.lines(1, 0)
    assert frames.read == before + 3
    frames[10] = np.zeros((2, 2))
    with pytest.raises(ValueError, match=r"fringe image 10 has shape \(2, 2\), the first one \(5, 6\)"):
        list(stack.samples(1, pixels))
