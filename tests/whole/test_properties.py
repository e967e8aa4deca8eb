"""Properties of every scene: the ledger, signs, both estimators' expectation, superposition, symmetries.

Hypothesis draws the scenes, always the same ones (derandomize), so a test that passes passes again. FAILURE_CHANCE is
that of each statistical test over all of its scenes, had the scenes' random words been others: split by Sidak's rule.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from scipy import stats
from significance import poisson_ratio_p, sidak_p

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.options import ESTIMATORS
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6
EXAMPLES = 20
some_scenes = settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    database=None,
    phases=[Phase.explicit, Phase.generate],  # a scene that fails is not shrunk: every other one is traced, for minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
)

# Sets of terms, not any: every other set is a kernel of its own to build
KINDS = {
    "sphere": ({}, ()),
    "sphere with a hole": ({"obscuration": 0.3}, (4, 6, 11)),
    "conic": ({"conic": -1.3}, (5, 8, 9)),
    "off-axis with a hole": ({"conic": -0.7, "off_axis": 0.2, "obscuration": 0.3}, (5, 8, 9)),
}
OF_REVOLUTION = [kind for kind, (shape, _) in KINDS.items() if "off_axis" not in shape]


def between(low: float, high: float):
    return st.floats(low, high, allow_subnormal=False).map(lambda value: round(value, 4))


@st.composite
def mirrors(draw, kinds=tuple(KINDS)) -> Mirror:
    """Of 1 to 3 m radius and f/2.5 to f/10."""
    shape, terms = KINDS[draw(st.sampled_from(kinds))]
    radius = draw(between(1000, 3000))
    diameter = radius * draw(between(0.05, 0.2))
    coefficients = {noll: draw(between(-2, 2)) for noll in terms}
    deviation = {"radius_mm": diameter * 0.55, "ordering": "noll", "coefficients_um": coefficients}
    return Mirror(
        radius_mm=radius,
        diameter_mm=diameter,
        conic=shape.get("conic", 0.0),
        off_axis_mm=radius * shape.get("off_axis", 0.0),
        obscuration_mm=diameter * shape.get("obscuration", 0.0),
        reflectance=0.9,
        zernike=(ZernikeTerms(**deviation),) if terms else (),
    )


@st.composite
def scenes(draw, mirror=mirrors(), view_mm=None) -> Scene:  # noqa: B008 - a strategy keeps nothing
    """The camera anywhere in front of the mirror, the screen where the detector's centre sees it, sized by its light.

    mirror: a strategy. view_mm: what the detector is to see of it, about; None: all.
    """
    mirror = draw(mirror)
    view = view_mm or mirror.diameter_mm
    away = min(mirror.radius_mm, 2000.0)
    distance, screen_distance = (away * draw(between(0.8, 1.2)) for _ in range(2))
    tilt = np.array([draw(between(-0.08, 0.08)), draw(between(-0.05, 0.05)), 1.0])
    look = [view * draw(between(-0.05, 0.05)) for _ in range(2)]
    pixels = draw(st.tuples(st.integers(4, 8), st.integers(4, 8)))
    pitch = view * 20.0 / distance / min(pixels) * draw(between(0.7, 1.3))
    camera = Camera(
        position_mm=tuple(map(float, distance * tilt)),
        look_at_mm=(*look, 0.0),
        aperture_diameter_mm=draw(between(1.0, 4.0)) * away / 1000,
        focal_length_mm=20.0,
        transmittance=0.8,
        detector=Detector(pixels=pixels, pitch_mm=pitch),
    )
    screen = Screen(
        position_mm=tuple(map(float, screen_distance * tilt * [-1, -1, 1])),
        look_at_mm=(away * draw(between(-0.1, 0.1)), away * draw(between(-0.1, 0.1)), 0.0),
        pixels=draw(st.tuples(st.integers(5, 12), st.integers(5, 12))),
        pitch_mm=1.0,
        radiance=2.0,
    )
    scene = Scene(name="drawn", mirror=mirror, screen=screen, camera=camera)
    return replace(scene, screen=sized_by_the_light(scene, draw(between(0.6, 1.4))))


def sized_by_the_light(scene: Scene, cover: float) -> Screen:
    """The screen about what the detector's centre sees; cover: its smaller side over the light's extent."""
    chief, screen = ChiefRays(scene), scene.screen
    rows, columns = chief.shape
    _, u, v = chief.reverse((rows - 1) / 2, (columns - 1) / 2)
    assume(np.isfinite(u + v) and chief.sees_mirror.any())
    lowest, highest = (edge[chief.sees_mirror] for edge in chief.landing_range())
    extent_mm = (np.nanmax(highest, 0) - np.nanmin(lowest, 0)).max() * screen.pitch_mm
    pitch = float(extent_mm) * cover / min(screen.pixels)
    return replace(screen, pitch_mm=pitch, centre_offset_mm=(float(u), float(v)))


def traced(scene, device, **options):
    """A run of few rays; another scene is drawn where no pixel sees the screen, which happens beside a hole."""
    try:
        return trace(scene, device=device, **({"rays_per_pixel": 1024, "replicates": 2} | options))
    except SceneError:
        assume(False)


def curves(run, axis: str, brightness=None) -> np.ndarray:
    """Flux [replicates, rows, columns, lines] of all detector pixels under all lines."""
    windows, (columns, rows) = run.windows, run.scene.camera.detector.pixels
    flux, k = run.line_flux_w(axis, brightness), "xy".index(axis)
    out = np.zeros((len(flux), rows * columns, run.scene.screen.pixels[k]))
    line = windows.origins[:, k, None] + np.arange(flux.shape[-1])
    out[:, windows.pixels[:, None], line] = flux
    return out.reshape(len(flux), rows, columns, -1)


def one_hit_w(run) -> np.ndarray:
    """Flux [rows, columns, 1] of one adjoint ray in a run of run.rays, for pixels that can see the mirror; else 1."""
    columns, rows = run.scene.camera.detector.pixels
    unit = np.ones(rows * columns)
    unit[run.windows.pixels] = run.unit_w[:, 0, 0] * WEIGHT_ONE / run.rays.sum()
    return unit.reshape(rows, columns, 1)


# --- bookkeeping -----------------------------------------------------------------------------------------------


ALL = {"forward": ("forward", False), "adjoint": ("adjoint", False), "smoothed": ("adjoint", True)}


@pytest.mark.slow  # it builds most of the kernels; 2 s where the driver has them in its cache
@some_scenes
@given(scenes(), st.integers(2, 3000), st.integers(0, 2**64 - 1))
def test_the_ledger_is_exact_and_no_flux_negative(device, scene, rays, seed):
    for kind, (estimator, smoothing) in ALL.items():
        run = traced(scene, device, estimator=estimator, smoothing=smoothing, rays_per_pixel=rays, seed=seed)
        ledger = dict(run.ledger)
        launched = ledger.pop("launched")
        columns, rows = scene.screen.pixels
        assert launched == rays * (columns * rows if kind == "forward" else len(run.windows.pixels))
        assert sum(ledger.values()) == launched and min(ledger.values()) >= 0
        assert ledger["failed"] == ledger["absorbed"] == 0
        totals = [curves(run, axis) for axis in "xy"]
        assert all(np.isfinite(of).all() and (of >= 0).all() for of in totals)
        if kind == "forward":
            assert ledger["detected"] == run.counts.sum()
        if kind != "smoothed":  # the same rays in both scans
            np.testing.assert_allclose(totals[0].sum(-1), totals[1].sum(-1), rtol=1e-12)  # rounding


# --- the estimators agree --------------------------------------------------------------------------------------


@pytest.mark.slow
@some_scenes
@given(scenes())
def test_forward_is_adjoint_in_expectation(device, scene):
    """The flux of every detector pixel and of all together, by z: Poisson variance forward, binomial adjoint."""
    forward = traced(scene, device, estimator="forward", rays_per_pixel=8192, replicates=1, seed=3)
    adjoint = traced(scene, device, rays_per_pixel=4096, replicates=1, seed=4)
    np.testing.assert_array_equal(forward.windows.pixels, adjoint.windows.pixels)
    shape = forward.counts.shape[1:]
    unit_forward = np.broadcast_to(forward.unit_w / forward.rays.sum(), shape)
    unit_adjoint = adjoint.unit_w * WEIGHT_ONE / adjoint.rays.sum()
    flux = adjoint.flux_w()
    expected = (flux / unit_forward).sum((1, 2))  # forward hits of a pixel
    variance = (flux * unit_forward).sum((1, 2))  # of its forward flux
    share = flux.sum((1, 2)) / (unit_adjoint * adjoint.rays.sum())[:, 0, 0]
    variance += flux.sum((1, 2)) * unit_adjoint[:, 0, 0] * np.clip(1 - share, 1e-3, 1)  # of its adjoint flux
    difference = forward.flux_w().sum((1, 2)) - flux.sum((1, 2))
    enough = expected >= 30
    assume(expected.sum() >= 30)  # what few hits say is for the bins of test_transport_agreement.py
    z = np.append(difference[enough] / np.sqrt(variance[enough]), difference.sum() / np.sqrt(variance.sum()))
    # Counts of 30 have a longer upper tail than a normal distribution: their p-values are Poisson's, of as many hits
    hits = np.append(expected[enough], expected.sum())
    p = np.minimum(stats.poisson.sf(hits + np.abs(z) * np.sqrt(hits) - 1, hits), 0.5) * 2
    assert p.min() > sidak_p(EXAMPLES * 65, FAILURE_CHANCE)  # at most 64 pixels, and their sum


@pytest.mark.slow
@some_scenes
@given(scenes())
def test_smoothed_is_plain_adjoint_in_expectation(device, scene):
    """The flux of all pixels and its first moment over the lines, by Welch's t test on the replicates."""
    options = {"rays_per_pixel": 32 * 256, "replicates": 32}
    runs = [traced(scene, device, **options, smoothing=s, seed=5 + s) for s in (False, True)]
    p = []
    for axis in "xy":
        line = np.arange(scene.screen.pixels["xy".index(axis)]) - (scene.screen.pixels["xy".index(axis)] - 1) / 2
        for power in (0, 1):
            sums = [(curves(run, axis) * line**power).sum((1, 2, 3)) for run in runs]
            p.append(stats.ttest_ind(*sums, equal_var=False).pvalue)
    assert min(p) > sidak_p(4 * EXAMPLES, FAILURE_CHANCE)


TINY, LARGE = 1e-200, 1e12  # sums of both keep their digits, and nothing underflows
LEVELS = np.array([0.0, TINY, 1.0, LARGE])
STRUCTURES = ("even", "levels", "levels and even", "one pixel", "column", "chequered", "ramp")


@st.composite
def brightness_maps(draw, shape: tuple[int, int]) -> np.ndarray:
    """A value of its own for every pixel [rows, columns], or a structure; always with some light."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    row, column = np.indices(shape)
    even, levels = random.random(shape), random.choice(LEVELS, shape)
    one, other = (random.integers(0, size) for size in shape)
    return {
        "even": even,
        "levels": levels + (levels.max() == 0),
        "levels and even": np.where(random.random(shape) < 0.5, levels, even),
        "one pixel": np.where((row == one) & (column == other), even + 0.1, 0.0),
        "column": np.where(column == other, even + 0.1, 0.0),
        "chequered": (row + column + one) % 2 * even,
        "ramp": (row + 1.0) * (column + 0.5),
    }[draw(st.sampled_from(STRUCTURES))]


def images_one_by_one(run, axis: str, brightness: np.ndarray) -> np.ndarray:
    """Light curves [n, window] of all replicates' rays, screen pixel by screen pixel."""
    flux = run.flux_w()
    out = np.zeros((len(flux), flux.shape[2 - "xy".index(axis)]))
    for k in range(flux.shape[1]):
        for m in range(flux.shape[2]):
            column, row = np.add(run.windows.origins, (m, k)).T
            out[:, m if axis == "x" else k] += flux[:, k, m] * brightness[row, column]
    return out


@some_scenes
@given(scenes(), st.sampled_from(ESTIMATORS), st.data())
def test_two_brightness_maps_add_up(device, scene, estimator, data):
    run, shape = traced(scene, device, estimator=estimator), scene.screen.pixels[::-1]
    first, second = (data.draw(brightness_maps(shape)) for _ in range(2))
    stacks = [run.images(LineScan(scene, of)) for of in (first, second, first + second, None)]
    for axis in "xy":
        one, other, both, full = (getattr(stack, axis).flux_w for stack in stacks)
        np.testing.assert_allclose(one + other, both, rtol=1e-12, atol=0)  # rounding: nothing is negative
        assert (both <= (first + second).max() * full * (1 + 1e-12)).all()
        mean = np.average(one, 0, run.rays)
        np.testing.assert_allclose(mean, images_one_by_one(run, axis, first), rtol=1e-12, atol=0)


def test_brightness_maps_are_no_trivial_ones():
    """In most cases both maps differ from pixel to pixel, and from each other by more than a factor."""
    found = []

    @settings(max_examples=100, derandomize=True, database=None)
    @given(brightness_maps((8, 9)), brightness_maps((8, 9)))
    def draw(first, second):
        assert first.any() and second.any() and min(first.min(), second.min()) >= 0
        uneven = min(len(np.unique(of)) for of in (first, second)) > 1
        found.append(uneven and not np.allclose(first / first.max(), second / second.max()))

    draw()
    assert np.mean(found) > 0.5


# --- motions that change nothing -------------------------------------------------------------------------------


def moved(scene: Scene, sign: tuple[int, int], flips: str) -> Scene:
    """The whole set-up with X and Y multiplied by sign. flips: the axes of devices' frames that turn round with it."""

    def point(at):
        return (sign[0] * at[0], sign[1] * at[1], at[2])

    def parity(noll):
        n, m = index_to_nm(noll, "noll")
        y = -1 if m < 0 else 1  # a sine term is odd in y
        return sign[1] ** (y < 0) * sign[0] ** ((n % 2 == 1) != (y < 0))

    zernike = tuple(
        replace(terms, coefficients_um={j: c * parity(j) for j, c in terms.coefficients_um.items()})
        for terms in scene.mirror.zernike
    )
    look = {part: point(getattr(scene, part).look_at_mm) for part in ("screen", "camera")}
    place = {part: point(getattr(scene, part).position_mm) for part in ("screen", "camera")}
    u, v = scene.screen.centre_offset_mm
    offset = (-u if "x" in flips else u, -v if "y" in flips else v)
    return replace(
        scene,
        mirror=replace(scene.mirror, zernike=zernike),
        screen=replace(scene.screen, position_mm=place["screen"], look_at_mm=look["screen"], centre_offset_mm=offset),
        camera=replace(scene.camera, position_mm=place["camera"], look_at_mm=look["camera"]),
    )


def flipped(values: np.ndarray, axis: str, flips: str) -> np.ndarray:
    """Curves [rows, columns, lines] of the scan along an axis ("": no scan) with the devices' axes `flips` turned."""
    along = [k for k, name in ((0, "y"), (1, "x")) if name in flips] + ([2] if axis and axis in flips else [])
    return np.flip(values, along)


def assert_flipped(device, scene: Scene, other: Scene, flips: str) -> None:
    """Chief rays but for rounding, every pixel's adjoint rays in every line within counting."""
    rows, columns = np.indices(ChiefRays(scene).shape)
    landed, other_landed = (np.stack(ChiefRays(of).reverse(rows, columns)[1:]) for of in (scene, other))
    for k, axis in enumerate("xy"):
        sign = -1 if axis in flips else 1
        back = flipped(other_landed[k][..., None], "", flips)[..., 0]
        np.testing.assert_allclose(landed[k], sign * back, rtol=0, atol=1e-9)  # mm: rounding at 3 m
    runs = [traced(of, device, rays_per_pixel=4096, replicates=1, seed=6 + k) for k, of in enumerate((scene, other))]
    p = []
    for axis in "xy":
        hits = [np.rint(curves(run, axis)[0] / one_hit_w(run)).astype(int) for run in runs]
        p.append(poisson_ratio_p(hits[0], flipped(hits[1], axis, flips), np.array(0.5)).ravel())
    assert runs[0].ledger["launched"] == runs[1].ledger["launched"]
    p = np.concatenate(p)  # binomial counts scatter less than Poisson's: on the safe side
    assert p.min() > sidak_p(EXAMPLES * 2 * 64 * 12, FAILURE_CHANCE)  # pixels and lines at most


@some_scenes
@given(scenes(mirrors(OF_REVOLUTION)))
def test_half_a_turn_about_the_mirrors_axis_turns_the_images(device, scene):
    assert_flipped(device, scene, moved(scene, (-1, -1), "xy"), "xy")


@some_scenes
@given(scenes())
def test_a_mirror_image_in_y_flips_the_images_rows(device, scene):
    """Off-axis segments too: the parent's axis stays where it is."""
    assert_flipped(device, scene, moved(scene, (1, -1), "y"), "y")


PLANE = st.just(Mirror(radius_mm=1e12, diameter_mm=4000.0))


@some_scenes
@given(scenes(PLANE, view_mm=150.0), between(-300, 300), between(-300, 300), st.booleans())
def test_a_plane_mirror_may_be_used_anywhere(device, scene, along_x, along_y, smoothing):
    """The same random words, so the same rays but for rounding."""

    def shifted(part):
        place, look = ((at[0] + along_x, at[1] + along_y, at[2]) for at in (part.position_mm, part.look_at_mm))
        return replace(part, position_mm=place, look_at_mm=look)

    other = replace(scene, screen=shifted(scene.screen), camera=shifted(scene.camera))
    runs = [traced(of, device, smoothing=smoothing, replicates=1) for of in (scene, other)]
    for axis in "xy":
        first, second = (curves(run, axis)[0] for run in runs)
        assert first.any()
        # two rays of 16 000: single precision rounds places of 2 m by 1e-4 mm, lines are 10 mm and wider
        assert np.abs(first - second).sum() < 3e-4 * first.sum()


@some_scenes
@given(scenes(), st.sampled_from([2.0, 0.25]))
def test_a_scene_of_twice_the_size_gives_the_same_bits(device, scene, factor):
    """A power of two scales every length without rounding; flux grows with its square."""

    def scaled(part, **also):
        lengths = {name: value for name, value in vars(part).items() if name.endswith("_mm") and value is not None}
        sizes = {
            name: tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
            for name, value in lengths.items()
        }
        return replace(part, **sizes, **also)

    deviation = tuple(
        scaled(terms, coefficients_um={j: factor * c for j, c in terms.coefficients_um.items()})
        for terms in scene.mirror.zernike
    )
    camera = scaled(scene.camera, detector=scaled(scene.camera.detector))
    other = replace(scene, mirror=scaled(scene.mirror, zernike=deviation), screen=scaled(scene.screen), camera=camera)
    for estimator, smoothing in ALL.values():
        options = {"estimator": estimator, "smoothing": smoothing, "rays_per_pixel": 256}  # every ray is compared
        first, second = (traced(of, device, **options) for of in (scene, other))
        assert first.ledger == second.ledger
        for axis in "xy":
            np.testing.assert_allclose(
                curves(second, axis), factor**2 * curves(first, axis), rtol=1e-13
            )  # float64 sums
