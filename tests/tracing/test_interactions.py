"""Device functions of the non-sequential tracer: where rays meet elements, and what becomes of them there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from device_kernels import PATH_FILES, kernel_text
from oracle import sequence

from irtscots_cl.maths.frame import Frame
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import PRECISIONS, element_dtype
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.scene.presets import load_scene

COUNT = 4096  # rays of a test; a multiple of every width
NONE = -1
EXACT = np.longdouble  # of what fp64 is compared with
PLANE = Quadric(0.0, 0.0, 0.0)
SCENE = np.dtype([("unused", np.int32)])  # the functions name the type and read nothing of it

GIVEN_RAYS = """    Rays rays;
    for (int lane = 0; lane < WIDTH; ++lane) {
        const size_t ray = get_global_id(0) * WIDTH + lane;
        ((real *)&rays.x[0])[lane] = given[6 * ray];
        ((real *)&rays.y[0])[lane] = given[6 * ray + 1];
        ((real *)&rays.z[0])[lane] = given[6 * ray + 2];
        ((real *)&rays.dx[0])[lane] = given[6 * ray + 3];
        ((real *)&rays.dy[0])[lane] = given[6 * ray + 4];
        ((real *)&rays.dz[0])[lane] = given[6 * ray + 5];
    }
    rays.group[0] = (intv)(0);
"""

MEET = (
    GIVEN_RAYS
    + """    rays.last[0] = (intv)(last);
    rays.before[0] = (intv)(before);
    rays.l1_norm[0] = l1_norm_of(rays.x[0], rays.y[0], rays.z[0]);
    realv nearest = (realv)(INFINITY);
    intv which = (intv)(-1);
    for (int k = 0; k < count; ++k) meet_SHAPE(&elements[k], &rays, 0, k, &nearest, &which);
    for (int lane = 0; lane < WIDTH; ++lane) {
        steps[get_global_id(0) * WIDTH + lane] = ((const real *)&nearest)[lane];
        numbers[get_global_id(0) * WIDTH + lane] = ((const int *)&which)[lane];
    }"""
)

# Rays through refractors in their order, as step_rays of trace_paths.cl takes them: `draw` never lets one reflect.
THROUGH = (
    GIVEN_RAYS
    + """    rays.last[0] = rays.before[0] = (intv)(-1);
    for (int k = 0; k < count; ++k) {
        __constant Element *element = &elements[k];
        rays.l1_norm[0] = l1_norm_of(rays.x[0], rays.y[0], rays.z[0]);
        realv nearest = (realv)(INFINITY);
        intv which = (intv)(-1);
        meet_quadric(element, &rays, 0, k, &nearest, &which);
        const Offset offset = group_offset(element, rays.group[0]);
        const LocalRay ray = element_ray(element, &rays, 0, &offset);
        Interaction at;
        at.point = quadric_point((__constant Scene *)0, (__global const real *)0, element, &ray, nearest);
        at.normal = quadric_normal((__constant Scene *)0, (__global const real *)0, element, at.point);
        at.along = at.goes = ray.along;
        at.weight = at.arriving = (realv)(1);
        at.event = (intv)(EVENT_NOMINAL);
        at.ends = to_mask(at.event != at.event);
        at.draw = (uintv)(0xffffffffu);
        interact_refractor(element, &at);
        __constant real *x = element->axis_x, *y = element->axis_y, *z = element->axis_z, *o = element->origin;
        const vec3v p = at.point, d = at.goes;
        rays.x[0] = x[0] * p.x + y[0] * p.y + z[0] * p.z + o[0];
        rays.y[0] = x[1] * p.x + y[1] * p.y + z[1] * p.z + o[1];
        rays.z[0] = x[2] * p.x + y[2] * p.y + z[2] * p.z + o[2];
        rays.dx[0] = x[0] * d.x + y[0] * d.y + z[0] * d.z;
        rays.dy[0] = x[1] * d.x + y[1] * d.y + z[1] * d.z;
        rays.dz[0] = x[2] * d.x + y[2] * d.y + z[2] * d.z;
        rays.last[0] = (intv)(k);
    }
    for (int lane = 0; lane < WIDTH; ++lane) {
        const size_t ray = get_global_id(0) * WIDTH + lane;
        out[6 * ray] = ((const real *)&rays.x[0])[lane];
        out[6 * ray + 1] = ((const real *)&rays.y[0])[lane];
        out[6 * ray + 2] = ((const real *)&rays.z[0])[lane];
        out[6 * ray + 3] = ((const real *)&rays.dx[0])[lane];
        out[6 * ray + 4] = ((const real *)&rays.dy[0])[lane];
        out[6 * ray + 5] = ((const real *)&rays.dz[0])[lane];
    }"""
)

INTERACT = """    Interaction at;
    for (int lane = 0; lane < WIDTH; ++lane) {
        const __global real *from = given + 9 * (get_global_id(0) * WIDTH + lane);
        ((real *)&at.point.x)[lane] = from[0];
        ((real *)&at.point.y)[lane] = from[1];
        ((real *)&at.point.z)[lane] = from[2];
        ((real *)&at.along.x)[lane] = from[3];
        ((real *)&at.along.y)[lane] = from[4];
        ((real *)&at.along.z)[lane] = from[5];
        ((real *)&at.normal.x)[lane] = from[6];
        ((real *)&at.normal.y)[lane] = from[7];
        ((real *)&at.normal.z)[lane] = from[8];
        ((uint *)&at.draw)[lane] = words[get_global_id(0) * WIDTH + lane];
    }
    at.goes = at.along;
    at.weight = at.arriving = (realv)(1);
    at.absorbed = at.split = (realv)(0);
    at.event = (intv)(EVENT_NOMINAL);
    at.room = (intv)(1);
    at.ends = to_mask(at.event != at.event);
    CALL
    const intv ends = to_int(at.ends) != 0 ? (intv)(1) : (intv)(0);
    for (int lane = 0; lane < WIDTH; ++lane) {
        const size_t ray = get_global_id(0) * WIDTH + lane;
        out[6 * ray] = ((const real *)&at.goes.x)[lane];
        out[6 * ray + 1] = ((const real *)&at.goes.y)[lane];
        out[6 * ray + 2] = ((const real *)&at.goes.z)[lane];
        out[6 * ray + 3] = ((const real *)&at.weight)[lane];
        out[6 * ray + 4] = ((const real *)&at.absorbed)[lane];
        out[6 * ray + 5] = ((const real *)&at.split)[lane];
        marks[2 * ray] = ((const int *)&at.event)[lane];
        marks[2 * ray + 1] = ((const int *)&ends)[lane];
    }"""


class Bench:
    """Builds small kernels on the device under test and runs them."""

    def __init__(self, device, folder, precision, branches="random"):
        self.device, self.folder, self.precision, self.branches = device, folder, precision, branches
        self.real, self.width = PRECISIONS[precision], device.vector_width(precision)
        self.epsilon = float(np.finfo(self.real).eps)

    def kernel(self, name, include, signature, body):
        entry = kernel_text(self.folder / f"{name}.cl", [include], "__constant Element *elements, " + signature, body)
        structs = {"Scene": SCENE, "Element": element_dtype(self.real, 1)}
        source = compose(entry, PATH_FILES | {"branch": self.branches}, structs, self.precision, self.width)
        return Workspace(self.device, source, name)

    def launch(self, work, inputs, outputs):
        given = [work.upload(x) if isinstance(x, np.ndarray) else x for x in inputs]
        buffers = [work.empty(out.nbytes) for out in outputs]
        work.launch((len(outputs[0]) // self.width, 1), [*given, *buffers])
        return [work.download(buffer, out) for buffer, out in zip(buffers, outputs, strict=True)]

    def meet(self, shape, elements, starts, directions, last=NONE, before=NONE):
        """Steps [rays] to the nearest element and their numbers [rays]."""
        signature = "__global const real *given, int last, int before, int count, __global real *steps, "
        work = self.kernel("meet", "element.cl", signature + "__global int *numbers", MEET.replace("SHAPE", shape))
        rays = np.concatenate([starts, directions], 1).astype(self.real)
        numbers = [np.int32(n) for n in (last, before, len(elements))]
        out = [np.zeros(len(rays), self.real), np.zeros(len(rays), np.int32)]
        return self.launch(work, [elements, rays, *numbers], out)

    def interact(self, kind, element, along, normal=None, point=None, words=None, call="interact_KIND(elements, &at);",
                 name="interact"):  # fmt: skip
        """goes [rays, 3], weight, event and ends [rays] after an interaction. name: one for each call."""
        along = np.asarray(along)
        zeros = np.zeros_like(along)
        normal = zeros + np.array([0, 0, 1]) if normal is None else normal
        rays = np.concatenate([zeros if point is None else point, along, normal], 1).astype(self.real)
        words = np.zeros(len(rays), np.uint32) if words is None else words
        signature = "__global const real *given, __global const uint *words, __global real *out, __global int *marks"
        body = INTERACT.replace("CALL", call.replace("KIND", kind))
        work = self.kernel(name, f"interact_{kind}.cl", signature, body)
        extra = -len(rays) % self.width  # whole vectors
        rays, words = (np.concatenate([a, a[:1].repeat(extra, 0)]) for a in (rays, words))
        out = [np.zeros((len(rays), 6), self.real), np.zeros((len(rays), 2), np.int32)]
        values, marks = (a[: len(along)] for a in self.launch(work, [element, rays, words.astype(np.uint32)], out))
        return SimpleNamespace(goes=values[:, :3].astype(float), weight=values[:, 3].astype(float),
                               absorbed=values[:, 4].astype(float), components=values[:, 5].astype(float),
                               event=marks[:, 0], ends=marks[:, 1])  # fmt: skip

    def through(self, elements, starts, directions):
        """Points and directions [rays, 3] behind curved refractors, told from the elements' common origin."""
        signature = "__global const real *given, int count, __global real *out"
        work = self.kernel("through", "interact_refractor.cl", signature, THROUGH)
        rays = np.concatenate([starts, directions], 1).astype(self.real)
        rays = np.concatenate([rays, rays[:1].repeat(-len(rays) % self.width, 0)])  # whole vectors
        (out,) = self.launch(work, [elements, rays, np.int32(len(elements))], [np.zeros_like(rays)])
        return out[: len(starts), :3].astype(float), out[: len(starts), 3:].astype(float)

    def refract(self, element, along, normal=None, kind="refractor"):
        """Refracted directions and, in `weight`, the reflectance."""
        call = "const Refraction r = refract(elements, &at); at.goes = r.beyond; "
        call += "at.weight = KIND_reflectance(elements, &r);"
        return self.interact(kind, element, along, normal, call=call, name="shares")


@pytest.fixture
def bench(device, tmp_path, precision):
    return Bench(device, tmp_path, precision)


def element_of(bench, frame=None, quadric=PLANE, outer_mm=1e15, copies=1, **values):
    """Elements [copies] at one place, told from the world's origin."""
    frame = frame or Frame(np.zeros(3), np.eye(3))
    entry = np.zeros(copies, element_dtype(bench.real, 1))
    entry["axis_x"], entry["axis_y"], entry["axis_z"] = frame.axes
    to = -frame.axes @ frame.position_mm
    entry["offset"] = [*to, np.abs(to).sum()]
    for name in ("q_xx", "q_yy", "q_zz", "q_xz"):
        entry[name] = getattr(quadric, name)
    entry["outer2"], entry["half_u"], entry["half_v"] = outer_mm**2, 1e30, 1e30
    for name, value in values.items():
        entry[name] = value
    return entry


def local(element, starts, directions):
    """What the kernel is given, in the element's frame, not rounded further: at, along [rays, 3] and size [rays]."""
    axes = np.stack([element[name][0] for name in ("axis_x", "axis_y", "axis_z")]).astype(EXACT)
    starts, directions = (a.astype(element["q_xx"].dtype).astype(EXACT) for a in (starts, directions))
    at = starts @ axes.T + element["offset"][0, 0, :3].astype(EXACT)
    return at, directions @ axes.T, (np.abs(starts).sum(1) + element["offset"][0, 0, 3]).astype(float)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def tilted(size):
    """A frame at about `size` from the origin that lies along no axis."""
    return Frame.looking(np.array([0.3, -0.5, 0.8]) * size, np.array([-0.2, 0.4, -0.3]) * size)


def incident(generator, count=COUNT):
    """Directions towards -z at up to 60 degrees from it."""
    slope = np.sqrt(3.0 * generator.random(count))
    angle = generator.uniform(0, 2 * np.pi, count)
    return unit(np.stack([slope * np.cos(angle), slope * np.sin(angle), -np.ones(count)], -1))


SIZES = [1e-3, 1.0, 1e3, 1e5]


# --- where rays meet elements -------------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES)
def test_meet_plane_is_exact_but_for_roundings_of_the_coordinates(bench, size):
    generator, frame = np.random.default_rng(1), tilted(size)
    element = element_of(bench, frame)
    directions = incident(generator) @ frame.axes
    targets = frame.to_world(*(generator.uniform(-size, size, (2, COUNT))))
    starts = targets - directions * (size * 10 ** generator.uniform(-2, 0.5, COUNT))[:, None]
    steps, numbers = bench.meet("plane", element, starts, directions)
    at, along, scale = local(element, starts, directions)
    assert (numbers == 0).all()
    error = np.abs(steps - (-at[:, 2] / along[:, 2])).astype(float)
    # four products and sums of the coordinates, over a cosine of 0.5 or more; three and a quotient of the step itself
    assert (error <= bench.epsilon * (8 * scale + 4 * np.abs(steps))).all()


def exact_step(quadric_of, at, along):
    """Step to the quadric's sheet that a ray from its front meets, by the textbook formula in long double."""
    q = [quadric_of[name].astype(EXACT)[0] for name in ("q_xx", "q_yy", "q_zz", "q_xz")]

    def form(a, b):
        return (q[0] * a[:, 0] * b[:, 0] + q[1] * a[:, 1] * b[:, 1] + q[2] * a[:, 2] * b[:, 2]
                + q[3] * (a[:, 0] * b[:, 2] + a[:, 2] * b[:, 0]))  # fmt: skip

    back = -(at * along).sum(1)
    at = at + back[:, None] * along
    a, b, c = form(along, along), form(at, along) - along[:, 2], form(at, at) - 2 * at[:, 2]
    return back - c / (b + np.sqrt(b * b - a * c))  # the root next to the vertex, for b above 0


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("conic", [0.0, -1.0, 0.5])
def test_meet_quadric_is_exact_but_for_roundings_of_the_coordinates(bench, size, conic):
    """Rays from the front, from 0.01 to 30 radii away, to a concave surface."""
    generator, frame = np.random.default_rng(2), tilted(size)
    quadric = Quadric.conic(size, conic, 0.0 if conic == 0.0 else 0.1 * size)
    element = element_of(bench, frame, quadric, 0.3 * size)
    directions = incident(generator)
    x, y = generator.uniform(-0.2 * size, 0.2 * size, (2, COUNT))
    targets = np.stack([x, y, quadric.meet(x, y, 0.0, 0.0)], -1)
    starts = targets - directions * (size * 10 ** generator.uniform(-2, 1.5, COUNT))[:, None]
    starts, directions = frame.position_mm + starts @ frame.axes, directions @ frame.axes
    steps, numbers = bench.meet("quadric", element, starts, directions)
    at, along, scale = local(element, starts, directions)
    assert (numbers == 0).all()
    error = np.abs(steps - exact_step(element, at, along)).astype(float)
    assert (error <= 32 * bench.epsilon * (scale + size)).all()  # a dozen roundings, over a cosine of 0.4 or more


def test_what_is_behind_or_beside_is_not_met(bench):
    """A hole, a rim and a rectangle; and a plane that the ray has passed."""
    element = element_of(bench, outer_mm=10.0, inner2=4.0, half_u=8.0, half_v=6.0)
    x = np.array([0.0, 1.9, 2.1, 7.9, 8.1, -7.9, -8.1, 0.0, 0.0, 0.0, 0.0, 7.9])
    y = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.9, 6.1, -5.9, -6.1, 6.2])
    met = np.array([False, False, True, True, False, True, False, True, False, True, False, False])
    starts = np.resize(np.stack([x, y, np.full(12, 50.0)], -1), (4 * 48, 3))  # whole vectors of any width
    down = np.zeros_like(starts) - (0, 0, 1)
    for shape in ("plane", "quadric"):
        _, numbers = bench.meet(shape, element, starts, down)
        np.testing.assert_array_equal(numbers == 0, np.resize(met, len(starts)))
        assert (bench.meet(shape, element, starts, -down)[1] == NONE).all()


@pytest.mark.parametrize("size", SIZES)
def test_a_ray_does_not_meet_the_plane_that_it_stands_on(bench, size):
    """On the plane but for rounding, to either side."""
    generator, frame = np.random.default_rng(3), tilted(size)
    element = element_of(bench, frame)
    starts = frame.to_world(*(generator.uniform(-size, size, (2, COUNT))))
    for side in (1, -1):
        directions = side * incident(generator) @ frame.axes
        steps, numbers = bench.meet("plane", element, starts, directions, last=0)
        assert (numbers == NONE).all() and np.isinf(steps).all()


@pytest.mark.parametrize("size", SIZES)
def test_a_ray_from_a_sphere_meets_its_other_side_alone(bench, size):
    """A bowl of nearly half a sphere: rays within it go to the other wall, those that leave it nowhere."""
    generator, frame = np.random.default_rng(4), tilted(size)
    element = element_of(bench, frame, Quadric.conic(size), 0.999 * size)
    polar, turn = generator.uniform(0.5, 1.4, COUNT), generator.uniform(0, 2 * np.pi, COUNT)
    walls = [size * np.stack([np.sin(polar) * np.cos(a), np.sin(polar) * np.sin(a), 1 - np.cos(polar)], -1)
             for a in (turn, turn + generator.uniform(2.0, 4.0, COUNT))]  # fmt: skip
    starts, ends = (frame.position_mm + wall @ frame.axes for wall in walls)
    steps, numbers = bench.meet("quadric", element, starts, unit(ends - starts), last=0)
    assert (numbers == 0).all()
    length = np.linalg.norm(ends - starts, axis=1)
    np.testing.assert_allclose(steps, length, rtol=0, atol=64 * bench.epsilon * size)  # roundings of 2 size, cosine 0.2
    up = np.zeros((COUNT, 3)) + frame.axes[2]
    assert (bench.meet("quadric", element, starts, up, last=0)[1] == NONE).all()
    out = unit(walls[0] - (0, 0, size)) @ frame.axes
    assert (bench.meet("quadric", element, starts, out, last=0)[1] == NONE).all()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shape", ["plane", "quadric"])
def test_surfaces_at_one_place_are_met_once_each(bench, size, shape):
    """The first from afar, the other at a step of nothing, then neither again: in either order, to either side."""
    generator, frame = np.random.default_rng(5), tilted(size)
    quadric = PLANE if shape == "plane" else Quadric.conic(size)
    pair = element_of(bench, frame, quadric, 0.3 * size, copies=2)
    x, y = generator.uniform(-0.2 * size, 0.2 * size, (2, COUNT))
    points = frame.position_mm + np.stack([x, y, quadric.meet(x, y, 0.0, 0.0)], -1) @ frame.axes
    for side in (1, -1):
        directions = side * incident(generator) @ frame.axes
        steps, numbers = bench.meet(shape, pair, points - 0.1 * size * directions, directions)
        assert (numbers >= 0).all()
        np.testing.assert_allclose(steps, 0.1 * size, rtol=0, atol=64 * bench.epsilon * size)  # as above
        for first in (0, 1):
            steps, numbers = bench.meet(shape, pair, points, directions, last=first)
            assert (numbers == 1 - first).all()
            assert np.abs(steps).max() <= 64 * bench.epsilon * size  # 8 of |x| + |y| + |z| and the offset, 5 size
            assert (bench.meet(shape, pair, points, directions, last=1 - first, before=first)[1] == NONE).all()


def test_a_ray_along_a_plane_misses_it(bench):
    """Above, below and in it: a quotient by nothing, or of nothing by nothing."""
    starts = np.repeat([[1.0, 2.0, 3.0], [1.0, 2.0, -3.0], [1.0, 2.0, 0.0]], 64, 0)
    along = np.zeros_like(starts) + np.array([0.6, 0.8, 0.0])
    for shape in ("plane", "quadric"):
        steps, numbers = bench.meet(shape, element_of(bench), starts, along)
        assert (numbers == NONE).all() and np.isinf(steps).all()


def test_a_ray_tangent_to_a_sphere_gives_no_nan(bench):
    """Within a few roundings of touching, either way: met at about the right step, or missed."""
    size, generator = 100.0, np.random.default_rng(6)
    element = element_of(bench, quadric=Quadric.conic(size), outer_mm=0.999 * size)
    polar, turn = generator.uniform(0.3, 1.2, COUNT), generator.uniform(0, 2 * np.pi, COUNT)
    out = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), -np.cos(polar)], -1)
    along = np.stack([-np.sin(turn), np.cos(turn), np.zeros(COUNT)], -1)
    off = size * (1 + bench.epsilon * generator.uniform(-4, 4, COUNT))
    steps, numbers = bench.meet("quadric", element, [0, 0, size] + off[:, None] * out - 50 * along, along)
    assert not np.isnan(steps).any()
    met = numbers == 0
    assert 0 < met.sum() < COUNT  # both happen
    assert np.isinf(steps[~met]).all()
    # half a chord at a depth of 16 roundings of the radius
    np.testing.assert_allclose(steps[met], 50, rtol=0, atol=size * np.sqrt(2 * 16 * bench.epsilon))


# --- what becomes of them -----------------------------------------------------------------------------------


def exact_fresnel(index_in, index_out, angle):
    """Unpolarised reflectance from Fresnel's amplitudes, by the angles."""
    sine = index_in / index_out * np.sin(angle)
    if sine >= 1:
        return 1.0
    other = np.arcsin(sine)
    if angle == 0:
        return ((index_in - index_out) / (index_in + index_out)) ** 2
    s, p = np.sin(angle - other) / np.sin(angle + other), np.tan(angle - other) / np.tan(angle + other)
    return (s * s + p * p) / 2


BREWSTER = np.degrees(np.arctan(1.5168))
ANGLES = [(1.0, 1.5168, a) for a in (0.0, 30.0, BREWSTER, 60.0, 85.0, 89.9)]
ANGLES += [(1.5168, 1.0, a) for a in (0.0, 20.0, 35.0, 90 - BREWSTER, 42.0, 60.0, 89.9)]  # critical: 41.2
ANGLES += [(1.5168, 1.6727, 30.0), (1.33, 1.33, 40.0)]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("index_in", "index_out", "degrees"), ANGLES)
def test_reflectance_is_fresnels(bench, index_in, index_out, degrees, side):
    """From the front and from the back; beyond the critical angle all is reflected."""
    angle = np.radians(degrees)
    front, back = (index_in, index_out) if side > 0 else (index_out, index_in)
    element = element_of(bench, index_front=front, index_back=back, reflectance=-1.0)
    along = np.array([[np.sin(angle), 0.0, -side * np.cos(angle)]])
    found = bench.refract(element, along).weight[0]
    tolerance = {"fp32": 1e-6, "fp64": 1e-13}[bench.precision]  # a dozen roundings of a share of 1
    assert abs(found - exact_fresnel(index_in, index_out, angle)) <= tolerance
    if degrees == 42.0:
        assert found == 1.0


@pytest.mark.parametrize(("front", "back"), [(1.0, 1.5168), (1.5168, 1.0), (1.5168, 1.6727)])
@pytest.mark.parametrize("side", [1, -1])
def test_directions_follow_snells_law(bench, front, back, side):
    """n x d times the index is the same on both sides, the direction is of length 1 and goes on to the same side."""
    generator = np.random.default_rng(7)
    normal = unit(generator.normal(size=(COUNT, 3)))
    across = unit(np.cross(normal, generator.normal(size=(COUNT, 3))))
    index_in, index_out = (front, back) if side > 0 else (back, front)
    limit = min(1.0, index_out / index_in)
    sine = limit * generator.uniform(0.0, 0.98, COUNT)  # nearer to the critical angle a root spoils half the digits
    along = sine[:, None] * across - side * np.sqrt(1 - sine * sine)[:, None] * normal
    element = element_of(bench, index_front=front, index_back=back, reflectance=-1.0)
    found = bench.refract(element, along, normal)
    tolerance = {"fp32": 1e-6, "fp64": 2e-15}[bench.precision]  # a few roundings of 1, at most 5-fold by the root
    np.testing.assert_allclose(index_out * np.cross(normal, found.goes), index_in * np.cross(normal, along), rtol=0,
                               atol=2 * tolerance)  # fmt: skip
    np.testing.assert_allclose(np.linalg.norm(found.goes, axis=1), 1, rtol=0, atol=tolerance)
    assert ((found.goes * normal).sum(1) * side < 0).all()
    assert (found.weight < 1).all()
    if index_out < index_in:
        sine = generator.uniform(limit * 1.0001, 1.0, COUNT)
        along = sine[:, None] * across - side * np.sqrt(1 - sine * sine)[:, None] * normal
        assert (bench.refract(element, along, normal).weight == 1).all()


def test_a_coating_reflects_what_it_says_but_for_total_reflection(bench):
    angle = np.radians([0.0, 30.0, 60.0, 85.0])
    along = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], -1)
    element = element_of(bench, index_front=1.0, index_back=1.5, reflectance=0.25)
    np.testing.assert_array_equal(bench.refract(element, along).weight, 0.25)
    np.testing.assert_array_equal(bench.refract(element, -along).weight, [0.25, 0.25, 1.0, 1.0])
    black = element_of(bench, index_front=1.0, index_back=1.5, reflectance=0.0)
    np.testing.assert_array_equal(bench.refract(black, along).weight, 0.0)


@pytest.mark.parametrize("reflectance", [0.0, 0.01, 0.3, 0.97, 1.0])
def test_the_branches_of_a_refractor_carry_their_shares(bench, reflectance):
    """Over evenly spread draws the weights add up to the shares; no branch that carries light is rarer than `least`."""
    words = (np.arange(COUNT) * (2**32 // COUNT) + 2**31 // COUNT).astype(np.uint32)
    along = np.tile([[0.6, 0.0, -0.8]], (COUNT, 1))
    element = element_of(bench, index_front=1.0, index_back=1.5, reflectance=reflectance, least_chance=0.125)
    found = bench.interact("refractor", element, along, words=words)
    reflected = found.event == 1
    np.testing.assert_allclose(found.weight[reflected].sum() / COUNT, reflectance, rtol=0, atol=2 / COUNT)  # one draw
    np.testing.assert_allclose(found.weight[~reflected].sum() / COUNT, 1 - reflectance, rtol=0, atol=2 / COUNT)
    np.testing.assert_array_equal(reflected, found.goes[:, 2] > 0)
    assert not found.ends.any()
    chance = {0.0: 0.0, 0.01: 0.125, 0.3: 0.3, 0.97: 0.875, 1.0: 1.0}[reflectance]
    assert abs(reflected.mean() - chance) <= 1 / COUNT
    np.testing.assert_allclose(found.goes[reflected], np.tile([0.6, 0, 0.8], (reflected.sum(), 1)), atol=3e-7)  # 1 ulp


@pytest.mark.parametrize("focal", [16.0, -30.0])
@pytest.mark.parametrize("side", [1, -1])
def test_a_lens_changes_slopes_by_the_point_over_the_focal_length(bench, focal, side):
    """Slopes are per length of way, so the same from both sides; length 1, onwards, the transmittance as weight."""
    generator = np.random.default_rng(8)
    p, q = generator.uniform(-0.5, 0.5, (2, COUNT))
    point = np.stack([*generator.uniform(-5, 5, (2, COUNT)), np.zeros(COUNT)], -1)
    along = unit(np.stack([p, q, np.full(COUNT, -float(side))], -1))
    element = element_of(bench, inverse_focal_length=1 / focal, transmittance=0.75)
    found = bench.interact("lens", element, along, point=point)
    expected = unit(np.stack([p - point[:, 0] / focal, q - point[:, 1] / focal, np.full(COUNT, -float(side))], -1))
    tolerance = {"fp32": 1e-6, "fp64": 1e-14}[bench.precision]  # a few roundings of 1
    np.testing.assert_allclose(found.goes, expected, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(found.weight, 0.75)
    np.testing.assert_array_equal(found.absorbed, 0.25)
    assert not found.ends.any() and (found.event == 0).all()


def test_a_mirror_reflects_what_comes_from_the_front_and_swallows_the_rest(bench):
    generator = np.random.default_rng(9)
    normal, along = unit(generator.normal(size=(2, COUNT, 3)))
    found = bench.interact("mirror", element_of(bench, reflectance=0.5), along, normal)
    front = (along * normal).sum(1) < 0
    sure = np.abs((along * normal).sum(1)) > 1e-5  # which side a grazing ray comes from, rounding decides
    np.testing.assert_array_equal(found.ends[sure] == 1, ~front[sure])
    tolerance = {"fp32": 1e-6, "fp64": 2e-15}[bench.precision]  # a few roundings of 1
    expected = along - 2 * (along * normal).sum(1)[:, None] * normal
    np.testing.assert_allclose(found.goes, expected, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(found.weight[sure], np.where(front[sure], 0.5, 0.0))
    np.testing.assert_array_equal(found.absorbed, 1 - found.weight)


# --- coatings of a quarter of a wavelength ------------------------------------------------------------------


def thin_film(index_in, coating, index_out, angle):
    """Unpolarised reflectance [angles] of one layer whose optical thickness is a quarter of a wavelength.

    By characteristic matrices (F. Abeles, Ann. Phys. 5 (1950) 596) in complex numbers: evanescent waves included.
    """
    sine = index_in * np.sin(angle) + 0j
    cosine_in, cosine, cosine_out = (np.sqrt(1 - (sine / index) ** 2) for index in (index_in, coating, index_out))
    phase = np.pi / 2 * cosine
    found = []
    for admittance_in, admittance, admittance_out in (
        (index_in * cosine_in, coating * cosine, index_out * cosine_out),  # s
        (index_in / cosine_in, coating / cosine, index_out / cosine_out),  # p
    ):
        layer = np.array([[np.cos(phase), 1j * np.sin(phase) / admittance],
                          [1j * admittance * np.sin(phase), np.cos(phase)]])  # fmt: skip
        b, c = layer[0, 0] + layer[0, 1] * admittance_out, layer[1, 0] + layer[1, 1] * admittance_out
        found.append(np.abs((admittance_in * b - c) / (admittance_in * b + c)) ** 2)
    return (found[0] + found[1]) / 2


COATED_ANGLES = np.radians([0.0, 1e-3, 10.0, 30.0, 35.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.9])
LAYERS = [(1.0, 1.38, 1.5168), (1.0, 2.3, 1.5168), (1.0, np.sqrt(1.5168), 1.5168), (1.5168, 1.6, 1.6727)]
LAYERS += [(1.0, 2.0, 4.0)]


def rays_at(angles, side):
    return np.stack([np.sin(angles), 0 * angles, -side * np.cos(angles)], -1)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("front", "coating", "back"), LAYERS)
def test_a_coating_reflects_as_a_thin_film(bench, front, coating, back, side):
    """Light from both sides, beyond the critical angle too: there all is reflected."""
    element = element_of(bench, index_front=front, index_back=back, coating_index=coating)
    found = bench.refract(element, rays_at(COATED_ANGLES, side), kind="coated").weight
    index_in, index_out = (front, back) if side > 0 else (back, front)
    expected = thin_film(index_in, coating, index_out, COATED_ANGLES)
    # fp32: a dozen roundings of a share of 1; fp64: the polynomial of the layer's phase is good to 3e-8
    np.testing.assert_allclose(found, expected, rtol=0, atol={"fp32": 1e-6, "fp64": 3e-8}[bench.precision])
    total = index_in * np.sin(COATED_ANGLES) > index_out
    assert (found[total] == 1).all() and (found[~total] < 1).all()
    assert total.any() == (index_in > index_out)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("coating", [1.0, 1.5168])
def test_a_layer_of_the_index_beside_it_is_none(bench, coating, side):
    """Its reflectance is the bare interface's."""
    element = element_of(bench, index_front=1.0, index_back=1.5168, coating_index=coating)
    index_in, index_out = (1.0, 1.5168) if side > 0 else (1.5168, 1.0)
    found = bench.refract(element, rays_at(COATED_ANGLES, side), kind="coated").weight
    expected = [exact_fresnel(index_in, index_out, angle) for angle in COATED_ANGLES]
    tolerance = {"fp32": 1e-6, "fp64": 1e-13}[bench.precision]  # of the phase nothing is left: roundings alone
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize(("front", "back"), [(1.0, 1.5168), (1.0, 4.0), (1.5168, 1.6727)])
def test_a_layer_of_the_mean_index_reflects_nothing_at_normal_incidence(bench, front, back):
    element = element_of(bench, index_front=front, index_back=back, coating_index=np.sqrt(front * back))
    bare = exact_fresnel(front, back, 0.0)
    for side in (1, -1):
        found = bench.refract(element, rays_at(np.zeros(1), side), kind="coated").weight[0]
        assert abs(found) <= bare * {"fp32": 1e-6, "fp64": 6e-8}[bench.precision]  # as above, of the bare reflectance


# --- both branches ------------------------------------------------------------------------------------------

KINDS = {"refractor": {"reflectance": 0.3}, "coated": {"coating_index": 1.38}}


@pytest.mark.parametrize("kind", KINDS)
def test_both_branches_share_the_light(device, tmp_path, precision, kind):
    """The ray goes on refracted with 1 - R whatever its random word; one of weight R parts from it, mirrored."""
    bench = Bench(device, tmp_path, precision, "split")
    generator = np.random.default_rng(10)
    element = element_of(bench, index_front=1.0, index_back=1.5, least_chance=0.1, min_weight=1e-3, **KINDS[kind])
    along, words = incident(generator), generator.integers(0, 2**32, COUNT, np.uint32)
    found, shares = bench.interact(kind, element, along, words=words), bench.refract(element, along, kind=kind)
    np.testing.assert_array_equal(found.components, shares.weight)
    np.testing.assert_allclose(found.weight + found.components, 1, rtol=0, atol=bench.epsilon)
    np.testing.assert_array_equal(found.goes, shares.goes)
    assert (found.event == 0).all() and not found.ends.any() and not found.absorbed.any()
    assert (found.goes[:, 2] < 0).all() and found.components.min() > 1e-3


@pytest.mark.parametrize("reflectance", [0.1, 0.9])
@pytest.mark.parametrize(("arriving", "room", "both"), [(0.0101, 1, True), (0.0099, 1, False), (1.0, 0, False)])
def test_a_branch_without_weight_or_room_is_left_to_chance(
    device, tmp_path, precision, reflectance, arriving, room, both
):
    """0.1 of a ray is the weaker share: at a hundredth of a ray it comes to the limit, 1e-3."""
    bench = Bench(device, tmp_path, precision, "split")
    words = (np.arange(COUNT) * (2**32 // COUNT) + 2**31 // COUNT).astype(np.uint32)
    element = element_of(bench, index_front=1.0, index_back=1.5, reflectance=reflectance, min_weight=1e-3)
    along = np.tile([[0.6, 0.0, -0.8]], (COUNT, 1))
    call = f"at.arriving = (realv)((real){arriving}); at.room = (intv)({room}); interact_refractor(elements, &at);"
    found = bench.interact("refractor", element, along, words=words, call=call)
    if both:
        np.testing.assert_allclose(found.components, reflectance, rtol=bench.epsilon)
        np.testing.assert_allclose(found.weight, 1 - reflectance, rtol=8 * bench.epsilon)
        assert (found.event == 0).all()
        return
    reflected = found.event == 1
    assert not found.components.any()
    assert abs(reflected.mean() - reflectance) <= 1 / COUNT
    np.testing.assert_allclose(found.weight, 1, rtol=8 * bench.epsilon)  # the chance is the share itself
    np.testing.assert_array_equal(reflected, found.goes[:, 2] > 0)


def test_light_that_is_wholly_reflected_does_not_part(device, tmp_path, precision):
    bench = Bench(device, tmp_path, precision, "split")
    element = element_of(bench, index_front=1.0, index_back=1.5, reflectance=-1.0, min_weight=1e-3, least_chance=0.1)
    found = bench.interact("refractor", element, rays_at(np.full(COUNT, 1.0), -1))  # 57 degrees; critical: 42
    assert not found.components.any()
    np.testing.assert_array_equal(found.weight, 1)
    assert (found.event == 1).all() and (found.goes[:, 2] < 0).all()


# --- real lenses, surface after surface ---------------------------------------------------------------------

ZONES = [0.5, 0.35, 0.005]  # mm from the stop's centre: its rim, 0.7 of it, next to its centre


def lens_rays(scene):
    """Rays in the camera's frame, z along the light, and the same mirrored in y: from the mirror's vertex through zones
    of the stop, from a point 532 mm beside it through the stop's centre, and one 1e-3 mm beside the axis, along it."""
    distance = np.linalg.norm(np.subtract(scene.camera.position_mm, scene.camera.look_at_mm))
    start = np.array([[0.0, height, 0.0] for height in (*ZONES, 0.0, 1e-3)])
    source = np.array([[0.0, height, -distance] for height in (0.0, 0.0, 0.0, 532.0, 1e-3)])
    over = np.array([1.0, -1.0, 1.0])
    start, source = np.concatenate([start, start * over]), np.concatenate([source, source * over])
    return start, unit(start - source)


def figures(at, along, distance_mm):
    """Half differences of mirrored rays: heights on the detector's plane [5], and the focal length of the last."""
    slope = along[:, 1] / along[:, 2]
    height = at[:, 1] + (distance_mm - at[:, 2]) * slope
    height, slope = ((value[:5] - value[5:]) / 2 for value in (height, slope))
    return height, -1e-3 / slope[4]


@pytest.mark.parametrize("name", ["sphere-singlet", "sphere-doublet"])
def test_real_lenses_image_as_the_oracle_says(bench, name):
    """Focal length, image height and transverse spherical aberration, of the very rays that the kernel is given."""
    scene = load_scene(name)
    origin, axes = np.array(scene.camera.position_mm), np.stack(sequence.axes_of(scene.camera))
    elements = []
    for component in components_of(scene):
        if component.kind == "refractor":
            place = component.frame.position_mm - origin
            frame = replace(component.frame, position_mm=place)
            index = {"index_front": component.index_front, "index_back": component.index_back}
            elements.append(element_of(bench, frame, component.quadric, origin=place, reflectance=-1.0, **index))
    start, along = (vectors @ axes for vectors in lens_rays(scene))
    found = bench.through(np.concatenate(elements), start, along)
    start, along = (vectors.astype(bench.real).astype(float) for vectors in (start, along))
    start = start + origin
    for step in sequence.lens_of(scene):
        start, along, _ = sequence.pass_step(step, start, along)
    distance = scene.camera.detector_distance_mm
    height, focal = figures(*(vectors @ axes.T for vectors in found), distance)
    expected, expected_focal = figures((start - origin) @ axes.T, along @ axes.T, distance)
    # fp32: roundings of 20 mm, less than 1/10000 pixel
    tolerance = {"fp32": 3e-6, "fp64": 1e-12}[bench.precision]
    np.testing.assert_allclose(height, expected, rtol=0, atol=tolerance)
    assert height[3] == pytest.approx(expected[3], rel=1e-6, abs=0)
    if bench.precision == "fp64":
        aberration, of_oracle = (h[:2] - h[2] * np.array(ZONES[:2]) / ZONES[2] for h in (height, expected))
        np.testing.assert_allclose(aberration, of_oracle, rtol=1e-6, atol=0)
        assert abs(aberration[0]) > 1e-4
        assert focal == pytest.approx(expected_focal, rel=1e-6, abs=0)
        assert focal == pytest.approx(16.0, rel=1e-6, abs=0)
