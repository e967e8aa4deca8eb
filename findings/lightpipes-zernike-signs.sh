#!/usr/bin/env bash
# LightPipes' Zernike(F, n, m, R, A) gives the field the phase -A Z, and has the polar angle turned by half a turn against
# the x and y of its own grid. The two together change the sign of all terms of even m (focus, astigmatism, spherical)
# and leave those of odd m (tilt, coma, trefoil) as they are: a wavefront of several terms becomes another wavefront, not
# only a negated or a turned one. Coefficients from a fit of any other library give focus against coma reversed.
#
# To be safe: negate the coefficients of even m, or multiply the field by exp(i phase) made elsewhere.
#
# LightPipes 2.1.5. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "LightPipes==2.1.5"
cat >"$folder/signs.py" <<'PY'
import numpy as np
from LightPipes import Begin, Zernike

N = 65
field = Begin(2.0, 1e-6, N)
y, x = field.mgrid_cartesian
assert np.allclose(field.mgrid_polar[1] - np.arctan2(y, x), np.pi)
r, t = np.hypot(x, y), np.arctan2(y, x)
terms = {  # name: n, m, the polynomial in x = r cos t, y = r sin t
    "tilt x": (1, 1, 2 * r * np.cos(t)), "tilt y": (1, -1, 2 * r * np.sin(t)),
    "focus": (2, 0, np.sqrt(3) * (2 * r**2 - 1)),
    "astigmatism 0": (2, 2, np.sqrt(6) * r**2 * np.cos(2 * t)),
    "astigmatism 45": (2, -2, np.sqrt(6) * r**2 * np.sin(2 * t)),
    "coma x": (3, 1, np.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(t)),
    "coma y": (3, -1, np.sqrt(8) * (3 * r**3 - 2 * r) * np.sin(t)),
    "trefoil x": (3, 3, np.sqrt(8) * r**3 * np.cos(3 * t)),
    "spherical": (4, 0, np.sqrt(5) * (6 * r**4 - 6 * r**2 + 1)),
}
used = r < 0.9
for name, (n, m, polynomial) in terms.items():
    phase = np.angle(Zernike(field, n, m, 1.0, 0.1, norm=True, units="rad").field)
    sign = (phase * polynomial)[used].sum() / (polynomial**2)[used].sum() / 0.1
    print(f"{name:15} n = {n}, m = {m:2}: {sign:+.2f} of what was asked for")
    assert round(sign) == (1 if m % 2 else -1)
PY
"$folder/venv/bin/python" "$folder/signs.py" && echo "as stated" || { echo "changed"; exit 1; }
