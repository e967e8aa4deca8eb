"""What a wrong geometry costs in the preset `sphere`, independent of the package. `sensitivities.json` keeps it in nm.

Devices move in the world and keep their orientation; intrinsics and the distance in focus stay. Three conventions:

    self_consistent  Data of the moved set-up, described as the nominal one, heights fed back until they explain the
                     data. This is what a measurement reports.
    one_shot         The same without feedback: slopes at the design's mirror points.
    fixed_points     Mirror points and grid coordinates of the nominal set-up; only the devices in the half vector move.
                     Turns of the camera and its intrinsics have no part in it.
"""

from __future__ import annotations

from oracle.measured import Seen, heights, heights_of_moved_devices, left_nm
from oracle.rig import Rig, with_fault

CASES = {
    "camera.x_mm": [("camera.x_mm", 0.1)],
    "camera.y_mm": [("camera.y_mm", 0.1)],
    "camera.z_mm": [("camera.z_mm", 0.1)],
    "screen.x_mm": [("screen.x_mm", 0.1)],
    "screen.y_mm": [("screen.y_mm", 0.1)],
    "screen.z_mm": [("screen.z_mm", 0.1)],
    "both x": [("camera.x_mm", 0.1), ("screen.x_mm", 0.1)],
    "both y": [("camera.y_mm", 0.1), ("screen.y_mm", 0.1)],
    "both z": [("camera.z_mm", 0.1), ("screen.z_mm", 0.1)],
    "screen.tilt_x_rad": [("screen.tilt_x_rad", 1e-3)],
    "screen.tilt_y_rad": [("screen.tilt_y_rad", 1e-3)],
    "screen.clocking_rad": [("screen.clocking_rad", 1e-3)],
    "screen.pitch_relative": [("screen.pitch_relative", 1e-3)],
    "camera.tilt_x_rad": [("camera.tilt_x_rad", 1e-3)],
    "camera.tilt_y_rad": [("camera.tilt_y_rad", 1e-3)],
    "camera.roll_rad": [("camera.roll_rad", 1e-3)],
    "camera.principal_x_px": [("camera.principal_x_px", 0.1)],
    "camera.focal_relative": [("camera.focal_relative", 1e-3)],
    # 0.1 mm in all, half of it each: nearly the same in all three conventions
    "apart x": [("camera.x_mm", 0.05), ("screen.x_mm", -0.05)],
    "apart y": [("camera.y_mm", 0.05), ("screen.y_mm", -0.05)],
    "apart z": [("camera.z_mm", 0.05), ("screen.z_mm", -0.05)],
}


def with_faults(rig: Rig, faults) -> Rig:
    for name, value in faults:
        rig = with_fault(rig, name, value)
    return rig


def sensitivity(nominal: Seen, faults) -> dict[str, dict[str, float]]:
    """Rms in nm by convention and by what is removed (measured.TERMS). nominal: recorded as described."""
    moved = with_faults(nominal.described, faults)
    seen = nominal.through(moved)
    return {
        "self_consistent": left_nm(seen, heights(seen)),
        "one_shot": left_nm(seen, heights(seen, rounds=1)),
        "fixed_points": left_nm(nominal, heights_of_moved_devices(nominal, moved)),
    }
