"""The closed forms of docs/theory-light.md and docs/theory-measurement.md are those that the code computes."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import eval_jacobi

from irtscots_cl.budget.distributions import excess
from irtscots_cl.execution.launch_plan import MAX_RAYS_PER_ITEM
from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.integration.rule_symbols import rise_symbol
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.centroids import centroids, poisson_error
from irtscots_cl.measurement.harmonics import bias_size, gamma_harmonics
from irtscots_cl.measurement.phase import FrameNoise, fit_sinusoid
from irtscots_cl.measurement.slopes import deconvolve_pixel, half_vector_slopes
from irtscots_cl.measurement.unwrapping import unwrap
from irtscots_cl.opencl.structs import LINE_WEIGHT_ONE, WEIGHT_ONE
from irtscots_cl.optics.pixel.chord import chord_cdf
from irtscots_cl.scene.error_sources import Distribution
from irtscots_cl.tracing.packing.sources import MIN_COSINE4

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(DOCS.glob("theory-*.md"))
EQUATION = re.compile(r"\$\$(.+?)\$\$|\$(.+?)\$", re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_equation_becomes_mathml(page):
    converter = pytest.importorskip("latex2mathml.converter", reason="pip install 'irtscots-cl[docs]'")
    equations = [block or inline for block, inline in EQUATION.findall(page.read_text(encoding="utf-8"))]
    assert len(equations) > 40
    for one in equations:
        # a command that the converter does not know is left as text with its backslash
        assert "\\" not in re.sub(r"<annotation.*?</annotation>", "", converter.convert(one)), one


def test_a_conic_is_the_quadric_and_a_line_meets_it_where_the_root_says():
    radius, conic, r = -2500.0, -0.7, 300.0  # convex: the sign of R matters
    sag = r**2 / (radius * (1 + math.sqrt(1 - (1 + conic) * r**2 / radius**2)))
    surface = Quadric.conic(radius, conic)
    assert (surface.q_xx, surface.q_yy, surface.q_zz, surface.q_xz) == pytest.approx(
        (1 / radius, 1 / radius, (1 + conic) / radius, 0.0)
    )
    assert surface.meet(0.0, r, 0.0, 0.0) == pytest.approx(sag, rel=1e-14)
    p, q = 0.1, -0.05
    z = float(surface.meet(-p * sag, r - q * sag, p, q))  # the line through that point of the surface
    assert z == pytest.approx(sag, rel=1e-13)


def test_a_disk_below_a_line_has_the_share_of_the_papers_equation():
    t = np.linspace(-1, 1, 9)
    x = np.linspace(-1, 1, 40001)
    below = np.concatenate([[0.0], np.cumsum(np.sqrt(1 - ((x[1:] + x[:-1]) / 2) ** 2)) * (x[1] - x[0]) * 2 / math.pi])
    assert chord_cdf(t) == pytest.approx(np.interp(t, x, below), abs=1e-6)


def test_weights_fit_their_words():
    assert WEIGHT_ONE == 2**24 and LINE_WEIGHT_ONE == 2**20 and MIN_COSINE4 == 2**-6
    assert WEIGHT_ONE / MIN_COSINE4 + 1 < 2**31
    assert 2**33 * (WEIGHT_ONE / MIN_COSINE4 + 1) < 2**64
    assert (2**40 - 1) * WEIGHT_ONE < 2**64
    assert MAX_RAYS_PER_ITEM < 2**32


def test_a_centroid_has_the_variance_of_its_curve_over_the_rays():
    flux = np.array([1.0, 3.0, 2.0])
    at = np.arange(5.0) * 0.2
    scan = Scan("x", at, (2, 2), np.array([1]), np.array([1]), flux[None, None], np.array([1.0]), np.array([100.0]))
    mean = (flux * at[1:4]).sum() / 6
    assert centroids(scan, flux[None]) == pytest.approx([mean])
    assert poisson_error(scan, flux[None])[0] ** 2 == pytest.approx(((flux * at[1:4] ** 2).sum() / 6 - mean**2) / 100)


@pytest.mark.parametrize("count", [4, 7])
def test_a_phase_of_equal_steps_has_the_variance_of_the_closed_form(count):
    offset, amplitude, phase, noise = 5.0, 3.0, 0.7, FrameNoise(0.04, 0.02)
    steps = np.array(equal_steps(count))
    fit = fit_sinusoid(offset + amplitude * np.cos(phase - steps)[:, None], steps)
    assert fit.phase_rad == pytest.approx([phase])
    wanted = 2 * (noise.read + noise.gain * offset) / (count * amplitude**2)
    assert fit.phase_error_rad(noise)[0] ** 2 == pytest.approx(wanted)


def test_a_phase_of_any_steps_has_the_variance_of_its_sine_and_cosine():
    steps, cosine, sine = np.array([0.0, 0.4, 1.1, 2.0, 4.5]), 2.0, -1.5
    columns = np.stack([np.ones(5), np.cos(steps), np.sin(steps)], -1)
    spread = 0.09 * np.linalg.inv(columns.T @ columns)
    cc, cs, ss = spread[1, 1], spread[1, 2], spread[2, 2]
    fit = fit_sinusoid((columns @ [5.0, cosine, sine])[:, None], steps)
    wanted = (sine**2 * cc + cosine**2 * ss - 2 * sine * cosine * cs) / (cosine**2 + sine**2) ** 2
    assert fit.phase_error_rad(FrameNoise(0.09))[0] ** 2 == pytest.approx(wanted)


def test_a_place_of_several_phases_has_the_sum_of_their_weights():
    periods, place, errors = (0.8, 5.3, 17.0), 0.61, np.array([0.02, 0.03, 0.05])
    phases = np.array([(2 * math.pi * p * place) for p in periods])[:, None]
    found = unwrap(np.angle(np.exp(1j * phases)), errors[:, None], periods)
    assert found.fraction == pytest.approx([place])
    weights = (2 * math.pi * np.array(periods) / errors) ** 2
    assert found.standard_error[0] ** -2 == pytest.approx(weights.sum())


def test_harmonics_of_gamma_and_their_bias():
    gamma = 2.2
    ratios = gamma_harmonics(gamma)
    assert ratios[2] == pytest.approx((gamma - 1) / (gamma + 2))
    for k in range(1, 8):
        assert ratios[k + 1] == pytest.approx(ratios[k] * (gamma - k) / (gamma + k + 1))
    assert bias_size(equal_steps(4), ratios) == pytest.approx(abs(ratios[3] - ratios[5]), rel=0.02)  # first order
    assert abs(ratios[3] - ratios[5]) == pytest.approx(0.0106, abs=5e-5)


def test_the_normal_halves_the_angle_and_the_pixels_mean_is_undone():
    normal = np.array([-0.03, 0.02, 1.0])
    mirror, camera = np.array([10.0, -20.0, 0.5]), np.array([50.0, 30.0, 2000.0])
    ray = camera - mirror
    screen = mirror + 1.3 * (2 * (ray @ normal) * normal / (normal @ normal) - ray)
    assert half_vector_slopes(mirror, screen, camera) == pytest.approx((0.03, -0.02))
    x = np.arange(9.0)[None, :] * np.ones((9, 1))
    mean = x**3 + x / 4  # of x^3 over a pixel
    assert deconvolve_pixel(mean, np.ones((9, 9), bool))[:, 2:-2] == pytest.approx((x**3)[:, 2:-2])


def test_rules_of_integration_pass_waves_on_as_their_symbols_say():
    turn = 0.9
    node = np.exp(1j * turn * np.arange(-1, 3))
    middle = np.exp(0.5j * turn)
    assert rise_symbol("southwell", turn) == pytest.approx(math.cos(turn / 2))
    assert rise_symbol("southwell", turn) == pytest.approx(((node[1] + node[2]) / 2 / middle).real)
    assert rise_symbol("cubic", turn) == pytest.approx((node @ [-1, 13, 13, -1] / 24 / middle).real)
    spline = math.cos(turn / 2) * (1 + (1 - math.cos(turn)) / (2 * (2 + math.cos(turn))))
    assert rise_symbol("spline", turn) == pytest.approx(spline)


def test_a_zernike_term_is_jacobis_polynomial_times_a_power():
    x, y = 0.3, -0.4
    zeta, t = complex(x, y), 2 * (x * x + y * y) - 1
    assert zernike(16, x, y) == pytest.approx(math.sqrt(12) * eval_jacobi(2, 0, 1, t) * zeta.real)  # n = 5, m = 1
    assert zernike(8, x, y) == pytest.approx(math.sqrt(8) * (3 * t - 1) / 2 * zeta.real)  # n = 3, m = 1
    assert zernike(5, x, y) == pytest.approx(math.sqrt(6) * (zeta**2).imag)  # n = 2, m = -2


def test_squares_of_normal_values_have_twice_their_variance():
    assert excess(Distribution(normal=0.3)) == 2.0
    assert excess(Distribution(uniform=0.3)) == pytest.approx(9 / 5 - 1)
