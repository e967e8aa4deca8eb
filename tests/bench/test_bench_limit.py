"""tools/compare_limit.py: its kernels do our work, and one that does not is found out."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

TOOLS = Path(__file__).parents[2] / "tools"
RAYS = 2048  # per source


@pytest.fixture(scope="module")
def tool():
    """The tool as a module; its folder is on the path only here."""
    sys.path.insert(0, str(TOOLS))
    module = importlib.import_module("compare_limit")
    yield module
    sys.path.remove(str(TOOLS))


@pytest.fixture(scope="module")
def ours(device):
    scene = load_scene("sphere")
    return {estimator: trace(scene, device=device, estimator=estimator, rays_per_pixel=rays, replicates=1)
            for estimator, rays in (("forward", 16 * RAYS), ("adjoint", RAYS))}  # fmt: skip


def told(tool, ours, device, name, width=8, **changes):
    """What the tool says of a limit kernel whose numbers are changed by these factors."""
    estimator, given = name.split()[0], tool.job()
    kernel = tool.LimitKernel(device, name, width, given, tool.places_of(given, ours["forward"])[estimator])
    for number, factor in changes.items():
        kernel.numbers[number] *= factor
    return tool.fault(kernel, estimator, given, ours[estimator])


@pytest.fixture(autouse=True)
def few_rays(tool, monkeypatch):
    monkeypatch.setattr(tool, "CHECKED_RAYS", RAYS)


@pytest.mark.parametrize("width", [8, 16])
@pytest.mark.parametrize("name", ["forward philox", "forward lattice", "adjoint lattice, moments"])
def test_limit_kernels_do_our_work(tool, ours, device, name, width):
    assert told(tool, ours, device, name, width) is None


@pytest.mark.parametrize(
    "name, changes, said",
    [
        ("forward philox", {"aperture2": 1.05}, "detects"),
        ("forward lattice", {"of_slope": 0.98, "of_position": 0.98}, "its image is not ours"),
        ("adjoint lattice, moments", {"rim": 0.95}, "meet the mirror"),
        ("adjoint lattice, moments", {"screen_x": 1.001}, "along x"),
    ],
)
def test_other_work_is_found_out(tool, ours, device, name, changes, said):
    assert said in told(tool, ours, device, name, **changes)


def test_ratios_are_within_rounds_to_the_faster_width(tool):
    class Kernel:
        def __init__(self, width):
            self.width = width

    limits = {name: [Kernel(8), Kernel(16)] for name in tool.LIMITS}
    rates = {f"limit {name}, {width} side by side": [8.0 * width, 4.0 * width, 2.0 * width]
             for name in limits for width in (8, 16)}  # fmt: skip
    rates |= {name: [64.0, 32.0, 8.0] for name in tool.OURS}  # the machine's speed changed between the rounds
    rows = tool.table(limits, rates, {"forward": 1.25, "adjoint": 1.5})
    assert rows["limit forward philox"]["side_by_side"] == 16
    assert rows["forward sobol"]["of_limit"] == 0.5 and rows["forward sobol"]["of_limit_lowest"] == 0.25
    assert rows["forward sobol"]["of_limit_on_mirror"] == 0.625 and rows["adjoint sobol"]["of_limit_on_mirror"] == 0.75
    assert np.isclose(rows["forward sobol"]["rays_per_second"], 32.0)
