// Frames of devices that are turned about the world's y alone: it is their y axis, so
// that x and z axes have no y. The verbs are those of frame_turned.cl. Unit: mm.
#include "line.cl"

INLINE realv dot_axis_x(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[2] * v.z; }
INLINE realv dot_axis_y(__constant real *axis, vec3v v) { return v.y; }
INLINE realv dot_axis_z(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[2] * v.z; }

// The line through the frame's point (u, v, 0) along (direction_u, direction_v, direction_z) in the frame.
INLINE Line frame_depart(__constant Frame *frame, realv u, realv v, realv direction_u, realv direction_v,
                         realv direction_z) {
    __constant real *x = frame->axis_x, *z = frame->axis_z;
    const realv inverse = 1 / (direction_u * x[2] + direction_z * z[2]);
    const realv p = (direction_u * x[0] + direction_z * z[0]) * inverse, q = direction_v * inverse;
    const realv start_z = frame->position[2] + u * x[2];
    return (Line){frame->position[0] + u * x[0] - start_z * p, frame->position[1] + v - start_z * q, p, q};
}

// The world's components of the frame's vectors (u, v, 0) and (l, m, n).
INLINE vec3v frame_across(__constant Frame *frame, realv u, realv v) {
    return (vec3v){frame->axis_x[0] * u, v, frame->axis_x[2] * u};
}
INLINE vec3v frame_along(__constant Frame *frame, realv l, realv m, realv n) {
    __constant real *x = frame->axis_x, *z = frame->axis_z;
    return (vec3v){x[0] * l + z[0] * n, m, x[2] * l + z[2] * n};
}
