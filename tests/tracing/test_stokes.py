"""Device functions of polarised light at interfaces: beside complex amplitudes and the rules of reflection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from device_kernels import PATH_FILES, kernel_text

from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import PRECISIONS, element_dtype

COUNT = 512
SCENE = np.dtype([("unused", np.int32)])  # the functions name the type and read nothing of it
POLARISED = PATH_FILES | dict.fromkeys(("light", "carry", "fresnel"), "polarised") | {"branch": "random"}

BODY = """    Interaction at;
    for (int lane = 0; lane < WIDTH; ++lane) {
        const __global real *from = given + 11 * (get_global_id(0) * WIDTH + lane);
        ((real *)&at.along.x)[lane] = from[0];
        ((real *)&at.along.y)[lane] = from[1];
        ((real *)&at.along.z)[lane] = from[2];
        ((real *)&at.normal.x)[lane] = from[3];
        ((real *)&at.normal.y)[lane] = from[4];
        ((real *)&at.normal.z)[lane] = from[5];
        ((real *)&at.light.q)[lane] = from[6];
        ((real *)&at.light.u)[lane] = from[7];
        ((real *)&at.light.e.x)[lane] = from[8];
        ((real *)&at.light.e.y)[lane] = from[9];
        ((real *)&at.light.e.z)[lane] = from[10];
    }
    at.event = (intv)(EVENT_NOMINAL);
    realv values[6];
    CALL
    for (int lane = 0; lane < WIDTH; ++lane)
        for (int k = 0; k < 6; ++k)
            out[6 * (get_global_id(0) * WIDTH + lane) + k] = ((const real *)&values[k])[lane];"""

INTERFACE = """const Refraction r = refract(elements, &at);
    const Interface found = KIND_interface(elements, &r);
    values[0] = found.s; values[1] = found.p; values[2] = found.u_mirrored; values[3] = found.u_passed;
    values[4] = values[5] = (realv)(0);"""

PART = """const Refraction r = refract(elements, &at);
    Parted parted;
    values[0] = KIND_share(elements, &at, &r, &parted);
    values[1] = parted.mirrored.q; values[2] = parted.mirrored.u; values[3] = parted.passed.q;
    values[4] = parted.passed.u; values[5] = dot3(parted.passed.e, at.normal);"""

MIRROR = """light_mirror(&at);
    values[0] = at.light.q; values[1] = at.light.u; values[2] = at.light.e.x; values[3] = at.light.e.y;
    values[4] = at.light.e.z; values[5] = (realv)(0);"""


@pytest.fixture
def run(device, tmp_path, precision):
    """run(call, kind, along, light, **element) -> values [n, 6]; the normal is along z. light: (q, u, e [n, 3])."""
    real, width = PRECISIONS[precision], device.vector_width(precision)

    def call(body, kind, along, light=(0.0, 0.0, 0.0), **values):
        element = np.zeros(1, element_dtype(real, 1))
        element["axis_x"], element["axis_y"], element["axis_z"] = np.eye(3)
        element["index_front"], element["index_back"], element["reflectance"] = 1.0, 1.5, -1.0
        for name, value in values.items():
            element[name] = value
        signature = "__constant Element *elements, __global const real *given, __global real *out"
        entry = kernel_text(tmp_path / "polarised.cl", ["interact_refractor.cl", "interact_coated.cl"], signature,
                            BODY.replace("CALL", body.replace("KIND", kind)))  # fmt: skip
        structs = {"Scene": SCENE, "Element": element.dtype}
        work = Workspace(device, compose(entry, POLARISED, structs, precision, width), "polarised")
        rays = np.zeros((COUNT, 11), real)
        rays[:, 0:3], rays[:, 3:6] = along, (0.0, 0.0, 1.0)
        rays[:, 6], rays[:, 7], rays[:, 8:11] = light
        out = np.zeros((COUNT, 6), real)
        buffers = [work.upload(element), work.upload(rays), work.empty(out.nbytes)]
        work.launch((COUNT // width, 1), buffers)
        return work.download(buffers[2], out).astype(float)

    return call


def tolerance(precision):
    return {"fp32": 3e-5, "fp64": 1e-8}[precision]  # steps of numbers near 1 over differences of some hundredths


def incident(low, high):
    """Directions [n, 3] towards -z, at angles between two in degrees; and the angles' cosines."""
    generator = np.random.default_rng(3)
    angle, turn = np.radians(generator.uniform(low, high, COUNT)), generator.uniform(0, 2 * np.pi, COUNT)
    along = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle)], -1)
    return along, np.cos(angle)


def amplitudes(first, last, cosine):
    """Complex reflection amplitudes of s and p of a bare interface, and the (complex) cosine beyond it."""
    beyond = np.sqrt(1 - (first / last) ** 2 * (1 - cosine**2) + 0j)
    return ((first * cosine - last * beyond) / (first * cosine + last * beyond),
            (last * cosine - first * beyond) / (last * cosine + first * beyond), beyond)  # fmt: skip


def test_a_bare_interface(run, precision):
    along, cosine = incident(0, 85)
    s, p, _ = amplitudes(1.0, 1.5, cosine)
    found = run(INTERFACE, "refractor", along)
    expected = [np.abs(s) ** 2, np.abs(p) ** 2, (s * p.conj()).real, np.sqrt((1 - s.real**2) * (1 - p.real**2))]
    np.testing.assert_allclose(found[:, :4], np.stack(expected, -1), atol=tolerance(precision))


def test_total_reflection_turns_the_phases_apart(run, precision):
    """Re(r_s r_p*) of Fresnel's complex amplitudes, from the critical angle of 41.8 degrees to grazing incidence."""
    along, cosine = incident(42.5, 89)
    s, p, _ = amplitudes(1.5, 1.0, cosine)
    np.testing.assert_allclose(np.abs([s, p]), 1, rtol=1e-12)
    found = run(INTERFACE, "refractor", along, index_front=1.5, index_back=1.0)
    np.testing.assert_allclose(found[:, :2], 1, atol=1e-6)
    np.testing.assert_allclose(found[:, 2], (s * p.conj()).real, atol=20 * tolerance(precision))  # beside the limit
    assert (s * p.conj()).real.min() < 0.8  # there is something to see


@pytest.mark.parametrize("layer", [1.2, 1.38, 2.3])
def test_a_coating(run, precision, layer):
    """Airy's sum of a layer of a quarter of a wavelength, in complex amplitudes; transmission by its own amplitude."""
    along, cosine = incident(0, 80)
    s1, p1, inside = amplitudes(1.0, layer, cosine)
    s2, p2, _ = amplitudes(layer, 1.5, inside.real)
    phase = np.exp(1j * np.pi * inside.real)
    s, p = ((one + two * phase) / (1 + one * two * phase) for one, two in ((s1, s2), (p1, p2)))
    turn = np.angle((1 + s1 * s2 * phase).conj() * (1 + p1 * p2 * phase))  # between the two that pass
    passed = np.sqrt((1 - np.abs(s) ** 2) * (1 - np.abs(p) ** 2)) * np.cos(turn)
    found = run(INTERFACE, "coated", along, coating_index=layer)
    expected = [np.abs(s) ** 2, np.abs(p) ** 2, (s * p.conj()).real, passed]
    np.testing.assert_allclose(found[:, :4], np.stack(expected, -1), atol=tolerance(precision))


def test_the_light_is_told_from_the_plane_of_incidence(run, precision):
    """Light polarised at any angle to that plane: its field's parts along s and p are reflected each by its own."""
    along, cosine = incident(20, 80)
    generator = np.random.default_rng(5)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    beside = np.cross(along, across)
    angle, reference = generator.uniform(0, 2 * np.pi, (2, COUNT))
    degree = generator.uniform(0, 1, COUNT)
    e = np.cos(reference)[:, None] * across + np.sin(reference)[:, None] * beside
    light = (degree * np.cos(2 * (angle - reference)), degree * np.sin(2 * (angle - reference)), e)
    s, p, _ = amplitudes(1.0, 1.5, cosine)
    s, p = s.real, p.real
    # unpolarised part, and a field (cos, sin) of (s, p)
    of_s = (1 - degree) / 2 + degree * np.cos(angle) ** 2
    of_p = 1 - of_s
    u = degree * np.sin(2 * angle)
    share = s**2 * of_s + p**2 * of_p
    expected = [share, (s**2 * of_s - p**2 * of_p) / share, s * p * u / share,
                ((1 - s**2) * of_s - (1 - p**2) * of_p) / (1 - share),
                np.sqrt((1 - s**2) * (1 - p**2)) * u / (1 - share), np.zeros(COUNT)]  # fmt: skip
    found = run(PART, "refractor", along, light)
    enough = share > 1e-3
    np.testing.assert_allclose(found[enough], np.stack(expected, -1)[enough], atol=100 * tolerance(precision))
    assert enough.mean() > 0.9


def test_unpolarised_light_needs_no_reference(run, precision):
    along, cosine = incident(0, 80)
    s, p, _ = amplitudes(1.0, 1.5, cosine)
    found = run(PART, "refractor", along)
    np.testing.assert_allclose(found[:, 0], (np.abs(s) ** 2 + np.abs(p) ** 2) / 2, atol=tolerance(precision))
    np.testing.assert_allclose(found[:, [2, 4]], 0, atol=1e-7)
    assert np.isfinite(found).all()


def test_light_along_the_normal_is_reflected_alike(run):
    """No plane of incidence: the degree of polarisation stays, whatever stands for that plane."""
    along = np.tile([0.0, 0.0, -1.0], (COUNT, 1))
    found = run(PART, "refractor", along, (0.6, 0.3, np.tile([1.0, 0.0, 0.0], (COUNT, 1))))
    np.testing.assert_allclose(found[:, 0], 0.04, rtol=1e-5)
    for q, u in ((1, 2), (3, 4)):
        np.testing.assert_allclose(np.hypot(found[:, q], found[:, u]), math.hypot(0.6, 0.3), rtol=1e-5)


def test_a_mirror_turns_the_field_as_a_mirror_does(run, precision):
    """The reference becomes its mirror image, and the field at 45 degrees to it the mirror image of that."""
    along, _ = incident(10, 80)
    e = np.cross(along, [0.3, 0.5, 0.8])
    e /= np.linalg.norm(e, axis=-1, keepdims=True)
    found = run(MIRROR, "refractor", along, (0.2, 0.7, e))
    image = e * [1, 1, -1]
    np.testing.assert_allclose(found[:, 2:5], image, atol=tolerance(precision))
    np.testing.assert_allclose(found[:, :2], np.tile([0.2, -0.7], (COUNT, 1)), atol=1e-6)
    # the old field along e + d x e has the image e' + (d x e)'; d' x e' is -(d x e)'
    goes = along * [1, 1, -1]
    np.testing.assert_allclose(np.cross(goes, image), -np.cross(along, e) * [1, 1, -1], atol=1e-12)
