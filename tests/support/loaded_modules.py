"""What code imports, in an interpreter of its own."""

from __future__ import annotations

import subprocess
import sys


def loaded_modules(code: str) -> set[str]:
    """Names of the modules that a fresh interpreter has loaded after some code."""
    code += "; import sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())
