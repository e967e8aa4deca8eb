"""Long commands as their users meet them: interrupted, gone on with, two at a time, limited in time, watched."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.cli.keeping import keeping
from irtscots_cl.cli.progress import Progress
from irtscots_cl.execution import checkpoint
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.pipeline.simulate import outlook
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.trace import trace

ROOT = Path(__file__).parents[2]
RUN = ("--rays-per-pixel", "600", "--replicates", "3")


@pytest.fixture
def irtscots(irtscots, tmp_path, monkeypatch):
    """As in conftest.py, in an empty folder with mine.toml."""
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(small_scene("sphere-deviated", 21).to_toml())
    # figures take most of such a run's time
    monkeypatch.setattr("irtscots_cl.report.figures.write_figures", lambda *_: [])
    return irtscots


@pytest.fixture
def small_launches(monkeypatch, device):
    monkeypatch.setattr("irtscots_cl.execution.run_loop._launch_size", lambda *_: lambda: 2**14)


@pytest.fixture
def after_launches(monkeypatch, small_launches):
    """after_launches(n, act): act() once, after the n-th launch from now."""

    def set_up(n, act):
        calls = []

        def called(self, done, total):
            calls.append(done)
            if len(calls) == n:
                act()

        monkeypatch.setattr(Progress, "__call__", called)

    return set_up


def numbers(folder):
    """What a run found, without times."""
    with h5py.File(folder / "result.h5") as file:
        found = {name: file[name][()].tobytes() for name in ("images/x", "images/y", "height_mm", "slope/x_rad")}
    return found | {"ledger": json.loads((folder / "report.json").read_text())["ledger"]}


def refused(outcome, *words, code=2):
    found, out, err = outcome
    assert (found, out) == (code, "") and err.startswith("irtscots: ") and err.count("\n") == 1
    assert all(word in err for word in words), err


@pytest.mark.parametrize(
    ("number", "way"),
    [(signal.SIGINT, ()), (signal.SIGTERM, ("--smoothing",)), (signal.SIGTERM, ("--estimator", "nonsequential"))],
    ids=str,
)
def test_a_signal_saves_and_resume_goes_on_to_the_same_result(irtscots, after_launches, tmp_path, number, way):
    arguments = ("run", "./mine.toml", *RUN, *way)
    after_launches(0, None)
    assert irtscots(*arguments, "--out", "whole")[0] == 0
    for launches in (2, 3, 4):
        after_launches(launches, lambda: os.kill(os.getpid(), number))
        outcome = irtscots(*arguments, "--out", "cut", "--resume")
        command = shlex.join(["irtscots", *arguments, "--out", "cut", "--resume"])
        words = f"% of the rays; continue with --resume, from cut/checkpoint: {command}\n"
        refused(outcome, "interrupted after", words, code=4)
        assert os.listdir("cut") == ["checkpoint"]
    after_launches(0, None)
    assert irtscots(*arguments, "--out", "cut", "--resume")[0] == 0
    assert numbers(tmp_path / "cut") == numbers(tmp_path / "whole")
    assert "checkpoint" not in os.listdir("cut") and ".lock" not in os.listdir("cut")


def test_handlers_are_put_back(irtscots, after_launches):
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    after_launches(2, lambda: os.kill(os.getpid(), signal.SIGTERM))
    outcome = irtscots("run", "./mine.toml", *RUN, "--out", "cut")
    refused(outcome, f": {shlex.join(['irtscots', 'run', './mine.toml', *RUN, '--out', 'cut'])} --resume\n", code=4)
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before


@pytest.mark.needs_device
def test_an_interrupt_before_the_first_ray_leaves_nothing(irtscots, monkeypatch):
    def trace_not(*_, **__):
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("irtscots_cl.pipeline.simulate.trace", trace_not)
    refused(irtscots("run", "./mine.toml", "--out", "a/b"), "interrupted; nothing was written", code=130)
    assert not Path("a").exists()


def test_an_interrupt_after_the_last_ray_keeps_what_was_saved(irtscots, monkeypatch, small_launches):
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr("irtscots_cl.pipeline.output.write_result", lambda *_: os.kill(os.getpid(), signal.SIGINT))
        refused(irtscots("run", "./mine.toml", *RUN, "--out", "cut"), "interrupted; continue with --resume", code=4)
    launched = []
    launch = "irtscots_cl.execution.device_tracer.DeviceTracer.launch"
    monkeypatch.setattr(launch, lambda *given: launched.append(given))
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut", "--resume")[0] == 0
    assert [part[3] for _, _, part in launched] == [0]  # that of no rays, when the tracer is made


def test_a_run_whose_device_is_lost_goes_on(irtscots, monkeypatch, after_launches, tmp_path):
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)

    def lose():
        raise DeviceError("device 0:0: lost")

    after_launches(0, None)
    assert irtscots("run", "./mine.toml", *RUN, "--out", "whole")[0] == 0
    after_launches(3, lose)
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut") == (3, "", "irtscots: device 0:0: lost\n")
    after_launches(0, None)
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut", "--resume")[0] == 0
    assert numbers(tmp_path / "cut") == numbers(tmp_path / "whole")


def test_an_interrupted_run_is_neither_written_over_nor_mixed_up(irtscots, after_launches, tmp_path):
    after_launches(2, lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut")[0] == 4
    kept = Path("cut/checkpoint").read_bytes()
    again = ("run", "./mine.toml", "--out", "cut")
    refused(irtscots(*again, *RUN), "cut/checkpoint: left by an interrupted run", "--resume")
    for options, words in (
        (("--seed", "2"), "seed = 1, here 2"),
        (("--sampler", "sobol"), "sampler = philox, here sobol"),
        (("--rays-per-pixel", "601"), "rays_per_pixel = 600, here 601"),
        (("--replicates", "4"), "replicates = 3, here 4"),
        (("--estimator", "forward"), "estimator = adjoint, here forward"),
        (("--smoothing",), "smoothing = False, here True"),
    ):
        refused(irtscots(*again, *RUN, *options, "--resume"), "cut/checkpoint: of another run: ", words)
    Path("other.toml").write_text(small_scene("sphere", 21).to_toml())
    refused(irtscots(*again, "--estimator", "analytic", "--resume"), "cut/checkpoint: of a run that traces rays")
    refused(irtscots("run", "./other.toml", *RUN, "--out", "cut", "--resume"), "of another run: other scene")
    assert Path("cut/checkpoint").read_bytes() == kept
    Path("cut/checkpoint").write_bytes(kept[:-1])
    refused(irtscots(*again, *RUN, "--resume"), "cut/checkpoint: damaged, or not a checkpoint")
    Path("cut/checkpoint").unlink()
    after_launches(0, None)
    assert irtscots(*again, *RUN, "--resume")[0] == 0  # from the beginning


def test_a_checkpoint_of_another_device_or_version_is_refused(irtscots, after_launches, monkeypatch):
    after_launches(2, lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut")[0] == 4
    resume = ("run", "./mine.toml", *RUN, "--out", "cut", "--resume")
    for name, value in (("driver", "8.0"), ("device", "GPU"), ("version", "99")):
        with monkeypatch.context() as patch:
            changed = {name: value}
            patch.setattr(
                "irtscots_cl.tracing.trace.trace_fingerprint", lambda *of, to=changed: trace_fingerprint(*of) | to
            )
            refused(irtscots(*resume), f"of another run: {name} = ", f"here {value}")
    with monkeypatch.context() as patch:
        patch.setattr("irtscots_cl.opencl.program.Source.digest", "0" * 32)
        refused(irtscots(*resume), "of another run: other code")


# --- the folder, limits ------------------------------------------------------------------------------------


def test_two_processes_never_have_one_folder(irtscots):
    with keeping(Path("out"), "checkpoint", False):
        refused(irtscots("run", "./mine.toml", *RUN, "--out", "out"), "--out = 'out': in use by another process")
        assert os.listdir("out") == [".lock"]
    assert not Path("out").exists()


def test_a_lock_dies_with_its_process(irtscots, tmp_path):
    program = (
        "import os, signal\nfrom pathlib import Path\nfrom irtscots_cl.cli.keeping import _locked\n"
        "with _locked(Path('out')):\n    print('locked', flush=True)\n    os.kill(os.getpid(), signal.SIGSTOP)\n"
    )
    Path("out").mkdir()
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                             env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    assert child.stdout.readline() == "locked\n"
    refused(irtscots("run", "./mine.toml", *RUN, "--out", "out"), "in use by another process")
    child.kill()
    child.wait()
    child.stdout.close()
    with keeping(Path("out"), "checkpoint", False):
        pass
    assert os.listdir("out") == []


def test_max_seconds(irtscots, small_launches):
    outcome = irtscots("run", "./mine.toml", *RUN, "--out", "cut", "--max-seconds", "1e-6")
    refused(outcome, "--max-seconds 1e-06: stopped after", "continue with --resume", code=4)
    assert irtscots("run", "./mine.toml", *RUN, "--out", "cut", "--max-seconds", "1e3", "--resume")[0] == 0
    for value in ("0", "-1", "nan", "inf"):
        refused(irtscots("run", "./mine.toml", "--max-seconds", value), "--max-seconds = ", "above 0 and finite")


@pytest.mark.parametrize("option", [("--resume",), ("--max-seconds", "5")])
def test_a_target_is_not_gone_on_with(irtscots, option):
    refused(irtscots("run", "./mine.toml", "--target-nm", "5", *option), f"{option[0]}: must be left out with --target")


def test_a_folder_that_cannot_be_made_is_refused_in_one_line(irtscots):
    refused(irtscots("run", "./mine.toml", *RUN, "--out", "/proc/none"), "/proc/none")


@pytest.mark.slow
def test_a_study_is_gone_on_with(irtscots, monkeypatch):
    """Its finished traces are not repeated; its results are those of an undisturbed one."""
    monkeypatch.setattr("irtscots_cl.studies.fig4.RUNS", 2)  # first: it is imported here, with the true number
    monkeypatch.setattr("irtscots_cl.studies.traces.PAPER_RAYS", (400, 900, 1600))
    monkeypatch.setattr("irtscots_cl.studies.traces.RUNS", 2)
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)
    monkeypatch.setattr("irtscots_cl.execution.run_loop._launch_size", lambda *_: lambda: 2**20)
    traced = []

    def stop(self, done, total):
        traced.append((done, total))
        if len({total for _, total in traced}) == 2 and done > total / 2 and stop.armed:
            os.kill(os.getpid(), signal.SIGTERM)
            stop.armed = False

    monkeypatch.setattr(Progress, "__call__", stop)
    stop.armed = False
    arguments = ("reproduce", "fig4", "--quick", "--json")
    code, whole, _ = irtscots(*arguments, "--out", "whole")
    assert code == 0 and len({total for _, total in traced}) == 2
    assert "checkpoints" not in os.listdir("whole")
    traced.clear()
    stop.armed = True
    refused(irtscots(*arguments, "--out", "cut"), "continue with --resume, from cut/checkpoints", code=4)
    assert len(os.listdir("cut/checkpoints")) == 2
    refused(irtscots(*arguments, "--out", "cut"), "cut/checkpoints: left by an interrupted run")
    first = max(traced)[1]
    traced.clear()
    code, again, _ = irtscots(*arguments, "--out", "cut", "--resume")
    assert code == 0 and os.listdir("cut") == os.listdir("whole")
    assert [done for done, total in traced if total < first] in ([], [min(total for _, total in traced)])
    rows = [json.loads(text)["studies"][0]["rows"] for text in (whole, again)]
    assert rows[0] == rows[1]


@pytest.mark.slow
def test_sigterm_from_outside_reaches_the_shell(tmp_path):
    def start(*more):
        return subprocess.Popen([sys.executable, "-m", "irtscots_cl", "run", "sphere", "--rays-per-pixel", str(2**24),
                                 "--out", "out", *more], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip

    for more in ((), ("--resume", "--quiet")):
        child = start(*more)
        time.sleep(8)
        child.send_signal(signal.SIGTERM)
        out, err = child.communicate(timeout=30)
        assert (child.returncode, out) == (4, "")
        assert err.splitlines()[-1].startswith("irtscots: interrupted after ")
    assert err.count("\n") == 1


# --- progress ----------------------------------------------------------------------------------------------


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("irtscots_cl.cli.progress.time.monotonic", lambda: now[0])
    return now


def test_lines_every_ten_seconds(capsys, clock):
    with Progress() as progress:
        for second in range(31):
            clock[0] = 100.0 + second
            progress(2_000_000 + second * 1_000_000, 100_000_000)  # two million in an earlier process
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "tracing: 12%, 12M of 100M rays, 1M rays/s, 1:28 left",
        "tracing: 22%, 22M of 100M rays, 1M rays/s, 1:18 left",
        "tracing: 32%, 32M of 100M rays, 1M rays/s, 1:08 left",
    ]


def test_a_second_trace_has_its_own_speed(capsys, clock):
    with Progress("snr") as progress:
        progress(0, 1000)
        clock[0] += 5
        progress(1000, 1000)
        progress(0, 4_000_000)
        clock[0] += 10
        progress(20_000, 4_000_000)
    assert capsys.readouterr().err == "snr: 0%, 20k of 4M rays, 2k rays/s, 33:10 left\n"


def test_a_line_tells_of_long_work_that_cannot_say_how_far_it_is(capsys, monkeypatch):
    monkeypatch.setattr("irtscots_cl.cli.progress.STAGE_SECONDS", 0.05)
    with Progress() as progress:
        progress.stage("measuring")
        threading.Event().wait(0.3)
        progress.stage("soon over")
    with Progress(quiet=True) as progress:
        progress.stage("quiet")
        threading.Event().wait(0.1)
    assert capsys.readouterr().err == "measuring ...\n"


def test_quiet_says_nothing(capsys, clock):
    with Progress(quiet=True, estimate=lambda _: pytest.fail("nobody would see it")) as progress:
        for second in range(1000):
            clock[0] += 1
            progress(second, 1000)
            progress.finished(None)
    assert capsys.readouterr() == ("", "")


def test_the_error_is_estimated_seldom(capsys, clock):
    asked = []

    def estimate(result):
        asked.append((result, clock[0]))
        clock[0] += 2.0
        return f"error {result}"

    with Progress(estimate=estimate) as progress:
        for second in range(600):
            clock[0] += 1
            progress.finished(second)
            progress(second, 600)
    assert [round(at) for _, at in asked] == [160, 262, 364, 466, 568, 670]  # 50 times the 2 s apart
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].endswith("left, error 559") and "error" not in lines[0]


def test_a_terminal_gets_a_bar(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Progress(estimate=lambda _: "height error 3 nm") as progress:
        progress._next_estimate = 0.0
        progress(10, 1000)
        progress.finished(None)
        time.sleep(0.01)
        progress(500, 1000)
        assert "500 of 1k rays" in progress._bar.tasks[0].fields["facts"]
        assert progress._bar.tasks[0].fields["facts"].endswith("height error 3 nm")
    assert "tracing" in capsys.readouterr().err


def test_outlook_of_a_trace(device):
    run = trace(small_scene("sphere-deviated", 41), device=device, rays_per_pixel=512, replicates=4)
    words, result = outlook(run, "refined")
    assert result.mask.sum() > 100
    share, height = (float(part.split()[-1 - part.endswith("nm")]) for part in words.split(", "))
    flux_w = np.array([run.flux_w(k).sum() for k in range(4)])
    assert share == pytest.approx(flux_w.std(ddof=1) / 2 / flux_w.mean(), rel=0.5)  # one digit is told
    assert 1 < height < 1000
    assert outlook(trace(run.scene, device=device, rays_per_pixel=8, replicates=1), "paper") == ("", None)
