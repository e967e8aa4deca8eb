"""Prints a digest of the sums of many traces: every estimator, sampler, precision and preset, and how traces are run.

Usage: tools/trace_digests.py [--json FILE] [--against FILE]

Same seed and device, same bits: on one machine two versions of the package print the same digests unless what is traced
has changed. --against compares with an earlier --json and exits with 1 where a digest differs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import irtscots_cl as irt

CASES: dict[str, dict] = {
    **{f"{estimator} {sampler} {precision}": {"scene": "sphere-deviated", "estimator": estimator, "sampler": sampler,
                                             "precision": precision}
       for estimator in ("forward", "adjoint") for sampler in ("philox", "sobol", "lattice")
       for precision in ("fp32", "fp64")},
    **{f"smoothed {sampler} {precision}": {"scene": "sphere-deviated", "smoothing": True, "sampler": sampler,
                                           "precision": precision, "rays_per_pixel": 64}
       for sampler in ("philox", "sobol") for precision in ("fp32", "fp64")},
    **{f"{estimator} {scene}": {"scene": scene, "estimator": estimator}
       for estimator in ("forward", "adjoint") for scene in ("sphere", "off-axis")},
    **{f"analytic {scene}": {"scene": scene, "estimator": "analytic"} for scene in ("sphere", "sphere-deviated")},
    "forward aimed at the camera": {"scene": "sphere", "estimator": "forward", "aim": "camera"},
    "forward overfilled": {"scene": "sphere", "estimator": "forward", "overfill": 1.5},
    **{f"nonsequential {scene}": {"scene": scene, "estimator": "nonsequential", "rays_per_pixel": 4096}
       for scene in ("sphere", "sphere-singlet", "sphere-doublet", "sphere-window", "ghosts", "baffled")},
    "nonsequential fp64": {"scene": "sphere-window", "estimator": "nonsequential", "precision": "fp64",
                           "rays_per_pixel": 4096},
    "another seed": {"scene": "sphere", "seed": 2**40 + 7},
    "launches of 2^18 rays": {"scene": "sphere", "launch_rays": 2**18},
}  # fmt: skip


def digest_of(run) -> str:
    """Of what a trace has found: its integer sums where it has them, and its images."""
    found = hashlib.blake2b(digest_size=12)
    arrays = [np.asarray(getattr(run, name)) for name in ("counts", "images_w") if hasattr(run, name)]
    flux = getattr(run, "flux_w", None)
    arrays += [flux[axis] for axis in "xy"] if isinstance(flux, dict) else []
    for array in arrays:
        found.update(f"{array.dtype} {array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    found.update(json.dumps(run.ledger, sort_keys=True).encode())
    return found.hexdigest()


def traced(case: dict, **how):
    """One trace of a case; a preset that this version lacks gives None."""
    given = {"rays_per_pixel": 512, "replicates": 2, "seed": 5} | {k: v for k, v in case.items() if k != "scene"}
    try:
        scene = irt.load_scene(case["scene"])
    except ValueError:
        return None
    return irt.trace(scene, **(given | how))


def resumed(case: dict):
    """The case interrupted after its first replicate, and resumed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "checkpoint"
        first = irt.Keeper(path)

        def stop(*_) -> None:
            first.stop = True

        try:
            traced(case, keeper=first, progress=stop, launch_rays=2**20)
        except irt.Interrupted:
            pass
        else:
            raise RuntimeError("the trace was to be interrupted")
        return traced(case, keeper=irt.Keeper(path, resume=True))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the digests to this file")
    parser.add_argument("--against", type=Path, help="digests of an earlier version to compare with")
    options = parser.parse_args()
    before = json.loads(options.against.read_text()) if options.against else {}
    device = irt.select_device(None)
    runs = {name: lambda case=case: traced(case, device=device) for name, case in CASES.items()}
    plain = CASES["adjoint philox fp32"]
    runs["two devices"] = lambda: traced(plain, device=[device, device])
    runs["resumed"] = lambda: resumed(plain)
    runs["resumed forward"] = lambda: resumed(CASES["forward philox fp32"])
    found, different = {}, 0
    for name, run in runs.items():
        result = run()
        if result is None:
            continue
        found[name] = digest_of(result)
        changed = name in before and before[name] != found[name]
        different += changed
        print(f"{found[name]}  {name}{'  CHANGED' if changed else ''}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1))
    print(f"{len(found)} traces, {different} differ" if before else f"{len(found)} traces")
    return int(different > 0 or not set(before) <= set(found))


if __name__ == "__main__":
    sys.exit(main())
