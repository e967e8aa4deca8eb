// Frames of devices in any position, also turned about their z. Unit: mm.
#include "line.cl"

// Components of a world vector along a frame's axes.
INLINE realv dot_axis(__constant real *axis, vec3v v) { return axis[0] * v.x + axis[1] * v.y + axis[2] * v.z; }
INLINE realv dot_axis_x(__constant real *axis, vec3v v) { return dot_axis(axis, v); }
INLINE realv dot_axis_y(__constant real *axis, vec3v v) { return dot_axis(axis, v); }
INLINE realv dot_axis_z(__constant real *axis, vec3v v) { return dot_axis(axis, v); }

// The world's components of the frame's vectors (u, v, 0) and (l, m, n).
INLINE vec3v frame_across(__constant Frame *frame, realv u, realv v) {
    __constant real *x = frame->axis_x, *y = frame->axis_y;
    return (vec3v){x[0] * u + y[0] * v, x[1] * u + y[1] * v, x[2] * u + y[2] * v};
}
INLINE vec3v frame_along(__constant Frame *frame, realv l, realv m, realv n) {
    __constant real *x = frame->axis_x, *y = frame->axis_y, *z = frame->axis_z;
    return (vec3v){x[0] * l + y[0] * m + z[0] * n, x[1] * l + y[1] * m + z[1] * n, x[2] * l + y[2] * m + z[2] * n};
}

// The line through the frame's point (u, v, 0) along (direction_u, direction_v, direction_z) in the frame.
INLINE Line frame_depart(__constant Frame *frame, realv u, realv v, realv direction_u, realv direction_v,
                         realv direction_z) {
    const vec3v along = frame_along(frame, direction_u, direction_v, direction_z), across = frame_across(frame, u, v);
    const realv inverse = 1 / along.z, p = along.x * inverse, q = along.y * inverse;
    const realv start_z = frame->position[2] + across.z;
    return (Line){frame->position[0] + across.x - start_z * p, frame->position[1] + across.y - start_z * q, p, q};
}
