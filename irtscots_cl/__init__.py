"""Simulation of a SCOTS deflectometry test of a mirror, from the screen's light to the measured height map.

    import irtscots_cl as irt
    scene = irt.load_scene("sphere-deviated")
    run = irt.trace(scene, rays_per_pixel=1024, seed=1)
    result = irt.reconstruct(run.images(irt.LineScan(scene)), scene.nominal())

The folders, in order: each imports only from folders above it.

    system       What the host offers: memory, whole files, versions.
    maths        Frames, quadrics, Zernike polynomials, slopes to heights, error bars.
    formats      Files of others: bytes to arrays with units, and back. Knows no scene.
    opencl       OpenCL devices, programs, buffers, structures. Alone imports pyopencl.
    scene        What is tested and with what: frozen, checked, as TOML. No NumPy at import.
    execution    Where launches run: one device, many, a Dask cluster; checkpoints. Knows no scene.
    optics       Rays in float64 on the host: surfaces, chief rays, a pixel's light in closed form.
    imaging      What the screen shows and the camera records.
    tracing      SIMULATION: scene and device to light transport, by four estimators.
    measurement  MEASUREMENT: images and design to height. Never imports tracing, opencl, execution.
    analysis     Truth meets measurement: errors, error terms, stray light.
    calibration  What is not known about a test's geometry, and what its images say about it.
    budget       What each error source of a test costs in nanometres of height, before there is any hardware.
    planning     A test before it is built: what will go wrong with a scene, and a first scene for one's own mirror.
    report       Results for people and programs: tables, JSON, HTML, HDF5, figures.
    pipeline     The ready-made jobs: simulate, measure, reach a target.
    bench        How fast rays are traced, how the time grows with a job, and which error is had for which time.
    stability    Numerical stability on hard cases: the device's arithmetic, ray by ray, against exact references.
    studies      The paper's tables and figures again, one module each: `irtscots reproduce` runs them.
    cli          The command line: `irtscots COMMAND`.

Two wings do not know each other: tracing simulates, measurement measures. docs/architecture.md draws their imports.
The kernels are OpenCL C in kernels/: at the top of the repository, inside the package once it is installed.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# Public name -> the module that defines it. Nothing is imported before it is asked for: listing the scenes or a
# wrong argument on the command line need not wait for NumPy, OpenCL and Matplotlib.
_PUBLIC = {
    "Bench": "planning.first_scene",
    "Calibration": "scene.calibration_known",
    "Camera": "scene.instrument",
    "Detector": "scene.instrument",
    "DeviceError": "opencl.device",
    "Checkpoints": "execution.checkpoint",
    "FringeScan": "imaging.fringes",
    "FringeSet": "imaging.fringes",
    "FringeStack": "imaging.fringes",
    "HeightMap": "formats.height_map",
    "ImageStack": "imaging.image_stack",
    "Interrupted": "execution.checkpoint",
    "Knowledge": "scene.calibration_known",
    "LineLight": "tracing.results.transport",
    "LineScan": "imaging.patterns",
    "measure_fringes": "pipeline.measure_fringes",
    "Mirror": "scene.mirror",
    "MirrorMap": "scene.height_map",
    "MapOptions": "formats.height_map",
    "moved": "calibration.parameters",
    "record_pictures": "imaging.recorded_pictures",
    "Scan": "imaging.image_stack",
    "Scene": "scene.model",
    "SceneError": "scene.validation",
    "Screen": "scene.instrument",
    "Transport": "tracing.results.transport",
    "all_devices": "opencl.device",
    "assess_budget": "budget.assess",
    "calibrate": "calibration.calibrate",
    "check_images": "measurement.quality",
    "check_scene": "planning.check",
    "compare": "analysis.comparison",
    "design": "planning.first_scene",
    "design_patterns": "measurement.pattern_design.choice",
    "error_bars": "measurement.error_bars",
    "error_terms": "analysis.error_terms",
    "estimate_centroids": "measurement.scan_estimates",
    "height_map": "report.height_map",
    "identify": "calibration.identification",
    "integrate_slopes": "maths.integration",
    "load_scene": "scene.presets",
    "measure_by": "measurement.methods",
    "noise_gain": "maths.integration",
    "open_map": "formats.maps",
    "plot": "report.plot",
    "record": "imaging.recording",
    "reconstruct": "measurement.reconstruction",
    "refine": "measurement.refinement",
    "screen_coordinates": "measurement.screen_coordinates",
    "select_device": "opencl.device",
    "select_devices": "opencl.device",
    "stray_light": "analysis.stray_light",
    "to_xarray": "report.xarray_data",
    "trace": "tracing.trace",
    "trace_paths": "tracing.trace",
    "Unknowns": "calibration.calibrate",
    "viewer": "report.viewer",
    "write_map": "formats.maps",
    "zernike": "maths.zernike.polynomials",
    "ZernikeTerms": "scene.mirror",
}

# Earlier names, which go on working.
_ALIASES = {"Keeper": "Checkpoints", "error_parts": "error_terms"}

# The same names for type checkers and editors, which do not run __getattr__.
if TYPE_CHECKING:
    from irtscots_cl.analysis.comparison import compare as compare
    from irtscots_cl.analysis.error_terms import error_terms as error_terms
    from irtscots_cl.analysis.stray_light import stray_light as stray_light
    from irtscots_cl.budget.assess import assess_budget as assess_budget
    from irtscots_cl.calibration.calibrate import Unknowns as Unknowns
    from irtscots_cl.calibration.calibrate import calibrate as calibrate
    from irtscots_cl.calibration.identification import identify as identify
    from irtscots_cl.calibration.parameters import moved as moved
    from irtscots_cl.execution.checkpoint import Checkpoints as Checkpoints
    from irtscots_cl.execution.checkpoint import Interrupted as Interrupted
    from irtscots_cl.formats.height_map import HeightMap as HeightMap
    from irtscots_cl.formats.height_map import MapOptions as MapOptions
    from irtscots_cl.formats.maps import open_map as open_map
    from irtscots_cl.formats.maps import write_map as write_map
    from irtscots_cl.imaging.fringes import FringeScan as FringeScan
    from irtscots_cl.imaging.fringes import FringeSet as FringeSet
    from irtscots_cl.imaging.fringes import FringeStack as FringeStack
    from irtscots_cl.imaging.image_stack import ImageStack as ImageStack
    from irtscots_cl.imaging.image_stack import Scan as Scan
    from irtscots_cl.imaging.patterns import LineScan as LineScan
    from irtscots_cl.imaging.recorded_pictures import record_pictures as record_pictures
    from irtscots_cl.imaging.recording import record as record
    from irtscots_cl.maths.integration import integrate_slopes as integrate_slopes
    from irtscots_cl.maths.integration import noise_gain as noise_gain
    from irtscots_cl.maths.zernike.polynomials import zernike as zernike
    from irtscots_cl.measurement.error_bars import error_bars as error_bars
    from irtscots_cl.measurement.methods import measure_by as measure_by
    from irtscots_cl.measurement.pattern_design.choice import design_patterns as design_patterns
    from irtscots_cl.measurement.quality import check_images as check_images
    from irtscots_cl.measurement.reconstruction import reconstruct as reconstruct
    from irtscots_cl.measurement.refinement import refine as refine
    from irtscots_cl.measurement.scan_estimates import estimate_centroids as estimate_centroids
    from irtscots_cl.measurement.screen_coordinates import screen_coordinates as screen_coordinates
    from irtscots_cl.opencl.device import DeviceError as DeviceError
    from irtscots_cl.opencl.device import all_devices as all_devices
    from irtscots_cl.opencl.device import select_device as select_device
    from irtscots_cl.opencl.device import select_devices as select_devices
    from irtscots_cl.pipeline.measure_fringes import measure_fringes as measure_fringes
    from irtscots_cl.planning.check import check_scene as check_scene
    from irtscots_cl.planning.first_scene import Bench as Bench
    from irtscots_cl.planning.first_scene import design as design
    from irtscots_cl.report.height_map import height_map as height_map
    from irtscots_cl.report.plot import plot as plot
    from irtscots_cl.report.viewer import viewer as viewer
    from irtscots_cl.report.xarray_data import to_xarray as to_xarray
    from irtscots_cl.scene.calibration_known import Calibration as Calibration
    from irtscots_cl.scene.calibration_known import Knowledge as Knowledge
    from irtscots_cl.scene.height_map import MirrorMap as MirrorMap
    from irtscots_cl.scene.instrument import Camera as Camera
    from irtscots_cl.scene.instrument import Detector as Detector
    from irtscots_cl.scene.instrument import Screen as Screen
    from irtscots_cl.scene.mirror import Mirror as Mirror
    from irtscots_cl.scene.mirror import ZernikeTerms as ZernikeTerms
    from irtscots_cl.scene.model import Scene as Scene
    from irtscots_cl.scene.presets import load_scene as load_scene
    from irtscots_cl.scene.validation import SceneError as SceneError
    from irtscots_cl.tracing.results.transport import LineLight as LineLight
    from irtscots_cl.tracing.results.transport import Transport as Transport
    from irtscots_cl.tracing.trace import trace as trace
    from irtscots_cl.tracing.trace import trace_paths as trace_paths

    Keeper = Checkpoints
    error_parts = error_terms
    __version__: str

__all__ = ["__version__", *_PUBLIC, *_ALIASES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value = import_module(f"{__name__}.system.versions").package_version()
    elif name in _ALIASES:
        value = __getattr__(_ALIASES[name])
    elif name in _PUBLIC:
        value = getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value  # the next access is a plain one
    return value


def __dir__() -> list[str]:
    """The public names, and those that every module has."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__") and name != "__getattr__")})
