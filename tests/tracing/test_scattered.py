"""Device functions of scattered rays: the directions drawn, their density, their weight, and the share that scatters.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from device_kernels import PATH_FILES, kernel_text
from significance import chi_square_p, sidak_p, sidak_z
from tracers import setup_of

from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import PATH, PRECISIONS, path_job_dtype
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.tracing.packing.components import LOBE_SHARE, pack_elements, pack_scatter
from irtscots_cl.tracing.packing.scene import pack

FAILURE_CHANCE = 1e-6
COUNT = 2**15
MODELS = [Lambertian(0.2), Harvey(0.05, -1.5, tis=0.1), Harvey(0.2, -2.0, tis=0.1), Harvey(1e-3, -3.0, tis=0.1),
          ABg(1e-3, 0.05, 2.6), ABg(1e-5, 1e-3, 1.5)]  # fmt: skip
NAMES = ("lambertian", "harvey", "abg")
ANGLES = (0.0, 30.0, 80.0)  # of incidence, degrees
STATEMENTS = 2 * 5 * len(MODELS) * len(ANGLES)  # precisions; lobe, target's ring and angle, energy with and without
P, Z = sidak_p(STATEMENTS, FAILURE_CHANCE), sidak_z(STATEMENTS, FAILURE_CHANCE)
AT = np.array([100.0, 50.0, 2.0])  # where the ray stands, mm
TARGET_MM = 800.0  # radius of the disk that stands for the camera's aperture: 11 degrees

DRAW = """    __constant Lobe *lobe = &scatter->lobes[0];
    Scattering ray;
    ray.at = (vec3s){about[0], about[1], about[2]};
    ray.normal = (vec3s){0, 0, 1};
    ray.beta0 = (vec3s){about[3], about[4], 0};
    ray.sine = sqrt(dots(ray.beta0, ray.beta0));
    ray.group = 0;
    const size_t first = get_global_id(0) * WIDTH;
    uintv radius, angle;
    realv cosine, a, b;
    for (int k = 0; k < WIDTH; ++k) {
        ((uint *)&radius)[k] = words[3 * (first + k) + 1];
        ((uint *)&angle)[k] = words[3 * (first + k) + 2];
        ((real *)&cosine)[k] = cosines[first + k];
    }
    unit_disk(radius, angle, &a, &b);
    const realv share = scattered_share(lobe, cosine);
    for (int k = 0; k < WIDTH; ++k) {
        __global real *into = out + 8 * (first + k);
        real density;
        const Leaving leaving = draw_direction(scatter, lobe, &ray, uniform_of(words[3 * (first + k)]),
                                               ((const real *)&a)[k], ((const real *)&b)[k], &density);
        const vec3s off = adds(leaving.beta, -1, ray.beta0);
        const real d2 = dots(off, off);
        into[0] = leaving.beta.x;
        into[1] = leaving.beta.y;
        into[2] = leaving.along.x;
        into[3] = leaving.along.y;
        into[4] = leaving.along.z;
        into[5] = model == 0 ? bsdf_lambertian(lobe, d2) : model == 1 ? bsdf_harvey(lobe, d2) : bsdf_abg(lobe, d2);
        into[6] = density;
        into[7] = ((const real *)&share)[k];
    }"""


class Scatterer:
    """A mirror that scatters by a model, on the device. lobe, target: as the kernels see them."""

    def __init__(self, device, folder, precision, model, aimed):
        packed = pack(setup_of(load_scene("sphere")).chief_rays, precision)
        scene = load_scene("sphere")
        scene = replace(scene, mirror=replace(scene.mirror, scatter=model))
        real, components = PRECISIONS[precision], components_of(scene)
        self.scatter, structs = pack_scatter(scene, components, real, aimed)
        self.scatter["targets"]["radius"] = TARGET_MM
        self.lobe, self.target = self.scatter["lobes"][0], self.scatter["targets"][0]
        self.model, self.real = NAMES.index(type(model).__name__.lower()), real
        structs |= {"Element": pack_elements(scene, components, real, 0.1).dtype, "Path": PATH}
        structs |= {"PathJob": path_job_dtype(real)}
        signature = "__constant Scatter *scatter, int model, __constant real *about, __global const uint *words, "
        signature += "__global const real *cosines, __global real *out"
        entry = kernel_text(folder / "draw.cl", [f"scatter_{name}.cl" for name in NAMES], signature, DRAW)
        choices = packed.choices | PATH_FILES | {"ray_stack": "list", "branch": "random"}
        self.width = device.vector_width(precision)
        self.work = Workspace(device, compose(entry, choices, packed.structs | structs, precision, self.width), "draw")

    def draw(self, beta0, words, cosines=None):
        """Columns: beta [n, 2], along [n, 3], bsdf, density, share of a ray of each random words [n, 3]."""
        work, out = self.work, np.zeros((len(words), 8), self.real)
        cosines = np.ones(len(words)) if cosines is None else cosines
        device_identity = np.array([*AT, *beta0, 0.0], self.real)
        given = [work.upload(self.scatter), np.int32(self.model), work.upload(device_identity), work.upload(words),
                 work.upload(cosines.astype(self.real))]  # fmt: skip
        buffer = work.empty(out.nbytes)
        work.launch((len(words) // self.width, 1), [*given, buffer])
        out = work.download(buffer, out).astype(float)
        return out[:, :2], out[:, 2:5], out[:, 5], out[:, 6], out[:, 7]


@pytest.fixture(scope="module")
def built(device, tmp_path_factory):
    """Made once each: the same for all angles."""
    folder = tmp_path_factory.mktemp("scattered")
    return cache(lambda precision, model, aimed: Scatterer(device, folder, precision, model, aimed))


@pytest.fixture
def scatterer(built, precision):
    return lambda model, aimed: built(precision, model, aimed)


@cache
def random_words():
    return np.random.default_rng(21).integers(0, 2**32, (COUNT, 3), np.uint32)


def specular(degrees):
    """beta0 of that angle of incidence, in an azimuth along no axis."""
    return np.sin(np.radians(degrees)) * np.array([0.6, 0.8])


def lobe_share(lobe, d):
    """Of the lobe's density, (1 + d^2 / l^2)^(p - 1): what lies nearer than d, but for a factor."""
    return np.expm1(float(lobe["power"]) * np.log1p(d * d * float(lobe["inverse_l2"])))


def density_of(scatterer, beta0, along, aimed):
    """Per solid angle, of directions [n, 3]: lobe and target by their chances; and whether they go to the target."""
    lobe, target = scatterer.lobe, scatterer.target
    p, inverse, centre = (float(lobe[name]) for name in ("power", "inverse_l2", "centre"))
    d2 = ((along[:, :2] - centre * beta0) ** 2).sum(1)
    whole = lobe_share(lobe, 1 + centre * np.hypot(*beta0))
    of_lobe = (1 + d2 * inverse) ** (p - 1) * p * inverse / (np.pi * whole) * along[:, 2]
    if not aimed:
        return of_lobe, np.zeros(len(along), bool)
    to, z = target["centre"][0].astype(float) - AT, target["axis_z"].astype(float)
    slope = along @ z
    step = (to @ z) / slope
    hits = (step > 0) & (np.linalg.norm(step[:, None] * along - to, axis=1) < TARGET_MM)
    of_target = hits * step**2 / (np.pi * TARGET_MM**2 * np.abs(slope))
    return LOBE_SHARE * of_lobe + (1 - LOBE_SHARE) * of_target, hits


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_directions_are_drawn_with_the_density_that_is_told(scatterer, model, degrees):
    """The lobe's by rings and azimuths about its centre, below the horizon too; those to the target by its area."""
    device, beta0, words = scatterer(model, True), specular(degrees), random_words()
    beta, along, _, density, _ = device.draw(beta0, words)
    aimed = (words[:, 0] >> 8 | 1) / 2**24 >= LOBE_SHARE
    lobe, centre = device.lobe, float(device.lobe["centre"]) * beta0
    away = beta[~aimed] - centre
    share = lobe_share(lobe, np.hypot(*away.T)) / lobe_share(lobe, 1 + np.hypot(*centre))
    azimuth = np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5
    bins, *_ = np.histogram2d(share, azimuth, 12, [(0, 1 + 1e-5), (0, 1)])  # 1e-5: rounding of the farthest
    assert bins.sum() == (~aimed).sum()
    assert chi_square_p(bins, np.full(bins.shape, bins.sum() / bins.size), fitted=1) > P
    to, z = device.target["centre"][0].astype(float) - AT, device.target["axis_z"].astype(float)
    step = (to @ z) / (along[aimed] @ z)
    off = (step[:, None] * along[aimed] - to) @ np.stack([device.target["axis_x"], device.target["axis_y"]], 1)
    square, turn = (off**2).sum(1) / TARGET_MM**2, np.arctan2(*off.T) / (2 * np.pi) + 0.5
    assert square.max() < 1 + 1e-4  # rounding of 4 m
    bins, *_ = np.histogram2d(square, turn, 12, [(0, 1 + 1e-4), (0, 1)])
    assert chi_square_p(bins, np.full(bins.shape, bins.sum() / bins.size), fitted=1) > P
    above = density > 0
    np.testing.assert_array_equal(above, along[:, 2] > 0)
    assert above[aimed].all()
    assert above.all() == (degrees == 0 or not centre.any())  # a lobe about the normal ends at the horizon
    expected, hits = density_of(device, beta0, along[above], True)
    inside = np.abs(density[above] / expected - 1) < (2e-3 if device.real is np.float32 else 1e-6)
    assert (~inside).sum() <= 8  # at the target's rim rounding decides whether it is met
    assert hits[aimed[above]].mean() > 0.999


@pytest.mark.parametrize("aimed", [True, False])
@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_the_scattered_light_is_the_models_total(scatterer, model, degrees, aimed):
    """Mean of BSDF times cosine over density: all light that scatters above the horizon, however it is drawn."""
    beta0 = specular(degrees)
    _, along, bsdf, density, _ = scatterer(model, aimed).draw(beta0, random_words())
    above = density > 0
    weight = np.where(above, bsdf * along[:, 2] / np.where(above, density, 1), 0)
    error = weight.std() / np.sqrt(COUNT)
    expected = float(model.tis_at(np.hypot(*beta0)))
    assert abs(weight.mean() - expected) < Z * error + 1e-5 * expected  # rounding
    assert Z * error < 0.1 * expected


WIDTHS = [Harvey(l, s, tis=0.1) for l in (1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0) for s in (-1.0, -2.0, -3.0)]
WIDTHS += [ABg(1e-6 * b, b, g) for b, g in ((1e-6, 2.0), (1e-3, 1.0), (1e-6, 3.0))]


def test_the_share_that_scatters_is_the_models_total_within_a_thousandth(device, tmp_path):
    """At all cosines of incidence from grazing on, of either sign: of the total at normal incidence."""
    cosines = np.concatenate([np.logspace(-5, 0, 448), -np.linspace(1e-6, 1, 64)])
    worst = 0.0
    for model in WIDTHS:
        *_, found = Scatterer(device, tmp_path, "fp32", model, False).draw(np.zeros(2), random_words()[:512], cosines)
        expected = model.tis_at(np.sqrt(1 - cosines * cosines))
        worst = max(worst, float(np.abs(found / expected - 1).max()))
        assert np.abs(found - expected).max() < 1e-3 * float(model.tis_at())
    assert worst > 1e-5  # the table is one
