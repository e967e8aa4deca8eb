#!/usr/bin/env bash
# SurfaceTopography's heights are indexed [x, y], not [row, column], and its y runs the other way for different formats:
# of Zygo's .dat downwards from the first row of the file, of ISO's .x3p upwards. The same map, written into both as their
# formats say (.dat: first row at the top; .x3p: first profile at the least y), comes back turned over against itself:
# what is compared or subtracted after reading both is the mirror image in y, and nothing says so.
#
# SurfaceTopography 1.27.1, NumPy 2.3.5. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "SurfaceTopography==1.27.1" "numpy==2.3.5"
cat >"$folder/read.py" <<'PY'
import pathlib
import struct
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
from SurfaceTopography import Topography
from SurfaceTopography.IO import open_topography
from SurfaceTopography.IO.X3P import write_x3p

folder = pathlib.Path(sys.argv[1])
# two columns, three rows, the top row first: the highest point is at the left of the top row
top_first = np.array([[3.0, 0.0], [0.0, 0.0], [0.0, 1.0]])  # um

# MetroPro .dat, header format 1 (834 bytes, big endian), phase only: one fringe is 32768 counts of resolution 1
header = bytearray(834)
struct.pack_into(">I", header, 0, 0x881B036F)
struct.pack_into(">h", header, 4, 1)
struct.pack_into(">i", header, 6, 834)
struct.pack_into(">hhhh", header, 64, 0, 0, 2, 3)  # phase: x, y, width, height
struct.pack_into(">i", header, 72, 24)
struct.pack_into(">f", header, 164, 0.5)  # interferometric scale factor
struct.pack_into(">f", header, 168, 1e-6)  # wavelength in m
struct.pack_into(">f", header, 176, 1.0)  # obliquity
struct.pack_into(">f", header, 184, 1e-3)  # lateral resolution in m
struct.pack_into(">h", header, 218, 1)  # phase resolution
counts = np.round(top_first / 0.5 * 32768).astype(">i4")
(folder / "a.dat").write_bytes(bytes(header) + counts.tobytes())
of_dat = np.asarray(open_topography(str(folder / "a.dat")).topography().heights())

# the same map as .x3p, whose first profile is that of the least y: written by the library itself, [x, y] upwards
write_x3p(Topography(top_first[::-1].T, (2.0, 3.0), unit="mm"), str(folder / "a.x3p"))
of_x3p = np.asarray(open_topography(str(folder / "a.x3p")).topography().heights())

highest = [tuple(int(i) for i in np.unravel_index(np.argmax(one), one.shape)) for one in (of_dat, of_x3p)]
print("shapes [x, y]:", of_dat.shape, of_x3p.shape)
print("highest point, left of the top row: in .dat at", highest[0], "in .x3p at", highest[1])
assert of_dat.shape == of_x3p.shape == (2, 3)
assert highest == [(0, 0), (0, 2)]
PY
"$folder/venv/bin/python" "$folder/read.py" "$folder" && echo "as stated" || { echo "changed"; exit 1; }
