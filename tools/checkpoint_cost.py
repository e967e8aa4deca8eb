#!/usr/bin/env python3
"""Print what saving costs a trace: tools/checkpoint_cost.py [SCENE ...] [--seconds S] [--out DIR] [--device D].

Traces each scene for S seconds with checkpoints in DIR; JSON: bytes of the last one, saves, seconds, share of the time.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from irtscots_cl.execution.checkpoint import Checkpoint, Checkpoints, Interrupted
from irtscots_cl.opencl.device import select_device
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

MANY_RAYS = 2**32  # per pixel: more than there is time for


class Watched(Checkpoints):
    """Remembers its trace's file."""

    def file_of(self, facts) -> Checkpoint:
        self.kept = super().file_of(facts)
        return self.kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["sphere-deviated"], metavar="SCENE")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, default=Path())
    parser.add_argument("--device")
    options = parser.parse_args()
    print(json.dumps([_measure(name, options) for name in options.scenes], indent=2))


def _measure(name: str, options: argparse.Namespace) -> dict[str, object]:
    device = select_device(options.device)
    with tempfile.TemporaryDirectory(dir=options.out) as folder:
        keeper = Watched(Path(folder) / "checkpoint", max_seconds=options.seconds)
        started = time.perf_counter()
        with suppress(Interrupted):
            trace(load_scene(name), device=device, rays_per_pixel=MANY_RAYS, keeper=keeper)
        seconds, size = time.perf_counter() - started, keeper.path.stat().st_size
    return {"scene": name, "device": device.name, "bytes": size, "saves": keeper.kept.saves, "seconds": seconds,
            "share": keeper.kept.save_seconds / seconds}  # fmt: skip


if __name__ == "__main__":
    main()
