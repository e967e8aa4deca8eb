"""Broken input made by chance: scene files and image files with bytes, tokens, keys, values and structure changed.

A number gives always the same input, so that a failure is found again by its number.
"""

from __future__ import annotations

import random
import re
from functools import cache
from pathlib import Path

import h5py
import numpy as np
from scenes import PUBLISHED

from irtscots_cl.scene.presets import preset_names, preset_text

NUMBERS = [
    "0", "-0.0", "1", "-1", "0.5", "2", "1e-9", "1e3", "1e6", "1e12", "-1e12", "1.0000001e12", "1e-12", "1e-300",
    "5e-324", "1e308", "-1e308", "1e309", "nan", "-nan", "inf", "-inf", "16384", "16385", "4096", "65536",
    "2147483648", "9223372036854775807", "9223372036854775808", "0x7fffffff", "0o17", "0b1", "1_000", "1__0", "00",
    "+1", "1.", ".5", "1e", "9e9999", "9" * 400, "1" + "0" * 5000, "0." + "0" * 400 + "1",
]  # fmt: skip
TEXTS = [
    '""', '"x"', '"../../etc/passwd"', '"/tmp/x"', '"a\\u0000b"', '"\\uD800"', '"{0.__class__}"', '"%s%n"', '"a\\nb"',
    '"-rf"', '".."', '"CON"', '"sphere"', '"lambertian"', '"elements"', '"harvey"', '"refractor"', '"lens"', '"stop"',
    "'''x'''", '"*/ } __kernel void x() {"', '"é漢字🙂"', '"' + "a" * 70 + '"', '"<script>"',
]  # fmt: skip
OTHERS = [
    "true", "[]", "{}", "[1, 2, 3]", "[0.0, 0.0, 0.0]", "[1e12, 1e12, 1e12]", "[0.0, 0.0, 1e-9]", "[[1, 2], 3]",
    "[nan, 0.0, 0.0]", "[16384, 4096]", "[16384, 1024]", "[1, 1]", "[0, 0]", "[-1, 5]", "[2.0, 2.0]", "1979-05-27",
    "1979-05-27T07:32:00Z", "07:32:00", "{ 4 = 1e6 }", "{ 861 = 1.0 }", "{ 862 = 1.0 }", "{ -1 = 1.0 }",
    "{ 1e3 = 2.0 }", "{ x = { y = { z = 1 } } }", "[" * 80 + "]" * 80, "[" * 3000, "{ a = " * 90 + "1" + " }" * 90,
    "[" + "1, " * 5000 + "1]",
]  # fmt: skip
LINES = [
    "[mirror]", "[[mirror]]", "[screen]", "[camera]", "[camera.detector]", "[[element]]", "[[mirror.zernike]]",
    "[mirror.scatter]", "[mirror.zernike]", "[element]", "[]", "[a.b.c.d]", '["\\u0000"]', "[mirror.mirror.mirror]",
    "= 1", "x", "a.b = 1", "mirror = 1", "mirror.conic = 0.1", '"" = 1', '"\\u202e" = 2', "name = 'again'", "\0",
    "# \0", "\ufeff", "\u2028", 'model = "abg"', "a = 1e-3", "b = 1e-6", "g = 2.0", "tis = 0.1", "l = 0.01",
    "s = -1.5", "noll_um = { 4 = 0.1 }", "osa_um = { 0 = 1 }", "fringe_um = { 1602 = 1.0 }", "radius_mm = 532.0",
]  # fmt: skip


@cache
def seeds() -> list[str]:
    """The presets' texts without comments, on small grids: what is slow is no more likely to fail."""
    texts = [re.sub(r" *#.*", "", preset_text(name)) for name in preset_names() if name not in PUBLISHED]
    screen = r"(?s)(\[screen\].*?pixels = )\[.*?\](\npitch_mm = )[0-9.]+"
    detector = r"pixels = \[125, 125\](\npitch_mm = )[0-9.]+"
    return [re.sub(detector, r"pixels = [9, 8]\g<1>0.514", re.sub(screen, r"\1[6, 5]\g<2>0.8", t)) for t in texts]


def scene_file(number: int) -> bytes:
    """The number-th broken scene file: a preset with one to five changes, of lines and values first, then of bytes."""
    chance = random.Random(number)
    lines = chance.choice(seeds()).splitlines()
    for _ in range(chance.choice((0, 1, 1, 1, 2, 2, 3, 5))):
        _change_line(lines, chance)
    data = bytearray("\n".join(lines).encode("utf-8", "surrogatepass"))
    if number % 4 == 0:
        for _ in range(chance.choice((1, 1, 2, 8))):
            _change_bytes(data, chance)
    return bytes(data)


def _change_line(lines: list[str], chance: random.Random) -> None:
    at = chance.randrange(len(lines) + 1)
    kind = chance.randrange(10)
    if kind == 0:
        lines.insert(at, chance.choice(LINES))
    elif kind == 1 and lines:
        del lines[min(at, len(lines) - 1)]
    elif kind == 2 and lines:
        lines.insert(at, chance.choice(lines))
    elif kind == 3 and lines:
        chance.shuffle(lines)
    else:
        where = [k for k, line in enumerate(lines) if " = " in line]
        if where:
            at = chance.choice(where)
            key, value = lines[at].split(" = ", 1)
            lines[at] = f"{_key(key, lines, chance)} = {_value(value, chance)}"


def _key(key: str, lines: list[str], chance: random.Random) -> str:
    if chance.random() > 0.1:
        return key
    others = [line.split(" = ")[0] for line in lines if " = " in line]
    made = [key[:-1], key + "x", key.upper(), f'"{key}\\u0000"', "é", f"{key}.{key}", "9" * 5000]
    return chance.choice([*others, *made])


def _value(value: str, chance: random.Random) -> str:
    kind = chance.randrange(6)
    if kind == 0:
        return chance.choice(OTHERS)
    if kind == 1:
        return chance.choice(TEXTS)
    numbers = list(re.finditer(r"-?\d+\.?\d*(?:e-?\d+)?", value))
    if not numbers:
        return chance.choice(TEXTS + NUMBERS)
    one = chance.choice(numbers)
    if kind == 2:
        new = chance.choice(NUMBERS)
    elif "." in one.group():  # scaled: mostly still a scene
        new = repr(float(one.group()) * chance.choice((-1, 0, 1e-6, 1e-3, 0.1, 0.5, 0.99, 1.01, 2, 10, 1e3, 1e6)))
    else:
        new = str(max(int(one.group()[:9].split("e")[0]) + chance.choice((-9, -1, 1, 3, 30)), -9))
    return value[: one.start()] + new + value[one.end() :]


def _change_bytes(data: bytearray, chance: random.Random) -> None:
    at, kind = chance.randrange(len(data) + 1), chance.randrange(6)
    if kind == 0:
        del data[at : at + chance.choice((1, 1, 5, 50))]
    elif kind == 1:
        data[at:at] = bytes(chance.choices(b"\0\t\n\r\"'=[]{}\x7f\x80\xc0\xed\xff", k=2))
    elif kind == 2:
        data[at:at] = data[: chance.choice((10, 200))]
    elif kind == 3:
        del data[at:]
    elif at < len(data):
        data[at] ^= 1 << chance.randrange(8)


def image_file(number: int, good: bytes, path: Path) -> None:
    """Writes the number-th broken image file: good, an HDF5 file's bytes, with bytes or a dataset changed."""
    chance = random.Random(number)
    data = bytearray(good)
    if number % 3:
        for _ in range(chance.choice((1, 1, 2, 4, 16, 256))):
            at = chance.randrange(min(len(data), chance.choice((64, 4096, len(data)))))
            data[at] = chance.choice((0, 1, 255, data[at] ^ 1 << chance.randrange(8), chance.randrange(256)))
        if chance.random() < 0.1:
            del data[chance.randrange(len(data)) :]
        path.write_bytes(data)
        return
    path.write_bytes(data)
    with h5py.File(path, "r+") as file:
        name = chance.choice(("images/x", "images/y", "lines/x_mm", "lines/y_mm"))
        values = np.array(file[name])
        del file[name]
        _write_changed(file, name, values, chance)


def _write_changed(file: h5py.File, name: str, values: np.ndarray, chance: random.Random) -> None:
    extreme = chance.choice((np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 5e-324, 1e-300))
    some = np.where(np.random.default_rng(chance.randrange(2**32)).random(values.shape) < 0.3, extreme, values)
    kind = chance.randrange(12)
    shape = tuple(chance.choice((0, 1, 2, n, n + 1, n - 1)) for n in values.shape)
    if kind < 4:
        file[name] = some
    elif kind == 4:
        file[name] = np.full_like(values, extreme)
    elif kind == 5:
        file[name] = np.resize(values, shape)
    elif kind == 6:
        shapes = ((1, *values.shape), values.shape[::-1], (-1,), (1, 1, 1, *values.shape))
        file[name] = values.reshape(chance.choice(shapes))
    elif kind == 7:
        with np.errstate(all="ignore"):
            file[name] = values.astype(chance.choice(("i1", "u8", "f2", "f4", ">f8", "c16", "S5", "?")))
    elif kind == 8:
        file.create_dataset(name, chance.choice(((2**40,), (2**14, 2**9, 2**9), (2**60, 1, 1), values.shape)), "f8")
    elif kind == 9:
        links = (h5py.SoftLink("/" + name), h5py.ExternalLink("other.h5", "/x"), h5py.SoftLink("/"))
        file[name] = chance.choice(links)
    elif kind == 10:
        file[name] = values[::-1] * chance.choice((1, 1e-300, 1e300, -1))


def peak_bytes() -> int:
    """The most memory that this program had; 0 where the system does not tell. (getrusage counts its parent's, too.)"""
    status = Path("/proc/self/status")
    found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text("ascii")) if status.exists() else None
    return int(found[1]) * 1024 if found else 0
