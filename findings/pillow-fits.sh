#!/usr/bin/env bash
# Pillow opens FITS images, and imageio.imread reads them through Pillow when nothing else is asked for. What comes back is
# a plausible picture with other values, and no warning:
# - BZERO and BSCALE are not applied. Cameras write 16-bit counts with BZERO = 32768, so that 1000 counts come back as
#   33768, 40000 as 7232: what is above half scale becomes darker than black. Scaled heights lose their scale.
# - the rows are turned over against astropy, which gives them as they are in the file.
# - of a stack only the first image is there, and n_frames says 1.
#
# To be safe: astropy.io.fits for FITS, whatever else can open it.
#
# Pillow 13.0.0, imageio 2.38.1, astropy 8.0.2. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pillow==13.0.0" "imageio==2.38.1" "astropy==8.0.2"
cat >"$folder/read.py" <<'PY'
import os
import sys
import warnings

import imageio.v3 as imageio
import numpy as np
from astropy.io import fits
from PIL import Image

warnings.simplefilter("error")  # no warning passes unseen
os.chdir(sys.argv[1])
counts = np.array([[1000, 40000, 60000], [1, 2, 3]], np.uint16)
fits.PrimaryHDU(np.stack([counts, counts + 1])).writeto("camera.fits")
scaled = fits.PrimaryHDU(np.array([[0, 100, 200], [1, 2, 3]], np.int16))
scaled.header["BSCALE"], scaled.header["BZERO"] = 0.5, 10
scaled.writeto("scaled.fits")


def ways(name):
    with fits.open(name) as units:
        theirs = np.array(units[0].data)
    with Image.open(name) as image:
        pillow, frames = np.array(image), getattr(image, "n_frames", 1)
    assert np.array_equal(imageio.imread(name), pillow)
    print(name, "astropy", theirs.tolist(), "Pillow", pillow.tolist(), f"({frames} image)")
    return theirs, pillow, frames


theirs, pillow, frames = ways("camera.fits")
assert np.array_equal(theirs[0], counts) and len(theirs) == 2
assert frames == 1 and pillow.tolist() == [[32769, 32770, 32771], [33768, 7232, 27232]]
theirs, pillow, _ = ways("scaled.fits")
assert theirs.tolist() == [[10, 60, 110], [10.5, 11, 11.5]] and pillow.tolist() == [[1, 2, 3], [0, 100, 200]]
PY
"$folder/venv/bin/python" "$folder/read.py" "$folder" && echo "as stated" || { echo "changed"; exit 1; }
