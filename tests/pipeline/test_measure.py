"""Measuring a laboratory's images: what is refused, what is doubted, what is told."""

from __future__ import annotations

import dataclasses
import json

import h5py
import numpy as np
import pytest
from image_faults import FAULTS
from noisy_images import Images, images_of, setup_of, small

from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.measurement.quality import ERROR, OK, WARNING
from irtscots_cl.pipeline.measure import RefusedImagesError, measure
from irtscots_cl.pipeline.picture import MaskChoice

SCENE = small(25)
NOMINAL = SCENE.nominal()
MAKE = {fault.name: fault.make for fault in FAULTS}


@pytest.fixture(autouse=True)
def without_figures(monkeypatch):
    """Figures take longer than all else here."""
    monkeypatch.setattr("irtscots_cl.report.figures.write_figures", lambda *_: [])


def images(fault: str = "none") -> Images:
    return MAKE[fault](images_of(SCENE).noisy(0.002, 1), np.random.default_rng(2))


def failed(facts) -> dict[str, str]:
    return {check["name"]: check["level"] for check in facts["checks"] if check["level"] != OK}


def write(path, of: Images) -> None:
    """As a laboratory would."""
    with h5py.File(path, "w") as file:
        file["images/x"], file["images/y"], file["lines/x_mm"], file["lines/y_mm"] = of.x, of.y, of.lines_x, of.lines_y


# --- the pipeline -------------------------------------------------------------------------------------------


def test_good_images_are_measured_with_their_errors(tmp_path):
    facts = measure(images().stack(), NOMINAL, tmp_path)
    assert facts["measure"] == "likelihood" and failed(facts) == {}
    assert 350 < facts["deviation_nm_rms"]["piston_tilt"] < 420
    assert 0.5 < facts["height_standard_error_nm"] < 5
    for axis in "xy":
        assert 0.02 < facts["slope_standard_error_urad"][axis] < 1
        assert 1 <= facts["of_bound"][axis] < 1.15
    with h5py.File(tmp_path / "result.h5") as file:
        mask = file["mask"][()]
        for name in ("slope/x_standard_error_rad", "centroid/y_standard_error_mm", "light_curve/x_chi_square"):
            assert np.isfinite(file[name][()][mask]).all(), name
        stated = file["height_standard_error_nm"][()][mask]
    assert np.sqrt(np.mean(stated**2)) == pytest.approx(facts["height_standard_error_nm"])


def test_a_scan_of_every_second_line_is_measured_and_says_so(tmp_path):
    of = images()
    every = dataclasses.replace(of, x=of.x[::2], y=of.y[::2], lines_x=of.lines_x[::2], lines_y=of.lines_y[::2])
    facts = measure(every.stack(), NOMINAL, tmp_path)
    assert failed(facts) == {}
    assert 350 < facts["deviation_nm_rms"]["piston_tilt"] < 420
    told = next(check["text"] for check in facts["checks"] if check["name"] == "lines x")
    assert f"; {len(of.lines_x) // 2} of its {len(of.lines_x)} were not recorded" in told


def test_lines_wider_than_the_scene_says_are_no_lines_that_were_left_out(tmp_path):
    of = images()
    wide = [a[:18].reshape(6, 3, *a.shape[1:]).sum(1) for a in (of.x, of.y)]
    joined = dataclasses.replace(of, x=wide[0], y=wide[1], lines_x=of.lines_x[1:18:3], lines_y=of.lines_y[1:18:3])
    with pytest.raises(RefusedImagesError, match="of the mirror's pixels have usable light curves"):
        measure(joined.stack(), NOMINAL, tmp_path, strict=True)


@pytest.mark.parametrize(
    ("fault", "name", "part"),
    [
        ("rows upside down", "orientation", "the rows upside down"),
        ("y scan reversed", "orientation", "the y scan reversed"),
        ("shifted by 5 rows", "outline", "rows"),
    ],
)
def test_wrong_images_are_refused_before_anything_is_written(tmp_path, fault, name, part):
    with pytest.raises(RefusedImagesError, match=f"lab.h5: .*{name}: .*{part}") as caught:
        measure(images(fault).stack(), NOMINAL, tmp_path / "out", source="lab.h5")
    assert str(caught.value).isprintable() and not (tmp_path / "out").exists()


def test_doubtful_images_are_measured_unless_strict(tmp_path):
    stack = images("half exposed frame").stack()
    facts = measure(stack, NOMINAL, tmp_path / "out")
    assert failed(facts) == {"gains x": WARNING}
    with pytest.raises(RefusedImagesError, match=r"gains x: .*frame 10.*\(--strict\)$"):
        measure(stack, NOMINAL, tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()
    measure(images().stack(), NOMINAL, tmp_path / "strict", strict=True)  # good ones pass


@pytest.mark.parametrize(("how", "threshold"), [("paper", 0.0), ("paper", 0.3), ("fine", 0.0)])
def test_a_measure_for_images_without_noise_is_compared_with_the_best(tmp_path, how, threshold):
    facts = measure(images().stack(), NOMINAL, tmp_path, threshold, how)
    assert failed(facts)["measure"] == WARNING
    (check,) = (check for check in facts["checks"] if check["name"] == "measure")
    name = f"--threshold {threshold:g}" if threshold else f"--measure {how}"
    assert name in check["text"] and check["value"] > check["limit"]
    assert not np.isfinite(facts["height_standard_error_nm"])  # not known by that measure
    with pytest.raises(RefusedImagesError, match="measure: the height by"):
        measure(images().stack(), NOMINAL, tmp_path / "strict", threshold, how, strict=True)


def test_without_noise_all_measures_agree(tmp_path):
    facts = measure(images_of(SCENE).stack(), NOMINAL, tmp_path, how="refined")
    (check,) = (check for check in facts["checks"] if check["name"] == "measure")
    assert check["value"] < 1.0, check


# --- a mask -------------------------------------------------------------------------------------------------


def half_mask() -> np.ndarray:
    use = np.zeros((25, 25), bool)
    use[3:20, 4:16] = True
    return use


def test_only_pixels_of_the_mask_are_measured_and_what_is_beside_them_does_not_matter(tmp_path):
    """Rubbish beside the mask: brighter light, of other lines. Without the mask it is refused or doubted."""
    good, use = images(), half_mask()
    spoilt = good.each(lambda a: np.where(use, a, 1.3 * np.roll(a, 4, axis=0)))
    facts = measure(spoilt.stack(), NOMINAL, tmp_path, choice=MaskChoice("file", use))
    assert facts["light_curves_refused"]["empty"] == 0  # pixels beside the mask are not refused, they are not asked
    assert failed(facts).keys() <= {"zernike terms"}  # a part of the mirror does not separate them all
    alone = measure(good.stack(), NOMINAL, tmp_path / "good", choice=MaskChoice("file", use))
    assert alone["deviation_nm_rms"] == facts["deviation_nm_rms"]
    with h5py.File(tmp_path / "result.h5") as file:
        mask = file["mask"][()]
        assert mask.sum() == facts["pixels_used"] and not (mask & ~use).any()
        assert file["images/x"][10][~use].any()  # the file keeps the images as they were
    coverage = setup_of(SCENE).chief_rays.footprint.coverage >= 0.5
    assert 0.95 * (use & coverage).sum() <= mask.sum() <= (use & coverage).sum()


def test_a_mask_of_another_shape_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"a mask of \(24, 25\) .* does not fit images of \(25, 25\)"):
        measure(images().stack(), NOMINAL, tmp_path, choice=MaskChoice("file", half_mask()[1:]))


@pytest.mark.parametrize("orientation", ["upright", "rows-reversed", "quarter-turn"])
def test_the_command_takes_a_mask_that_lies_as_the_images_do(irtscots, tmp_path, monkeypatch, orientation):
    monkeypatch.chdir(tmp_path)
    detector = dataclasses.replace(SCENE.camera.detector, orientation=orientation)
    scene = dataclasses.replace(SCENE, camera=dataclasses.replace(SCENE.camera, detector=detector))
    (tmp_path / "my.toml").write_text(scene.to_toml())
    write(tmp_path / "lab.h5", images().each(lambda a: stored(a, orientation)))
    np.save("use.npy", stored(half_mask(), orientation))
    command = ("reconstruct", "lab.h5", "--scene", "my.toml", "--out", "out", "--mask")
    code, _, err = irtscots(*command, "use.npy")
    assert code == 0, err
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        assert file.attrs["orientation"] == orientation
        mask = upright(file["mask"][()], orientation)
    assert mask.any() and not (mask & ~half_mask()).any()
    np.save("empty.npy", np.zeros((25, 25)))
    code, out, err = irtscots(*command, "empty.npy")
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith("irtscots: --mask = 'empty.npy': is 0 everyw")


# --- the command --------------------------------------------------------------------------------------------


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with the scene's file; writes lab.h5 with a fault."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(SCENE.to_toml())

    def with_fault(name: str):
        write(tmp_path / "lab.h5", images(name))
        return ("reconstruct", "lab.h5", "--scene", "my.toml", "--out", "out")

    return with_fault


def test_the_command_refuses_images_upside_down_and_says_so(irtscots, lab, tmp_path):
    code, out, err = irtscots(*lab("rows upside down"))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("irtscots: lab.h5: orientation: ") and "the rows upside down" in err
    assert not (tmp_path / "out").exists()


def test_the_command_warns_on_stderr_and_in_its_table(irtscots, lab):
    code, out, err = irtscots(*lab("half exposed frame"))
    assert code == 0 and err.count("\n") == 1
    assert err.startswith("irtscots: warning: gains x: x scan: frame 10 0.5 times")
    assert "gains x" in out and "warning" in out and "standard error of the height [nm]" in out


def test_strict_refuses_what_is_doubtful(irtscots, lab, tmp_path):
    code, out, err = irtscots(*lab("half exposed frame"), "--strict")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("irtscots: lab.h5: gains x: ") and err.endswith("(--strict)\n")
    assert not (tmp_path / "out").exists()


def test_the_command_finds_the_ceiling_by_itself(irtscots, lab):
    code, out, err = irtscots(*lab("1 % of the pixels saturated"), "--json")
    facts = json.loads(out)
    assert code == 0 and failed(facts) == {"saturation": WARNING} and "are at 4095" in err


def test_json_has_the_checks_and_errors(irtscots, lab):
    code, out, err = irtscots(*lab("none"), "--json", "--strict")
    assert (code, err) == (0, "")
    facts = json.loads(out, parse_constant=pytest.fail)
    assert facts["measure"] == "likelihood" and 0 < facts["height_standard_error_nm"] < 5
    for check in facts["checks"]:
        assert check.keys() == {"name", "level", "value", "limit", "false_alarm", "text", "cost_nm"}
        assert check["level"] in (OK, WARNING, ERROR) and check["text"]
    assert {"orientation", "saturation", "frames x", "gains y", "profile x"} <= {c["name"] for c in facts["checks"]}
