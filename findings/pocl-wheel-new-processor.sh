#!/usr/bin/env bash
# pyopencl[pocl] of 2026 still installs PoCL 3.0-rc2 with LLVM 14 of 2022. On a processor that this LLVM does not know
# (AMD family 26, Zen 5, for one) the device is listed with all its properties, and no kernel builds: "unknown target
# CPU 'generic'". The options that look as if they named another processor (-march, -mcpu, -target-cpu, also by
# POCL_EXTRA_BUILD_FLAGS) are all refused as INVALID_BUILD_OPTIONS, on known processors too.
#
# pyopencl 2026.1.4, pocl-binary-distribution 3.0, Linux x86-64. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pyopencl[pocl]==2026.1.4" "pocl-binary-distribution==3.0" numpy
cat >"$folder/build.py" <<'PY'
import os
import re
import sys

import pyopencl as cl

os.environ["PYOPENCL_NO_CACHE"] = "1"
device = next(
    d for p in cl.get_platforms() if "3.0-rc2" in p.version for d in p.get_devices()
)
print("platform:", device.platform.version)
assert "PoCL 3.0-rc2" in device.platform.version and "LLVM 14.0.6" in device.platform.version


def build(*options):
    try:
        cl.Program(cl.Context([device]), "__kernel void f(__global int *x) { x[0] = 1; }").build(list(options))
    except cl.Error as error:
        return str(error)
    return "builds"


def cpuinfo(key):
    return int(re.search(rf"^{key}\s*: (\d+)$", open("/proc/cpuinfo").read(), re.M).group(1))


plain = build()
amd = "AuthenticAMD" in open("/proc/cpuinfo").read()
unknown = amd and cpuinfo("cpu family") >= 26
print("processor family", cpuinfo("cpu family"), "- unknown to LLVM 14:", unknown, "-", plain.splitlines()[-1][:60] if plain == "builds" else "does not build")
if unknown:
    assert "unknown target CPU 'generic'" in plain, plain
for option in ("-march=x86-64", "-mcpu=x86-64", "-target-cpu x86-64"):
    found = build(*option.split())
    print(option, "->", "INVALID_BUILD_OPTIONS" if "INVALID_BUILD_OPTIONS" in found else found.splitlines()[0][:80])
    assert "INVALID_BUILD_OPTIONS" in found, found
sys.exit(0)
PY
"$folder/venv/bin/python" "$folder/build.py" && echo "as stated" || { echo "changed"; exit 1; }
