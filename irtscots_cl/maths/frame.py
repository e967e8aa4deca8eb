"""Frames of the devices in the world. Lengths in mm, float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system import interruption

_AT_ONCE = 2**14  # vectors that are turned between looks for a signal
ALONG_Y = 1e-12  # rad from the world's Y axis, about the rounding of positions: a device so near to it looks along it


@dataclass(frozen=True)
class Frame:
    """A device's frame in world coordinates: origin at the device, +z away from the point it looks at.

    position_mm: [3]; axes: [3, 3], the rows are the unit vectors x, y, z. x = unit(Y_world x z), y = z x x. For a
    device that looks along the world's Y, where this has no direction, x = X_world: the limit for a device that turns
    from Z to Y. No rule is continuous there. Before it is turned about z, x has no part along Y_world.
    """

    position_mm: FloatArray
    axes: FloatArray

    @classmethod
    def looking(cls, position_mm: ArrayLike, look_at_mm: ArrayLike, turn_rad: float = 0.0) -> Frame:
        """Frame of a device at position_mm [3] that looks at look_at_mm [3].

        turn_rad: turns x and y about z, from x towards y.
        """
        position = np.asarray(position_mm, float)
        z = _unit(position - np.asarray(look_at_mm, float))
        if np.hypot(z[0], z[2]) <= ALONG_Y:
            x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, np.sign(z[1]), 0.0])
        else:
            x = _unit(np.cross([0.0, 1.0, 0.0], z))
        y = np.cross(z, x)
        if turn_rad != 0.0:
            cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
            x, y = cosine * x + sine * y, cosine * y - sine * x
        return cls(position, np.stack([x, y, z]))

    def to_world(self, u_mm: ArrayLike, v_mm: ArrayLike) -> FloatArray:
        """World coordinates [..., 3] of the points (u, v, 0) of the frame."""
        along_u, along_v = np.multiply.outer(u_mm, self.axes[0]), np.multiply.outer(v_mm, self.axes[1])
        world: FloatArray = self.position_mm + along_u + along_v
        return world

    def arrive(
        self, points_mm: FloatArray, directions: FloatArray, in_front: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Where rays from world points [..., 3] along directions [..., 3] cross the plane z = 0: (u, v) [...] in mm.

        in_front: NaN for rays that do not run from the device's front onto the plane: they run away from it, or come
        from behind it.
        """
        from_device = turned(points_mm - self.position_mm, self.axes.T)
        along = turned(directions, self.axes.T)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a ray parallel to the plane
            step = -from_device[..., 2] / along[..., 2]
        if in_front:
            step = np.where((along[..., 2] > 0) & (step >= 0), step, np.nan)
        return from_device[..., 0] + step * along[..., 0], from_device[..., 1] + step * along[..., 1]


def aim_of(frame: Frame, distance_mm: float) -> tuple[FloatArray, FloatArray, float]:
    """The arguments position_mm, look_at_mm (so far in front of the device) and turn_rad that make a frame again.

    The inverse of Frame.looking, for a right-handed frame whose z is not along the world's Y axis.
    """
    look_at = frame.position_mm - distance_mm * frame.axes[2]
    plain = Frame.looking(frame.position_mm, look_at)
    turn = float(np.arctan2(frame.axes[0] @ plain.axes[1], frame.axes[0] @ plain.axes[0]))
    return frame.position_mm, look_at, turn


def turned(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """The product vectors [..., 3] @ axes [3, 3], in parts, so that a signal need not wait for a large one."""
    if vectors.ndim < 3:
        return vectors @ axes
    flat, result = vectors.reshape(-1, 3), np.empty(vectors.shape)
    into = result.reshape(-1, 3)
    for first in range(0, len(flat), _AT_ONCE):
        interruption.check()
        np.matmul(flat[first : first + _AT_ONCE], axes, out=into[first : first + _AT_ONCE])
    return result


def _unit(vector: FloatArray) -> FloatArray:
    return vector / np.linalg.norm(vector)
