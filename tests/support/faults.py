"""Faults of devices and drivers, for tests of what becomes of them."""

from __future__ import annotations

import math

import pyopencl as cl

# From cl.h. The first three say that memory is short.
CODES = {
    "MEM_OBJECT_ALLOCATION_FAILURE": -4,
    "OUT_OF_RESOURCES": -5,
    "OUT_OF_HOST_MEMORY": -6,
    "DEVICE_NOT_AVAILABLE": -2,
    "EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST": -14,
    "INVALID_COMMAND_QUEUE": -36,
    "INVALID_BUFFER_SIZE": -61,
}
SHORT_OF_MEMORY = tuple(CODES)[:3]


def driver_error(name: str, call: str = "clSomething") -> cl.Error:
    """What PyOpenCL raises when a driver reports that code: its text has a second line, as some have."""
    kind = cl.MemoryError if name in SHORT_OF_MEMORY else cl.RuntimeError
    return kind(cl._cl._ErrorRecord(call, CODES[name], "more\non a second line"))


class FaultyKernel:
    """Stands for cl.Kernel: refuses launches of more than most_items work-items, and all after the first `good` ones.

    starting: fails when it is started, else while it runs. tried: (offset, size) of every launch that was asked for.
    """

    def __init__(self, name: str, most_items: float = math.inf, good: float = math.inf, starting: bool = True):
        self.name, self.most_items, self.good, self.starting = name, most_items, good, starting
        self.tried: list[tuple[tuple[int, int], tuple[int, int]]] = []
        self._make = cl.Kernel

    def __call__(self, program, name):
        kernel = self._make(program, name)

        def launch(queue, grid, group, *arguments, global_offset=(0, 0)):
            self.tried.append((global_offset, grid))
            bad = math.prod(grid) > self.most_items or len(self.tried) > self.good
            if bad and self.starting:
                raise driver_error(self.name, "clEnqueueNDRangeKernel")
            event = kernel(queue, grid, group, *arguments, global_offset=global_offset)
            return _BrokenEvent(event, self.name) if bad else event

        return launch


class _BrokenEvent:
    def __init__(self, event: cl.Event, name: str):
        self._event, self._name = event, name

    def wait(self) -> None:
        self._event.wait()
        raise driver_error(self._name, "clWaitForEvents")
