#!/usr/bin/env bash
# tifffile reads a multi-page TIFF that was cut off while it was copied or recorded as a shorter stack: imread returns
# the pages that are left, with no exception and no warning, only a line by logging. A strip whose byte count is 0 is
# read as zeros, and the strips after it come out one place late, the last one lost: FileHandle.read_segments takes the
# strips for contiguous (its check passes over the empty one) and reads on where the empty one's bytes would be. A
# recording that lost frames or rows looks like a whole one. imageio and scikit-image read TIFF through tifffile.
#
# To be safe: follow the chain of directories oneself and compare its length with len(TiffFile.pages); check that every
# strip has bytes inside the file.
#
# tifffile 2026.3.3. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "tifffile==2026.3.3" numpy
cat >"$folder/read.py" <<'PY'
import pathlib
import sys
import warnings

import numpy as np
import tifffile

warnings.simplefilter("error")  # no warning passes unseen
name = sys.argv[1]
frames = np.arange(1, 1 + 16 * 20 * 30, dtype=np.uint16).reshape(16, 20, 30)
with tifffile.TiffWriter(name) as file:  # page after page, as a recording does
    for frame in frames:
        file.write(frame, contiguous=False, photometric="minisblack", metadata=None, rowsperstrip=1)
path = pathlib.Path(name)
whole = path.read_bytes()
assert np.array_equal(tifffile.imread(name), frames)

with tifffile.TiffFile(name) as file:
    cut, tag = file.pages[9].offset, file.pages[0].tags["StripByteCounts"]
path.write_bytes(whole[: cut + 1])
left = tifffile.imread(name)
print("cut in page 10 of 16: read as", left.shape)
assert left.shape == (9, 20, 30) and np.array_equal(left, frames[:9])

size = {3: 2, 4: 4}[int(tag.dtype)]
broken = bytearray(whole)
broken[tag.valueoffset + 5 * size : tag.valueoffset + 6 * size] = bytes(size)
path.write_bytes(broken)
first = tifffile.imread(name, key=0)
print("byte count of row 6 is 0: rows 5 to 8 begin with", first[4:8, 0], "for", frames[0, 4:8, 0])
assert np.array_equal(first[:5], frames[0, :5]) and (first[5] == 0).all()
assert np.array_equal(first[6:], frames[0, 5:-1])
PY
"$folder/venv/bin/python" "$folder/read.py" "$folder/a.tif" && echo "as stated" || { echo "changed"; exit 1; }
