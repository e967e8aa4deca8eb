"""Maps on a mirror: where they lie, what is made up, and the device's twin, against SciPy's splines."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from device_kernels import SmallKernel, kernel_text
from lopsided import lopsided
from scenes import with_part
from scipy.interpolate import RectBivariateSpline
from scipy.spatial import cKDTree

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.height_map import MapWarning
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.outline import Outline
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.packing.departures import is_slight, newton_steps, pack_departures

MIRROR = Mirror(radius_mm=1500.0, diameter_mm=100.0)


def mirror_with(*tables, base=MIRROR):
    return replace(base, map=tables)


def departure_of(*tables, base=MIRROR):
    return Surface.of(mirror_with(*tables, base=base)).deviation[0]


def bump(x, y):
    """A hill on one side, of which no turn or mirror image is the same [mm]."""
    return 1e-5 * np.exp(-((x - 14) ** 2 + (y - 7) ** 2) / 50) + 4e-6 * np.exp(-((x + 6) ** 2 + (y - 18) ** 2) / 90)


def bumps(pitch=(0.8, 0.9), half=60.0, centre=(0.0, 0.0)):
    """The hill as a map, [rows, columns] of unequal pitches that cover the mirror."""
    columns, rows = (2 * int(half / p) + 1 for p in pitch)
    x, y = (centre[k] + (np.arange(n) - (n - 1) / 2) * pitch[k] for k, n in enumerate((columns, rows)))
    return HeightMap(bump(x, y[:, None]), pitch_mm=pitch, centre_mm=centre)


def random_map(seed, rows=140, columns=150, pitch=(0.9, 0.85), size=1e-6):
    return HeightMap(size * np.random.default_rng(seed).normal(size=(rows, columns)), pitch_mm=pitch)


def points(count=500, radius=49.0, seed=3):
    generator = np.random.default_rng(seed)
    r, angle = radius * np.sqrt(generator.random(count)), generator.uniform(0, 2 * np.pi, count)
    return r * np.cos(angle), r * np.sin(angle)


# --- where a map lies -------------------------------------------------------------------------------------------
PLACES = {  # what a table says -> where a point (x, y) of the mirror is in the map's own frame
    "as it is": ({}, lambda x, y: (x, y)),
    "turned anticlockwise": ({"rotation_deg": 90.0}, lambda x, y: (y, -x)),
    "turned by 30 degrees": ({"rotation_deg": 30.0}, lambda x, y: (x * 0.75**0.5 + y / 2, y * 0.75**0.5 - x / 2)),
    "left and right turned over": ({"flip": "x"}, lambda x, y: (-x, y)),
    "top and bottom turned over": ({"flip": "y"}, lambda x, y: (x, -y)),
    "both": ({"flip": "xy"}, lambda x, y: (-x, -y)),
    "first turned over, then turned": ({"flip": "x", "rotation_deg": 90.0}, lambda x, y: (-y, -x)),
    "moved": ({"centre_mm": (5.0, -3.0)}, lambda x, y: (x - 5, y + 3)),
    "enlarged": ({"scale": 1.25}, lambda x, y: (x / 1.25, y / 1.25)),
    "turned and moved": ({"rotation_deg": -90.0, "centre_mm": (2.0, 1.0)}, lambda x, y: (-(y - 1), x - 2)),
}


@pytest.mark.parametrize("name", PLACES)
def test_a_map_lies_where_its_table_says(name):
    keys, back = PLACES[name]
    x, y = points()
    height = departure_of(MirrorMap(heights=bumps(half=70), **keys)).at(x, y)[0]
    np.testing.assert_allclose(height, bump(*back(x, y)), rtol=0, atol=2e-9)  # mm: of the spline, 2e-4 of the hill


def test_a_maps_own_centre_counts_unless_another_is_given():
    own = bumps(centre=(6.0, 2.0))
    x, y = points()
    np.testing.assert_allclose(departure_of(MirrorMap(heights=own)).at(x, y)[0], bump(x, y), rtol=0, atol=2e-9)
    turned = departure_of(MirrorMap(heights=own, rotation_deg=180.0)).at(x, y)[0]
    np.testing.assert_allclose(turned, bump(-x, -y), rtol=0, atol=2e-9)
    moved = departure_of(MirrorMap(heights=own, centre_mm=(0.0, 0.0))).at(x, y)[0]
    np.testing.assert_allclose(moved, bump(x + 6, y + 2), rtol=0, atol=2e-9)


def test_factor_wavefront_and_several_maps():
    x, y = points()
    surface, wave = bumps(), replace(bumps(), kind="wavefront")
    tables = [MirrorMap(heights=surface, factor=-2.0), MirrorMap(heights=wave, flip="x")]
    expected = -2 * bump(x, y) + 0.5 * bump(-x, y)
    np.testing.assert_allclose(departure_of(*tables).at(x, y)[0], expected, rtol=0, atol=6e-9)


def test_slopes_and_bends_are_differences_of_heights_and_slopes():
    departure = departure_of(
        MirrorMap(heights=random_map(1), rotation_deg=25.0, flip="y", scale=1.1), MirrorMap(heights=bumps())
    )
    x, y = points()
    h = 1e-4  # mm: third derivatives 1e-5 h^2, rounding 1e-21 / h
    _, slope_x, slope_y = departure.at(x, y)
    by_x, by_y = (
        np.subtract(departure.at(x + a, y + b), departure.at(x - a, y - b)) / (2 * h) for a, b in ((h, 0), (0, h))
    )
    np.testing.assert_allclose([slope_x, slope_y], [by_x[0], by_y[0]], rtol=0, atol=1e-12)
    twice, mixed, y_twice = departure.bend(x, y)
    # a second derivative has kinks at the cells' borders, which a few points lie near to
    for found, expected in ((twice, by_x[1]), (mixed, by_x[2]), (mixed, by_y[1]), (y_twice, by_y[2])):
        np.testing.assert_allclose(found, expected, rtol=0, atol=3e-9)


def test_nominal_has_no_map():
    assert Surface.of(mirror_with(MirrorMap(heights=bumps())).nominal()).departures == ()


# --- what is made up --------------------------------------------------------------------------------------------
def round_map(radius, pitch=1.0, half=60):
    """A plane's heights, valid within a radius."""
    x = np.arange(-half, half + 1) * pitch
    heights = 1e-6 * (2.0 + 0.1 * x + 0.05 * x[:, None])
    return HeightMap(np.where(np.hypot(x, x[:, None]) <= radius, heights, np.nan), pitch_mm=(pitch, pitch))


def test_a_small_edge_is_extrapolated_with_its_slope_and_said():
    x, y = points(radius=50.0)
    with pytest.warns(MapWarning, match=r"mirror\.map\[0\]: has no height on .* %.*: extrapolated there"):
        departure = departure_of(MirrorMap(heights=round_map(48.4)))
    height, slope_x, _ = departure.at(x, y)
    np.testing.assert_allclose(height, 1e-6 * (2 + 0.1 * x + 0.05 * y), rtol=0, atol=1e-8)  # mm: a tenth of its slope
    np.testing.assert_allclose(slope_x, 1e-7, rtol=0, atol=4e-8)


def test_a_wide_edge_or_a_hole_is_refused_and_says_what_helps():
    said = (
        r"^mirror\.map\[0\]: has no height on 16.\d % of the mirror, up to .* mm from the nearest: must come to within "
    )
    said += r'3 mm, or outside must be "nearest" or "zero"$'
    with pytest.raises(SceneError, match=said):
        departure_of(MirrorMap(heights=round_map(45.0)))
    holed = round_map(70.0)
    holed.heights_mm[55:66, 40:50] = np.nan
    # 12 x 11 mm between middles of pixels, less 0.75 diagonals on each side, of 7854 mm^2
    with pytest.raises(SceneError, match="has no height on 1.12 % of the mirror"):
        departure_of(MirrorMap(heights=holed))


def test_only_the_outline_must_have_heights():
    strip = np.where(np.abs(np.arange(-60, 61.0))[:, None] <= 21, 1e-6, np.nan) * np.ones(121)
    table = MirrorMap(heights=HeightMap(strip, pitch_mm=(1.0, 1.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        inside = replace(MIRROR, outline=Outline(shape="rectangle", size_mm=(90.0, 42.0)))
        assert departure_of(table, base=inside).at(30.0, 20.0)[0] == pytest.approx(1e-6)
    beyond = replace(MIRROR, outline=Outline(shape="rectangle", size_mm=(60.0, 60.0)))
    # a rectangle of 60 x 60 in which 21 + 1.06 mm have heights, as near as 0.75 diagonals of a pixel
    with pytest.raises(
        SceneError, match=r"has no height on 2[67]\.\d* % of the mirror, up to 9.01 mm from the nearest"
    ):
        departure_of(table, base=beyond)
    with pytest.raises(SceneError, match="has no height on"):
        departure_of(table)


@pytest.mark.parametrize("turn", [0.0, 20.0, 45.0])
def test_the_edge_of_a_map_is_as_far_along_a_diagonal(turn):
    """From the rim to the middle of the nearest pixel with a height, by a tree; heights end 4 mm before the rim."""
    x, y = np.meshgrid(np.arange(-60, 61.0), np.arange(-60, 61.0))
    valid = np.cos(np.radians(turn)) * x + np.sin(np.radians(turn)) * y <= 46.0
    with pytest.raises(SceneError) as caught:
        departure_of(MirrorMap(heights=HeightMap(np.where(valid, 1e-6, np.nan), pitch_mm=(1.0, 1.0))))
    angle = np.linspace(0, 2 * np.pi, 4000)
    far, _ = cKDTree(np.stack([x[valid], y[valid]], -1)).query(50 * np.stack([np.cos(angle), np.sin(angle)], -1))
    told = float(str(caught.value).split("up to ")[1].split(" mm")[0])
    assert told == pytest.approx(far.max(), abs=0.02)  # three digits, 1604 points on the rim


def test_a_hole_of_the_mirror_needs_no_heights():
    x = np.arange(-60, 61.0)
    heights = np.where(np.hypot(x, x[:, None]) < 14, np.nan, 1e-6)
    annular = replace(MIRROR, obscuration_mm=30.0)
    table = MirrorMap(heights=HeightMap(heights, pitch_mm=(1.0, 1.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        height = departure_of(table, base=annular).at(20.0, 20.0)[0]
    assert height == pytest.approx(1e-6)


@pytest.mark.parametrize("outside, beyond", [("nearest", 2e-6), ("zero", 0.0)])
def test_outside_as_told(outside, beyond):
    small = HeightMap(np.full((11, 21), 2e-6), pitch_mm=(1.0, 1.0))
    departure = departure_of(MirrorMap(heights=small, outside=outside))
    x, y = np.array([0.0, 45.0, 30.0]), np.array([0.0, 0.0, -30.0])
    np.testing.assert_allclose(departure.at(x, y)[0], [2e-6, beyond, beyond], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"centre_mm": (500.0, 0.0)}, "lies beside the mirror, its middle at 500, 0 mm"),
        ({"scale": 1e-3}, "must come to within 1 mm, or outside must be"),
        ({"factor": 0.0}, "factor = 0.0: must be"),
    ],
)
def test_absurd_places_are_one_line(change, said):
    with pytest.raises(SceneError) as caught:
        departure_of(MirrorMap(heights=bumps(), **change))
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_map_without_heights_on_the_mirror_is_refused():
    heights = np.full((200, 200), np.nan)
    heights[0, 0] = 1.0
    with pytest.raises(SceneError, match="no valid height on the mirror"):
        departure_of(MirrorMap(heights=HeightMap(heights, pitch_mm=(1.0, 1.0)), outside="nearest"))


def test_too_many_nodes_are_refused_before_anything_is_made(monkeypatch):
    monkeypatch.setattr("irtscots_cl.optics.height_map.MAX_NODES", 100)
    with pytest.raises(SceneError, match="has 145 x 131 points of the map: must be at most 100 along an axis"):
        departure_of(MirrorMap(heights=bumps()))


def test_only_the_mirrors_part_of_a_large_map_is_kept():
    large = random_map(2, 900, 900, (1.0, 1.0))
    assert max(departure_of(MirrorMap(heights=large)).maps[0].spline.shape) < 125


# --- the device -------------------------------------------------------------------------------------------------
MAP_ADD = """    const __global real *given = points + 2 * WIDTH * get_global_id(0);
    realv x, y, height = 0, slope_x = 0, slope_y = 0;
    for (int lane = 0; lane < WIDTH; ++lane) {
        ((real *)&x)[lane] = given[2 * lane];
        ((real *)&y)[lane] = given[2 * lane + 1];
    }
    map_add(scene, tables, x, y, &height, &slope_x, &slope_y);
    for (int lane = 0; lane < WIDTH; ++lane) {
        const size_t at = 3 * (get_global_id(0) * WIDTH + lane);
        out[at] = ((const real *)&height)[lane];
        out[at + 1] = ((const real *)&slope_x)[lane];
        out[at + 2] = ((const real *)&slope_y)[lane];
    }"""


def on_device(device, folder, precision, scene, x, y, width=None):
    """Height [mm] and slopes [3, n] of the maps of a scene at points [n], n a multiple of 16."""
    signature = "__constant Scene *scene, __global const real *tables, __global const real *points, __global real *out"
    entry = kernel_text(folder / "add.cl", ["map_*.cl"], signature, MAP_ADD)
    kernel = SmallKernel(device, entry, precision, scene, width)
    given = np.stack([x, y], -1).astype(kernel.real)
    (out,) = kernel.run((len(x) // kernel.width, 1), [kernel.tables, given], [np.zeros((len(x), 3), kernel.real)])
    return given.astype(float).T, out.astype(float).T


def other_spline(height_map):
    """SciPy's spline of a map in its own frame: ev(y, x)."""
    sizes = zip(height_map.heights_mm.shape, height_map.pitch_mm[::-1], strict=True)
    at = [(np.arange(count) - (count - 1) / 2) * pitch for count, pitch in sizes]
    return RectBivariateSpline(*at, height_map.heights_mm, kx=3, ky=3, s=0)


@pytest.mark.parametrize("width", [None, 1], ids=["own", "scalar"])
def test_the_device_agrees_with_another_spline(device, tmp_path, precision, width):
    """Two maps of 1 um rms, one turned by 90 degrees and turned over, of which SciPy's splines know the places."""
    first, second = random_map(5, size=1e-3), random_map(6, pitch=(0.95, 0.9), size=1e-3)
    tables = (MirrorMap(heights=first), MirrorMap(heights=second, flip="x", rotation_deg=90.0, factor=0.5))
    scene = with_part(
        lopsided(), "mirror", off_axis_mm=0.0, obscuration_mm=0.0, zernike=(), diameter_mm=80.0, map=tables
    )
    x, y = points(4096, radius=35.0)
    (x, y), found = on_device(device, tmp_path, precision, scene, x, y, width)
    one, two = (other_spline(height_map) for height_map in (first, second))
    expected = np.stack([one.ev(y, x), one.ev(y, x, 0, 1), one.ev(y, x, 1, 0)])
    expected += 0.5 * np.stack([two.ev(-x, -y), -two.ev(-x, -y, 1, 0), -two.ev(-x, -y, 0, 1)])
    # fp32: a place of 75 cells is rounded by 4e-6 of one, times slopes of 4 um per cell; fp64: of SciPy's ends
    tolerance = {"fp32": (1e-7, 3e-7), "fp64": (1e-11, 1e-10)}[precision]
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=tolerance[0])
    np.testing.assert_allclose(found[1:], expected[1:], rtol=0, atol=tolerance[1])
    departure = Surface.of(scene.mirror).deviation[0]
    np.testing.assert_allclose(departure.at(x, y), expected, rtol=0, atol=1e-10)


def test_the_device_stays_on_the_map_whatever_the_place(device, tmp_path, precision):
    small = HeightMap(np.arange(12.0).reshape(3, 4) * 1e-6, pitch_mm=(1.0, 1.0))
    scene = with_part(lopsided(), "mirror", zernike=(), map=(MirrorMap(heights=small, outside="nearest"),))
    far = [np.nan, np.inf, -np.inf, 1e30, -1e30, 3e9, 1.5, -1.5]
    x, y = (np.resize(v, 16) for v in (far, far[::-1]))
    _, (height, slope_x, slope_y) = on_device(device, tmp_path, precision, scene, x, y)
    assert (height >= -1e-12).all() and (height <= 11e-6 + 1e-12).all()
    assert np.isfinite(slope_x).all() and np.isfinite(slope_y).all()
    x, y = np.random.default_rng(8).uniform(-3.0, 3.0, (2, 4096))  # half of them around the map's edge
    (x, y), found = on_device(device, tmp_path, precision, scene, x, y)
    expected = Surface.of(scene.mirror).deviation[0].at(x, y)
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-11)  # mm: single precision of 11 nm
    slope = np.abs(found[1:] - expected[1:]).max(0)
    assert np.mean(slope > 1e-11) < 0.01  # rad; on an edge itself rounding decides


def test_extreme_slopes_are_found_and_steps_suffice():
    """One steep node among smooth ones decides how many Newton steps it takes, and whether slopes are slight."""
    heights = np.zeros((121, 121))
    scene = with_part(lopsided(), "mirror", zernike=(), diameter_mm=100.0, obscuration_mm=0.0)

    def with_map(height):
        heights[40, 77] = height
        made = HeightMap(heights.copy(), pitch_mm=(1.0, 1.0))
        return ChiefRays(with_part(scene, "mirror", map=(MirrorMap(heights=made),)))

    assert is_slight(with_map(1e-7).surface, "fp32") and not is_slight(with_map(3e-6).surface, "fp32")
    assert newton_steps(with_map(1e-6), 1e-9) == 1  # moves of 1e-7 mm times bends of 3e-6 / mm
    assert newton_steps(with_map(1e-3), 1e-9) > 1
    x, y = with_map(1e-6).surface.deviation[0].spread(50.0)
    assert np.hypot(x - 17.0, y + 20.0).min() < 1e-9 and (np.hypot(x, y) < 50.001).all()


def test_tables_of_several_maps_follow_each_other():
    tables = (MirrorMap(heights=random_map(1)), MirrorMap(heights=random_map(2), rotation_deg=10.0))
    packed = pack_departures(Surface.of(mirror_with(*tables)), np.float32)
    first, second = packed.values["map"]["grid"]
    assert first["offset"] == 1 and second["offset"] == 1 + (first["rows"] + 2) * first["stride"]
    assert len(packed.tables) == second["offset"] + (second["rows"] + 2) * second["stride"]


def test_slopes_of_no_mirror_are_refused_and_heights_of_no_deviation_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        departure_of(MirrorMap(heights=bumps(), factor=9e3))  # 0.09 mm
    with pytest.warns(MapWarning, match=r"heights up to 0\.11 mm: .*is its unit right\?"):
        departure_of(MirrorMap(heights=bumps(), factor=1.1e4))
    with pytest.raises(SceneError, match=r"has slopes up to \S+ on the mirror: must be below 1 \(unit"):
        departure_of(MirrorMap(heights=bumps(), factor=9.9e5))
