"""The benchmark does what it says it times; no time is judged."""

from __future__ import annotations

import dataclasses
import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import SEQUENTIAL
from tracers import totals, tracer_of

from irtscots_cl import cli
from irtscots_cl.bench import figures, scaling, suite, tables, throughput
from irtscots_cl.opencl.structs import Fate
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system.atomic_files import plain
from irtscots_cl.tracing.options import ESTIMATORS, TraceOptions
from irtscots_cl.tracing.samplers import SAMPLERS

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def short():
    """Rounds and times as small as they can be."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(throughput, "SECONDS", {True: 0.002, False: 0.002})
        patch.setattr(throughput, "ROUNDS", {True: 2, False: 2})
        patch.setattr(throughput, "WARM_UP_RAYS", 2**16)
        points = tuple(scaling.Point(441 * n, load_scene("sphere"), n) for n in (16, 64))
        patch.setattr(scaling, "default_sweeps", lambda *_: [scaling.Sweep("rays", "rays", "tiny", points)])
        yield


@pytest.fixture(scope="module")
def results(device, short):
    """Of the quick benchmark: every case."""
    return suite.run_bench(device, quick=True)


@pytest.fixture
def few_cases(monkeypatch):
    """What all are compared with: the plain sphere, and rays that are not added up."""
    every = throughput.default_cases

    def few(device, quick):
        return [case for case in every(device, quick) if case.name == "plain sphere" or case.group == "limit"]

    monkeypatch.setattr(throughput, "default_cases", few)


def test_every_feature_is_a_scene_of_its_own(device):
    cases = throughput.default_cases(device, quick=False)
    features = [case for case in cases if case.group.startswith("one feature")]
    assert len({(case.scene, case.estimator, case.precision, case.accumulate) for case in features}) == len(features)
    assert len({(case.group, case.name) for case in cases}) == len(cases)


def test_all_combinations_of_scene_estimator_sampler_and_precision(device):
    cases = throughput.default_cases(device, quick=False)
    found = {(c.scene.name, c.estimator, c.sampler, c.precision) for c in cases if c.group in SCENE_GROUPS}
    precisions = ("fp32", "fp64") if device.has_fp64 else ("fp32",)
    assert found == set(itertools.product(SEQUENTIAL, ESTIMATORS, SAMPLERS, precisions))


SCENE_GROUPS = ("scenes and samplers", "double precision")


@pytest.mark.parametrize("quick", [True, False])
def test_cpus_are_timed_at_every_width(device, quick):
    rows = [case for case in throughput.default_cases(device, quick) if case.group.startswith("rays side by side")]
    assert [case.width for case in rows] == ([1, 8, 16] if device.kind == "cpu" else [])
    assert len({dataclasses.replace(case, name="", width=None) for case in rows}) <= 1  # all else is the same


def test_a_case_is_traced_at_its_width(device, short):
    cases = [throughput.Case("", "", load_scene("sphere"), width=width) for width in (8, 1, None)]
    timings = throughput.time_cases(cases, device, quick=True)
    assert [timing.width for timing in timings] == [8, 1, device.vector_width("fp32")]
    if device.kind == "cpu":  # one ray at a time is slower by 10 or 20: PoCL neither inlines nor vectorises it
        assert timings[1].median < timings[0].median


@pytest.mark.slow
def test_results_hold_every_case_and_what_they_were_taken_on(device, results):
    cases = throughput.default_cases(device, quick=True)
    assert [row["name"] for row in results["cases"]] == [case.name for case in cases]
    for row in results["cases"]:
        assert 0 < row["lowest"] <= row["rays_per_second"] <= row["highest"]
        assert row["warm_up_rays_per_second"] > 0 and row["rays_of_a_round"] > 0
    sphere = next(row for row in results["cases"] if row["name"] == "plain sphere")
    assert sphere["of_plain_sphere"] == 1.0
    assert results["multiply_adds_per_second"] > 1e8  # a single slow core does more
    assert results["device"] == device.describe() and results["device"]["driver"] and results["git_revision"]
    assert results["versions"] and results["rounds"] == 2 and results["warm_up_rays"] == 2**16
    assert results["peak_memory_mib"] > 20  # NumPy and a driver take more
    assert json.loads(json.dumps(plain(results))) == plain(results)


@pytest.mark.slow
def test_tables_and_figure_show_every_case(results, tmp_path):
    results = {name: value for name, value in results.items() if name != "scaling"}  # test_bench_scaling.py has it
    shown = tables.bench_tables(results)
    assert [row[0] for table in shown for row in table.rows] == [row["name"] for row in results["cases"]]
    assert all(len(row) == len(table.head) for table in shown for row in table.rows)
    figures.write_figures(tmp_path, results)
    assert [path.name for path in tmp_path.iterdir()] == ["bench.png"]
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
    (axes,) = figures.rate_figure(results).axes
    assert len(axes.patches) == len(results["cases"])


@pytest.mark.parametrize("quick, asked, made", [(True, False, True), (False, True, True), (False, False, False)])
def test_scaling_is_there_when_asked_for_and_in_the_quick_form(device, monkeypatch, quick, asked, made):
    monkeypatch.setattr(suite, "run_throughput", lambda device, quick: {"cases": []})
    monkeypatch.setattr(suite, "run_scaling", lambda device, quick: {"quick": quick})
    results = suite.run_bench(device, quick, asked)
    assert results.get("scaling") == ({"quick": quick} if made else None)


def test_accuracy_is_there_when_asked_for(device, monkeypatch):
    monkeypatch.setattr(suite, "run_throughput", lambda device, quick: {"cases": []})
    monkeypatch.setattr(suite, "run_accuracy", lambda device, quick: {"quick": quick})
    assert suite.run_bench(device, accuracy=True)["accuracy"] == {"quick": False}
    assert "accuracy" not in suite.run_bench(device)


@pytest.mark.parametrize(
    "arguments, code, said",
    [
        (["--device", "no such device"], 3, "--device = 'no such device'"),
        (["--quik"], 2, "unrecognized arguments: --quik"),
        (["--scaling", "rays"], 2, "unrecognized arguments: rays"),
        (["--out", __file__], 2, "is not a folder"),
    ],
)
def test_bad_options_are_refused_in_one_line(arguments, code, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suite, "run_bench", lambda *_: pytest.fail("went on to measure"))
    try:
        found = cli.main(["bench", *arguments])
    except SystemExit as stop:  # of argparse
        found = stop.code
    error = capsys.readouterr().err
    assert found == code and said in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_command_writes_what_it_prints(device, short, few_cases, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("IRTSCOTS_DEVICE", device.index)
    assert cli.main(["bench", "--quick", "--json", "--out", str(tmp_path / "out")]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((tmp_path / "out" / "bench.json").read_text()) == printed
    assert {"cases", "scaling", "device", "git_revision"} <= printed.keys()
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert written == ["bench.json", "bench.png", "bench_scaling.png"]


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_without_accumulation_rays_fare_alike(device, estimator):
    """The limit's kernel traces the same rays: only where they are stored is left out."""
    scene, options = load_scene("sphere"), TraceOptions(estimator)
    stored, left_out = (
        totals(tracer_of(scene, device, options, accumulate=kind), np.array([64])) for kind in ("atomic", "none")
    )
    assert stored[0].sum() > 0 and left_out[0].sum() == 0
    if estimator == "forward":  # an adjoint ray's fate is one of its bins
        known = [Fate.MISSED_MIRROR, Fate.CLIPPED, Fate.OFF_DETECTOR, Fate.DETECTED]
        np.testing.assert_array_equal(stored[1][known], left_out[1][known])
        assert stored[1].sum() == left_out[1].sum() > 0


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_throughput_counts_the_rays_it_launched(device, estimator):
    tracer = tracer_of(load_scene("sphere"), device, TraceOptions(estimator))
    launched = []
    launch = tracer.launch
    tracer.launch = lambda replicate, part: launched.append(part) or launch(replicate, part)
    rate = tracer.throughput(2**20)
    ((first, sources, _, rays),) = launched
    assert rate == pytest.approx(sources * rays / tracer.kernel_seconds, rel=1e-12)  # rounding
    assert first >= 0 and first + sources <= tracer.sources and sources * rays <= 2**20


def run_tool(*arguments):
    code = TOOL.format(path=str(ROOT / "tools" / "throughput.py"), arguments=list(arguments))
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)


@pytest.mark.needs_device
def test_the_tool_prints_json():
    done = run_tool()
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert [(row["scene"], row["estimator"]) for row in rows] == [("sphere", "forward"), ("sphere", "adjoint")]
    assert all(row["rays_per_second"] > 0 and row["git_revision"] for row in rows)


@pytest.mark.parametrize("arguments", [["--sampler", "halton"], ["no-such-scene"], ["--device", "no such device"]])
def test_the_tool_refuses_in_one_line(arguments):
    done = run_tool(*arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert arguments[-1] in done.stderr and done.stderr.count("\n") == 1


TOOL = """
import runpy, sys
from irtscots_cl.bench import throughput
throughput.SECONDS, throughput.ROUNDS, throughput.WARM_UP_RAYS = {{False: 0.002}}, {{False: 1}}, 2**16
sys.argv = ["throughput.py", *{arguments!r}]
runpy.run_path({path!r}, run_name="__main__")
"""
