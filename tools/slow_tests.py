#!/usr/bin/env python3
"""Writes tests/slow_tests.txt: the tests that tools/test leaves out, since they take more than LIMIT_S of processor
time each. Runs all tests but those marked slow or long by hand, in two processes: some 20 minutes.

Processor time hardly depends on what else the machine does. A fixture's or a kernel's time counts for the first test
that uses it; with that test left out it counts for the next, so the tests run PASSES times.

tests/file_seconds.txt gets the sums over the longest files of the tests that are left: conftest.py runs these first.

Usage: .venv/bin/python tools/slow_tests.py [FOLDER...]    FOLDER: of times that are already measured (cpu_time.py)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "slow_tests.txt"
FILES = ROOT / "tests" / "file_seconds.txt"
LIMIT_S = 0.8
FILE_LIMIT_S = 2.0
PASSES = 2
HEAD = (
    f"# Tests of more than {LIMIT_S} s of processor time, as tools/slow_tests.py found them; conftest.py marks them.\n"
)


def measured(folder: Path) -> dict[str, float]:
    """Processor time by test."""
    lines = (line.split(" ", 1) for path in folder.glob("*.txt") for line in path.read_text("utf-8").splitlines())
    return {name: float(seconds) for seconds, name in lines}


def run_tests(folder: Path) -> None:
    """Run the tests that the list leaves in, their times into the folder."""
    env: dict[str, str] = {**os.environ, "CPU_TIMES": str(folder), "PYTHONPATH": str(ROOT / "tests" / "support")}
    # cold caches, as on a fresh machine: most of the time of a kernel's first test is its build
    env["POCL_CACHE_DIR"] = str(folder / "pocl")
    Path(env["POCL_CACHE_DIR"]).mkdir()
    command = [sys.executable, "-m", "pytest", "-p", "cpu_time", "-q", "-n", "2", "--dist", "loadfile"]
    subprocess.run(command, cwd=ROOT, env=env, check=False)


def write_files(times: dict[str, float]) -> None:
    """The files whose tests take more than FILE_LIMIT_S together, longest first."""
    files: Counter[str] = Counter()
    for name, seconds in times.items():
        files[name.split("::")[0]] += seconds
    lines = [f"{seconds:.0f} {name}\n" for name, seconds in files.most_common() if seconds > FILE_LIMIT_S]
    FILES.write_text("".join(lines), encoding="utf-8")


def main() -> int:
    slow: set[str] = set()
    times: dict[str, float] = {}
    folders = [Path(name) for name in sys.argv[1:]]
    for number in range(len(folders) or PASSES):
        LIST.write_text(HEAD + "".join(f"{name}\n" for name in sorted(slow)), encoding="utf-8")
        if folders:
            times = measured(folders[number])
        else:
            with tempfile.TemporaryDirectory() as own:
                run_tests(Path(own))
                times = measured(Path(own))
        slow |= {name for name, seconds in times.items() if seconds > LIMIT_S}
    LIST.write_text(HEAD + "".join(f"{name}\n" for name in sorted(slow)), encoding="utf-8")
    write_files({name: seconds for name, seconds in times.items() if name not in slow})
    rest = sum(seconds for name, seconds in times.items() if name not in slow)
    print(f"{LIST.relative_to(ROOT)}: {len(slow)} tests; the {len(times.keys() - slow)} others take {rest:.0f} s of "
          "processor time")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
