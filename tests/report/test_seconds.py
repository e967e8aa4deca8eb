"""The seconds of a run: its parts add up to its total."""

from __future__ import annotations

from irtscots_cl.report.seconds import PARTS, seconds_of, with_parts


def test_parts_add_up_and_kernels_are_within_the_trace():
    trace = {"build": 1.0, "trace": 4.0, "kernels": 3.0}
    seconds = with_parts(seconds_of(trace, 7.0, reconstruct=8.0, predict=16.0), start=0.5, store=32.0, figures=64.0)
    assert seconds == {
        "start": 0.5, "prepare": 2.0, "build": 1.0, "trace": 4.0, "kernels": 3.0, "reconstruct": 8.0, "predict": 16.0,
        "store": 32.0, "figures": 64.0, "total": 127.5,
    }  # fmt: skip
    assert [name for name in seconds if name in PARTS] == list(PARTS[:-1])


def test_the_trace_of_an_earlier_process_counts():
    seconds = seconds_of({"build": 1.0, "trace": 400.0, "kernels": 3.0}, 7.0, reconstruct=8.0, predict=0.0)
    assert seconds["prepare"] == 0.0 and seconds["total"] == 409.0
