// Probe: writes out forward paths of given random words. For checks of single rays by irtscots_cl/stability/ only.
// Frames as in path_forward.cl. Unit: mm.
#include "path_forward.cl"
#include "detector.cl"

#define PATH_FIELDS 9

// Parameters: tables: of the mirror; emitters [grid 0]; words [grid 0][DIMENSIONS][BLOCK]; paths [grid
// 0][PATH_FIELDS][BLOCK]: the unit disk's point from the words, mirror point in the world's frame, position and slopes
// at the aperture in the camera's frame; marks [grid 0][3][BLOCK]: met the mirror, passed the aperture, detector pixel
// or -1.
// Grid: (blocks of rays, 1).
__kernel void probe_forward(__constant Scene *scene, __global const real *tables, __global const Emitter *emitters,
                            __global const uint *words, __global real *paths, __global int *marks) {
    const Emitter emitter = emitters[get_global_id(0)];
    Words given;
    for (int d = 0; d < DIMENSIONS; ++d)
        for (int ray = 0; ray < BLOCK; ++ray)
            ((uint *)given.of[d])[ray] = words[(get_global_id(0) * DIMENSIONS + d) * BLOCK + ray];
    __global real *path = paths + get_global_id(0) * PATH_FIELDS * BLOCK;
    __global int *mark = marks + get_global_id(0) * 3 * BLOCK;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        realv x, y;
        const Direction aim = forward_aim(&emitter, &given, v);
        const Line line = forward_emit(scene, &emitter, &aim, &given, v);
        Meeting met = mirror_meet(scene, tables, &line);
        mirror_deviate(scene, tables, &line, &met);
        maskv through, clipped;
        const Arrival at = forward_arrive(scene, &line, &met, &through, &clipped);
        unit_disk(ray_words(&given, FORWARD_AIM_RADIUS, v), ray_words(&given, FORWARD_AIM_ANGLE, v), &x, &y);
        const realv values[PATH_FIELDS] = {x, y, met.point.x, met.point.y, met.point.z,
                                           at.a, at.b, at.slope_a, at.slope_b};
        const intv masks[2] = {to_int(met.on_mirror), to_int(through)};
        for (int lane = 0; lane < WIDTH; ++lane) {
            const int ray = v * WIDTH + lane;
            for (int i = 0; i < PATH_FIELDS; ++i) path[i * BLOCK + ray] = ((const real *)&values[i])[lane];
            for (int i = 0; i < 2; ++i) mark[i * BLOCK + ray] = ((const int *)&masks[i])[lane] & 1;
            mark[2 * BLOCK + ray] = detector_pixel(scene, ((const real *)&at.a)[lane], ((const real *)&at.b)[lane],
                                                   ((const real *)&at.slope_a)[lane],
                                                   ((const real *)&at.slope_b)[lane]);
        }
    }
}
