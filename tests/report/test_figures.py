"""The figures of a run: pictures, one map for each of what they are to show."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from outlined import outline_of
from scenes import with_part
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.report.figures import (
    draw_chord,
    height_figure,
    image_figure,
    light_curve_figure,
    parts_figure,
    write_figures,
)


@pytest.fixture(scope="module")
def run():
    """Stack, result and comparison of images without a device."""
    scene = small_scene(pixels=21)
    stack = with_replicates(noise_free_stack(scene), 3, 0.01)
    result = reconstruct(stack, scene.nominal())
    return stack, result, compare(result, scene)


@pytest.mark.parametrize("separated", [True, False])
def test_the_figures_are_pictures(run, tmp_path, separated):
    """With the parts of the error where they were separated; with and without the truth."""
    stack, result, comparison = run
    parts = (ErrorTerm("ray noise", (0.0, 0.0), 1.0, result.height_mm),) if separated else ()
    names = write_figures(tmp_path, stack, result, comparison if separated else None, parts)
    assert names == ["images.png", "light_curve.png", "slopes.png", "height.png"] + ["error_parts.png"] * separated
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert all((tmp_path / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for name in names)


def test_maps_show_the_edge_of_a_mirror_that_is_no_disk():
    """An L: the edge lies along the measured pixels, its foot towards +x at the lowest y."""
    scene = small_scene(pixels=21)
    scene = with_part(scene, "mirror", outline=outline_of("ell", scene.mirror.diameter_mm))
    result = reconstruct(noise_free_stack(scene), scene.nominal())
    axes = height_figure(result, None).axes[0]
    (edge,) = [line.get_xydata() for line in axes.lines if line.get_gid() == "edge"]
    radius = scene.mirror.diameter_mm / 2
    assert edge[edge[:, 1] < -0.4 * radius, 0].max() == pytest.approx(0.45 * radius, abs=0.02 * radius)
    assert edge[edge[:, 1] > 0.4 * radius, 0].max() == pytest.approx(-0.15 * radius, abs=0.02 * radius)
    surface = result.setup.chief_rays.surface
    x, y = result.x_mm[result.mask], result.y_mm[result.mask]
    assert surface.contains(x, y).all()
    shape = result.mask.shape
    low, high = result.mask[: shape[0] // 2], result.mask[shape[0] // 2 :]
    assert low[:, shape[1] // 2 + 2 :].any() and not high[:, shape[1] // 2 + 2 :].any()


def maps_of(figure):
    return [axes.images[0] for axes in figure.axes if axes.images]


def test_images_are_those_of_the_named_lines(run):
    """Row 0 is at the bottom, as one looks at the mirror."""
    stack = run[0]
    pictures = maps_of(image_figure(stack))
    expected = []
    for scan in (stack.x, stack.y):
        sums = np.array([scan.image(k).sum() for k in range(len(scan.positions_mm))])
        lit = np.flatnonzero(sums > 0.01 * sums.max())
        assert len(lit) < len(sums)  # lines beside the mirror's light would show a dark detector
        expected += [scan.image(lit[len(lit) // part]) for part in (3, 2)]
    for picture, image in zip(pictures, expected, strict=True):
        np.testing.assert_array_equal(picture.get_array(), image)
        assert picture.origin == "lower"


def test_the_light_curves_are_of_the_middle_pixel_with_its_centroids(run):
    stack, result, _ = run
    for axes, scan, centroid in zip(
        light_curve_figure(stack, result).axes,
        (stack.x, stack.y),
        (result.centroid_x_mm, result.centroid_y_mm),
        strict=True,
    ):
        assert "pixel [10, 10]" in axes.get_title()
        marked = next(line for line in axes.lines if line.get_label().startswith("centroid"))
        assert marked.get_xdata()[0] == centroid[10, 10]
        curve = axes.containers[0].lines[0].get_ydata()
        np.testing.assert_array_equal(curve, scan.mean_w()[np.flatnonzero(scan.pixels == 10 * 21 + 10)[0]])


def dotted(axes):
    return [line for line in axes.lines if "unit magnification" in str(line.get_label())]


def test_light_curves_show_all_lines_with_light(run):
    """Near the centre of curvature with the aperture's chord."""
    stack, result, _ = run
    for axes in light_curve_figure(stack, result).axes:
        low, high = axes.get_xlim()
        curve = axes.containers[0].lines[0]
        lit = curve.get_xdata()[curve.get_ydata() > 0.1 * curve.get_ydata().max()]
        assert len(lit) > 2 and low < lit.min() and lit.max() < high
        assert len(dotted(axes)) == 1


def test_light_that_is_much_wider_than_the_aperture_is_shown_without_its_chord(run):
    axes = Figure().subplots()
    lines = np.arange(-20.0, 21.0)
    draw_chord(axes, run[0].x, lines, np.maximum(0.0, 1 - (lines / 10) ** 2), 0.0, 1.0)
    assert axes.get_xlim()[0] < -9.0 and axes.get_xlim()[1] > 9.0
    assert not dotted(axes)


def test_a_light_curve_with_missing_samples_is_drawn(run):
    stack = run[0]
    lines = np.arange(5.0)
    axes = Figure().subplots()
    draw_chord(axes, stack.x, lines, np.array([0.0, 1.0, np.nan, 1.0, 0.0]), 2.0, 1.0)
    assert axes.get_xlim()[0] < 1.0 and axes.get_xlim()[1] > 3.0
    draw_chord(axes, stack.x, lines, np.zeros(5), 2.0, 1.0)  # no light


def test_the_error_is_drawn_where_the_truth_is_known_in_nm_and_from_zero(run):
    _, result, comparison = run
    assert len(maps_of(height_figure(result, None))) == 2
    *_, error = maps_of(height_figure(result, comparison))
    rows, columns = np.nonzero(result.mask)
    cut = comparison.error_mm[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] * 1e6
    np.testing.assert_array_equal(np.ma.filled(error.get_array(), np.nan), cut)
    low, high = error.get_clim()
    assert low == -high < 0


def test_every_part_of_the_error_has_a_map_of_its_own(run):
    _, result, _ = run
    parts = [ErrorTerm(f"part {k}", (0.0, 0.0), float(k), np.where(result.mask, k * 1e-6, np.nan)) for k in range(5)]
    figure = parts_figure(result, parts)
    maps = maps_of(figure)
    assert [np.nanmax(np.ma.filled(one.get_array(), np.nan)) for one in maps] == [0.0, 1.0, 2.0, 3.0, 4.0]  # nm
    titles = [axes.get_title() for axes in figure.axes if axes.images]
    assert titles[3] == "part 3:\n3 nm rms"
