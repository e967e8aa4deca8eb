// Probe: single lines to the mirror and on to the screen, written out. For checks of the arithmetic that the estimators
// share (irtscots_cl/stability/), never for a run. Frames: the mirror's; u, v the screen's. Unit: mm.
#include "arrival_*.cl"

#define LINE_FIELDS 4
#define MET_FIELDS 8

// Parameters: lines [LINE_FIELDS][n]: x0, y0, p, q as in reflection.cl; met [MET_FIELDS][n]: mirror point, a vector along
// the normal there, where the reflected light crosses the screen's plane; marks [2][n]: met the mirror, runs towards the
// screen. Grid: (n / WIDTH, 1); n is a multiple of WIDTH.
__kernel void probe_meet(__constant Scene *scene, __global const real *lines, __global real *met, __global int *marks) {
    const size_t n = get_global_size(0) * WIDTH, first = get_global_id(0) * WIDTH;
    realv given[LINE_FIELDS];
    for (int i = 0; i < LINE_FIELDS; ++i)
        for (int lane = 0; lane < WIDTH; ++lane) ((real *)&given[i])[lane] = lines[i * n + first + lane];
    const Line line = {given[0], given[1], given[2], given[3]};
    Meeting at = mirror_meet(scene, &line);
    mirror_deviate(scene, &line, &at);
    const vec3v normal = mirror_normal(scene, &at);
    realv u, v, slope_u, slope_v;
    const maskv ahead = reflected_arrive(scene, &scene->screen, &line, &at, &u, &v, &slope_u, &slope_v);
    const realv values[MET_FIELDS] = {at.point.x, at.point.y, at.point.z, normal.x, normal.y, normal.z, u, v};
    const intv masks[2] = {to_int(at.on_mirror), to_int(ahead)};
    for (int lane = 0; lane < WIDTH; ++lane) {
        for (int i = 0; i < MET_FIELDS; ++i) met[i * n + first + lane] = ((const real *)&values[i])[lane];
        for (int i = 0; i < 2; ++i) marks[i * n + first + lane] = ((const int *)&masks[i])[lane] & 1;
    }
}
