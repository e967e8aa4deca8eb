"""The time of a run, part by part: the parts add up to the whole command."""

from __future__ import annotations

from typing import cast

from irtscots_cl.report.types import Seconds

# One after the other, but for the report's facts, which come before the files. Writing report.json, which has these
# seconds, takes milliseconds.
PARTS = ("start", "prepare", "build", "trace", "reconstruct", "predict", "store", "figures", "report")


def seconds_of(of_trace: dict[str, float], tracing: float, **parts: float) -> dict[str, float]:
    """Seconds of a simulation by part. of_trace: {"build", "trace", "kernels"}; tracing: from its call to its return.

    What of it is neither build nor trace is "prepare". An earlier process's share of "trace" counts, too.
    """
    prepare = max(0.0, tracing - of_trace["build"] - of_trace["trace"])
    return in_order({"prepare": prepare} | of_trace | parts)


def with_parts(seconds: Seconds, **parts: float) -> Seconds:
    """The same with further parts, and the new total."""
    return cast("Seconds", in_order(cast("dict[str, float]", seconds) | parts))


def in_order(seconds: dict[str, float]) -> dict[str, float]:
    """The parts in the order of their work, "kernels", which are in "trace", after it, and "total": all of PARTS."""
    ordered = {}
    for name in PARTS:
        if name in seconds:
            ordered[name] = seconds[name]
        if name == "trace":
            ordered["kernels"] = seconds["kernels"]
    return ordered | {"total": sum(seconds.get(name, 0.0) for name in PARTS)}
