#!/usr/bin/env python3
"""Print the tracer's rays per second as JSON: tools/throughput.py [SCENE ...] [--device D] [--sampler S].

The same code as `irtscots bench`, for scripts: one object per scene and estimator.
"""

from __future__ import annotations

import argparse
import json

from irtscots_cl.bench import Case, time_cases
from irtscots_cl.device import select_device
from irtscots_cl.presets import load_scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["sphere"], metavar="SCENE")
    parser.add_argument("--device")
    parser.add_argument("--sampler", default="philox")
    parser.add_argument("--precision", default="fp32")
    options = parser.parse_args()
    device = select_device(options.device)
    cases = [
        Case("", name, load_scene(name), estimator, options.sampler, options.precision)
        for name in options.scenes
        for estimator in ("forward", "adjoint")
    ]
    rows = [
        {
            "scene": timing.case.name,
            "estimator": timing.case.estimator,
            "sampler": timing.case.sampler,
            "precision": timing.case.precision,
            "rays_per_second": timing.median,
            "lowest": min(timing.rates),
            "highest": max(timing.rates),
            "device": device.name,
        }
        for timing in time_cases(cases, device, quick=False)
    ]
    print(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
