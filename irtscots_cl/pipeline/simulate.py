"""Simulate a test and measure the mirror from its images."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from irtscots_cl.analysis.comparison import Comparison, compare
from irtscots_cl.analysis.error_terms import ErrorTerm, error_terms
from irtscots_cl.execution.executor import Executor
from irtscots_cl.execution.select import executor_of
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.error_bars import ErrorBars, error_bars
from irtscots_cl.measurement.methods import BEST, measure_by
from irtscots_cl.measurement.prediction import predict_error
from irtscots_cl.measurement.quality import check_images
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.opencl.device import Device, select_devices
from irtscots_cl.optics.setup import Setup
from irtscots_cl.report.facts import build_report
from irtscots_cl.report.quality import check_facts
from irtscots_cl.report.seconds import seconds_of, with_parts
from irtscots_cl.report.types import CheckFacts, Report
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.tracing.checks.precision import rounding_error, rounding_on
from irtscots_cl.tracing.options import ANALYTIC
from irtscots_cl.tracing.results.paths import PathLight
from irtscots_cl.tracing.results.transport import LineLight, Transport
from irtscots_cl.tracing.trace import trace

if TYPE_CHECKING:
    from irtscots_cl.scene.detector_noise import DetectorNoise
    from irtscots_cl.scene.screen_response import ScreenResponse


@dataclass(frozen=True)
class Run:
    """A finished simulation and its measurement. parts: of the height error, where asked for. report: as report.json
    holds it. bars: standard errors from the noise of the images, by measures that give them. began: when the simulation
    did, by time.perf_counter."""

    transport: Transport | LineLight
    stack: ImageStack
    result: Reconstruction
    comparison: Comparison
    parts: tuple[ErrorTerm, ...]
    report: Report
    bars: ErrorBars | None = None
    began: float = 0.0


def simulate(
    scene: Scene | Setup,
    *,
    measure: str = "paper",
    zernike: str = "circular",
    parts: bool = False,
    noise: DetectorNoise | None = None,
    response: ScreenResponse | None = None,
    device: Device | Sequence[Device] | None = None,
    client=None,
    progress: Callable[[int, int], None] | None = None,
    stage: Callable[[str], None] | None = None,
    **trace_options,
) -> Run:
    """Trace a scene, take its line-scan images, measure the mirror from them and compare with the truth.

    scene: a scene, or a Setup of it. measure: a name of methods.MEASURES. zernike: kind of the terms that are fitted,
    of coefficients.KINDS. parts: also separate the height error into its terms; float rounding is separated on the
    first device, not with a client. noise, response: of the detector and the screen, instead of the scene's own.
    stage(words): called when work on the host begins that may take long. device, client, progress, trace_options: as
    of `trace`. Raises as `trace`, `measure_by` and, with noise,
    noise.check_noise do.
    """
    started = time.perf_counter()
    setup = Setup.of(scene)
    take_images = _clean_images
    if noise is not None or response is not None or setup.scene.has_noise_tables:
        from irtscots_cl.pipeline.noise import noisy_images, set_up_noise  # imported late: few runs have noise

        setup, is_noisy = set_up_noise(setup, noise, response, parts, **trace_options)
        take_images = noisy_images if is_noisy else _clean_images
    scene = setup.scene
    transport = trace(setup, device=device, client=client, progress=progress, **trace_options)
    traced = time.perf_counter()
    interruption.check()
    tell = stage or (lambda words: None)
    tell("measuring")
    stack, more_facts = take_images(transport)
    result = measure_by(measure, stack, setup.nominal)
    measured = time.perf_counter()
    interruption.check()
    tell("predicting errors")
    rounding = _rounding_mm(setup, transport, device, client)
    comparison = compare(result, scene, zernike)
    bars = error_bars(result)
    predicted = predict_error(result, stack, rounding_height_mm=rounding, bars=bars)
    separated = error_terms(result, setup, measure, transport.options, device) if parts else ()
    judged = time.perf_counter()
    seconds = seconds_of(transport.seconds, traced - started, reconstruct=measured - traced, predict=judged - measured)
    report = build_report(transport, measure, result, comparison, predicted, separated, seconds)
    report.update(more_facts)
    if measure == BEST:
        report["checks"] = checks_of(result, stack)
    report["seconds"] = with_parts(report["seconds"], report=time.perf_counter() - judged)
    return Run(transport, stack, result, comparison, separated, report, bars, started)


def _rounding_mm(setup: Setup, transport: Transport | LineLight, device, client) -> float:
    """Rms height in mm that the arithmetic of the trace adds; 0 in double precision and without rays."""
    options = transport.options
    if options.estimator == ANALYTIC or options.precision != "fp32":
        return 0.0
    if client is not None:
        place: Executor = executor_of(None, client)
        return place.call(rounding_on, setup.scene.to_toml(), options.precision).height_nm * 1e-6
    first = select_devices()[0] if device is None else device if isinstance(device, Device) else device[0]
    return rounding_error(setup, first, options.precision).height_nm * 1e-6


def checks_of(result: Reconstruction, stack: ImageStack) -> list[CheckFacts]:
    """The checks of the images of a result by the best measure, as report.json holds them."""
    assert result.estimates_of_scans is not None
    return check_facts(check_images(stack, result.setup, result.estimates_of_scans))


def _clean_images(transport: Transport | LineLight) -> tuple[ImageStack, dict]:
    """The images of a trace without noise, about which the report has nothing more to say."""
    return transport.images(LineScan(transport.scene)), {}


class Outlook(NamedTuple):
    """What a trace of some replicates gives so far. words: the error, "" if it is not known yet. result: None if there
    is too little light yet."""

    words: str
    result: Reconstruction | None = None


def outlook(traced: Transport | LineLight | PathLight, measure: str, nominal: Setup | None = None) -> Outlook:
    """The error so far, and the result so far, from a trace of some replicates.

    nominal: the set-up of the design, if the caller has it.
    """
    flux_w = traced.line_flux_w("x").sum((1, 2))
    if len(flux_w) < 2 or not flux_w.all():
        return Outlook("")
    words = f"standard error of the flux {flux_w.std(ddof=1) / len(flux_w) ** 0.5 / flux_w.mean():.1g}"
    stack = traced.images(LineScan(traced.scene))
    try:
        # refinement takes long, and leaves ray noise as it is
        result = measure_by("fine" if measure == "refined" else measure, stack, nominal or traced.scene.nominal())
    except ValueError:  # too little light yet
        return Outlook(words)
    height_nm = predict_error(result, stack, systematic=False).height_mm * 1e6
    return Outlook(f"{words}, height error {height_nm:.2g} nm" if np.isfinite(height_nm) else words, result)
