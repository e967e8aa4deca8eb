// From the mirror to a device: reflection, then the way to the device's plane. World frame to the device's.
#include "reflection.cl"
#include "device_frame.cl"

// Where the light of a line that met the mirror crosses the frame's plane z = 0; results as of frame_arrive.
INLINE maskv reflected_arrive(__constant Scene *scene, __constant Frame *frame, const Line *line, const Meeting *met,
                              realv *u, realv *v, realv *slope_u, realv *slope_v) {
    return frame_arrive(frame, met->point, reflect(line, mirror_normal(scene, met)), u, v, slope_u, slope_v);
}
