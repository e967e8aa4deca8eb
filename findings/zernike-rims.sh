#!/usr/bin/env bash
# "The unit disk on N pixels" is not the same disk in libraries that make Zernike polynomials on a square of pixels, so
# that coefficients which one makes and another fits change, with no error:
# - aotools and hcipy put the rim on the outer edges of the outer pixels: radius N/2;
# - poppy and zernike (its documented grid, linspace(-1, 1, N)) put it on their centres: radius (N - 1)/2;
# - prysm (make_xy_grid) puts the rim on an edge on one side and has x = 0 on a pixel: the centre is half a pixel off.
# 1000 nm rms of focus on 64 pixels made by aotools fits as 969 nm in poppy's terms, ((N - 1)/N)^2; made by prysm, it fits
# as 1000 nm of focus and 54 nm of tilt in x and in y in aotools' terms.
#
# So a table of Zernike coefficients on pixels needs its disk: radius and centre, in pixels.
#
# aotools 1.0.8, hcipy 0.7.1, poppy 1.1.2, prysm 0.21.1, zernike 0.0.33. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet aotools==1.0.8 hcipy==0.7.1 poppy==1.1.2 prysm==0.21.1 zernike==0.0.33 numpy==2.4.6
cat >"$folder/rims.py" <<'PY'
import warnings

warnings.simplefilter("ignore")
import aotools
import hcipy
import numpy as np
import poppy
from prysm.coordinates import cart_to_polar, make_xy_grid
from prysm.polynomials import noll_to_nm, zernike_nm
from zernike import RZern

N = 64
of = {"aotools": aotools.zernikeArray(4, N)}
of["hcipy"] = [np.array(term.shaped) for term in hcipy.make_zernike_basis(4, 1, hcipy.make_pupil_grid(N))]
of["poppy"] = [np.nan_to_num(term) for term in poppy.zernike.zernike_basis(nterms=4, npix=N)]
polar = cart_to_polar(*make_xy_grid(N, diameter=2))
of["prysm"] = [np.where(polar[0] <= 1, zernike_nm(*noll_to_nm(j), *polar, norm=True), 0) for j in (1, 2, 3, 4)]
disk = RZern(2)
disk.make_cart_grid(*np.meshgrid(np.linspace(-1, 1, N), np.linspace(-1, 1, N)))
of["zernike"] = [np.nan_to_num(disk.eval_grid(np.eye(disk.nk)[k], matrix=True)) for k in range(4)]  # 0.0.33: Noll's order


def fit(terms, height):
    """Coefficients of height over the pixels that both know."""
    used = (terms[3] != 0) & (height != 0)
    return np.linalg.lstsq(np.stack([term[used] for term in terms], axis=1), height[used], rcond=None)[0]


used = np.hypot(*np.meshgrid(np.arange(N) - 31.5, np.arange(N) - 31.5)) < 30
x, y = np.meshgrid(np.arange(N) - (N - 1) / 2, np.arange(N) - (N - 1) / 2)
for name, terms in of.items():
    parabola = np.stack([(x * x + y * y)[used], x[used], y[used], np.ones(used.sum())], axis=1)
    a, b, c, _ = np.linalg.lstsq(parabola, terms[3][used], rcond=None)[0]
    radius, centre = np.sqrt(2 * np.sqrt(3) / a), (-b / (2 * a), -c / (2 * a))
    print(f"{name:8} radius {radius:.3f} pixels, centre {centre[0]:+.3f}, {centre[1]:+.3f} from the middle")
    assert abs(radius - {"poppy": 31.5, "zernike": 31.5}.get(name, 32)) < 1e-6
    assert np.allclose(centre, 0.5 if name == "prysm" else 0, atol=1e-6)
seen = fit(of["poppy"], 1000 * of["aotools"][3])
print("1000 nm of focus by aotools in poppy's terms:", np.round(seen, 1))
assert abs(seen[3] - 1000 * (63 / 64) ** 2) < 0.1  # 969.0
seen = fit(of["aotools"], 1000 * of["prysm"][3])
print("1000 nm of focus by prysm in aotools' terms:", np.round(seen, 1))
assert abs(seen[3] - 1000) < 0.1 and np.allclose(seen[1:3], -54.1, atol=0.1)
PY
"$folder/venv/bin/python" "$folder/rims.py" && echo "as stated" || { echo "changed"; exit 1; }
