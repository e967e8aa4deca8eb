"""Ctrl-C and SIGTERM as users send them: at any moment, the command ends soon, in one line, with the right code."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import pytest
from synthetic import small_scene

ROOT = Path(__file__).parents[2]
SECONDS = 20.0  # to the end after a signal: on a loaded machine; without load a second or two
FEW = ("--rays-per-pixel", "64", "--replicates", "2", "--quiet")
ENDLESS = ("--rays-per-pixel", str(2**34), "--replicates", "2", "--quiet")

# The child sends itself a signal when it calls a function of the package for the n-th time: MODULE, NAME, CALLS, HOW.
# In a finaliser, HOW is "weakref": the handler runs while Python calls back for a weak reference.
PROGRAM = """
import importlib, os, signal, sys, weakref
from irtscots_cl.__main__ import main

module, name, calls, number, how = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]
del sys.argv[1:6]
owner = importlib.import_module(module)
*path, name = name.split(".")
for part in path:
    owner = getattr(owner, part)
original, seen = getattr(owner, name), [0]

class Thing:
    pass

def back(_):
    os.kill(os.getpid(), number)
    for k in range(1000):  # Python code, so that the handler runs in here
        str(k)

def called(*arguments, **options):
    seen[0] += 1
    if seen[0] == calls:
        print("signal", file=sys.stderr, flush=True)
        if how == "weakref":
            thing = Thing()
            reference = weakref.ref(thing, back)
            del thing
        else:
            os.kill(os.getpid(), number)
    return original(*arguments, **options)

setattr(owner, name, called)
sys.exit(main())
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with mine.toml and big.toml."""
    for name, pixels in (("mine", 21), ("big", 300)):
        (tmp_path / f"{name}.toml").write_text(small_scene("sphere-deviated", pixels).to_toml())
    return tmp_path


def interrupted(folder, where, *arguments, number=signal.SIGTERM, calls=1, how="plain"):
    """(exit code, lines of stderr after the signal, seconds from the signal to the end)."""
    command = [sys.executable, "-c", PROGRAM, *where, str(calls), str(int(number)), how, *arguments]
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                             env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    try:
        assert child.stderr.readline() == "signal\n"
        started = time.monotonic()
        killer = threading.Timer(60, child.kill)
        killer.start()
        lines = child.stderr.read().splitlines()
        child.wait()
        killer.cancel()
    finally:
        child.kill()
        child.wait()
        child.stderr.close()
    return child.returncode, lines, time.monotonic() - started


def assert_ended(outcome, code, line):
    found, lines, seconds = outcome
    assert (found, len(lines)) == (code, 1) and lines[0].startswith(f"irtscots: interrupted{line}"), outcome
    assert seconds < SECONDS


RESULT = ("irtscots_cl.report.result_file", "_write")
REVERSE = ("irtscots_cl.optics.chief_rays", "ChiefRays.reverse")
LAUNCH = ("irtscots_cl.execution.device_tracer", "DeviceTracer.launch")


@pytest.mark.parametrize(
    ("where", "calls", "left"),
    [
        (("irtscots_cl.cli.run", "visible_setup"), 1, []),
        (REVERSE, 2, []),
        (("irtscots_cl.execution.device_tracer", "DeviceTracer.__init__"), 1, []),
        (("irtscots_cl.execution.device_tracer", "DeviceTracer.launch"), 2, None),
        (("irtscots_cl.measurement.surface_heights", "integrate"), 1, []),
        (("irtscots_cl.pipeline.simulate", "compare"), 1, []),
        (RESULT, 3, ["figures"]),
        (("irtscots_cl.report.figures", "height_figure"), 1, ["figures", "result.h5"]),
    ],
    ids=lambda value: value[1] if isinstance(value, tuple) else "",
)
@pytest.mark.parametrize("how", ["plain", "weakref"])
@pytest.mark.needs_device
def test_a_run_ends_wherever_the_signal_comes(folder, where, calls, left, how):
    outcome = interrupted(folder, where, "run", "mine.toml", "--out", "out", *FEW, calls=calls, how=how)
    if left is None:  # there are rays to go on from
        assert_ended(outcome, 4, " after ")
        assert os.listdir(folder / "out") == ["checkpoint"]
        return
    assert_ended(outcome, 130, "; out: not all files were written" if left else "; nothing was written")
    assert sorted(os.listdir(folder / "out") if left else []) == left
    assert left or not (folder / "out").exists()
    if "result.h5" in left:  # whole, or not there
        with h5py.File(folder / "out" / "result.h5") as file:
            assert "height_standard_error_nm" in file


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=str)
@pytest.mark.needs_device
def test_a_long_trace_ends_with_its_sums_saved(folder, number):
    arguments = ("run", "mine.toml", "--out", "out", *ENDLESS)
    assert_ended(interrupted(folder, LAUNCH, *arguments, number=number, calls=5), 4, " after ")
    assert os.listdir(folder / "out") == ["checkpoint"]


@pytest.mark.parametrize(
    ("command", "where", "calls"),
    [
        (("paths", "ghosts", *ENDLESS), LAUNCH, 4),
        (("run", "mine.toml", "--target-nm", "0.2", "--quiet"), LAUNCH, 4),
        (("run", "big.toml", "--estimator", "analytic", "--measure", "refined"), REVERSE, 9),
        (("stability", "--quiet"), ("irtscots_cl.opencl.kernel", "Workspace.launch"), 5),
        (("bench", "--quick"), ("irtscots_cl.execution.device_tracer", "DeviceTracer.throughput"), 1),
        (("reproduce", "table4", "--quick", "--quiet"), LAUNCH, 4),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
@pytest.mark.needs_device
def test_other_commands_end_too(folder, command, where, calls):
    outcome = interrupted(folder, where, *command, calls=calls)
    assert outcome[0] in (4, 130), outcome
    assert len(outcome[1]) == 1 and outcome[1][0].startswith("irtscots: interrupted"), outcome
    assert outcome[2] < SECONDS


@pytest.mark.needs_device
def test_measuring_from_images_ends(folder):
    done = subprocess.run([sys.executable, "-m", "irtscots_cl", "run", "mine.toml", "--out", "images", *FEW],
                          cwd=folder, capture_output=True, timeout=120, check=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    assert done.stderr == b""
    arguments = ("reconstruct", "images/result.h5", "--scene", "mine.toml", "--out", "out", "--measure", "refined")
    for where, calls in ((REVERSE, 1), (("irtscots_cl.measurement.refinement", "_round"), 2)):
        assert_ended(interrupted(folder, where, *arguments, calls=calls), 130, "; nothing was written")
        assert not (folder / "out").exists()
    assert_ended(interrupted(folder, RESULT, *arguments, calls=2), 130, "; out: not all files were written")
    assert "result.h5" not in os.listdir(folder / "out")


def test_a_signal_before_the_command_begins(folder):
    where = ("irtscots_cl.cli", "_parser")
    assert_ended(interrupted(folder, where, "run", "mine.toml", "--out", "out"), 130, "; nothing was written")
    assert not (folder / "out").exists()


@pytest.mark.needs_device
def test_a_signal_after_the_last_file_changes_nothing(folder):
    where = ("irtscots_cl.cli.run", "print_tables")
    code, lines, _ = interrupted(folder, where, "run", "mine.toml", "--out", "out", *FEW)
    assert (code, lines) == (0, []) and "report.json" in os.listdir(folder / "out")
