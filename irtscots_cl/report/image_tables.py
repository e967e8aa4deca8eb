"""How a laboratory's images were read, and what was known about its camera, as tables for the terminal."""

from __future__ import annotations

import math

from irtscots_cl.report.table import Table
from irtscots_cl.report.types import MeasuredFacts


def image_tables(facts: MeasuredFacts) -> list[Table]:
    """Nothing for images that bring no such facts."""
    rows: list[tuple[str, ...]] = []
    if "images" in facts:
        found = facts["images"]
        rows.append(("images, files", f"{found['frames']}, {found['files']}"))
        rows.append(("bits of a sample", str(found["bits"]) if found["bits"] else "floating point"))
        saturation = found["saturation"]
        rows.append(("saturated from", "not known" if saturation is None else f"{saturation:.10g} counts"))
        rows += [("reading", note) for note in found["notes"]]
    if "camera" in facts:
        known = facts["camera"]
        for kind, count in known["averaged"].items():
            error = known["standard_error"][kind]
            told = f" +- {error:.2g}" if math.isfinite(error) else ""
            rows.append((f"{kind} frames", f"{count}, {known['counts'][kind]:.5g}{told} counts"))
        if known["images_per_frame"] > 1:
            times = ", ".join(f"{time:g}" for time in known["exposures_s"])
            rows.append(("images of each frame", f"{known['images_per_frame']}{f' of {times} s' if times else ''}"))
        if known["bad_pixels"]:
            rows.append(("bad pixels", f"{known['bad_pixels']}, {known['dead_pixels']} of them by the flat frames"))
    return [Table("Images", ("", ""), rows)] if rows else []
