// Non-sequential estimator: rays leave the screen, aimed at the mirror, and go from element to element in whatever order
// they meet them, until they end. What ends on the detector is kept by path and by class of path.
//
// ELEMENTS(DO) is the scene's list of elements, made on the host: DO(shape, kind, model, number) for each. shape: plane,
// quadric or deviated; kind: that of an interact_* file; model: that of a scatter_* file, or none.
#include "emission.cl"
#include "path_rng_*.cl"
#include "tally.cl"

// The rays that leave the screen, into the list. Their frame is the screen's group: small numbers.
INLINE void emit(const Trace *trace, const Emitter *emitter, const Words *words, const Words *keys, Rays *rays) {
    __constant Frame *screen = &trace->scene->screen;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Direction aim = forward_aim(emitter, words, v);
        const realv n = -real_sqrt(1 - aim.l * aim.l - aim.m * aim.m);
        const realv x = emitter->x + trace->scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_X, v));
        const realv y = emitter->y + trace->scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_Y, v));
        rays->x[v] = screen->axis_x[0] * x + screen->axis_y[0] * y;
        rays->y[v] = screen->axis_y[1] * y;
        rays->z[v] = screen->axis_x[2] * x + screen->axis_y[2] * y;
        rays->dx[v] = screen->axis_x[0] * aim.l + screen->axis_y[0] * aim.m + screen->axis_z[0] * n;
        rays->dy[v] = screen->axis_y[1] * aim.m + screen->axis_z[1] * n;
        rays->dz[v] = screen->axis_x[2] * aim.l + screen->axis_y[2] * aim.m + screen->axis_z[2] * n;
        rays->l1_norm[v] = l1_norm_of(rays->x[v], rays->y[v], rays->z[v]);
        rays->weight[v] = (realv)(emitter->aim_ll * emitter->aim_mm * trace->job->inverse_unit_area);
        rays->path_low[v] = rays->path_high[v] = (uintv)(0);
        rays->key[v] = ray_words(keys, 0, v);
        rays->group[v] = (intv)(trace->job->screen_group);
        rays->last[v] = (intv)(trace->job->screen_element);
        rays->before[v] = (intv)(-1);
        rays->bounces[v] = (intv)(0);
    }
}

INLINE Interaction interaction_begin(const Trace *trace, const Rays *rays, int v, const LocalRay *ray, int number) {
    Interaction at;
    at.along = at.goes = ray->along;
    at.arriving = rays->weight[v];
    at.weight = (realv)(1);
    at.absorbed = at.split = (realv)(0);
    at.event = (intv)(EVENT_NOMINAL);
    at.room = (intv)(stack_room(trace->stack));
    at.ends = to_mask(at.event != at.event);
    at.draw = path_word(rays->key[v], rays->path_low[v], rays->path_high[v], number);
    return at;
}

// The nearest element ahead of each ray of a list, and how far it is; NONE of a ray that escapes, ENDED of one that ended
// there.
typedef struct { realv step[BLOCK_VECTORS]; intv which[BLOCK_VECTORS]; } Nearest;
#define NONE (-1)
#define ENDED (-2)

// All elements in turn that rays may meet, each with all rays: in short loops a processor sees enough rays at a time. Their
// interactions are taken ray by ray again: two thirds of that rate in loops by element.
#define MEET(shape, kind, model, number) \
    if (may >> number & 1u) \
        for (int v = 0; v < vectors; ++v) \
            meet_##shape(&trace->elements[number], rays, v, number, &nearest->step[v], &nearest->which[v]);

#define INTERACT(shape, kind, model, number)                                                                 \
    {                                                                                                        \
        const maskv meets = to_mask(which == (number));                                                      \
        if ((may >> number & 1u) && any_lane(meets)) {                                                       \
            __constant Element *element = &trace->elements[number];                                          \
            const Offset offset = group_offset(element, rays->group[v]);                                     \
            const LocalRay ray = element_ray(element, rays, v, &offset);                                     \
            Interaction at = interaction_begin(trace, rays, v, &ray, number);                                \
            at.point = shape##_point(trace->scene, element, &ray, step);                                     \
            at.normal = shape##_normal(trace->scene, element, at.point);                                     \
            interact_##kind(element, &at);                                                                   \
            const realv left = model##_left(trace, number, &at);                                             \
            leave_##kind(element, rays, v, number, meets, element_bound(rays, v, &offset), step, &at);       \
            model##_part(trace, rays, v, number, meets, &at);                                                \
            rays->weight[v] = meets ? rays->weight[v] * left : rays->weight[v];                              \
            const maskv ended = tally_##kind(trace, rays, v, number, meets, &at, left);                     \
            after = to_int(ended) != 0 ? (intv)(ENDED) : after;                                              \
        }                                                                                                    \
    }

// may: a bit for each element that they may meet.
INLINE void find_nearest(const Trace *trace, const Rays *rays, int count, uint may, Nearest *nearest) {
    const int vectors = (count + WIDTH - 1) / WIDTH;
    for (int v = 0; v < vectors; ++v) {
        nearest->step[v] = (realv)(INFINITY);
        nearest->which[v] = (intv)(NONE);
    }
    ELEMENTS(MEET)
    const intv beyond = as_intv(lane_index()) + (vectors - 1) * WIDTH;   // of the list's end
    nearest->which[vectors - 1] = beyond < count ? nearest->which[vectors - 1] : (intv)(ENDED);
}

// The rays of vector v through their elements. Returns those that go on, as mask_word gives them; others are counted.
INLINE ulong step_rays(const Trace *trace, Rays *rays, int v, uint may, realv step, intv which) {
    intv after = which;
    ELEMENTS(INTERACT)
    rays->bounces[v] = rays->bounces[v] + 1;
    const maskv goes = to_mask(after >= 0), tired = goes & to_mask(rays->bounces[v] >= trace->job->bounce_limit);
    const maskv escaped = to_mask(which == NONE);
    count_rays(trace, PATH_ESCAPED, lanes_in(escaped));
    count_rays(trace, PATH_BOUNCE_LIMIT, lanes_in(tired));
    count_weight(trace, trace->job->element_count, escaped, rays->weight[v]);
    count_weight(trace, trace->job->element_count + 1, tired, rays->weight[v]);
    return mask_word(goes & !tired);
}

// All rays of the list to their ends; after each step the list closes up.
INLINE void trace_rays(const Trace *trace, Rays *rays, int count) {
    Nearest nearest;
    const int known = sizeof(trace->job->may) / sizeof(trace->job->may[0]);
    int step = 0;
    while ((count = stack_pop(trace->stack, rays, count)) > 0) {
        int left = 0;
        const uint may = step < known ? trace->job->may[step++] : ~0u;
        find_nearest(trace, rays, count, may, &nearest);
        for (int v = 0; v * WIDTH < count; ++v) {
            const ulong alive = step_rays(trace, rays, v, may, nearest.step[v], nearest.which[v]);
            if (alive == ALL_LANES && left == v * WIDTH) left += WIDTH;   // they are where they belong
            else   // in ascending order: none is overwritten before it was copied
                for (int part = 0; part < LANE_PARTS; ++part)
                    for (ulong lanes = alive >> part & LANE_PART; lanes != 0; lanes &= lanes - 1)
                        ray_copy(rays, left++, rays, v * WIDTH + 8 * part + lowest_lane(lanes));
        }
        count = left;
    }
}

// Parameters: as members of Trace. Grid: (screen pixels of this launch, parts of its rays).
// Assumes: sums, images and the first word of found zeroed before the replicate's first launch.
__kernel void trace_paths(__constant Scene *scene, const Launch launch, __global const Emitter *emitters,
                          __constant Element *elements, __constant Scatter *scatter, __global const Path *paths,
                          __global uint *sums, __global uint *images, __global uint *found, const PathJob job) {
    const uint source = launch.first_source + get_global_id(0);
    const ulong begin = launch.first_ray + get_global_id(1) * launch.rays_per_item;
    const ulong end = min(begin + launch.rays_per_item, launch.first_ray + launch.ray_count);
    const int sums_size = PATH_ABSORBED + 2 * job.element_count + 2 + 2 * job.path_count;
    ulong own[MAX_SUMS];
    for (int k = 0; k < sums_size; ++k) own[k] = 0;
    RayStack stack;
    stack_begin(&stack);
    const Trace trace = {scene, elements, scatter, &launch, paths, sums, images, found, &job, &stack, own,
                         source % launch.screen_columns, source / launch.screen_columns};
    const Emitter emitter = emitters[source];
    Sampler sampler;
    sampler_begin(&sampler, &launch, source);
    Words words, keys;
    Rays rays;
    for (ulong first = begin; first < end; first += BLOCK) {
        sampler_block(&sampler, first, &words);
        path_keys(&launch, source, first, &keys);
        emit(&trace, &emitter, &words, &keys, &rays);
        trace_rays(&trace, &rays, (int)min(end - first, (ulong)(BLOCK)));
    }
    own[PATH_FAILED] += stack_lost(&stack);
    for (int k = 0; k < sums_size; ++k)
        if (own[k] != 0) sum64_add(sums, k, own[k]);
}
