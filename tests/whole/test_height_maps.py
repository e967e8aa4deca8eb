"""Measured maps through a whole test: file, scene, light, measurement, and file again."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from height_maps import letter, polishing_marks, with_maps
from scenes import coarse

from irtscots_cl.cli import main
from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import open_map, write_map
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.presets import load_scene, preset_text
from irtscots_cl.tracing.trace import trace

CUT_MM = 34.0  # four pixels of `off-axis` on its mirror
SMALL = 61  # detector pixels, 17 mm on the mirror


def measured_and_true(scene, result):
    """Heights in nm of the measured pixels, piston and tilt removed: measured and true."""
    x, y, mask = result.x_mm, result.y_mm, result.height_mask
    true = Surface.of(scene.mirror).deviation_at(x, y)[0]
    return [remove_terms(x, y, h, mask, "piston_tilt")[mask] * 1e6 for h in (result.deviation_mm, true)]


@pytest.mark.slow
def test_polishing_marks_of_a_nanometre_come_back_in_the_band_of_the_pixels():
    """Measured 0.9997, of which 0.03 nm of 0.96 nm are missing: a pixel's own averaging."""
    bare = load_scene("off-axis")
    scene = with_maps(bare, MirrorMap(heights=polishing_marks(bare.mirror.diameter_mm, CUT_MM)))
    light = trace(scene, estimator="analytic")
    assert light.ledger["failed"] == 0
    result = measure_by("fine", light.images(LineScan(scene)), scene.nominal())
    found, true = measured_and_true(scene, result)
    assert 0.9 < true.std() < 1.1 and result.pixels_used > 8500
    assert np.corrcoef(found, true)[0, 1] > 0.999
    assert (found - true).std() < 0.05  # nm
    again = [power(result, h, scene.mirror.diameter_mm) for h in (found, true)]
    np.testing.assert_allclose(again[0], again[1], rtol=0.1)  # in every octave of the band


def power(result, heights, diameter_mm):
    """Power of heights on the pixels used in three octaves of periods, down to CUT_MM."""
    grid = np.zeros(result.mask.shape)
    grid[result.height_mask] = heights
    step = np.nanmedian(np.diff(np.where(result.mask, result.x_mm, np.nan), axis=1))
    spectrum = np.abs(np.fft.fft2(grid)) ** 2
    frequency = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n, step) for n in grid.shape[::-1])))
    edges = np.array([8.0, 4.0, 2.0, 1.0]) * CUT_MM
    return [spectrum[(frequency >= 1 / a) & (frequency < 1 / b)].sum() for a, b in itertools.pairwise(edges)]


TABLES = {  # file, keys of the table, what the file holds beside the letter
    "week.dat": ("", {}),
    "week.datx": ('rotation_deg = 90.0\nflip = "y"\nfactor = -1.0\n', {}),
    "week.fits": ("centre_mm = [40.0, -25.0]\nscale = 1.1\n", {"kind": "wavefront"}),
}


def scene_file(folder, name):
    """A scene whose map is the letter in a file."""
    keys, others = TABLES[name]
    given = letter()
    with np.errstate(all="ignore"):
        write_map(folder / name, HeightMap(given.heights_mm * (2 if others else 1), given.pitch_mm, 632.8, **others))
    path = folder / "letter.toml"
    text = preset_text("sphere").replace("pixels = [125, 125]", f"pixels = [{SMALL}, {SMALL}]")
    text = text.replace("pitch_mm = 0.037", f"pitch_mm = {0.037 * 125 / SMALL}")
    path.write_text(text + f'\n[[mirror.map]]\nfile = "{name}"\noutside = "nearest"\n{keys}', encoding="utf-8")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_a_letter_goes_from_file_to_file(tmp_path, capsys, name):
    """Map, scene, light curves, measurement, result.h5, another format: the same letter, as the table places it."""
    path, out = scene_file(tmp_path, name), tmp_path / "out"
    told = ["--estimator", "analytic", "--measure", "fine", "--out", str(out)]
    assert main(["run", str(path), *told]) == 0
    assert main(["convert", str(out / "result.h5"), str(tmp_path / "back.dat"), "--wavelength-nm", "632.8"]) == 0
    capsys.readouterr()
    read = [open_map(out / "result.h5"), open_map(tmp_path / "back.dat")]
    x, y = read[0].positions_mm()
    surface = Surface.of(load_scene(path).mirror)
    assert np.ptp(surface.deviation_at(x, y)[0]) > 0.9e-4  # mm: the letter is there
    for found in read:
        used = found.valid & surface.contains(x, y, -20.0)
        true = surface.deviation_at(x, y)[0]
        found, true = (remove_terms(x, y, h, used, "piston_tilt")[used] * 1e6 for h in (found.heights_mm, true))
        assert used.sum() > 2000 and np.corrcoef(found, true)[0, 1] > 0.999
        assert (found - true).std() < 1.0  # nm, of a letter of 100 nm: pixels of 17 mm, and their grid
    report = json.loads((out / "report.json").read_text())
    assert report["height_error_nm_rms"]["piston_tilt"] < 1.0
    # its Zernike terms are those of the letter over the pixels, and measured so
    given = {row["noll"]: (row["input_um"], row["output_um"]) for row in report["zernike"]}
    assert max(abs(a) for a, _ in given.values()) > 5e-3  # um
    assert all(abs(a - b) < 1e-3 for noll, (a, b) in given.items() if noll > 3)  # um; no slope tells piston


def test_a_missing_map_ends_a_run_at_once(tmp_path, capsys):
    path = scene_file(tmp_path, "week.dat")
    (tmp_path / "week.dat").unlink()
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "week.dat: mirror.map[0].file: not a readable file" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_what_a_reader_doubts_reaches_the_user_once(tmp_path, capsys):
    path = scene_file(tmp_path, "week.dat")
    path.write_text(path.read_text() + "pitch_mm = 16.5\n", encoding="utf-8")
    assert main(["kernel", str(path)]) == 0
    said = capsys.readouterr().err
    assert said.count("pitch of 16.5 x 16.5 mm as told") == 1


@pytest.mark.slow
def test_slight_maps_keep_their_digits_in_single_precision(device):
    """A letter of 1 pm, whose slopes single precision would lose beside the sphere's."""
    results = []
    for height_mm in (1e-9, -1e-9):  # the same rays: what they err by is the same, but for the letter
        scene = with_maps(coarse("sphere", 25), MirrorMap(heights=letter(height_mm=height_mm), outside="nearest"))
        light = trace(scene, device=device, sampler="sobol", smoothing=True, rays_per_pixel=256, replicates=1)
        results.append(measure_by("fine", light.images(LineScan(scene)), scene.nominal()))
    first, second = results
    found = first.deviation_mm - second.deviation_mm
    true = 2 * Surface.of(with_maps(coarse("sphere", 25), MirrorMap(
        heights=letter(height_mm=1e-9), outside="nearest")).mirror).deviation_at(first.x_mm, first.y_mm)[0]  # fmt: skip
    used = first.height_mask & second.height_mask
    assert np.corrcoef(found[used], true[used])[0, 1] > 0.99
