"""A whole calibration of an f/2 paraboloid against data of the oracle: what it promises of heights and unknowns."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest
from calibrations import NOISE_MM, fitted, inner_pixels, knowing, measured, paraboloid
from oracle.rig import Rig
from oracle.sensitivities import with_faults
from oracle.undescribed import COSTS_NM, FAULTS, SCENE
from scenes import coarse
from scipy import stats
from significance import sidak_p, sidak_z

from irtscots_cl.calibration.calibrate import FIRST_ORDER, Calibrated, Unknowns, calibrate, mirror_terms
from irtscots_cl.calibration.heights import TERMS, HeightGrid
from irtscots_cl.calibration.known import named_unknowns, priors_of
from irtscots_cl.calibration.measured import Measurement, from_maps
from irtscots_cl.calibration.parameters import moved, zernike_names, zernike_noll
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.quality import OK
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError

SEEDS = 50
CHANCE = 1e-6  # that a correct program fails one of the tests of many seeds
IDEAL_NM = 1.6
GEOMETRY = "camera,screen,intrinsics,camera.k1"  # with priors of 0.5 mm, 0.1 degree, 0.5 pixel


@lru_cache
def designed(pixels: int = 41) -> Scene:
    return coarse(load_scene(str(SCENE)), pixels)


def seen_by_the_oracle(scene: Scene, faults, noise_mm: float, seed: int = 0, margin: int = 2) -> Measurement:
    inside = inner_pixels(scene, margin)
    row, column = (v.astype(float) for v in np.nonzero(inside))
    there = with_faults(Rig.of(scene.to_toml()), list(faults)).back(row, column)
    places = np.full((2, *inside.shape), np.nan)
    places[:, inside] = [there.u, there.v]
    places += noise_mm * np.random.default_rng(seed).standard_normal(places.shape)
    return from_maps(scene, *places, max(noise_mm, 1e-4), max(noise_mm, 1e-4))


def left_nm(found: Calibrated, heights, terms: str = "piston_tilt") -> float:
    grid = found.effects.grid
    return float(np.sqrt(np.mean(grid.without(heights, terms)[..., grid.mask] ** 2))) * 1e6


# --- what the scene describes -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_costs_nothing_where_described_or_fitted(name):
    """Undescribed it costs what the oracle says; described, or found by the fit, no more than an ideal set-up."""
    scene, pixels = designed(63), 63
    cost = COSTS_NM[name] * (125 / pixels if "principal" in name else 1)  # a tenth of a larger pixel
    m = seen_by_the_oracle(scene, FAULTS[name], 0.0, margin=0)
    every = np.ones(len(m.pixels), bool)
    for described, least, most in ((scene, 0.85 * cost, 1.02 * cost), (moved(scene, dict(FAULTS[name])), 0, IDEAL_NM)):
        grid = HeightGrid.of(m, described, every)
        height = grid.without(grid.heights(grid.maps(m.places_mm)), "piston_tilt")[grid.mask]
        assert least < np.sqrt(np.mean(height**2)) * 1e6 < most  # without pixels at the edge: (1 - 2/63)^4 is 0.88
    found = calibrate([m], scene, Unknowns(named_unknowns(GEOMETRY, scene), mirror_order=0))
    assert left_nm(found, found.effects.after) < IDEAL_NM
    assert found.fit.noise == 1


# --- fifty set-ups drawn from their priors ------------------------------------------------------------------


@dataclass(frozen=True)
class Trials:
    """Of SEEDS set-ups: pulls [seeds, unknowns] of the fitted values; Zernike terms of the height's error, and the
    covariance stated for them; rms [seeds] of the height's error before, after, and as stated."""

    names: tuple[str, ...]
    pulls: np.ndarray
    errors_nm: np.ndarray
    covariance: np.ndarray
    before_nm: np.ndarray
    after_nm: np.ndarray
    stated_nm: np.ndarray
    chi_square: float
    degrees: float


@lru_cache
def trials(order: int) -> Trials:
    """order: of mirror terms, in the mirror and in the fit."""
    scene = designed()
    unknowns = Unknowns(named_unknowns(GEOMETRY if order == 0 else "camera,screen", scene), order)
    names = unknowns.up_to(order)
    priors = priors_of(names, scene)
    pulls, errors, covariances, before, after, stated, sums = [], [], [], [], [], [], np.zeros(2)
    for seed in range(SEEDS):
        random = np.random.default_rng([seed, order])
        true = {name: random.normal() * priors[name].sigma for name in names}
        m = seen_by_the_oracle(scene, true.items(), NOISE_MM, seed)
        found = calibrate([m], scene, unknowns)
        fit, effects = found.fit, found.effects
        pulls.append([(v - true[n]) / e for n, v, e in zip(names, fit.values, fit.errors, strict=True)])
        figure = true_figure(effects.grid, true)
        wrong = effects.after - figure
        errors.append(effects.grid.coefficients(wrong) * 1e6)
        covariances.append(np.cov(effects.grid.coefficients(effects.draws).T * 1e6))
        before.append(left_nm(found, effects.before - figure))
        after.append(left_nm(found, wrong))
        stated.append(left_nm(found, effects.draws))
        sums += fit.chi_square, fit.degrees
    return Trials(names, np.array(pulls), np.array(errors), np.array(covariances), np.array(before), np.array(after),
                  np.array(stated), *sums)  # fmt: skip


def true_figure(grid, true) -> np.ndarray:
    """Heights [r, c] in mm of the mirror's terms."""
    x, y = grid.mirror_mm / 532.0
    terms = {zernike_noll(name): value for name, value in true.items() if zernike_noll(name)}
    inside = sum((v * 1e-3 * zernike(noll, x[grid.mask], y[grid.mask]) for noll, v in terms.items()), np.zeros(1))
    figure = np.full(grid.mask.shape, np.nan)
    figure[grid.mask] = inside
    return figure


ORDERS = pytest.mark.parametrize("order", [0, FIRST_ORDER], ids=["mirror as designed", "mirror terms fitted"])


@pytest.mark.long
@ORDERS
def test_heights_are_wrong_by_what_the_covariance_says(order):
    """Chi-square of the Zernike terms of the height's error; DRAWS draws give the covariance."""
    found = trials(order)
    draws, terms = 100, len(TERMS)
    shrink = (draws - terms - 2) / (draws - 1)  # mean of the inverse of an estimated covariance
    squares = [e @ np.linalg.solve(c, e) * shrink for e, c in zip(found.errors_nm, found.covariance, strict=True)]
    total = stats.chi2(terms * SEEDS)
    # fewer draws than wanted widen the sum: by 1 + terms / draws
    low, high = total.ppf(CHANCE / 2) * 0.9, total.isf(CHANCE / 2) * (1 + terms / draws)
    assert low < sum(squares) < high
    assert found.before_nm.min() > 100 > 50 * IDEAL_NM or order
    assert np.sqrt(np.mean(found.after_nm**2)) == pytest.approx(np.sqrt(np.mean(found.stated_nm**2)), rel=0.3)
    if order == 0:
        assert found.after_nm.max() < 5  # nm, of up to some micrometres


@pytest.mark.long
@ORDERS
def test_each_term_of_the_heights_is_wrong_by_its_standard_deviation(order):
    found = trials(order)
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    pulls = found.errors_nm / sigma
    limit = sidak_z(2 * len(TERMS), CHANCE)
    assert np.abs(pulls.mean(0)).max() < limit / math.sqrt(SEEDS)
    # 100 draws know a standard deviation to 7 %
    assert np.abs(pulls.var(0) - 1).max() < limit * math.sqrt(2 / SEEDS) * 1.2


@pytest.mark.long
@ORDERS
def test_unknowns_are_wrong_by_their_standard_deviations(order):
    """Pulls have mean 0, variance 1, and are normal (Kolmogorov and Smirnov)."""
    found = trials(order)
    count = len(found.names)
    limit = sidak_z(2 * count, CHANCE)
    assert np.abs(found.pulls.mean(0)).max() < limit / math.sqrt(SEEDS)
    assert np.abs(found.pulls.var(0) - 1).max() < limit * math.sqrt(2 / SEEDS) + 0.3  # the tail of chi-square
    assert min(stats.kstest(pulls, "norm").pvalue for pulls in found.pulls.T) > sidak_p(count, CHANCE)


@pytest.mark.long
@ORDERS
def test_residuals_are_noise(order):
    found = trials(order)
    z = (found.chi_square - found.degrees) / math.sqrt(2 * found.degrees)
    assert abs(z) < sidak_z(1, CHANCE)


def test_unknowns_together_are_wrong_by_their_covariance():
    """Pulls without correlations, where the priors are so narrow that all is linear."""
    scene, names = paraboloid(31), named_unknowns("camera,screen,zernike.4-11", paraboloid(31))
    narrow = {name: 0.05 * prior.sigma for name, prior in priors_of(names, scene).items()}
    known = knowing(scene, **{name.replace(".", "__"): sigma for name, sigma in narrow.items()})
    pulls = []
    for seed in range(SEEDS):
        random = np.random.default_rng(1000 + seed)
        true = {name: random.normal() * sigma for name, sigma in narrow.items()}
        fit = fitted(measured(known, true, seed), ",".join(names))
        root = np.linalg.cholesky(fit.covariance / np.outer(fit.errors, fit.errors))
        off = (fit.values - [true[name] for name in fit.names]) / fit.errors
        pulls.append(np.linalg.solve(root, off))
    pulls = np.array(pulls).ravel()
    limit = sidak_z(2, CHANCE)
    assert abs(pulls.mean()) < limit / math.sqrt(pulls.size)
    assert abs(pulls.var() - 1) < limit * math.sqrt(2 / pulls.size)
    assert stats.kstest(pulls, "norm").pvalue > CHANCE


# --- mirror terms, priors, verdicts -------------------------------------------------------------------------


def test_more_mirror_terms_are_fitted_where_the_residuals_ask_for_them():
    scene = paraboloid(31)
    simple = calibrate([measured(scene, {"zernike.6_um": 0.1})], scene)
    assert simple.order == FIRST_ORDER and simple.verdict.startswith("good")
    more = calibrate([measured(scene, {"zernike.20_um": 0.05})], scene)
    assert more.order == 6 and more.verdict.startswith("good") and "zernike.20_um" in more.fit.names


def test_what_the_model_lacks_is_named():
    scene = paraboloid(31)
    m = measured(scene, {"camera.k1": 0.5, "screen.x_mm": 0.2})
    found = calibrate([m], scene)
    assert found.order == FIRST_ORDER  # not hidden in mirror terms
    assert found.verdict.startswith("the model does not explain the data: residuals are ")
    assert "chi-square most: camera.k1 (by " in found.verdict
    unknowns = Unknowns((*Unknowns().names, "camera.k1"))
    strict = calibrate([m], scene, unknowns)
    assert "camera.k1 = " in strict.verdict and "standard deviations of its prior" in strict.verdict
    wide = knowing(scene, camera__k1=1.0)
    better = calibrate([m], wide, unknowns)
    assert better.verdict.startswith("good") and better.fit.values[
        better.fit.names.index("camera.k1")
    ] == pytest.approx(0.5, abs=0.1)


def test_geometry_alone_absorbs_the_mirrors_low_orders_and_says_so():
    scene = paraboloid(31)
    found = calibrate([measured(scene, {"zernike.4_um": 0.2, "zernike.6_um": 0.1})], scene, Unknowns(mirror_order=0))
    (said,) = (check for check in found.checks if check.name == "mirror terms")
    assert said.level != OK and "no term of the mirror is an unknown" in said.text and "Z4 100%" in said.text
    assert found.effects.grid.coefficients(found.effects.after)[0] * 1e3 < 0.02  # of 0.2: lost
    known = calibrate([measured(scene, {}, knows_mirror=True)], scene)
    assert known.order == 0 and known.verdict.startswith("good")


def test_a_reference_mirror_finds_the_geometry_for_the_mirror_under_test():
    """The known mirror determines the geometry, so that the other's power is its own."""
    scene, true = paraboloid(31), {"camera.z_mm": 0.3, "screen.z_mm": 0.2, "camera.x_mm": 0.3}
    figure = {"zernike.4_um": 0.5}
    alone = measured(scene, true | figure, seed=1, name="mirror")
    reference = measured(scene, true, seed=2, name="reference", knows_mirror=True)
    without, with_it = calibrate([alone], scene), calibrate([reference, alone], scene)
    power = TERMS.index(4)
    stated = [f.effects.grid.coefficients(f.effects.draws)[:, power].std() * 1e3 for f in (without, with_it)]
    assert stated[0] > 0.1 > 0.002 > stated[1]
    found = with_it.effects.grid.coefficients(with_it.effects.after)[power] * 1e3
    assert abs(found - 0.5) < 5 * stated[1] + 1e-3  # a nanometre of the pixels


def test_the_scene_that_comes_out_states_what_is_known_of_it():
    scene = knowing(paraboloid(31), camera__x_mm=0.1, camera_to_screen=0.05)
    found = calibrate([measured(scene, {"camera.x_mm": 0.1})], scene)
    assert found.scene.mirror == scene.mirror and found.scene.camera != scene.camera
    known = found.scene.calibration.known
    assert known["camera.x_mm"].sigma == pytest.approx(found.fit.errors[0])
    assert known["camera.x_mm"].source == "irtscots calibrate"
    apart = math.dist(scene.camera.position_mm, scene.screen.position_mm)
    assert known["camera to screen"].mm == pytest.approx(apart) and known["camera to screen"].sigma == 0.05
    assert Scene.from_dict(tomllib.loads(found.scene.to_toml())) == found.scene


def test_names_that_are_held_and_terms():
    assert mirror_terms(0) == () and mirror_terms(2) == zernike_names([4, 5, 6])
    held = Unknowns(("camera.x_mm", "camera.y_mm"), hold=("camera.y_mm", "zernike.5_um"))
    assert held.up_to(2) == ("camera.x_mm", "zernike.4_um", "zernike.6_um")


def test_a_name_of_what_is_known_that_is_none():
    scene = knowing(paraboloid(31), camera__x=0.1)
    with pytest.raises(SceneError, match=r"^a\.toml: calibration\.known: unknown 'camera\.x': did you mean"):
        calibrate([measured(scene, {})], scene, Unknowns(source="a.toml"))
