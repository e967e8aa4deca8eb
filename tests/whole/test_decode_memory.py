"""Peak memory of decoding camera files, by tools/decode_memory.py in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[2] / "tools" / "decode_memory.py"


def decoded(*options):
    run = subprocess.run([sys.executable, TOOL, *options], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--calibrated",)])
def test_64_frames_of_5_megapixels_are_decoded_in_3_gib(options):
    """All frames at once would be 0.6 GiB as 16 bits, 2.4 GiB as float64, before anything is made of them."""
    found = decoded(*options)
    assert (found["frames"], found["pixels"]) == (64, [2448, 2048]) and found["lit"] > 3e6
    assert found["peak_gib"] < 3
    assert found["largest_error"] < 2e-4  # of the screen: 6 sigma at 31.9 periods


def test_memory_grows_with_pixels_far_less_than_all_frames_do():
    """320 x 256 pixels, 64 frames: the same code in a second."""
    found = decoded("--pixels", "320", "256", "--calibrated")
    assert found["frames"] == 64 and found["largest_error"] < 2e-4
    assert found["peak_gib"] - found["before_gib"] < 0.5
