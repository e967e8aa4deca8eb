"""Fringes as in a laboratory: pictures for the screen, the camera's images in files, heights from the files."""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import irtscots_cl as irt
from irtscots_cl.cli import main

quick = "--quick" in sys.argv
scene = irt.load_scene("sphere-deviated")
if quick:  # a camera of fewer, larger pixels
    detector = replace(scene.camera.detector, pixels=(24, 24), pitch_mm=scene.camera.detector.pitch_mm * 125 / 24)
    scene = replace(scene, camera=replace(scene.camera, detector=detector))

with tempfile.TemporaryDirectory() as folder:
    test = Path(folder) / "test.toml"
    test.write_text(scene.to_toml(), encoding="utf-8")
    fringes = Path(folder) / "fringes"
    main(["patterns", str(test), "--out", str(fringes)])  # the same as on the command line

    # A real camera's images go into fringes/camera; here it is simulated, with noise, 12 bits
    paths = irt.record_pictures(irt.trace(scene, estimator="analytic"), fringes, seed=1)
    facts = irt.measure_fringes([fringes], scene.nominal(), Path(folder) / "result")

print(f"{len(paths)} images, for example {paths[0].name}")
height = facts["deviation_nm_rms"]
print(f"rms deviation {height['piston_tilt']:.1f} nm, standard error {facts['height_standard_error_nm']:.1f} nm")
for check in facts["checks"]:
    if check["level"] != "ok":
        print(check["name"], check["level"], check["text"])
