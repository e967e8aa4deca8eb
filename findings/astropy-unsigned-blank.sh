#!/usr/bin/env bash
# astropy gives NaN for the samples that a FITS image of signed integers marks as missing (BLANK), and an ordinary count
# for the same mark in an image of unsigned integers (BZERO = 32768), which is what cameras write: BLANK is then not
# looked at, and nothing says so. The missing sample of the signed image comes back as NaN, that of the unsigned one as
# 32768 + BLANK, here a plausible 0 counts.
#
# Known upstream (pull request 16636 of astropy, open since 2024). To be safe: open with do_not_scale_image_data=True
# and apply BLANK, BSCALE and BZERO to the values as stored.
#
# astropy 8.0.2. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "astropy==8.0.2"
cat >"$folder/read.py" <<'PY'
import pathlib
import sys
import warnings

import numpy as np
from astropy.io import fits

warnings.simplefilter("error")  # no warning passes unseen
name = sys.argv[1]


def read(zero):
    """What astropy makes of the stored values -32768 (missing), 100, 200."""
    values = {"SIMPLE": "T", "BITPIX": 16, "NAXIS": 2, "NAXIS1": 3, "NAXIS2": 1, "BZERO": zero, "BLANK": -32768}
    header = "".join(f"{key:8}= {value:>20}".ljust(80) for key, value in values.items()) + "END"
    data = np.array([-32768, 100, 200], ">i2").tobytes()
    pathlib.Path(name).write_bytes(header.ljust(2880).encode() + data.ljust(2880, b"\0"))
    with fits.open(name) as units:
        return np.array(units[0].data)


signed, unsigned = read(0), read(32768)
print("BZERO = 0:    ", signed.dtype, signed.tolist())
print("BZERO = 32768:", unsigned.dtype, unsigned.tolist())
assert np.isnan(signed[0, 0]) and signed[0, 1:].tolist() == [100, 200]
assert unsigned.dtype == np.uint16 and unsigned.tolist() == [[0, 32868, 32968]]
PY
"$folder/venv/bin/python" "$folder/read.py" "$folder/a.fits" && echo "as stated" || { echo "changed"; exit 1; }
