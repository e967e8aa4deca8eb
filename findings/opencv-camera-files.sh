#!/usr/bin/env bash
# What reads and writes camera calibrations, and what it leaves out without a word:
# - opencv-python 5 writes "%YAML 1.2" and vectors as "!!opencv-nd-matrix" with `sizes`; 4 wrote "%YAML:1.0" and
#   "!!opencv-matrix" with `rows`, `cols`. Its JSON holds .Nan, which is no JSON. No YAML loader knows the tags.
# - OpenCV's functions ignore the skew [0][1] and the last element [2][2] of a camera matrix: a matrix that was scaled
#   as a whole, [2][2] included, gives the same pixels as one with 1 there.
# - PyYAML's loaders read 1e-05 (as Python and ROS tools write it) as text, 0123 as 83 and 1:30 as 90.
# - SciPy's RectBivariateSpline of degree 1 has no first derivative: "Error code returned by pardeu: 10".
#
# opencv-python-headless 5.0.0.93, PyYAML 6.0.4, SciPy 1.17.1. Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet opencv-python-headless==5.0.0.93 PyYAML==6.0.4 scipy==1.17.1
cat >"$folder/check.py" <<'PY'
import json
import os
import sys

import cv2
import numpy as np
import yaml
from scipy.interpolate import RectBivariateSpline

folder = sys.argv[1]
matrix = np.array([[686.5, 0, 101.5], [0, 685.25, 77.25], [0, 0, 1]])
lens = np.array([-0.144, 1.61, 2.5e-5, -1.9e-3, 0.0])
texts = {}
for ending in ("yml", "json"):
    path = os.path.join(folder, f"a.{ending}")
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", lens)
    storage.write("worst", float("nan"))
    storage.release()
    texts[ending] = open(path).read()
print(texts["yml"].splitlines()[0], "|", next(line for line in texts["yml"].splitlines() if "nd-matrix" in line))
assert texts["yml"].startswith("%YAML 1.2") and "distortion_coefficients: !!opencv-nd-matrix" in texts["yml"]
try:
    yaml.safe_load(texts["yml"])
    raise SystemExit("PyYAML knows the tag")
except yaml.constructor.ConstructorError as error:
    print("yaml.safe_load:", error.problem)
try:
    json.loads(texts["json"])
    raise SystemExit("the JSON is JSON")
except json.JSONDecodeError as error:
    print("json.loads:", error)

points = np.array([[0.1, 0.2, 10.0], [0.5, -0.3, 9.0]])
none = np.zeros(3)
plain = cv2.projectPoints(points, none, none, matrix, lens)[0]
other = matrix.copy()
other[0, 1], other[2, 2] = 5.0, 0.125
changed = cv2.projectPoints(points, none, none, other, lens)[0]
print("pixels with and without a skew of 5 and a last element of 0.125 differ by", np.abs(plain - changed).max())
assert np.array_equal(plain, changed)

read = yaml.safe_load("a: 1e-05\nb: 0123\nc: 1:30\n")
print("PyYAML:", read)
assert read == {"a": "1e-05", "b": 83, "c": 90}

spline = RectBivariateSpline([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], np.eye(3), kx=1, ky=1)
try:
    spline.ev(0.5, 0.5, dx=1)
    raise SystemExit("a derivative")
except ValueError as error:
    print("RectBivariateSpline:", error)
PY
"$folder/venv/bin/python" "$folder/check.py" "$folder" && echo "as stated" || { echo "changed"; exit 1; }
