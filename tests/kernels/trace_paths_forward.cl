// Test only: every forward path of some screen pixels, written out instead of being counted. Lengths in mm.
#include "path_forward.cl"
#include "detector.cl"

#define FIELDS 11

// Parameters: emitters [screen pixels]; sources [grid 0] screen pixel numbers; paths [grid 0][grid 1 x BLOCK][FIELDS]:
// where the line to the mirror crosses z = 0, mirror point in world coordinates, aperture position and slopes in the
// camera's frame, the unit disk's point; marks [same rays][3]: met the mirror, went through the aperture, detector pixel
// or -1.
// Grid: (sources, rays of each / BLOCK).
__kernel void trace_paths_forward(__constant Scene *scene, __global const real *tables, const Launch launch,
                                  __global const Emitter *emitters, __global const uint *sources,
                                  __global real *paths, __global int *marks) {
    const Emitter emitter = emitters[sources[get_global_id(0)]];
    const size_t block = get_global_id(0) * get_global_size(1) + get_global_id(1);
    Sampler sampler;
    Words words;
    sampler_begin(&sampler, &launch, sources[get_global_id(0)]);
    sampler_block(&sampler, launch.first_ray + get_global_id(1) * BLOCK, &words);
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Direction aim = forward_aim(&emitter, &words, v);
        const Line line = forward_emit(scene, &emitter, &aim, &words, v);
        Meeting met = mirror_meet(scene, tables, &line);
        mirror_deviate(scene, tables, &line, &met);
        maskv through, clipped;
        const Arrival at = forward_arrive(scene, &line, &met, &through, &clipped);
        realv disk_x, disk_y;
        unit_disk(ray_words(&words, FORWARD_AIM_RADIUS, v), ray_words(&words, FORWARD_AIM_ANGLE, v), &disk_x, &disk_y);
        const realv values[FIELDS] = {line.x0, line.y0, met.point.x, met.point.y, met.point.z,
                                      at.a, at.b, at.slope_a, at.slope_b, disk_x, disk_y};
        const intv masks[2] = {to_int(met.on_mirror), to_int(through)};
        for (int lane = 0; lane < WIDTH; ++lane) {
            const size_t j = block * BLOCK + v * WIDTH + lane;
            for (int i = 0; i < FIELDS; ++i) paths[j * FIELDS + i] = ((const real *)&values[i])[lane];
            for (int i = 0; i < 2; ++i) marks[3 * j + i] = (((const int *)&masks[i])[lane]) & 1;
            marks[3 * j + 2] = detector_pixel(scene, ((const real *)&at.a)[lane], ((const real *)&at.b)[lane],
                                              ((const real *)&at.slope_a)[lane], ((const real *)&at.slope_b)[lane]);
        }
    }
}
