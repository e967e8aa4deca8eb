#!/usr/bin/env bash
# SciPy's CloughTocher2DInterpolator depends on the unit of the values. Interpolation is linear in the values, so the same
# heights in nm, mm or m should give the same surface; but the slopes at the points come from an iteration whose
# tolerance (tol = 1e-6) is relative only for slopes above 1 and absolute below. Heights of 20 nm given in metres stop
# after the first sweep: here the surface is 90 times as wrong (0.29 % of its rms) as that of the same heights in nm
# (0.003 %), and in mm three times, with no warning. griddata(..., method="cubic") does the same.
#
# To be safe: divide the values by their largest one before, and multiply after; or give a smaller tol.
#
# SciPy 1.17.1, NumPy 2.4.6. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "scipy==1.17.1" "numpy==2.4.6"
cat >"$folder/interpolate.py" <<'PY'
import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator, griddata


def height_nm(x, y):
    return 20 * np.sin(2 * np.pi * x / 30) + 10 * np.cos(2 * np.pi * (y + 0.3 * x) / 45)


n = 51
x, y = np.meshgrid(np.arange(n) * 1.0, np.arange(n) * 1.0)
points = np.stack([(x + 0.05 * y).ravel(), y.ravel()], axis=1)  # a sheared grid of 1 mm
at = np.meshgrid(np.arange(8, n - 8) + 0.3, np.arange(8, n - 8) + 0.2)
truth = height_nm(*at)
values = height_nm(*points.T)
error = {}
for unit, scale in (("nm", 1.0), ("mm", 1e-6), ("m", 1e-9)):
    found = CloughTocher2DInterpolator(points, values * scale)(*at) / scale
    again = griddata(points, values * scale, tuple(at), method="cubic") / scale
    assert np.allclose(found, again)
    error[unit] = np.sqrt(np.mean((found - truth) ** 2)) / truth.std()
    print(f"heights given in {unit}: error {100 * error[unit]:.4f} % of the rms")
assert error["nm"] < 5e-5 and error["mm"] > 2 * error["nm"] and error["m"] > 50 * error["nm"]
PY
"$folder/venv/bin/python" "$folder/interpolate.py" && echo "as stated" || { echo "changed"; exit 1; }
