"""No kernel reads or writes outside its memory, reads what nobody set, or races: every entry kernel under Oclgrind.

Tiny scenes of a few rays, at both widths, cut into several work-items for each stream. Run by tools/check_kernels.
"""

from __future__ import annotations

import dataclasses
import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from freeform import ANNULAR, freeform
from oclgrind import HOW_TO_GET_IT, Oclgrind, has_oclgrind
from outlined import outline_of
from real_setup import real_setup
from scenes import with_part
from tracers import setup_of, totals, tracer_of

from irtscots_cl.execution.launch_plan import RayBlock
from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.opencl import program, selftest, speed
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import BLOCK, compose, kernel_files
from irtscots_cl.opencl.speed import SpeedTest
from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.tracing.checks.probes import MeetProbe, PathProbe
from irtscots_cl.tracing.estimators import nonsequential
from irtscots_cl.tracing.estimators import sequential as tracer
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.packing.sources import emitters, receivers
from irtscots_cl.tracing.trace import trace_paths

pytestmark = pytest.mark.oclgrind

WIDTHS = (1, 8)
SAMPLERS = ("philox", "sobol", "lattice")
FEW = {1: 5, 8: 264}  # rays of a stream: three work-items, or two, the second's block nearly empty
OF_ITEM = {1: 2, 8: 256}
SCATTER = {
    "lambertian": Lambertian(tis=0.2),
    "harvey": Harvey(l=0.01, s=-1.5, tis=0.2),
    "abg": ABg(a=1e-3, b=1e-4, g=2),
}
checked_files: set[str] = set()


@pytest.fixture
def oclgrind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest):
    """Oclgrind with all checks."""
    if not has_oclgrind():
        pytest.skip(HOW_TO_GET_IT)
    found = Oclgrind(tmp_path / "log", monkeypatch)
    yield found
    checked_files.update(found.files)


def small(preset: str, rows: int = 2, aperture: float = 1.0, **mirror: object) -> Scene:
    """A preset with 2 columns and as many rows of screen pixels and 2 x 2 detector pixels that cover what its own do; a
    wider aperture finds more light."""
    scene = load_scene(preset)
    screen, camera = scene.screen, scene.camera
    detector = camera.detector
    return dataclasses.replace(
        scene,
        mirror=dataclasses.replace(scene.mirror, **mirror),
        screen=dataclasses.replace(screen, pixels=(2, rows), pitch_mm=screen.pitch_mm * screen.pixels[0] / 2),
        camera=dataclasses.replace(
            camera,
            aperture_diameter_mm=camera.aperture_diameter_mm * aperture,
            detector=dataclasses.replace(detector, pixels=(2, 2), pitch_mm=detector.pitch_mm * detector.pixels[0] / 2),
        ),
    )


def terms(*nolls: int) -> tuple[ZernikeTerms, ...]:
    return (ZernikeTerms(radius_mm=540.0, ordering="noll", coefficients_um=dict.fromkeys(nolls, 0.1)),)


def small_setup(terms: int) -> Scene:
    """A real set-up with 2 x 2 pixels on its screen and detector, and so many coefficients of the distortion."""
    scene = real_setup()
    screen, camera, detector = scene.screen, scene.camera, scene.camera.detector
    pitches = tuple(p * n / 2 for p, n in zip(screen.pitch_xy_mm, screen.pixels, strict=True))
    intrinsics = dataclasses.replace(
        camera.intrinsics, binning=(64, 64), distortion=camera.intrinsics.distortion[:terms]
    )
    camera = dataclasses.replace(
        camera,
        intrinsics=intrinsics,
        detector=dataclasses.replace(detector, pixels=(2, 2), pitch_mm=32 * detector.pitch_mm),
    )
    return dataclasses.replace(
        scene, screen=dataclasses.replace(screen, pixels=(2, 2), pitch_mm=pitches), camera=camera
    )


def maps() -> tuple[MirrorMap, ...]:
    """One that most rays miss, and one of few nodes that all meet, turned."""
    heights = np.array([[1.0, 2.0, 4.0], [0.0, 3.0, 5.0]]) * 1e-6
    small = MirrorMap(heights=HeightMap(heights, pitch_mm=(9.0, 7.0)), outside="nearest")
    return small, dataclasses.replace(small, scale=100.0, rotation_deg=20.0)


# Every file of the families surface, aperture, outline, mirror, approach, arrival, zernike, asphere, polynomial, map,
# frame, camera, lens, screen and glass
MIRRORS = {
    "nominal": small("sphere"),
    "slight": small("sphere", zernike=(ZernikeTerms(radius_mm=540.0, ordering="noll", coefficients_um={4: 1e-5}),)),
    "power": small("sphere-deviated", 2, 4.0),
    "clenshaw, hole": small("sphere", conic=-0.5, obscuration_mm=300.0, zernike=terms(*range(4, 200, 13))),
    "off-axis": small("off-axis"),
    "polynomials, ring": small(
        "sphere", obscuration_mm=266.0, polynomial=freeform().mirror.polynomial, zernike=ANNULAR
    ),
    "even asphere": small("sphere-deviated", asphere=Asphere(coefficients_mm={4: 1e-12, 20: 1e-55})),
    "odd asphere": small("sphere", asphere=Asphere(coefficients_mm={3: 1e-9, 4: 1e-12})),
    "maps": small("sphere", map=maps()),
    "flat": small("sphere", radius_mm=math.inf),
    "polygon": small("sphere", outline=outline_of("hexagon", 1064.0)),
    "parts": small("sphere-deviated", outline=outline_of("parts", 1064.0)),
    "above the axis": with_part(small("sphere"), "screen", look_at_mm=(0.0, 1.0, 0.0)),
    "real, k1 to k3": small_setup(5),
    "real, k1 to k6": small_setup(8),
}


def traced(scene: Scene, device: Device, options: TraceOptions, accumulate: str, rays: int = 5) -> np.ndarray:
    """Rays by fate."""
    run = tracer_of(scene, device, options, accumulate=accumulate)
    _, fates = totals(run, np.array([rays]))
    assert fates.sum() == rays * run.sources  # or the kernel did not run
    return fates


@pytest.mark.parametrize("accumulate", ["tile", "atomic"])
@pytest.mark.parametrize("estimator", ["forward", "adjoint", "lines"])
@pytest.mark.parametrize("width", WIDTHS)
def test_estimators(oclgrind, width, estimator, accumulate, monkeypatch):
    options = TraceOptions("forward") if estimator == "forward" else TraceOptions(smoothing=estimator == "lines")
    monkeypatch.setattr(tracer.SequentialTask, "max_rays_per_item", OF_ITEM[width])
    fates = traced(MIRRORS["power"], oclgrind.device(width), options, accumulate, FEW[width])
    assert fates[0] > 0  # some light is stored
    assert oclgrind.complaints() == []


@pytest.mark.parametrize("sampler", SAMPLERS[1:])
@pytest.mark.parametrize("width", WIDTHS)
def test_samplers(oclgrind, width, sampler):
    traced(MIRRORS["nominal"], oclgrind.device(width), TraceOptions(sampler=sampler), "tile")
    assert oclgrind.complaints() == []


@pytest.mark.parametrize(
    "kind, estimator, precision",
    [("slight", "adjoint", "fp32"), ("polynomials, ring", "adjoint", "fp32"), ("even asphere", "forward", "fp32"),
     ("odd asphere", "adjoint", "fp32"), ("maps", "forward", "fp32"), ("maps", "adjoint", "fp64"),
     ("clenshaw, hole", "lines", "fp32"), ("clenshaw, hole", "forward", "fp64"),
     ("off-axis", "adjoint", "fp64"), ("off-axis", "lines", "fp64"), ("flat", "adjoint", "fp32"),
     ("above the axis", "forward", "fp32"),
     ("polygon", "adjoint", "fp32"), ("polygon", "lines", "fp32"), ("parts", "forward", "fp64"),
     ("real, k1 to k3", "forward", "fp32"), ("real, k1 to k6", "forward", "fp64"), ("real, k1 to k6", "lines", "fp32")],
)  # fmt: skip
@pytest.mark.parametrize("width", WIDTHS)
def test_mirrors_and_precisions(oclgrind, width, kind, estimator, precision):
    options = TraceOptions(
        "forward" if estimator == "forward" else "adjoint", precision=precision, smoothing=estimator == "lines"
    )
    traced(MIRRORS[kind], oclgrind.device(width), options, "atomic")
    complaints = oclgrind.complaints()
    if kind == "maps" and width > 1:
        # Oclgrind takes what gather_vector.cl shuffles for uninitialized; its values agree with SciPy's, and all other
        # complaints, of addresses above all, count
        complaints = [line for line in complaints if "uninitialized" not in line.lower()]
    assert complaints == []


@pytest.mark.parametrize("width", WIDTHS)
def test_outline_of_a_mask(oclgrind, width, tmp_path):
    scene = small("sphere", outline=outline_of("mask", 1064.0, tmp_path))
    traced(scene, oclgrind.device(width), TraceOptions("adjoint"), "atomic")
    assert oclgrind.complaints() == []


def of_elements(preset: str, **values: object) -> Scene:
    """A small preset whose first element has other values."""
    scene = small(preset, 1, 2.0)
    first, *others = scene.element
    return dataclasses.replace(scene, element=(dataclasses.replace(first, **values), *others))


# beside the screen and the camera: what the mirror sends past them scatters there
WALL = Element("wall", "absorber", (0.0, 0.0, 4100.0), (0.0, 0.0, 0.0), size_mm=(400.0, 400.0),
               scatter=SCATTER["harvey"])  # fmt: skip
# beside the mirror, so that rays go into several cones
PANEL = Element("panel", "absorber", (480.0, 480.0, 60.0), (480.0, 480.0, 4000.0), size_mm=(100.0, 100.0),
                scatter=SCATTER["lambertian"])  # fmt: skip
PATHS = {
    "plain": small("sphere", 1, 4.0),
    "deviated": small("sphere-deviated", 1, 4.0),
    "singlet": small("sphere-singlet", 1, 2.0),
    "ghosts": small("ghosts", 1, 2.0),
    "baffled": small("baffled", 1, 4.0),
    "window": small("sphere-window", 1, 4.0),
    "coated": of_elements("sphere-singlet", coating_index=1.2),
    "wall": dataclasses.replace(small("sphere", 1, 4.0), element=(WALL,)),
    "panel": dataclasses.replace(small("sphere", 1, 4.0), element=(PANEL,)),
    "rough": small("sphere", 1, 4.0, scatter=Harvey(l=0.01, s=-1.5, roughness_nm=50.0, wavelength_nm=633.0)),
    "polarised": small("sphere-singlet", 1, 2.0),
    "polarised coating": of_elements("sphere-singlet", coating_index=1.2),
    "long": small("sphere-window", 1, 4.0),
} | {name: small("sphere", 1, 4.0, scatter=model) for name, model in SCATTER.items()}


# Of some of them; the others have none.
PATH_OPTIONS = {"long": {"bounce_limit": 12}, "polarised": {"polarisation": "on"},
                "polarised coating": {"polarisation": "on"}}  # fmt: skip
RAYS = 18  # of a screen pixel
BLOCKS = 264  # more than a block


@pytest.mark.parametrize(
    ("kind", "branches"),
    [*((kind, "random") for kind in PATHS), *((kind, "split") for kind in ("singlet", "coated", "polarised"))],
)
@pytest.mark.parametrize("width", WIDTHS)
def test_nonsequential(oclgrind, width, kind, branches, monkeypatch):
    rays, of_item = BLOCKS if width == 8 and kind == "plain" else RAYS, {1: 6, 8: 256}[width]
    for name, value in {"PILOT_RAYS": 2 * RAYS, "FOUND_SIZE": 4}.items():
        monkeypatch.setattr(nonsequential, name, value)
    monkeypatch.setattr(nonsequential.PathTask, "max_rays_per_item", of_item)
    light = trace_paths(PATHS[kind], device=oclgrind.device(width), rays_per_pixel=rays, replicates=1,
                        branches=branches, **PATH_OPTIONS.get(kind, {}))  # fmt: skip
    assert light.ends["detected"] > 0  # some light is stored
    assert oclgrind.complaints() == []


@pytest.mark.parametrize("entry", ["meet", "adjoint", "forward", "sums", "multiply_add", "device", "speed", "none"])
@pytest.mark.parametrize("width", WIDTHS)
def test_probes(oclgrind, width, entry, monkeypatch):
    device, scene, random = oclgrind.device(width), MIRRORS["power"], np.random.default_rng(1)
    words = random.integers(0, 2**32, (BLOCK, 4), dtype=np.uint32)
    chief = setup_of(scene).chief_rays
    if entry == "meet":
        MeetProbe(device, scene, "fp32")(random.uniform(-0.05, 0.05, (4, 13)).astype(np.float32))
    elif entry == "adjoint":
        sources = receivers(chief, np.zeros(BLOCK, int), np.zeros((BLOCK, 2), np.int32), "fp32")
        PathProbe(device, scene, "fp32", "adjoint")(sources, words)
    elif entry == "forward":
        sources, _ = emitters(setup_of(scene), "fp32", 1.0, "mirror")
        PathProbe(device, scene, "fp32", "forward")(np.repeat(sources[:1], BLOCK), words)
    elif entry == "sums":
        work = Workspace(device, compose("probe_sums.cl", {}, {}, "fp32", 1), "probe_sums")
        sums, amounts = work.empty(24), random.integers(0, 2**63, 64, dtype=np.uint64)
        work.clear(sums)
        work.launch((64, 1), [work.upload(amounts), work.upload(np.arange(64, dtype=np.uint32) % 3), sums])
        found = work.download(sums, np.zeros(3, np.uint64))
        assert [int(n) for n in found] == [sum(int(a) for a in amounts[k::3]) % 2**64 for k in range(3)]
    elif entry == "multiply_add":
        work = Workspace(device, compose("multiply_add.cl", {}, {}, "fp32", width), "multiply_add")
        work.launch((4, 1), [np.int32(3), work.empty(4 * 4 * 64)])
    elif entry == "device":
        selftest.probe(device)
    elif entry == "speed":
        monkeypatch.setattr(speed, "FIRST_BLOCKS", 2)
        monkeypatch.setattr(speed, "SECONDS", 0.0)  # one block for each launch
        assert SpeedTest(device).counts().any()
    else:
        run = tracer_of(scene, device, TraceOptions("forward"), accumulate="none")
        run.launch(0, RayBlock(0, run.sources, 0, 3))
    assert oclgrind.complaints() == []


# What it is to find, each put into a copy of a kernel file: (file, what is there, what comes instead, the complaint)
FAULTS = {
    "write behind the buffer": (
        "trace_adjoint.cl", "2 * (size_t)visible_pixel", "2 * (size_t)(visible_pixel + 1)", "Invalid write",
    ),
    "read before the buffer": (
        "window.cl", "hits->visible_pixels[pixel],", "hits->visible_pixels[pixel - 9],", "Invalid read",
    ),
    "write behind local memory": ("accumulate_tile.cl", "i < light->bins", "i <= light->bins", "Invalid write"),
    "race between work-items": (
        "sum64.cl", "atomic_add(&sums[2 * index], low);", "sums[2 * index]; sums[2 * index] += low;", "data race",
    ),
    "tile not cleared": ("accumulate_tile.cl", "light->tile[i] = 0;", ";", "ninitialized"),
    "variable not set": ("trace_forward.cl", "uint detected = 0, off", "uint detected, off", "ninitialized"),
    "write behind an array": ("tally.cl", "#define MAX_SUMS 200", "#define MAX_SUMS 8", "Invalid write"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_found(oclgrind, fault, monkeypatch):
    name, old, new, complaint = FAULTS[fault]
    text, lines = kernel_files()[name].read_text("ascii"), program._lines
    assert text.count(old) == 1
    broken = text.replace(old, new).splitlines()
    monkeypatch.setattr(program, "_lines", lambda path: broken if path.name == name else lines(path))
    device = oclgrind.device(8 if name == "accumulate_tile.cl" else 1)
    if name == "tally.cl":
        monkeypatch.setattr(nonsequential, "PILOT_RAYS", 2 * RAYS)
        with suppress(AssertionError):  # of the ledger, which the broken kernel writes over
            trace_paths(PATHS["plain"], device=device, rays_per_pixel=RAYS, replicates=1)
    else:
        estimator = "forward" if name in ("trace_forward.cl", "window.cl", "sum64.cl") else "adjoint"
        run = tracer_of(MIRRORS["nominal"], device, TraceOptions(estimator))
        totals(run, np.array([16]))
    found = oclgrind.complaints()
    assert any(complaint in line for line in found), found


def test_every_kernel_file_was_checked(request):
    """Over the tests above; only where all of them ran."""
    if not has_oclgrind():
        pytest.skip(HOW_TO_GET_IT)
    here = [item for item in request.session.items if item.fspath == request.node.fspath]
    assert len(here) >= 60, "run the whole file"
    assert checked_files == set(kernel_files())
