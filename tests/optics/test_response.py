"""The closed form of a pixel's light: the chord of Eq. 2, its integrals, pixels whole and cut, against many rays."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from lopsided import lopsided
from scenes import coarse, with_part
from scipy import integrate
from scipy.stats import qmc
from tracers import setup_of

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.chord import chord_cdf, chord_integrals
from irtscots_cl.optics.pixel.response import MAX_PUSH, PixelResponse
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene

A, D = 0.5, 0.2  # the paper's aperture radius and line width [mm]
OUTPUTS = "uvxy"


def holed():
    """The paper's sphere with a hole of 200 mm."""
    return with_part(load_scene("sphere"), "mirror", obscuration_mm=200.0)


def narrow():
    """The lopsided scene with an aperture so small that its rim is sharp enough for the closed form."""
    return with_part(lopsided(), "camera", aperture_diameter_mm=1.0)


def wide():
    """The paper's sphere seen through an aperture of 12 mm, lit by lines as much wider: its light bends most."""
    scene = with_part(load_scene("sphere"), "camera", aperture_diameter_mm=12.0)
    return with_part(scene, "screen", pitch_mm=2.4)


MADE = {"holed": holed, "narrow": narrow, "wide": wide}


# --- many rays of one pixel --------------------------------------------------------------------------------


def scene_of(name):
    return MADE[name]() if name in MADE else load_scene(name)


NODES = -np.cos(np.arange(5) * np.pi / 4)  # Chebyshev points along a chord of the aperture, in half chords
TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True))


@dataclass(frozen=True)
class ChordRays:
    """Rays of a pixel's light on chords through the aperture, five on each; of a cut pixel, on the mirror alone.

    They fill pixel and chords evenly (Sobol). Along a chord light and landing point are taken as polynomials through
    the five, so that the light that lands below an edge is an integral and not a count: nearly without noise.
    values: of u, v, x, y [mm], share: of the pixel's light, per unit along the chord; both as powers [n, 5].
    """

    values: dict[str, np.ndarray]
    share: np.ndarray

    @classmethod
    def of(cls, chief: ChiefRays, row: int, column: int, output: str, cut: str = ""):
        """output: "u" or "v", along which the chords run. cut: "rim" or "hole", what part of the pixel sees."""
        log2 = 14 if cut else 15
        inward, across, angle = qmc.Sobol(3, seed=2).random_base2(log2).T[:, :, None]
        across, angle = 2 * across - 1, (angle - 0.5) * np.pi
        radius = chief.scene.camera.aperture_diameter_mm / 2
        normal = _gradient(lambda a, b: chief.reverse(row, column, a, b)[1 + "uv".index(output)], radius)
        normal /= np.hypot(*normal)
        along, aside = radius * np.cos(angle) * NODES, radius * np.sin(angle)
        a, b = normal[0] * along - normal[1] * aside, normal[1] * along + normal[0] * aside
        row_at, column_at, kept = _on_mirror(chief, row, column, inward, across, a, b, cut)
        points, u, v = chief.reverse(row_at, column_at, a, b)
        # chords of a disk evenly in angle: each weighs as the square of its length; 1 on average with the factor 2
        share = kept * 2 * np.cos(angle) ** 2 / 2 * cosine4(chief, row_at, column_at, a, b)
        values = dict(zip(OUTPUTS, (u, v, points[..., 0], points[..., 1]), strict=True))
        return cls({name: value @ TO_POWERS.T for name, value in values.items()}, share @ TO_POWERS.T)

    def total(self) -> float:
        """Light of the pixel: its area and that of the aperture are 1."""
        return _integral(self.share, 1.0).mean()

    def mean(self, output: str) -> float:
        at_nodes = [powers @ np.vander(NODES, increasing=True).T for powers in (self.share, self.values[output])]
        return _integral(np.prod(at_nodes, 0) @ TO_POWERS.T, 1.0).mean() / self.total()

    def range(self, output: str) -> tuple[float, float]:
        """Between which values the output lies."""
        middle, aside = self.values[output][:, 0], np.abs(self.values[output][:, 1:]).sum(1)
        return (middle - aside).min(), (middle + aside).max()

    def below(self, output: str, edges_mm: np.ndarray) -> np.ndarray:
        """Light [edges] that lands below the edges [edges]."""
        values = self.values[output]
        place = np.clip((edges_mm - values[:, :1]) / values[:, 1:2], -1.0, 1.0)
        for _ in range(4):  # Newton: the landing point is nearly linear along a chord
            slope = _polynomial(values[:, 1:] * np.arange(1, 5), place)
            place = np.clip(place - (_polynomial(values, place) - edges_mm) / slope, -1.0, 1.0)
        return _integral(self.share, place).mean(0)


def cosine4(chief, row, column, a, b):
    """cos^4 of rays in front of the lens."""
    camera = chief.scene.camera
    x, y = chief.camera_model.image_point(row, column)
    slopes = a / camera.focus_mm - x / camera.image_distance_mm, b / camera.focus_mm - y / camera.image_distance_mm
    return (1 + slopes[0] ** 2 + slopes[1] ** 2) ** -2


def _polynomial(powers, at):
    return sum(powers[:, k, None] * at**k for k in range(powers.shape[1]))


def _integral(powers, end):
    """Integrals [n, ends] of polynomials [n, 5] from -1 to the ends [n, ends]."""
    return sum(powers[:, k, None] * (end ** (k + 1) - (-1.0) ** (k + 1)) / (k + 1) for k in range(5))


def _gradient(function, step):
    return np.array([function(step, 0) - function(-step, 0), function(0, step) - function(0, -step)])


def _on_mirror(chief, row, column, inward, across, a, b, cut):
    """(rows, columns, share of the line) of the points at `inward` (0 to 1) of the part on the mirror of pixel lines.

    The lines lie at `across` (-1 to 1) of the pixel and run along the axis that rim or hole cuts more steeply.
    """
    if not cut:
        return row + across / 2, column + inward - 0.5, 1.0
    surface = chief.surface
    sign, radius = {"rim": (1, surface.aperture_radius_mm), "hole": (-1, surface.obscuration_radius_mm)}[cut]

    def excess(row_at, column_at, a=0.0, b=0.0):
        points = chief.reverse(row_at, column_at, a, b)[0]
        return sign * (np.hypot(points[..., 0], points[..., 1]) - radius)

    by_column, by_row = _gradient(lambda s, t: excess(row + t, column + s), 0.25)
    along_columns = abs(by_column) > abs(by_row)
    steepest = by_column if along_columns else by_row

    def place(at):  # at: in half pixels from the centre, growing out of the mirror
        at = np.sign(steepest) * at
        return (row + across / 2, column + at / 2) if along_columns else (row + at / 2, column + across / 2)

    end = np.zeros_like(a)
    for _ in range(6):  # Newton with one slope: the rim is nearly straight
        end = np.clip(end - excess(*place(end), a, b) / abs(steepest), -1.0, 1.0)
    return *place(inward * (end + 1) - 1), (end + 1) / 2


# --- the chord of Eq. 2 and its integrals ------------------------------------------------------------------


def test_chord_cdf_is_the_share_of_a_disk_left_of_a_line():
    """Paper Eq. 2: F(u) = u sqrt(a^2 - u^2) + a^2 asin(u / a), against the disk's area strip by strip."""
    edges = np.linspace(-1, 1, 200_001)
    middle = (edges[1:] + edges[:-1]) / 2
    area = np.concatenate([[0.0], np.cumsum(2 * np.sqrt(1 - middle**2) * (edges[1] - edges[0]))]) / np.pi
    np.testing.assert_allclose(
        chord_cdf(edges),
        area,
        atol=1e-7,  # strips at the ends: the 3/2 power of their width
    )
    np.testing.assert_array_equal(chord_cdf(np.array([-7.0, -1.0, 1.0, 7.0])), [0, 0, 1, 1])
    assert chord_cdf(np.array(0.0)) == 0.5


@pytest.mark.parametrize("offset", [0.0, 0.03, 0.1, -0.077])
def test_all_lines_together_let_through_the_whole_aperture(offset):
    lines = (np.arange(21) - 10) * D
    share = chord_cdf((lines - offset + D / 2) / A) - chord_cdf((lines - offset - D / 2) / A)
    assert share.sum() == pytest.approx(1, abs=1e-14)  # rounding
    assert (share >= 0).all()


def test_the_light_curve_s_full_base_width_is_1_2_mm():
    line = np.array([-0.6001, -0.5999, 0.5999, 0.6001])
    share = chord_cdf((line + D / 2) / A) - chord_cdf((line - D / 2) / A)
    np.testing.assert_array_equal(share > 0, [False, True, True, False])


def half_chord(tau):
    return np.sqrt(np.maximum(1 - tau**2, 0.0))


INTEGRANDS = {
    "share": chord_cdf,
    "square": lambda tau: 2 * tau**2 * half_chord(tau),  # of the position across the chord, over the chord
    "along": lambda tau: 1.5 * (2 / 3) * half_chord(tau) ** 3,  # of the square of the position along it, times 3/2
}


@pytest.mark.parametrize("which", INTEGRANDS)
@pytest.mark.parametrize("step", [0.3, 0.05])
def test_chord_integrals_are_second_antiderivatives(which, step):
    """A second difference of f'' = g is exactly the integral of g under a hat; across the disk's ends and beyond."""
    function = INTEGRANDS[which]
    k = list(INTEGRANDS).index(which)
    for tau in [-1.4, -1.2, -1.0, -0.99, -0.6, -0.013, 0.0, 0.47, 0.96, 1.0, 1.02, 1.3, 2.0]:
        below, here, above = (chord_integrals(np.array(tau + sign * step))[k] for sign in (-1, 0, 1))
        ends = [end for end in (-1.0, 1.0) if abs(end - tau) < step]

        def under_hat(x, tau=tau):
            return (step - abs(x - tau)) * function(x)

        hat = sum(
            integrate.quad(under_hat, *piece, epsabs=1e-13, epsrel=1e-12)[0]
            for piece in pairwise(sorted({tau - step, tau, tau + step, *ends}))
        )
        assert below - 2 * here + above == pytest.approx(hat, abs=1e-11)  # the quadrature at a root's end


def test_chord_integrals_go_on_smoothly_past_the_disk():
    for end in (-1.0, 1.0):
        for step in (1e-3, 1e-5, 1e-7):
            inside, at, outside = (np.array(chord_integrals(np.array(end * (1 + d)))) for d in (-step, 0.0, step))
            # g is at most 1 near the end, so that values and slopes differ by no more than g step allows
            assert (np.abs(outside - 2 * at + inside) < step**2 + 5e-14).all()  # 5e-14: rounding of values near 1
    far = np.array(chord_integrals(np.array([3.0, 4.0, 5.0, -3.0, -4.0, -5.0])))
    np.testing.assert_allclose(far[:, 3] - far[:, 4], far[:, 4] - far[:, 5], rtol=0, atol=1e-14)  # rounding
    np.testing.assert_allclose(np.diff(far[:, :3], 2)[:, 0], [1, 0, 0], rtol=0, atol=1e-14)  # share 1, else no chord


# --- pixels against many rays ------------------------------------------------------------------------------

# (scene, row, column, part): whole pixels near the centre and far out, and pixels that rim or hole cuts at a slant
PIXELS = [
    ("sphere", 62, 62, ""),
    ("sphere", 110, 39, ""),
    ("sphere", 23, 101, "rim"),
    ("sphere", 54, 117, "rim"),
    ("sphere-deviated", 80, 55, ""),
    ("off-axis", 62, 62, ""),
    ("holed", 70, 69, "hole"),
    ("narrow", 34, 31, "hole"),
    ("wide", 62, 110, ""),
    ("wide", 100, 90, ""),
]


def light_of(name, *places):
    """The PixelResponse of some pixels (row, column) of a scene."""
    chief = setup_of(scene_of(name)).chief_rays
    row, column = np.array(places).T
    return PixelResponse.of(chief, row * chief.shape[1] + column)


def line_edges(scene, output):
    """Edges [lines + 1] of the lines of a scan."""
    positions, half = LineScan(scene).positions_mm("xy"["uv".index(output)]), scene.screen.pitch_mm / 2
    return np.append(positions - half, positions[-1] + half)


def edges_of(light, rays, output):
    """Edges of lines as the scan's, also beyond the screen, from before a pixel's light to behind it."""
    first, pitch = line_edges(light.chief.scene, output)[0], light.chief.scene.screen.pitch_mm
    lowest, highest = np.round((np.array(rays[output].range(output)) - first) / pitch)
    return first + pitch * np.arange(lowest - 2, highest + 3)


@pytest.fixture(scope="module", params=PIXELS, ids=lambda p: f"{p[0]}-{p[1]}-{p[2]}")
def pixel(request):
    """(light of one pixel, its many rays along u and v)"""
    name, row, column, cut = request.param
    light = light_of(name, (row, column))
    return light, {o: ChordRays.of(light.chief, row, column, o, cut) for o in "uv"}


def test_means_are_those_of_many_rays(pixel):
    light, rays = pixel
    for output, along, mm in [("u", "u", 3e-6), ("v", "v", 3e-6), ("x", "u", 1e-4), ("y", "v", 1e-4)]:
        # mm: cubic terms make 1.8e-6 in the scene "narrow", 0.4 nrad; the mirror point to 1e-5 of a pixel
        assert light.means(output)[0, 0] == pytest.approx(rays[along].mean(output), abs=mm)


@pytest.mark.parametrize("output", "uv")
def test_light_is_that_of_many_rays(pixel, output):
    light, rays = pixel
    edges = edges_of(light, rays, output)
    found = light.light(output, edges[None])[0]
    expected = np.diff(rays[output].below(output, edges))
    peak = expected.max()
    assert (expected > 0.05 * peak).sum() >= 2 and (expected[[0, -1]] == 0).all()  # a light curve, whole
    # 6.5e-6 measured at worst; where the rays' own noise is 1e-5, of pixels whose light is wide, 1.7e-5
    coarse = light.chief.scene.name in ("off-axis", "lopsided")
    assert np.abs(found - expected).max() < (2e-5 if coarse else 1e-5) * peak
    lit = expected > 1e-4 * peak
    assert np.sqrt(np.mean((found - expected)[lit] ** 2)) < (1.2e-5 if coarse else 5e-6) * peak  # over the light curve


def test_all_light_is_the_pixel_s(pixel):
    light, rays = pixel
    for output in "uv":
        edges = edges_of(light, rays, output)
        total = light.light(output, edges[None]).sum()
        assert total == pytest.approx(rays[output].total(), rel=4e-6)  # 3e-6: cos^4 bends over a pixel


@pytest.mark.parametrize("place", [(62, 20), (30, 90)])
def test_light_is_that_of_rays_counted_by_lines(place):
    """Without any of the helpers above: 2 million rays of a whole pixel, each in its line."""
    light = light_of("off-axis", place)
    parts, points = 40, 1250
    step = (np.arange(parts) + 0.5) / parts - 0.5
    step_row, step_column = (s.ravel()[:, None] for s in np.meshgrid(step, step, indexing="ij"))
    radius = A * np.sqrt((np.arange(points) + 0.5) / points)
    # a sunflower, even over the disk, turned anew for each part of the pixel
    angle = np.arange(points) * np.pi * (3 - np.sqrt(5)) + np.arange(parts**2)[:, None] * 4.7437
    rays = place[0] + step_row, place[1] + step_column, radius * np.cos(angle), radius * np.sin(angle)
    _, *landing = light.chief.reverse(*rays)
    weight = cosine4(light.chief, *rays)
    for output, mm in zip("uv", landing, strict=True):
        edges = line_edges(light.chief.scene, output)
        counted, _ = np.histogram(mm, edges, weights=weight / weight.size)
        found = light.light(output, edges[None])[0]
        assert np.abs(found - counted).max() < 1e-3 * counted.max()  # noise of the counts: 1e5 rays or more, evenly


@pytest.mark.parametrize("monomial", ["aa", "ab", "bb"])
def test_a_bend_of_any_direction_shifts_the_light(monomial):
    """A map turned and bent by hand, much more than apertures do (and they hardly do along the chord)."""
    light, size = light_of("sphere", (100, 90)), 0.01
    radius = light.spread("u", ("a", "b"))[0]
    straight = with_terms(light, {"a": 0.8 * radius, "b": 0.6 * radius, "aa": 0.0, "ab": 0.0, "bb": 0.0})
    bent = with_terms(straight, {monomial: size * radius})

    s, t, r, angle = qmc.Sobol(4, seed=1).random_base2(19).T  # points of pixel and aperture
    a, b = np.sqrt(r) * np.cos(2 * np.pi * angle), np.sqrt(r) * np.sin(2 * np.pi * angle)
    place = {"s": 2 * s - 1, "t": 2 * t - 1, "a": a, "b": b}
    landing = straight.maps.term("u")[0] + sum(straight.maps.term("u", name)[0] * place[name] for name in place)
    moved = landing + size * radius * {"aa": a * a, "ab": a * b, "bb": b * b}[monomial]
    edges = line_edges(light.chief.scene, "u")
    counted = (np.histogram(moved, edges)[0] - np.histogram(landing, edges)[0]) / len(a)
    found = (bent.light("u", edges[None]) - straight.light("u", edges[None]))[0]
    assert np.abs(counted).max() > 8e-4
    np.testing.assert_allclose(found, counted, rtol=0, atol=2e-4)  # second order, 0.01 squared; and as much from counts
    shift = bent.means("u")[0, 0] - straight.means("u")[0, 0]
    assert shift == pytest.approx(np.mean(moved - landing), abs=2e-4 * size * radius)  # what cos^4 does to it


def with_terms(light, terms):
    """Light of one pixel whose map has other coefficients of u."""
    maps = light.maps
    number = replace(maps, coefficient=np.tile(np.arange(15)[:, None, None], (1, 4, 1)))  # of each monomial
    coefficient = maps.coefficient.copy()
    for monomial, value in terms.items():
        coefficient[number.term("u", monomial)[0], 0] = value
    return PixelResponse(light.chief, light.pixels, replace(maps, coefficient=coefficient))


def test_light_of_many_pixels_is_that_of_each():
    """Cells are worked on in chunks, and pixels of all kinds stand side by side."""
    places = [(62, 62), (110, 39), (23, 101), (54, 117), (62, 72), (63, 71)]
    open_pool = light_of("holed", *places)
    edges = np.broadcast_to(line_edges(open_pool.chief.scene, "u"), (len(places), 22))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("irtscots_cl.optics.pixel.response.CHUNK", 7)
        light = open_pool.light("u", edges)
    for k, place in enumerate(places):  # beside one that the hole cuts
        alone = light_of("holed", place, places[4]).light("u", edges[:2])[0]
        np.testing.assert_allclose(alone, light[k], rtol=0, atol=2e-6)  # cells of another size, as other pixels are
    np.testing.assert_allclose(open_pool.light("u", edges), light, rtol=0, atol=1e-15)  # rounding


# --- coverage and holes ------------------------------------------------------------------------------------


def footprint_areas(chief):
    """Area [rows, columns] of the pixels' footprints by their corners."""
    rows, columns = chief.shape
    corners = chief.reverse(*np.meshgrid(np.arange(rows + 1) - 0.5, np.arange(columns + 1) - 0.5, indexing="ij"))
    first, second = corners[0][1:, 1:] - corners[0][:-1, :-1], corners[0][1:, :-1] - corners[0][:-1, 1:]
    return np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]).ravel() / 2


@pytest.mark.parametrize(("name", "hole_mm"), [("sphere", 0.0), ("holed", 100.0)])
def test_coverage_adds_up_to_the_mirror(name, hole_mm):
    light = setup_of(scene_of(name)).pixel_response
    area = np.sum(light.coverage() * footprint_areas(light.chief)[light.pixels])
    expected = np.pi * (532.0**2 - hole_mm**2)
    assert area == pytest.approx(expected, rel=1e-5)  # 4e-6: a pixel's footprint is a little larger on one side


@pytest.mark.parametrize("name", ["sphere", "holed", "off-axis", "narrow"])
def test_coverage_is_that_of_counted_chief_rays(name):
    light = setup_of(scene_of(name)).pixel_response
    counted = light.chief.footprint.coverage.ravel()[light.pixels]
    found = light.coverage()
    assert found.max() <= 1 + 1e-14 and found.min() >= -1e-14  # rounding
    np.testing.assert_allclose(found[counted == 1], 1, rtol=0, atol=4e-3)  # a corner without any of 16 x 16 rays: 1/256
    assert np.abs(found - counted).max() < 1 / 16  # a straight edge moves by at most about one row of rays
    assert ((found > 0.1) & (found < 0.9)).sum() > 150  # and many pixels are cut


@pytest.mark.parametrize("name", ["sphere-deviated", "off-axis", "holed", "narrow"])
def test_no_ray_of_a_clear_pixel_comes_near_an_edge(name):
    setup = setup_of(scene_of(name))
    chief, response = setup.chief_rays, setup.pixel_response
    clear, coverage = chief.clear_of_edges.ravel()[response.pixels], response.coverage()
    assert 0.5 < clear.mean() < 1 and (coverage[clear] > 1 - 1e-9).all()
    row, column = np.divmod(response.pixels[clear], chief.shape[1])
    radius = chief.scene.camera.aperture_diameter_mm / 2
    random = np.random.default_rng(4)
    for _ in range(20):
        s, t = random.choice([-0.5, 0.5], size=(2, len(row)))  # the corners' rays go farthest
        turn = random.uniform(0, 2 * np.pi, len(row))
        points, _, _ = chief.reverse(row + t, column + s, radius * np.cos(turn), radius * np.sin(turn))
        from_axis = np.hypot(points[..., 0], points[..., 1])
        assert (from_axis < chief.surface.aperture_radius_mm).all()
        assert (from_axis > chief.surface.obscuration_radius_mm).all() or chief.surface.obscuration_radius_mm == 0


def test_no_light_comes_from_the_hole():
    places = [(62, 62), (62, 72), (62, 80)]  # in the hole, on its edge, on the mirror
    light, whole = light_of("holed", *places), light_of("sphere", *places)
    edges = np.broadcast_to(line_edges(light.chief.scene, "u"), (3, 22))
    found, full = light.light("u", edges).sum(1), whole.light("u", edges).sum(1)
    assert abs(found[0]) < 1e-14 * full[0]  # rounding: what the hole takes away is all
    assert found[1] == pytest.approx(full[1] * light.coverage()[1], rel=1e-4)  # cos^4 between the parts of a pixel
    assert found[2] == pytest.approx(full[2], rel=1e-12)  # cells of another size
    assert 0.05 < light.coverage()[1] < 0.95


def test_a_pixel_in_the_hole_has_no_coverage():
    light = setup_of(narrow()).pixel_response
    dark = light.coverage() < 1e-9
    assert dark.sum() > 3 and (light.coverage()[dark] == 0).all()
    assert np.isnan(light.means("uv")[:, dark]).all()


def test_a_hole_that_no_pixel_sees_takes_nothing():
    light, whole = light_of("holed", (62, 100)), light_of("sphere", (62, 100))
    np.testing.assert_array_equal(light.coverage(), whole.coverage())


def test_a_hole_within_a_pixel_takes_its_area_or_is_refused():
    scene = with_part(load_scene("sphere"), "mirror", obscuration_mm=4.0)
    light = setup_of(scene).pixel_response
    centre = light.pixels == 62 * 125 + 62
    share = np.pi * 2.0**2 / footprint_areas(light.chief)[62 * 125 + 62]
    assert not light.valid()[centre] or light.coverage()[centre] == pytest.approx(1 - share, abs=1e-3)  # of 0.86


# --- where the closed form holds ---------------------------------------------------------------------------


def test_the_closed_form_holds_on_the_presets():
    for name in ("sphere", "sphere-deviated", "off-axis", "narrow"):
        assert setup_of(scene_of(name)).pixel_response.valid().all()


def test_an_aperture_that_blurs_the_rim_too_much_is_refused():
    """The rim moves aside by the aperture's defocused image on the mirror: as far as rays from both its sides say."""
    scene, pixel = load_scene("sphere"), np.array([62 * 125 + 10])
    points, _, _ = setup_of(scene).chief_rays.reverse(62, 10, np.array([A, -A, 0, 0]), np.array([0, 0, A, -A]))
    corners, _, _ = setup_of(scene).chief_rays.reverse(
        62 + np.array([0, 0, 0.5, -0.5]), 10 + np.array([0.5, -0.5, 0, 0])
    )
    blur, size = (np.hypot(*(p[::2, :2] - p[1::2, :2]).ravel()[[0, 3]]) / 2 for p in (points, corners))
    widest = 2 * A * MAX_PUSH / (blur / size)
    for diameter_mm, valid in [(0.97 * widest, True), (1.03 * widest, False)]:
        wide = with_part(scene, "camera", aperture_diameter_mm=diameter_mm)
        assert PixelResponse.of(setup_of(wide).chief_rays, pixel).valid()[0] == valid


def test_a_map_that_is_not_quadratic_is_refused():
    """Ripples of radial order 40: half a period in three pixels, and steep at 30 um."""
    sphere = load_scene("sphere")
    for amount_um, valid in [(0.03, True), (30.0, False)]:
        terms = (ZernikeTerms(radius_mm=532.0, ordering="osa", coefficients_um={840: amount_um}),)
        light = PixelResponse.of(
            setup_of(with_part(sphere, "mirror", zernike=terms)).chief_rays, np.array([62 * 125 + 90])
        )
        assert light.valid()[0] == valid


def test_a_pixel_that_misses_the_surface_is_refused():
    """The surface ends at 580 mm, and the detector looks at 600 mm."""
    scene = with_part(load_scene("sphere"), "mirror", radius_mm=580.0, diameter_mm=800.0)
    light = PixelResponse.of(setup_of(scene).chief_rays, np.arange(125 * 125))
    missed = np.isnan(light.maps.term("x"))
    assert 1000 < missed.sum() < 2000  # the corners of the detector
    assert not light.valid()[missed].any()


@pytest.mark.parametrize(("name", "shared"), [("sphere", True), ("off-axis", False)])
def test_axes_whose_light_needs_the_same_cells_share_them(name, shared):
    chief, pixels = ChiefRays(load_scene(name)), np.arange(0, 125 * 125, 31)
    together = PixelResponse.of(chief, pixels)
    assert (together.cells("u") is together.cells("v")) == shared
    means = together.means("xyuv")
    for output, mean in zip("xyuv", means, strict=True):  # as of cells of its own
        np.testing.assert_array_equal(PixelResponse.of(chief, pixels).means(output)[0], mean)


def test_the_means_take_little_memory_beside_the_cells():
    """Of light far wider than the aperture's image: a pixel has 256 cells, whose maps would take ten times more."""
    response = setup_of(coarse("vista-secondary", 16)).pixel_response
    cells = response.cells("u")
    own = sum(getattr(cells, name).nbytes for name in cells.__dataclass_fields__)
    assert own > 2**22
    tracemalloc.start()
    response.means("u")
    response.extent("u")
    assert tracemalloc.get_traced_memory()[1] < 1.5 * own
    tracemalloc.stop()
