// Test only: every adjoint path of some detector pixels, written out instead of being summed. Lengths in mm.
#include "path_adjoint.cl"

#define FIELDS 10

// Parameters: receivers [visible_pixels]; chosen [grid 0] visible_pixels; paths [grid 0][grid 1 x BLOCK][FIELDS]: where the line to the
// mirror crosses z = 0, mirror point in world coordinates, screen position in the screen's frame, weight, the unit disk's
// point; marks [same rays][2]: met the mirror, runs towards the screen.
// Grid: (visible_pixels chosen, rays of each / BLOCK).
__kernel void trace_paths_adjoint(__constant Scene *scene, __global const real *tables, const Launch launch,
                                  __global const Receiver *receivers, __global const uint *chosen,
                                  __global real *paths, __global int *marks) {
    const Receiver receiver = receivers[chosen[get_global_id(0)]];
    const size_t block = get_global_id(0) * get_global_size(1) + get_global_id(1);
    Sampler sampler;
    Words words;
    sampler_begin(&sampler, &launch, receiver.pixel);
    sampler_block(&sampler, launch.first_ray + get_global_id(1) * BLOCK, &words);
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        realv weight, at_u, at_v, disk_x, disk_y;
        const Line line = adjoint_emit(scene, &receiver, &words, v, &weight);
        Meeting met = mirror_meet(scene, tables, &line);
        mirror_deviate(scene, tables, &line, &met);
        const maskv ahead = adjoint_arrive(scene, &receiver, &line, &met, &at_u, &at_v);
        unit_disk(ray_words(&words, ADJOINT_APERTURE_RADIUS, v), ray_words(&words, ADJOINT_APERTURE_ANGLE, v),
                  &disk_x, &disk_y);
        const realv values[FIELDS] = {line.x0, line.y0, met.point.x, met.point.y, met.point.z, at_u, at_v, weight,
                                      disk_x, disk_y};
        const intv masks[2] = {to_int(met.on_mirror), to_int(ahead)};
        for (int lane = 0; lane < WIDTH; ++lane) {
            const size_t j = block * BLOCK + v * WIDTH + lane;
            for (int i = 0; i < FIELDS; ++i) paths[j * FIELDS + i] = ((const real *)&values[i])[lane];
            for (int i = 0; i < 2; ++i) marks[2 * j + i] = (((const int *)&masks[i])[lane]) & 1;
        }
    }
}
