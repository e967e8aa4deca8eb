"""Recorded images against closed forms of mean and variance, their limits, and the same noise in any order."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from irtscots_cl.imaging.detector import (
    check_recording_memory,
    electrons_per_w,
    expose,
    mean_of_frames,
    pixel_properties,
    saturation_dn,
)
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.screen_response import frame_factors
from irtscots_cl.measurement.light_curves import Flag, flag_curves
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.screen_response import ScreenResponse

SHAPE = (60, 50)  # rows, columns
COUNT = SHAPE[0] * SHAPE[1]
LEVELS = np.array([0.0, 2e-4, 1e-3, 0.01, 0.1, 0.5, 1.0])  # of the lines, of the peak
PEAK_E = 20_000.0
PEAK_W = 3e-9
ROUNDING = 1e-12  # relative: sums and products of a few float64 numbers
SIGMAS = 4.5  # chance 7e-6; of some hundred comparisons, one in a thousand runs


def flat_stack(levels=LEVELS, shape=SHAPE) -> ImageStack:
    """Evenly lit images: of the x scan with the given levels, of the y scan with them in reverse."""
    images = np.broadcast_to(np.asarray(levels)[:, None, None] * PEAK_W, (len(levels), *shape))
    positions = np.arange(len(levels)) * 0.2
    return ImageStack(Scan.from_images("x", positions, images), Scan.from_images("y", positions, images[::-1]))


def recorded(**values) -> np.ndarray:
    """The x scan's images [exposures, lines, pixels] of a detector with these values."""
    return curves(expose(flat_stack(), DetectorNoise(**{"electrons_at_peak": PEAK_E} | values)).x)


def curves(scan: Scan) -> np.ndarray:
    return scan.flux_w.transpose(0, 2, 1)


def assert_moments(samples: np.ndarray, mean: float, variance: float):
    """Mean and variance of independent samples, within SIGMAS; the fourth moment is nearly a normal one's or larger."""
    number = samples.size
    assert abs(samples.mean() - mean) <= SIGMAS * (variance / number) ** 0.5 + ROUNDING * abs(mean)
    kurtosis = ((samples - samples.mean()) ** 4).mean() / max(samples.var() ** 2, 1e-300) if variance else 3.0
    error = variance * (max(kurtosis - 1.0, 2.0) / number) ** 0.5
    assert abs(samples.var() - variance) <= SIGMAS * error + ROUNDING * variance


# --- mean and variance --------------------------------------------------------------------------------------


def test_the_photon_transfer_curve():
    """EMVA 1288: mean = e / g + offset, variance = (e + read^2) / g^2, at every level."""
    gain, offset, read = 2.5, 100.0, 6.0
    images = recorded(shot_noise=True, read_noise_e=read, gain_e_per_dn=gain, offset_dn=offset)
    for level, image in zip(LEVELS, images[0], strict=True):
        electrons = level * PEAK_E
        assert_moments(image, electrons / gain + offset, (electrons + read**2) / gain**2)


def test_shot_noise_alone_is_whole_electrons_with_the_variance_of_the_mean():
    images = recorded(shot_noise=True)
    np.testing.assert_array_equal(images, np.rint(images))
    for level, image in zip(LEVELS, images[0], strict=True):
        assert_moments(image, level * PEAK_E, level * PEAK_E)


def test_read_noise_alone_is_normal_and_the_same_at_every_level():
    for level, image in zip(LEVELS, recorded(read_noise_e=3.0)[0], strict=True):
        assert_moments(image, level * PEAK_E, 9.0)


def test_rounding_adds_a_twelfth_where_noise_covers_a_step():
    images = recorded(read_noise_e=4.0, gain_e_per_dn=2.0, offset_dn=50.0, bits=16)
    for level, image in zip(LEVELS, images[0], strict=True):
        assert_moments(image, level * PEAK_E / 2 + 50, 4.0 + 1 / 12)


@pytest.mark.parametrize("limits", [{}, {"full_well_e": 1e6}, {"bits": 16, "gain_e_per_dn": 0.5}])
def test_the_mean_of_frames_has_the_variance_of_a_frame_over_their_number(limits):
    """Drawn at once without limits, frame by frame with them: the same moments."""
    gain = limits.get("gain_e_per_dn", 1.0)
    images = recorded(shot_noise=True, read_noise_e=5.0, offset_dn=40.0, frames_averaged=8, **limits)
    for level, image in zip(LEVELS, images[0], strict=True):
        electrons = level * PEAK_E
        frame = (electrons + 25) / gain**2 + ("bits" in limits) / 12
        assert_moments(image, electrons / gain + 40.0, frame / 8)


def test_dark_current_and_its_noise_come_with_the_exposure():
    images = recorded(shot_noise=True, exposure_s=0.5, dark_current_e_per_s=60.0)
    for level, image in zip(LEVELS, images[0], strict=True):
        assert_moments(image, level * PEAK_E + 30.0, level * PEAK_E + 30.0)
    quiet = recorded(exposure_s=0.5, dark_current_e_per_s=60.0)  # without shot noise: a level alone
    np.testing.assert_allclose(quiet[0], np.broadcast_to(LEVELS[:, None] * PEAK_E + 30.0, quiet[0].shape))


def test_dark_frames_take_the_level_away_and_leave_their_own_noise_in_every_image():
    """Mean 0; variance of an image (d + r^2) (1 / K + 1 / D), of which the D part is in all images alike."""
    values = {"shot_noise": True, "exposure_s": 1.0, "dark_current_e_per_s": 50.0, "read_noise_e": 4.0,
              "offset_dn": 200.0, "frames_averaged": 4, "dark_frames": 2, "hot_pixel_share": 0.05,
              "hot_pixel_e": 500.0}  # fmt: skip
    noise = DetectorNoise(electrons_at_peak=PEAK_E, **values)
    images = curves(expose(flat_stack(np.array([0.0] * 40 + [1.0])), noise).x)[0, :40]
    ordinary = pixel_properties(noise, SHAPE).dark_e < 51
    one_frame = 50.0 + 16.0
    assert_moments(images[0, ordinary], 0.0, one_frame * (1 / 4 + 1 / 2))
    assert_moments(images[:, ordinary].mean(0), 0.0, one_frame * (1 / 160 + 1 / 2))
    assert_moments(images[0, ~ordinary], 0.0, (one_frame + 500.0) * (1 / 4 + 1 / 2))  # the hot ones', too


def test_the_exposure_by_watts():
    """A photon of 632.8 nm has 1239.841984 / 632.8 eV; half of them become electrons."""
    noise = DetectorNoise(exposure_s=0.2, quantum_efficiency=0.5, wavelength_nm=632.8, offset_dn=1.0)
    photons = PEAK_W * 0.2 / (1239.841984 / 632.8 * 1.602176634e-19)
    images = curves(expose(flat_stack(), noise).x)[0]
    np.testing.assert_allclose(images[:, 7], LEVELS * photons / 2 + 1.0, rtol=1e-9)  # digits of the constant


def test_the_peak_is_that_of_both_scans_whatever_the_screen_shows():
    stack = flat_stack()
    brighter = ImageStack(stack.x, dataclasses.replace(stack.y, flux_w=stack.y.flux_w * 4.0))
    noise, dim = DetectorNoise(electrons_at_peak=1000.0, offset_dn=0.5), ScreenResponse(grey_level=0.5, gamma=2.0)
    for response in (None, dim):
        images = expose(brighter, noise, response)
        assert images.y.flux_w.max() == pytest.approx(1000.5, rel=ROUNDING)
        assert images.x.flux_w.max() == pytest.approx(250.5, rel=ROUNDING)
    by_watts = DetectorNoise(exposure_s=1.0, quantum_efficiency=1.0, wavelength_nm=500.0, offset_dn=0.5)
    bright, grey = (expose(stack, by_watts, response).x.flux_w.max() - 0.5 for response in (None, dim))
    assert grey == pytest.approx(bright / 4, rel=1e-9)  # a small difference of numbers near 1e10


def test_a_stack_without_light_has_no_peak_to_set_the_exposure_by():
    with pytest.raises(ValueError, match="electrons_at_peak: no frame has any light"):
        electrons_per_w(DetectorNoise(electrons_at_peak=1.0, shot_noise=True), 0.0)


# --- the pixels ---------------------------------------------------------------------------------------------


def test_prnu_is_the_rms_of_the_response_and_stays_from_frame_to_frame():
    images = recorded(prnu=0.02)
    response = images[0, -1] / PEAK_E
    assert_moments(response, 1.0, 0.02**2)
    np.testing.assert_allclose(images[0], LEVELS[:, None] * PEAK_E * response, rtol=ROUNDING)


def test_a_map_of_the_quantum_efficiency_is_the_response(tmp_path):
    path = tmp_path / "qe.npy"
    response = np.random.default_rng(1).uniform(0.2, 1.3, SHAPE)
    np.save(path, response)
    images = recorded(quantum_efficiency_map=str(path))
    np.testing.assert_allclose(images[0, -1], PEAK_E * response.ravel(), rtol=ROUNDING)


def test_dead_pixels_see_no_light_but_have_all_other_noise():
    images = recorded(dead_pixel_share=0.1, read_noise_e=2.0)
    dead = images[0, -1] < PEAK_E / 2
    assert abs(dead.mean() - 0.1) < SIGMAS * (0.1 * 0.9 / COUNT) ** 0.5
    assert_moments(images[0][:, dead], 0.0, 4.0)
    assert_moments(images[0, -1, ~dead], PEAK_E, 4.0)


def test_hot_pixels_are_the_same_in_every_frame():
    images = recorded(hot_pixel_share=0.05, hot_pixel_e=400.0, shot_noise=True)
    hot = images[0, 0] > 0
    assert abs(hot.mean() - 0.05) < SIGMAS * (0.05 * 0.95 / COUNT) ** 0.5
    for level, image in zip(LEVELS, images[0], strict=True):
        assert_moments(image[hot], level * PEAK_E + 400.0, level * PEAK_E + 400.0)


# --- numbers and limits -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "electrons", "dn"),
    [
        ({"bits": 8}, [0.0, 0.49, 0.5, 1.5, 254.4, 254.5, 1e6], [0, 0, 1, 2, 254, 255, 255]),
        ({"bits": 8, "offset_dn": 10.0, "gain_e_per_dn": 4.0}, [0.0, 5.9, 6.0, 980.0, 981.0], [10, 11, 12, 255, 255]),
        ({"bits": 12, "justification": "left"}, [0.0, 1.0, 4095.0, 5000.0], [0, 16, 65520, 65520]),
        ({"bits": 16, "justification": "left"}, [3.0, 70000.0], [3, 65535]),
        ({"bits": 12, "full_well_e": 1000.0}, [999.0, 1000.0, 1001.0], [999, 1000, 1000]),
        ({"full_well_e": 1000.0, "gain_e_per_dn": 4.0, "offset_dn": 2.0}, [999.0, 1e5], [251.75, 252.0]),
    ],
)  # fmt: skip
def test_digital_numbers_are_rounded_limited_and_justified(values, electrons, dn):
    noise = DetectorNoise(electrons_at_peak=1.0, **values)
    pixels = pixel_properties(noise, (1, len(electrons)))
    found, saturated = mean_of_frames(noise, pixels, np.array(electrons), np.ones(1), "x", 0)
    np.testing.assert_array_equal(found, dn)
    np.testing.assert_array_equal(saturated, np.array(dn) >= saturation_dn(noise))


def test_read_noise_goes_below_0_only_without_bits():
    assert recorded(read_noise_e=5.0)[0, 0].min() < 0
    assert recorded(read_noise_e=5.0, bits=14, gain_e_per_dn=4.0)[0, 0].min() == 0


@pytest.mark.parametrize(
    ("values", "limit"),
    [
        ({"bits": 12, "gain_e_per_dn": 3.0}, 4095),
        ({"bits": 12, "gain_e_per_dn": 3.0, "justification": "left"}, 65520),
        ({"full_well_e": 10_000.0, "offset_dn": 100.0}, 10_100),
        ({"full_well_e": 9_000.0, "bits": 12, "gain_e_per_dn": 3.0, "justification": "left"}, 48000),
    ],
)
def test_what_was_saturated_once_is_stored_at_the_limit_and_found(values, limit):
    """Also in a mean of frames of which few were saturated, and where dark frames are subtracted."""
    more = {"shot_noise": True, "read_noise_e": 10.0, "frames_averaged": 6, "dark_frames": 3,
            "exposure_s": 1.0, "dark_current_e_per_s": 200.0, "hot_pixel_share": 0.2, "hot_pixel_e": 2e3}  # fmt: skip
    noise = DetectorNoise(electrons_at_peak=14_000.0, **more, **values)
    most = (limit / (16 if "justification" in values else 1) - noise.offset_dn) * noise.gain_e_per_dn  # electrons
    levels = np.array([0.3, (most - 230.0) / 14_000.0, 1.0])  # far below, a few noises below the limit, above it
    scan = expose(flat_stack(levels), noise).x
    assert scan.saturation_w == limit == saturation_dn(noise)
    low, near, high = curves(scan)[0]
    assert (high == limit).all()
    assert low.max() < 0.9 * limit
    assert near.max() == limit and 0.02 < (near == limit).mean() < 0.98  # some of them, at random
    pixels = pixel_properties(noise, SHAPE)
    mean, once = mean_of_frames(noise, pixels, np.full(COUNT, levels[1] * 14_000.0), np.ones(6), "x", 1)
    assert once.any() and (mean[once] == limit).all() and (mean[~once] < limit).all()
    always = [mean_of_frames(noise, pixels, np.full(COUNT, levels[1] * 14_000.0), np.ones(1), "x", 1)[1]]
    assert (once & ~always[0]).any()  # a mean that a saturated frame alone would not lift to the limit
    flags = flag_curves(scan, scan.mean_w(), np.full(COUNT, 0.2), np.full(COUNT, 1.0))
    assert (flags == Flag.SATURATED).all()


def test_a_detector_without_limits_saturates_nowhere():
    assert saturation_dn(DetectorNoise(electrons_at_peak=1.0, shot_noise=True)) == np.inf


def test_images_are_in_dn_with_all_lines_of_every_pixel():
    lit = np.zeros((len(LEVELS), *SHAPE))
    lit[2, 3, 4] = PEAK_W
    one = Scan.from_images("x", np.arange(len(LEVELS)) * 0.2, lit)
    narrow = dataclasses.replace(
        one, pixels=np.array([3 * SHAPE[1] + 4]), first_line=np.array([2]), hits=np.ones(1),
        flux_w=np.full((1, 1, 1), PEAK_W),
    )  # fmt: skip
    noise = DetectorNoise(electrons_at_peak=PEAK_E, read_noise_e=1.0)
    found = expose(ImageStack(narrow, narrow), noise).x
    np.testing.assert_array_equal(found.flux_w, expose(ImageStack(one, one), noise).x.flux_w)
    assert found.flux_w.shape == (1, COUNT, len(LEVELS)) and found.unit == "DN" and one.unit == "W"
    assert np.isnan(found.hits).all()


def test_more_than_the_memory_is_refused_before_it_is_taken():
    with pytest.raises(ValueError, match="exposures = 1000: images of 704643072000 values: takes"):
        check_recording_memory(DetectorNoise(exposures=1000), 42, (4096, 4096))


# --- the same noise in any order and any split --------------------------------------------------------------

ALL = DetectorNoise(
    electrons_at_peak=3000.0, exposure_s=1.0, shot_noise=True, prnu=0.01, dark_current_e_per_s=5.0,
    hot_pixel_share=0.01, hot_pixel_e=300.0, dead_pixel_share=0.01, read_noise_e=3.0, full_well_e=5000.0,
    gain_e_per_dn=2.0, offset_dn=20.0, bits=12, frames_averaged=3, dark_frames=4, exposures=3, seed=11,
)  # fmt: skip
SCREEN = ScreenResponse(drift=0.05, jitter=0.02, seed=5)


def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    first, again = expose(flat_stack(), ALL, SCREEN), expose(flat_stack(), ALL, SCREEN)
    other = expose(flat_stack(), dataclasses.replace(ALL, seed=12), SCREEN)
    for axis in ("x", "y"):
        one, two, three = (getattr(stack, axis).flux_w for stack in (first, again, other))
        np.testing.assert_array_equal(one, two)
        assert (one != three).mean() > 0.5


def test_frames_taken_one_by_one_in_any_order_are_those_of_the_stack():
    noise = dataclasses.replace(ALL, dark_frames=0)
    whole = curves(expose(flat_stack(), noise, SCREEN).x)
    pixels, lines = pixel_properties(noise, SHAPE), len(LEVELS)
    for exposure, line in np.random.default_rng(1).permutation(np.argwhere(np.ones((3, lines)))):
        factors = frame_factors(SCREEN, "x", line, lines, exposure, noise.frames_averaged)
        light = np.full(COUNT, PEAK_W * LEVELS[line]) * electrons_per_w(noise, PEAK_W)
        image, _ = mean_of_frames(noise, pixels, light, factors, "x", int(line), int(exposure))
        np.testing.assert_array_equal(image, whole[exposure, line])


def test_a_part_of_the_exposures_or_of_the_pixels_has_the_noise_of_the_whole():
    whole = expose(flat_stack(), ALL, SCREEN).x.flux_w
    np.testing.assert_array_equal(
        expose(flat_stack(), dataclasses.replace(ALL, exposures=2), SCREEN).x.flux_w, whole[:2]
    )
    upper = expose(flat_stack(shape=(20, SHAPE[1])), ALL, SCREEN).x.flux_w  # the first rows alone
    np.testing.assert_array_equal(upper, whole[:, : 20 * SHAPE[1]])


def test_the_noise_of_a_pixel_does_not_depend_on_the_light_of_others():
    stack, changed = flat_stack(), flat_stack()
    changed.x.flux_w.setflags(write=True)
    flux = changed.x.flux_w.copy()
    flux[0, 100] = PEAK_W * LEVELS[::-1]
    changed = ImageStack(dataclasses.replace(changed.x, flux_w=flux), changed.y)
    one, two = (expose(s, ALL, SCREEN).x.flux_w for s in (stack, changed))
    different = (one != two).any((0, 2))
    assert different[100] and different.sum() == 1


def test_frames_exposures_and_scans_have_independent_noise():
    level = flat_stack(np.ones(4))
    stack = expose(level, DetectorNoise(electrons_at_peak=100.0, shot_noise=True, read_noise_e=3.0, exposures=2))
    images = np.concatenate([curves(scan).reshape(-1, COUNT) for scan in (stack.x, stack.y)])
    correlation = np.corrcoef(images) - np.eye(len(images))
    assert np.abs(correlation).max() < 5 / COUNT**0.5  # 5 sigma of 120 pairs: chance 7e-5


# --- replicates and exposures -------------------------------------------------------------------------------


def with_rays(replicates: int) -> ImageStack:
    """A stack whose replicates differ, with unequal weights."""
    random = np.random.default_rng(replicates)
    scans = []
    for scan in (flat_stack().x, flat_stack().y):
        flux = random.uniform(0.5, 1.0, (replicates, *scan.flux_w.shape[1:])) * PEAK_W
        scans.append(dataclasses.replace(scan, flux_w=flux, weights=np.arange(1.0, replicates + 1)))
    return ImageStack(*scans)


@pytest.mark.parametrize(
    ("exposures", "shares"), [(1, [[0, 1, 2, 3]]), (2, [[0, 1], [2, 3]]), (4, [[0], [1], [2], [3]])]
)
def test_each_exposure_has_rays_of_its_own_and_their_mean_is_that_of_all(exposures, shares):
    stack = with_rays(4)
    noise = DetectorNoise(exposure_s=1.0, quantum_efficiency=1.0, wavelength_nm=500.0, exposures=exposures)
    found, scale = expose(stack, noise).x, electrons_per_w(noise, 0.0)
    for k, share in enumerate(shares):
        expected = np.average(stack.x.flux_w[share], axis=0, weights=stack.x.weights[share]) * scale
        np.testing.assert_allclose(found.flux_w[k], expected, rtol=ROUNDING)
    np.testing.assert_allclose(found.mean_w(), stack.x.mean_w() * scale, rtol=ROUNDING)


def test_more_exposures_than_replicates_are_refused_but_for_a_single_one():
    noise = DetectorNoise(electrons_at_peak=10.0, shot_noise=True, exposures=5)
    with pytest.raises(ValueError, match=r"exposures = 5: must be at most --replicates = 4, so that each"):
        expose(with_rays(4), noise)
    assert expose(with_rays(1), noise).x.flux_w.shape[0] == 5
