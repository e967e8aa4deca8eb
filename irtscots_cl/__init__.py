"""Simulation of a SCOTS deflectometry test of a mirror, from the screen's light to the measured height map.

    import irtscots_cl as irt
    scene = irt.load_scene("sphere-deviated")
    run = irt.trace(scene, rays_per_pixel=1024, seed=1)
    result = irt.reconstruct(run.images(irt.LineScan(scene)), scene.nominal())

Map of the files, in layers; a file imports only from files above it:

    geometry, zernikes, zonal, integration                mathematics
    checked, scatter, element, scene, presets,
    surface, calibration                                  what is tested, with what, and its chief rays
    pixelmap, cells, pixellight                           a detector pixel's light in closed form
    interface, device, program, execution                 OpenCL: no other file imports pyopencl
    windows, samplers, options, launches, checkpoint,
    runner, crew, tasks, cluster, aiming, packing,
    transport, analytic, parts, paths, pathsums,
    nonsequential, tracer, probes, precision              scene + device -> Transport, light curves, light by path
    images, patterns                                      Transport -> image stack
    lightcurves, centroids, profiles, slopes,
    reconstruction, refinement, measures, prediction      image stack -> height; never sees the true surface
    comparison, straylight, errorparts, files, report,
    plots, studies, pipeline, targets, stability, bench,
    cli                                                   assembly

The kernels are OpenCL C in kernels/: at the top of the repository, inside the package once it is installed.
"""

from importlib import import_module
from typing import Any

# Public name -> the module that defines it. Nothing is imported before it is asked for: listing the scenes or a
# wrong argument on the command line need not wait for NumPy, OpenCL and Matplotlib.
_PUBLIC = {
    "DeviceError": "device",
    "Interrupted": "checkpoint",
    "Keeper": "checkpoint",
    "LineLight": "transport",
    "LineScan": "patterns",
    "Scene": "scene",
    "SceneError": "scene",
    "Transport": "transport",
    "all_devices": "device",
    "compare": "comparison",
    "error_parts": "errorparts",
    "integrate_slopes": "integration",
    "load_scene": "presets",
    "measure_by": "measures",
    "noise_gain": "integration",
    "reconstruct": "reconstruction",
    "refine": "refinement",
    "select_device": "device",
    "select_devices": "device",
    "stray_light": "straylight",
    "trace": "tracer",
    "trace_paths": "nonsequential",
    "zernike": "zernikes",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value = _version()
    elif name in _PUBLIC:
        value = getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value  # the next access is a plain one
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("irtscots-cl")
    except PackageNotFoundError:  # a source tree on the path
        return "0+uninstalled"
