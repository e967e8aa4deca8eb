"""All hard cases on all devices: runs them, and gives their findings as plain data and as tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from irtscots_cl.opencl.device import Device
from irtscots_cl.report.tables import Table
from irtscots_cl.stability import conics, counting, curves, edges, invariance, masks, paths, signature, zernike
from irtscots_cl.stability.checks import Bench, Case, Finding
from irtscots_cl.system import interruption
from irtscots_cl.system.versions import versions

_PARTS = (conics, edges, paths, zernike, signature, invariance, counting, masks, curves)
CASES: tuple[Case, ...] = tuple(case for part in _PARTS for case in part.CASES)
HOST = "host"


def benches(devices: list[Device], case: Case) -> Iterator[Bench]:
    """The benches of a case: the host once, or every device in every precision that it has."""
    if case.on_host:
        yield Bench(None, "fp64")
        return
    for device in devices:
        for precision in ("fp32", "fp64") if device.has_fp64 else ("fp32",):
            yield Bench(device, precision)


def run_stability(
    devices: list[Device], long: bool = False, progress: Callable[[int, int], None] | None = None
) -> dict[str, object]:
    """Run the cases, with long also the long ones. progress(done, total) is called after each. Plain data for JSON."""
    started = time.perf_counter()
    jobs = [(case, bench) for case in CASES if long or not case.long for bench in benches(devices, case)]
    rows: list[dict[str, object]] = []
    for done, (case, bench) in enumerate(jobs, 1):
        interruption.check()
        rows += [_row(case, bench, part) for part in case.run(bench)]
        if progress is not None:
            progress(done, len(jobs))
    return {
        "devices": [device.describe() for device in devices],
        "versions": versions(),
        "long": long,
        "seconds": time.perf_counter() - started,
        "cases": len(jobs),
        "checks": len(rows),
        "failed": sum(not row["passed"] for row in rows),
        "results": rows,
    }


def _row(case: Case, bench: Bench, part: Finding) -> dict[str, object]:
    device = bench.device
    return {
        "group": case.group,
        "case": case.name,
        "device": HOST if device is None else device.index,
        "precision": bench.precision,
        "quantity": part.quantity,
        "largest": part.largest,
        "rms": part.rms,
        "samples": part.samples,
        "limit": part.limit.value,
        "unit": part.limit.unit,
        "reason": part.limit.reason,
        "passed": part.passed,
    }


def stability_tables(results: dict) -> list[Table]:
    """The devices, then a table per group: of each case, device and precision the check nearest to its limit."""
    devices = Table(
        "devices",
        ("", ""),
        [(facts["index"], f"{facts['name']} ({facts['platform']}, {facts['driver']})") for facts in results["devices"]],
    )
    groups: dict[str, dict[tuple, list[dict]]] = {}
    for row in results["results"]:
        key = (row["case"], row["device"], row["precision"])
        groups.setdefault(row["group"], {}).setdefault(key, []).append(row)
    head = ("case", "on", "nearest to its limit", "largest", "rms", "limit", "unit", "")
    return [devices] + [Table(name, head, [_shown(max(rows, key=_use)) for rows in of_case.values()])
            for name, of_case in groups.items()]  # fmt: skip


def failure_table(results: dict) -> Table:
    """Every check that failed, with the reason for its limit."""
    head = ("group", "case", "device", "precision", "quantity", "largest", "limit", "unit", "reason of the limit")
    rows = [tuple(f"{row[key]:.3g}" if isinstance(row[key], float) else str(row[key])
                  for key in ("group", "case", "device", "precision", "quantity", "largest", "limit", "unit", "reason"))
            for row in results["results"] if not row["passed"]]  # fmt: skip
    return Table("FAILED", head, rows)


def _use(row: dict) -> float:
    """Share of its limit that a check uses; infinite for a failed one."""
    if not row["passed"]:
        return float("inf")
    return row["largest"] / row["limit"] if row["limit"] else 0.0


def _shown(row: dict) -> tuple[str, ...]:
    numbers = (f"{row[key]:.2g}" if row[key] == row[key] else "-" for key in ("largest", "rms", "limit"))
    passed = "pass" if row["passed"] else "FAIL"
    return (row["case"], f"{row['device']} {row['precision']}", row["quantity"], *numbers, row["unit"], passed)
