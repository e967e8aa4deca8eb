// A ray that splits from another at an element. Frame: the world.
#include "tally.cl"

// Splits a ray from ray k of vector v, which has just left with event `event`. The new ray has event `as`, a direction
// `along` in the world, its own weight and light.
INLINE void split_ray(const Trace *trace, const Rays *rays, int v, int k, vec3s along, real weight, int event, int as,
                      StokesOne light) {
    ++trace->own[PATH_SPLIT];
    if (((const int *)&rays->bounces[v])[k] + 1 >= trace->job->bounce_limit) {
        count_rays(trace, PATH_BOUNCE_LIMIT, 1);
        return count_weight_of(trace, trace->job->element_count + 1, weight);
    }
    int place;
    Rays *waiting = stack_push(trace->stack, rays, v * WIDTH + k, &place);
    ((real *)waiting->dx)[place] = along.x;
    ((real *)waiting->dy)[place] = along.y;
    ((real *)waiting->dz)[place] = along.z;
    ((real *)waiting->weight)[place] = weight;
    ((uint *)waiting->path[0])[place] += as - event;
    light_put(waiting, place, light);
}
