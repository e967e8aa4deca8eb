"""The set-up in a page: rays that obey the law of reflection, and those of the shown line."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.optics.surface import Surface
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.report.page.page import page_of
from irtscots_cl.report.page.setup import setup_data
from tests.support.synthetic import small_scene

LIT_DOTS = (
    """() => [...document.querySelectorAll('#setup-screen circle[r="3"]')].map((c) => Number(c.getAttribute('cx')))"""
)
BOLD = """(id) => document.querySelectorAll(`#${id} path[stroke-width="1.2"]`).length"""


@pytest.fixture(scope="module")
def run():
    return simulate(small_scene(pixels=41), estimator="analytic")


@pytest.fixture(scope="module")
def data():
    return setup_data(small_scene(pixels=41))


@pytest.fixture
def page(opened, run, tmp_path):
    (tmp_path / "page.html").write_text(page_of(run.result, run.comparison, run.stack), encoding="utf-8")
    with opened(tmp_path / "page.html") as page:
        yield page


@pytest.mark.parametrize("kind", ["chief", "marginal"])
def test_rays_obey_the_law_of_reflection_on_the_mirror(data, kind):
    surface = Surface.of(small_scene(pixels=41).nominal().mirror)
    for view in data["views"]:
        rays = np.array(view[kind])
        assert len(rays) >= 3
        screen, mirror, camera = rays[:, 0], rays[:, 1], rays[:, 2]
        np.testing.assert_allclose(surface.sag(mirror[:, 0], mirror[:, 1]), mirror[:, 2], atol=2e-4)  # rounding
        slope = np.stack(surface.gradient(mirror[:, 0], mirror[:, 1]), -1)
        normal = np.concatenate([-slope, np.ones((len(rays), 1))], -1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        to_screen, to_camera = (
            (p - mirror) / np.linalg.norm(p - mirror, axis=1, keepdims=True) for p in (screen, camera)
        )
        half = to_screen + to_camera
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        np.testing.assert_allclose(half, normal, atol=1e-6)  # 1e-4 mm of rounding over 4 m, and more of the screen's


def test_marginal_rays_go_through_the_rim_of_the_aperture(data):
    scene = small_scene(pixels=41)
    centre = np.array(scene.camera.position_mm)
    for view in data["views"]:
        chief, marginal = (np.array(view[kind])[:, 2] for kind in ("chief", "marginal"))
        np.testing.assert_allclose(chief, np.broadcast_to(centre, chief.shape), atol=1e-4)
        away = np.linalg.norm(marginal - centre, axis=1)
        np.testing.assert_allclose(away, scene.camera.aperture_diameter_mm / 2, atol=2e-4)


def test_the_light_of_the_shown_line_follows_the_slider(page, run):
    assert page.evaluate(BOLD, "setup-x") == 18  # nine rays, to the mirror and to the camera
    before = page.evaluate(LIT_DOTS)
    assert len(before) == 9 and np.ptp(before) == 0  # all begin on the line, which is a column of screen pixels
    line = int(page.input_value("#line"))
    page.fill("#line", str(line + 2))
    after = page.evaluate(LIT_DOTS)
    place = run.stack.x.positions_mm
    corners = page.eval_on_selector("#setup-screen rect", "r => [Number(r.getAttribute('width'))]")
    assert after[0] > before[0] and np.ptp(after) == 0 and corners[0] > 0
    assert f"line x at {place[line + 2]:.4g} mm" in page.locator("#setup-text").inner_text().replace(
        "\N{MINUS SIGN}", "-"
    )
    page.select_option("#scan", "1")
    assert np.ptp(page.evaluate(LIT_DOTS)) > 10  # a row: its rays begin side by side
    page.uncheck("#rays")
    assert page.evaluate(BOLD, "setup-x") == 0 and page.evaluate(LIT_DOTS) == [] and page.said == []


def test_without_line_scans_there_is_the_set_up_alone(opened, run, tmp_path):
    (tmp_path / "page.html").write_text(page_of(run.result), encoding="utf-8")
    with opened(tmp_path / "page.html") as page:
        assert page.locator("#setup-x").is_visible() and page.evaluate(BOLD, "setup-x") == 0
        for name in ("frame-controls", "frames", "rays-switch", "curves"):
            assert page.locator(f"#{name}").is_hidden()
        assert page.said == []
