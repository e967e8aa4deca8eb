"""The main job from scene to report: the one module that knows every stage."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from irtscots_cl.comparison import HEIGHT_TERMS, Comparison, compare
from irtscots_cl.device import Device
from irtscots_cl.errorparts import ErrorPart, error_parts
from irtscots_cl.files import check_output_folder, write_json, write_result
from irtscots_cl.images import ImageStack
from irtscots_cl.measures import measure_by
from irtscots_cl.paths import PathLight
from irtscots_cl.patterns import LineScan
from irtscots_cl.prediction import predict_error
from irtscots_cl.reconstruction import Reconstruction
from irtscots_cl.report import build_report, versions, write_html
from irtscots_cl.scene import Scene
from irtscots_cl.tracer import trace
from irtscots_cl.transport import LineLight, Transport
from irtscots_cl.zonal import remove_terms, rms


@dataclass(frozen=True)
class Run:
    """A finished simulation and its measurement. parts: of the height error, where asked for. report: as report.json
    holds it."""

    transport: Transport | LineLight
    stack: ImageStack
    result: Reconstruction
    comparison: Comparison
    parts: tuple[ErrorPart, ...]
    report: dict


def simulate(
    scene: Scene,
    *,
    measure: str = "paper",
    parts: bool = False,
    device: Device | Sequence[Device] | None = None,
    client=None,
    progress: Callable[[int, int], None] | None = None,
    **trace_options,
) -> Run:
    """Trace a scene, take its line-scan images, measure the mirror from them and compare with the truth.

    measure: a name of measures.MEASURES. parts: also separate the height error into its parts; rounding is told apart
    on the first device, not with a client. device, client: as of `trace`. trace_options: estimator, sampler, precision,
    rays_per_pixel, replicates, seed, aim, overfill, smoothing, keeper, finished of `trace`. Raises as `trace` and
    `measure_by` do.
    """
    started = time.perf_counter()
    transport = trace(scene, device=device, client=client, progress=progress, **trace_options)
    traced = time.perf_counter()
    stack = transport.images(LineScan(scene))
    result = measure_by(measure, stack, scene.nominal())
    measured = time.perf_counter()
    comparison, predicted = compare(result, scene), predict_error(result, stack)
    seconds = transport.seconds | {"reconstruct": measured - traced, "total": time.perf_counter() - started}
    first = device if device is None or isinstance(device, Device) else device[0]
    separated = error_parts(result, scene, measure, transport.options, first) if parts else ()
    report = build_report(transport, measure, result, comparison, predicted, separated, seconds)
    return Run(transport, stack, result, comparison, separated, report)


def outlook(traced: Transport | LineLight | PathLight, measure: str) -> str:
    """What a trace of some replicates says of the error, in words; "" where it says nothing yet."""
    flux_w = traced.line_flux_w("x").sum((1, 2))
    if len(flux_w) < 2 or not flux_w.all():
        return ""
    words = f"standard error of the flux {flux_w.std(ddof=1) / len(flux_w) ** 0.5 / flux_w.mean():.1g}"
    stack = traced.images(LineScan(traced.scene))
    try:
        # refinement takes long, and leaves ray noise as it is
        result = measure_by("fine" if measure == "refined" else measure, stack, traced.scene.nominal())
    except ValueError:  # too little light yet
        return words
    height_nm = predict_error(result, stack).height_mm * 1e6
    return f"{words}, height error {height_nm:.2g} nm" if np.isfinite(height_nm) else words


def write_run(run: Run, folder: Path) -> None:
    """Write report.json, result.h5, report.html and figures/*.png; the folder is made if it is not there.

    report.json comes last: where it is, the others are complete.
    """
    from irtscots_cl.plots import write_figures  # matplotlib is slow to import: only where figures are made

    _open_folder(folder)
    report, toml = run.report, run.transport.scene.to_toml()
    attributes = {
        "scene": toml,
        "seed": str(report["seed"]),
        "device": report["device"]["name"],
        "driver": report["device"]["driver"],
        "estimator": report["estimator"],
        "sampler": report["sampler"],
        "precision": report["precision"],
        "measure": report["measure"],
        "ledger": json.dumps(report["ledger"]),
    }
    write_result(folder / "result.h5", run.stack, run.result, attributes | _version_attributes())
    figures = write_figures(folder / "figures", run.stack, run.result, run.comparison, run.parts)
    write_html(folder / "report.html", report, figures, toml)
    write_json(folder / "report.json", report)


def _open_folder(folder: Path) -> None:
    """Make the folder, without the report.json of an earlier run: that would vouch for files about to be replaced."""
    check_output_folder(folder)
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    (folder / "report.json").unlink(missing_ok=True)


def _version_attributes() -> dict[str, str]:
    return {f"version {name}": value for name, value in versions().items()}


def measure(stack: ImageStack, nominal: Scene, folder: Path, threshold: float = 0.0, how: str = "paper") -> dict:
    """Measure a mirror from images alone, without a truth to compare with.

    how: a name of measures.MEASURES. Writes result.h5 and figures into the folder and returns the main facts, named as
    in report.json.
    """
    from irtscots_cl.plots import write_figures

    result = measure_by(how, stack, nominal, threshold)
    _open_folder(folder)
    attributes = {"scene": nominal.to_toml(), "measure": how} | _version_attributes()
    write_result(folder / "result.h5", stack, result, attributes)
    write_figures(folder / "figures", stack, result, None)
    left = {t: remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.mask, t) for t in HEIGHT_TERMS}
    deviation = {terms: rms(height, result.mask) * 1e6 for terms, height in left.items()}
    return {
        "scene": nominal.name,
        "measure": how,
        "refinement_updates_nm": list(result.updates_nm),
        "pixels_used": result.pixels_used,
        "light_curves_refused": result.refused(),
        "deviation_nm_rms": deviation,
    }
