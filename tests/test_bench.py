"""The benchmark does what it says it times; no time is judged."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl import bench
from irtscots_cl.calibration import calibrate
from irtscots_cl.interface import Fate
from irtscots_cl.presets import load_scene
from irtscots_cl.tracer import ESTIMATORS, TraceOptions, Tracer

ROOT = Path(__file__).parents[1]


@pytest.fixture
def short(monkeypatch):
    """Rounds and times as small as they can be."""
    monkeypatch.setattr(bench, "SECONDS", {True: 0.002, False: 0.002})
    monkeypatch.setattr(bench, "ROUNDS", {True: 2, False: 2})
    monkeypatch.setattr(bench, "FIRST_RAYS", 2**16)


def test_every_feature_is_a_scene_of_its_own(device):
    cases = bench.default_cases(device, quick=False)
    features = [case for case in cases if case.group.startswith("one feature")]
    assert len({(case.scene, case.precision, case.accumulate) for case in features}) == len(features)
    assert {case.sampler for case in cases} == {"philox", "sobol", "lattice"}
    assert {case.scene.name for case in cases} == {"sphere", "sphere-deviated", "off-axis"}
    assert len({(case.group, case.name) for case in cases}) == len(cases)


def test_results_hold_every_case_and_what_they_were_taken_on(device, short, tmp_path):
    results = bench.run_bench(device, quick=True)
    cases = bench.default_cases(device, quick=True)
    assert [row["name"] for row in results["cases"]] == [case.name for case in cases]
    for row in results["cases"]:
        assert 0 < row["lowest"] <= row["rays_per_second"] <= row["highest"]
    plain = next(row for row in results["cases"] if row["name"] == "plain sphere")
    assert plain["of_plain_sphere"] == 1.0
    assert results["multiply_adds_per_second"] > 1e8  # a single slow core does more
    assert results["device"] == device.describe() and results["versions"] and results["git_revision"]
    assert json.loads(json.dumps(results)) == results
    tables = bench.bench_tables(results)
    assert sum(len(table.rows) for table in tables) == len(cases)
    assert all(len(row) == len(table.head) for table in tables for row in table.rows)
    bench.write_plot(results, tmp_path / "bench.png")
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_without_accumulation_rays_fare_alike(device, estimator):
    """The limit's kernel traces the same rays: only where they are stored is left out."""
    calibration, options = calibrate(load_scene("sphere")), TraceOptions(estimator)
    stored, left_out = (
        Tracer(calibration, device, options, accumulate=kind).run(np.array([64])) for kind in ("atomic", "none")
    )
    assert stored[0].sum() > 0 and left_out[0].sum() == 0
    if estimator == "forward":  # an adjoint ray's fate is one of its bins
        known = [Fate.MISSED_MIRROR, Fate.CLIPPED, Fate.OFF_DETECTOR, Fate.DETECTED]
        np.testing.assert_array_equal(stored[1][known], left_out[1][known])
        assert stored[1].sum() == left_out[1].sum() > 0


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_throughput_counts_the_rays_it_launched(device, estimator):
    tracer = Tracer(calibrate(load_scene("sphere")), device, TraceOptions(estimator))
    launched = []
    launch = tracer._launch
    tracer._launch = lambda replicate, first, streams, ray, rays: (
        launched.append((first, streams, rays)) or launch(replicate, first, streams, ray, rays)
    )
    rate = tracer.throughput(2**20)
    ((first, streams, rays),) = launched
    assert rate == pytest.approx(streams * rays / tracer.kernel_seconds, rel=1e-12)  # rounding
    assert first >= 0 and first + streams <= tracer.streams and streams * rays <= 2**20


def test_the_tool_prints_json():
    tool = [sys.executable, "-c", TOOL.format(path=str(ROOT / "tools" / "throughput.py"))]
    done = subprocess.run(tool, capture_output=True, text=True, check=True, cwd=ROOT)
    rows = json.loads(done.stdout)
    assert [(row["scene"], row["estimator"]) for row in rows] == [("sphere", "forward"), ("sphere", "adjoint")]
    assert all(row["rays_per_second"] > 0 for row in rows)


TOOL = """
import runpy, sys
from irtscots_cl import bench
bench.SECONDS, bench.ROUNDS, bench.FIRST_RAYS = {{False: 0.002}}, {{False: 1}}, 2**16
sys.argv = ["throughput.py"]
runpy.run_path({path!r}, run_name="__main__")
"""
