"""tools/compare_peers.py: every peer that is installed does our work, and one that does not is found out."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

TOOLS = Path(__file__).parents[2] / "tools"
RAYS = 1024  # per screen pixel


@pytest.fixture(scope="module")
def tool():
    """The tool as a module; its folder is on the path only here."""
    sys.path.insert(0, str(TOOLS))
    yield importlib.import_module("compare_peers")
    sys.path.remove(str(TOOLS))


@pytest.fixture(scope="module")
def ours(device):
    return trace(load_scene("sphere"), device=device, estimator="forward", rays_per_pixel=16 * RAYS, replicates=1)


@pytest.mark.parametrize(
    "name, package",
    [
        ("NumPy float64", "numpy"),
        *(
            pytest.param(f"Numba {words} {real}", "numba", marks=pytest.mark.slow)  # compiles for 5 s
            for real in ("float32", "float64")
            for words in ("hash", "philox", "lattice")
        ),
        ("Dr.Jit LLVM float32", "drjit"),
        ("Mitsuba 3 ray casting", "mitsuba"),
        ("batoid, NumPy emission", "batoid"),
    ],
)
def test_peer_does_the_same_work(tool, ours, name, package):
    pytest.importorskip(package)
    module, function, _ = tool.PEERS[name]
    given = tool.job()
    image = getattr(importlib.import_module(f"peers.{module}"), function)(RAYS, 7, given)
    assert image.shape == (125, 125) and image.sum() > 0
    # two tests, each failing a correct peer with a chance of 6e-7
    assert tool.difference(image, RAYS * len(given["sources"]), tool.our_image(ours), ours.rays_total) is None


def made_images(fraction=0.044, rays=10**6):
    """Counts of two runs of the same job with that many rays: a disk that is brighter at one side."""
    y, x = np.mgrid[-1:1:125j, -1:1:125j]
    light = np.where(x * x + y * y < 1, 1 + 0.1 * x, 0)
    light *= fraction * rays / light.sum()
    random = np.random.default_rng(3)
    return random.poisson(light), random.poisson(10 * light), rays


@pytest.mark.parametrize(
    "spoil, said",
    [
        (lambda image: image, None),
        (lambda image: image + (image > 0) * (np.arange(125) % 5 == 0), "detects"),  # 5 % more, 10 sigma
        (lambda image: image[:, ::-1], "its image is not ours"),
        (lambda image: np.roll(image, 5, 0), "its image is not ours"),
        (lambda image: np.zeros_like(image), "detects"),
    ],
)
def test_other_work_is_found_out(tool, spoil, said):
    theirs, ours, rays = made_images()
    told = tool.difference(spoil(theirs), rays, ours, 10 * rays)
    assert told is None if said is None else said in told


def test_peers_without_a_row_get_a_line(tool, ours, monkeypatch, capsys):
    monkeypatch.setattr(tool, "CHECKED_RAYS", 64)
    monkeypatch.setattr(
        tool,
        "PEERS",
        {
            "good": ("numpy_peer", "peer", 64),
            "missing": ("no_such_peer", "peer", 64),
            "broken": ("made_peers", "broken", 64),
            "other": ("made_peers", "other", 64),
        },
    )
    monkeypatch.setitem(sys.modules, "peers.made_peers", MadePeers)
    found = tool.usable_peers(tool.job(), ours)
    lines = capsys.readouterr().out.splitlines()
    assert list(found) == ["good"] and len(lines) == 4
    assert "not installed" in lines[1] and "does not run here (no library)" in lines[2]
    assert "not the same work: no row" in lines[3]


class MadePeers:
    @staticmethod
    def broken(of_pixel, seed, given):
        raise RuntimeError("no library\nand more")

    @staticmethod
    def other(of_pixel, seed, given):
        return np.ones((125, 125), np.int64)


def test_rates_are_of_all_in_turn(tool, device, monkeypatch):
    monkeypatch.setattr(tool, "ROUNDS", 2)
    monkeypatch.setattr(tool, "RAYS", 256)
    monkeypatch.setattr(tool, "CHECKED_RAYS", 64)
    tracers, calls = tool.our_tracers(device), []
    peers = {"p": (lambda of_pixel, seed, given: calls.append((of_pixel, seed)), 64)}
    rates = tool.time_all(tracers, peers, tool.job())
    assert list(rates) == [*tracers, "p"] and calls == [(64, 0), (64, 1)]
    assert all(len(r) == 2 and min(r) > 0 for r in rates.values())


def test_numba_is_compared_by_random_numbers_and_by_each_ones_best(tool):
    rates = {"irtscots-cl philox": [2.0, 4.0, 3.0], "irtscots-cl lattice": [6.0, 6.0, 6.0], "NumPy float64": [9.0] * 3,
             "Numba philox float32": [1.0, 2.0, 1.0], "Numba hash float32": [2.0, 3.0, 4.0]}  # fmt: skip
    assert tool.against_numba(rates) == {"each its best float32": 2.0, "philox float32": 2.0}
    assert tool.against_numba({"irtscots-cl philox": [1.0]}) == {}
