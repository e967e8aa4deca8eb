"""Checks of images: each passes on good images, each fails on its fault, and its text says where and what to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from image_faults import FAULTS
from noisy_images import Images, images_of, setup_of, small

from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.measurement import quality
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check, check_images, worst
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.measurement.scan_estimates import estimate_centroids

SCENE = small(25)
OF_SCANS = ("lines", "frames", "gains", "profile", "stray", "place")
NAMES = {f"{name} {axis}" for name in OF_SCANS for axis in "xy"} | {"saturation", "orientation", "outline", "pixels"}
MAKE = {fault.name: fault.make for fault in FAULTS}


def checks_of(images: Images, scene=SCENE) -> dict[str, Check]:
    setup, stack = setup_of(scene), images.stack()
    stack = stack.saturating_at(find_ceiling(stack))
    found = check_images(stack, setup, estimate_centroids(stack, setup, "likelihood"))
    assert len({check.name for check in found}) == len(found)
    return {check.name: check for check in found}


def faulty(name: str, noise: float = 0.002, scene=SCENE) -> dict[str, Check]:
    return checks_of(MAKE[name](images_of(scene).noisy(noise, 1), np.random.default_rng(2)), scene)


def failed(checks: dict[str, Check]) -> dict[str, str]:
    return {name: check.level for name, check in checks.items() if check.level != OK}


def test_good_images_pass_every_check():
    checks = checks_of(images_of(SCENE).noisy(0.002, 1))
    assert checks.keys() == NAMES
    assert failed(checks) == {}
    for check in checks.values():
        assert check.text and check.text.isprintable() and 0 <= check.false_alarm <= 1e-3
        assert np.isfinite([check.value, check.limit]).all()


def test_sixty_good_noisy_runs_give_no_warning():
    for seed in range(60):
        share = (0.0005, 0.002, 0.005, 0.01)[seed % 4]
        assert failed(checks_of(images_of(SCENE).noisy(share, 100 + seed))) == {}, (seed, share)


def test_images_without_noise_and_those_of_the_design_give_none():
    assert failed(checks_of(images_of(SCENE))) == {}
    assert failed(checks_of(images_of(SCENE.nominal()).noisy(0.002, 1))) == {}


@pytest.mark.parametrize(
    ("fault", "name", "level", "parts"),
    [
        ("black frame", "frames x", WARNING, ("x scan", "frame 10 shows no light", "count from 0", "left out")),
        ("two black frames", "frames x", WARNING, ("frame 7 shows no light", "frame 12 shows no light")),
        ("repeated frame", "frames x", WARNING, ("frame 10 shows line 9, not 10",)),
        ("exchanged frames", "frames x", WARNING, ("frame 10 shows line 11", "frame 11 shows line 10")),
        ("light on in a frame", "frames x", WARNING, ("frame 10 shows light where none can be",)),
        ("half exposed frame", "gains x", WARNING, ("x scan: frame 10 0.5 times as bright", "corrected")),
        ("gamma 2.2", "profile x", WARNING, ("% of their peak from the modelled profile", "gamma", "focus")),
        ("1 % of the pixels saturated", "saturation", WARNING, ("samples are at 4095", "expose less")),
        ("rows upside down", "orientation", ERROR, ("the rows upside down", "times better", "behind the camera")),
        ("x scan reversed", "orientation", ERROR, ("the x scan reversed",)),
        ("scans exchanged", "orientation", ERROR, ("the scans exchanged",)),
        ("scan one line late", "place x", WARNING, ("x scan lies +0.99 lines (+0.197 mm)", "tilted mirror")),
        ("50 % of the pixels dead", "pixels", WARNING, ("of the mirror's pixels have usable light curves",)),
    ],
)  # fmt: skip
def test_a_fault_fails_its_check_and_the_text_says_where(fault, name, level, parts):
    check = faulty(fault)[name]
    assert check.level == level
    for part in parts:
        assert part in check.text, check.text
    assert check.text.isprintable()


def test_a_shifted_image_is_refused_with_its_shift():
    rolled = images_of(SCENE).noisy(0.002, 1).each(lambda a: np.roll(a, (2, -3), (1, 2)))
    check = checks_of(rolled)["outline"]
    assert check.level == ERROR and "+2 rows and -3 columns" in check.text
    assert check.value == pytest.approx(np.hypot(2, 3))


def test_a_second_light_is_named():
    """A ghost eight lines away, a third as bright, on a tenth of the pixels."""
    images = images_of(SCENE).noisy(0.002, 1)
    x = images.x.copy()
    x[:, 8:12] += 0.33 * np.roll(images_of(SCENE).x, 8, axis=0)[:, 8:12]
    checks = checks_of(replace(images, x=x))
    assert (checks["stray x"].level, checks["stray y"].level) == (WARNING, OK)
    assert "of the pixels of the x scan see a second light" in checks["stray x"].text
    assert checks["stray x"].value > quality.STRAY_SHARE


def test_a_scan_of_wrong_frames_is_refused():
    images = images_of(SCENE).noisy(0.002, 1)
    x = images.x.copy()
    x[5:16:2] = 0.0
    check = checks_of(replace(images, x=x))["frames x"]
    assert check.level == ERROR and "frame 5 shows no light" in check.text and "left out" not in check.text


def test_frames_in_any_order_are_not_told_to_be_right():
    images = images_of(SCENE).noisy(0.002, 1)
    x = images.x.copy()
    x[4:17] = x[4:17][np.random.default_rng(3).permutation(13)]
    assert {"frames x", "pixels"} <= failed(checks_of(replace(images, x=x))).keys()


def test_hardly_any_pixel_left_is_an_error():
    images = images_of(SCENE).noisy(0.002, 1)
    keep = np.zeros((25, 25), bool)
    keep[12, 8:16] = True
    check = checks_of(images.each(lambda a: np.where(keep, a, 0.0)))["pixels"]
    assert (check.level, check.limit) == (ERROR, quality.FEW[1])
    assert check.value < 0.05


def test_one_scan_s_fault_is_not_the_other_s():
    assert not {name for name in failed(faulty("half exposed frame")) if name.endswith(" y")}


def test_left_out_frames_leave_good_pixels():
    setup = setup_of(SCENE)
    images = MAKE["repeated frame"](images_of(SCENE).noisy(0.002, 1), None)
    estimate = estimate_centroids(images.stack(), setup, "likelihood")[0]
    on_mirror = setup.chief_rays.footprint.coverage.ravel()[estimate.scan.pixels] >= 0.5
    assert (estimate.flags[on_mirror] == Flag.GOOD).mean() > 0.99


def test_the_worst_level_of_checks():
    levels = [Check("a", level, 0.0, 0.0, 1e-6, "") for level in (OK, WARNING, OK, ERROR)]
    assert [worst(levels[:count]) for count in range(5)] == [OK, OK, WARNING, WARNING, ERROR]


# --- orientation: what to set -------------------------------------------------------------------------------


@pytest.mark.parametrize("now", ["upright", "rows-reversed", "quarter-turn"])
@pytest.mark.parametrize("lies", ["upright", "columns-reversed", "half-turn", "transposed-half-turn"])
def test_the_message_names_the_key_and_the_word_that_makes_the_images_fit(lies, now):
    """Images that lie as `lies` in files, read by a scene that says `now`."""
    scene = with_orientation(SCENE, now)
    images = images_of(SCENE).noisy(0.002, 1)
    check = checks_of(images.each(lambda a: upright(stored(a, lies), now)), scene)["orientation"]
    if lies == now:
        assert check.level == OK
        return
    assert check.level == ERROR and check.text.isprintable()
    assert f'set camera.detector.orientation = "{lies}" (now "{now}")' in check.text
    # the word mends it
    mended = images.each(lambda a: upright(stored(a, lies), lies))
    assert checks_of(mended, with_orientation(SCENE, lies))["orientation"].level == OK


def test_a_symmetric_set_up_says_that_it_cannot_tell_and_what_would():
    """The sphere on its axis: an image upside down, or the y scan reversed; both fit."""
    check = faulty("rows upside down")["orientation"]
    assert 'set camera.detector.orientation = "rows-reversed" (now "upright")' in check.text
    assert "or mend the order of the lines (the y scan reversed)" in check.text
    assert "a symmetric set-up does not tell these apart" in check.text and "a fiducial would tell" in check.text
    good = checks_of(images_of(SCENE).noisy(0.002, 1))["orientation"]
    assert good.level == OK and "the set-up is symmetric" in good.text and "a fiducial would tell" in good.text
    assert "the rows upside down and the y scan reversed" in good.text


def with_orientation(scene, word: str):
    detector = replace(scene.camera.detector, orientation=word)
    return replace(scene, camera=replace(scene.camera, detector=detector))
