// A scattering mirror's rays: those that end there, and the new ones towards the camera.
#include "finish.cl"
#include "interact_scattering.cl"

INLINE maskv finish_scattering(const Trace *trace, const Rays *rays, int v, int number, maskv meets, const Interaction *at) {
    __constant Element *element = &trace->elements[number];
    const maskv ended = meets & at->ends;
    count_rays(trace, PATH_ABSORBED + number, lanes_in(ended));
    __constant real *x = element->axis_x, *y = element->axis_y, *z = element->axis_z;
    const vec3v n = at->normal;
    const vec3v normal = {x[0] * n.x + y[0] * n.y + z[0] * n.z, x[1] * n.x + y[1] * n.y + z[1] * n.z,
                          x[2] * n.x + y[2] * n.y + z[2] * n.z};
    const uintv low = rays->path_low[v], high = rays->path_high[v];
    const Aimed aimed = aim_at_camera(trace->scene, trace->job, element, rays, v, low, high, normal);
    const maskv chosen = meets & !ended & (aimed.weight > 0) &
                         (uniform_open(path_word(rays->key[v], low, high, USE_SCATTER)) < element->scatter_chance);
    for (ulong lanes = mask_word(chosen); lanes != 0; lanes &= lanes - 1) {
        const int k = lowest_lane(lanes), place = spawn_copy(trace->spawned, rays, v * WIDTH + k);
        Rays *waiting = &trace->spawned->rays;
        ((real *)waiting->dx)[place] = ((const real *)&aimed.along.x)[k];
        ((real *)waiting->dy)[place] = ((const real *)&aimed.along.y)[k];
        ((real *)waiting->dz)[place] = ((const real *)&aimed.along.z)[k];
        ((real *)waiting->weight)[place] *= ((const real *)&aimed.weight)[k] / element->scatter_chance *
                                            scatter_bsdf(element, ((const real *)&aimed.distance2)[k]);
        ((uint *)waiting->path_low)[place] += EVENT_SCATTER;
        ++trace->own[PATH_PARTED];
    }
    return ended;
}
