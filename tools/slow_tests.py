#!/usr/bin/env python3
"""Writes tests/slow_tests.txt: the tests that tools/test leaves out, since they take more than LIMIT_S of processor
time each. Runs all tests but those marked slow by hand, in two processes: some minutes.

Processor time hardly depends on what else the machine does. A fixture's time counts for the first test that uses it.

Usage: .venv/bin/python tools/slow_tests.py [FOLDER]    FOLDER: of times that are already measured (cpu_time.py)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "slow_tests.txt"
LIMIT_S = 1.0
HEAD = (
    f"# Tests of more than {LIMIT_S} s of processor time, as tools/slow_tests.py found them; conftest.py marks them.\n"
)


def measured(folder: Path) -> dict[str, float]:
    """Processor time by test."""
    lines = (line.split(" ", 1) for path in folder.glob("*.txt") for line in path.read_text("utf-8").splitlines())
    return {name: float(seconds) for seconds, name in lines}


def main() -> int:
    with tempfile.TemporaryDirectory() as own:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else own)
        if len(sys.argv) == 1:
            LIST.write_text(HEAD, encoding="utf-8")
            # cold caches, as on a fresh machine: most of the time of a kernel's first test is its build
            env: dict[str, str] = {**os.environ, "CPU_TIMES": own, "PYTHONPATH": str(ROOT / "tests" / "support")}
            env |= {"POCL_CACHE_DIR": str(Path(own) / "pocl")}
            Path(env["POCL_CACHE_DIR"]).mkdir()
            command = [sys.executable, "-m", "pytest", "-p", "cpu_time", "-q", "-n", "2", "--dist", "loadfile"]
            subprocess.run(command, cwd=ROOT, env=env, check=False)
        times = measured(folder)
    slow = sorted(name for name, seconds in times.items() if seconds > LIMIT_S)
    LIST.write_text(HEAD + "".join(f"{name}\n" for name in slow), encoding="utf-8")
    rest = sum(seconds for seconds in times.values() if seconds <= LIMIT_S)
    print(f"{LIST}: {len(slow)} of {len(times)} tests; the others take {rest:.0f} s of processor time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
