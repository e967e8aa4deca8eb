"""The command `irtscots kernel`."""

from __future__ import annotations

import argparse

from irtscots_cl.cli.common import add_scene, add_trace_choices, choices, command, print_json, visible_setup


def add(commands) -> None:
    parser = command(
        commands,
        "kernel",
        _execute,
        "print the OpenCL source and build options that a scene gets",
        example="sphere-deviated --estimator forward",
    )
    add_scene(parser)
    add_trace_choices(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.tracing.options import ANALYTIC, ESTIMATORS, NONSEQUENTIAL, TraceOptions

    chosen = TraceOptions(**choices(options, ("estimator", "sampler", "precision", "smoothing")))
    if chosen.estimator == ANALYTIC:
        allowed = ", ".join((*ESTIMATORS, NONSEQUENTIAL))
        raise ValueError(f"--estimator = {ANALYTIC!r}: has no kernel; must be one of {allowed}")
    setup = visible_setup(options.scene)
    source = _source(setup, options.device, chosen)
    if options.json:
        print_json({"options": source.options, "files": source.files, "source": source.text})
    else:
        print(f"// build options: {' '.join(source.options)}")
        print(source.text, end="")
    return 0


def _source(setup, choice: str | None, options):
    """The composed source of the estimator's kernel, built on the device."""
    from irtscots_cl.execution.device_tracer import DeviceTracer
    from irtscots_cl.opencl.device import select_device
    from irtscots_cl.tracing.estimators.nonsequential import PathTask
    from irtscots_cl.tracing.estimators.sequential import SequentialTask
    from irtscots_cl.tracing.options import NONSEQUENTIAL

    device = select_device(choice)
    task = (PathTask if options.estimator == NONSEQUENTIAL else SequentialTask)(setup, options)
    return DeviceTracer(task, device).program.source
