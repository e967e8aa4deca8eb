"""The executor of what a caller gives: devices, or a Dask client."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from irtscots_cl.execution.dask.cluster import DaskExecutor
from irtscots_cl.execution.executor import Executor
from irtscots_cl.execution.local import LocalExecutor
from irtscots_cl.opencl.device import Device, select_devices


def executor_of(device: Device | Sequence[Device] | None, client: Any = None) -> Executor:
    """Where to trace: the workers of a distributed.Client or of a Cluster, these devices, or those selected."""
    if client is not None:
        if device is not None:
            raise ValueError("device: must be left out with a client; its workers choose theirs by IRTSCOTS_DEVICE")
        return client if isinstance(client, DaskExecutor) else DaskExecutor(client)
    if device is None:
        return LocalExecutor(select_devices())
    return LocalExecutor([device] if isinstance(device, Device) else device)
