#!/usr/bin/env python3
"""Print the tracer's rays per second as JSON: tools/throughput.py [SCENE ...] [--device D] [--sampler S].

The same code as `irtscots bench`, for scripts: one object per scene and estimator.
"""

from __future__ import annotations

import argparse
import json
import sys

from irtscots_cl.bench.suite import conditions
from irtscots_cl.bench.throughput import Case, time_cases
from irtscots_cl.opencl.device import DeviceError, select_device
from irtscots_cl.scene.presets import load_scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["sphere"], metavar="SCENE")
    parser.add_argument("--device")
    parser.add_argument("--sampler", default="philox")
    parser.add_argument("--precision", default="fp32")
    options = parser.parse_args()
    try:
        rows = _measure(options)
    except (ValueError, DeviceError) as error:
        print(f"throughput.py: {error}", file=sys.stderr)
        sys.exit(2)
    print(json.dumps(rows, indent=2))


def _measure(options: argparse.Namespace) -> list[dict]:
    device = select_device(options.device)
    facts = conditions(device)
    cases = [
        Case("", name, load_scene(name), estimator, options.sampler, options.precision)
        for name in options.scenes
        for estimator in ("forward", "adjoint")
    ]
    return [
        {
            "scene": timing.case.name,
            "estimator": timing.case.estimator,
            "sampler": timing.case.sampler,
            "precision": timing.case.precision,
            "rays_per_second": timing.median,
            "lowest": min(timing.rates),
            "highest": max(timing.rates),
            "rounds": len(timing.rates),
            "device": device.name,
            "driver": device.driver,
            "git_revision": facts["git_revision"],
        }
        for timing in time_cases(cases, device, quick=False)
    ]


if __name__ == "__main__":
    main()
