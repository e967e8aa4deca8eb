// Compensated arrival, from a mirror with a slight deviation to a device: the same verb as arrival_plain.cl. From the
// world frame to the device's. Unit: mm.
//
// In single precision a tilt below 4e-9 (half a step) is lost when it is added to a normal, and in the same way for
// every ray. So the deviation's contribution is carried separately to the end. Larger tilts of many steps need no
// compensation: they are rounded up as often as down.
#include "reflection.cl"
#include "device_frame.cl"

// How much the design's reflected direction (reflect) turns when the design's normal n tilts by the deviation's slopes:
// with t the normal's change, 2 (d.n + d.t) t + 2 (d.t) n - (2 n.t + t.t) d.
INLINE vec3v deviation_turn(const Line *line, const Meeting *met, vec3v n) {
    const realv tilt_x = -met->slope_x * n.z, tilt_y = -met->slope_y * n.z;
    const realv dt2 = 2 * (line->p * tilt_x + line->q * tilt_y);
    const realv dn2 = 2 * (line->p * n.x + line->q * n.y + n.z) + dt2;
    const realv nt = 2 * (n.x * tilt_x + n.y * tilt_y) + tilt_x * tilt_x + tilt_y * tilt_y;
    return (vec3v){dn2 * tilt_x + dt2 * n.x - nt * line->p, dn2 * tilt_y + dt2 * n.y - nt * line->q, dt2 * n.z - nt};
}

INLINE maskv reflected_arrive(__constant Scene *scene, __constant Frame *frame, const Line *line, const Meeting *met,
                              realv *u, realv *v, realv *slope_u, realv *slope_v) {
    const vec3v normal = mirror_design_normal(scene, met);
    const vec3v direction = reflect(line, normal, surface_normal_square(normal));
    const vec3v turn = deviation_turn(line, met, normal);
    const realv along = dot_axis_z(frame->axis_z, direction), along_turn = dot_axis_z(frame->axis_z, turn);
    const realv sum = along + along_turn, inverse = 1 / sum;
    const realv lost = along_turn - (sum - along);   // rounding error of the sum
    const realv depth = dot_axis_z(frame->axis_z, met->point) + frame->offset[2];
    const realv main_u = dot_axis_x(frame->axis_x, direction) * inverse;
    const realv main_v = dot_axis_y(frame->axis_y, direction) * inverse;
    const realv turn_u = (dot_axis_x(frame->axis_x, turn) - main_u * lost) * inverse;
    const realv turn_v = (dot_axis_y(frame->axis_y, turn) - main_v * lost) * inverse;
    *slope_u = main_u + turn_u;
    *slope_v = main_v + turn_v;
    *u = dot_axis_x(frame->axis_x, met->point) + frame->offset[0] - depth * main_u - depth * turn_u;
    *v = dot_axis_y(frame->axis_y, met->point) + frame->offset[1] - depth * main_v - depth * turn_v;
    return inverse > 0;
}
