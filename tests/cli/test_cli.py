"""The command line as its users meet it: what it prints, writes, refuses and returns."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib

import h5py
import numpy as np
import pytest
from faults import FaultyKernel
from scenes import large_segment
from synthetic import small_scene

from irtscots_cl import cli
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.opencl.selftest import check_device
from irtscots_cl.report.seconds import PARTS
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene, preset_names, preset_text

FEW = ("--rays-per-pixel", "64", "--replicates", "4")
FILES = [
    "figures/height.png",
    "figures/images.png",
    "figures/light_curve.png",
    "figures/slopes.png",
    "report.html",
    "report.json",
    "result.h5",
]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def everything_in(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def assert_refused(outcome, code, *parts):
    """One line on stderr that names everything in parts, nothing on stdout."""
    found, out, err = outcome
    assert (found, out) == (code, "")
    assert err.startswith("irtscots: ") and err.count("\n") == 1 and err.endswith("\n")
    for part in parts:
        assert part in err


def small_toml() -> str:
    return small_scene("sphere-deviated", 25).to_toml()


# --- scenes, devices, kernel --------------------------------------------------------------------------------


def test_scenes_lists_every_preset_with_what_it_is(irtscots):
    code, out, err = irtscots("scenes")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == preset_names()
    assert all(len(line.split(maxsplit=1)[1]) > 20 for line in lines)


@pytest.mark.parametrize("name", preset_names())
def test_scenes_prints_a_preset_that_loads(irtscots, name):
    code, out, err = irtscots("scenes", name)
    assert (code, out, err) == (0, preset_text(name), "")
    assert Scene.from_dict(tomllib.loads(out)) == load_scene(name)
    assert json.loads(irtscots("scenes", name, "--json")[1]) == {"name": name, "toml": out}


def test_scenes_as_json(irtscots):
    listed = json.loads(irtscots("scenes", "--json")[1])
    assert [scene["name"] for scene in listed] == preset_names()
    assert all(Scene.from_dict(tomllib.loads(scene["toml"])).name == scene["name"] for scene in listed)


def test_devices(irtscots, device):
    code, out, _ = irtscots("devices")
    assert code == 0
    assert f"{device.index}  {device.name}" in out
    found = json.loads(irtscots("devices", "--json")[1])
    mine = next(facts for facts in found if facts["index"] == device.index)
    assert {"name", "platform", "driver", "kind", "compute_units", "fp64", "sqrt_error_ulp"} <= set(mine)


def test_without_a_device_the_list_says_what_to_install(irtscots, monkeypatch):
    monkeypatch.setattr("irtscots_cl.opencl.device.all_devices", tuple)
    assert_refused(irtscots("devices"), 3, "no OpenCL device found; install one: pip install")


@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_kernel_prints_source_that_stands_alone(irtscots, device, estimator):
    code, out, err = irtscots("kernel", "sphere", "--estimator", estimator, "--device", device.index)
    assert (code, err) == (0, "")
    assert out.startswith("// build options: ") and "-cl-std=" in out.splitlines()[0]
    assert f"trace_{estimator}(" in out and "#include" not in out
    data = json.loads(irtscots("kernel", "sphere", "--estimator", estimator, "--json", "--device", device.index)[1])
    assert out.endswith(data["source"]) and f"trace_{estimator}.cl" in data["files"]
    assert out.splitlines()[0] == f"// build options: {' '.join(data['options'])}"


def test_the_printed_kernel_builds_by_itself(irtscots, device):
    cl = pytest.importorskip("pyopencl")
    data = json.loads(irtscots("kernel", "off-axis", "--json", "--device", device.index)[1])
    program = cl.Program(device.context, data["source"]).build(options=data["options"], cache_dir=False)
    assert [kernel.function_name for kernel in program.all_kernels()] == ["trace_adjoint"]


@pytest.mark.parametrize("sampler", ["philox", "sobol"])
def test_kernel_prints_the_smoothed_one(irtscots, device, sampler):
    arguments = ("kernel", "sphere", "--smoothing", "--sampler", sampler, "--device", device.index)
    code, out, err = irtscots(*arguments)
    assert (code, err) == (0, "")
    assert "trace_lines(" in out and "trace_adjoint(" not in out and "#include" not in out
    assert "trace_lines.cl" in json.loads(irtscots(*arguments, "--json")[1])["files"]


# --- run ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(device, tmp_path_factory):
    """Folder and scene file of a finished run: a small detector, few rays."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "my.toml").write_text(small_toml())
    arguments = [
        "run",
        folder / "my.toml",
        "--out",
        folder / "out",
        "--device",
        device.index,
        "--seed",
        "5",
        *FEW,
    ]
    assert cli.main([str(argument) for argument in arguments]) == 0
    return folder


def test_run_writes_all_files_and_nothing_else(finished):
    assert everything_in(finished / "out") == FILES
    report = json.loads((finished / "out" / "report.json").read_text(), parse_constant=pytest.fail)
    assert (report["scene"], report["seed"], report["replicates"]) == ("sphere-deviated", 5, 4)
    assert sum(n for fate, n in report["ledger"].items() if fate != "launched") == report["rays_total"]
    seconds = report["seconds"]
    assert set(seconds) == {*PARTS, "kernels", "total"} and min(seconds.values()) >= 0
    assert seconds["total"] == pytest.approx(sum(seconds[part] for part in PARTS)) and seconds["store"] > 0
    page = (finished / "out" / "report.html").read_text()
    assert all(source.startswith("data:") for source in re.findall(r'src="([^"]+)"', page))


def test_result_h5_tells_where_it_comes_from(finished, device):
    with h5py.File(finished / "out" / "result.h5") as file:
        attributes = dict(file.attrs)
    assert Scene.from_dict(tomllib.loads(attributes["scene"])) == small_scene("sphere-deviated", 25)
    assert (attributes["seed"], attributes["device"], attributes["estimator"]) == (
        "5",
        device.name,
        "adjoint",
    )
    assert {"driver", "sampler", "precision", "version numpy", "version irtscots-cl"} <= set(attributes)


def test_run_prints_tables_with_units_and_where_the_results_are(irtscots, device, here):
    (here / "my.toml").write_text(small_toml())
    code, out, err = irtscots("run", "my.toml", "--device", device.index, *FEW)
    assert (code, err) == (0, "")
    assert out.splitlines()[0].strip() == f"sphere-deviated, adjoint estimator on {device.name}"
    for text in (
        "slope x [urad]",
        "height without piston, tilt [nm]",
        "in [um]",
        "difference [nm]",
        "predicted",
    ):
        assert text in out
    assert out.endswith(f"results in {os.path.join('irtscots-out', 'sphere-deviated')}\n")
    assert everything_in(here / "irtscots-out" / "sphere-deviated") == FILES  # the default folder
    assert "\x1b" not in out  # no colours in a pipe


def test_run_as_json_prints_the_report_and_replaces_an_older_one(irtscots, device, here):
    (here / "my.toml").write_text(small_toml())
    seeds = []
    for seed in (1, 2):
        code, out, err = irtscots(
            "run", "my.toml", "--out", "out", "--json", "--seed", seed, "--device", device.index, *FEW
        )
        assert (code, err) == (0, "")
        report = json.loads(out, parse_constant=pytest.fail)
        assert report == json.loads((here / "out" / "report.json").read_text())
        seeds.append(report["seed"])
        assert everything_in(here) == sorted(["my.toml", *(f"out/{name}" for name in FILES)])
    assert seeds == [1, 2]


@pytest.fixture
def without_figures(monkeypatch):
    """Figures take longer than all else in a small run."""
    monkeypatch.setattr("irtscots_cl.report.figures.write_figures", lambda *_: [])


def only_warnings(err: str) -> bool:
    """Whether stderr holds nothing but lines that warn of the images; a run of few rays has some."""
    return all(line.startswith("irtscots: warning: ") for line in err.splitlines())


def warned_facts_of(outcome):
    """As report_of, of a command that may warn."""
    code, out, err = outcome
    assert code == 0 and only_warnings(err), err
    return json.loads(out, parse_constant=pytest.fail)


def report_of(outcome):
    code, out, err = outcome
    assert (code, err) == (0, "")
    return json.loads(out, parse_constant=pytest.fail)


@pytest.fixture
def analytic(irtscots, here):
    """Runs my.toml by the analytic estimator, with more options: its report."""
    (here / "my.toml").write_text(small_toml())

    def call(*more):
        return report_of(irtscots("run", "my.toml", "--estimator", "analytic", "--json", "--out", "out", *more))

    return call


def test_no_figures_leaves_none_not_even_of_an_earlier_run(analytic, here):
    analytic()
    (here / "out/figures/mine.png").write_bytes(b"")
    analytic("--no-figures")
    assert everything_in(here / "out") == ["figures/mine.png", *(name for name in FILES if "figures" not in name)]
    (here / "out/figures/mine.png").unlink()
    analytic("--no-figures")
    assert not (here / "out/figures").exists()
    assert "figures/" not in (here / "out/report.html").read_text()


def test_the_analytic_estimator_needs_no_device(irtscots, analytic, here, monkeypatch):
    monkeypatch.setenv("IRTSCOTS_DEVICE", "nonsense")
    report = analytic()
    assert everything_in(here / "out") == FILES
    assert (report["estimator"], report["device"]["name"], report["precision"]) == ("analytic", "host", "fp64")
    assert sum(n for fate, n in report["ledger"].items() if fate != "launched") == report["rays_total"]
    assert report["predicted"]["height_ray_noise_nm_rms"] == 0.0
    assert report["height_standard_error_nm"] is None and report["replicates"] == 1
    # the same variable where a device is needed
    assert_refused(irtscots("run", "my.toml", "--out", "other", *FEW), 3, "IRTSCOTS_DEVICE", "nonsense")


def test_an_analytic_run_prints_its_tables(irtscots, here):
    (here / "my.toml").write_text(small_toml())
    code, out, err = irtscots("run", "my.toml", "--estimator", "analytic", "--measure", "refined", "--out", "out")
    assert (code, err) == (0, "")
    assert out.splitlines()[0].strip() == "sphere-deviated, analytic estimator on host"
    assert "height without piston, tilt [nm]" in out and out.endswith("results in out\n")
    page = (here / "out" / "report.html").read_text()
    assert "analytic" in page


def test_measures_are_reported_and_each_is_more_exact_than_the_one_before(analytic, here, without_figures):
    errors, updates = [], []
    for measure in ("paper", "fine", "refined"):
        report = analytic("--measure", measure)
        assert (report["measure"], report["smoothing"]) == (measure, False)
        with h5py.File(here / "out" / "result.h5") as file:
            assert file.attrs["measure"] == measure
        errors.append(report["height_error_nm_rms"]["piston_tilt"])
        updates.append(report["refinement_updates_nm"])
    assert updates[:2] == [[], []] and 2 <= len(updates[2]) <= 4
    assert sorted(updates[2], reverse=True) == updates[2]
    # nm: 10 by averaging over pixels of 43 mm to the second order, 0.8 to the fourth, 0.005 by the unknown piston
    assert errors[0] > 5 > 2 > errors[1] > 0.2 > 0.02 > errors[2]


def test_paper_is_the_measure_unless_told_otherwise(finished):
    report = json.loads((finished / "out" / "report.json").read_text())
    assert (report["measure"], report["refinement_updates_nm"], report["smoothing"]) == ("paper", [], False)


def test_smoothing_is_reported_and_has_less_noise(irtscots, finished, device, here):
    arguments = ("run", finished / "my.toml", "--out", "out", "--seed", "5", "--device", device.index, *FEW)
    smooth = report_of(irtscots(*arguments, "--smoothing", "--json"))
    rough = json.loads((finished / "out" / "report.json").read_text())
    assert smooth["smoothing"] is True and smooth["estimator"] == "adjoint"
    assert sum(n for fate, n in smooth["ledger"].items() if fate != "launched") == smooth["rays_total"]
    assert smooth["rays_total"] == rough["rays_total"]
    for axis in ("x", "y"):
        # 2.3 times here, where a pixel's own image is as large as the aperture's; 393 pixels tell the ratio to 5 %
        assert smooth["slope_error_urad_rms"][axis] < 0.7 * rough["slope_error_urad_rms"][axis]
    assert everything_in(here / "out") == FILES


# --- reconstruct --------------------------------------------------------------------------------------------


def test_reconstruct_finds_in_a_run_s_images_what_the_run_found(irtscots, finished, here):
    code, out, err = irtscots(
        "reconstruct", finished / "out" / "result.h5", "--scene", finished / "my.toml", "--json", "--measure", "paper"
    )
    assert code == 0 and only_warnings(err)
    folder = here / "irtscots-out" / "sphere-deviated-measured"
    assert everything_in(folder) == [*FILES, "scene.toml"]
    with h5py.File(finished / "out" / "result.h5") as run, h5py.File(folder / "result.h5") as again:
        for name in ("deviation_nm", "slope/x_rad", "centroid/y_mm"):
            np.testing.assert_allclose(
                again[name][()],
                run[name][()],
                rtol=1e-9,
                atol=1e-9,  # rounding of the mean
            )
        np.testing.assert_array_equal(again["mask"][()], run["mask"][()])
        assert "zernike" not in again.attrs["scene"]  # the design alone was used
    facts, report = json.loads(out), json.loads((finished / "out" / "report.json").read_text())
    for key in ("scene", "pixels_used", "light_curves_refused"):
        assert facts[key] == report[key]
    assert 300 < facts["deviation_nm_rms"]["piston_tilt"] < 500  # nm: 385 and the noise of few rays


def test_reconstruct_prints_a_table(irtscots, finished, here):
    code, out, err = irtscots(
        "reconstruct", finished / "out" / "result.h5", "--scene", finished / "my.toml", "--out", "lab"
    )
    assert code == 0 and only_warnings(err)
    assert "without piston, tilt [nm]" in out and out.endswith("results in lab\n")
    assert "Zernike coefficients (Noll)" in out and "slopes of no surface" in out


def test_reconstruct_tells_the_islands_and_the_coefficients(irtscots, finished, here):
    """The middle columns dark: two parts whose pistons are unknown, said on stderr, in the table and in JSON."""
    with h5py.File(finished / "out" / "result.h5") as file, h5py.File("halves.h5", "w") as halves:
        for name in ("images/x", "images/y", "lines/x_mm", "lines/y_mm"):
            halves[name] = file[name][()]
        columns = file["mask"].shape[1]
        for name in ("images/x", "images/y"):
            halves[name][:, :, columns // 2 - 4 : columns // 2 + 5] = 0.0
    arguments = ("reconstruct", "halves.h5", "--scene", finished / "my.toml", "--out", "lab")
    code, out, err = irtscots(*arguments)
    assert code == 0 and "2 islands in 2 joined groups" in out and "unknown" in out
    assert "irtscots: warning: islands: the mask has 2 islands in 2 groups" in err
    code, out, err = irtscots(*arguments, "--json")
    facts = json.loads(out, parse_constant=pytest.fail)
    assert code == 0 and facts["islands"]["groups"] == 2 and facts["islands"]["largest"][1]["piston_known"] is False
    told = [f"irtscots: warning: {c['name']}: {c['text']}" for c in facts["checks"] if c["level"] != "ok"]
    assert told == err.splitlines()
    assert facts["zernike_fit"]["standard_errors_from"] == "images"
    astigmatism = next(row for row in facts["zernike"] if row["noll"] == 6)
    assert abs(astigmatism["output_um"] - 0.3266) < 5 * astigmatism["standard_error_um"] + 0.02  # other terms' share
    with h5py.File(here / "lab" / "result.h5") as file:
        assert set(np.unique(file["island_groups"][()])) == {0, 1, 2}
        assert np.array_equal(file["islands"][()] > 0, file["mask"][()])


def test_reconstruct_refuses_images_that_do_not_fit(irtscots, finished, here):
    images = finished / "out" / "result.h5"
    assert_refused(
        irtscots("reconstruct", images, "--scene", "sphere"),
        2,
        "images of (25, 25) and (25, 25) (rows, columns) do not fit; must be of the scene's detector, (125, 125)",
    )
    (here / "text.h5").write_text("no HDF5")
    assert_refused(irtscots("reconstruct", "text.h5", "--scene", "sphere"), 2, "text.h5: not a readable HDF5 file")
    assert_refused(irtscots("reconstruct", "none.h5", "--scene", "sphere"), 2, "none.h5: not a readable HDF5 file")
    assert_refused(irtscots("reconstruct", images, "--scene", "none"), 2, "none: unknown scene")
    assert_refused(irtscots("reconstruct", images), 2, "--scene", "see irtscots reconstruct --help")
    for threshold in ("1", "-0.1", "nan"):
        assert_refused(
            irtscots("reconstruct", images, "--scene", "sphere", f"--threshold={threshold}"),
            2,
            "--threshold = ",
            "must be at least 0 and below 1",
        )
    assert everything_in(here) == ["text.h5"]


@pytest.mark.parametrize(
    ("measure", "options"),
    [(name, ("--measure", name)) for name in ("paper", "fine", "refined", "windowed", "likelihood")],
)
def test_reconstruct_measures_as_the_run_did(irtscots, analytic, here, without_figures, measure, options):
    report = analytic(*options)
    arguments = ("reconstruct", "out/result.h5", "--scene", "my.toml", "--out", "lab", "--json")
    facts = warned_facts_of(irtscots(*arguments, *options))
    assert facts["measure"] == measure
    assert facts["refinement_updates_nm"] == pytest.approx(report["refinement_updates_nm"], rel=0.01, abs=1e-6)
    with h5py.File("out/result.h5") as run, h5py.File("lab/result.h5") as again:
        assert again.attrs["measure"] == measure
        np.testing.assert_allclose(
            again["deviation_nm"][()],
            run["deviation_nm"][()],
            rtol=0,
            atol=1e-5,  # nm: rounding of 385, and of the last round's change
        )


@pytest.fixture
def thirty_saturated(finished):
    """A value of a run's images that 30 of its pixels reach, and which of the used pixels do."""
    with h5py.File(finished / "out" / "result.h5") as file:
        peaks = np.maximum(file["images/x"][()].max(0), file["images/y"][()].max(0))
        mask = file["mask"][()]
    limit = float(np.sort(peaks[mask])[-30])  # a value of the images, and it is saturated
    return limit, mask, mask & (peaks >= limit)


def test_saturated_pixels_are_counted_and_left_out_by_measures_of_whole_curves(
    irtscots, finished, here, without_figures, thirty_saturated
):
    limit, mask, full = thirty_saturated
    arguments = ("reconstruct", finished / "out" / "result.h5", "--scene", finished / "my.toml", "--out", "lab")
    arguments += ("--json", "--measure", "paper")
    plain = warned_facts_of(irtscots(*arguments))
    facts = warned_facts_of(irtscots(*arguments, "--saturation", repr(limit)))
    assert facts["light_curves_refused"]["saturated"] >= 30 and plain["light_curves_refused"]["saturated"] == 0
    assert facts["pixels_used"] == plain["pixels_used"] - 30
    with h5py.File(here / "lab" / "result.h5") as file:
        np.testing.assert_array_equal(file["mask"][()], mask & ~full)
        assert (file["flags"][()][full] == 4).all()
    above = warned_facts_of(irtscots(*arguments, "--saturation", repr(2 * limit)))
    assert above == plain == warned_facts_of(irtscots(*arguments, "--saturation", "inf"))


def test_saturated_pixels_are_measured_from_their_other_samples(
    irtscots, finished, here, without_figures, thirty_saturated
):
    """A light curve of seven samples tells its place without the highest one."""
    limit, _, full = thirty_saturated
    arguments = ("reconstruct", finished / "out" / "result.h5", "--scene", finished / "my.toml", "--json")
    plain = warned_facts_of(irtscots(*arguments, "--out", "all"))
    code, out, err = irtscots(*arguments, "--out", "lab", "--saturation", repr(limit))
    assert code == 0 and "irtscots: warning: saturation: " in err and "left out; expose less" in err
    facts = json.loads(out, parse_constant=pytest.fail)
    assert facts["light_curves_refused"]["saturated"] == 0 and facts["pixels_used"] == plain["pixels_used"]
    with h5py.File(here / "all" / "result.h5") as whole, h5py.File(here / "lab" / "result.h5") as part:
        np.testing.assert_array_equal(part["mask"][()], whole["mask"][()])
        moved = (part["centroid/x_mm"][()] - whole["centroid/x_mm"][()])[full]
        error = part["centroid/x_standard_error_mm"][()][full]
    assert np.abs(moved).max() > 0 and np.abs(moved / error).max() < 6  # of curves that lost a sample: by its noise


@pytest.mark.parametrize(
    ("option", "parts"),
    [
        (("--saturation", "0"), ("--saturation = 0.0: must be above 0",)),
        (("--saturation=-1",), ("--saturation = -1.0: must be above 0",)),
        (("--saturation", "nan"), ("--saturation = nan: must be above 0",)),
        (("--saturation", "x"), ("--saturation", "'x'", "see irtscots reconstruct --help")),
        (("--saturation", "1e-300"), ("pixels: only 0.0% of the mirror's pixels", "393 saturated", "too few")),
        (("--saturation", "1e-300", "--measure", "paper"), ("pixels: only 0.0%", "393 saturated")),
        (("--measure", "bad"), ("--measure = 'bad': must be one of paper, fine, refined, windowed, likelihood",)),
        (("--measure",), ("--measure", "see irtscots reconstruct --help")),
        (("--zernike", "square"), ("--zernike = 'square': must be one of circular, annular",)),
    ],
)
def test_reconstruct_refuses_what_it_cannot_use(irtscots, finished, here, option, parts):
    images, scene = finished / "out" / "result.h5", finished / "my.toml"
    assert_refused(irtscots("reconstruct", images, "--scene", scene, "--out", "lab", *option), 2, *parts)
    assert everything_in(here) == []


# --- refusals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("radius_mm = 4166.747", "raduis_mm = 4166.747", ("mirror.raduis_mm", "unknown key", "radius_mm")),
        ("pitch_mm = 0.2\n", "", ("screen.pitch_mm", "missing", "a finite number at least 1e-12")),
        (
            "diameter_mm = 1064.0",
            "diameter_mm = '1064'",
            ("mirror.diameter_mm = '1064'", "a finite number at least 1e-12"),
        ),
        (
            "diameter_mm = 1064.0",
            "diameter_mm = nan",
            ("mirror.diameter_mm = nan", "a finite number at least 1e-12"),
        ),
        ("focal_length_mm = 16.0", "focal_length_mm = -16.0", ("camera.focal_length_mm = -16.0", "at least 1e-12")),
        (
            "pixels = [125, 125]",
            "pixels = [125.5, 125]",
            ("camera.detector.pixels", "two integers from 1 to 16384"),
        ),
        ("conic = 0.0", "conic = 70.0", ("mirror.diameter_mm = 1064.0", "be below", "where the conic ends")),
        (
            "[-218.0707, 0.0, 4161.0366]",
            "[-218.0707, 0.0, -4161.0366]",
            ("camera.position_mm = [-218.0707, 0.0, -4161.0366]", "lie in front of the mirror: z above"),
        ),
        (
            "[screen]",
            "[[mirror.zernike]]\nradius_mm = 532.0\nnoll_um = { 0 = 0.1 }\n[screen]",
            ("mirror.zernike[0].noll_um.0 = 0.1", "a noll index from 1 to 861"),
        ),
        (
            "pitch_mm = 0.2\n",
            "pitch_mm = 0.2\ncentre_offset_mm = [90.0, 0.0]\n",
            ("screen.position_mm", "no detector pixel sees the screen in the mirror", "-90"),
        ),
        (
            "look_at_mm = [0.0, 0.0, 0.0]  #",
            "look_at_mm = [2000.0, 0.0, 0.0]  #",
            ("camera.look_at_mm = [2000.0, 0.0, 0.0]", "no detector pixel sees the mirror"),
        ),
        ('name = "sphere"', 'name = "../sphere"', ("name = '../sphere'", "1 to 64 characters")),
        ("[mirror]", "[mirror", ("is not valid TOML",)),
    ],
)
def test_a_bad_scene_file_is_refused_in_one_line_and_nothing_is_written(irtscots, device, here, old, new, parts):
    text = preset_text("sphere")
    assert text.count(old) == 1, "the test changes one thing"
    (here / "my.toml").write_text(text.replace(old, new))
    assert_refused(irtscots("run", "my.toml", "--device", device.index, *FEW), 2, "my.toml: ", *parts)
    assert everything_in(here) == ["my.toml"] and not (here / "irtscots-out").exists()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("run", "spere"), ("spere: unknown scene", "did you mean sphere?")),
        (("run", "none.toml"), ("none.toml: cannot be read",)),
        (("kernel", "spere"), ("spere: unknown scene",)),
        (("scenes", "spere"), ("spere: unknown scene", "off-axis")),
        (
            ("run", "sphere", "--rays-per-pixel", "0"),
            ("--rays-per-pixel = 0: must be at least the 8 replicates",),
        ),
        (("run", "sphere", "--rays-per-pixel=-5"), ("--rays-per-pixel = -5: must be at least",)),
        (
            ("run", "sphere", "--rays-per-pixel", "7"),
            ("--rays-per-pixel = 7: must be at least the 8 replicates",),
        ),
        (
            ("run", "sphere", "--rays-per-pixel", "abc"),
            ("--rays-per-pixel", "'abc'", "see irtscots run --help"),
        ),
        (("run", "sphere", "--rays-per-pixel", "9" * 30), ("--rays-per-pixel = 999", "at most 2^40")),
        (("run", "sphere", "--replicates", "0"), ("--replicates = 0: must be 1 to 1024",)),
        (("run", "sphere", "--estimator", "foo"), ("--estimator = 'foo': must be one of forward, adjoint",)),
        (("run", "sphere", "--precision", "fp16"), ("precision = 'fp16': must be one of fp32, fp64",)),
        (("run", "sphere", "--sampler", "x"), ("--sampler = 'x': must be one of philox",)),
        (("run", "sphere", "--seed", "-1"), ("--seed = -1: must be 0 to 2^64 - 1",)),
        (("run", "sphere", "--overfill", "0.5"), ("--overfill = 0.5: must be 1 to 10000",)),
        (("run", "sphere", "--overfill", "nan"), ("--overfill = nan: must be 1 to 10000",)),
        (("paths", "sphere", "--overfill", "0.5"), ("--overfill = 0.5: must be 1 to 10000",)),
        (("run", "sphere", "--measure", "bad"), ("--measure = 'bad': must be one of paper, fine, refined, ",)),
        (
            ("run", "sphere", "--smoothing", "--estimator", "forward"),
            ("--smoothing: must go with --estimator adjoint, not forward",),
        ),
        (
            ("run", "sphere", "--smoothing", "--estimator", "analytic"),
            ("--smoothing: must go with --estimator adjoint, not analytic",),
        ),
        (
            ("kernel", "sphere", "--smoothing", "--estimator", "forward"),
            ("--smoothing: must go with --estimator adjoint, not forward",),
        ),
        (
            ("kernel", "sphere", "--estimator", "analytic"),
            ("--estimator = 'analytic': has no kernel; must be one of forward, adjoint",),
        ),
        (("run", "sphere", "--out", "file"), ("--out = 'file': file is not a folder",)),
        (("run", "sphere", "--out", "file/below"), ("--out = 'file/below': ", "file is not a folder")),
        (("run", "sphere", "--out", "x" * 300), ("File name too long",)),
        (
            ("kernel", "sphere", "--estimator", "foo"),
            ("--estimator = 'foo': must be one of forward, adjoint",),
        ),
        (("kernel", "sphere", "--precision", "fp16"), ("precision = 'fp16': must be one of fp32, fp64",)),
        (("run",), ("the following arguments are required: SCENE", "see irtscots run --help")),
        (("run", "sphere", "--foo"), ("unrecognized arguments: --foo",)),
        ((), ("the following arguments are required: COMMAND", "see irtscots --help")),
        (("fly",), ("invalid choice: 'fly'", "reconstruct")),
    ],
)
def test_a_bad_argument_is_refused_in_one_line_and_nothing_is_written(irtscots, here, arguments, parts):
    (here / "file").write_text("")
    assert_refused(irtscots(*arguments), 2, *parts)
    assert everything_in(here) == ["file"] and not (here / "irtscots-out").exists()


@pytest.mark.parametrize("wrong", [("--measure", "bad"), ("--smoothing", "--estimator", "forward")], ids=str)
def test_a_wrong_choice_is_refused_before_any_ray_is_traced(irtscots, here, monkeypatch, wrong):
    monkeypatch.setattr("irtscots_cl.pipeline.simulate.simulate", lambda *_, **__: pytest.fail("traced"))
    monkeypatch.setenv("IRTSCOTS_DEVICE", "nonsense")  # and before a device is looked for
    assert_refused(irtscots("run", "sphere", *wrong), 2, "must ")


def test_an_unusable_output_folder_is_refused_before_any_ray_is_traced(irtscots, here, monkeypatch):
    monkeypatch.setattr("irtscots_cl.pipeline.simulate.simulate", lambda *_, **__: pytest.fail("traced"))
    (here / "file").write_text("")
    assert_refused(irtscots("run", "sphere", "--out", "file"), 2, "file is not a folder")


def test_an_output_folder_without_permission_is_refused(irtscots, here):
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    (here / "locked").mkdir(mode=0o500)
    assert_refused(irtscots("run", "sphere", "--out", "locked/out"), 2, "no permission to write in")


@pytest.mark.parametrize("command", ["run", "kernel"])
def test_an_unknown_device_is_code_3_and_the_line_names_those_found(irtscots, device, here, command):
    assert_refused(irtscots(command, "sphere", "--device", "no such"), 3, "--device = 'no such'", device.name)
    assert everything_in(here) == []


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "irtscots: interrupted; nothing was written\n"),
        (OSError(28, "No space left on device"), 2, "irtscots: [Errno 28] No space left on device\n"),
        (MemoryError(), 3, "irtscots: too little memory on the host\n"),
        (MemoryError("no 9 TiB"), 3, "irtscots: too little memory on the host: no 9 TiB\n"),
    ],
)
def test_what_stops_a_run_is_one_line(irtscots, device, here, monkeypatch, error, code, line):
    def stop(*_, **__):
        raise error

    monkeypatch.setattr("irtscots_cl.pipeline.simulate.simulate", stop)
    assert irtscots("run", "sphere", "--device", device.index) == (code, "", line)
    assert everything_in(here) == []


@pytest.mark.parametrize("starting", [True, False])
@pytest.mark.parametrize("command", [("run",), ("run", "--estimator", "nonsequential"), ("paths",)], ids=" ".join)
def test_a_device_that_is_lost_in_mid_run_is_one_line(irtscots, device, here, monkeypatch, command, starting):
    check_device(device, "fp32")  # or that would fail first
    kernel = FaultyKernel("DEVICE_NOT_AVAILABLE", good=4, starting=starting)
    monkeypatch.setattr("irtscots_cl.opencl.kernel.cl.Kernel", kernel)
    (here / "my.toml").write_text(small_toml())
    name, *more = command
    outcome = irtscots(name, "my.toml", "--device", device.index, *more, *FEW)
    assert_refused(outcome, 3, device.label, "failed: DEVICE_NOT_AVAILABLE")
    assert len(kernel.tried) == 5
    assert everything_in(here) == ["my.toml"]


def test_a_device_that_computes_wrongly_is_one_line(irtscots, device, here, monkeypatch):
    def wrong(*_):
        raise DeviceError(f"{device.label}: computes wrongly: this and that")

    monkeypatch.setattr("irtscots_cl.opencl.kernel.check_device", wrong)
    monkeypatch.setattr("irtscots_cl.opencl.selftest.check_device", wrong)
    assert_refused(irtscots("run", "sphere", "--device", device.index), 3, "computes wrongly: this and that")
    assert everything_in(here) == []
    code, out, err = irtscots("devices")  # the list is no refusal: others may be good
    assert (code, err) == (0, "") and "computes wrongly: this and that" in out
    assert all("unusable" in facts for facts in json.loads(irtscots("devices", "--json")[1]))


def test_a_fault_of_the_program_keeps_its_traceback(monkeypatch, device):
    def fail(*_, **__):
        raise RuntimeError("a bug")

    monkeypatch.setattr("irtscots_cl.pipeline.simulate.simulate", fail)
    with pytest.raises(RuntimeError, match="a bug"):
        cli.main(["run", "sphere", "--device", device.index])


# --- as a program -------------------------------------------------------------------------------------------


def program(*arguments, **options):
    command = [sys.executable, "-m", "irtscots_cl", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)


@pytest.mark.parametrize("command", [(), ("run",), ("scenes",), ("devices",), ("kernel",), ("reconstruct",)])
def test_every_command_has_help_without_loading_anything_slow(irtscots, command):
    code, out, err = irtscots(*command, "--help")
    assert (code, err) == (0, "")
    assert out.startswith("usage: irtscots")
    assert not command or "--json" in out


def test_python_dash_m_is_the_command():
    done = program("scenes")
    assert (done.returncode, done.stderr) == (0, "")
    assert "\noff-axis " in done.stdout


def test_exit_codes_and_lines_reach_the_shell(tmp_path):
    refused = program("run", "spere", cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith("irtscots: spere: unknown scene") and refused.stderr.count("\n") == 1
    without = program("run", "sphere", cwd=tmp_path, env=os.environ | {"IRTSCOTS_DEVICE": "no such"})
    assert (without.returncode, without.stdout) == (3, "")
    assert "IRTSCOTS_DEVICE" in without.stderr and without.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == []


def test_a_whole_run_as_a_program_says_nothing_on_stderr(device, tmp_path):
    (tmp_path / "my.toml").write_text(small_toml())
    done = program("run", "my.toml", "--json", "--device", device.index, *FEW, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    # of 393 pixels on the mirror; few rays and large pixels lose some
    assert json.loads(done.stdout)["pixels_used"] > 380


def test_a_reader_that_has_seen_enough_is_no_error():
    read, write = os.pipe()
    os.close(read)  # as if `head` had gone
    with os.fdopen(write, "w") as closed:
        done = subprocess.run(
            [sys.executable, "-m", "irtscots_cl", "scenes", "sphere"],
            stdout=closed,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            check=False,
        )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("option", [("--bounce-limit", "4"), ("--least-chance", "0.2"), ("--branches", "split"),
                                    ("--no-aimed-scatter",)])  # fmt: skip
def test_run_takes_the_choices_of_the_nonsequential_estimator_for_it_alone(irtscots, monkeypatch, option):
    seen = []
    monkeypatch.setattr("irtscots_cl.pipeline.simulate.simulate", lambda *_, **given: seen.append(given) or 1 / 0)
    code, _, err = irtscots("run", "sphere", *option)
    assert code == 2 and "must go with --estimator nonsequential, not adjoint" in err and not seen
    with pytest.raises(ZeroDivisionError):
        irtscots("run", "sphere", "--estimator", "nonsequential", *option)
    name = {"--no-aimed-scatter": "aimed_scatter"}.get(option[0], option[0].strip("-").replace("-", "_"))
    assert str(seen[0][name]) == (option[1] if option[1:] else "False")


# --- noise --------------------------------------------------------------------------------------------------

CAMERA = """[camera.detector.noise]
electrons_at_peak = 1e5
shot_noise = true
bits = 12
gain_e_per_dn = 30.0
exposures = 2
"""


def test_run_takes_noise_from_a_file(irtscots, here):
    (here / "small.toml").write_text(small_toml())
    (here / "camera.toml").write_text(CAMERA)
    arguments = ("run", "./small.toml", "--estimator", "analytic", "--noise", "camera.toml", "--json", "--quiet")
    code, out, _ = irtscots(*arguments)
    assert code == 0
    report = json.loads(out)
    assert report["noise"]["saturation"] == 4095
    assert report["noise"]["detector"]["bits"] == 12
    with h5py.File("irtscots-out/sphere-deviated/result.h5") as file:
        assert file["images/x"].attrs["unit"] == "DN"
        doubled = file["images/x"][()] * 2  # the mean of two exposures
        np.testing.assert_array_equal(doubled, np.rint(doubled))
        own = file.attrs["scene"]
    (here / "own.toml").write_text(own)  # the scene of a result repeats it
    code, again, _ = irtscots("run", "./own.toml", "--estimator", "analytic", "--json", "--quiet")
    assert code == 0
    assert json.loads(again)["height_error_nm_rms"] == report["height_error_nm_rms"]


def test_noise_that_does_not_work_is_refused(irtscots, here):
    (here / "camera.toml").write_text(CAMERA)
    (here / "empty.toml").write_text("")
    (here / "map.toml").write_text('[screen.response]\nbrightness_map = "no.npy"\n')
    for file, options, parts in (
        ("camera.toml", ("--parts",), ["--parts: must be left out with noise"]),
        ("camera.toml", ("--target-nm", "5"), ["--target-nm: must be left out with a table [camera.detector.noise]"]),
        ("camera.toml", ("--replicates", "1", "--smoothing", "--noise", "none.toml"), ["none.toml: cannot be read"]),
        ("empty.toml", (), ["empty.toml: has no noise; must have a table [camera.detector.noise] or "]),
        ("map.toml", (), ["no.npy: screen.response.brightness_map: cannot be read: No such file"]),
        ("map.toml", ("--smoothing",), ["screen.response: uneven brightness", "which --smoothing does not give"]),
    ):
        assert_refused(irtscots("run", "sphere", "--noise", file, *options), 2, *parts)
    assert everything_in(here) == ["camera.toml", "empty.toml", "map.toml"]


def test_paths_warns_on_one_line_of_height_that_rounding_adds(irtscots, device, here):
    (here / "segment.toml").write_text(large_segment(9).to_toml())
    code, out, err = irtscots("paths", "segment.toml", "--rays-per-pixel", 64, "--device", device.index, "--quiet")
    assert code == 0 and "paths from the screen to the detector" in out
    assert re.fullmatch(
        r"irtscots: warning: precision fp32: segment: rounding adds \S+ nm rms to the height .*; fp64 does not\n", err
    )


def test_run_says_on_stderr_what_should_be_known_of_the_result(irtscots, device, here, without_figures):
    (here / "segment.toml").write_text(large_segment(25).to_toml())
    arguments = ("run", "segment.toml", "--rays-per-pixel", 64, "--out", "out", "--device", device.index, "--quiet")
    code, _, err = irtscots(*arguments)  # so few rays are noisier than rounding: not refused, nothing to say
    assert (code, err) == (0, "")
    if device.has_fp64:
        finer = ("--sampler", "sobol", "--smoothing", "--measure", "fine")
        code, _, err = irtscots(*arguments[:3], 16384, *arguments[4:], *finer)
        assert code == 0
        assert re.fullmatch(r"irtscots: warning: single precision adds \S+ nm rms to the height, all other .*\n", err)
