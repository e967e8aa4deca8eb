"""Scatter models: totals against quadrature, cut lobes against the disk, sampling against the density, refusals."""

from __future__ import annotations

import dataclasses
import itertools
import math
import pickle

import numpy as np
import pytest
from scipy import integrate
from significance import chi_square_p, sidak_p, sidak_z

from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian, tis_of_roughness
from irtscots_cl.scene.scatter.toml import scatter_from_table
from irtscots_cl.scene.validation import SceneError

FAILURE_CHANCE = 1e-6  # of a right module, over all random tests of this file
RANDOM_TESTS = 4 * 2 + 4  # four models' histograms in two directions, and their shares below the horizon in one
ROUNDING = 1e-13  # relative, of sums of some tens of terms
QUADRATURE = 1e-10  # relative, as asked of scipy.integrate.quad


def near(value, rel):
    return pytest.approx(value, rel=rel, abs=0)  # its 1e-12 without abs would let many a total here pass


def sines(*degrees):
    return np.sin(np.radians(degrees))


# --- the total ----------------------------------------------------------------------------------------------

SLOPES = (0.0, -1.0, -1.5, -2 + 1e-9, -2.0, -2 - 1e-9, -3.0, -6.0)
POWERS = (0.0, 1e-200, 1e-3, 1.0, 1 + 1e-9, 1.5, 2 - 1e-9, 2.0, 2 + 1e-9, 3.0, 10.0)
TOTALS = [Harvey(l, s, b0=1e-3) for l in (1e-4, 0.01, 0.5, 3.0) for s in SLOPES]
TOTALS += [ABg(1e-4 * b, b, g) for b in (1e-8, 1e-3, 0.3, 2.0) for g in POWERS]
TOTALS += [Lambertian(0.3)]


@pytest.mark.parametrize("model", TOTALS, ids=repr)
def test_the_lobe_is_the_integral_of_the_bsdf(model):
    def ring(d):
        return 2 * math.pi * d * model.bsdf(d)

    for x in (1e-5, 0.3, 1.0, 2.0):
        edges = x * np.array([0.0, *np.logspace(-5, 0, 6)])
        parts = (integrate.quad(ring, *edge, epsrel=1e-11, epsabs=0)[0] for edge in itertools.pairwise(edges))
        assert model.lobe(x) == near(sum(parts), QUADRATURE)
    assert model.tis_at() == model.lobe(1.0)
    assert model.lobe(0.0) == 0


@pytest.mark.parametrize("l", [1e-9, 1e-4, 0.2])
def test_totals_of_one_line(l):
    """What the models' sources print, where that has no cancellation of its own."""
    for s in (-1.0, -1.5, -3.0):
        total = 2 * math.pi * 0.1 * l * l / (s + 2) * ((1 + 1 / l**2) ** ((s + 2) / 2) - 1)
        assert Harvey(l, s, b0=0.1).tis_at() == near(total, ROUNDING)
    assert Harvey(l, -2.0, b0=0.1).tis_at() == near(math.pi * 0.1 * l**2 * math.log1p(l**-2), ROUNDING)
    b, a = l, 0.01 * l
    assert ABg(a, b, 2.0).tis_at() == near(math.pi * a * math.log1p(1 / b), ROUNDING)
    assert ABg(a, b, 1.0).tis_at() == near(2 * math.pi * a * (1 - b * math.log1p(1 / b)), ROUNDING)
    assert ABg(a, b, 0.0).tis_at() == near(math.pi * a / (1 + b), ROUNDING)
    four = math.pi * a / math.sqrt(b) * math.atan(1 / math.sqrt(b))
    assert ABg(a, b, 4.0).tis_at() == near(four, ROUNDING)


def test_the_known_numbers_of_a_2_nm_mirror():
    tis = tis_of_roughness(2.0, 500.0)
    assert tis == pytest.approx(0.0025266, abs=5e-8)  # as printed
    assert Harvey(0.01, -1.5, tis=float(tis)).bsdf(0.0) == pytest.approx(0.2234, abs=5e-5)  # as printed


@pytest.mark.parametrize("l", [1e-9, 1e-4, 0.5, 1e9])
@pytest.mark.parametrize("s", SLOPES)
def test_a_harvey_lobe_has_the_total_it_was_given(l, s):
    model = Harvey(l, s, tis=0.02)
    assert model.tis_at() == near(0.02, ROUNDING)
    same = Harvey(l, s, b0=min(float(model.bsdf(0.0)), 1e12))
    if same.b0 < 1e12:
        d = np.array([0.0, 1e-3, 1.0])
        np.testing.assert_allclose(same.bsdf(d), model.bsdf(d), rtol=ROUNDING)


def test_totals_of_one_are_accepted():
    full = Harvey(0.01, -1.5, tis=1.0)
    assert Harvey(0.01, -1.5, b0=float(full.bsdf(0.0))).tis_at() == near(1, ROUNDING)
    assert Lambertian(1).tis_at(0.5) == near(1, ROUNDING)


def test_roughness_scatters_as_its_square_or_less():
    sigma, cosine = np.array([1.0, 3.0, 200.0]), np.cos(np.radians([[0.0], [60.0]]))
    small = tis_of_roughness(sigma, 633.0, cosine)
    np.testing.assert_allclose(small[0], (4 * np.pi * sigma / 633.0) ** 2, rtol=ROUNDING)
    np.testing.assert_allclose(small[1], small[0] / 4, rtol=ROUNDING)
    exact = tis_of_roughness(sigma, 633.0, cosine, exact=True)
    np.testing.assert_allclose(exact, 1 - np.exp(-small), rtol=1e-12)  # 1e-16 of 1, over 4e-4
    assert tis_of_roughness(1e-9, 1.0, exact=True) == near((4e-9 * np.pi) ** 2, ROUNDING)


def test_an_interface_scatters_by_the_phase_that_its_roughness_gives():
    """By the change of n cos(theta): (2 pi sigma (n2 - n1) / lambda)^2 at normal incidence, else by Snell's law."""
    assert tis_of_roughness(5.0, 632.8, index_beyond=1.517) == pytest.approx(6.59e-4, abs=5e-7)  # as printed
    assert tis_of_roughness(5.0, 632.8) == pytest.approx(9.86e-3, abs=5e-6)  # a mirror's
    sine = math.sin(math.radians(50))
    step = math.sqrt(1.517**2 - sine**2) - math.sqrt(1 - sine**2)
    into = tis_of_roughness(5.0, 632.8, math.sqrt(1 - sine**2), index_beyond=1.517)
    assert into == near((2 * math.pi * 5 * step / 632.8) ** 2, 1e-12)
    inside = math.sqrt(1 - (sine / 1.517) ** 2)
    assert tis_of_roughness(5.0, 632.8, inside, index=1.517, index_beyond=1.0) == near(into, 1e-9)  # the way back
    assert tis_of_roughness(5.0, 632.8, inside, index=1.517) == near((4 * math.pi * 5 * 1.517 * inside / 632.8) ** 2,
                                                                      1e-12)  # fmt: skip


# --- cut at the horizon -------------------------------------------------------------------------------------

CUT = [
    Harvey(0.01, -1.5, tis=0.01),
    Harvey(0.001, -3.0, tis=0.01),
    Harvey(0.3, -2.0, tis=0.5),
    ABg(1e-4, 1e-3, 1.5),
    ABg(1e-6, 1e-5, 2.4),
    Lambertian(0.2),
]


def graded(centre, low, high):
    """Gauss nodes and weights [k, n] from low to high [k, 1]: structure of any size about `centre` and at `high`."""
    steps = np.array([0.0, *np.logspace(-6, math.log10(4), 26)])
    edges = np.broadcast_to(centre + np.concatenate([-steps, steps]), (len(high), 2 * len(steps)))
    edges = np.sort(np.clip(np.concatenate([edges, high - steps], 1), low, high))
    nodes, weights = np.polynomial.legendre.leggauss(10)
    middle, half = (edges[:, 1:] + edges[:, :-1]) / 2, (edges[:, 1:] - edges[:, :-1]) / 2
    at, weight = middle[..., None] + half[..., None] * nodes, half[..., None] * weights
    return at.reshape(len(edges), -1), weight.reshape(len(edges), -1)


def over_the_disk(model, sin0):
    """Integral of the BSDF about (sin0, 0) over the unit disk, at (sin(t), y) with |y| < cos(t)."""
    quarter = np.array([[np.pi / 2]])
    (t,), (weight_t,) = graded(np.arcsin(sin0), -quarter, quarter)
    edge = np.cos(t)[:, None]
    y, weight_y = graded(0.0, -edge, edge)
    bsdf = model.bsdf(np.hypot(np.sin(t)[:, None] - sin0, y))
    return np.sum(weight_t * np.cos(t) * np.sum(weight_y * bsdf, 1))


@pytest.mark.parametrize("model", CUT, ids=repr)
def test_oblique_totals_are_integrals_over_the_disk(model):
    angles = sines(0, 1, 30, 60, 85, 89)
    expected = [over_the_disk(model, sin0) for sin0 in angles]
    np.testing.assert_allclose(model.tis_at(angles), expected, rtol=1e-8)  # the accuracy promised
    assert (np.diff(model.tis_at(angles[1:])) < 1e-15).all()  # off centre less is inside; Lambertian: rounding


@pytest.mark.parametrize(
    "model",
    [
        Harvey(1e-9, -10.0, tis=0.1),
        Harvey(1e9, -2.0, tis=0.1),
        Harvey(1e-3, -2.0, tis=0.1),
        ABg(1e-30, 1e-30, 10.0),
        ABg(1e-8, 1e-6, 2.0),
    ],
    ids=repr,
)
def test_more_nodes_change_no_oblique_total(model, monkeypatch):
    grazing = [1 - 1e-3, 1 - 1e-6, 1 - 1e-10, 1 - 1e-16, 1.0]
    sin0 = np.array([1e-300, 1e-12, *sines(1, 45, 89), *grazing])
    found = model.tis_at(sin0)
    monkeypatch.setattr("irtscots_cl.scene.scatter.lobe.OBLIQUE_NODES", 4001)
    np.testing.assert_allclose(found, model.tis_at(sin0), rtol=1e-11)  # thousands of terms, and what is left


def test_half_of_a_narrow_lobe_remains_at_grazing_incidence():
    model = Harvey(1e-6, -8.0, tis=0.1)
    assert model.tis_at(1.0) == near(0.05, 1e-5)  # the horizon is straight over the lobe's width
    np.testing.assert_allclose(model.tis_at([0.0, 0.5, 0.99]), 0.1, rtol=ROUNDING)


# --- sampling -----------------------------------------------------------------------------------------------

SAMPLED = [
    Lambertian(0.2),
    *(Harvey(l, s, tis=0.1) for l in (1e-9, 1e-4, 0.1, 100.0) for s in (0.0, -1.5, -2 + 1e-9, -2.0, -3.0, -10.0)),
    *(ABg(1e-3 * b, b, g) for b in (1e-30, 1e-8, 1e-3, 2.0) for g in (0.0, 0.01, 1.0, 2.0, 2 + 1e-9, 3.0, 10.0)),
]


@pytest.mark.parametrize("model", SAMPLED, ids=repr)
def test_a_sample_s_distance_inverts_the_lobe(model):
    share = np.array([1e-20, 1e-12, 1e-6, 0.01, 0.3, 0.5, 0.77, 0.999, 1 - 1e-9, 1 - 2**-53])
    beta, inside = model.sample(np.stack([share, np.linspace(0, 0.9, 10)], -1), np.zeros(2))
    d = np.hypot(*beta.T)
    np.testing.assert_allclose(model.lobe(d), share * model.lobe(1.0), rtol=1e-9)  # the accuracy promised
    assert (d < 1 + 1e-15).all() and inside[:-1].all()  # the last is the horizon but for rounding
    oblique = np.array([0.6, -0.3])
    beta, _ = model.sample(np.stack([share, np.full(10, 0.4)], -1), oblique)
    d = np.hypot(*(beta - oblique).T)
    seen = d > 1e-6  # 1e-16 of beta is 1e-10 of it
    np.testing.assert_allclose(model.lobe(d)[seen], (share * model.lobe(1 + np.hypot(*oblique)))[seen], rtol=1e-9)


@pytest.mark.parametrize("l, s, sin0", [(2.1e-7, -9.9, 0.7), (1.9e-9, -5.6, 0.3), (4.7e-3, -9.9, 0.7)])
def test_the_end_of_a_steep_lobe_is_its_rim(l, s, sin0):
    """Where rounding puts the last share of the lobe beyond all of it."""
    beta, _ = Harvey(l, s, tis=0.1).sample([1 - 2**-53, 0.5], [-sin0, 0.0])
    np.testing.assert_allclose(beta, [-1 - 2 * sin0, 0.0], atol=1e-15)  # rounding of sin(pi)


def test_a_sample_s_azimuth_is_in_turns_about_the_specular_direction():
    turns = np.array([0.01, 0.26, 0.5, 0.8])
    for beta0 in ([0.0, 0.0], [0.3, 0.4]):
        beta, _ = Harvey(0.1, -1.5, tis=0.1).sample(np.stack([np.full(4, 0.5), turns], -1), beta0)
        x, y = (beta - beta0).T
        np.testing.assert_allclose(np.arctan2(y, x) / (2 * np.pi) % 1, turns, rtol=0, atol=1e-14)  # rounding of beta


@pytest.mark.parametrize("model", CUT[::3], ids=repr)
def test_shapes_and_one_specular_direction_for_each_sample(model):
    generator = np.random.default_rng(4)
    u, beta0 = generator.random((3, 5, 2)), generator.uniform(-0.7, 0.7, (5, 2))
    beta, inside = model.sample(u, beta0)
    density = model.pdf(beta, beta0)
    assert beta.shape == (3, 5, 2) and inside.shape == density.shape == (3, 5) and inside.dtype == bool
    for k in np.ndindex(3, 5):
        one, one_inside = model.sample(u[k], beta0[k[1]])
        np.testing.assert_allclose(beta[k], one, rtol=0, atol=1e-15)  # vector and scalar functions' last bit
        assert inside[k] == one_inside == (np.hypot(*one) <= 1)
        assert density[k] == near(model.pdf(one, beta0[k[1]]), ROUNDING)
        d, farthest = np.hypot(*(one - beta0[k[1]])), 1 + np.hypot(*beta0[k[1]])
        assert density[k] == near(model.bsdf(d) / model.lobe(farthest), 1e-12)  # d loses a digit
    for function in (model.bsdf, model.lobe, model.tis_at):
        assert function(np.abs(beta0)).shape == (5, 2) and np.ndim(function(0.2)) == 0
        assert function(np.abs(beta0))[1, 1] == near(function(abs(beta0[1, 1])), ROUNDING)


SAMPLES = 200_000
RANDOM = [Lambertian(0.2), Harvey(0.15, -1.5, tis=0.1), Harvey(0.2, -2.0, tis=0.1), ABg(1e-3, 0.05, 2.6)]
DIRECTIONS = [np.zeros(2), np.array([-0.48, 0.64])]  # normal incidence, and a sine of 0.8


def expected_shares(model, beta0, radii, azimuths):
    """Integrals of the density over the bins [r, a] of polar coordinates about the normal."""
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def panels(edges):
        half = np.diff(edges)[:, None] / 2
        return edges[:-1, None] + half * (1 + nodes), half * weights

    (r, weight_r), (a, weight_a) = panels(radii), panels(azimuths)
    r, a = r[:, None, :, None], a[None, :, None, :]
    density = model.pdf(np.stack([r * np.cos(a), r * np.sin(a)], -1), beta0)
    return np.einsum("raij,ri,aj->ra", density * r, weight_r, weight_a)


@pytest.mark.parametrize("beta0", DIRECTIONS, ids=str)
@pytest.mark.parametrize("model", RANDOM, ids=repr)
def test_samples_follow_the_density(model, beta0):
    beta, inside = model.sample(np.random.default_rng(11).random((SAMPLES, 2)), beta0)
    radii, azimuths = np.linspace(0, 1, 13), np.linspace(-np.pi, np.pi, 25)
    x, y = beta[inside].T
    observed = np.histogram2d(np.hypot(x, y), np.arctan2(y, x), [radii, azimuths])[0]
    shares = expected_shares(model, beta0, radii, azimuths)
    sin0 = np.hypot(*beta0)
    hemisphere = model.tis_at(sin0) / model.lobe(1 + sin0)
    assert shares.sum() == near(hemisphere, 1e-5)  # the bins' quadrature, a hundredth of the noise
    observed, expected = np.append(observed, np.sum(~inside)), SAMPLES * np.append(shares, 1 - shares.sum())
    p = chi_square_p(observed, expected, fitted=1)  # their sum
    assert p > sidak_p(RANDOM_TESTS, FAILURE_CHANCE)


@pytest.mark.parametrize("beta0", DIRECTIONS, ids=str)
@pytest.mark.parametrize("model", RANDOM, ids=repr)
def test_the_share_below_the_horizon_is_what_the_cut_takes(model, beta0):
    _, inside = model.sample(np.random.default_rng(12).random((SAMPLES, 2)), beta0)
    sin0 = np.hypot(*beta0)
    if sin0 == 0:
        assert inside.all()
        return
    share = 1 - model.tis_at(sin0) / model.lobe(1 + sin0)
    assert 0.05 < share < 0.95  # there is something to see
    z = (np.mean(~inside) - share) / np.sqrt(share * (1 - share) / SAMPLES)
    assert abs(z) < sidak_z(RANDOM_TESTS, FAILURE_CHANCE)


# --- tables and refusals ------------------------------------------------------------------------------------

SCALE = "a finite number above 0 and at most 1e+12"
FRACTION = "a finite number above 0 and at most 1"
HARVEY = {"model": "harvey", "l": 0.01, "s": -1.5}
ABG = {"model": "abg", "a": 1e-4, "b": 1e-3, "g": 2}
LAMBERTIAN = {"model": "lambertian"}
MODELS = "lambertian, harvey, abg"


def refusal(build, *args, **kwargs):
    with pytest.raises(SceneError) as caught:
        build(*args, **kwargs)
    message = str(caught.value)
    assert message.isprintable()  # one line, no control characters
    return message


def test_tables_build_models():
    assert scatter_from_table({"model": "lambertian", "tis": 1}, "my.toml") == Lambertian(1.0)
    assert scatter_from_table({**HARVEY, "tis": 0.1}, "my.toml") == Harvey(0.01, -1.5, tis=0.1)
    assert scatter_from_table({**HARVEY, "b0": 0.1}, "my.toml") == Harvey(0.01, -1.5, 0.1)
    assert scatter_from_table(ABG, "my.toml") == ABg(1e-4, 1e-3, 2.0)


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (3, " = 3: must be a table with the key model, one of " + MODELS),
        ({}, ".model: missing; needs one of " + MODELS),
        ({"tis": 0.1}, ".model: missing; needs one of " + MODELS),
        ({"modl": "harvey", "l": 0.01}, ".modl: unknown key; did you mean model?"),
        ({"model": "harvy"}, ".model = 'harvy': unknown model; did you mean harvey?"),
        ({"model": "phong"}, ".model = 'phong': unknown model; allowed: " + MODELS),
        ({"model": ["abg"]}, ".model = ['abg']: unknown model; did you mean abg?"),
        ({**LAMBERTIAN, "tsi": 0.1}, ".tsi: unknown key; did you mean tis?"),
        ({**HARVEY, "tis": 0.1, "slope": -2},
         ".slope: unknown key; allowed: l, s, b0, tis, roughness_nm, wavelength_nm"),
        ({**LAMBERTIAN}, f".tis: missing; needs {FRACTION}"),
        ({**LAMBERTIAN, "tis": 1.01}, f".tis = 1.01: must be {FRACTION}"),
        ({**LAMBERTIAN, "tis": 0}, f".tis = 0: must be {FRACTION}"),
        ({**LAMBERTIAN, "tis": math.nan}, f".tis = nan: must be {FRACTION}"),
        ({**LAMBERTIAN, "tis": True}, f".tis = True: must be {FRACTION}"),
        ({**HARVEY, "tis": 1.5}, f".tis = 1.5: must be {FRACTION}"),
        ({**HARVEY, "tis": "1"}, f".tis = '1': must be {FRACTION}"),
        ({**HARVEY, "b0": 0.0}, f".b0 = 0.0: must be {SCALE}"),
        ({**HARVEY, "b0": -1.0}, f".b0 = -1.0: must be {SCALE}"),
        ({**HARVEY}, f".b0 = None: must be {SCALE}, unless tis or roughness_nm is given in its place"),
        ({**HARVEY, "roughness_nm": 2.0}, ".wavelength_nm = None: must be given with roughness_nm, and only then"),
        ({**HARVEY, "tis": 0.1, "wavelength_nm": 500.0},
         ".wavelength_nm = 500.0: must be given with roughness_nm, and only then"),
        ({**HARVEY, "tis": 0.1, "roughness_nm": 2.0, "wavelength_nm": 500.0},
         ".roughness_nm = 2.0: must be left out where tis (0.1) is given: exactly one of b0, tis, roughness_nm"),
        ({**HARVEY, "roughness_nm": 0.0, "wavelength_nm": 500.0},
         ".roughness_nm = 0.0: must be a finite number above 0 and at most 1e+06"),
        ({**HARVEY, "b0": 0.2, "tis": 0.1},
         ".tis = 0.1: must be left out where b0 (0.2) is given: exactly one of b0, tis, roughness_nm"),
        ({**HARVEY, "tis": 0.1, "l": 0.0}, ".l = 0.0: must be a finite number at least 1e-09 and at most 1e+09"),
        ({**HARVEY, "tis": 0.1, "s": 0.1}, ".s = 0.1: must be a finite number at least -10 and at most 0"),
        ({**HARVEY, "tis": 0.1, "s": -11}, ".s = -11: must be a finite number at least -10 and at most 0"),
        ({**HARVEY, "l": 1.0, "s": 0.0, "b0": 0.5},
         ".b0 = 0.5: must be at most 0.3183098862, where the total integrated scatter reaches 1"),
        ({**ABG, "a": 0}, f".a = 0: must be {SCALE}"),
        ({**ABG, "b": 0.0}, ".b = 0.0: must be a finite number at least 1e-30 and at most 1e+12"),
        ({**ABG, "g": -0.5}, ".g = -0.5: must be a finite number at least 0 and at most 10"),
        ({**ABG, "g": math.inf}, ".g = inf: must be a finite number at least 0 and at most 10"),
        ({**ABG, "a": 0.5, "b": 1.0},
         ".a = 0.5: must be at most 0.4592240943, where the total integrated scatter reaches 1"),
    ],
)  # fmt: skip
def test_a_table_is_refused_in_one_line(table, line):
    assert refusal(scatter_from_table, table, "my.toml", ("mirror", "scatter")) == f"my.toml: mirror.scatter{line}"


def test_the_limit_that_a_refusal_names_is_accepted():
    assert Harvey(1.0, 0.0, b0=0.3183098862).tis_at() == pytest.approx(1, abs=1e-9)  # as printed
    assert ABg(0.4592240943, 1.0, 2.0).tis_at() == pytest.approx(1, abs=1e-9)  # 1 / (pi ln 2), as printed


def test_constructors_and_functions_refuse_with_such_lines():
    assert refusal(Lambertian, 1.5) == f"Lambertian: tis = 1.5: must be {FRACTION}"
    assert refusal(Harvey, 0.01, b0=0.1) == "Harvey: s: missing; needs a finite number at least -10 and at most 0"
    assert refusal(ABg, 1e-3, 1e-3, gg=2.0) == "ABg: gg: unknown key; did you mean g?"
    assert refusal(scatter_from_table, {**LAMBERTIAN, "tis": 2}, "a.toml") == f"a.toml: tis = 2: must be {FRACTION}"
    model = Lambertian(0.1)
    assert refusal(model.tis_at, 1.1) == "tis_at: sin0 = 1.1: must be 0 to 1"
    assert refusal(model.tis_at, [0.1, math.nan, -1]) == "tis_at: sin0 = nan: must be 0 to 1"
    place = "tis_of_roughness: "
    assert refusal(tis_of_roughness, -1, 5) == place + "sigma_nm = -1.0: must be a finite number at least 0"
    assert refusal(tis_of_roughness, 1, [5, 0]) == place + "wavelength_nm = 0.0: must be above 0"
    assert refusal(tis_of_roughness, 1, 5, 1.5) == place + "cosine = 1.5: must be 0 to 1"
    assert refusal(tis_of_roughness, 1, 5, index=0.9) == place + "index = 0.9: must be a finite number at least 1"
    beyond = refusal(tis_of_roughness, 1, 5, index_beyond=0.9)
    assert beyond == place + "index_beyond = 0.9: must be a finite number at least 1"
    total = refusal(tis_of_roughness, 1, 5, 0.5, index=1.5, index_beyond=1.0)
    assert total == place + "cosine = 0.5: must be above that of total reflection"
    assert refusal(Harvey(0.01, -1.5, roughness_nm=2.0, wavelength_nm=5e2).tis_at, -1) == (
        "tis_at: sin0 = -1.0: must be 0 to 1"
    )


def test_models_are_values():
    for model in (Harvey(0.01, -1.5, tis=0.1), ABg(1e-4, 1e-3, 2.0), Lambertian(0.1)):
        model.sample(np.full(2, 0.5), np.zeros(2))  # what it keeps for itself makes no other value of it
        again = pickle.loads(pickle.dumps(model))
        assert again == model == dataclasses.replace(model) and hash(again) == hash(model)
        with pytest.raises(dataclasses.FrozenInstanceError):
            model.tis = 0.2
    assert dataclasses.replace(Harvey(0.01, -1.5, tis=0.1), s=-2.0) == Harvey(0.01, -2.0, tis=0.1)


def test_a_lobe_of_given_roughness_scatters_as_bennett_and_porteus_say():
    rough = Harvey(0.01, -1.5, roughness_nm=200.0, wavelength_nm=500.0)
    assert rough.tis_at() == near(1 - math.exp(-((4 * math.pi * 200 / 500) ** 2)), ROUNDING)


def test_a_rough_mirrors_total_falls_with_the_square_of_the_cosine():
    """The cut at the horizon alone would leave three quarters of this wide lobe at 60 degrees."""
    rough = Harvey(0.01, -1.5, roughness_nm=5.0, wavelength_nm=632.8)
    at_60 = math.sin(math.radians(60))
    assert rough.tis_at(at_60) / rough.tis_at() == pytest.approx(0.25, rel=0.01, abs=0)  # 1 - exp(-g): half of g
    assert rough.above_horizon(at_60) / rough.above_horizon() > 0.7
    g = (4 * math.pi * 5 / 632.8) ** 2
    np.testing.assert_allclose(rough.tis_at([0.0, at_60]), -np.expm1([-g, -g / 4]), rtol=1e-12)
