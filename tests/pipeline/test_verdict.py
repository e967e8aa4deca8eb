"""A measured map in a file, judged by the budget of its test."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.verdict import MET, NOT_MET, OPEN
from irtscots_cl.formats.height_map import WAVEFRONT, HeightMap
from irtscots_cl.formats.maps import write_map
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.verdict import heights_at_pixels, judge_map
from irtscots_cl.scene.error_sources import Air, Budget

BUDGET = Budget(sources={"camera.x_mm": 0.1, "screen.x_mm": 0.1})
NM = 1e-6


@pytest.fixture(scope="module")
def setup():
    return Setup(small_scene(31))


def astigmatism(setup, nm: float, across: int = 101, hole: bool = True) -> HeightMap:
    """A map of a Zernike term 6 of the mirror, without its outside and a square."""
    radius = setup.scene.mirror.diameter_mm / 2
    place = np.linspace(-1.02, 1.02, across) * radius
    x, y = np.meshgrid(place, place)
    height = nm * NM * zernike(6, x / radius, y / radius)
    height[np.hypot(x, y) > radius] = np.nan
    if hole:
        height[across // 2 : across // 2 + 6, across // 2 : across // 2 + 6] = np.nan
    return HeightMap(height, pitch_mm=(place[1] - place[0],) * 2, wavelength_nm=632.8)


def test_a_map_is_read_at_the_designs_mirror_points(setup, tmp_path):
    design = MeasuredDesign.of(setup)
    seen, radius = design.seen, setup.scene.mirror.diameter_mm / 2
    found = heights_at_pixels(astigmatism(setup, 300.0), design, tmp_path)
    x, y = seen.x_mm[seen.mask], seen.y_mm[seen.mask]
    has = np.isfinite(found)
    assert 0.9 < has.mean() < 1
    middle = np.abs(np.stack([x, y]) - 0.05 * radius).max(0) < 0.03 * radius
    assert middle.any() and not has[middle].any()
    assert np.abs(found - 300 * NM * zernike(6, x / radius, y / radius))[has].max() < 1e-3 * NM


def test_what_is_no_low_order_is_read_to_a_part_of_it(setup, tmp_path):
    """Ripples of 1 nm, eight across the mirror: next to the rim and the hole the spline is less good than inside."""
    design = MeasuredDesign.of(setup)
    flat, seen = astigmatism(setup, 0.0), design.seen
    period = setup.scene.mirror.diameter_mm / 8
    rippled = replace(flat, heights_mm=flat.heights_mm + NM * np.sin(2 * np.pi * flat.positions_mm()[0] / period))
    found = heights_at_pixels(rippled, design, tmp_path)
    left = found - NM * np.sin(2 * np.pi * seen.x_mm[seen.mask] / period)
    assert np.nanstd(left) < 0.02 * NM and np.nanmax(np.abs(left)) < 0.2 * NM


def test_limits_are_judged(setup, tmp_path):
    write_map(tmp_path / "m.dat", astigmatism(setup, 300.0))
    found = judge_map(setup, BUDGET, tmp_path / "m.dat", "3/2(0.5/0.2) RMSi<1.1 RMSt<2", 546.07)
    assert {one.name: one.verdict for one in found.judged} == {
        "A": MET, "B": NOT_MET, "C": MET, "RMSi": OPEN, "RMSt": MET,
    }  # fmt: skip
    interval = found.zernikes[6]
    assert interval.low < 300 < interval.high and interval.estimate == pytest.approx(300, abs=0.1)
    one = next(one for one in found.judged if one.verdict == OPEN)
    assert one.guard_nm == one.interval.high - one.interval.estimate > 0
    assert one.missing_nm == min(one.interval.high - one.limit_nm, one.limit_nm - one.interval.low) > 0


def test_a_wavefronts_map_is_halved(setup, tmp_path):
    write_map(tmp_path / "m.npz", astigmatism(setup, 300.0).as_kind(WAVEFRONT))
    found = judge_map(setup, BUDGET, tmp_path / "m.npz")
    assert found.zernikes[6].estimate == pytest.approx(300, abs=0.1) and found.judged == ()


def test_the_verdict_is_by_the_frames_and_the_air_of_the_budget(setup, tmp_path):
    write_map(tmp_path / "m.npz", astigmatism(setup, 300.0))
    budget = replace(BUDGET, periods=(2.0, 9.0), air=Air(outer_scale_mm=300.0))
    design = judge_map(setup, budget, tmp_path / "m.npz").trials.design
    assert (design.fringes, design.air) == (budget.fringes, budget.air)


def test_what_cannot_be_judged_is_one_line(setup, tmp_path):
    whole = astigmatism(setup, 300.0)
    for name, height_map, told in (
        ("small.npz", replace(whole, pitch_mm=(1.0, 1.0)), "points of the mirror that the design's pixels see"),
        ("beside.npz", replace(whole, centre_mm=(1e5, 0.0)), "lies beside the mirror"),
        ("scale.npz", replace(whole, pitch_mm=None), "tells no lateral scale"),
    ):
        write_map(tmp_path / name, height_map)
        with pytest.raises(ValueError, match=told) as error:
            judge_map(setup, BUDGET, tmp_path / name)
        assert str(error.value).startswith(str(tmp_path / name)) and "\n" not in str(error.value)
    with pytest.raises(ValueError, match="error sources"):
        judge_map(setup, Budget(), tmp_path / "small.npz")


def test_a_file_without_a_unit_goes_through_convert(setup, tmp_path):
    np.save(tmp_path / "m.npy", astigmatism(setup, 300.0).heights_mm)
    with pytest.raises(ValueError, match="tells no unit of its heights: give --unit, .* to `irtscots convert` first$"):
        judge_map(setup, BUDGET, tmp_path / "m.npy")


def test_a_map_that_goes_far_beyond_the_mirror_is_told(setup, tmp_path):
    """Such as one with its pitch in inches: what is judged is but its middle."""
    plain, radius = astigmatism(setup, 300.0, hole=False), setup.scene.mirror.diameter_mm / 2
    for name, pitch in (("mm.npz", plain.pitch_mm[0]), ("inch.npz", 25.4 * plain.pitch_mm[0])):
        write_map(tmp_path / name, replace(plain, pitch_mm=(pitch, pitch)))
    assert judge_map(setup, BUDGET, tmp_path / "mm.npz").warnings == ()
    (told,) = judge_map(setup, BUDGET, tmp_path / "inch.npz").warnings
    assert re.match(rf"has heights 1.+ mm from the middle of a mirror of {radius:g} mm radius: ", told)


def test_what_compensators_take_is_no_part_of_the_verdict(setup, tmp_path):
    """Half a millimetre of the screen's distance on the map: with it as a compensator, nothing is left but the rest."""
    design, shape = MeasuredDesign.of(setup), astigmatism(setup, 300.0)
    radius = setup.scene.mirror.diameter_mm / 2
    x, y = (place / radius for place in shape.positions_mm())
    power = replace(shape, heights_mm=shape.heights_mm + 200 * NM * zernike(4, x, y))
    write_map(tmp_path / "m.npz", power)
    budget = Budget(sources={"screen.z_mm": 0.05, "camera.x_mm": 0.1}, compensators=("screen.z_mm",))
    found, plain = judge_map(setup, budget, tmp_path / "m.npz"), judge_map(setup, BUDGET, tmp_path / "m.npz")
    assert plain.zernikes[4].estimate == pytest.approx(200, abs=0.1)
    assert abs(found.zernikes[4].estimate) < 2  # the screen's map is power but for a part in a hundred
    assert found.zernikes[6].estimate == pytest.approx(300, rel=0.02)
    assert found.trials.procedure.text == "screen.z_mm fitted away" and design.count == len(found.used)
