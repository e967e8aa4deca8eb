"""Moves of a scene's devices: shifts in the world, turns about their own axes or about the mirror's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.frame import Frame, aim_of
from irtscots_cl.scene.instrument import Camera, Screen

Device = TypeVar("Device", Screen, Camera)


def rotation(vector_rad: ArrayLike) -> FloatArray:
    """Matrix [3, 3] that turns vectors about the axis vector_rad [3] by its length, right-handed (Rodrigues)."""
    vector = np.asarray(vector_rad, float)
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: FloatArray = np.eye(3) + np.sin(angle) * cross + 2 * np.sin(angle / 2) ** 2 * cross @ cross
    return turn


def device_frame(device: Screen | Camera) -> Frame:
    """The frame of a screen or camera, its turn about its own z included."""
    return Frame.looking(device.position_mm, device.look_at_mm, np.radians(_turn_deg(device)))


def shifted(device: Device, shift_mm: ArrayLike) -> Device:
    """A device moved in the world by shift_mm [3], its orientation kept."""
    position, look_at = (np.add(point, shift_mm) for point in (device.position_mm, device.look_at_mm))
    return replace(device, position_mm=_point(position), look_at_mm=_point(look_at))


def turned_in_place(device: Device, own_rad: ArrayLike) -> Device:
    """A device turned about its own axes by the rotation vector own_rad [3]; its position is kept."""
    return _posed(device, rotation(own_rad).T @ device_frame(device).axes, np.asarray(device.position_mm, float))


def seen_from_moved_mirror(device: Device, shift_mm: ArrayLike, turn_rad: ArrayLike) -> Device:
    """A device that stands still while the mirror turns by the rotation vector turn_rad [3] and moves by shift_mm [3].

    A scene's world is the mirror's frame, so the device makes the inverse move.
    """
    back = rotation(turn_rad).T
    position = back @ (np.asarray(device.position_mm, float) - np.asarray(shift_mm, float))
    return _posed(device, device_frame(device).axes @ back.T, position)


def _posed(device: Device, axes: FloatArray, position_mm: FloatArray) -> Device:
    """A device with other axes [3, 3] (rows) at another place; it looks as far as before, so its focus stays."""
    distance = float(np.linalg.norm(np.subtract(device.position_mm, device.look_at_mm)))
    place, look_at, turn_rad = aim_of(Frame(position_mm, axes), distance)
    key = "clocking_deg" if isinstance(device, Screen) else "roll_deg"
    turn: dict[str, Any] = {key: float(np.degrees(turn_rad))}
    return replace(device, position_mm=_point(place), look_at_mm=_point(look_at), **turn)


def _turn_deg(device: Screen | Camera) -> float:
    return device.clocking_deg if isinstance(device, Screen) else device.roll_deg


def _point(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
