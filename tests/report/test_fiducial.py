"""The mark on every map: where the mirror's +x is, seen from the camera."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from scenes import coarse, with_part

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.report.fiducial import WORDS, MapFrame, mark_x, x_direction
from irtscots_cl.report.figures import height_figure, image_figure, parts_figure, slope_figure
from irtscots_cl.studies.drawing import maps
from irtscots_cl.tracing.trace import trace


def marks_of(axes) -> list:
    return [text for text in axes.texts if text.get_gid() == "fiducial"]


def direction_of(axes) -> np.ndarray:
    """Unit vector (right, up) of the arrow on the page."""
    (arrow,) = marks_of(axes)
    along = np.subtract(arrow.xy, arrow.xyann)
    return along / np.linalg.norm(along)


def measured(**camera):
    scene = with_part(coarse("sphere-deviated", 21), "camera", **camera)
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    return scene, stack, measure_by("paper", stack, scene.nominal())


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 180.0, -120.0])
def test_the_direction_of_x_on_a_turned_and_stretched_grid(degrees):
    angle = np.radians(degrees)
    row, column = np.meshgrid(np.arange(20.0), np.arange(30.0), indexing="ij")
    x = 5 * (np.cos(angle) * column - np.sin(angle) * row) + 100
    y = 5 * (np.sin(angle) * column + np.cos(angle) * row) - 3
    x[3:7, 4:9] = np.nan
    assert x_direction(x, y) == pytest.approx((np.cos(angle), -np.sin(angle)), abs=1e-9)


def test_too_few_pixels_tell_no_direction():
    x = np.full((4, 4), np.nan)
    x[0, :3] = 1.0
    assert x_direction(x, x) == (1.0, 0.0)


@pytest.mark.parametrize("roll", [0.0, 50.0, -90.0])
def test_every_map_of_a_run_has_an_arrow_to_x_and_the_words(roll):
    """A camera that rolls by r from x towards y sees the mirror's +x turned by -r."""
    scene, stack, result = measured(roll_deg=roll)
    comparison = compare(result, scene)
    part = ErrorTerm("ray noise", (0.0, 0.0), 1.0, result.deviation_mm)
    towards = np.array([np.cos(np.radians(roll)), -np.sin(np.radians(roll))])
    frame = MapFrame.of(result.x_mm, result.y_mm, result.mask)
    figures = [image_figure(stack, frame), slope_figure(result), height_figure(result, comparison),
               height_figure(result, None), parts_figure(result, (part,))]  # fmt: skip
    for figure in figures:
        shown = [axes for axes in figure.axes if axes.images]
        assert shown
        for axes in shown:
            np.testing.assert_allclose(direction_of(axes), towards, atol=0.02)
            assert WORDS in [text.get_text() for text in axes.texts]
            assert "+x" in [text.get_text() for text in axes.texts]
    labels = {axes.get_xlabel() for axes in figures[2].axes if axes.images}
    assert labels == ({"mirror x [mm]"} if roll == 0.0 else {"detector column"})


def test_a_map_ends_with_the_edges_of_its_pixels_on_the_line_of_all_places():
    row, column = np.meshgrid(np.arange(6.0), np.arange(9.0), indexing="ij")
    mask = np.zeros((6, 9), bool)
    mask[1:5, 2:8] = True
    assert MapFrame.of(4 * column - 20, 3 * row - 7, mask).extent == pytest.approx((-14.0, 10.0, -5.5, 6.5))
    assert MapFrame.of(4 * column - 20, 3 * row - 7, mask & (row == 2)).extent[:2] == pytest.approx((-14.0, 10.0))


def test_a_map_that_is_seen_at_a_slant_is_labelled_with_the_detectors_columns():
    row, column = np.meshgrid(np.arange(100.0), np.arange(100.0), indexing="ij")
    mask = np.ones(row.shape, bool)
    labels = []
    for slant in (3e-4, 3e-3):
        x, y = (1000 * (c / 100 - 0.5) / (1 + slant * column) for c in (column, row))
        labels.append(MapFrame.of(x, y, mask).x_label)
    assert labels == ["mirror x [mm]", "detector column"]


def test_maps_of_the_studies_are_marked_but_not_those_of_the_screen():
    figure = maps([("a", np.eye(3)), ("b", np.eye(3))], "nm", of_detector=[False, True])
    assert [len(marks_of(axes)) for axes in figure.axes[:2]] == [0, 1]
    for axes in maps([("a", np.eye(3)), ("b", np.eye(3))], "nm").axes[:2]:
        np.testing.assert_allclose(direction_of(axes), (1.0, 0.0))


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_the_mark_stays_inside_the_map(degrees):
    figure = Figure(figsize=(4, 4))
    axes = figure.subplots()
    axes.imshow(np.eye(5), origin="lower")
    mark_x(axes, (np.cos(np.radians(degrees)), np.sin(np.radians(degrees))))
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    for text in axes.texts:
        own = text.get_window_extent()
        assert own.x0 >= box.x0 and own.y0 >= box.y0 and own.x1 <= box.x1 and own.y1 <= box.y1, text


@pytest.mark.parametrize(
    ("roll", "labels"), [(0.0, ("mirror x [mm]", "mirror y [mm]")), (50.0, ("detector column", "detector row"))]
)
def test_a_frame_is_of_the_shown_pixels(roll, labels):
    _, _, result = measured(roll_deg=roll)
    frame = MapFrame.of(result.x_mm, result.y_mm, result.mask)
    assert (frame.x_label, frame.y_label) == labels
    shown = result.mask[frame.cut]
    assert shown.sum() == result.mask.sum() and shown[0].any() and shown[-1].any() and shown[:, 0].any()
    if roll == 0.0:
        half = np.nanmax(np.diff(result.x_mm, axis=1)) / 2
        assert frame.extent[:2] == pytest.approx(
            (np.nanmin(result.x_mm) - half, np.nanmax(result.x_mm) + half), abs=half
        )
        half = np.nanmax(np.diff(result.y_mm, axis=0)) / 2
        assert frame.extent[2:] == pytest.approx(
            (np.nanmin(result.y_mm) - half, np.nanmax(result.y_mm) + half), abs=half
        )
    else:
        columns, rows = np.flatnonzero(result.mask.any(0)), np.flatnonzero(result.mask.any(1))
        assert frame.extent == (columns[0] - 0.5, columns[-1] + 0.5, rows[0] - 0.5, rows[-1] + 0.5)
