// Probe: traces single lines to the mirror and to the screen, and writes out the results. For checks of the estimators'
// shared arithmetic by irtscots_cl/stability/ only. Frames: the mirror's; u, v in the screen's. Unit: mm.
#include "arrival_*.cl"

#define LINE_FIELDS 4
#define MET_FIELDS 8

// Parameters: tables: of the mirror; lines [grid 0][LINE_FIELDS][WIDTH]: x0, y0, p, q as in reflection.cl; met [grid
// 0][MET_FIELDS][WIDTH]: mirror point, a vector along the normal there, where the reflected light crosses the screen's
// plane; marks [grid 0][2][WIDTH]: met the mirror, runs towards the screen.
// Grid: (vectors of lines, 1).
__kernel void probe_meet(__constant Scene *scene, __global const real *tables, __global const real *lines,
                         __global real *met, __global int *marks) {
    const size_t item = get_global_id(0);
    realv given[LINE_FIELDS];
    for (int i = 0; i < LINE_FIELDS; ++i)
        for (int lane = 0; lane < WIDTH; ++lane)
            ((real *)&given[i])[lane] = lines[(item * LINE_FIELDS + i) * WIDTH + lane];
    const Line line = {given[0], given[1], given[2], given[3]};
    Meeting at = mirror_meet(scene, tables, &line);
    mirror_deviate(scene, tables, &line, &at);
    const vec3v normal = mirror_normal(scene, &at);
    realv u, v, slope_u, slope_v;
    const maskv ahead = reflected_arrive(scene, &scene->screen, &line, &at, &u, &v, &slope_u, &slope_v);
    const realv values[MET_FIELDS] = {at.point.x, at.point.y, at.point.z, normal.x, normal.y, normal.z, u, v};
    const intv masks[2] = {to_int(at.on_mirror), to_int(ahead)};
    for (int lane = 0; lane < WIDTH; ++lane) {
        for (int i = 0; i < MET_FIELDS; ++i)
            met[(item * MET_FIELDS + i) * WIDTH + lane] = ((const real *)&values[i])[lane];
        for (int i = 0; i < 2; ++i) marks[(item * 2 + i) * WIDTH + lane] = ((const int *)&masks[i])[lane] & 1;
    }
}
