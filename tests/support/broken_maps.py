"""Files with maps broken by chance, and what must come of them: a map or one line, and no memory beyond the file's."""

from __future__ import annotations

import tracemalloc

from irtscots_cl.formats.height_map import MapOptions
from irtscots_cl.formats.maps import open_map

NUMBERS = (b"0", b"-1", b"65535", b"99999", b"2147483647", b"-2147483648", b"9999999999999999999", b"1e308", b"nan",
           b"inf", b"-inf", b"1e-320", b"9" * 300, b"0x10", b"1_0", b"")  # fmt: skip
WORDS = (
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\x00\x00\x00\x00",
    b"\x7f\x80\x00\x00",
    b"\xff\xff",
    b"\x00\x00\xc0\x7f",
)
TOLD = MapOptions(unit="nm")


def broken(data, rng):
    """Data cut off, with bytes, numbers or whole pieces changed, as chance has it."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        kind, at = rng.randrange(6), rng.randrange(max(1, len(data)))
        early = rng.randrange(max(1, min(len(data), 900)))  # headers are at the start
        if kind == 0:
            del data[at:]
        elif kind == 1:
            data[early : early + 1] = bytes([rng.randrange(256)])
        elif kind == 2:
            word = rng.choice(WORDS)
            data[early : early + len(word)] = word
        elif kind == 3:
            numbers = [k for k in range(min(len(data), 900)) if data[k : k + 1].isdigit()]
            if numbers:
                first = rng.choice(numbers)
                data[first : first + 1] = rng.choice(NUMBERS)
        elif kind == 4:
            del data[early : early + rng.randrange(1, 40)]
        else:
            data[at:at] = data[early : early + rng.randrange(1, 60)]
    return bytes(data)


def outcome(path, data, told=TOLD):
    """ "read", or the one line that says why not. Anything else is raised; memory is checked, too."""
    path.write_bytes(data)
    tracemalloc.start()
    try:
        open_map(path, told)
        return "read"
    except ValueError as error:
        said = str(error)
        assert said.isprintable() and said.startswith(str(path)) and len(said) < len(str(path)) + 500, said
        return said
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 64 * len(data) + 8e6, f"{peak} bytes for a file of {len(data)}"
