"""The time that a process has run, from outside and inside."""

from __future__ import annotations

import subprocess
import sys
import time

from irtscots_cl.system.process_time import seconds_of_process

CODE = "import time; time.sleep(0.3)\nfrom irtscots_cl.system.process_time import seconds_of_process as s; print(s())"


def test_the_time_before_the_module_s_import_counts():
    began = time.monotonic()
    told = float(subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True).stdout)
    assert 0.29 <= told <= time.monotonic() - began + 0.02  # 0.01 s: a tick of the system, twice


def test_it_grows_as_time_passes():
    before = seconds_of_process()
    time.sleep(0.05)
    assert 0.04 < seconds_of_process() - before < 5
