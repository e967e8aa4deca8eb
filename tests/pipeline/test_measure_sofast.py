"""A made-up facet, from its fringe images and the laboratory's files to slopes and height."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from sofast_lab import COLUMNS, ROWS, Lab

from irtscots_cl.formats.sofast import read_sofast_measurement
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.pipeline.measure_sofast import SofastSetup, measure_sofast, sofast_surface

CLEAN, NOISY = Lab(bend=0.004, sag=0.03), Lab(bump=3e-6)
DISPLAYS = ("rectangular2D", "distorted3D")


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clean")
    return CLEAN.write(folder, DISPLAYS)


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return NOISY.write(tmp_path_factory.mktemp("noisy"), noise=0.004)


def measured(path, display=None):
    return sofast_surface(read_sofast_measurement(path), SofastSetup.of_folder(path.parent, display))


def slope_errors(lab, result):
    """Measured less true slopes [2, pixels], in the facet's frame."""
    true = lab.slopes(result.x_mm / 1e3, result.y_mm / 1e3)
    return np.stack([result.slope_x - true[0], result.slope_y - true[1]])[:, result.mask]


def test_slopes_and_height_of_a_quadratic_facet_are_found(clean):
    """The frame is turned to the slopes: no tilt is left. 12-bit images leave 1 to 2 urad, 0.2 um."""
    found = measured(clean)
    result = found.result
    errors = slope_errors(CLEAN, result)
    assert np.abs(errors.mean(1)).max() < 0.3e-6
    assert errors.std(1).max() < 2.5e-6
    assert 0.97 < result.mask.sum() / (CLEAN.coverage() > 0.5).sum() < 1.01
    height = result.height_mm - 1e3 * CLEAN.height(result.x_mm / 1e3, result.y_mm / 1e3)
    left = remove_terms(result.x_mm, result.y_mm, height, result.mask, "piston_tilt")[result.mask]
    assert left.std() < 0.5e-3  # mm
    assert found.lab is not None and found.coordinates.notes == ()


def test_another_description_of_the_screen_shows_in_the_slopes(clean):
    """By as much as its points move: half the shift over the distance, the mirror's tilt and curvature apart."""
    flat = measured(clean, clean.parent / "display_rectangular2D.h5").result
    bent = measured(clean).result
    both = flat.mask & bent.mask
    row, column = np.nonzero(both[::-1])
    fraction = CLEAN.seen(column.astype(float), row.astype(float))[1]
    moved = CLEAN.on_screen(*fraction)[:, 0] - CLEAN.size[0] * (fraction[0] - 0.5)
    depth = np.linalg.norm(CLEAN.screen_at)
    expected = -moved / (2 * depth)  # a light source farther to +x: the slope dz/dx is less

    def without_plane(values, x, y):
        terms = np.stack([np.ones_like(x), x, y], -1)
        return values - terms @ np.linalg.lstsq(terms, values, rcond=None)[0]

    # upright maps, in the same order as the rows counted from the top
    change = (bent.slope_x - flat.slope_x)[::-1][both[::-1]]
    place = bent.x_mm[::-1][both[::-1]], bent.y_mm[::-1][both[::-1]]
    change, expected = without_plane(change, *place), without_plane(expected, *place)
    assert expected.std() > 5e-6
    assert np.std(change - expected) < 0.35 * expected.std()  # the sag acts too, by its slope
    assert np.corrcoef(change, expected)[0, 1] > 0.93


def test_error_bars_are_those_of_noisy_images(noisy):
    """4,800 pixels; the bump of 3 um and 0.06 m is in the truth. Pulls' spread is known to 1 %; 5 sigma."""
    result = measured(noisy).result
    bars = error_bars(result)
    errors = slope_errors(NOISY, result)
    for error, bar in zip(errors, (bars.slope_x, bars.slope_y), strict=True):
        pulls = (error - error.mean()) / bar[result.mask]
        assert abs(pulls.std() - 1) < 0.07  # 5 sigma, and the 2 % to which the errors themselves are known


def test_what_is_written(clean, tmp_path):
    setup = SofastSetup.of_folder(clean.parent)
    facts = measure_sofast(clean, setup, tmp_path / "out")
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {
        "quality.png",
        "screen.png",
        "slopes.png",
        "height.png",
    }
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["pixels_used"] == facts["pixels_used"] and report["measure"] == "fringes"
    place = facts["geometry"]
    assert place["display"] == "display_distorted3D.h5" and place["distance_mm"] == CLEAN.measured_distance() * 1e3
    assert place["focal_lengths_m"]["x"] == pytest.approx(40, rel=1e-3)
    assert place["focal_lengths_m"]["y"] == pytest.approx(47.5, rel=1e-3)
    assert [check["name"] for check in facts["checks"][:3]] == ["fringes", "corners", "distance"]
    assert all(check["level"] == "ok" for check in facts["checks"][:3])
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        assert file.attrs["orientation"] == "rows-reversed"
        mask = file["mask"][()]
        row, column = np.nonzero(mask)
        points, fraction = CLEAN.seen(column.astype(float), row.astype(float))  # as the images lie in their file
        for k, axis in enumerate("xy"):
            found = file[f"screen/{axis}_fraction"]
            assert found.shape == (ROWS, COLUMNS) and found.attrs["unit"] == "1"
            np.testing.assert_allclose(found[()][mask], fraction[k], rtol=0, atol=1e-4)
            np.testing.assert_allclose(file[f"mirror/{axis}_mm"][()][mask], 1e3 * points[:, k], rtol=0, atol=1.5)
            slope = CLEAN.slopes(points[:, 0], points[:, 1])[k]
            np.testing.assert_allclose(file[f"slope/{axis}_rad"][()][mask], slope, rtol=0, atol=4e-5)
            assert np.isfinite(file[f"screen/{axis}_standard_error_mm"][()][mask]).all()
        # the screen's frame of a scene has y upwards and z away from the mirror
        on_screen = 1e3 * CLEAN.on_screen(*fraction) * [1, -1, -1]
        for k, axis in enumerate("xyz"):
            np.testing.assert_allclose(file[f"screen/{axis}_mm"][()][mask], on_screen[:, k], rtol=0, atol=2.0)
        assert file["modulation"].shape == (ROWS, COLUMNS)
        for name in ("height_mm", "deviation_nm", "height_standard_error_nm"):
            assert np.isfinite(file[name][()][mask]).all() and np.isnan(file[name][()][~mask]).all()


@pytest.mark.slow
def test_the_scene_that_was_found_measures_the_same(noisy, irtscots, tmp_path):
    """A folder becomes a scene: its TOML measures what the folder measured."""
    code, _, err = irtscots("reconstruct", noisy, "--scene", noisy.parent, "--out", tmp_path / "a", "--json")
    assert code == 0, err
    code, out, err = irtscots("reconstruct", noisy, "--scene", tmp_path / "a" / "scene.toml", "--out", tmp_path / "b")
    assert code == 0, err
    assert "Fringes" in out and "geometry" not in out.lower()
    with h5py.File(tmp_path / "a" / "result.h5") as one, h5py.File(tmp_path / "b" / "result.h5") as other:
        both = one["mask"][()] & other["mask"][()]
        assert both.sum() > 0.97 * one["mask"][()].sum()
        for name in ("slope/x_rad", "slope/y_rad"):
            # with the aperture of 1 mm that stands in the scene for the unknown one
            np.testing.assert_allclose(one[name][()][both], other[name][()][both], rtol=0, atol=2e-6)


def test_pixels_that_a_mask_leaves_out_are_not_used(clean, irtscots, tmp_path):
    use = np.ones((ROWS, COLUMNS), np.uint8)
    use[:, :50] = 0  # as the images lie in their file
    np.save(tmp_path / "mask.npy", use)
    arguments = ("--scene", clean.parent, "--out", tmp_path / "a", "--mask", tmp_path / "mask.npy")
    code, _, err = irtscots("reconstruct", clean, *arguments)
    assert code == 0, err
    with h5py.File(tmp_path / "a" / "result.h5") as file:
        mask = file["mask"][()]
        assert mask.sum() > 1000 and not mask[:, :50].any()
        assert np.isnan(file["screen/x_fraction"][()][:, :50]).all()


def test_doubtful_files_are_named(clean, tmp_path):
    folder = tmp_path / "lab"
    folder.mkdir()
    path = CLEAN.write(folder, DISPLAYS)
    with h5py.File(path, "a") as file:
        distance = file["MeasurementSofastFringe/dist_optic_screen"]
        distance[()] = distance[()] * 1.03
    with pytest.raises(
        ValueError, match=r"measurement.h5: .*distance: .* the facet's size or the focal length.*--strict"
    ):
        measure_sofast(path, SofastSetup.of_folder(folder), tmp_path / "out", strict=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--measure", "fine"), "--measure: is of line scans"),
        (("--threshold", "0.1"), "--threshold: is of line scans"),
        (("--display", "no.h5"), "no.h5: not a readable HDF5 file: there is no file of that name"),
    ],
)
def test_options_that_do_not_fit_are_refused(clean, irtscots, tmp_path, arguments, message):
    code, _, err = irtscots("reconstruct", clean, "--scene", clean.parent, "--out", tmp_path / "a", *arguments)
    assert code == 2 and message in err and err.count("\n") == 1


def test_a_folder_needs_a_sofast_measurement(clean, irtscots, tmp_path):
    other = tmp_path / "images.h5"
    with h5py.File(other, "w"):
        pass
    code, _, err = irtscots("reconstruct", other, "--scene", clean.parent)
    assert code == 2 and "--scene: a folder of calibration files goes with a SOFAST measurement" in err
    code, _, err = irtscots("reconstruct", clean, "--scene", "sphere", "--display", "a.h5")
    assert code == 2 and "--display: goes with a folder of calibration files as --scene" in err
    code, _, err = irtscots("reconstruct", clean, "--scene", "sphere", "--out", tmp_path / "a")
    assert code == 2 and "camera.detector.pixels = [125, 125]: the images have [96, 80]" in err
