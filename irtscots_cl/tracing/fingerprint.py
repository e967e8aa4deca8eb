"""The facts that the sums of a trace depend on: no other trace may continue its checkpoint."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from irtscots_cl.execution.checkpoint_file import Fingerprint, hash_of
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.versions import package_version
from irtscots_cl.tracing.options import TraceOptions


def trace_fingerprint(
    scene: Scene, options: TraceOptions, rays: np.ndarray, device_identity: dict[str, str]
) -> Fingerprint:
    """The facts that a trace of rays [replicates] per source depends on and that are known before its kernel is built.

    device_identity: {"device", "driver"}: their names.
    """
    facts = {"scene": hash_of(scene.to_toml().encode())} | asdict(options)
    outline = scene.mirror.outline
    if outline is not None and outline.is_mask:  # the scene's text has the file's name alone
        from irtscots_cl.scene.outline_mask import outline_mask  # imported late: few outlines are pictures

        facts["outline"] = hash_of(outline_mask(outline).tobytes())
    numbers = {"rays_per_pixel": int(rays.sum()), "replicates": len(rays)}
    return facts | numbers | {**device_identity, "version": package_version()}
