#!/usr/bin/env bash
# prysm reads the grid of a CODE V interferogram (.int) 2.497 times too high at 632.8 nm, and with rows and columns
# exchanged. The format says: height in waves = count / SSZ, so in nm count / SSZ * WVL * 1000 (WVL in um), in lines of
# "GRD columns rows". read_codev_gridint multiplies by 1000 / WVL instead, so that the factor is 1 / WVL^2, and takes the
# two sizes as rows and columns: of a map that is not square each height lies at another place, with no error.
#
# The two faults hide where maps are square, compared in their own units, or measured near 1 um.
#
# prysm 0.21.1, NumPy 2.3.5. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "prysm==0.21.1" "numpy==2.3.5"
cat >"$folder/read.py" <<'PY'
import pathlib
import sys

import numpy as np
from prysm.io import read_codev_gridint

# three columns, two rows: counts 0 to 5 times 1000, one wave is 1000 counts
text = "a grid of heights\nGRD 3 2 SUR WVL 0.6328 SSZ 1000 NDA -32768\n0 1000 2000\n3000 4000 5000\n"
path = pathlib.Path(sys.argv[1])
path.write_bytes(text.replace("\n", "\r\n").encode())
heights, _ = read_codev_gridint(path)
print("shape", heights.shape, "of 2 rows and 3 columns")
print("one wave of 632.8 nm is read as", np.sort(heights.ravel())[1], "nm")
assert heights.shape == (3, 2)
assert abs(np.sort(heights.ravel())[1] - 632.8 / 0.6328**2) < 0.01
PY
"$folder/venv/bin/python" "$folder/read.py" "$folder/a.int" && echo "as stated" || { echo "changed"; exit 1; }
