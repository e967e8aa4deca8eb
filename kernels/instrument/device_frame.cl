// A device (screen or camera) and its frame: origin at the device, +z away from what it looks at. Unit: mm.
// axis_x, axis_y, axis_z: the device's axes in world coordinates; offset = -axes . position, computed in float64 on the
// host, so that no device coordinate of several metres is subtracted here in single precision.
#include "reflection.cl"

INLINE realv dot_axis_x(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[2] * v.z; }
INLINE realv dot_axis(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[1] * v.y + axis[2] * v.z; }

// Where the ray from point_world along direction_world (of any length) crosses the device's plane z = 0.
// u, v: position there; slope_u, slope_v: du/dz, dv/dz. Returns false if the ray runs away from the plane.
INLINE maskv frame_arrive(__constant Frame *frame, vec3v point_world, vec3v direction_world,
                          realv *u, realv *v, realv *slope_u, realv *slope_v) {
    const realv inverse = 1 / dot_axis(frame->axis_z, direction_world);
    const realv depth = dot_axis(frame->axis_z, point_world) + frame->offset[2];
    *slope_u = dot_axis_x(frame->axis_x, direction_world) * inverse;
    *slope_v = dot_axis(frame->axis_y, direction_world) * inverse;
    *u = dot_axis_x(frame->axis_x, point_world) + frame->offset[0] - depth * *slope_u;
    *v = dot_axis(frame->axis_y, point_world) + frame->offset[1] - depth * *slope_v;
    return inverse > 0;
}

// The line through the frame's point (u, v, 0) along (direction_u, direction_v, direction_z) in the frame.
INLINE Line frame_depart(__constant Frame *frame, realv u, realv v, realv direction_u, realv direction_v,
                         realv direction_z) {
    __constant real *x = frame->axis_x, *y = frame->axis_y, *z = frame->axis_z;
    const realv inverse = 1 / (direction_u * x[2] + direction_v * y[2] + direction_z * z[2]);
    const realv p = (direction_u * x[0] + direction_v * y[0] + direction_z * z[0]) * inverse;
    const realv q = (direction_v * y[1] + direction_z * z[1]) * inverse;
    const realv start_z = frame->position[2] + u * x[2] + v * y[2];
    return (Line){frame->position[0] + u * x[0] + v * y[0] - start_z * p, frame->position[1] + v * y[1] - start_z * q,
                  p, q};
}
