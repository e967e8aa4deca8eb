"""Tracing: absolute radiometry, bookkeeping, reproducibility, independence of how the work is cut."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from device_kernels import FOLDER, SmallKernel, kernel_text, launch_of
from lopsided import lopsided
from oracle import tracer
from real_setup import real_setup
from scenes import coarse, rim_view, with_part
from scipy import stats
from significance import sidak_p
from tracers import totals, tracer_of

from irtscots_cl.execution import run_loop as runner
from irtscots_cl.execution.launch_plan import plan_launches
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.screen_windows import place_windows
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.options import ESTIMATORS, TraceOptions
from irtscots_cl.tracing.packing.sources import emitters, receivers
from irtscots_cl.tracing.samplers import SAMPLERS
from irtscots_cl.tracing.trace import trace

module = import_module("irtscots_cl.tracing.estimators.sequential")
FIVE_SIGMA = 5.0  # two-sided failure chance 6e-7


# --- radiometry --------------------------------------------------------------------------------------------


def test_estimators_agree_on_a_close_view_of_the_rim(device):
    """The camera looks away from the vertex; by path, the light that comes by way of the mirror is the same."""
    scene = rim_view()
    adjoint = trace(scene, device=device, rays_per_pixel=512)
    assert adjoint.ledger["detected"] == adjoint.rays_total  # so the flux is that of a screen without end
    expected = flux_of_pixels(scene, *np.divmod(np.arange(225), 15)).sum()
    assert adjoint.line_flux_w("x").mean(0).sum() == pytest.approx(expected, rel=1e-3)  # single precision, cos^4
    forward = trace(scene, device=device, rays_per_pixel=2**17, estimator="forward")
    flux = [forward.line_flux_w("x")[k].sum() for k in range(8)]
    # Student's t with 7 degrees of freedom beyond 6: failure chance 5e-4, with a fixed seed
    assert abs(np.mean(flux) - expected) < 6 * np.std(flux, ddof=1) / 8**0.5 and np.std(flux) < 0.3 * expected


def test_forward_rays_of_a_screen_with_mirror_behind_it_are_refused(device):
    scene = with_part(rim_view(), "screen", look_at_mm=(720.0, 0.0, 179.0))
    with pytest.raises(ValueError, match="^scene rim: estimator forward: part of the mirror is behind the screen's"):
        trace(scene, device=device, estimator="forward")


def flux_of_pixels(scene, row, column):
    """Flux [n] on pixels [n] that see nothing but lit screen.

    Radiance x integral of cos^4 / z^2 over aperture and pixel by Gauss quadrature; z is the image distance,
    the angle that of the ray in front of the lens.
    """
    camera = scene.camera
    node, weight = np.polynomial.legendre.leggauss(4)
    angle = np.arange(12) * np.pi / 6
    radius = np.sqrt((node + 1) / 2) * camera.aperture_diameter_mm / 2  # uniform in area: nodes in radius^2
    aperture = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], -1).reshape(-1, 2)
    aperture_weight = np.repeat(weight / 2, 12) / 12
    columns, rows = camera.detector.pixels
    total = np.zeros(len(row))
    _, _, z = tracer.device_axes(camera.position_mm, camera.look_at_mm)
    for step_x, weight_x in zip(node / 2, weight / 2, strict=True):
        for step_y, weight_y in zip(node / 2, weight / 2, strict=True):
            image = np.stack([column - (columns - 1) / 2 + step_x, row - (rows - 1) / 2 + step_y], -1)
            point = tracer.focus_point(camera, image * camera.detector.pitch_mm)
            ray = point[:, None, :] - tracer.from_plane(camera, aperture)
            cosine = -(ray @ z) / np.linalg.norm(ray, axis=-1)
            total += weight_x * weight_y * (cosine**4 @ aperture_weight)
    area = np.pi / 4 * camera.aperture_diameter_mm**2 * camera.detector.pitch_mm**2
    gain = scene.screen.radiance * scene.mirror.reflectance * camera.transmittance
    return gain * area * total / tracer.image_distance(camera) ** 2


def inner_pixels(scene):
    """Flat numbers of the pixels that see nothing but mirror through every point of the aperture."""
    coverage = np.pad(ChiefRays(scene).footprint.coverage == 1, 1)
    return np.flatnonzero(
        np.logical_and.reduce(
            [
                coverage[1 + i : coverage.shape[0] - 1 + i, 1 + j : coverage.shape[1] - 1 + j]
                for i in (-1, 0, 1)
                for j in (-1, 0, 1)
            ]
        )
    )


def test_flux_integral_gives_the_stated_value():
    scene = load_scene("sphere")
    assert flux_of_pixels(scene, np.array([62]), np.array([62]))[0] == pytest.approx(4.168e-6, rel=1e-4)  # its digits


@pytest.mark.parametrize(
    ("estimator", "overfill", "rays"),
    [("forward", 1.0, 2**19), ("forward", 3.4, 2**18), ("adjoint", 1.0, 2**12)],
)
def test_absolute_flux(device, estimator, overfill, rays):
    scene = load_scene("sphere")
    run = trace(
        scene,
        device=device,
        estimator=estimator,
        rays_per_pixel=rays,
        replicates=8,
        seed=11,
        overfill=overfill,
    )
    inner = inner_pixels(scene)
    assert len(inner) > 9000
    of_replicate = np.stack([run.flux_w(r).sum((1, 2)) for r in range(8)])
    visible_pixel = np.searchsorted(run.windows.pixels, inner)
    np.testing.assert_array_equal(run.windows.pixels[visible_pixel], inner)
    row, column = np.divmod(inner, 125)
    exact = flux_of_pixels(scene, row, column)
    rounding = 3e-7  # of fixed-point weights (2^-25 each) and of cos^4 in single precision

    centre = of_replicate[:, visible_pixel[inner == 62 * 125 + 62]][:, 0]
    mean, error = centre.mean(), centre.std(ddof=1) / np.sqrt(8)
    # 10 standard errors of eight replicates: Student's t with 7 degrees, failure chance 2e-5
    assert abs(mean - exact[inner == 62 * 125 + 62][0]) < 10 * error + rounding * mean
    assert error < (0.1 if estimator == "forward" else 1e-4) * mean  # the check means something

    # Each pixel relative to its own value, all of them together: Student's t as above
    ratio = (of_replicate[:, visible_pixel] / exact).mean(1)
    error = ratio.std(ddof=1) / np.sqrt(8)
    assert abs(ratio.mean() - 1) < 10 * error + rounding
    assert error < (2e-3 if estimator == "forward" else 1e-6)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_radiance_reflectance_and_transmittance_scale_the_flux(device, estimator):
    scene = coarse()
    options = {"device": device, "estimator": estimator, "rays_per_pixel": 256, "replicates": 2}
    plain = trace(scene, **options)
    for part, changes, factor in [
        ("screen", {"radiance": 3.0}, 3.0),
        ("mirror", {"reflectance": 0.9}, 0.9),
        ("camera", {"transmittance": 0.25}, 0.25),
    ]:
        scaled = trace(with_part(scene, part, **changes), **options)
        np.testing.assert_array_equal(scaled.counts, plain.counts)
        np.testing.assert_allclose(scaled.flux_w(), factor * plain.flux_w(), rtol=1e-15)  # rounding


# --- bookkeeping -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("scene", [coarse(), lopsided()], ids=lambda scene: scene.name)
def test_the_ledger_closes_and_names_every_loss(device, scene, estimator):
    run = trace(scene, device=device, estimator=estimator, rays_per_pixel=2000, replicates=3)
    ledger = dict(run.ledger)
    launched = ledger.pop("launched")
    columns, rows = scene.screen.pixels
    assert launched == run.rays_total == 2000 * (columns * rows if estimator == "forward" else len(run.windows.pixels))
    assert sum(ledger.values()) == launched
    assert ledger["failed"] == ledger["absorbed"] == 0
    assert list(run.rays) == [667, 667, 666]
    if estimator == "forward":
        assert ledger["detected"] == run.counts.sum()
        assert ledger["clipped"] > 0 and ledger["missed_mirror"] > 0
    else:
        assert ledger["clipped"] == ledger["off_detector"] == 0 and ledger["missed_mirror"] > 0
        weights = run.counts.sum() / WEIGHT_ONE
        assert weights == pytest.approx(ledger["detected"], rel=0.02)  # cos^4 over the coarsest pixel
    beside = {"forward": "off_detector", "adjoint": "off_screen"}[estimator]
    assert (ledger[beside] > 0) == (scene.name == "lopsided")


def test_shapes_and_descriptions(device):
    scene = lopsided()
    run = trace(scene, device=device, rays_per_pixel=100, replicates=4, seed=5)
    n, (_, _, window_rows, window_columns) = len(run.windows.pixels), run.counts.shape
    assert run.counts.shape[:2] == (4, n) and run.windows.origins.shape == (n, 2) and run.counts.dtype == np.uint64
    assert run.flux_w().shape == run.standard_error_w().shape == (n, window_rows, window_columns)
    assert (run.windows.origins >= 0).all() and (
        np.add(run.windows.origins, [window_columns, window_rows]) <= scene.screen.pixels
    ).all()
    assert (np.diff(run.windows.pixels) > 0).all()
    assert run.replicates == 4 and run.options.seed == 5 and run.device == device.describe() and run.scene is scene
    assert run.seconds["trace"] > 0 and run.seconds["build"] > 0
    np.testing.assert_allclose(np.mean([run.flux_w(r) for r in range(4)], axis=0), run.flux_w(), rtol=1e-13)  # rounding
    one = trace(scene, device=device, rays_per_pixel=10, replicates=1)
    assert np.isnan(one.standard_error_w()).all()


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_progress_ends_at_all_rays(device, estimator):
    seen = []
    run = trace(
        coarse(),
        device=device,
        estimator=estimator,
        rays_per_pixel=300,
        replicates=2,
        launch_rays=20_000,
        progress=lambda done, total: seen.append((done, total)),
    )
    done, totals = zip(*seen, strict=True)
    assert len(done) > 4 and list(done) == sorted(set(done))
    assert done[-1] == run.rays_total and set(totals) == {run.rays_total}


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("estimator", "backward", "estimator = 'backward': must be one of forward, adjoint"),
        ("sampler", "halton", "sampler = 'halton': must be one of "),
        ("replicates", 0, "replicates = 0: must be 1 to 1024"),
        ("replicates", 1025, "replicates = 1025: must be 1 to 1024"),
        ("rays_per_pixel", 7, "rays_per_pixel = 7: must be at least the 8 replicates"),
        ("rays_per_pixel", 2**40 + 1, "rays_per_pixel = 1099511627777: must be "),
        ("seed", -1, "seed = -1: must be 0 to "),
        ("seed", 2**64, "seed = 18446744073709551616: must be 0 to "),
        ("overfill", 0.99, "overfill = 0.99: must be 1 to 10000"),
        ("overfill", float("nan"), "overfill = nan: must be 1 to 10000"),
        ("precision", "fp16", "precision = 'fp16': must be one of fp32, fp64"),
    ],
)
def test_arguments_out_of_range_are_refused(device, option, value, message):
    with pytest.raises(ValueError, match="must be") as caught:
        trace(load_scene("sphere"), device=device, **{option: value})
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


def test_a_dark_scene_is_refused(device):
    scene = with_part(load_scene("sphere"), "screen", centre_offset_mm=(30.0, 0.0))
    with pytest.raises(SceneError, match="scene sphere: screen.position_mm"):
        trace(scene, device=device)


def test_double_precision_is_refused_where_there_is_none(device, monkeypatch):
    monkeypatch.setattr(type(device), "has_fp64", False)
    with pytest.raises(DeviceError, match="fp64: device .* has no double precision"):
        trace(coarse(), device=device, precision="fp64")


# --- the same result, however the work is cut --------------------------------------------------------------


@pytest.fixture(
    params=[("forward", "coarse"), ("adjoint", "coarse"), ("forward", "lopsided"), ("adjoint", "lopsided")],
    ids="-".join,
)
def whole(request, device):
    """(options, run) of a trace in one launch per replicate."""
    estimator, name = request.param
    scene = lopsided() if name == "lopsided" else coarse()
    options = {
        "scene": scene,
        "device": device,
        "estimator": estimator,
        "rays_per_pixel": 2500,
        "replicates": 2,
        "seed": 3,
    }
    return options, trace(**options, launch_rays=10**9)


def same(first, second):
    np.testing.assert_array_equal(first.counts, second.counts)
    np.testing.assert_array_equal(first.windows.origins, second.windows.origins)
    assert first.ledger == second.ledger


@pytest.mark.parametrize(
    ("launch_rays", "per_item"), [(None, 2**18), (50_000, 2**18), (5000, 700), (200_000, 512), (10**9, 90)]
)
def test_counts_do_not_depend_on_the_launches(whole, monkeypatch, launch_rays, per_item):
    options, run = whole
    monkeypatch.setattr(module.SequentialTask, "max_rays_per_item", per_item)
    same(trace(**options, launch_rays=launch_rays), run)


def test_counts_do_not_depend_on_the_accumulation(whole, device, monkeypatch):
    if device.kind != "cpu":
        pytest.skip("this device accumulates by atomics only")
    options = whole[0] | {"rays_per_pixel": 5000}
    tiled = trace(**options)
    monkeypatch.setattr(module, "MAX_TILE_BYTES", 0)
    same(trace(**options), tiled)
    scene = options["scene"]
    sources = [tracer_of(scene, device, tiled.options, accumulate=kind).program.source for kind in (None, "atomic")]
    assert sources[0] == sources[1]  # without room for a tile it is the atomic one


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("scene", [coarse(), lopsided(), real_setup()], ids=lambda scene: scene.name)
def test_counts_do_not_depend_on_the_rays_side_by_side(device, scene, sampler, estimator):
    """The kernels of GPUs, one ray per work-item and atomics, on a CPU: the same rays one by one."""
    if device.vector_width("fp32") == 1:
        pytest.skip("this device traces one ray per work-item anyway")
    options = TraceOptions(estimator, sampler, seed=3)
    rays = np.array([300, 270])  # not whole blocks
    wide = tracer_of(scene, device, options)
    narrow = tracer_of(scene, device, options, width=1, accumulate="atomic")
    assert "simd_vector.cl" in wide.program.source.files and "simd_scalar.cl" in narrow.program.source.files
    (counts, fates), (one_by_one, fates_one_by_one) = (totals(tracer, rays) for tracer in (wide, narrow))
    assert fates.sum() == fates_one_by_one.sum() == rays.sum() * wide.sources
    # The compiler may contract other products here than there: fewer than 1e-3 of the rays lie so close to an edge
    moved = np.abs(one_by_one.astype(float) - counts).sum()
    assert moved <= 1e-3 * counts.sum()
    assert np.abs(fates_one_by_one.astype(float) - fates).max() <= 1e-3 * fates.sum()
    assert counts.any(axis=(1, 2, 3)).all()


def test_64_bit_sums_carry(device, tmp_path):
    generator = np.random.default_rng(13)
    amounts = generator.integers(0, 2**34, 4096, dtype=np.uint64)
    amounts[:12] = [0, 1, 2**32 - 1, 2**32, 2**32 - 1, 1, 2**63, 2**32, 2**24, 2**31, 2**31, 2**62]
    body = "    sum64_add(sums, get_global_id(0) % 3, amounts[get_global_id(0)]);"
    entry = kernel_text(
        tmp_path / "add.cl",
        ["simd_*.cl", "sum64.cl"],
        "__global const ulong *amounts, __global uint *sums",
        body,
    )
    (sums,) = SmallKernel(device, entry, "fp32", width=1).run((4096, 1), [amounts], [np.zeros(3, np.uint64)])
    expected = [sum(map(int, amounts[k::3])) % 2**64 for k in range(3)]
    assert list(map(int, sums)) == expected


def test_same_seed_same_bits_and_another_seed_others(whole):
    options, run = whole
    same(trace(**options), run)
    for other in (4, 3 + 2**32):  # both words of the seed count
        changed = trace(**options | {"seed": other})
        assert not np.array_equal(changed.counts, run.counts)
        assert changed.ledger["launched"] == run.ledger["launched"]


def test_replicates_differ_and_begin_alike(whole):
    options, run = whole
    assert not np.array_equal(run.counts[0], run.counts[1])
    alone = trace(**options | {"replicates": 1, "rays_per_pixel": 1250})
    np.testing.assert_array_equal(alone.counts[0], run.counts[0])  # the first replicate does not know of the second


def test_windows_grow_until_they_hold_all_light(whole, monkeypatch):
    options, run = whole
    asked = []

    def beside_at_first(chief, margin):
        asked.append(margin)
        windows = place_windows(chief, margin)
        aside = np.maximum(windows.origins - np.array([3, 0]), 0).astype(np.int32)
        return replace(windows, origins=aside) if margin == 1 else windows

    monkeypatch.setattr("irtscots_cl.optics.setup.place_windows", beside_at_first)
    grown = trace(**options)
    assert asked == [1, 2]
    assert grown.counts.sum() == run.counts.sum() and grown.ledger == run.ledger
    np.testing.assert_array_equal(grown.counts.sum((2, 3)), run.counts.sum((2, 3)))


def test_precisions_agree_but_for_rays_at_the_edges_of_bins(whole, device):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    options, run = whole
    double = trace(**options, precision="fp64")
    moved = np.abs(double.counts.astype(float) - run.counts).sum() / run.counts.sum()
    assert moved < 5e-3  # 0.2 um of a 200 um bin at both edges of both axes: 4e-3


# --- rays one by one ---------------------------------------------------------------------------------------


FAR = 2**33 + 12_345
RAYS = 768


@pytest.fixture(params=[0, FAR], ids=["near", "beyond 2^33"])
def start(request, monkeypatch):
    """The number of the first ray of every source that a trace takes."""
    monkeypatch.setattr(
        runner,
        "plan_launches",
        lambda *given: (block._replace(first_ray=block.first_ray + request.param) for block in plan_launches(*given)),
    )
    return request.param


def ray_by_ray(device, scene, name, sources, chosen, fields, marks, first_ray):
    kernel = SmallKernel(device, FOLDER / f"{name}.cl", "fp32", scene)
    outputs = [
        np.zeros((len(chosen), RAYS, fields), kernel.real),
        np.zeros((len(chosen), RAYS, marks), np.int32),
    ]
    launch = launch_of(seed_low=3, first_ray=first_ray)
    inputs = [kernel.tables, launch, sources, chosen]
    return kernel.run((len(chosen), RAYS // kernel.block), inputs, outputs)


@pytest.mark.parametrize("scene", [coarse(), lopsided(), real_setup()], ids=lambda scene: scene.name)
def test_forward_counts_are_the_rays_that_came_through(device, scene, start):
    run = trace(scene, device=device, estimator="forward", rays_per_pixel=RAYS - 28, replicates=1, seed=3)
    sources, _ = emitters(Setup(scene), "fp32", 1.0, "mirror")
    chosen = np.arange(len(sources), dtype=np.uint32)
    _, marks = ray_by_ray(device, scene, "trace_paths_forward", sources, chosen, 11, 3, start)
    marks = marks[:, : RAYS - 28]
    landed = (marks[..., 1] == 1) & (marks[..., 2] >= 0)
    screen = np.broadcast_to(chosen[:, None], landed.shape)
    shape = (scene.camera.detector.pixels[0] * scene.camera.detector.pixels[1], len(sources))
    expected = np.zeros(shape, int)
    np.add.at(expected, (marks[..., 2][landed], screen[landed]), 1)

    counted = np.zeros(shape, int)
    visible_pixel, row, column = np.nonzero(run.counts[0])
    source = (
        (run.windows.origins[visible_pixel, 1] + row) * scene.screen.pixels[0]
        + run.windows.origins[visible_pixel, 0]
        + column
    )
    counted[run.windows.pixels[visible_pixel], source] = run.counts[0][visible_pixel, row, column]
    assert expected.sum() > 4000
    # The compiler may contract other products here than there: 1e-4 of the rays lie so close to an edge
    assert np.abs(counted - expected).sum() <= 1e-4 * expected.sum() + 1


@pytest.mark.parametrize("scene", [coarse(), lopsided(), real_setup()], ids=lambda scene: scene.name)
def test_adjoint_sums_are_the_weights_that_reached_each_screen_pixel(device, scene, start):
    run = trace(scene, device=device, estimator="adjoint", rays_per_pixel=RAYS - 28, replicates=1, seed=3)
    sources = receivers(ChiefRays(scene), run.windows.pixels, run.windows.origins, "fp32")
    chosen = np.linspace(0, len(sources) - 1, 200).astype(np.uint32)
    paths, marks = ray_by_ray(device, scene, "trace_paths_adjoint", sources, chosen, 10, 2, start)
    paths, marks = paths[:, : RAYS - 28].astype(float), marks[:, : RAYS - 28]
    columns, rows = scene.screen.pixels
    cursor = (paths[..., 5:7] - scene.screen.centre_offset_mm) / scene.screen.pitch_xy_mm + np.array(
        [columns, rows]
    ) / 2
    cursor = np.floor(cursor).astype(int)
    landed = marks.all(-1) & (cursor >= 0).all(-1) & (cursor < [columns, rows]).all(-1)
    expected = np.zeros((len(chosen), rows, columns))
    which = np.broadcast_to(np.arange(len(chosen))[:, None], landed.shape)
    weight = paths[..., 7] * sources["weight_scale"][chosen][:, None]
    np.add.at(expected, (which[landed], cursor[..., 1][landed], cursor[..., 0][landed]), weight[landed] / WEIGHT_ONE)

    counted = np.zeros_like(expected)
    for k, visible_pixel in enumerate(chosen):
        column, row = run.windows.origins[visible_pixel]
        window = run.counts[0, visible_pixel] / WEIGHT_ONE
        counted[k, row : row + window.shape[0], column : column + window.shape[1]] = window
    assert expected.sum() > 50_000
    # as above, and 2^-25 of fixed point per ray
    assert np.abs(counted - expected).sum() <= 1e-4 * expected.sum() + 1


# --- error bars --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_replicates_scatter_as_counts_do(device, estimator):
    """Dispersion sum (n - mean)^2 / mean over replicates, given a bin's total: R - 1 for Poisson counts.

    A share p of a detector pixel's rays lands in a bin: the adjoint's counts are binomial, 1 - p as much.
    """
    of_replicate = 8000 if estimator == "forward" else 1000
    run = trace(coarse(), device=device, estimator=estimator, rays_per_pixel=16 * of_replicate, replicates=16, seed=8)
    one = WEIGHT_ONE if estimator == "adjoint" else 1
    counts = run.counts / one
    used = counts.sum(0) >= 1
    total, counts = counts.sum(0)[used], counts[:, used]
    share = total / (16 * of_replicate) if estimator == "adjoint" else np.zeros_like(total)
    dispersion = ((counts - total / 16) ** 2).sum(0) / (total / 16) / (1 - share)
    deviation = (dispersion - 15) / np.sqrt(2 * 15 * np.maximum(1 - 1 / total, 0.02))
    assert len(total) > 3000
    # The adjoint's bins of a pixel exclude each other and so correlate a little: its limit is twice as wide.
    assert abs(deviation.sum()) / np.sqrt(len(total)) < FIVE_SIGMA * (2 if estimator == "adjoint" else 1)
    strong = total > 100
    assert strong.sum() > 1000
    chance = stats.chi2.sf(dispersion[strong].max(), 15)
    assert chance > sidak_p(int(strong.sum()), 1e-6)  # failure chance 1e-6

    error = run.standard_error_w()[used]
    poisson = np.sqrt(total * (1 - share)) * one / run.rays.sum() * np.broadcast_to(run.unit_w, used.shape)[used]
    ratio = np.mean((error[strong] / poisson[strong]) ** 2)
    spread = np.sqrt(2 / 15 / strong.sum())
    assert abs(ratio - 1) < 2 * FIVE_SIGMA * spread + 2e-3  # correlated as above; weights within 0.1 % of one another
