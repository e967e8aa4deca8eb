"""From fringe images to places on the screen: synthetic stacks with all that goes wrong in a laboratory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.imaging.fringes import FringeSet, FringeStack, equal_steps
from irtscots_cl.measurement import screen_coordinates as coordinates_module
from irtscots_cl.measurement.fringe_survey import blur_fall
from irtscots_cl.measurement.harmonics import ResponseTable
from irtscots_cl.measurement.screen_coordinates import places_again, screen_coordinates

ROWS, COLUMNS = 120, 110
FAILURE_CHANCE = 1e-6
Z = float(stats.norm.isf(FAILURE_CHANCE / 4))
PERIODS = (0.9, 3.9, 15.9)


def mirror():
    row, column = np.mgrid[:ROWS, :COLUMNS]
    return np.hypot(row - 60, column - 55) < 45


def places():
    """Screen fractions (x, y) of a mirror that is seen through a slightly bent mapping."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    x, y = (column - 55) / 100, (row - 60) / 110
    return 0.5 + x + 0.05 * x * y, 0.45 - y + 0.03 * x**2


def stack_of(sets, *, noise=1.0, gamma=1.0, top=np.inf, seed=1, taken=None, whole=False):
    """Images of the mirror: brightness uneven, dark around. taken: the sets that the screen really showed."""
    bright = np.where(mirror(), 180 * (1 - 0.3 * np.mgrid[:ROWS, :COLUMNS][1] / COLUMNS), 0.0)
    frames = []
    for fringes in taken or sets:
        place = places()["xy".index(fringes.axis)]
        frames += [3 + bright * value.reshape(ROWS, COLUMNS) ** gamma for value in fringes.values(place.ravel())]
    images = np.array(frames) + noise * np.random.default_rng(seed).normal(size=(len(frames), ROWS, COLUMNS))
    images = np.minimum(images, top)
    images = np.clip(np.rint(images), 0, 255).astype(np.uint8) if whole else images
    return FringeStack(sets, images, saturation=top)


def both(periods=PERIODS, steps=4, **options):
    return tuple(FringeSet.equal(axis, periods, steps, **options) for axis in "yx")


def pulls_of(found):
    inside = mirror() & found.mask
    return {
        axis: ((found.axes[axis].fraction - place) / found.axes[axis].standard_error)[inside]
        for axis, place in zip("xy", places(), strict=True)
    }


def assert_normal(pulls, spare=0.0):
    n = len(pulls)
    assert abs(pulls.mean()) < Z / np.sqrt(n) + spare
    assert abs(pulls.var() - 1) < Z * np.sqrt(2 / n) + 0.05 + spare  # 5 %: the noise's own error bar


@pytest.mark.parametrize("steps", [4, 5, 8, 16])
def test_places_with_their_error_bars(steps):
    found = screen_coordinates(stack_of(both(steps=steps)))
    assert (found.mask ^ mirror()).sum() < 4 and found.notes == ()
    for pulls in pulls_of(found).values():
        assert_normal(pulls)
    assert found.x.survey.noise.variance(100.0) == pytest.approx(1.0, rel=0.1)
    assert np.nanmax(found.x.wrong) < 1e-9
    assert found.x.survey.floor_rad < 0.01
    assert np.isnan(found.x.fraction[~found.mask]).all()


@pytest.mark.parametrize(
    "options", [{"reverse": True}, {"ends": "centres"}, {"reverse": True, "ends": "centres"}], ids=str
)
def test_fractions_are_in_the_fringes_own_convention(options):
    found = screen_coordinates(stack_of(both(**options), noise=0.1))
    for axis, place in zip("xy", places(), strict=True):
        np.testing.assert_allclose(found.axes[axis].fraction[found.mask], place[found.mask], atol=1e-4)


@pytest.mark.parametrize("steps", [4, 5])
def test_gamma_is_found_and_taken_out(steps):
    """Gamma 2.2 of the screen: without correction phases are off by 0.0106 rad at four steps, many error bars."""
    found = screen_coordinates(stack_of(both(steps=steps), gamma=2.2, noise=0.3))
    assert found.x.survey.second[0].gamma == pytest.approx(2.2, abs=0.02)
    for pulls in pulls_of(found).values():
        assert_normal(pulls, spare=0.05)


def test_a_response_table_is_used_only_where_the_images_agree():
    shown = np.linspace(0, 255, 40)
    table = ResponseTable(shown, 2 + 200 * (shown / 255) ** 2.2)
    right = screen_coordinates(stack_of(both(), gamma=2.2, noise=0.3), response=table)
    assert right.notes == ()
    for pulls in pulls_of(right).values():
        assert_normal(pulls, spare=0.05)
    wrong = screen_coordinates(stack_of(both(), noise=0.3), response=table)
    assert len(wrong.notes) == 2 and "not shown through this response; it is not applied" in wrong.notes[0]
    for pulls in pulls_of(wrong).values():
        assert_normal(pulls)


def test_saturated_samples_do_not_move_places():
    """Most pixels are cut off at a third of their samples."""
    stack = stack_of(both(steps=8), top=130.0, noise=0.5)
    found = screen_coordinates(stack)
    missing = found.x.missing[mirror()]
    assert np.mean(missing > 0) > 0.5
    for axis, place in zip("xy", places(), strict=True):
        error = (found.axes[axis].fraction - place)[mirror() & found.mask]
        assert np.nanmax(np.abs(error)) < 6e-4
        assert np.isfinite(error).mean() > 0.99


def test_images_of_whole_numbers():
    found = screen_coordinates(stack_of(both(), noise=1.0, whole=True, top=255.0))
    for pulls in pulls_of(found).values():
        assert_normal(pulls, spare=0.05)


def test_steps_that_are_not_those_said_are_found_and_used():
    fifteenths = tuple(2 * np.pi * k / 15 for k in range(16))
    taken = tuple(FringeSet(axis, PERIODS, (fifteenths,) * 3) for axis in "yx")
    found = screen_coordinates(stack_of(both(steps=16), taken=taken))
    assert len(found.notes) == 6 and "2 pi / 15.0" in found.notes[0]
    for axis, place in zip("xy", places(), strict=True):
        error = (found.axes[axis].fraction - place)[mirror() & found.mask]
        assert np.std(error) < 3e-4 and abs(np.mean(error)) < 3e-4


@pytest.mark.parametrize("top", [110.0, 150.0])
def test_wrong_steps_gamma_and_saturation_at_once(top):
    """Steps of 2 pi / 15, a second harmonic of 20 %, and all or half of the pixels saturated."""
    fifteenths = tuple(2 * np.pi * k / 15 for k in range(16))
    sets = tuple(FringeSet.equal(axis, (0.9, 12.0), 16) for axis in "yx")
    taken = tuple(FringeSet(axis, (0.9, 12.0), (fifteenths,) * 2) for axis in "yx")
    found = screen_coordinates(stack_of(sets, taken=taken, gamma=1.75, top=top))
    assert np.mean(found.x.missing[found.mask] > 0) > 0.5
    assert len(found.notes) == 4 and all("2 pi / 15.0" in note for note in found.notes)
    for axis, place in zip("xy", places(), strict=True):
        error = (found.axes[axis].fraction - place)[mirror() & found.mask]
        assert np.std(error) < 2e-4 and abs(np.mean(error)) < 2e-4
        # a ratio of 0.2 whether from complete pixels or from those that lack samples
        assert found.axes[axis].survey.second[1].ratio == pytest.approx(0.2, abs=0.005)


def test_steps_that_ran_backwards_are_noticed():
    taken = tuple(FringeSet(axis, PERIODS, (tuple(-s for s in equal_steps(4)),) * 3) for axis in "yx")
    found = screen_coordinates(stack_of(both(), taken=taken))
    assert [("ran backwards" in note) for note in found.notes] == [True, True]
    for pulls in pulls_of(found).values():
        assert_normal(pulls)


def shown_at(steps):
    return tuple(FringeSet(axis, PERIODS, (tuple(steps),) * 3) for axis in "yx")


@pytest.mark.parametrize("count", [8, 16])
@pytest.mark.parametrize("kind", ["a turn less one", "one repeated", "half a turn", "backwards"])
def test_other_steps_than_said_leave_places_within_their_error_bars(kind, count):
    steps = np.array(equal_steps(count))
    steps = {"a turn less one": steps * count / (count - 1), "half a turn": steps / 2, "backwards": -steps}.get(
        kind, np.where(np.arange(count) == 2, steps[1], steps)
    )
    found = screen_coordinates(stack_of(both(steps=count), taken=shown_at(steps)))
    assert found.notes
    for pulls in pulls_of(found).values():
        assert np.std(pulls) < 1.1 and abs(np.mean(pulls)) < 0.4  # a common step found is a common shift
    assert np.nanmax(found.x.wrong) < 1e-6


@pytest.mark.parametrize("kind", ["a turn less one", "one repeated", "half a turn"])
def test_four_wrong_steps_leave_no_place_in_use(kind):
    """Four steps do not tell that they are wrong, the series do: all places are in doubt, and the reason is named."""
    steps = {"a turn less one": (0, 2, 4, 6), "one repeated": (0, 1.5, 1.5, 4.5), "half a turn": (0, 0.75, 1.5, 2.25)}
    found = screen_coordinates(stack_of(both(), taken=shown_at(np.array(steps[kind]) * np.pi / 3)))
    assert sum("rad beyond their noise" in note or "series differ by" in note for note in found.notes) == 2
    assert np.nanmin(found.x.wrong) == 1.0 and np.nanmin(found.y.wrong) == 1.0


@pytest.mark.parametrize("count", [4, 8])
@pytest.mark.parametrize("kind", ["noise", "constant", "black frame"])
def test_a_broken_series_is_named_and_does_not_spoil_the_others(kind, count):
    stack = stack_of(both(steps=count))
    frames, first = np.array(stack.frames), 2 * count  # 15.9 periods of y
    broken = frames[first : first + count]
    if kind == "noise":
        broken[:] = 100 + 30 * np.random.default_rng(3).normal(size=broken.shape)
    elif kind == "constant":
        broken[:] = broken[0]
    else:
        broken[1] = 0.0
    found = screen_coordinates(FringeStack(stack.sets, frames))
    (note,) = found.notes
    assert note.startswith("y fringes of 15.9 periods: ")
    for pulls in pulls_of(found).values():
        assert_normal(pulls, spare=0.1)


def test_series_at_odds_leave_no_place_in_use():
    """Steps without any order in one series: found from the images, but not from where they count."""
    odd = tuple(np.random.default_rng(5).uniform(0, 2 * np.pi, 8))
    taken = tuple(FringeSet(axis, PERIODS, (equal_steps(8), equal_steps(8), odd)) for axis in "yx")
    found = screen_coordinates(stack_of(both(steps=8), taken=taken))
    assert sum("rad beyond their noise" in note for note in found.notes) == 2
    assert np.nanmin(found.x.wrong) == 1.0


def test_series_that_do_not_agree_are_named():
    taken = tuple(FringeSet.equal(axis, (0.9, 3.9, 14.2)) for axis in "yx")  # 14.2 shown, 15.9 said
    found = screen_coordinates(stack_of(both(), taken=taken))
    assert len(found.notes) == 2 and "rad beyond their noise" in found.notes[0]


def test_three_steps_have_error_bars_from_the_series_agreement():
    found = screen_coordinates(stack_of(both(steps=3)))
    assert "three steps leave nothing to tell the noise from" in found.notes[0]
    for pulls in pulls_of(found).values():
        assert_normal(pulls, spare=0.3)  # brighter pixels have less noise than the common floor says


def test_a_prior_replaces_the_lowest_series():
    sets = both(periods=(15.9,))
    prior = {axis: (place + 0.004, np.full_like(place, 0.005)) for axis, place in zip("xy", places(), strict=True)}
    found = screen_coordinates(stack_of(sets), prior=prior)
    for axis, place in zip("xy", places(), strict=True):
        error = (found.axes[axis].fraction - place)[mirror() & found.mask]
        assert np.abs(error).max() < 1.5e-3
    alone = screen_coordinates(stack_of(sets))
    assert np.nanmedian(alone.x.wrong) > 0.5
    assert found.notes == () and "100% of the pixels fit several places on the screen" in alone.notes[0]


def test_frames_one_by_one_give_the_same_bits():
    stack = stack_of(both())
    one_by_one = FringeStack(stack.sets, list(stack.frames))
    first, second = screen_coordinates(stack), screen_coordinates(one_by_one)
    for axis in "xy":
        np.testing.assert_array_equal(first.axes[axis].fraction, second.axes[axis].fraction)


def test_maps_say_offset_modulation_and_residual():
    found = screen_coordinates(stack_of(both(steps=8)))
    inside = mirror() & found.mask
    assert found.x.modulation.shape == (3, ROWS, COLUMNS)
    bright = 180 * (1 - 0.3 * np.mgrid[:ROWS, :COLUMNS][1] / COLUMNS) / 2
    np.testing.assert_allclose(found.x.amplitude[1][inside], bright[inside], atol=4)
    np.testing.assert_allclose(found.x.offset[1][inside], bright[inside] + 3, atol=3)
    assert np.sqrt(np.mean(found.x.residual[0][inside] ** 2)) == pytest.approx(1.0, rel=0.05)


def test_blur_is_told_from_falling_amplitudes():
    periods = np.array([0.9, 15.9, 63.9])
    assert blur_fall(periods, 90 * np.exp(-1e-4 * periods**2)) == pytest.approx(1e-4)
    assert blur_fall(periods, np.array([90.0, 91.0, 92.0])) == 0.0


def test_wrong_shapes_and_empty_masks_are_refused():
    stack = stack_of(both())
    with pytest.raises(ValueError, match=r"mask of shape \(3, 3\): must be \(120, 110\)"):
        screen_coordinates(stack, mask=np.ones((3, 3), bool))
    with pytest.raises(ValueError, match="no pixel is marked"):
        screen_coordinates(stack, mask=np.zeros((ROWS, COLUMNS), bool))


BAR = (slice(None), slice(50, 60))  # across the mirror: two islands


def barred(sets, **options):
    """A stack of the mirror with a bar across it, and the mask of what is left."""
    stack, mask = stack_of(sets, **options), mirror()
    mask[BAR] = False
    return stack, mask


def design(error, spread=0.1):
    """Priors: the true places and an error in periods of 15.9, stated as `spread`."""
    return {
        axis: (place + error / 15.9, np.full_like(place, spread / 15.9))
        for axis, place in zip("xy", places(), strict=True)
    }


@pytest.mark.parametrize("periods", [(15.9,), (7.95, 15.9, 63.6)], ids=str)
@pytest.mark.parametrize("options", [{}, {"reverse": True}], ids=str)
def test_series_that_leave_the_place_open_are_unwrapped_over_the_image(periods, options):
    """Two islands; with several series of common fringes the lowest is unwrapped. The prior does not pull places."""
    stack, mask = barred(both(periods=periods, **options))
    prior = design(0.2)
    found = screen_coordinates(stack, mask=mask, prior=prior)
    assert found.notes == ()
    for axis, place in zip("xy", places(), strict=True):
        one = found.axes[axis]
        assert [island.pixels for island in one.islands] == [int((mask & half).sum()) for half in halves()]
        assert max(island.wrong for island in one.islands) < 1e-5 and np.nanmax(one.wrong) < 1e-4
        assert_normal(((one.fraction - place) / one.standard_error)[mask])
        assert np.isnan(one.fraction[~mask]).all() and np.isnan(one.wrong[~mask]).all()


def halves():
    left = np.zeros((ROWS, COLUMNS), bool)
    left[:, :55] = True
    return left, ~left


def test_a_surface_far_from_the_design_keeps_its_shape():
    """Off by up to a whole period at the rim, where each pixel by itself would take the next fringe."""
    stack, mask = barred(both(periods=(15.9,)))
    row, column = np.mgrid[:ROWS, :COLUMNS]
    bent = design(np.hypot(row - 60, column - 55) ** 2 / 45**2 - 0.3, spread=0.05)
    found = screen_coordinates(stack, mask=mask, prior=bent)
    for axis, place in zip("xy", places(), strict=True):
        np.testing.assert_allclose(found.axes[axis].fraction[mask], place[mask], atol=1.5e-3)
        assert 1e-6 < max(island.wrong for island in found.axes[axis].islands) < 0.5  # and it is not told for sure


@pytest.mark.parametrize("periods", [(15.9,), (15.9, 63.6)], ids=str)
def test_a_prior_that_cannot_tell_the_order_is_named(periods):
    """Half a period off in one island, where nothing is known of the other."""
    stack, mask = barred(both(periods=periods))
    left, right = halves()
    prior = {
        axis: (np.where(left, place, np.nan), error)
        for axis, (place, error) in design(np.where(left, 0.49, 0.0)).items()
    }
    found = screen_coordinates(stack, mask=mask, prior=prior)
    assert (found.x.wrong[mask & left] > 0.2).all() and (found.x.wrong[mask & right] == 1).all()
    assert np.isnan(found.x.fraction[mask & right]).all()
    assert len(found.notes) >= 2 and any("in doubt for 2 of 2 islands" in note for note in found.notes)


def test_a_prior_off_by_a_period_is_followed_and_only_that():
    stack, mask = barred(both(periods=(15.9,)))
    found = screen_coordinates(stack, mask=mask, prior=design(np.where(halves()[0], 1.0, 0.0)))
    off = np.where(halves()[0], 1 / 15.9, 0.0)
    np.testing.assert_allclose(found.x.fraction[mask], (places()[0] + off)[mask], atol=1.5e-3)


def test_places_of_other_phases_keep_the_orders_of_the_image():
    stack, mask = barred(both(periods=(15.9,)), noise=0.1)
    found = screen_coordinates(stack, mask=mask, prior=design(0.1)).x
    pixels = np.flatnonzero(mask)
    phase, error = (m.reshape(1, -1)[:, pixels].astype(float) for m in (found.phase_rad, found.phase_error_rad))
    floor, moved = places_again(found, pixels, phase + 0.3, error)
    assert floor == 0.0
    np.testing.assert_allclose(moved[0], found.fraction[mask] + 0.3 / (2 * np.pi * 15.9), atol=1e-12)
    np.testing.assert_allclose(moved[1], found.standard_error[mask], rtol=1e-9)
    np.testing.assert_array_equal(moved[2], found.wrong[mask])


def test_blocks_do_not_change_the_maps(monkeypatch):
    """To the rounding of matrix products, which may differ with their width; gamma and saturation as well."""
    stack = stack_of(both(), gamma=2.2, top=170.0)
    whole = screen_coordinates(stack)
    monkeypatch.setattr(coordinates_module, "AT_ONCE", 777)
    parts = screen_coordinates(stack)
    np.testing.assert_array_equal(parts.mask, whole.mask)
    for name in ("fraction", "standard_error", "misfit", "amplitude", "residual", "missing"):
        np.testing.assert_allclose(getattr(parts.x, name), getattr(whole.x, name), rtol=1e-5, atol=1e-9)
