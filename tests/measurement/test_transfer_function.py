"""The closed form of the transfer function, factor by factor, and against whole simulated tests of rippled mirrors.

The simulated tests trace float64 rays to the true surface through pixels and aperture, make the images of the lines or
fringes from their light, and measure them by the normal chain. They share no formula with the closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from ripples import RippledSetup, SineDeparture, fringe_stack, line_images, wave_fit
from scenes import coarse, with_part

from irtscots_cl.measurement.fringe_light import place_mm, places_of_light
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import screen_coordinates
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.measurement.transfer_function import TransferFunction, wrapped
from irtscots_cl.measurement.transfer_geometry import whole_pixels
from irtscots_cl.optics.setup import Setup

AMPLITUDE_MM, PHASE = 5e-6, 0.3
EXACT = 0.01  # of the response
PHASE_RAD = 5e-3


@cache
def setup_of(name: str, pixels: int = 41) -> Setup:
    """Presets with larger pixels; "blurred": the sphere with a wide aperture, focused far before the mirror."""
    if name == "blurred":
        scene = with_part(coarse("sphere", pixels).nominal(), "screen", pixels=(151, 151))
        return Setup(with_part(scene, "camera", focus_distance_mm=2500.0, aperture_diameter_mm=20.0))
    if name == "fine lines":  # so many that plain centroids follow the light
        return Setup(with_part(coarse("sphere", pixels).nominal(), "screen", pixels=(81, 81), pitch_mm=0.05))
    if name == "fringes":
        return Setup(with_part(setup_of("blurred", pixels).scene, "screen", pixels=(401, 401), pitch_mm=0.075))
    return Setup(coarse(name, pixels).nominal())


@dataclass(frozen=True)
class Chain:
    """A way to measure. fringes: periods over the screen, or None for line scans by the measure."""

    measure: str
    fringes: float | None = None

    def result(self, setup: Setup, ripple) -> Reconstruction:
        rippled = RippledSetup(setup.scene, ripple)
        if self.fringes is None:
            return measure_by(self.measure, line_images(rippled), setup)
        mask = whole_pixels(setup)
        found, _ = places_of_light(screen_coordinates(fringe_stack(rippled, (self.fringes,)), mask=mask), setup)
        error = np.where(mask, 1e-3, np.nan)
        places = ScreenPlaces(*(place_mm(found.axes[axis], setup) for axis in "xy"), error, error)
        return surface_from_places(places, setup, method="cubic", pixel_average=False)


@cache
def without_ripple(chain: Chain, name: str) -> Reconstruction:
    return chain.result(setup_of(name), None)


def compared(chain: Chain, name: str, ratio: float, angle_deg: float) -> tuple[complex, complex]:
    """Measured over predicted amplitudes of slope and height; ratio: of the period to a pixel.

    The closed form varies over the mirror, so both sides are fitted over the same part of it.
    """
    setup = setup_of(name)
    transfer = TransferFunction.of(setup, chain.measure, chain.fringes)
    middle = transfer.geometry(transfer.nearest())
    way = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    k = 2 * np.pi / (ratio * np.abs(middle.pixel).max()) * way
    before = without_ripple(chain, name)
    after = chain.result(setup, SineDeparture.one(k, AMPLITUDE_MM, PHASE, setup.scene.mirror.diameter_mm / 2))
    mask = before.mask & after.mask & whole_pixels(setup)
    response = transfer.response(transfer.geometry(np.flatnonzero(mask)), k[None])
    x, y = before.x_mm, before.y_mm
    angle = k[0] * x[mask] + k[1] * y[mask] + PHASE
    slope = (after.slope_x - before.slope_x) * way[0] + (after.slope_y - before.slope_y) * way[1]
    pairs = (
        (slope / (AMPLITUDE_MM * np.hypot(*k)), -np.sin(angle) * response.slope[:, 0]),
        ((after.deviation_mm - before.deviation_mm) / AMPLITUDE_MM, np.cos(angle) * response.height[:, 0]),
    )
    ratios = []
    for measured, closed_form in pairs:
        predicted = np.full(mask.shape, np.nan)
        predicted[mask] = closed_form
        ratios.append(wave_fit(x, y, measured, mask, k, PHASE) / wave_fit(x, y, predicted, mask, k, PHASE))
    return ratios[0], ratios[1]


RATIOS = np.geomspace(2.15, 12.0, 12).round(3)  # of the period to a pixel


def check(chain: Chain, name: str, ratio: float, angle_deg: float) -> None:
    for found in compared(chain, name, ratio, angle_deg):
        assert abs(found) == pytest.approx(1.0, abs=EXACT)
        assert abs(np.angle(found)) < PHASE_RAD


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [0.0, 55.0])
@pytest.mark.parametrize(
    "ratio",
    [pytest.param(ratio, marks=pytest.mark.long if n % 4 else ()) for n, ratio in enumerate(RATIOS)],
)
@pytest.mark.parametrize("measure, name", [
    ("paper", "off-axis"), ("fine", "sphere"),
    *(pytest.param(*case, marks=pytest.mark.long)
      for case in (("paper", "fine lines"), ("fine", "blurred"), ("fine", "off-axis"))),
])  # fmt: skip
def test_simulated_tests_show_ripples_as_the_closed_form_says(measure, name, ratio, angle_deg):
    check(Chain(measure), name, ratio, angle_deg)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [3.436, 4.697])
def test_where_lines_are_coarse_their_gain_varies_over_the_mirror(ratio):
    """By 6 %: slopes are as the closed form says, heights get waves beside the ripple's own."""
    slope, height = compared(Chain("paper"), "sphere", ratio, 0.0)
    assert abs(slope - 1) < EXACT and abs(height - 1) < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [0.0, 55.0])
@pytest.mark.parametrize("ratio", [2.3, 4.0, 9.0])
def test_so_do_fringes_of_which_the_light_leaves_two_fifths(ratio, angle_deg):
    check(Chain("fringes", 1.2), "fringes", ratio, angle_deg)


@pytest.mark.slow
@pytest.mark.parametrize("ratio, angle_deg, off", [(2.15, 0.0, 1e-2), (5.0, 0.0, 3e-2), (5.0, 55.0, 3e-2),
                                                   (12.0, 55.0, 5e-3)])  # fmt: skip
def test_refinement_restores_what_its_model_follows(ratio, angle_deg, off):
    """Exact where the model follows the whole wave or nothing of it; between, as good as a mean share can be."""
    slope, height = compared(Chain("refined"), "sphere", ratio, angle_deg)
    assert abs(slope) == pytest.approx(1.0, abs=off) and abs(height) == pytest.approx(1.0, abs=off)


def one_pixel(name: str, measure: str = "paper", fringes: float | None = None, **part):
    transfer = TransferFunction.of(setup_of(name, 21), measure, fringes)
    number = np.flatnonzero(whole_pixels(transfer.setup))[5:6]  # near the rim, where nothing is symmetric
    return transfer, transfer.geometry(number)


def rays_of(setup: Setup, number: int):
    """Mirror points [q, 2], places [q, 2] and weights [q] of a pixel's light, by Gauss points and rings."""
    node, weight = np.polynomial.legendre.leggauss(8)
    ring = np.sqrt((node + 1) / 2)
    angle = 2 * np.pi * (np.arange(12) + 0.5) / 12
    s, t, r, w = (v.ravel() for v in np.meshgrid(node, node, ring, angle, indexing="ij"))
    shares = [v.ravel() for v in np.meshgrid(weight, weight, weight, np.ones(12), indexing="ij")]
    radius = setup.scene.camera.aperture_diameter_mm / 2
    row, column = np.divmod(number, setup.chief_rays.shape[1])
    point, u, v = setup.chief_rays.reverse(row + t / 2, column + s / 2, radius * r * np.cos(w), radius * r * np.sin(w))
    share = np.prod(shares, axis=0)
    return point[:, :2], np.stack([u, v], -1), share / share.sum()


@pytest.mark.parametrize("name", ["sphere", "blurred"])
def test_footprint_and_aperture_are_the_mean_of_the_wave_over_rays(name):
    transfer, geometry = one_pixel(name)
    points, _, share = rays_of(transfer.setup, int(geometry.number[0]))
    size = 2 * np.pi / np.abs(geometry.pixel).max()
    k = size * np.array([[0.3, 0.0], [0.0, 0.45], [0.35, -0.3]])
    mean = share @ np.exp(1j * (points - share @ points) @ k.T)
    found = transfer.response(geometry, k)
    np.testing.assert_allclose((found.footprint * found.aperture)[0], mean.real, atol=2e-3)
    assert np.abs(mean.imag).max() < 2e-3
    assert (found.aperture < 0.99).any() == (name == "blurred")


def test_fringes_weigh_the_mean_by_their_phase():
    """The phase of the mean of exp(i w u) changes by the mean of w du, weighted with exp(i w u) over its mean."""
    transfer, geometry = one_pixel("fringes", fringes=1.2)
    points, places, share = rays_of(transfer.setup, int(geometry.number[0]))
    k = np.array([2 * np.pi / np.abs(geometry.pixel).max() * 0.4, 0.0])
    screen = transfer.setup.scene.screen
    w = 2 * np.pi * 1.2 / (screen.pixels[0] * screen.pitch_xy_mm[0])
    fringe = np.exp(1j * w * (places[:, 0] - share @ places[:, 0]))
    weights = np.real(share * fringe / (share @ fringe))
    wanted = weights @ np.exp(1j * (points - share @ points) @ k)
    found = transfer.response(geometry, k[None])
    assert found.slope[0, 0] / found.sharpening[0, 0] == pytest.approx(wanted.real, rel=3e-3)
    assert found.display[0, 0] > 1.01  # the aperture's rim counts less
    assert transfer.modulation(geometry)[0, 0] == pytest.approx(abs(share @ fringe), rel=3e-3)


def test_factors_multiply_and_slow_waves_pass():
    for measure in ("paper", "fine"):
        transfer, geometry = one_pixel("off-axis", measure)
        k = np.array([[1e-4, 2e-4], [0.03, 0.02]])
        found = transfer.response(geometry, k)
        product = found.footprint * found.aperture * found.display * found.sharpening
        np.testing.assert_allclose(found.slope, product, rtol=1e-12)
        np.testing.assert_allclose(found.height, product * found.integration, rtol=1e-12)
        gain = geometry.line_gain.mean() if measure == "paper" else 1.0
        assert found.height[0, 0] == pytest.approx(gain, abs=1e-3)


def test_waves_beyond_the_grid_are_their_aliases():
    transfer, geometry = one_pixel("sphere")
    k = geometry.waves(np.array([[[4.5, 0.2]]]))[0]
    found = transfer.response(geometry, k)
    assert found.aliased[0, 0]
    alias = geometry.waves(wrapped(found.turns))[0]
    np.testing.assert_allclose(geometry.turns(alias)[0, 0], [4.5 - 2 * np.pi, 0.2], atol=1e-9)
    assert not transfer.response(geometry, alias).aliased[0, 0]


def test_diffraction_is_that_of_a_round_aperture():
    """Half the frequency of the cut-off D / wavelength leaves 0.391; beyond it nothing is left."""
    setup = setup_of("sphere", 21)
    transfer = TransferFunction.of(setup, wavelength_nm=550.0)
    geometry = transfer.geometry(transfer.nearest())
    distance = np.linalg.norm(setup.scene.camera.position_mm)
    cutoff = setup.scene.camera.aperture_diameter_mm / (550e-6 * distance)  # 1/mm at the mirror's centre
    k = 2 * np.pi * cutoff * np.array([[0.0, 0.5], [0.0, 1.01], [0.0, 1e-6]])
    np.testing.assert_allclose(transfer.response(geometry, k).diffraction[0], [0.391, 0.0, 1.0], atol=2e-3)


def test_the_model_of_a_measure_that_refines_follows_slow_waves_alone():
    transfer = TransferFunction.of(setup_of("sphere", 41), "refined")
    geometry = transfer.geometry(transfer.nearest())
    k = 2 * np.pi * np.array([[1 / 2000.0, 0.0], [1 / 65.0, 0.0]])
    found = transfer.response(geometry, k)
    np.testing.assert_allclose(found.model[0], [1.0, 0.0], atol=0.02)
    assert found.height[0, 0] == pytest.approx(1.0, abs=1e-6)


def test_refusals():
    scene = setup_of("sphere", 21).scene
    with pytest.raises(ValueError, match="measure = 'best': must be one of paper"):
        TransferFunction.of(scene, "best")
    with pytest.raises(ValueError, match="fringes = 0: must be above 0"):
        TransferFunction.of(scene, fringes=0)
    with pytest.raises(ValueError, match="wavelength_nm = 0.5: must be from 1 to 1e6"):
        TransferFunction.of(scene, wavelength_nm=0.5)
    one = with_part(scene, "camera", detector=replace(scene.camera.detector, pixels=(1, 1), pitch_mm=5.0))
    with pytest.raises(ValueError, match="no detector pixel lies on the mirror as a whole"):
        TransferFunction.of(one).nearest()
