"""The page of quality, result.h5 and report.html of fringes, from one measurement through files."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from fringe_folders import recorded
from noisy_images import small

from irtscots_cl import cli
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.report import fringe_figures
from irtscots_cl.tracing.trace import trace

SETS = tuple(FringeSet.equal(axis, (0.9, 2.46), 4) for axis in "xy")
TITLES = (
    "brightness", "weakest modulation", "largest phase residual", "noise of a sample",
    "second harmonic over the first", "saturated samples", "wrong fringe order",
    "why pixels of the mirror are not used",
)  # fmt: skip
MAPS = {
    "second_harmonic": "1", "saturated_share": "1", "phase_residual_rad": "rad", "noise": "counts", "offset": "counts",
    "modulation": "1", "wrong_order_probability": "1",
}  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """One measurement: its folder, and the figure, maps and result of the page."""
    path, scene = tmp_path_factory.mktemp("fringes"), small(30)
    recorded(trace(scene, estimator="analytic"), scene, SETS, gamma=1.5).write(path)
    use = np.ones((30, 30), np.uint8)
    use[10:13, 8:12] = 0
    np.save(path / "use.npy", use)
    (path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    drawn = {"folder": path / "out"}
    original = fringe_figures.quality_figure

    def keep(maps, result):
        drawn.update(figure=original(maps, result), result=result, maps=maps)
        return drawn["figure"]

    given = ("--scene", path / "scene.toml", "--out", path / "out", "--mask", path / "use.npy")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fringe_figures, "quality_figure", keep)
        assert cli.main(["reconstruct", *map(str, (path, *given))]) == 0
    return drawn


@pytest.fixture(scope="module")
def folder(page):
    return page["folder"]


def test_the_page_has_all_maps_with_units_axes_and_the_mark(page):
    axes = {one.get_title(): one for one in page["figure"].axes if one.get_title()}
    assert tuple(axes) == TITLES
    for one in axes.values():
        assert (one.get_xlabel(), one.get_ylabel()) == ("detector column", "detector row")
        texts = [text.get_text() for text in one.texts]
        assert "seen from the camera" in texts and "+x" in texts
    bars = [one.get_ylabel() for one in page["figure"].axes if not one.get_title()]
    assert bars == [
        "counts",
        "amplitude / mean",
        "rad",
        "counts",
        "part of the first",
        "share",
        "log10 of the probability",
    ]


def test_the_legend_counts_the_pixels_of_the_mirror(page):
    one = next(a for a in page["figure"].axes if a.get_title() == TITLES[-1])
    told = [text.get_text() for text in one.get_legend().get_texts()]
    reason, orientation = page["maps"].reason, page["result"].nominal.camera.detector.orientation
    on_mirror = page["result"].on_mirror
    used = int((upright(reason, orientation)[on_mirror] == 0).sum())
    assert told[0] == f"used: {used}" and told[1] == "masked: 12"
    assert not any(text.endswith(": 0") for text in told)


def test_maps_are_in_the_file_with_units(folder, page):
    with h5py.File(folder / "result.h5") as file:
        for axis in "xy":
            for name, unit in MAPS.items():
                data = file[f"fringes/{axis}_{name}"]
                assert data.attrs["unit"] == unit and data.shape[-2:] == (30, 30)
            second = file[f"fringes/{axis}_second_harmonic"][()]
            # (gamma - 1) / (gamma + 2), which the aperture's blur lowers; 5 standard errors of the mean
            seen = page["maps"].coordinates.axes[axis].survey.second[0].ratio
            assert np.nanmean(second) == pytest.approx(seen, abs=5 * np.nanstd(second) / 15) and 0.08 < seen < 0.5 / 3.5
        assert "masked" in file["excluded"].attrs["unit"] and (file["excluded"][()][10:13, 8:12] == 1).all()


def test_the_html_report_shows_the_page_and_the_numbers(folder):
    html = (folder / "report.html").read_text(encoding="utf-8")
    facts = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert html.index('alt="quality" src="data:image/png') < html.index('alt="height" src="data:image/png')
    assert "noise of a sample of median brightness" in html and "12 masked" in html
    # 2 counts of read-out and 5 electrons per count: of some 1100 counts
    assert 10 < facts["fringes"]["noise"]["x"] < 20 and 10 < facts["fringes"]["noise"]["y"] < 20
    assert facts["fringes"]["photon_transfer"]["variance_counts2"]
