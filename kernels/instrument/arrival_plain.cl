// Plain arrival: reflection at the mirror, then the crossing of a device's plane. From the world frame to the device's.
// Unit: mm.
#include "reflection.cl"
#include "device_frame.cl"

// Where the light of a line that met the mirror crosses the frame's plane z = 0; results as in frame_arrive.
INLINE maskv reflected_arrive(__constant Scene *scene, __constant Frame *frame, const Line *line, const Meeting *met,
                              realv *u, realv *v, realv *slope_u, realv *slope_v) {
    const vec3v normal = mirror_normal(scene, met);
    return frame_arrive(frame, met->point, reflect(line, normal, mirror_normal_square(normal)), u, v, slope_u, slope_v);
}
