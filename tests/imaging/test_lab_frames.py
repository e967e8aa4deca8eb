"""A camera's dark, bias and flat frames, repeated exposures, bad pixels: what is left is the light."""

import math

import numpy as np
import pytest
from picture_files import ramp, tiff

from irtscots_cl.formats.images import open_frames
from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.imaging.lab_frames import CameraCalibration, LabFrames, camera_calibration, mean_frame

SHAPE = (12, 10)
RNG = np.random.default_rng(3)
BIAS = 100 + RNG.normal(0, 5, SHAPE)
DARK_PER_S = RNG.gamma(2.0, 10.0, SHAPE)
RESPONSE = 1 + 0.1 * RNG.normal(0, 1, SHAPE)
RESPONSE /= np.median(RESPONSE)
LIGHT = 200 + 2000 * np.add.outer(np.linspace(0, 0.5, 12), np.linspace(0, 0.5, 10))  # counts in a second
BIASES = np.stack([BIAS] * 3)


def recorded(light, exposure_s=1.0):
    return BIAS + exposure_s * (DARK_PER_S + RESPONSE * light)


def darks(exposure_s=1.0):
    return np.stack([recorded(0, exposure_s)] * 4)


def calibration(**changes):
    kinds = {"dark": darks(), "flat": np.stack([recorded(2400)] * 3), "saturation": 4095}
    return camera_calibration(**(kinds | changes))


def test_dark_and_flat_leave_the_light():
    lab = LabFrames(np.stack([recorded(LIGHT), recorded(LIGHT / 2)]), calibration(), saturation=4095)
    assert np.allclose(lab[0], LIGHT, rtol=1e-6) and lab[0].dtype == np.float32  # of its 24 bits
    assert len(lab) == 2 and lab.shape == SHAPE and np.allclose(list(lab)[1], lab[1:][0])


def test_nothing_known_changes_nothing():
    images = ramp(2)
    assert np.array_equal(np.stack(list(LabFrames(images))), images)


def test_bias_alone_is_taken_off():
    lab = LabFrames(np.stack([BIAS + LIGHT]), camera_calibration(bias=BIASES))
    assert np.allclose(lab[0], LIGHT, rtol=1e-6)


def test_dark_frames_are_scaled_to_other_exposures_by_the_bias():
    scaled = calibration(bias=BIASES, dark=darks(8.0), dark_exposure_s=8.0, flat_exposure_s=1.0)
    lab = LabFrames(np.stack([recorded(LIGHT, 0.5)]), scaled, exposures_s=(0.5,))
    assert np.allclose(lab[0], 0.5 * LIGHT, rtol=1e-6)


def test_dark_frames_of_another_exposure_are_refused_without_bias_frames():
    with pytest.raises(ValueError, match="flat frames: 1 s, the dark frames 8 s: must be equal, or give bias frames"):
        calibration(dark=darks(8.0), dark_exposure_s=8.0, flat_exposure_s=1.0)
    known = calibration(dark_exposure_s=8.0)
    with pytest.raises(ValueError, match=r"exposures_s: 0\.5 s, the dark frames 8 s"):
        LabFrames(np.stack([recorded(LIGHT)]), known, exposures_s=(0.5,))


def test_flat_frames_have_dark_frames_of_their_own():
    known = calibration(flat=np.stack([recorded(400, 6.0)] * 2), flat_dark=darks(6.0))
    assert np.allclose(known.response, RESPONSE, rtol=1e-6)


def test_bad_and_dead_pixels_are_missing_and_not_saturated():
    bad = np.zeros(SHAPE, np.uint8)
    bad[2, 3] = 255
    flat = np.stack([recorded(2400)] * 3)
    flat[:, 4, 5] = recorded(0)[4, 5] + 20  # dead
    flat[1, 6, 7] = 4095  # saturated once
    known = calibration(bad=bad, flat=flat)
    assert known.notes == ("1 bad pixels by the map", "2 pixels that are saturated or dead in the flat frames")
    lab = LabFrames(np.full((1, *SHAPE), 4095.0), known, saturation=4095)
    assert int(lab.frame(0).saturated.sum()) == LIGHT.size - 3
    lab = LabFrames(np.stack([recorded(LIGHT)]), known, saturation=4095)
    assert np.argwhere(np.isnan(lab[0])).tolist() == [[2, 3], [4, 5], [6, 7]] and not lab.frame(0).saturated.any()


def test_saturated_samples_are_marked():
    images = np.stack([recorded(LIGHT)] * 2)
    images[1, 5, 6] = 4095
    lab = LabFrames(images, calibration(), saturation=4095)
    assert np.isfinite(lab[0]).all() and not lab.frame(0).saturated.any()
    assert np.argwhere(np.isnan(lab[1])).tolist() == [[5, 6]] == np.argwhere(lab.frame(1).saturated).tolist()


@pytest.mark.parametrize("order", ["together", "in turn"])
def test_repeats_are_averaged_in_their_order(order):
    images = np.stack([recorded(k * LIGHT) for k in (0.4, 0.6, 0.9, 1.1)])  # means 0.5 and 1 together
    if order == "in turn":
        images = images[[0, 2, 1, 3]]
    lab = LabFrames(images, calibration(), exposures_s=(None, None), order=order)
    assert len(lab) == 2
    for k, mean in enumerate((0.5, 1.0)):
        assert np.allclose(lab[k], mean * LIGHT, rtol=1e-6)


def test_a_sample_saturated_in_one_of_equal_repeats_is_missing():
    images = np.stack([recorded(LIGHT)] * 3)
    images[1, 0, 0] = 4095
    lab = LabFrames(images, calibration(), saturation=4095, exposures_s=(1.0,) * 3)
    assert np.argwhere(np.isnan(lab[0])).tolist() == [[0, 0]]


def merged_light(light, exposures_s, frames, full_scale=4095.0):
    """Merged frames of shot noise, one count per electron, clipped at the full scale: [frames, *SHAPE] at 1 s."""
    rng = np.random.default_rng(7)
    times = np.tile(exposures_s, frames)
    raw = rng.poisson(np.broadcast_to(light, SHAPE) * times[:, None, None]).astype(float)
    lab = LabFrames(np.minimum(raw, full_scale), saturation=full_scale, exposures_s=exposures_s)
    return np.stack([lab.frame(k).values for k in range(frames)]).astype(float) / exposures_s[0]


def test_exposures_are_merged_with_the_noise_of_all_their_light():
    light, exposures, frames = 100.0, (1.0, 4.0, 16.0), 60
    values = merged_light(light, exposures, frames)
    expected = math.sqrt(light / sum(exposures))
    error = expected / math.sqrt(values.size)
    assert abs(values.mean() - light) < 4.5 * error  # fails by chance once in 150,000
    assert abs(values.std() / expected - 1) < 4.5 / math.sqrt(2 * values.size)


@pytest.mark.parametrize("share", [0.75, 0.8, 0.9, 0.98, 1.0, 1.02, 1.2])
def test_merging_is_unbiased_where_the_long_exposure_saturates(share):
    """At most a tenth of the long exposure's own noise; leaving it out above one count would give four tenths."""
    light, exposures, frames = share * 4095 / 16, (1.0, 16.0), 400
    values = merged_light(light, exposures, frames)
    assert np.isfinite(values).all()
    chance = values.std() / math.sqrt(values.size)
    assert abs(values.mean() - light) < 0.1 * math.sqrt(light / 16) + 4.5 * chance  # 4.5 sigma: once in 150,000


def test_a_long_exposure_saturated_in_one_repeat_is_left_out():
    images = np.stack([np.full(SHAPE, value) for value in (100.0, 300.0, 300.0)])
    images[2, 1, 1] = 1000.0
    lab = LabFrames(images, saturation=1000.0, exposures_s=(1.0, 4.0, 4.0))
    expected = np.full(SHAPE, 700 / 9)
    expected[1, 1] = 100.0
    assert np.allclose(lab[0], expected, rtol=1e-6) and not lab.frame(0).saturated.any()


def test_whole_counts_a_bad_pixel_and_the_first_exposure():
    images = np.stack([np.full(SHAPE, value, np.uint16) for value in (400, 100)])
    images[1, 1, 1] = 1000
    bad = np.zeros(SHAPE, bool)
    bad[2, 2] = True
    lab = LabFrames(images, camera_calibration(bad=bad), saturation=1000, exposures_s=(4.0, 1.0))
    expected = np.full(SHAPE, 400.0)
    expected[[1, 2], [1, 2]] = np.nan
    assert np.allclose(lab[0], expected, rtol=1e-6, equal_nan=True)
    assert np.argwhere(lab.frame(0).saturated).tolist() == [[1, 1]]


def test_where_the_shortest_exposure_is_saturated_nothing_is_known():
    assert np.isnan(merged_light(5000.0, (1.0, 4.0), 1)).all()


@pytest.mark.parametrize("changes, said", [
    ({"flat": darks(), "dark": np.stack([recorded(3000)])}, "must be brighter; are they swapped"),
    ({"dark": darks()[:, :-1]}, r"flat: shape \(12, 10\); dark: \(11, 10\); must be equal"),
    ({"bad": np.zeros((3, 3))}, "bad-pixel map: shape"),
    ({"flat": np.full((1, *SHAPE), 4095.0)}, "120 of 120 pixels are saturated or dead: too many"),
    ({"dark": darks()[:0]}, "no frames for a mean"),
])  # fmt: skip
def test_frames_that_cannot_calibrate_are_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        calibration(**changes)


@pytest.mark.parametrize("changes, said", [
    ({"exposures_s": (1.0, 1.0)}, "3 frames: must be a multiple of the 2 repeats"),
    ({"exposures_s": ()}, "multiple of the 0 repeats"),
    ({"exposures_s": (0.0,)}, "must be numbers above 0"),
    ({"exposures_s": (1.0, None, 2.0)}, "must be numbers above 0"),
    ({"order": "any"}, "order = 'any': must be one of 'together', 'in turn'"),
    ({"calibration": CameraCalibration(bias=np.zeros((2, 2)))}, "bias frame has shape"),
])  # fmt: skip
def test_frames_that_do_not_fit_are_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        LabFrames(**{"frames": np.zeros((3, *SHAPE))} | changes)


def test_a_mean_is_that_of_its_frames():
    one = mean_frame(ramp(5), saturation=3400)
    assert np.allclose(one.mean, ramp(5).mean(0), rtol=1e-14) and one.count == 5
    assert np.array_equal(one.saturated, (ramp(5) >= 3400).any(0)) and one.saturated.any()
    with pytest.raises(ValueError, match="frame 1 has shape"):
        mean_frame([np.zeros((2, 3)), np.zeros((2, 4))])


def test_files_of_a_laboratory_become_a_fringe_stack(tmp_path):
    """Fringes in 12 bits by a camera with a dark image and a response of its own: its phase is found again."""
    row, column = np.mgrid[:12, :10]
    phase = 0.3 * row + 0.2 * column
    sets = (FringeSet.equal("x", [3.0], 4),)
    images = [recorded(1200 + 1000 * np.cos(phase - step)) for step in sets[0].steps_rad[0]]
    for folder, some in (("fringes", images), ("dark", darks()), ("flat", [recorded(2400)])):
        (tmp_path / folder).mkdir()
        for k, image in enumerate(some):
            data = np.rint(image).astype(np.uint16).tobytes()
            (tmp_path / folder / f"f_{k}.tif").write_bytes(tiff([data], 16, shapes=[SHAPE]))
    sources = {folder: open_frames(tmp_path / folder, saturation=4095) for folder in ("fringes", "dark", "flat")}
    known = camera_calibration(dark=sources["dark"], flat=sources["flat"], saturation=4095)
    stack = FringeStack(sets, LabFrames(sources["fringes"], known, saturation=4095))
    ((_, steps, found),) = stack.series(0)
    sums = np.tensordot(np.exp(1j * np.array(steps)), found, 1)
    # 1 count of rounding in each of the four frames, dark and flat, over an amplitude of 1000
    assert np.abs(np.angle(sums * np.exp(-1j * phase))).max() < 2e-3


def test_a_mean_s_standard_error_is_that_of_its_scatter():
    """20000 pixels: their mean square error is known to 1 / sqrt(20000 x 7 / 2) = 0.4 % each, 2 % is 5 sigma."""
    frames = np.random.default_rng(3).normal(1e6, 3.0, (8, 100, 200))
    found = mean_frame(frames)
    assert np.sqrt(np.mean(found.error**2)) == pytest.approx(3 / np.sqrt(8), rel=0.02)
    assert found.levels == pytest.approx(frames.mean((1, 2)))
    assert np.isnan(mean_frame(frames[:1]).error).all()
