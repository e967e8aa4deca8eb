// A device (screen or camera) and its frame: origin at the device, +z away from what it looks at. Unit: mm.
// axis_x, axis_y, axis_z: the device's axes in world coordinates; offset = -axes . position, computed in float64 on the
// host, so that no device coordinate of several metres is subtracted here in single precision.
#include "reflection.cl"
#include "frame_*.cl"

// Where the ray from point_world along direction_world (of any length) crosses the device's plane z = 0.
// u, v: position there; slope_u, slope_v: du/dz, dv/dz. Returns false if the ray runs away from the plane.
INLINE maskv frame_arrive(__constant Frame *frame, vec3v point_world, vec3v direction_world,
                          realv *u, realv *v, realv *slope_u, realv *slope_v) {
    const realv inverse = 1 / dot_axis_z(frame->axis_z, direction_world);
    const realv depth = dot_axis_z(frame->axis_z, point_world) + frame->offset[2];
    *slope_u = dot_axis_x(frame->axis_x, direction_world) * inverse;
    *slope_v = dot_axis_y(frame->axis_y, direction_world) * inverse;
    *u = dot_axis_x(frame->axis_x, point_world) + frame->offset[0] - depth * *slope_u;
    *v = dot_axis_y(frame->axis_y, point_world) + frame->offset[1] - depth * *slope_v;
    return inverse > 0;
}
