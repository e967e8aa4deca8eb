"""Structures and enums: the same bytes on the host and on the device."""

from __future__ import annotations

import numpy as np
import pytest
from device_kernels import kernel_text
from lopsided import lopsided

from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import LAUNCH, Fate, c_declarations
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.packing.scene import pack

SCENES = {"plain": "sphere", "deviated": "sphere-deviated", "deviated and annular": None}
NAMES = ["Launch", "Emitter", "Receiver", "Frame", "Mirror", "ZernikeTerm", "Zernike", "Scene"]


def structs_of(scene, precision):
    name = SCENES[scene]
    return pack(ChiefRays(load_scene(name) if name else lopsided()), precision).structs


def run(device, tmp_path, structs, precision, signature, body, inputs, out):
    entry = kernel_text(tmp_path / "layout.cl", [], signature, body)
    work = Workspace(device, compose(entry, {}, structs, precision, 1), "layout")
    buffer = work.empty(out.nbytes)
    work.launch((1, 1), [*map(work.upload, inputs), buffer])
    return work.download(buffer, out)


@pytest.mark.parametrize("scene", SCENES)
def test_layout_is_the_devices(device, tmp_path, precision, scene):
    """Sizes and offsets of all structures, by one kernel."""
    structs, lines, expected = structs_of(scene, precision), [], []
    for name in NAMES:
        if name not in structs:
            # a mirror without deviation has no such structure, one of few radial terms no recurrence
            assert (scene == "plain" and name.startswith("Zernike")) or (scene, name) == ("deviated", "ZernikeTerm")
            continue
        dtype = structs[name]
        lines += [f"(int)sizeof({name})"]
        lines += [f"(int)((const char *)&of_{name}.{field} - (const char *)&of_{name})" for field in dtype.names]
        expected += [(name, dtype.itemsize), *((f"{name}.{f}", dtype.fields[f][1]) for f in dtype.names)]
    body = "".join(f"    {name} of_{name};\n" for name in NAMES if name in structs)
    body += "".join(f"    out[{i}] = {line};\n" for i, line in enumerate(lines))
    out = run(device, tmp_path, structs, precision, "__global int *out", body, [], np.zeros(len(lines), np.int32))
    assert [(name, int(found)) for (name, _), found in zip(expected, out, strict=True)] == expected


def leaves(dtype, path=""):
    """C expressions and values' dtypes of all numbers in a structure, in memory order."""
    if dtype.subdtype is not None:
        base, (count,) = dtype.subdtype
        return [leaf for i in range(count) for leaf in leaves(base, f"{path}[{i}]")]
    if dtype.names is None:
        return [(path, dtype)]
    return [leaf for f in dtype.names for leaf in leaves(dtype.fields[f][0], f"{path}.{f}")]


def fill(array, numbers):
    """Give every number of a structure the next of `numbers`, in the order of leaves()."""
    if array.dtype.names is None:
        for index in np.ndindex(array.shape):
            array[index] = next(numbers)
        return
    for index in np.ndindex(array.shape):
        for field in array.dtype.names:
            inner = array[index][field]
            if array.dtype.fields[field][0].base.names is None and np.ndim(inner) == 0:
                array[index][field] = next(numbers)
            else:
                fill(np.atleast_1d(inner), numbers)


def test_every_number_arrives_under_its_name(device, tmp_path, precision):
    """All structures' numbers, by one kernel."""
    structs = structs_of("deviated and annular", precision)
    values, signature, body, count = [], "", "", 0
    for name in NAMES:
        numbers, value = leaves(structs[name]), np.zeros(1, structs[name])
        fill(value, iter(range(3 + count, 3 + count + len(numbers))))
        values.append(value)
        signature += f"__global const {name} *of_{name}, "
        body += "".join(f"    out[{count + i}] = (int)of_{name}[0]{path};\n" for i, (path, _) in enumerate(numbers))
        count += len(numbers)
    out = run(
        device, tmp_path, structs, precision, f"{signature}__global int *out", body, values, np.zeros(count, np.int32)
    )
    np.testing.assert_array_equal(out, np.arange(3, 3 + count))


def test_fates_have_the_hosts_numbers(device, tmp_path):
    body = "".join(f"    out[{fate.value}] = FATE_{fate.name};\n" for fate in Fate)
    body += f"    out[{len(Fate)}] = FATE_COUNT;\n"
    out = run(
        device,
        tmp_path,
        {"Launch": LAUNCH},
        "fp32",
        "__global int *out",
        body,
        [],
        np.zeros(len(Fate) + 1, np.int32),
    )
    np.testing.assert_array_equal(out, np.arange(len(Fate) + 1))


def test_declarations_are_plain_text():
    inner = np.dtype([("a", np.float32), ("n", np.int32, 2)], align=True)
    outer = np.dtype([("first", inner), ("many", inner, 3), ("x", np.float64)], align=True)
    fates, first, second = c_declarations({"Inner": inner, "Outer": outer}).splitlines()
    assert fates.startswith("enum { FATE_DETECTED = 0, FATE_MISSED_MIRROR = 1, ") and "FATE_COUNT = 8" in fates
    assert first == "typedef struct { float a; int n[2]; } Inner;"
    assert second == "typedef struct { Inner first; Inner many[3]; double x; } Outer;"


def test_a_nested_structure_must_come_before_its_owner():
    inner = np.dtype([("a", np.float32)], align=True)
    with pytest.raises(KeyError):
        c_declarations({"Outer": np.dtype([("b", inner)], align=True), "Inner": inner})
