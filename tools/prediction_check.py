"""Whether the predicted height error is the actual one: seeded random scenes of many kinds, under every measure.

    tools/prediction_check.py [--scenes 28] [--rays 1024] [--sampler sobol] [--plain] [--precision fp64] [--json]

Each scene (tests/support/varied_scenes.py) is traced, measured, and compared with its true surface. The prediction has
the design and the images alone. Heights in nm rms, piston and tilt removed; ratio: actual / predicted.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from varied_scenes import KINDS, varied_scene

from irtscots_cl.measurement.methods import MEASURES
from irtscots_cl.pipeline.simulate import simulate

WITHIN = 1.3  # of the actual error


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=28)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rays", type=int, default=1024, help="per detector pixel")
    parser.add_argument("--sampler", default="sobol")
    parser.add_argument("--plain", action="store_true", help="without --smoothing")
    parser.add_argument("--precision", default="fp64")
    parser.add_argument("--measures", nargs="+", default=["paper", "fine", "refined"], choices=list(MEASURES))
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.scenes)
    rows = []
    for row in check(numbers, options.measures, sampler=options.sampler, smoothing=not options.plain,
                     precision=options.precision, rays_per_pixel=options.rays):  # fmt: skip
        rows.append(row)
        if not options.json:
            print("| {scene} | {kind} | {measure} | {actual_nm:.3g} | {predicted_nm:.3g} | {ratio:.2f} | {note} |"
                  .format(**row), flush=True)  # fmt: skip
    if options.json:
        print(json.dumps(rows, indent=2))
    missed = [row for row in rows if not row["holds"]]
    for measure in options.measures:
        of_one = [row for row in rows if row["measure"] == measure]
        near = sum(row["near"] for row in of_one)
        print(f"{measure}: {near} of {len(of_one)} within {WITHIN}, worst "
              f"{max(max(row['ratio'], 1 / row['ratio']) for row in of_one):.2f}", file=sys.stderr)  # fmt: skip
    return 1 if missed else 0


def check(numbers, measures, **trace_options) -> Iterator[dict]:
    """A row for each scene and measure."""
    for number in numbers:
        scene = varied_scene(number)
        for measure in measures:
            yield compared(scene, KINDS[number % len(KINDS)], simulate(scene, measure=measure, **trace_options))


def compared(scene, kind: str, run) -> dict:
    """Actual and predicted height error of a run in nm; near: within WITHIN; holds: near, or below a stated bound."""
    actual = run.comparison.height_error_nm["piston_tilt"].value
    predicted = run.report["predicted"]
    height = predicted["height_error_nm_rms_piston_tilt"]
    ratio = actual / height
    near = 1 / WITHIN <= ratio <= WITHIN
    bound = predicted["bound"]
    return {"scene": scene.name, "kind": kind, "measure": run.report["measure"], "actual_nm": actual,
            "predicted_nm": height, "ratio": ratio, "near": near, "holds": near or (bound != "" and ratio <= WITHIN),
            "note": bound}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
