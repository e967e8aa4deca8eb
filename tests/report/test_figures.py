"""The figures of a run: pictures, one map for each of what they are to show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from outlined import outline_of
from scenes import with_part
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.report.fiducial import MapFrame
from irtscots_cl.report.figures import (
    draw_chord,
    height_figure,
    image_figure,
    light_curve_figure,
    parts_figure,
    shown_lines,
    slope_figure,
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
    """Row 0 is at the bottom, as one looks at the mirror; all on one scale, in units that read well."""
    stack, result, _ = run
    figure = image_figure(stack, MapFrame.of(result.x_mm, result.y_mm, result.mask))
    pictures = maps_of(figure)
    expected = []
    for scan in (stack.x, stack.y):
        sums = np.array([scan.image(k).sum() for k in range(len(scan.positions_mm))])
        lit = np.flatnonzero(sums > 0.1 * sums.max())
        assert len(lit) < len(sums)  # lines beside the mirror's light would show a dark detector
        expected += [scan.image(lit[len(lit) // part]) for part in (3, 2)]
    largest = max(image.max() for image in expected)
    for picture, image in zip(pictures, expected, strict=True):
        np.testing.assert_allclose(picture.get_array(), image * 1e3, rtol=1e-12)  # floats: of the factor
        assert picture.origin == "lower" and picture.get_clim() == (0.0, pytest.approx(1e3 * largest))
    assert [axes.get_ylabel() for axes in figure.axes[4:]] == ["flux [mW]"] * 4


def test_lines_of_a_large_screen_with_an_offset_are_lit_ones(run):
    """Of 400 lines ten light the mirror, and a camera adds 100 counts to all pixels of all frames."""
    rows, lit = 8, np.arange(250, 260)
    images = np.full((400, rows, rows), 100.0)
    images[lit, :, 3] += 50.0
    scan = replace(Scan.from_images("x", np.arange(400.0), images), unit="DN")
    assert all(line in lit for line in shown_lines(scan))
    figure = image_figure(ImageStack(scan, replace(scan, axis="y")))
    assert all(one.get_array().max() == 150.0 for one in maps_of(figure))
    assert {axes.get_ylabel() for axes in figure.axes[4:]} == {"signal [DN]"}


def test_a_line_as_thin_as_a_pixel_is_shown_in_full_brightness(run):
    images = np.zeros((4, 1500, 1500), np.float32)
    images[1:3, :, 701] = 7.0
    scan = Scan.from_images("x", np.arange(4.0), images)
    shown = maps_of(image_figure(ImageStack(scan, replace(scan, axis="y"))))[0]
    assert shown.get_array().shape == (375, 375) and (shown.get_array().max(axis=1) == 7.0).all()
    assert shown.get_extent() == [-0.5, 1499.5, -0.5, 1499.5]


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
    assert titles[3] == "part 3\nrms 3.00 nm, PV 0 nm"
    assert len({one.get_clim() for one in maps}) == 1


def test_small_parts_of_the_error_are_shown_magnified_and_say_so(run):
    _, result, _ = run
    tilt = np.where(result.mask, result.x_mm / np.nanmax(result.x_mm), np.nan) * 1e-6
    parts = [ErrorTerm(name, (0.0, 0.0), 1.0, tilt * size) for name, size in (("large", 1.0), ("small", 0.003))]
    large, small = (axes for axes in parts_figure(result, parts).axes if axes.images)
    assert np.nanmax(small.images[0].get_array()) == pytest.approx(0.3 * np.nanmax(large.images[0].get_array()))
    assert "shown \N{MULTIPLICATION SIGN} 100" in [text.get_text() for text in small.texts]
    assert not any("shown" in text.get_text() for text in large.texts)


def test_slopes_are_those_from_the_design_on_one_scale(run):
    """The sphere's own, tens of mrad, would hide them."""
    _, result, _ = run
    x, y = maps_of(slope_figure(result))
    assert x.get_clim() == y.get_clim() and x.get_clim()[1] < 100  # urad
    sag = np.hypot(result.x_mm, result.y_mm)
    assert np.nanmax(np.abs(x.get_array())) < 0.01 * 1e6 * np.nanmax(sag) / result.nominal.mirror.radius_mm


def test_maps_have_millimetres_and_pixels(run):
    """The middle of the detector at the mirror's vertex, on both axes of both sides."""
    _, result, _ = run
    for axes in height_figure(result, None).axes[:2]:
        assert axes.get_xlabel() == "mirror x [mm]"
        top, right = axes.child_axes
        assert (top.get_xlabel(), right.get_ylabel()) == ("detector column", "detector row")
        axes.figure.draw_without_rendering()
        frame = MapFrame.of(result.x_mm, result.y_mm, result.mask)
        assert top.get_xlim() == pytest.approx((frame.cut[1].start - 0.5, frame.cut[1].stop - 0.5))
        assert right.get_ylim() == pytest.approx((frame.cut[0].start - 0.5, frame.cut[0].stop - 0.5))
