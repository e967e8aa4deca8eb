// Frames of devices whose x axis is level (its world y is zero): screens and cameras that are not turned about their z.
// The verbs are those of frame_turned.cl. Unit: mm.
#include "line.cl"

INLINE realv dot_axis(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[1] * v.y + axis[2] * v.z; }
INLINE realv dot_axis_x(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[2] * v.z; }
INLINE realv dot_axis_y(__constant real *axis, vec3v v) { return dot_axis(axis, v); }
INLINE realv dot_axis_z(__constant real *axis, vec3v v) { return dot_axis(axis, v); }

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

// The world's components of the frame's vectors (u, v, 0) and (l, m, n).
INLINE vec3v frame_across(__constant Frame *frame, realv u, realv v) {
    __constant real *x = frame->axis_x, *y = frame->axis_y;
    return (vec3v){x[0] * u + y[0] * v, y[1] * v, x[2] * u + y[2] * v};
}
INLINE vec3v frame_along(__constant Frame *frame, realv l, realv m, realv n) {
    __constant real *x = frame->axis_x, *y = frame->axis_y, *z = frame->axis_z;
    return (vec3v){x[0] * l + y[0] * m + z[0] * n, y[1] * m + z[1] * n, x[2] * l + y[2] * m + z[2] * n};
}
