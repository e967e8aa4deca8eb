"""Plugin of pytest: processor time of every test, also of the processes that it waits for, as lines "seconds nodeid".

The environment variable CPU_TIMES names a folder; each process of the tests writes a file of its own there.
tools/slow_tests.py uses it.
"""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest


def processor_time() -> float:
    """Of this process and of the children that have ended, in s."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item):
    before = processor_time()
    yield
    with open(Path(os.environ["CPU_TIMES"]) / f"{os.getpid()}.txt", "a", encoding="utf-8") as file:
        file.write(f"{processor_time() - before:.3f} {item.nodeid}\n")
