// Probe: writes out adjoint paths of given random words. For checks of single rays by irtscots_cl/stability/ only.
// Frames as in path_forward.cl. Unit: mm.
#include "path_adjoint.cl"

#define PATH_FIELDS 8

// Parameters: tables: of the mirror; receivers [grid 0]; words [grid 0][DIMENSIONS][BLOCK]; paths [grid
// 0][PATH_FIELDS][BLOCK]: the unit disk's point from the words, mirror point in the world's frame, landing point in the
// screen's frame, weight; marks [grid 0][2][BLOCK]: met the mirror, runs towards the screen. Grid: (blocks of rays, 1).
__kernel void probe_adjoint(__constant Scene *scene, __global const real *tables, __global const Receiver *receivers,
                            __global const uint *words, __global real *paths, __global int *marks) {
    const Receiver receiver = receivers[get_global_id(0)];
    Words given;
    for (int d = 0; d < DIMENSIONS; ++d)
        for (int ray = 0; ray < BLOCK; ++ray)
            ((uint *)given.of[d])[ray] = words[(get_global_id(0) * DIMENSIONS + d) * BLOCK + ray];
    __global real *path = paths + get_global_id(0) * PATH_FIELDS * BLOCK;
    __global int *mark = marks + get_global_id(0) * 2 * BLOCK;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        realv weight, at_u, at_v, x, y;
        const Line line = adjoint_emit(scene, &receiver, &given, v, &weight);
        Meeting met = mirror_meet(scene, tables, &line);
        mirror_deviate(scene, tables, &line, &met);
        const maskv ahead = adjoint_arrive(scene, &receiver, &line, &met, &at_u, &at_v);
        unit_disk(ray_words(&given, ADJOINT_APERTURE_RADIUS, v), ray_words(&given, ADJOINT_APERTURE_ANGLE, v), &x, &y);
        const realv values[PATH_FIELDS] = {x, y, met.point.x, met.point.y, met.point.z, at_u, at_v, weight};
        const intv masks[2] = {to_int(met.on_mirror), to_int(ahead)};
        for (int lane = 0; lane < WIDTH; ++lane) {
            for (int i = 0; i < PATH_FIELDS; ++i)
                path[i * BLOCK + v * WIDTH + lane] = ((const real *)&values[i])[lane];
            for (int i = 0; i < 2; ++i) mark[i * BLOCK + v * WIDTH + lane] = ((const int *)&masks[i])[lane] & 1;
        }
    }
}
