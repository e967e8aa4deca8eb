"""Composing and building kernel sources from the kernel files."""

from __future__ import annotations

import itertools
import math
import os
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from aspheres import asphere_scene
from freeform import lopsided_freeform
from lopsided import lopsided
from outlined import outline_of
from real_setup import SHAPES, real_setup
from scenes import with_part

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.opencl.program import build, check_precision, compose, kernel_files, kernels_folder
from irtscots_cl.opencl.structs import LAUNCH
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.options import ESTIMATORS
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.samplers import SAMPLERS

FAMILIES = {
    "surface": ["sphere", "conic", "off_axis", "flat"],
    "mirror": ["nominal", "deviated"],
    "aperture": ["disk", "annulus"],
    "zernike": ["power", "clenshaw", "none"],
    "map": ["none", "bicubic"],
    "arrival": ["plain", "compensated"],
    "accumulate": ["tile", "atomic", "none"],
    "sampler": list(SAMPLERS),
}
RAMPS = ["edges", "steps"]  # how smoothed rays are added
# What only the non-sequential estimator chooses between.
PATH_FAMILIES = {
    "path_rng": ["none", "philox"],
    "ray_stack": ["none", "list"],
    "branch": ["random", "split"],
    "path_code": ["short", "long"],
    "cones": ["single", "several"],
    "sieve": ["none", "stop"],
}
# Chosen together: all of one member.
LIGHT_FAMILIES = {family: ["unpolarised", "polarised"] for family in ("light", "carry", "fresnel")}
# What the screen and the camera choose between: together, and each alone in other tests.
DEVICE_FAMILIES = {
    "frame": ["upright", "turned", "level"],
    "camera": ["plain", "distorted"],
    "screen": ["flat", "bent"],
    "glass": ["none", "plate"],
}
# What mirrors with aspheric terms or polynomials choose.
DEPARTURE_FAMILIES = {
    "approach": ["slight", "exact"],
    "asphere": ["none", "even", "odd"],
    "polynomial": ["none", "chebyshev"],
    "map": ["none", "bicubic"],
}
NO_DEPARTURE = {family: members[0] for family, members in DEPARTURE_FAMILIES.items()}
PLAIN = {family: members[0] for family, members in DEVICE_FAMILIES.items()}
OUTLINES = ["none", "polygon", "parts", "mask"]  # of a mirror that is no whole disk
LENSES = ["polynomial", "rational"]  # of a camera with distortion
REAL = {family: members[1] for family, members in DEVICE_FAMILIES.items()}
STRUCTS = {"Launch": LAUNCH}


def all_choices():
    for members in itertools.product(*FAMILIES.values()):
        chosen = dict(zip(FAMILIES, members, strict=True))
        ramps = "edges" if chosen["accumulate"] == "tile" else "steps"  # as the host chooses on CPUs
        yield PLAIN | NO_DEPARTURE | {"outline": "none", "ramps": ramps} | chosen


def write(path, text):
    path.write_text(text, encoding="ascii")
    return path


def flat_map():
    return MirrorMap(heights=HeightMap(np.zeros((2, 2)), pitch_mm=(200.0, 200.0)), outside="nearest")


def scene_for(choices):
    """A scene whose packing makes these choices."""
    base = lopsided()
    few = ZernikeTerms(radius_mm=180.0, ordering="noll", coefficients_um={5: -3.0, 8: 1.5})
    zernike = base.mirror.zernike if choices["zernike"] == "clenshaw" else (few,)
    size = 1e-6 if choices["arrival"] == "compensated" else 1.0
    zernike = tuple(
        replace(terms, coefficients_um={j: c * size for j, c in terms.coefficients_um.items()}) for terms in zernike
    )
    mirror = Mirror(
        radius_mm=math.inf if choices["surface"] == "flat" else 1500.0,
        conic=0.0 if choices["surface"] in ("sphere", "flat") else -0.8,
        diameter_mm=330.0,
        off_axis_mm=240.0 if choices["surface"] == "off_axis" else 0.0,
        obscuration_mm=70.0 if choices["aperture"] == "annulus" else 0.0,
        zernike=zernike if choices["mirror"] == "deviated" else (),
        map=(flat_map(),) if choices["map"] == "bicubic" else (),
    )
    return replace(base, mirror=mirror)


def covering(cases: list[dict]) -> list[dict]:
    """Few of the cases, in which every two values that one of them has together are together once: greedily."""

    def pairs(case):
        return set(itertools.combinations(case.items(), 2))

    open_pairs, chosen = set().union(*map(pairs, cases)), []
    while open_pairs:
        chosen.append(max(cases, key=lambda case: len(pairs(case) & open_pairs)))
        open_pairs -= pairs(chosen[-1])
    return chosen


BUILT = covering([
    c | {"estimator": estimator}
    for c in all_choices()
    for estimator in (*ESTIMATORS, "lines")
    if c["sampler"] == SAMPLERS[0] and c["accumulate"] == "tile"
    if c["zernike"] != "none"  # other tests build mirrors with departures of another kind
    if c["mirror"] == "deviated" or (c["arrival"], c["zernike"], c["map"]) == ("plain", "power", "none")
])  # fmt: skip


def test_pairs_are_covered_by_few_cases():
    cases = [dict(zip("abcd", members, strict=True)) for members in itertools.product(range(3), repeat=4)]
    few = covering(cases)
    assert (
        {(c["a"], c["d"]) for c in few} == {(c["b"], c["c"]) for c in few} == set(itertools.product(range(3), repeat=2))
    )
    assert len(few) <= 13  # 9 at best, 81 cases


@pytest.mark.second_device
@pytest.mark.parametrize("case", BUILT, ids=lambda c: "-".join(c[family] for family in (*FAMILIES, "estimator")))
def test_every_pair_of_files_composes_and_builds(device, case):
    choices = {family: member for family, member in case.items() if family != "estimator"}
    packed = pack(ChiefRays(scene_for(choices)), "fp32")
    of_deviated = ["zernike", *NO_DEPARTURE] if choices["mirror"] == "deviated" else []
    chosen = ("surface", "mirror", "arrival", "aperture", *of_deviated)
    assert packed.choices == {family: choices[family] for family in (*chosen, *PLAIN, "outline")}
    entry, width = f"trace_{case['estimator']}", device.vector_width("fp32")
    source = compose(f"{entry}.cl", choices, packed.structs, "fp32", width, packed.constants)
    for family, member in choices.items():
        if family in ("zernike", *NO_DEPARTURE) and choices["mirror"] == "nominal":
            continue
        if family == "ramps" and case["estimator"] != "lines":
            continue
        assert [f for f in source.files if f.startswith(f"{family}_")] == [f"{family}_{member}.cl"]
    assert [k.function_name for k in build(device, source).all_kernels()] == [entry]


def ways(device, precision, entries):
    """Entries at the device's own width and ray by ray, as GPUs trace them. Single precision has one of the two widths,
    double the other, by turns: together both have been built."""
    widths = sorted({1, device.vector_width(precision)})
    turn = precision == "fp64"
    return [(entry, widths[(k + turn) % len(widths)]) for k, entry in enumerate(entries)]


@pytest.mark.second_device
def test_polynomials_compose_and_build(device, precision):
    packed = pack(ChiefRays(lopsided_freeform()), precision)
    assert packed.choices | {"mirror": "deviated", "polynomial": "chebyshev"} == packed.choices
    choices = packed.choices | {"sampler": "philox", "accumulate": "atomic", "ramps": "steps"}
    for estimator, width in ways(device, precision, ESTIMATORS):
        source = compose(f"trace_{estimator}.cl", choices, packed.structs, precision, width, packed.constants)
        assert "polynomial_chebyshev.cl" in source.files
        build(device, source)


@pytest.mark.second_device
@pytest.mark.parametrize("asphere", ["even", "odd"])
def test_every_kind_of_asphere_composes_and_builds(device, precision, asphere):
    packed = pack(ChiefRays(asphere_scene({"even": "deviated"}.get(asphere, asphere))), precision)
    expected = {"mirror": "deviated", "approach": "exact", "asphere": asphere}
    assert packed.choices | expected == packed.choices
    choices = packed.choices | {"sampler": "philox", "accumulate": "atomic", "ramps": "steps"}
    for estimator, width in ways(device, precision, (*ESTIMATORS, "lines")):
        source = compose(f"trace_{estimator}.cl", choices, packed.structs, precision, width, packed.constants)
        build(device, source)


KINDS = [(distorted, shape, glass) for distorted in (False, True) for shape in SHAPES for glass in (False, True)]
USUAL = {(True, "points", True), (True, "flat", False), (False, "sag", False)}  # the others take minutes to build


@pytest.mark.parametrize(
    "distorted, shape, glass", [k if k in USUAL else pytest.param(*k, marks=pytest.mark.slow) for k in KINDS]
)
def test_every_kind_of_camera_and_screen_composes_and_builds(device, precision, distorted, shape, glass):
    """At the device's own width and ray by ray, as GPUs trace them."""
    packed = pack(ChiefRays(real_setup(shape, glass, distorted)), precision)
    expected = {"frame": "turned", "camera": "distorted" if distorted else "plain",
                "screen": "flat" if shape == "flat" else "bent", "glass": "plate" if glass else "none"}  # fmt: skip
    assert packed.choices.get("lens") == ("rational" if distorted else None)
    assert packed.choices | expected == packed.choices
    choices = packed.choices | {"sampler": "philox", "accumulate": "atomic", "ramps": "steps"}
    for estimator, width in itertools.product((*ESTIMATORS, "lines"), {1, device.vector_width(precision)}):
        source = compose(f"trace_{estimator}.cl", choices, packed.structs, precision, width, packed.constants)
        for family, member in expected.items():
            assert [f for f in source.files if f in {f"{family}_{m}.cl" for m in DEVICE_FAMILIES[family]}] == [
                f"{family}_{member}.cl"
            ]
        build(device, source)


@pytest.mark.parametrize("shape", ["hexagon", "parts", "mask"])
@pytest.mark.second_device
def test_every_kind_of_outline_composes_and_builds(device, precision, shape, tmp_path):
    """Chords where they are in one piece."""
    scene = with_part(scene_for(next(all_choices())), "mirror", outline=outline_of(shape, 300.0, tmp_path))
    packed = pack(ChiefRays(scene), precision)
    entries = [*ESTIMATORS, *(["lines"] if packed.choices["outline"] == "polygon" else [])]
    choices = packed.choices | {"sampler": "philox", "accumulate": "atomic", "ramps": "steps"}
    for estimator, width in ways(device, precision, entries):
        source = compose(f"trace_{estimator}.cl", choices, packed.structs, precision, width, packed.constants)
        assert f"outline_{packed.choices['outline']}.cl" in source.files
        build(device, source)


def test_no_kernel_file_is_dead():
    every = covering(list(all_choices()))
    used = {
        file
        for choices in every
        for estimator in (*ESTIMATORS, "lines")
        for precision, width in itertools.product(("fp32", "fp64"), (1, 8))
        for file in compose(f"trace_{estimator}.cl", choices, STRUCTS, precision, width).files
    }
    used |= set(compose("trace_forward.cl", every[0] | {"frame": "level"}, STRUCTS, "fp32", 8).files)
    for outline in OUTLINES:
        choices = every[0] | {"outline": outline}
        used |= set(compose("trace_adjoint.cl", choices, STRUCTS, "fp32", 8).files)
    for estimator, lens in itertools.product((*ESTIMATORS, "lines"), LENSES):
        choices = every[0] | REAL | {"lens": lens}
        used |= set(compose(f"trace_{estimator}.cl", choices, STRUCTS, "fp32", 8).files)
    for members in itertools.product(*DEPARTURE_FAMILIES.values()):
        choices = next(c for c in every if c["mirror"] == "deviated")
        choices |= dict(zip(DEPARTURE_FAMILIES, members, strict=True))
        used |= set(compose("trace_forward.cl", choices, STRUCTS, "fp32", 8).files)
    for probe, choices in itertools.product(("meet", "adjoint", "forward"), every):
        used |= set(compose(f"probe_{probe}.cl", choices, STRUCTS, "fp32", 8).files)
    for *members, light in itertools.product(*PATH_FAMILIES.values(), LIGHT_FAMILIES["light"]):
        choices = every[0] | dict(zip(PATH_FAMILIES, members, strict=True))
        choices |= dict.fromkeys(LIGHT_FAMILIES, light)
        first = [name for name in kernel_files() if name.startswith("interact_")]
        first += ["element_deviated.cl", *(name for name in kernel_files() if name.startswith("scatter_"))]
        first += ["tally_random.cl" if choices["branch"] == "random" else "tally_split.cl"]
        used |= set(compose("trace_paths.cl", choices, STRUCTS, "fp32", 8, first=first).files)
    used |= set(compose("multiply_add.cl", {}, STRUCTS, "fp32", 8).files)  # the benchmark's own
    for entry in ("probe_sums", "self_test", "speed_test"):
        used |= set(compose(f"{entry}.cl", {}, STRUCTS, "fp32", 8).files)
    assert used == set(kernel_files())


def test_names_of_kernel_files_are_unique():
    paths = list(kernels_folder().rglob("*.cl"))
    assert len(paths) == len(kernel_files()) > 60


def test_families_here_are_those_of_the_folder():
    stars = {
        star
        for path in kernel_files().values()
        for star in re.findall(r'^#include "([a-z0-9_]+)_\*\.cl"', path.read_text(), re.M)
    }
    families = FAMILIES | DEPARTURE_FAMILIES | DEVICE_FAMILIES | PATH_FAMILIES | LIGHT_FAMILIES
    families |= {"lens": LENSES, "outline": OUTLINES, "ramps": RAMPS}
    assert stars == {*families, "simd", "gather", "real", "sobol_words"}
    for family, members in families.items():
        assert {f"{family}_{member}.cl" for member in members} == {
            name for name in kernel_files() if re.fullmatch(rf"{family}_[a-z0-9_]+\.cl", name)
        }


@pytest.mark.parametrize("path", kernel_files().values(), ids=lambda path: path.name)
def test_kernel_files_are_short_plain_and_introduced(path):
    text = path.read_bytes().decode("ascii")  # raises on anything else
    lines = text.splitlines()
    assert path.suffix == ".cl" and len(lines) < 250 and "\t" not in text
    assert lines[0].startswith("// ")


def test_a_file_comes_in_once_and_before_its_user():
    source = compose("trace_forward.cl", next(all_choices()), STRUCTS, "fp32", 16)
    assert len(set(source.files)) == len(source.files)
    assert source.files[-1] == "trace_forward.cl"
    assert source.text.count("typedef struct { wordv word[4]; } Philox;") == 1
    assert source.files.index("philox.cl") < source.files.index("sampler_philox.cl")
    assert "#include" not in source.text


def test_precision_and_width_choose_the_types():
    for precision, width, files in [
        ("fp32", 1, {"real_float.cl", "simd_scalar.cl"}),
        ("fp64", 8, {"real_double.cl", "simd_vector.cl"}),
    ]:
        source = compose("uniform.cl", {}, STRUCTS, precision, width)
        assert files <= set(source.files)
        assert ("-DWIDTH=8" in source.options) == (width == 8)
        assert not any("relaxed" in option or "unsafe" in option for option in source.options)


def test_an_entry_elsewhere_includes_files_of_the_folder(tmp_path):
    entry = write(tmp_path / "mine.cl", '#include "philox.cl"\n__kernel void mine(__global int *x) { x[0] = WIDTH; }\n')
    source = compose(entry, {}, STRUCTS, "fp32", 1)
    assert source.files == ("real_float.cl", "simd_scalar.cl", "philox.cl", "mine.cl")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The user's folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def refusal_of_broken(device, folder) -> str:
    entry = write(folder / "broken_here.cl", "int first = no_such_name;\nint second = nor_this;\n")
    with pytest.raises(DeviceError) as caught:
        build(device, compose(entry, {}, STRUCTS, "fp32", 1))
    message = str(caught.value)
    assert message.startswith(f"{device.label}: kernels do not build: ") and "\n" not in message
    return message


def test_the_compilers_whole_log_is_in_a_file_of_the_users_own(device, tmp_path, temporary):
    messages = [refusal_of_broken(device, tmp_path) for _ in range(2)]
    paths = [Path(message.rpartition("; the compiler's log: ")[2]) for message in messages]
    assert paths[0] != paths[1]
    for path in paths:
        assert path.parent == temporary and re.fullmatch(r"irtscots-build-\w{8}\.log", path.name)
        log = path.read_text(encoding="utf-8")
        assert log.count("\n") > 1 and "no_such_name" in log and "nor_this" in log
        assert os.name == "nt" or path.stat().st_mode & 0o777 == 0o600


def test_a_log_that_cannot_be_kept_does_not_hide_the_error(device, tmp_path, temporary, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "mkstemp", full)
    message = refusal_of_broken(device, tmp_path)
    assert message.endswith("; its log could not be kept: [Errno 28] No space left on device")
    assert "error" in message


@pytest.mark.parametrize("line", [1, 2, 5])
def test_a_compilers_message_names_file_and_line(device, tmp_path, temporary, line):
    lines = ["// nothing"] * 6
    lines[0] = lines[2] = '#include "philox.cl"'
    lines.insert(line - 1, "int broken = no_such_name;")
    entry = write(tmp_path / "broken_here.cl", "\n".join([*lines, "__kernel void broken_here(__global int *x) {}", ""]))
    with pytest.raises(DeviceError) as caught:
        build(device, compose(entry, {}, STRUCTS, "fp32", 1))
    message = str(caught.value)
    assert "\n" not in message and "kernels do not build" in message
    assert re.search(rf"broken_here\.cl\D{{1,3}}{line}\b", message)  # clang "file:line:", others "file(line)"


def test_unknown_names_are_refused(tmp_path):
    with pytest.raises(KeyError, match="surface"):
        compose("mirror_nominal.cl", {}, STRUCTS, "fp32", 1)
    with pytest.raises(FileNotFoundError, match="surface_saddle"):
        compose("mirror_nominal.cl", {"surface": "saddle", "aperture": "disk"}, STRUCTS, "fp32", 1)
    entry = write(tmp_path / "nowhere.cl", '#include "nowhere_else.cl"\n')
    with pytest.raises(FileNotFoundError, match="nowhere_else"):
        compose(entry, {}, STRUCTS, "fp32", 1)


def test_building_twice_gives_the_same_program(device):
    packed = pack(ChiefRays(load_scene("sphere")), "fp32")
    choices = packed.choices | {"sampler": "philox", "accumulate": "atomic", "ramps": "steps"}
    sources = [compose("trace_adjoint.cl", choices, packed.structs, "fp32", 1) for _ in range(2)]
    assert build(device, sources[0]) is build(device, sources[1])


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_no_number_and_no_string_of_a_scene_reaches_the_source(estimator):
    first = lopsided()
    second = replace(first, name="Xx-another_Name.9", mirror=replace(first.mirror, radius_mm=1501.25, reflectance=0.5))
    texts = []
    for scene in (first, second):
        packed = pack(ChiefRays(scene), "fp32")
        choices = packed.choices | {"sampler": "philox", "accumulate": "tile"}
        texts.append(compose(f"trace_{estimator}.cl", choices, packed.structs, "fp32", 16))
    assert texts[0] == texts[1]
    assert all(word not in texts[0].text for word in (first.name, second.name, "1500", "1501"))


def test_check_precision(device):
    with pytest.raises(ValueError, match="precision = 'half': must be fp32 or fp64"):
        check_precision(device, "half")
    check_precision(device, "fp32")

    class WithoutDoubles:
        has_fp64, label = False, "device 3:1 Some GPU"

    with pytest.raises(DeviceError, match="fp64: device 3:1 Some GPU has no double precision"):
        check_precision(WithoutDoubles(), "fp64")
